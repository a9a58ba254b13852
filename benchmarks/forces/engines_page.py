"""The page about contact in four engines, docs/engines.md, and its chart, from the results file."""

from __future__ import annotations

import math
from pathlib import Path

from forces.engines import EXPERIMENTS, FALLING, LONGEST, SUBSTEPS
from harness import charts, results
from harness.charts import BOOK, INK, OURS, Panel, Series
from harness.page import indented, named, table, write

STYLES = {
    "volumetric": {"color": OURS, "marker": "o", "zorder": 3},
    "Bullet": {"color": INK, "marker": "x"},
    "MuJoCo": {"color": BOOK, "marker": "s"},
    "Drake": {"color": "#3a8f4c", "marker": "^"},
}
LEAST = 1e-15  # errors are drawn from here on
FALL = 0.01  # m; what sinks less has not fallen

Points = dict[tuple[str, str], list[tuple[int, float, float]]]  # by experiment and engine: substeps, error and ms


def read(path: Path) -> tuple[list[str], Points]:
    notes, rows = results.read(path)
    found: Points = {}
    for row in rows:
        point = int(row["substeps"]), float(row["error"]), float(row["ms"])
        found.setdefault((row["experiment"], row["engine"]), []).append(point)
    return notes, found


def panel(name: str, found: Points) -> Panel:
    series = []
    for engine, style in STYLES.items():
        if points := valid(found, name, engine):
            y, x = zip(*points)
            series.append(Series(x, y, format="-", style={**style, "ms": 4, "lw": 1}))
    return Panel(
        EXPERIMENTS[name].title, series, {"xscale": "log", "yscale": "log", "ylim": (LEAST / 2, 3), "xlabel": "ms"}
    )


def cell(points: list[tuple[int, float, float]], substeps: int) -> str:
    for n, error, ms in points:
        if n == substeps:
            return "failed" if math.isnan(error) else f"{error:.1e} in {ms:,.0f}"
    return "–"


def beside(found: Points, peer: str) -> list[str] | None:
    """A row about a peer, if it was measured: in how many experiments is it less exact, more exact, and slower?"""
    names = [name for name in EXPERIMENTS if valid(found, name, peer) and valid(found, name, "volumetric")]
    if not names:
        return None
    less = more = slower = 0
    for name in names:
        ours, theirs = valid(found, name, "volumetric"), valid(found, name, peer)
        smallest, time = min(theirs)
        best = min(error for error, _ in ours)
        less += best < smallest
        more += smallest < best
        slower += min((ms for error, ms in ours if error <= smallest), default=math.inf) < time
    return [peer, *map(str, (len(names), less, more, slower))]


def valid(found: Points, name: str, engine: str) -> list[tuple[float, float]]:
    """Errors and milliseconds of the runs that did not fail."""
    return [(max(error, LEAST), ms) for _, error, ms in found.get((name, engine), []) if not math.isnan(error)]


def write_page(path: Path, folder: Path) -> Path:
    notes, found = read(path)
    key = [Series([], [], engine, style=style) for engine, style in STYLES.items()]
    panels = [panel(name, found) for name in EXPERIMENTS]
    charts.draw(folder / "engines.png", panels, (13, 12), columns=4, key=key, colours=64)
    rows = [
        [f"{EXPERIMENTS[name].title}", engine, *(cell(found[name, engine], n) for n in SUBSTEPS)]
        for name in EXPERIMENTS
        for engine in STYLES
        if (name, engine) in found
    ]
    fallen = {
        engine: all(found[name, engine][0][1] > FALL for name in FALLING if (name, engine) in found)
        for engine in STYLES
        if any((name, engine) in found for name in FALLING)
    }
    peers = [row for peer in STYLES if peer != "volumetric" and (row := beside(found, peer))]
    return write(
        Path(__file__).with_suffix(".md"),
        folder / "engines.md",
        results=named(path),
        notes=indented(notes),
        table=table(["experiment", "engine", *(f"{n} substeps" for n in SUBSTEPS)], rows, left=2),
        longest=f"{LONGEST:.0f}",
        least=f"{LEAST:g}",
        beside=table(["engine", "experiments", "less exact", "more exact", "slower at equal error"], peers),
        fallen=", ".join(engine for engine, fell in fallen.items() if fell) or "none",
    )
