"""Volumetric contact beside the formulae of textbooks, and beside Bullet's own contact in steps as long.

    python benchmarks physics          all again, a minute or two, then the page and its pictures
    python benchmarks physics --page   only the page, from the results there are

The experiments are those of the tests, tests/support/contact_experiments.py. Writes forces.csv, a line per figure, to
benchmarks/results, and the page forces.md with its pictures to docs.
"""

from __future__ import annotations

import math
import warnings
from argparse import Namespace
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import contact_experiments as experiments
import numpy as np
from contact_experiments import HALF, STEP, G

from harness import results
from overlapper import Box, Placed, overlap
from overlapper.simulation import SubstepsWarning

RESULTS = results.FOLDER / "forces.csv"
PAGE = "forces.page"
LAWS = ("volumetric", "bullet")
SUBSTEPS = (1, 2, 4, 8, 16, 32, 64)
FEW = (1, 4, 20)
WINDOW = 12  # steps: of so many values of a series, the largest is kept


class Row(NamedTuple):
    experiment: str
    law: str
    case: str
    at: Any
    value: float


def rests() -> Iterator[Row]:
    """How far the depth is from m g / k A after three seconds, and how fast a tilted cube still is, on the way."""
    for stiffness in (1e7, 1e8, 1e9):
        seen = experiments.rattle(stiffness=stiffness)
        case = f"{stiffness:.0e} Pa/m"
        yield Row("rest", "volumetric", case, "depth", seen["depth"][-1] / (G / (stiffness * 4 * HALF**2)) - 1)
        yield from rattling("volumetric", case, seen)
    for substeps in (1, 4):
        yield from rattling("bullet", f"{substeps} substeps", experiments.rattle("bullet", substeps=substeps))


def rattling(law: str, case: str, seen: dict[str, np.ndarray]) -> Iterator[Row]:
    speed = seen["speed"] + HALF * seen["spin"]
    yield Row("rest", law, case, "speed", speed[-1])
    for last in range(WINDOW, len(speed) + 1, WINDOW):
        yield Row("rattle", law, case, f"{last * STEP:.3f}", speed[last - WINDOW : last].max())


def bounces() -> Iterator[Row]:
    for law in LAWS:
        for pose in experiments.POSES if law == "volumetric" else ("face", "edge"):
            for substeps in SUBSTEPS:
                yield Row("bounce", law, pose, substeps, experiments.bounce(pose, substeps, law))


def rebounds() -> Iterator[Row]:
    """The speed after a bounce on a face over that before, and what is foretold."""
    yield Row("rebound", "volumetric", "measured", 5e-4, experiments.restitution(5e-4))
    yield Row("rebound", "volumetric", "foretold", 5e-4, experiments.rebound(5e-4))


def slides() -> Iterator[Row]:
    for law in LAWS:
        for substeps in FEW:
            yield Row("slide", law, "", substeps, experiments.slide(substeps, law))


def inclines() -> Iterator[Row]:
    """The acceleration over g."""
    for law in LAWS:
        for slope in (0.99, 0.997, 0.999, 1.001, 1.003, 1.01):
            acceleration, way = experiments.incline(slope, law)
            yield Row("incline", law, "acceleration", slope, acceleration / G)
            yield Row("incline", law, "way", slope, way)


def shoves() -> Iterator[Row]:
    yield Row("shove", "volumetric", "box", "way", experiments.shove()[0])


def spins() -> Iterator[Row]:
    for law in LAWS:
        for shape in ("box", "disc"):
            for substeps in FEW:
                stopped, foretold = experiments.spin(shape, substeps, law)
                yield Row("spin", law, shape, substeps, stopped / foretold)


def slides_and_spins() -> Iterator[Row]:
    rigid = experiments.rigid_slide_and_spin("box")
    for case, law, friction in (
        ("box ellipsoid", "volumetric", None),
        ("box distributed", "volumetric", "distributed"),
        ("box", "bullet", None),
    ):
        found = experiments.slide_and_spin("box", law, friction)
        for figure in ("way", "angle"):
            yield Row("slide and spin", law, case, figure, getattr(found, figure) / getattr(rigid, figure))


def rolls() -> Iterator[Row]:
    """The speed after a second over that before, and the change of energy without dissipation."""
    for shape in ("cylinder", "ball"):
        for tau in (0.0, 5e-4, 1e-3, 2e-3, 4e-3):
            v0, v1, e0, e1 = experiments.roll(shape, stiffness=1e8, dissipation=tau)
            yield Row("roll", "volumetric", shape, tau, v1 / v0)
            if not tau:
                yield Row("roll", "volumetric", shape, "energy", e1 / e0 - 1)
        v0, v1, e0, e1 = experiments.roll(shape, "bullet")
        yield Row("roll", "bullet", shape, 0.0, v1 / v0)
        yield Row("roll", "bullet", shape, "energy", e1 / e0 - 1)


def pushes() -> Iterator[Row]:
    angle = math.radians(45)
    for law in LAWS:
        for name, velocity in zip(("box", "balls"), experiments.simbenchmark(angle, law)):
            yield Row("push", law, name, 45, velocity @ [math.cos(angle), math.sin(angle)])


def grips() -> Iterator[Row]:
    for law in LAWS:
        yield Row("grip", law, "speed", 1.01, abs(experiments.grip(1.01, law).speed))
        yield Row("grip", law, "acceleration", 0.99, -experiments.grip(0.99, law).acceleration / G)


def turntables() -> Iterator[Row]:
    for law in LAWS:
        yield Row("turntable", law, "drift", 3, abs(experiments.turntable(3, law)[0]))


def stacks() -> Iterator[Row]:
    for stiffness, name in ((1e8, "1e8 Pa/m"), (1e7, "1e7 Pa/m")):
        drift, speed = experiments.stack(stiffness=stiffness)
        yield Row("stack", "volumetric", name, "drift", drift)
        yield Row("stack", "volumetric", name, "speed", speed)
    for substeps in (1, 4):
        drift, speed = experiments.stack("bullet", substeps=substeps)
        yield Row("stack", "bullet", f"{substeps} substeps", "drift", drift)
        yield Row("stack", "bullet", f"{substeps} substeps", "speed", speed)


def loops() -> Iterator[Row]:
    """The work on a box that goes round a circle over the rim of another, over the energy stored; 0 of a potential."""
    box, across, depth, radius, nodes = Box([HALF] * 3), 0.03, 2e-3, 1e-3, 256
    below, work, stored = Placed(box), 0.0, 0.0
    for turn in 2 * math.pi * np.arange(nodes) / nodes:
        at = (2 * HALF - across + radius * math.cos(turn), 0, 2 * HALF - depth + radius * math.sin(turn))
        shared = overlap(Placed(box, at), below)
        out = -shared.gradient[0, :3]
        force = shared.volume * out / np.linalg.norm(out)
        work += float(force @ [-math.sin(turn), 0, math.cos(turn)]) * radius * 2 * math.pi / nodes
        stored = max(stored, shared.volume * (depth - radius * math.sin(turn)) / 2)
    yield Row("loop", "volumetric", "over a rim", "work", abs(work) / stored)


def collisions() -> Iterator[Row]:
    """Bodies in space, without friction and dissipation: the change of their energy, by seed."""
    for kind in ("cubes", "balls"):
        for substeps in (16, 64):
            for seed in range(3):
                change = experiments.collide(kind, substeps, seed) - 1
                yield Row("collide", "volumetric", f"{kind} in {substeps} substeps", seed, change)


PARTS = (
    rests, bounces, rebounds, slides, inclines, shoves, spins, slides_and_spins, rolls, pushes, grips,
    turntables, stacks, loops, collisions,
)  # fmt: skip


def measure(_: Namespace, path: Path) -> None:
    rows: list[Row] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SubstepsWarning)  # few are taken to see what is lost
        for part in PARTS:
            rows += part()
            print(f"{part.__name__}: measured", flush=True)
    with results.writing(path, Row._fields) as write:
        write((*row[:-1], f"{row.value:.10g}") for row in rows)
