"""A million pairs of boxes: stated errors of the common volume, and proofs of a sample in rational arithmetic.

    python benchmarks million
    python benchmarks million --pairs 1000 --proved 10

The first took 8 minutes on one processor, beside other work.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

import numpy as np

from boxes.iou import proved_error
from harness.command import Wrong
from harness.results import of_machine, today, writing
from harness.timing import on_one_processor
from overlapper import Box, arrays, overlaps

RESULTS = of_machine("million_boxes.csv")
PAGE = "boxes.page"

OFFSETS = (1.0, 0.3, 0.1, 0.03, 0.01, 1e-3, 1e-5, 1e-8, 1e-12, 0.0)
ROTATIONS = ("yaw", "any")
AT_ONCE = 10_000  # pairs of one call
SMALLEST, LARGEST = 1e-3, 1e3  # m, of sides


def options(parser: ArgumentParser) -> None:
    classes = len(OFFSETS) * len(ROTATIONS)
    parser.add_argument("--pairs", type=int, default=1_000_000 // classes, help="pairs of each of the 20 classes")
    parser.add_argument("--proved", type=int, default=10_000 // classes, help="pairs of each class that are proved")


def pairs(rng: np.random.Generator, n: int, rotation: str, offset: float) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Sizes, positions and quaternions of boxes, and of boxes beside them.

    Sides are anything from a millimetre to a kilometre. The second box is moved along its sides by about the offset
    times its sides, and turned and stretched by about the offset.
    """
    sizes = np.exp(rng.uniform(np.log(SMALLEST), np.log(LARGEST), (n, 3)))
    positions = rng.uniform(-1, 1, (n, 3)) * sizes.max(1, keepdims=True)
    turns, change = rng.normal(size=(n, 4)), offset * rng.normal(size=(n, 4))
    if rotation == "yaw":
        turns[:, :2] = change[:, :2] = 0
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    axes = arrays.boxes(sizes, positions, turns).rotations
    moves = np.einsum("nij,nj->ni", axes, offset * rng.normal(size=(n, 3)) * sizes)
    stretched = sizes * np.exp(offset * rng.normal(size=(n, 3)))
    return [sizes, positions, turns], [stretched, positions + moves, turns + change]


def of_class(rng: np.random.Generator, chosen: Namespace, rotation: str, offset: float) -> dict[str, float]:
    """The figures of a class. Wrong if an IoU is above 1."""
    figures = {"pairs": 0, "overlapping": 0, "stated": 0.0, "above": 0, "proved": 0, "off": 0.0}
    for first in range(0, chosen.pairs, AT_ONCE):
        n = min(AT_ONCE, chosen.pairs - first)
        one, two = pairs(rng, n, rotation, offset)
        a, b = arrays.boxes(*one), arrays.boxes(*two)
        volumes, ratios = arrays.volume(a, b, aligned=True), arrays.iou(a, b, aligned=True)
        if (ratios > 1).any():
            raise Wrong(f"an IoU above 1 at the offset {offset:g}")
        shapes = [Box(size / 2) for size in np.vstack([one[0], two[0]])]
        rows = np.c_[np.arange(n), np.arange(n) + n]
        found = overlaps(shapes, np.vstack([one[1], two[1]]), np.vstack([one[2], two[2]]), pairs=rows)
        if not (np.abs(found.volume - volumes) <= found.volume_error + 1e-12 * volumes).all():
            raise Wrong(f"arrays and overlaps differ by more than their errors at the offset {offset:g}")
        solid = volumes > 0
        stated = found.volume_error[solid] / volumes[solid]
        figures["pairs"] += n
        figures["overlapping"] += int(solid.sum())
        figures["stated"] = max(figures["stated"], float(stated.max(initial=0)))
        figures["above"] += int((stated > 1e-12).sum())
        for k in np.flatnonzero(solid)[: max(0, chosen.proved - figures["proved"])]:
            off = proved_error(a, b, volumes, [k])
            figures["proved"] += 1
            figures["off"] = max(figures["off"], off)
    return figures


def measure(chosen: Namespace, path: Path) -> None:
    on_one_processor()
    rng = np.random.default_rng(0)
    with writing(path, ("rotation", "offset", "figure", "value"), today()) as write:
        for rotation in ROTATIONS:
            for offset in OFFSETS:
                found = of_class(rng, chosen, rotation, offset)
                write([(rotation, f"{offset:g}", figure, value) for figure, value in found.items()])
                figures = " ".join(f"{name} {value:.3g}" for name, value in found.items())
                print(f"{rotation:4} {offset:7g} {figures}", flush=True)
