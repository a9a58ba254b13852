"""The page about round bodies, docs/round.md, and its chart, from the results file."""

from __future__ import annotations

from pathlib import Path

from harness import charts, results
from harness.charts import OURS, Panel, Series
from harness.page import duration, named, table, times, write
from overlapper import Overlaps
from speed.round import BOXES, POLYHEDRA

# The aim for every class: times two boxes, for the median and for 99 of 100 pairs.
TYPICAL, RARE = 10, 40

Figures = dict[str, dict[str, dict[str, float]]]  # by part, name and figure


def read(path: Path) -> tuple[str, Figures]:
    """The comment, and the figures."""
    (note,), rows = results.read(path)
    found: Figures = {}
    for row in rows:
        found.setdefault(row["part"], {}).setdefault(row["name"], {})[row["figure"]] = float(row["value"])
    return note, found


def ways_of(figures: dict[str, float]) -> str:
    found = sorted((-share, way) for way, share in figures.items() if way in Overlaps.WAYS)
    return ", ".join(f"{way} {-share:.0f} %" for share, way in found)


def fast(figures: dict[str, float], boxes: float) -> bool:
    return figures["median"] <= TYPICAL * boxes and figures["99 %"] <= RARE * boxes


def quantity_rows(figures: Figures) -> list[list[str]]:
    rows = []
    for name, each in figures["quantity"].items():
        ratio = times(each["six, batch"] / each["six, calls"])
        rows.append([name, *(duration(each[key]) for key in ("volume", "patch", "errors", "six, calls")), ratio])
    return rows


def class_rows(figures: Figures) -> list[list[str]]:
    boxes = figures["class"][BOXES]["median"]
    rows = []
    for name, each in figures["class"].items():
        us = each["median"], each["99 %"]
        marked = f"**{name}**" if fast(each, boxes) else name
        rows.append(
            [marked, *(cell for value in us for cell in (duration(value), times(value / boxes))), ways_of(each)]
        )
    return rows


def margin_rows(figures: Figures) -> list[list[str]]:
    both = {name: (each["nominal"], each["with margins"]) for name, each in figures["margin"].items()}
    return [[name, duration(bare), duration(grown), times(grown / bare)] for name, (bare, grown) in both.items()]


def draw(found: Figures, path: Path) -> None:
    """A line for each class, from its median to what 99 % of its pairs take."""
    boxes = found["class"][BOXES]["median"]
    classes = sorted(found["class"].items(), key=lambda item: item[1]["median"])
    series, factors = [], {1: "two boxes", 10: "10 times", 100: "100 times", 1000: "1,000 times"}
    for k, (name, each) in enumerate(classes):
        style = {"color": "#666666" if all(kind in POLYHEDRA for kind in name.split(", ")) else OURS}
        series += [
            Series([each["median"], each["99 %"]], [k, k], style=style | {"lw": 1.4, "alpha": 0.55}),
            Series([each["median"]], [k], format="o", style=style | {"ms": 5}),
            Series([each["99 %"]], [k], format="|", style=style | {"ms": 7}),
        ]
    for factor in factors:
        series.append(Series([factor * boxes] * 2, [-0.8, len(classes) - 0.4], style={"color": charts.BOOK, "lw": 0.8}))
    said = "time of a call: the median of a class (dot), and what 99 of 100 of its pairs take at most (bar)"
    panel = Panel(
        series=series,
        axes={"xscale": "log", "ylim": (-0.8, len(classes) + 0.6), "xlabel": said},
        xticks={10.0**k: duration(10.0**k) for k in range(6)},
        yticks=dict(enumerate(name for name, _ in classes)),
        texts=[(factor * boxes, len(classes) - 0.3, words, charts.BOOK) for factor, words in factors.items()],
    )
    charts.draw(path, [panel], (8.6, 0.165 * len(classes) + 1.2))


def write_page(path: Path, folder: Path) -> Path:
    note, found = read(path)
    draw(found, folder / "round.png")
    kept = sum(fast(each, found["class"][BOXES]["median"]) for each in found["class"].values())
    quantities = ["pairs", "volume", "patch", "errors", "six quantities", "the same in a batch"]
    classes = ["pairs", "median", "times two boxes", "99 % take at most", "times two boxes", "ways"]
    return write(
        Path(__file__).with_suffix(".md"),
        folder / "round.md",
        results=named(path),
        note=note,
        table=table(classes, class_rows(found)),
        kept=str(kept),
        all=str(len(found["class"])),
        quantities=table(quantities, quantity_rows(found)),
        margins=table(["", "as they are", "with margins of 1 mm", "times"], margin_rows(found)),
    )
