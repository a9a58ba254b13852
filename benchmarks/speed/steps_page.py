"""The page about the time of a step, docs/steps.md, and its chart, from the results file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from harness import charts, results
from harness.charts import INK, OURS, Panel, Series
from harness.page import duration, named, table, write
from speed.steps import PARTS

COLOURS = ("#9ecae1", "#4292c6", "#fdae6b", OURS, "#8c6bb1")
WHOLES = {
    "stepSimulation": ("pybullet's stepSimulation()", INK, ".:"),
    "getContactPoints": ("pybullet's getContactPoints()", INK, ".-"),
    "ours": ("update() and overlaps()", OURS, ".-"),
}

Figures = dict[str, dict[int, float]]  # median µs, or counts, by part and number of boxes


def read(path: Path) -> Figures:
    found: Figures = {}
    for row in results.read(path)[1]:
        found.setdefault(row["part"], {})[int(row["boxes"])] = float(row["us"])
    return found


def draw(us: Figures, path: Path) -> None:
    piles = sorted(us["ours"])
    places, names = np.arange(len(piles)), [f"{boxes:,}" for boxes in piles]
    parts = np.array([[max(0.0, us[part][boxes]) / boxes for boxes in piles] for part in PARTS])
    bars = [
        Series(places, heights, words, bottom=below, style={"color": colour, "width": 0.62, "zorder": 2})
        for heights, below, words, colour in zip(parts, np.cumsum(parts, 0) - parts, PARTS.values(), COLOURS)
    ]
    divided = {"getContactPoints": 1, "stepSimulation": 10}
    for part, divisor in divided.items():
        words, colour, form = WHOLES[part]
        heights = [us[part][boxes] / boxes / divisor for boxes in piles]
        bars.append(Series(places, heights, words + ", a tenth" * (divisor > 1), form, style={"color": colour}))
    top = max(max(bars[-2].y), parts.sum(0).max())
    each = Panel(
        "Time of a step by part, per box",
        bars,
        {"xlabel": "boxes in the pile", "ylabel": "µs of a step, per box", "ylim": (0, 1.45 * top)},
        xticks=dict(enumerate(names)),
        legend={"ncols": 2, "columnspacing": 1, "loc": "upper left"},
    )
    lines = [
        Series(piles, [us[part][boxes] / 1e3 for boxes in piles], words, form, style={"color": colour})
        for part, (words, colour, form) in WHOLES.items()
    ]
    scales = {"xscale": "log", "yscale": "log"}
    whole = Panel(
        "Total time of a step",
        lines,
        {**scales, "xlabel": "boxes in the pile", "ylabel": "ms of a step"},
        xticks=dict(zip(piles, names)),
        legend={"fontsize": 8},
    )
    charts.draw(path, [each, whole], (10.8, 4.4), font=9, widths=[1.35, 1])


def write_page(path: Path, folder: Path) -> Path:
    us = read(path)
    draw(us, folder / "steps.png")
    piles = sorted(us["ours"])
    rows = [
        [
            f"{boxes:,}", f"{us['pairs overlapping'][boxes]:,.0f}",
            *(f"{us[part][boxes] / boxes:.2f}" for part in PARTS),
            *(duration(us[part][boxes]) for part in ("ours", "getContactPoints", "stepSimulation")),
        ]
        for boxes in piles
    ]  # fmt: skip
    heading = ["boxes", "pairs", "poses asked, µs per box", *list(PARTS)[1:]]
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
