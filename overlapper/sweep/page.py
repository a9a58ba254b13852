"""The summary of a sweep: one page that needs no network."""

from __future__ import annotations

import html
import math
import shlex
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from overlapper.simulation.settings import Asking, Modelling, settings_of
from overlapper.sweep import charts
from overlapper.sweep.comparison import Comparison, mean_force
from overlapper.sweep.left_out import LeftOut
from overlapper.sweep.part import FAILURES, TASKS
from overlapper.sweep.store import Store
from overlapper.sweep.sweep import Sweep
from overlapper.tables.outputs import recorder
from overlapper.viewer.page_text import filled
from overlapper.whole_file import beside

TEMPLATE = Path(__file__).parent / "summary.html"

WORST = 10

# Parameters drawn at most, the first ones: of more, a page of pictures would be no summary.
DRAWN = 5

MOVED = charts.Measure("moved", "tasks that moved, %", 100.0)

Row = Mapping[str, Any]


def write(
    sweep: Sweep,
    store: Store,
    scene: str,
    pages: int = 0,
    comparison: Comparison | None = None,
) -> Path:
    """Write the summary of the tasks of a sweep that are done, at least one; returns where.

    `scene` is the name or path that commands give to it. Of the `pages` worst tasks the pages are written, too. With a
    `comparison`, it shows what has moved.
    """
    rows = [row for row in store.rows(TASKS) if row["task"] in sweep.tasks]
    worst = sorted(rows, key=lambda row: (-row["largest_volume_m3"], row["task"]))[: max(WORST, pages)]
    for row in worst[:pages]:
        _show(sweep, row, store.folder / _view(row))
    opening = [_opening(sweep, rows), *LeftOut.of(sweep, rows).lines()]
    place = store.folder / "summary.html"
    texts = {
        "title": html.escape(f"Sweep of {sweep.study.scene}"),
        "opening": html.escape(" ".join(opening)),
        "moved": "\n".join(_moved(sweep, comparison)) if comparison else "",
        "worst": _worst(sweep, store, scene, worst),
        "failed": _failed(sweep, store),
        "charts": "\n".join(_charts(sweep, rows)),
        "settings": _table((name, value) for name, value in sweep.study.identity().items()),
    }
    with beside(place) as begun:
        begun.write_text(filled(TEMPLATE, texts), encoding="utf-8")
    return place


def _opening(sweep: Sweep, rows: Sequence[Row]) -> str:
    touched = sum(row["largest_volume_m3"] > 0 for row in rows)
    varied = ", ".join(f"{name} ({len({row[name] for row in rows}):,})" for name in _varied(sweep, rows))
    over = f" over {varied}" if varied else ""
    return f"{len(rows):,} of {len(sweep.tasks):,} tasks are done{over}. Something overlaps in {touched:,} of them."


def _varied(sweep: Sweep, rows: Sequence[Row]) -> list[str]:
    """The parameters that have more than one value, one that is called seed last."""
    names = next(iter(sweep.tasks.values())).parameters
    varied = [name for name in names if len({row[name] for row in rows}) > 1]
    return sorted(varied, key=lambda name: name == "seed")


def _view(row: Row) -> Path:
    return Path("views", f"{row['task'][:12]}.html")


def _show(sweep: Sweep, row: Row, place: Path) -> None:
    """The page of a task, as the command beside it writes it."""
    place.parent.mkdir(exist_ok=True)
    parameters = sweep.tasks[row["task"]].parameters
    with recorder(place, []) as record, closing(sweep.study.frames(parameters)) as frames:
        for frame in frames:
            record(frame)


def command(sweep: Sweep, scene: str, row: Row, place: Path) -> str:
    """The shell command that writes the page of a task."""
    study, settings = sweep.study, sweep.study.settings
    defaults = study.loaded()
    words = [f"--set={name}={row[name]}" for name, value in defaults.parameters.items() if row[name] != value]
    for name, value in (("steps", defaults.steps), ("contact", defaults.contact)):
        if settings[name] != value:
            words.append(f"--{name}={settings[name]}")
    others = [
        f"--{name.replace('_', '-')}={settings[name]}"
        for name, value in settings_of(Asking(), Modelling()).items()  # of `overlapper view`
        if settings[name] != value
    ]
    return shlex.join(["overlapper", "run" if others else "view", scene, *words, *others, f"--html={place}"])


def _worst(sweep: Sweep, store: Store, scene: str, worst: Sequence[Row]) -> str:
    varied = _varied(sweep, worst)
    heading = [*varied, "volume, cm³", "depth, mm", "pair", "step", "page"]
    cells = "".join(f"<th>{html.escape(name)}</th>" for name in heading)
    lines = [f"<tr>{cells}</tr>"]
    for row in worst[:WORST]:
        pair = " – ".join(filter(None, (row["worstA"], row["worstB"])))
        figures = [*(_figure(row[name]) for name in varied)]
        figures += [_figure(1e6 * row["largest_volume_m3"]), _figure(1e3 * row["largest_depth_m"])]
        shown = "".join(f'<td class="number">{html.escape(each)}</td>' for each in figures)
        moment = (row["worst_step"] or 1) * row["time_s"] / row["steps"]
        place = _view(row)
        link = f'<a href="{place.as_posix()}#t={moment:.6g}">{place.name}</a>'
        how = html.escape(command(sweep, scene, row, store.folder / place))
        lines.append(
            f'<tr>{shown}<td>{html.escape(pair)}</td><td class="number">{row["worst_step"] or ""}</td>'
            f"<td>{link}<br><code>{how}</code></td></tr>"
        )
    return "\n".join(lines)


def _moved(sweep: Sweep, comparison: Comparison) -> Iterable[str]:
    """The changes since another sweep: how many, where over the parameters, and the worst tasks."""
    first, *more = comparison.lines(0)
    said = " ".join([first, *(line for line in more if not line.startswith(" "))])
    yield f"<h2>What has moved</h2><p>{html.escape(said)}</p>"
    if not comparison.moved:
        return
    varied = _varied(sweep, [task.found for task in comparison.tasks])
    heading = [*varied, "measure", "recorded", "now", "times its budget"]
    lines = ["<tr>" + "".join(f"<th>{html.escape(name)}</th>" for name in heading) + "</tr>"]
    for task in comparison.moved[:WORST]:
        worst = task.worst
        part = f"{worst.part:.3g}" if math.isfinite(worst.part) else ""
        cells = [*(_figure(task.found[name]) for name in varied), worst.measure, worst.recorded, worst.found, part]
        lines.append("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in cells) + "</tr>")
    yield f'<div class="wide"><table>{"".join(lines)}</table></div>'
    columns = [(MOVED, np.array([float(bool(task.changes)) for task in comparison.tasks]))]
    for measure in charts.MEASURES[:2]:
        change = replace(measure, label=f"change of {measure.label}")
        columns.append((change, np.array([task.difference(measure.column) for task in comparison.tasks])))
    axes = [charts.axis(name, [task.found[name] for task in comparison.tasks]) for name in varied[:DRAWN]]
    if axes:
        means = (
            "The mean of all tasks with a value, and the band that holds them; nothing of measures where one failed."
        )
        yield f'<h2>Where it has moved</h2><p class="quiet">{means}</p>'
    for axis in axes:
        yield charts.lines(axis, columns, np.mean)
    for across, up in combinations((axis for axis in axes if axis.name != "seed"), 2):
        yield charts.heat_map(across, up, columns, np.mean)


def _failed(sweep: Sweep, store: Store) -> str:
    rows = [row for row in store.rows(FAILURES) if row["task"] in sweep.tasks]
    if not rows:
        return ""
    kinds = {what: sum(row["what"] == what for row in rows) for what in sorted({row["what"] for row in rows})}
    counted = ", ".join(f"{count:,} {what}" for what, count in kinds.items())
    names = next(iter(sweep.tasks.values())).parameters
    shown = (
        (", ".join(f"{name}={_figure(row[name])}" for name in names), f"{row['what']}: {row['sentence']}")
        for row in rows[:WORST]
    )
    more = f"<p>{len(rows) - WORST:,} more are in {FAILURES}.parquet.</p>" if len(rows) > WORST else ""
    return f'<h2>Failed: {counted}</h2><div class="wide"><table>{_table(shown)}</table></div>{more}'


def _charts(sweep: Sweep, rows: Sequence[Row]) -> Iterable[str]:
    varied = _varied(sweep, rows)
    if not varied:
        return
    measures = [*charts.MEASURES, *[charts.FORCE] * (charts.FORCE.column in rows[0])]
    columns = {measure: np.array([_measured(row, measure.column) for row in rows]) for measure in measures}
    axes = [charts.axis(name, [row[name] for row in rows]) for name in varied[:DRAWN]]
    yield "<h2>Over each parameter</h2>"
    yield '<p class="quiet">Line: the median of all tasks with that value. Band: from the least to the largest.</p>'
    for axis in axes:
        yield charts.lines(axis, [*columns.items()])
    pairs = [*combinations((axis for axis in axes if axis.name != "seed"), 2)]
    if pairs:
        yield '<h2>Over two parameters</h2><p class="quiet">The median of all tasks with these values.</p>'
    for across, up in pairs:
        yield charts.heat_map(across, up, [*columns.items()][:2])
    if len(varied) > DRAWN:
        yield f"<p>Not drawn: {html.escape(', '.join(varied[DRAWN:]))}.</p>"


def _measured(row: Row, column: str) -> float:
    if column == "mean_force_m2":
        return float(np.linalg.norm(mean_force(row)))
    return float(row[column])


def _figure(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _table(rows: Iterable[tuple[str, Any]]) -> str:
    return "".join(f"<tr><td>{html.escape(name)}</td><td>{html.escape(str(value))}</td></tr>" for name, value in rows)
