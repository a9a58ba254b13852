"""The page about the time of a step, docs/steps.md, and its chart, from the results file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from harness import figures, results
from harness.figures import INK, OURS, plt
from harness.page import duration, named, table, write
from speed.steps import PARTS

COLOURS = dict(zip(PARTS, ("#9ecae1", "#4292c6", "#fdae6b", OURS, "#8c6bb1")))

Figures = dict[str, dict[int, float]]  # median µs, or counts, by part and number of boxes


def read(path: Path) -> Figures:
    found: Figures = {}
    for row in results.read(path)[1]:
        found.setdefault(row["part"], {})[int(row["boxes"])] = float(row["us"])
    return found


def draw(us: Figures, folder: Path) -> None:
    """The chart, as steps.png and steps.svg."""
    figures.style(**{"font.size": 9})
    piles = sorted(us["ours"])
    figure, (each, whole) = plt.subplots(1, 2, figsize=(10.8, 4.4), gridspec_kw={"width_ratios": [1.35, 1]})

    bottom = np.zeros(len(piles))
    places = np.arange(len(piles))
    for part, words in PARTS.items():
        heights = np.array([max(0.0, us[part][boxes]) / boxes for boxes in piles])
        each.bar(places, heights, 0.62, bottom=bottom, color=COLOURS[part], label=words, zorder=2)
        bottom += heights
    lines = {"getContactPoints": (INK, "-", 1), "stepSimulation": (INK, ":", 10)}
    for part, (colour, dashes, divisor) in lines.items():
        words = f"pybullet's {part}()" + (", a tenth" if divisor > 1 else "")
        heights = [us[part][boxes] / boxes / divisor for boxes in piles]
        each.plot(places, heights, dashes, color=colour, marker=".", label=words, zorder=3)
    each.set_xticks(places, [f"{boxes:,}" for boxes in piles])
    each.set(xlabel="boxes in the pile", ylabel="µs of a step, per box", title="Where the time of a step goes")
    each.set_ylim(0, 1.45 * max(bottom.max(), *(us["getContactPoints"][boxes] / boxes for boxes in piles)))
    each.legend(frameon=False, fontsize=7.2, ncols=2, columnspacing=1, loc="upper left")

    for part, words, colour, dashes in (
        ("stepSimulation", "stepSimulation()", INK, ":"),
        ("getContactPoints", "getContactPoints()", INK, "-"),
        ("ours", "update() and overlaps()", OURS, "-"),
    ):
        whole.plot(piles, [us[part][boxes] / 1e3 for boxes in piles], dashes, color=colour, marker=".", label=words)
    whole.set(xscale="log", yscale="log", xlabel="boxes in the pile", ylabel="ms of a step", title="The whole")
    whole.set_xticks(piles, [f"{boxes:,}" for boxes in piles])
    whole.minorticks_off()
    whole.legend(frameon=False, fontsize=8)
    figures.tidy(each, whole)
    figure.tight_layout()
    figures.save(figure, folder / "steps.png", svg=True)


def write_page(path: Path, folder: Path) -> Path:
    us = read(path)
    draw(us, folder)
    piles = sorted(us["ours"])
    rows = []
    for boxes in piles:
        whole = [us[part][boxes] for part in ("ours", "getContactPoints", "stepSimulation")]
        parts = [f"{us[part][boxes] / boxes:.2f}" for part in PARTS]
        rows.append([f"{boxes:,}", f"{us['pairs overlapping'][boxes]:,.0f}", *parts, *map(duration, whole)])
    heading = ["boxes", "pairs", "poses asked, µs per box", "placing", "culling", "geometry", "hand-over"]
    heading += ["all of ours", "`getContactPoints`", "`stepSimulation`"]
    at = {part: of_part[200 if 200 in piles else piles[0]] for part, of_part in us.items()}
    return write(
        Path(__file__).with_suffix(".md"),
        folder / "steps.md",
        results=named(path),
        piles=f"{piles[0]:,} to {piles[-1]:,}",
        table=table(heading, rows, left=0),
        widened=f"{100 * at['pairs widened'] / at['pairs overlapping']:.0f}",
        overlapping=f"{at['pairs overlapping']:,.0f}",
        apart=f"{at['pairs examined'] - at['pairs overlapping']:,.0f}",
        a_pair=f"{at['a pair that overlaps']:.2g} µs",
        a_pair_apart=f"{at['a pair that does not']:.2g} µs",
        poses=f"{at['reading'] / at['getContactPoints']:.2g}",
        against_contacts=f"{at['ours'] / at['getContactPoints']:.2g}",
        against_step=f"{at['ours'] / at['stepSimulation']:.2g}",
    )
