"""The page of speed and its charts, from the results files and nothing else."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from harness import charts, results
from harness.charts import Panel, Series
from harness.page import duration, filled, indented, named, table, times
from harness.peers import PEERS, TIMED, Look
from speed import groups
from speed.turns import Row
from speed.workloads import FAMILIES, SIZES

# The panels of the first chart that the README shows.
CHOSEN = [
    "box deep", "box on ground", "h50", "i1280 shallow", "i5120 deep", "box sliver", "ball at box corner",
    "crossing cylinders",
]  # fmt: skip

# The families of polyhedra, whose times are compared with those of manifold3d.
COMPARED = [*list(FAMILIES)[:15]]

# Beyond this, a method that has no setting for its accuracy is wrong, not inexact.
WRONG = 1e-6

# Where an answer without any error is drawn: below the half-ulp of 1e-16.
EXACT = 1e-17

LOOKS = {name: peer.look for name, peer in TIMED.items() if peer.look}


@dataclass(frozen=True)
class Results:
    """All that was measured, and the folder that it was read from, as the page names it."""

    folder: str
    notes: list[str]
    rows: list[Row]
    groups: list[groups.Row]


def results_in(folder: Path) -> Results:
    notes, rows = results.read(folder / "speed.csv")
    path = folder / "groups.csv"
    of_groups = results.read(path)[1] if path.exists() else []
    return Results(str(named(folder)), notes, [Row(**row) for row in rows], [groups.Row(**row) for row in of_groups])


def write_page(path: Path, folder: Path) -> Path:
    found = results_in(path.parent)
    at_hand = {row.family for row in found.rows}
    families = [name for name in FAMILIES if name in at_hand]
    if families:
        accuracy(found.rows, [name for name in CHOSEN if name in at_hand] or families, folder / "speed.png")
        accuracy(found.rows, families, folder / "speed_families.png")
    if panels := [panel for panel in panels_of(found) if panel.lines]:
        growth(panels, folder / "speed_sizes.png")
    page = folder / "speed.md"
    page.write_text(text(found), encoding="utf-8")
    return page


def find(rows: Iterable[Row], family: str, method: str, setting: str | None = None) -> Row | None:
    """The row that has a time; the first if no setting is named."""
    found = (row for row in rows if row.family == family and row.method == method and row.us)
    return next((row for row in found if setting in (None, row.setting)), None)


def best(rows: Iterable[Row], family: str, method: str) -> Row | None:
    """At the setting that is a method's default or needs least to be done."""
    setting = {"auto": "0.001", "manifold3d": "prebuilt", "scipy": "point given"}.get(method)
    return find(rows, family, method, setting)


# Error over time


def marks(look: Look) -> dict[str, object]:
    fill, edge, width = ("white", look.colour, 1.1) if look.hollow else (look.colour, "white", 0.6)
    return {"color": look.colour, "marker": look.marker, "ms": look.size, "mfc": fill, "mec": edge, "mew": width}


def accuracy(rows: list[Row], families: list[str], path: Path) -> None:
    """A panel for each family, every method at every setting a point."""
    lines = -(-len(families) // 4)
    key = [
        Series([], [], f"{name} (ours)" if look.ours else name, style=marks(look) | {"lw": float(look.joined)})
        for name, look in LOOKS.items()
    ]
    panels = [accuracy_panel(family, [row for row in rows if row.family == family]) for family in families]
    size = (9.8, 2.05 * lines + 1.1)
    charts.draw(path, panels, size, columns=4, key=key, dpi=170, colours=128, share=True)


def accuracy_panel(family: str, rows: list[Row]) -> Panel:
    series = []
    for name, look in LOOKS.items():
        found = [row for row in rows if row.method == name and row.us and row.error]
        x = [float(row.us) for row in found]
        y = [min(1.0, max(EXACT, float(row.error))) for row in found]
        style = marks(look) | {"lw": float(look.joined), "zorder": 3 + 2 * look.ours + look.joined, "clip_on": False}
        if found:
            series.append(Series(x, y, style=style))
    axes = {"xscale": "log", "yscale": "log", "xlim": (0.1, 3e7), "ylim": (3e-18, 8)}
    return Panel(
        family,
        series,
        axes | {"xlabel": "time per pair", "ylabel": "error, relative"},
        xticks={1e0: "1 µs", 1e2: "100 µs", 1e4: "10 ms", 1e6: "1 s"},
        yticks={EXACT: "none", 1e-12: "1e−12", 1e-8: "1e−8", 1e-4: "1e−4", 1: "1"},
    )


# Time by number of vertices


@dataclass(frozen=True)
class Growth:
    """A panel: for each method its points (size, µs), and the power of the size with which it grows, where fitted."""

    title: str
    along: str
    lines: dict[str, list[tuple[float, float]]]
    least: float  # the size from which on powers are fitted

    @property
    def powers(self) -> dict[str, float]:
        """The power of the size with which time grows, of methods with three points or more."""
        large = {name: [point for point in points if point[0] >= self.least] for name, points in self.lines.items()}
        return {name: power(points) for name, points in large.items() if len(points) > 2}


def power(points: list[tuple[float, float]]) -> float:
    x, y = np.log(points).T
    return float(np.polyfit(x, y, 1)[0])


def panels_of(found: Results) -> list[Growth]:
    return [by_size(found.rows, "deep"), by_size(found.rows, "shallow"), by_number(found.groups)]


def by_size(rows: list[Row], way: str) -> Growth:
    lines = {}
    for name in ("auto", "auto, batch", "paper", "scipy", "manifold3d", "trimesh"):
        found = [(float(size), float(row.us)) for size in SIZES if (row := best(rows, f"i{size} {way}", name))]
        lines |= {name: found} if found else {}
    return Growth(way, "facets of either mesh", lines, 320)


def by_number(rows: list[groups.Row]) -> Growth:
    lines: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        lines.setdefault(row.method, []).append((float(row.bodies), float(row.us)))
    return Growth("many bodies", f"bodies of {groups.VERTICES} vertices", lines, 8)


def growth(panels: list[Growth], path: Path) -> None:
    """Time over size, a line for each method, which is named with its power."""
    points = [point for panel in panels for line in panel.lines.values() for point in line]
    decades = 10.0 ** np.arange(np.floor(np.log10(min(us for _, us in points))), 9)
    top = max(us for _, us in points)
    charts.draw(path, [growth_panel(panel, {us: duration(us) for us in decades if us < 10 * top}) for panel in panels],
                (11, 4.2), dpi=170, colours=128)  # fmt: skip


def growth_panel(shown: Growth, decades: dict[float, str]) -> Panel:
    series = []
    for name, points in sorted(shown.lines.items(), key=lambda item: -item[1][-1][1]):
        look = LOOKS[name]
        said = f"{name}, {shown.powers[name]:.2f}" if name in shown.powers else name
        style = {"color": look.colour, "marker": look.marker, "ms": look.size, "lw": 2.2 if look.ours else 1.2}
        series.append(Series(*zip(*points), said, style=style))
    sizes = sorted({x for points in shown.lines.values() for x, _ in points})
    axes = {"xscale": "log", "yscale": "log", "xlabel": shown.along, "ylabel": "time"}
    ticks = {size: f"{size:,.0f}" for size in sizes}
    key = {"title": "grows with the power of", "loc": "upper left"}
    return Panel(
        shown.title,
        series,
        axes,
        xticks=ticks,
        yticks=decades,
        legend=key,
    )


# Words


def text(found: Results) -> str:
    rows = found.rows
    pairs = {row.family: int(row.pairs) for row in rows if row.method == "auto"}
    cores = re.search(r"(\d+) cores", " ".join(found.notes))
    return filled(
        Path(__file__).with_name("page.md"),
        families=len(pairs),
        pairs=sum(pairs.values()),
        processors=cores[1] if cores else "its",
        compared=compared(rows),
        wrong=wrong(rows),
        warm=warm(rows),
        results=found.folder,
        notes=indented(found.notes),
    )


def compared(rows: list[Row]) -> str:
    """Times of this package beside those of manifold3d."""
    lines = []
    for family in COMPARED:
        peer, alone, many = (best(rows, family, name) for name in ("manifold3d", "auto", "auto, batch"))
        if not (peer and alone):
            continue
        clock = find(rows, family, "manifold3d, by the clock", "prebuilt")
        cells = [family, duration(float(peer.us)), duration(float(clock.us)) if clock else ""]
        for ours in (alone, many):
            cells += [duration(float(ours.us)), times(float(peer.us) / float(ours.us))] if ours else ["", ""]
        depth = find(rows, family, "auto, depth")
        lines.append([*cells, duration(float(depth.us)) if depth else ""])
    heading = ["", "manifold3d", "by the clock", "a call", "times faster", "a pair of a batch", "times faster", "depth"]
    return table(heading, lines)


def warm(rows: list[Row]) -> str:
    lines = []
    for family in [*COMPARED, "boxes apart"]:
        cold, again = best(rows, family, "auto, batch"), best(rows, family, "auto, warm batch")
        if cold and again:
            us = float(cold.us), float(again.us)
            lines.append([family, *map(duration, us), f"{us[0] / us[1]:.2f}"])
    return table(["", "first call", "second call, 0.1 mm moved", "times faster"], lines)


def wrong(rows: list[Row]) -> str:
    """The methods that are off by more than `WRONG` at a setting that promises exact answers."""
    off: dict[str, list[Row]] = {}
    for row in rows:
        exact = row.facets and (row.method not in PEERS["volume"] or PEERS["volume"][row.method].exact)
        if row.error and exact and float(row.error) > WRONG:
            off.setdefault(" ".join(filter(None, (row.method, row.setting))), []).append(row)
    if not off:
        return "No method is off by more than 1e-6 on polyhedra."
    lines = []
    for name, found in sorted(off.items(), key=lambda item: -max(float(row.error) for row in item[1])):
        worst = sorted(found, key=lambda row: -float(row.error))
        said = ", ".join(f"{row.family} {float(row.error):.0e}" for row in worst[:4])
        lines.append([name, str(len(found)), said + (", ..." if len(worst) > 4 else "")])
    return table(["", "families", "relative error, the worst first"], lines)
