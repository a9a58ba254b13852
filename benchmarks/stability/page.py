"""The stability page and its pictures, from a results file and nothing else but the failing cases it names."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import islice
from math import ceil, log10
from pathlib import Path

import numpy as np
from matplotlib.colors import LinearSegmentedColormap

from harness import charts, results
from harness.charts import Cells, Panel
from harness.page import filled, indented, table
from harness.peers import NO_ANSWER, NOT_ASKED, OUT_OF_ITERATIONS, hard_cases
from stability import stress
from stability.judging import distance_column, error_of, failed

Row = dict[str, str]

GROUPS = {
    "general position": ("general",),
    "posed to 1 km away": ("posed", "posed_boxes"),
    "slivers": ("slivers", "posed_slivers"),
    "tilted slivers": ("tilted_slivers",),
    "touching": ("touching", "parallel_edges", "nearly_touching"),
    "shared planes": ("identical", "shared_planes", "shared_facets", "nested_flush", "cut_at_edges", "dual_pairs"),
    "needles and plates": ("needles_and_plates", "stacked_plates"),
    "tiny and huge": ("scaled", "tiny_in_huge"),
    "far from the origin": ("far_away",),
    "published failures": ("published",),
    "moments of a motion": ("sequences",),
    "round hulls": ("round_hulls", "prisms", "pole_slivers"),
    "round bodies": ("round_contacts",),
    "several bodies": ("compounds", "many_bodies", "crowds", "empty_triples", "slender_groups"),
}

# The meaning of a family's parameter, for families whose cases run over many decades of it.
DEGENERACIES = {
    "slivers": "depth of the overlap, in sizes",
    "tilted_slivers": "tilt of one body, in radians",
    "nearly_touching": "gap or depth, in sizes",
    "needles_and_plates": "aspect ratio",
    "far_away": "distance from the origin, in sizes",
    "scaled": "size, in m",
}

# The same where it matters to depths and distances, which of round bodies are all that is asked.
DEGENERACIES_OF_PAIRS = {
    "slivers": "depth of the overlap, in sizes",
    "tilted_slivers": "tilt of one body, in radians",
    "tiny_in_huge": "size of the larger body, in sizes of the smaller",
    "far_away": "distance from the origin, in sizes",
    "round_contacts": "depth or gap, in m",
}

DISTANCES = {distance_column(peer): peer for peer in hard_cases("distance")}

# One hue from pale to dark: told apart without colours, too, and the figures stand in the cells.
FAILURES = LinearSegmentedColormap.from_list("failures", ["#fdebd3", "#f4a259", "#c8553d", "#5b1a18"])
ERRORS = LinearSegmentedColormap.from_list("errors", ["#eef3f8", "#a9c6de", "#4f83b5", "#16365c"])

Figure = Callable[[Iterable[Row], str], float]


def write_page(measured: Path, folder: Path) -> Path:
    notes, rows = results.read(measured)
    overview(with_volumes(rows), folder / "stability.png")
    by_degeneracy(rows, folder / "stability_degeneracy.png", DEGENERACIES, peers_of(rows), volumes_of(rows), "a volume")
    overview_of_distances(rows, folder / "stability_distances.png")
    columns, path = list(DISTANCES), folder / "stability_distances_degeneracy.png"
    by_degeneracy(rows, path, DEGENERACIES_OF_PAIRS, columns, columns, "a depth or distance")
    page = folder / "stability.md"
    page.write_text(text(notes, rows), encoding="utf-8")
    return page


def volumes_of(rows: list[Row]) -> list[str]:
    """The peers that were asked for volumes."""
    return [name for name in hard_cases("volume") if name in rows[0]]


def peers_of(rows: list[Row]) -> list[str]:
    """The peers that were asked for volumes, or whether anything is common."""
    return volumes_of(rows) + [name for name in hard_cases("overlaps") if name in rows[0]]


# Figures


def with_volumes(rows: Iterable[Row]) -> list[Row]:
    return [row for row in rows if row["volume"] != NOT_ASKED]


def deep(rows: Iterable[Row]) -> list[Row]:
    """Those of pairs that share inner points."""
    return [row for row in rows if row["signed distance"] != NOT_ASKED and float(row["signed distance"]) < 0]


def not_deep(rows: Iterable[Row]) -> list[Row]:
    """Those of pairs that are apart or touch."""
    return [row for row in rows if row["signed distance"] != NOT_ASKED and float(row["signed distance"]) >= 0]


def asked(rows: Iterable[Row], peer: str) -> list[str]:
    return [row[peer] for row in rows if row[peer] != NOT_ASKED]


def failure_share(rows: Iterable[Row], peer: str) -> float:
    """In percent; nan if the peer was not asked."""
    cells = asked(rows, peer)
    return 100 * sum(map(failed, cells)) / len(cells) if cells else np.nan


def worst_error(rows: Iterable[Row], peer: str) -> float:
    """The largest relative error of the volumes or distances that were given; nan if none was given."""
    errors = [error for cell in asked(rows, peer) if not np.isnan(error := error_of(cell))]
    return max(errors, default=np.nan)


def grouped(rows: list[Row]) -> dict[str, list[Row]]:
    """The rows by group, a family that is in no group by its own name."""
    name_of = {family: group for group, members in GROUPS.items() for family in members}
    groups: dict[str, list[Row]] = {group: [] for group in GROUPS}
    for row in rows:
        groups.setdefault(name_of.get(row["family"], row["family"].replace("_", " ")), []).append(row)
    return {name: members for name, members in groups.items() if members}


def decade(row: Row) -> float:
    """The power of ten of the parameter's size; minus infinity for zero."""
    size = abs(float(row["parameter"]))
    return round(log10(size)) if size else -np.inf


# Charts


def percent(value: float) -> str:
    return "" if np.isnan(value) else "0" if value == 0 else "<1" if value < 1 else f"{value:.0f}"


def exponent(value: float) -> str:
    """Its power of ten, rounded up: 3e-9 as −8. A cross where the error is as large as the volume."""
    return "" if np.isnan(value) else "×" if value > 0.5 else f"{ceil(log10(max(value, 1e-17)))}".replace("-", "−")


def failure_shade(value: float) -> float | None:
    return None if value == 0 else min(1.0, (value / 60) ** 0.5)


def error_shade(value: float) -> float | None:
    return None if value < 1e-12 else min(1.0, (log10(value) + 12) / 12)


def cells(share: Figure, groups: Iterable[list[Row]], columns: list[str]) -> np.ndarray:
    """A row for each group, a column for each peer."""
    return np.array([[share(group, column) for column in columns] for group in groups])


def failures(groups: Iterable[list[Row]], columns: list[str]) -> Cells:
    return Cells(cells(failure_share, groups, columns), failure_shade, percent, FAILURES)


def errors(groups: Iterable[list[Row]], columns: list[str]) -> Cells:
    return Cells(cells(worst_error, groups, columns), error_shade, exponent, ERRORS)


def named(columns: list[str]) -> dict[float, str]:
    return dict(enumerate(DISTANCES.get(column, column) for column in columns))


def overview(rows: list[Row], path: Path) -> None:
    groups, peers, volumes = grouped(rows), peers_of(rows), volumes_of(rows)
    counts = dict(enumerate(f"{name}  ({len(group)})" for name, group in groups.items()))
    left = failures(groups.values(), peers), "failures, % of the cases (number in brackets)", counts, peers
    right = errors(groups.values(), volumes), "worst error of a volume, power of ten (× lost)", {}, volumes
    draw_overview(path, [left, right])


def overview_of_distances(rows: list[Row], path: Path) -> None:
    groups = {name: group for name, group in grouped(rows).items() if deep(group) or not_deep(group)}
    counts = (f"{name}  ({len(deep(group))}, {len(not_deep(group))})" for name, group in groups.items())
    names, columns, panels = dict(enumerate(counts)), list(DISTANCES), []
    for shown, words in ((failures, "failures, %"), (errors, "worst error")):
        for part, word in ((deep, "depth"), (not_deep, "distance")):
            panels.append((shown(map(part, groups.values()), columns), f"{word}: {words}", names, columns))
            names = {}
    draw_overview(path, panels)


def draw_overview(path: Path, panels: list[tuple[Cells, str, dict[float, str], list[str]]]) -> None:
    rows, _ = panels[0][0].values.shape
    widths = [shown.values.shape[1] for shown, *_ in panels]
    drawn = [
        Panel(axes={"xlabel": words}, xticks=named(columns), yticks=names, cells=shown, above=True)
        for shown, words, names, columns in panels
    ]
    charts.draw(path, drawn, (9, 0.36 * rows + 1.75), widths=widths, dpi=180, colours=64)


def by_degeneracy(
    rows: list[Row], path: Path, families: dict[str, str], columns: list[str], measured: list[str], what: str
) -> None:
    """Failures of these columns and worst errors of those that are measures, by the parameter of families."""
    panels = []
    for family, words in families.items():
        members = [row for row in rows if row["family"] == family]
        decades = sorted({decade(row) for row in members})
        parts = [[row for row in members if decade(row) == d] for d in decades]
        shown = [column for column in columns if asked(members, column)]
        named_decades = enumerate("0" if np.isinf(d) else f"1e{d:.0f}" for d in decades)
        ticks = dict(islice(named_decades, 0, None, 1 + len(decades) // 12))
        title = f"{family.replace('_', ' ')}: failures, %"
        for figures, names in ((failures, shown), (errors, [column for column in measured if column in shown])):
            across = figures(parts, names)
            turned = replace(across, values=across.values.T)
            if members:
                panels.append(Panel(title, axes={"xlabel": words}, xticks=ticks, yticks=named(names), cells=turned))
            title = f"worst error of {what}, power of ten (× lost)"
    if panels:
        charts.draw(path, panels, (9, 1.15 * len(panels)), columns=2, font=7, dpi=180, colours=64)


# Words

KINDS = ("missed", "phantom", NO_ANSWER, OUT_OF_ITERATIONS, "raised", "crashed", "hung")
WRONG = "off by > 1e-6"

# An answer further off than this, relative to the true one, is counted for itself.
COARSE = 0.01


def kind(cell: str) -> str:
    return (
        cell if cell in KINDS else {"raises": "raised", "crash": "crashed", "hang": "hung"}.get(cell.split()[0], WRONG)
    )


def text(notes: list[str], rows: list[Row]) -> str:
    (seeds,), stressed = results.read(stress.TABLE)
    volumes, every = with_volumes(rows), stressed[-1]
    return filled(
        Path(__file__).with_name("page.md"),
        cases=f"{len(volumes):,}",
        pairs=f"{len(deep(rows)) + len(not_deep(rows)):,}",
        rounds=f"{len(rows) - len(volumes):,}",
        totals=totals(volumes, peers_of(rows)),
        depths=totals(deep(rows), list(DISTANCES)),
        distances=totals(not_deep(rows), list(DISTANCES)),
        stress=f"{int(every['cases']):,} cases of {len(stressed) - 1} families, {seeds}: {every['failures']} failures",
        stress_error=every["worst error"],
        stress_share=every["of the stated"],
        notes=indented(notes),
    )


def totals(rows: list[Row], columns: list[str]) -> str:
    """A line for each peer: how many cases it was asked, the share it failed, and how often in each way, if ever."""
    cells = {column: asked(rows, column) for column in columns}
    failed_by = {column: Counter(kind(cell) for cell in of if failed(cell)) for column, of in cells.items()}
    kinds = [name for name in (WRONG, *KINDS) if any(counts[name] for counts in failed_by.values())]
    lines = []
    for column, of in cells.items():
        share = f"{percent(failure_share(rows, column))} %" if of else "not installed"
        coarse = sum(error_of(cell) > COARSE for cell in of if kind(cell) == WRONG)
        counts = [str(count or "") for count in (*(failed_by[column][name] for name in kinds), coarse)]
        error = worst_error(rows, column) if column not in hard_cases("overlaps") else np.nan
        worst = "" if np.isnan(error) else f"{error:.0e}"
        lines.append([DISTANCES.get(column, column), str(len(of)), share, *counts, worst])
    return table(["", "cases", "failures", *kinds, f"off by > {100 * COARSE:.0f} %", "worst error"], lines)
