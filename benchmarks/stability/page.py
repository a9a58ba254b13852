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
from stability import contacts, stress
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

KINDS = ("wrong volume", "missed", "phantom", "raised", "crashed", "hung")
KINDS_OF_DISTANCES = ("off by > 1e-6", *KINDS[1:3], NO_ANSWER, OUT_OF_ITERATIONS, *KINDS[3:])

# A depth or distance further off than this, relative to the true one, is counted for itself.
COARSE = 0.01


def kind(cell: str, wrong: str = KINDS[0]) -> str:
    if cell in (NO_ANSWER, OUT_OF_ITERATIONS, "missed", "phantom"):
        return cell
    return {"raises": "raised", "crash": "crashed", "hang": "hung"}.get(cell.split()[0], wrong)


def text(notes: list[str], rows: list[Row]) -> str:
    parts = {
        "cases": f"{len(with_volumes(rows)):,}",
        "pairs": f"{len(deep(rows)) + len(not_deep(rows)):,}",
        "rounds": f"{len(rows) - len(with_volumes(rows)):,}",
        "depths": totals_of_distances(deep(rows)),
        "distances": totals_of_distances(not_deep(rows)),
        "ways": ways(rows),
        "notes": indented(notes),
        "totals": totals(with_volumes(rows)),
        "auto": about_auto(rows),
        "stress": stress_run(),
        **shallow_rounds(),
    }
    for column, peer in DISTANCES.items():
        key = peer.split(",")[0] + "_tight" * ("," in peer)
        for part, word in ((deep, "depth"), (not_deep, "distance")):
            parts |= {f"{word}_{key}": f"{percent(failure_share(part(rows), column))} %"}
            parts |= {f"{word}_{key}_at": worst_places(part(rows), column)}
    for peer in peers_of(rows):
        key = peer.replace(" ", "_")
        kinds = Counter(kind(cell) for cell in asked(rows, peer) if failed(cell))
        parts |= {f"{key}_{name.replace(' ', '_')}": str(kinds[name]) for name in KINDS}
        parts |= {f"{key}_share": percent(failure_share(rows, peer))}
        parts |= {f"{key}_worst_at": worst_places(rows, peer)}
    return filled(Path(__file__).with_name("page.md"), **parts)


def worst_places(rows: list[Row], peer: str) -> str:
    """The three groups in which a peer fails most, with the share."""
    shares = {name: failure_share(group, peer) for name, group in grouped(rows).items()}
    worst = sorted((name for name in shares if shares[name] > 0), key=lambda name: -shares[name])[:3]
    return ", ".join(f"{name} {percent(shares[name])} %" for name in worst) or "none"


def about_auto(rows: list[Row]) -> str:
    failures = [f"`{row['family']}` {row['seed']} ({row['auto']})" for row in rows if failed(row["auto"])]
    return "It failed in none of them." if not failures else f"It failed in {', '.join(failures)}."


def totals(rows: list[Row]) -> str:
    lines = []
    for peer in peers_of(rows):
        kinds = Counter(kind(cell) for cell in asked(rows, peer) if failed(cell))
        counts = [str(kinds[name] or "") for name in KINDS]
        lines.append([*score(rows, peer), *counts, worst(rows, peer) if peer in volumes_of(rows) else ""])
    return table(["", "cases", "failures", *KINDS, "worst error"], lines)


def score(rows: list[Row], peer: str) -> list[str]:
    """The peer, how many cases it was asked, and how many of them it failed."""
    cases = len(asked(rows, peer))
    share = f"{percent(failure_share(rows, peer))} %" if cases else "not installed"
    return [DISTANCES.get(peer, peer), str(cases), share]


def worst(rows: list[Row], peer: str) -> str:
    error = worst_error(rows, peer)
    return "" if np.isnan(error) else f"{error:.0e}"


def totals_of_distances(rows: list[Row]) -> str:
    lines = []
    for column in DISTANCES:
        cells = asked(rows, column)
        kinds = Counter(kind(cell, KINDS_OF_DISTANCES[0]) for cell in cells if failed(cell))
        coarse = sum(error_of(cell) > COARSE for cell in cells if cell not in KINDS_OF_DISTANCES)
        counts = [str(count or "") for count in [*(kinds[name] for name in KINDS_OF_DISTANCES), coarse]]
        lines.append([*score(rows, column), *counts, worst(rows, column)])
    return table(["", "cases", "failures", *KINDS_OF_DISTANCES, f"off by > {COARSE * 100:.0f} %", "worst error"], lines)


def ways(rows: list[Row]) -> str:
    """By which way the package answered, in percent of each group, the most frequent of all first."""
    names = [way for way, _ in Counter(asked(rows, "way")).most_common()]
    lines = []
    for name, group in [*grouped(rows).items(), ("all", rows)]:
        counts = Counter(asked(group, "way"))
        lines.append([name, *(percent(100 * counts[way] / counts.total()) if counts[way] else "" for way in names)])
    return table(["", *names], lines)


def stress_run() -> str:
    """The record of `python benchmarks stress`, in words and as a table."""
    (seeds,), rows = results.read(stress.TABLE)
    failures = int(rows[-1]["failures"])
    words = f"{int(rows[-1]['cases']):,} cases, {seeds}: " + (f"{failures} failures." if failures else "no failure.")
    lines = ([value.replace("_", " ") for value in row.values()] for row in rows)
    return f"{words}\n\n{table(list(rows[0]), lines)}"


def shallow_rounds() -> dict[str, str]:
    """The record of `python benchmarks contacts`, with all answers to a contact in one cell."""
    notes, rows = results.read(contacts.RESULTS)
    kinds = dict.fromkeys(row["contact"] for row in rows)
    known = max(float(row["known to"]) for row in rows)
    said = {
        "shallow_cases": str(len(rows)),
        "shallow_contacts": str(len(kinds)),
        "shallow_known": f"{known:.0e}",
        "shallow_notes": indented(notes),
    }
    for word, key in ((": volume", "volumes"), (": stated error", "stated"), (": depth", "depths")):
        peers = [column for column in rows[0] if column.endswith(word)]
        said[f"shallow_{key}_auto"] = all_said([row[f"auto{word}"] for row in rows])
        lines = (
            [contact, *(all_said([row[peer] for row in rows if row["contact"] == contact]) for peer in peers)]
            for contact in kinds
        )
        said[f"shallow_{key}"] = table(["", *(peer.removesuffix(word) for peer in peers)], lines)
    return said


def all_said(cells: list[str]) -> str:
    """The largest error, and how often each word stands in place of an answer."""
    errors = [error for cell in cells if not np.isnan(error := error_of(cell))]
    words = Counter(cell for cell in cells if cell != NOT_ASKED and np.isnan(error_of(cell)))
    worst = [f"{max(errors):.0e}"] if errors else []
    return ", ".join([*worst, *(f"{count} {word}" for word, count in words.most_common())])
