"""The page about round bodies, docs/round.md, and its chart, from the results file."""

from __future__ import annotations

from pathlib import Path
from textwrap import fill
from typing import NamedTuple

import numpy as np

from harness import figures, results
from harness.figures import OURS, plt
from harness.page import duration, named, table, write
from overlapper import Overlaps
from speed.round import BATCHES, BOXES, POLYHEDRA

# Aims: at most so many times two boxes in the median and in the slowest hundredth, a single call, and the nominal self.
MEDIAN, TAIL, BATCH, WITH_MARGIN = 10, 40, 1.5, 3

Figures = dict[str, dict[str, dict[str, float]]]  # by part, name and figure


def read(path: Path) -> tuple[str, Figures]:
    """The comment, and the figures."""
    (note,), rows = results.read(path)
    found: Figures = {}
    for row in rows:
        found.setdefault(row["part"], {}).setdefault(row["name"], {})[row["figure"]] = float(row["value"])
    return note, found


def times(ratio: float, aim: float) -> str:
    """In bold what keeps the aim."""
    said = f"{ratio:,.0f}" if ratio >= 10 else f"{ratio:.1f}"
    return f"**{said}**" if ratio <= aim else said


def ways_of(figures: dict[str, float]) -> str:
    found = {way: share for way, share in figures.items() if way in Overlaps.WAYS}
    return ", ".join(f"{way} {share:.0f} %" for way, share in sorted(found.items(), key=lambda item: -item[1]))


def class_table(figures: Figures) -> str:
    boxes = figures["class"][BOXES]["median"]
    rows = [
        [
            name, duration(each["median"]), times(each["median"] / boxes, MEDIAN),
            duration(each["99 %"]), times(each["99 %"] / boxes, TAIL), ways_of(each),
        ]
        for name, each in figures["class"].items()
    ]  # fmt: skip
    return table(["pairs", "median", "times two boxes", "99 % take at most", "times two boxes", "ways"], rows)


def batch_table(figures: Figures) -> str:
    rows = [
        [name, *(duration(each[figure]) for figure in BATCHES), *(times(ratio, BATCH) for ratio in ratios(each))]
        for name, each in figures["batch"].items()
    ]
    heading = ["pairs", *BATCHES, "all over volume", "all over all"]
    return table(heading, rows)


def ratios(of_class: dict[str, float]) -> tuple[float, float]:
    """How much longer a pair of a batch takes with all measures than a call for the volume, and for all."""
    return tuple(of_class["a batch, all"] / of_class[figure] for figure in BATCHES[:2])


def held(figures: Figures) -> dict[str, str]:
    """How many classes keep the aims, of how many."""
    boxes, classes = figures["class"][BOXES]["median"], figures["class"]
    of_volume, of_all = zip(*map(ratios, figures["batch"].values()))
    return {
        "classes": str(len(classes)),
        "median_held": str(sum(each["median"] <= MEDIAN * boxes for each in classes.values())),
        "tail_held": str(sum(each["99 %"] <= TAIL * boxes for each in classes.values())),
        "volume_held": str(sum(ratio <= BATCH for ratio in of_volume)),
        "all_held": str(sum(ratio <= BATCH for ratio in of_all)),
        "boxes": duration(boxes),
    }


# Why a class misses an aim, by what is done for most of its pairs.
BOUNDS = {
    "planes": "**Planes around ellipsoids.** An ellipsoid and another round body are no ball and no cylinder in any "
    "common frame. They are enclosed by tangent planes, some thousand for a tolerance of 1e-3.",
    "pieces": "**Pieces of rounded hulls.** Which facets, edges and corners are met is found by cutting a polytope "
    "around what is common, and each piece that is met is measured on its own: the time goes with their number.",
    "slices": "**Slices.** There is no formula for two round bodies whose surfaces cross, and for a side of a capsule "
    "or a cylinder over an edge or a corner it cancels where the contact is shallow. What is left are slices, dozens "
    "to hundreds, each an outline.",
}


def bound_by(name: str, figures: dict[str, float]) -> str:
    if figures.get("dual hull", 0.0) > figures.get("slicing", 0.0):
        return "planes"
    return "pieces" if {"rounded hull", "mesh with margin"} & set(name.split(", ")) else "slices"


def bounds_text(figures: Figures) -> str:
    boxes = figures["class"][BOXES]["median"]
    lines = []
    for bound, words in BOUNDS.items():
        of_bound = {name: each for name, each in figures["class"].items() if bound_by(name, each) == bound}
        both = [name for name, each in of_bound.items() if each["median"] > MEDIAN * boxes]
        tail = [name for name, each in of_bound.items() if name not in both and each["99 %"] > TAIL * boxes]
        if both or tail:
            said = [words]
            said += [f"Beyond {MEDIAN} times in the median: {listed(both)}."] * bool(both)
            said += [f"Beyond {TAIL} times in the slowest hundredth only: {listed(tail)}."] * bool(tail)
            lines.append(fill(" ".join(said), 120, initial_indent="- ", subsequent_indent="  ", break_on_hyphens=False))
    return "\n".join(lines) or "None does."


def listed(names: list[str]) -> str:
    return "; ".join(name.replace(", ", " and ") for name in names)


class Aim(NamedTuple):
    """The aim for a scene: in words; in µs, or None for half of stepSimulation; and the reason if it is missed."""

    words: str
    us: float | None
    bound: str


AIMS = {
    "bin_of_balls": Aim(
        "0.4 ms", 400.0, "capsules on edges of walls, and others near where their ends begin, which are sliced"
    ),
    "fifty capsule humanoids": Aim(
        "half of stepSimulation", None, "capsules of neighbours that cross or touch, which are sliced"
    ),
    "random_objects_pile, with margins": Aim(
        "6 ms", 6000.0, "small hulls of up to a hundred facets, every one of which has pieces"
    ),
    "36 mixed robots, all measures": Aim("20 ms", 2e4, "poses and shapes of so many links"),
}


def aim_of(name: str, figures: dict[str, float]) -> float:
    """In µs."""
    return AIMS[name].us or figures["stepSimulation"] / 2


def scene_bounds(figures: Figures) -> str:
    missed = [name for name, each in figures["scene"].items() if each["ours"] > aim_of(name, each)]
    said = "; ".join(f"*{name}*: {AIMS[name].bound}" for name in missed)
    return fill(f"What bounds those that miss their aim: {said}.", 120) if missed else "All keep their aim."


def margin_table(figures: Figures) -> str:
    rows = []
    for name, each in figures["margin"].items():
        ratio = each["with margins"] / each["nominal"]
        rows.append([name, duration(each["nominal"]), duration(each["with margins"]), times(ratio, WITH_MARGIN)])
    return table(["", "as they are", "with margins of 1 mm", "times"], rows)


def overlap_text(figures: Figures) -> str:
    if "overlap" not in figures:
        return "It was not installed."
    rows = [
        [
            f"{float(name):.0e} m", duration(each["ours"]), duration(each["overlap"]),
            f"{each['error, ours']:.0e}",
            "answers 0" if each["error, overlap"] == 1 else f"{each['error, overlap']:.0e}",
        ]
        for name, each in figures["overlap"].items()
        if name != "at random"
    ]  # fmt: skip
    both = figures["overlap"]["at random"]
    said = f"In the median of the balls and boxes above, this package takes {duration(both['ours'])}"
    said += f" and `overlap` {duration(both['overlap'])}. Over an edge:\n\n"
    return said + table(["depth", "ours", "`overlap`", "error, ours", "error, `overlap`"], rows)


def scene_table(figures: Figures) -> str:
    rows = []
    for name, each in figures["scene"].items():
        took = duration(each["ours"])
        counts = [f"{each['pairs']:,.0f}", f"{each['round']:,.0f}"]
        ours = f"**{took}**" if each["ours"] <= aim_of(name, each) else took
        rows.append([name, *counts, duration(each["stepSimulation"]), ours, AIMS[name].words])
    return table(["scene", "pairs that overlap", "a round one in", "`stepSimulation`", "ours", "aim"], rows)


def draw(found: Figures, folder: Path) -> None:
    """A line for each class from its median to what 99 % of its pairs take, as round.png and round.svg."""
    figures.style(**{"font.size": 8})
    boxes = found["class"][BOXES]["median"]
    classes = sorted(found["class"].items(), key=lambda item: item[1]["median"])
    figure, ax = plt.subplots(figsize=(8.6, 0.165 * len(classes) + 1.2))
    for k, (name, each) in enumerate(classes):
        colour = "#666666" if all(kind in POLYHEDRA for kind in name.split(", ")) else OURS
        ax.plot([each["median"], each["99 %"]], [k, k], color=colour, lw=1.4, alpha=0.55, zorder=2)
        ax.plot(each["median"], k, "o", color=colour, ms=5, zorder=3)
        ax.plot(each["99 %"], k, "|", color=colour, ms=7, zorder=3)
    for factor, words in ((1, "two boxes"), (MEDIAN, "10 times"), (TAIL, "40 times")):
        ax.axvline(factor * boxes, color="#1f5fbf", lw=0.8, ls=":" if factor > 1 else "-", zorder=1)
        ax.annotate(words, (factor * boxes, len(classes) - 0.3), color="#1f5fbf", fontsize=7, ha="center")
    ax.set(xscale="log", ylim=(-0.8, len(classes) + 0.6))
    ax.set_xlabel("time of a call: the median of a class (dot), and what 99 of 100 of its pairs take at most (bar)")
    ax.set_yticks(range(len(classes)), [name for name, _ in classes])
    ticks = [tick for tick in 10.0 ** np.arange(-1, 7) if ax.get_xlim()[0] < tick < ax.get_xlim()[1]]
    ax.set_xticks(ticks, [duration(tick) for tick in ticks])
    ax.minorticks_off()
    figures.tidy(ax)
    ax.grid(visible=False, axis="y")
    figure.tight_layout()
    figures.save(figure, folder / "round.png", svg=True)


def write_page(path: Path, folder: Path) -> Path:
    note, found = read(path)
    draw(found, folder)
    return write(
        Path(__file__).with_suffix(".md"),
        folder / "round.md",
        results=named(path),
        note=note,
        table=class_table(found),
        batches=batch_table(found),
        margins=margin_table(found),
        overlap=overlap_text(found),
        scenes=scene_table(found),
        bounds=bounds_text(found),
        scene_bounds=scene_bounds(found),
        **held(found),
    )
