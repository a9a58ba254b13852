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
from numpy.typing import NDArray

from overlapper.simulation.settings import Asking, Modelling, settings_of
from overlapper.sweep import charts
from overlapper.sweep.comparison import Comparison
from overlapper.sweep.left_out import LeftOut
from overlapper.sweep.part import FAILURES, TASKS
from overlapper.sweep.points import array_of
from overlapper.sweep.store import Store
from overlapper.sweep.sweep import Sweep
from overlapper.tables.outputs import recorder
from overlapper.viewer.page_text import filled
from overlapper.whole_file import beside

TEMPLATE = Path(__file__).parent / "summary.html"

WORST = 10

# Only the first parameters, at most this many, are drawn, so that the page stays short.
DRAWN = 5

MOVED = charts.Measure("moved", "tasks that moved, %", 100.0)

Row = Mapping[str, Any]
Columns = Mapping[str, NDArray[Any]]


def write(
    sweep: Sweep,
    store: Store,
    scene: str,
    pages: int = 0,
    comparison: Comparison | None = None,
) -> Path | None:
    """Write the summary of the finished tasks of a sweep, and return its path; None if no task is finished.

    `scene` is the name or path of the scene in commands. The pages of the `pages` worst tasks are written, too. With a
    `comparison`, the summary shows which tasks have moved.
    """
    forces = [charts.FORCE] * (sweep.study.contact == "volumetric")
    measures = [*charts.MEASURES, *forces]
    stored = [name for each in measures for name in _stored(each)]
    numbers, columns = store.columns(TASKS, sweep, [*sweep.points[0], *stored])
    if not len(numbers):
        return None
    largest = np.lexsort((numbers, -columns["largest_volume_m3"]))[: max(WORST, pages)]
    worst = store.rows_of(TASKS, sweep, numbers[largest].tolist())
    for row in worst[:pages]:
        _show(sweep, row, store.folder / _view(row))
    varied = _varied({name: columns[name] for name in sweep.points[0]})
    opening = [_opening(sweep, columns, varied), *LeftOut.of(sweep, store).lines()]
    place = store.folder / "summary.html"
    texts = {
        "title": html.escape(f"Sweep of {sweep.study.scene}"),
        "opening": html.escape(" ".join(opening)),
        "moved": "\n".join(_moved(sweep, comparison)) if comparison else "",
        "worst": _worst(sweep, store, scene, worst),
        "failed": _failed(sweep, store),
        "charts": "\n".join(_charts(columns, varied, measures)),
        "settings": _table((name, value) for name, value in sweep.study.identity().items()),
    }
    with beside(place) as begun:
        begun.write_text(filled(TEMPLATE, texts), encoding="utf-8")
    return place


def _stored(measure: charts.Measure) -> list[str]:
    """The columns of the table that a measure is drawn from."""
    return [f"mean_force_{axis}_m2" for axis in "xyz"] if measure.column == "mean_force_m2" else [measure.column]


def _opening(sweep: Sweep, columns: Columns, varied: Mapping[str, int]) -> str:
    volumes = columns["largest_volume_m3"]
    told = ", ".join(f"{name} ({count:,})" for name, count in varied.items())
    over = f" over {told}" if told else ""
    touched = int((volumes > 0).sum())
    return f"{len(volumes):,} of {len(sweep):,} tasks are done{over}. Something overlaps in {touched:,} of them."


def _varied(columns: Columns) -> dict[str, int]:
    """The number of values of each parameter with more than one value. A parameter called seed comes last."""
    counts = {name: len(np.unique(values)) for name, values in columns.items()}
    return {name: counts[name] for name in sorted(counts, key=lambda name: name == "seed") if counts[name] > 1}


def _view(row: Row) -> Path:
    return Path("views", f"{row['task'][:12]}.html")


def _show(sweep: Sweep, row: Row, place: Path) -> None:
    """Write the page of a task: the same page that the command beside it writes."""
    place.parent.mkdir(exist_ok=True)
    parameters = {name: row[name] for name in sweep.points[0]}
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
    varied = _varied({name: array_of([row[name] for row in worst]) for name in sweep.points[0]})
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
        there = (store.folder / place).exists()
        link = f'<a href="{place.as_posix()}#t={moment:.6g}">{place.name}</a><br>' if there else ""
        how = html.escape(command(sweep, scene, row, store.folder / place))
        lines.append(
            f'<tr>{shown}<td>{html.escape(pair)}</td><td class="number">{row["worst_step"] or ""}</td>'
            f"<td>{link}<code>{how}</code></td></tr>"
        )
    return "\n".join(lines)


def _moved(sweep: Sweep, comparison: Comparison) -> Iterable[str]:
    """The changes since another sweep: their number, their distribution over the parameters, and the worst tasks."""
    first, *more = comparison.lines(0)
    said = " ".join([first, *(line for line in more if not line.startswith(" "))])
    yield f"<h2>What has moved</h2><p>{html.escape(said)}</p>"
    if not comparison.worst:
        return
    over = {name: sweep.points.values(name, comparison.numbers) for name in sweep.points[0]}
    varied = [*_varied(over)]
    heading = [*varied, "measure", "recorded", "now", "times its budget"]
    lines = ["<tr>" + "".join(f"<th>{html.escape(name)}</th>" for name in heading) + "</tr>"]
    for worst in comparison.worst[:WORST]:
        part = f"{worst.part:.3g}" if math.isfinite(worst.part) else ""
        cells = [_figure(worst.parameters[name]) for name in varied]
        cells += [worst.measure, worst.recorded, worst.found, part]
        lines.append("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in cells) + "</tr>")
    yield f'<div class="wide"><table>{"".join(lines)}</table></div>'
    columns = [(MOVED, (comparison.parts > 1).astype(float))]
    for measure in charts.MEASURES:
        if measure.column in comparison.differences:
            change = replace(measure, label=f"change of {measure.label}")
            columns.append((change, comparison.differences[measure.column]))
    axes = [charts.axis(name, over[name]) for name in varied[:DRAWN]]
    if axes:
        means = (
            "Line: the mean of all tasks with a value. Band: from the least to the largest. "
            "A measure is not drawn where a task failed."
        )
        yield f'<h2>Where it has moved</h2><p class="quiet">{means}</p>'
    for axis in axes:
        yield charts.lines(axis, columns, np.mean)
    for across, up in combinations((axis for axis in axes if axis.name != "seed"), 2):
        yield charts.heat_map(across, up, columns, np.mean)


def _failed(sweep: Sweep, store: Store) -> str:
    numbers, columns = store.columns(FAILURES, sweep, ["what"])
    if not len(numbers):
        return ""
    kinds, counts = np.unique(columns["what"], return_counts=True)
    counted = ", ".join(f"{count:,} {what}" for what, count in zip(kinds, counts))
    rows = store.rows_of(FAILURES, sweep, numbers[:WORST].tolist())
    names = sweep.points[0]
    shown = (
        (", ".join(f"{name}={_figure(row[name])}" for name in names), f"{row['what']}: {row['sentence']}")
        for row in rows
    )
    more = f"<p>{len(numbers) - WORST:,} more are in {FAILURES}.parquet.</p>" if len(numbers) > WORST else ""
    return f'<h2>Failed: {counted}</h2><div class="wide"><table>{_table(shown)}</table></div>{more}'


def _charts(columns: Columns, varied: Iterable[str], measures: Sequence[charts.Measure]) -> Iterable[str]:
    varied = [*varied]
    if not varied:
        return
    drawn = [(each, _measured(columns, each)) for each in measures]
    axes = [charts.axis(name, columns[name]) for name in varied[:DRAWN]]
    yield "<h2>Over each parameter</h2>"
    yield '<p class="quiet">Line: the median of all tasks with that value. Band: from the least to the largest.</p>'
    for axis in axes:
        yield charts.lines(axis, drawn)
    pairs = [*combinations((axis for axis in axes if axis.name != "seed"), 2)]
    if pairs:
        yield '<h2>Over two parameters</h2><p class="quiet">The median of all tasks with these values.</p>'
    for across, up in pairs:
        yield charts.heat_map(across, up, drawn[:2])
    if len(varied) > DRAWN:
        yield f"<p>Not drawn: {html.escape(', '.join(varied[DRAWN:]))}.</p>"


def _measured(columns: Columns, measure: charts.Measure) -> NDArray[np.float64]:
    values = [columns[name] for name in _stored(measure)]
    return values[0] if len(values) == 1 else np.linalg.norm(values, axis=0)


def _figure(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _table(rows: Iterable[tuple[str, Any]]) -> str:
    return "".join(f"<tr><td>{html.escape(name)}</td><td>{html.escape(str(value))}</td></tr>" for name, value in rows)
