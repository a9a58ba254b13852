"""The page of speed and its charts, from the results files and nothing else."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from string import Template

import numpy as np
from interleaved import Row
from speed_figures import accuracy, duration, sizes, style
from workloads import FAMILIES, SIZES

# What the README shows of the first chart.
CHOSEN = [
    "box deep", "box on ground", "h50", "i1280 shallow", "i5120 deep", "box sliver", "ball at box corner",
    "crossing cylinders",
]  # fmt: skip

# Times as fast as manifold3d on meshes made before, for a single call and for a pair of a batch: what was aimed at.
TARGETS: dict[str, tuple[float, float | None]] = {
    "box deep": (60, 110),
    "box sliver": (40, 80),
    "box on ground": (30, 80),
    "tetra": (30, 80),
    "h20": (20, None),
    "h50": (18, None),
    "h100": (10, None),
    "h500": (6, None),
    "i320 deep": (5, None),
    "i320 shallow": (15, None),
    "i1280 deep": (4, None),
    "i1280 shallow": (25, None),
    "i5120 deep": (3, None),
    "i5120 shallow": (35, None),
    "prism 64 and box": (60, None),
}

# Beyond this, a method that has no setting for its accuracy is wrong, not inexact.
WRONG = 1e-6


def write_page(results: Path, folder: Path, rows: list[Row], notes: list[str]) -> Path:
    """`results` is the folder that the rows come from, as the page names it."""
    folder.mkdir(parents=True, exist_ok=True)
    style()
    at_hand = {row.family for row in rows}
    families = [name for name in FAMILIES if name in at_hand]
    if families:
        accuracy(rows, [name for name in CHOSEN if name in at_hand] or families, 4, folder / "speed.png")
        accuracy(rows, families, 4, folder / "speed_families.png", folder / "speed.html")
    lines = {way: by_size(rows, way) for way in ("deep", "shallow")}
    if all(lines.values()):
        sizes(lines, {way: slopes_of(methods) for way, methods in lines.items()}, folder / "speed_sizes.png")
    page = folder / "speed.md"
    page.write_text(text(results, rows, notes, lines), encoding="utf-8")
    return page


def find(rows: Iterable[Row], family: str, method: str, setting: str | None = None) -> Row | None:
    """The row that has a time; the first if no setting is named."""
    found = (row for row in rows if row.family == family and row.method == method and row.us)
    return next((row for row in found if setting in (None, row.setting)), None)


def best(rows: Iterable[Row], family: str, method: str) -> Row | None:
    """At the setting that is a method's default or needs least to be done."""
    setting = {"auto": "0.001", "manifold3d": "prebuilt", "scipy": "point given"}.get(method)
    return find(rows, family, method, setting)


# Time over size


def by_size(rows: list[Row], way: str) -> dict[str, list[tuple[float, float]]]:
    methods = ("auto", "auto, batch", "paper", "scipy", "manifold3d", "trimesh")
    lines = {}
    for name in methods:
        found = [(size, best(rows, f"i{size} {way}", name)) for size in SIZES]
        points = [(float(size), float(row.us)) for size, row in found if row]
        if points:
            lines[name] = points
    return lines


def slopes_of(lines: dict[str, list[tuple[float, float]]]) -> dict[str, float]:
    """The power of the facets with which time grows, from 320 facets."""
    return {name: slope(points) for name, points in lines.items() if sum(x >= 320 for x, _ in points) > 2}


def slope(points: list[tuple[float, float]]) -> float:
    x, y = np.log([point for point in points if point[0] >= 320]).T
    return float(np.polyfit(x, y, 1)[0])


# Words


def text(results: Path, rows: list[Row], notes: list[str], lines: dict) -> str:
    template = (Path(__file__).parent / "speed_page.md").read_text(encoding="utf-8")
    pairs = {row.family: row.pairs for row in rows if row.method == "auto"}
    parts = {
        "families": str(len(pairs)),
        "pairs": str(sum(pairs.values())),
        "targets": targets(rows),
        "wrong": wrong(rows),
        "slopes": slope_table(lines),
        "per_facet": per_facet(rows),
        "warm": warm(rows),
        "missing": missing(rows),
        "results": str(results),
        "notes": "\n".join(f"    {line}" for line in notes),
    }
    return Template(template).substitute(parts)


def table(heading: list[str], lines: Iterable[Iterable[str]]) -> str:
    rule = "|---|" + "--:|" * (len(heading) - 1)
    return "\n".join([f"| {' | '.join(heading)} |", rule, *(f"| {' | '.join(line)} |" for line in lines)])


def targets(rows: list[Row]) -> str:
    lines = []
    for family, (aim, aim_batch) in TARGETS.items():
        peer, alone, many = (best(rows, family, name) for name in ("manifold3d", "auto", "auto, batch"))
        if not (peer and alone):
            continue
        cells = [family, duration(float(peer.us)), duration(float(alone.us)), held(peer, alone, aim)]
        cells += [duration(float(many.us)), held(peer, many, aim_batch)] if many else ["", ""]
        lines.append(cells)
    return table(["", "manifold3d", "a call", "times faster (aim)", "a pair of a batch", "times faster (aim)"], lines)


def held(peer: Row, ours: Row, aim: float | None) -> str:
    """Times faster, in bold where it reaches the aim."""
    ratio = float(peer.us) / float(ours.us)
    said = f"{ratio:.0f}" if ratio >= 10 else f"{ratio:.1f}"
    if aim is None:
        return said
    return f"**{said}** ({aim:g})" if ratio >= aim else f"{said} ({aim:g})"


def warm(rows: list[Row]) -> str:
    lines = []
    for family in [*TARGETS, "boxes apart"]:
        cold, again = best(rows, family, "auto, batch"), best(rows, family, "auto, warm batch")
        if cold and again:
            ratio = float(cold.us) / float(again.us)
            lines.append([family, duration(float(cold.us)), duration(float(again.us)), f"{ratio:.2f}"])
    return table(["", "first call", "the next, a little moved", "times faster"], lines)


def wrong(rows: list[Row]) -> str:
    """Who answered beside the truth without having been asked for less."""
    off: dict[str, list[Row]] = {}
    for row in rows:
        inexact = row.method in ("auto, warm batch", "Monte Carlo", "voxels") or not row.facets
        if row.error and not inexact and float(row.error) > WRONG:
            off.setdefault(" ".join(filter(None, (row.method, row.setting))), []).append(row)
    if not off:
        return "Among the polyhedra, nobody is off by more than 1e-6."
    lines = []
    for name, found in sorted(off.items(), key=lambda item: -max(float(row.error) for row in item[1])):
        worst = sorted(found, key=lambda row: -float(row.error))
        said = ", ".join(f"{row.family} {float(row.error):.0e}" for row in worst[:4])
        lines.append([name, str(len(found)), said + (", ..." if len(worst) > 4 else "")])
    return table(["", "families", "relative error, the worst first"], lines)


def slope_table(lines: dict[str, dict]) -> str:
    slopes = {way: slopes_of(methods) for way, methods in lines.items()}
    names = [name for name in lines["deep"] if any(name in found for found in slopes.values())]
    shown = [[name, *(f"{slopes[way][name]:.2f}" if name in slopes[way] else "" for way in lines)] for name in names]
    return table(["time grows with the facets to the power of", *lines], shown)


def per_facet(rows: list[Row]) -> str:
    """What a facet of the answer costs in shallow pairs, over the size of the meshes."""
    lines = []
    for size in SIZES:
        alone, many = (best(rows, f"i{size} shallow", name) for name in ("auto", "auto, batch"))
        if alone and many:
            facets = float(alone.facets)
            costs = [f"{float(row.us) / facets:.2f} µs" for row in (alone, many)]
            lines.append([f"{size:,}", f"{facets:.3g}", *costs])
    return table(["facets of either mesh", "facets in common", "a facet, by a call", "by a batch"], lines)


def missing(rows: list[Row]) -> str:
    notes: dict[str, list[str]] = {}
    for row in rows:
        if row.note and not row.us:
            name = " ".join(filter(None, (row.method, row.setting)))
            notes.setdefault(f"{name}: {row.note}", []).append(row.family)
    lines = [f"- {note} ({', '.join(families)})" for note, families in sorted(notes.items())]
    return "\n".join(lines) or "Everybody was asked everything."
