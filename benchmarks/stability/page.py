"""The stability page and its pictures, from a results file and nothing else but the failing cases it names."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from math import ceil, log10
from pathlib import Path

import exact
import families
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, LinearSegmentedColormap

from harness import figures, results
from harness.figures import INK, plt
from harness.page import filled, indented, table
from harness.peers import NO_ANSWER, NOT_ASKED, OUT_OF_ITERATIONS, hard_cases
from paper.pictures import PICTURES, save, steps_in_thicknesses
from paper.steps import STEPS
from stability import contacts, stress
from stability.judging import RIGHT, distance_column, error_of, failed

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
CLEAN, EMPTY = "#ffffff", "#f0f0f0"


def write_page(measured: Path, folder: Path) -> Path:
    notes, rows = results.read(measured)
    figures.style(**{"font.size": 8, "axes.linewidth": 0.0})
    overview(with_volumes(rows), folder / "stability.png")
    volumes = volumes_of(rows)
    by_degeneracy(rows, folder / "stability_degeneracy.png", DEGENERACIES, peers_of(rows), volumes, "a volume")
    overview_of_distances(rows, folder / "stability_distances.png")
    columns = list(DISTANCES)
    path = folder / "stability_distances_degeneracy.png"
    by_degeneracy(rows, path, DEGENERACIES_OF_PAIRS, columns, columns, "a depth or distance")
    shown = shown_cases(rows)
    for step, row in shown.items():
        PICTURES[CAUSES[step]](*case_of(row), folder / f"stability_{CAUSES[step]}.png")
    page = folder / "stability.md"
    page.write_text(text(notes, rows, shown), encoding="utf-8")
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


def heat_map(ax: Axes, values: np.ndarray, shade: Callable, label: Callable[[float], str], colours: Colormap) -> None:
    """Cells with their figures. `shade` maps a value to 0 ... 1, or to None where it is as good as can be."""
    for (i, j), value in np.ndenumerate(values):
        strength = None if np.isnan(value) else shade(value)
        colour = EMPTY if np.isnan(value) else CLEAN if strength is None else colours(strength)
        ax.add_patch(plt.Rectangle((j - 0.47, i - 0.45), 0.94, 0.9, facecolor=colour, edgecolor="#dddddd", lw=0.5))
        ink = "white" if strength is not None and strength > 0.6 else "#999999" if strength is None else INK
        ax.text(j, i, label(value), ha="center", va="center", color=ink, fontsize=7)
    ax.set_xlim(-0.5, values.shape[1] - 0.5)
    ax.set_ylim(values.shape[0] - 0.5, -0.5)
    ax.tick_params(length=0)


def failure_shade(value: float) -> float | None:
    return None if value == 0 else min(1.0, (value / 60) ** 0.5)


def error_shade(value: float) -> float | None:
    return None if value < 1e-12 else min(1.0, (log10(value) + 12) / 12)


def failures(ax: Axes, groups: Iterable[list[Row]], columns: list[str], across: bool = True) -> None:
    """Shares of failures; groups go down and columns across, or the other way round."""
    values = np.array([[failure_share(group, column) for column in columns] for group in groups])
    heat_map(ax, values if across else values.T, failure_shade, percent, FAILURES)


def errors(ax: Axes, groups: Iterable[list[Row]], columns: list[str], across: bool = True) -> None:
    values = np.array([[worst_error(group, column) for column in columns] for group in groups])
    heat_map(ax, values if across else values.T, error_shade, exponent, ERRORS)


def name_columns(ax: Axes, columns: Iterable[str], *lines: float) -> None:
    """Names above, the first in bold, and lines between groups of columns."""
    names = [DISTANCES.get(column, column) for column in columns]
    ax.xaxis.tick_top()
    ax.set_xticks(range(len(names)), names, rotation=40, ha="left", rotation_mode="anchor")
    ax.get_xticklabels()[0].set_fontweight("bold")
    for line in lines:
        ax.axvline(line, color=INK, lw=0.8)


def overview(rows: list[Row], path: Path) -> None:
    groups, peers, volumes = grouped(rows), peers_of(rows), volumes_of(rows)
    widths = [len(peers), len(volumes)]
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 0.36 * len(groups) + 1.75), width_ratios=widths)
    failures(left, groups.values(), peers)
    errors(right, groups.values(), volumes)
    left.set_yticks(range(len(groups)), [f"{name}  ({len(group)})" for name, group in groups.items()])
    right.set_yticks([])
    name_columns(left, peers, 1.5, len(volumes) - 0.5)
    name_columns(right, volumes, 1.5)
    left.set_xlabel("failures, % of the cases (number in brackets)", labelpad=6)
    right.set_xlabel("worst error of a volume, power of ten (× lost)", labelpad=6)
    figure.tight_layout(w_pad=1.5)
    save(figure, path)


def overview_of_distances(rows: list[Row], path: Path) -> None:
    groups = {name: group for name, group in grouped(rows).items() if deep(group) or not_deep(group)}
    figure, axes = plt.subplots(1, 4, figsize=(9, 0.36 * len(groups) + 1.75))
    columns = list(DISTANCES)
    for j, (part, word) in enumerate([(deep, "depth"), (not_deep, "distance")]):
        failures(axes[j], map(part, groups.values()), columns)
        errors(axes[2 + j], map(part, groups.values()), columns)
        axes[j].set_xlabel(f"{word}: failures, %", labelpad=6)
        axes[2 + j].set_xlabel(f"{word}: worst error", labelpad=6)
    counts = [f"{name}  ({len(deep(group))}, {len(not_deep(group))})" for name, group in groups.items()]
    for ax in axes:
        ax.set_yticks(range(len(groups)) if ax is axes[0] else [], counts if ax is axes[0] else [])
        name_columns(ax, columns, 0.5)
    figure.tight_layout(w_pad=1.2)
    save(figure, path)


def by_degeneracy(
    rows: list[Row], path: Path, families: dict[str, str], columns: list[str], measured: list[str], what: str
) -> None:
    """Failures of these columns and worst errors of those that are measures, by the parameter of families."""
    panels = {family: [r for r in rows if r["family"] == family] for family in families}
    panels = {family: members for family, members in panels.items() if members}
    figure, axes = plt.subplots(len(panels), 2, figsize=(9, 2.3 * len(panels)), squeeze=False)
    for (left, right), (family, members) in zip(axes, panels.items()):
        decades = sorted({decade(row) for row in members})
        parts = [[row for row in members if decade(row) == d] for d in decades]
        shown = [column for column in columns if asked(members, column)]
        exact_ones = [column for column in measured if column in shown]
        failures(left, parts, shown, across=False)
        errors(right, parts, exact_ones, across=False)
        for ax, names in ((left, shown), (right, exact_ones)):
            ax.set_yticks(range(len(names)), [DISTANCES.get(name, name) for name in names])
            ax.get_yticklabels()[0].set_fontweight("bold")
            ax.set_xticks(range(len(decades)), ["0" if np.isinf(d) else f"1e{d:.0f}" for d in decades])
            ax.tick_params(axis="x", labelsize=6 if len(decades) > 10 else 7.5)
            ax.set_xlabel(families[family])
        name = family.replace("_", " ")
        left.set_title(f"{name}: failures, %", loc="left", fontsize=8.5, fontweight="bold")
        right.set_title(f"worst error of {what}, power of ten (× lost)", loc="left", fontsize=8.5)
    figure.tight_layout(h_pad=1.2, w_pad=1.5)
    save(figure, path)


# Pictures of the causes


CAUSES = {"2 shifts": "shifts", "3 planes": "planes", "4 coplanar duals": "coplanar"}


def shown_cases(rows: list[Row]) -> dict[str, Row]:
    """For each cause that occurs, the failing case that shows it best."""
    pairs = [row for row in rows if row["bodies"] == "2" and row["clear"] == "yes"]
    shown = {}
    for step in CAUSES:
        column = "paper lost at" if step == "2 shifts" else "given a point"
        found = [row for row in pairs if row[column] == step]
        if found:
            shown[step] = max(found, key=lambda row: vividness(step, row))
    return shown


def vividness(step: str, row: Row) -> float:
    if step == "2 shifts":
        # Shifts of a few thicknesses: all of them and the body can be seen at one scale.
        return -abs(log10(steps_in_thicknesses(*case_of(row)) / 2.5))
    if step == "3 planes":
        error = error_of(row["and by qhull"])
        return 0.0 if np.isnan(error) else error
    return -len(case_of(row)[1].facets)


def case_of(row: Row) -> tuple[list[np.ndarray], exact.Polytope]:
    case = families.make(row["family"], int(row["seed"]))
    bodies = [np.array(families.points_of(body), float) for body in case.bodies]
    return bodies, exact.common(*map(exact.hull, bodies))


# Words

KINDS = ("wrong volume", "missed", "phantom", "raised", "crashed", "hung")
KINDS_OF_DISTANCES = ("off by > 1e-6", *KINDS[1:3], NO_ANSWER, OUT_OF_ITERATIONS, *KINDS[3:])

# A depth or distance further off than this, relative to the true one, is counted for itself.
COARSE = 0.01


def kind(cell: str, wrong: str = KINDS[0]) -> str:
    if cell in (NO_ANSWER, OUT_OF_ITERATIONS, "missed", "phantom"):
        return cell
    return {"raises": "raised", "crash": "crashed", "hang": "hung"}.get(cell.split()[0], wrong)


def text(notes: list[str], rows: list[Row], shown: dict[str, Row]) -> str:
    solids = [row for row in rows if row["given a point"] != NOT_ASKED]
    paper = Counter(row["paper lost at"] for row in rows if row["paper lost at"] != NOT_ASKED)
    parts = {
        "cases": f"{len(with_volumes(rows)):,}",
        "pairs": f"{len(deep(rows)) + len(not_deep(rows)):,}",
        "rounds": f"{len(rows) - len(with_volumes(rows)):,}",
        "depths": totals_of_distances(deep(rows)),
        "distances": totals_of_distances(not_deep(rows)),
        "ways": ways(rows),
        "solids": f"{len(solids):,}",
        "notes": indented(notes),
        "totals": totals(with_volumes(rows)),
        "steps": steps(rows, solids, paper),
        "auto": about_auto(rows),
        "stress": stress_run(),
        **shallow_rounds(),
        "paper_failures": str(sum(paper.values())),
        "shift_failures": str(paper["2 shifts"]),
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
    for step, name in CAUSES.items():
        row = shown.get(step)
        at = f"`{row['family']}` {row['seed']} ({row['detail']})" if row else ""
        picture = f"![{STEPS[step]}](stability_{name}.png)\n\nThe case is {at}."
        parts[f"picture_{name}"] = picture if row else "In these cases that never happened."
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


def steps(rows: list[Row], solids: list[Row], paper: Counter[str]) -> str:
    given = Counter(row["given a point"] for row in solids)
    late = ("1 common point", "2 shifts", "not reproduced")
    lines = [
        [f"{step}: {words}", str(paper[step]), "" if step in late else str(given[step])]
        for step, words in STEPS.items()
    ]
    by_qhull = sum(failed(row["and by qhull"]) for row in solids)
    lost = given.total() - given[RIGHT]
    lines.append(["**all**", f"**{paper.total()}** of {len(with_volumes(rows))}", f"**{lost}** of {len(solids)}"])
    lines.append(["the same with qhull in place of exact signs", "", f"{by_qhull} of {len(solids)}"])
    return table(["first step that loses it", "as written", "the centroid given"], lines)
