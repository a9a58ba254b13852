"""Times of impact of this package beside FCL's continuous collision, on the same motions.

    python benchmarks motion

A body moves along a line and turns about its position at a constant rate between two poses. This is the motion of
`time_of_impact`, and also FCL's CCDM_LINEAR. FCL's CCDM_TRANS, the default, leaves the turn out.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import Any

import fcl
import numpy as np
from first_touch import exact_first_touch
from strategies import hull_points, quaternion, turn
from strategies import product as turned_by

from harness.bodies import of_fcl, rotation
from harness.command import Wrong
from harness.results import of_machine, today, writing
from harness.timing import in_turn, on_one_processor
from overlapper import (
    Box,
    Capsule,
    Cylinder,
    Hull,
    Placed,
    Sphere,
    TimeOfImpact,
    overlap,
    time_of_impact,
    times_of_impact,
)

RESULTS = of_machine("motion.csv")
PAGE = "motion.page"

MOTIONS = 300  # of each kind
SAMPLES = 40  # poses before the time of impact that are tested, of each motion
ROUNDS = 3  # in which each call is timed

FRAME = ("position", "orientation")

Motion = tuple[Placed, Placed, Placed, Placed]  # both bodies at the start, then at the end


@dataclass(frozen=True)
class Kind:
    """A kind of motions: the name, two shapes, the largest turn in radians, and the gap in m of a pass."""

    name: str
    shapes: Callable[[np.random.Generator], tuple[Any, Any]]
    turn: float = 0.0
    gap: float | None = None


def box(rng: np.random.Generator) -> Box:
    return Box(rng.integers(200, 800, 3) / 1024)


KINDS = (
    Kind("boxes, translated", lambda rng: (box(rng), box(rng))),
    Kind("boxes, turned", lambda rng: (box(rng), box(rng)), 2.5),
    Kind("ball and sheet", lambda rng: (Sphere(rng.uniform(0.002, 0.02)), Box([1, 1, 0.0005]))),
    Kind("capsule and box, turned", lambda rng: (Capsule(*rng.uniform(0.2, 0.8, 2)), box(rng)), 2.5),
    Kind("cylinder and box, turned", lambda rng: (Cylinder(*rng.uniform(0.2, 0.8, 2)), box(rng)), 2.5),
    Kind("hulls, turned", lambda rng: (Hull(hull_points(rng, 16) / 2), Hull(hull_points(rng, 16) / 2)), 2.5),
    Kind("boxes pass, gap 1e-6 m", lambda rng: (box(rng), box(rng)), gap=1e-6),
    Kind("boxes pass, depth 1e-6 m", lambda rng: (box(rng), box(rng)), gap=-1e-6),
)


def motions(kind: Kind, seed: int, count: int) -> Iterator[Motion]:
    rng = np.random.default_rng([seed, *kind.name.encode()])
    for _ in range(count):
        a, b = kind.shapes(rng)
        if kind.gap is not None:
            yield passing(a, b, kind.gap, rng)
            continue
        start = rng.normal(size=3)
        start *= 3 / np.linalg.norm(start)
        if kind.name == "ball and sheet":
            start = np.array([*rng.uniform(-0.5, 0.5, 2), rng.uniform(1, 2)])
            orientations = [np.array([0, 0, 0, 1.0])] * 2
        else:
            orientations = [quaternion(rng), quaternion(rng)]
        end = -start * rng.uniform(0.2, 1) + rng.normal(size=3) * 0.4
        turns = [turn(rng.normal(size=3)), turn(rng.normal(size=3))] if kind.turn else []
        ends = [turned_by(shorter(each, kind.turn, rng), q) for each, q in zip(turns, orientations)] or orientations
        yield (
            Placed(a, start, orientations[0]),
            Placed(b, (0, 0, 0), orientations[1]),
            Placed(a, end, ends[0]),
            Placed(b, rng.normal(size=3) * 0.3 * bool(kind.turn), ends[1]),
        )


def shorter(q: np.ndarray, most: float, rng: np.random.Generator) -> np.ndarray:
    """A turn about the axis of `q` by at most `most` radians."""
    axis = q[:3] / np.linalg.norm(q[:3])
    return turn(axis * rng.uniform(0, most))


def passing(a: Box, b: Box, gap: float, rng: np.random.Generator) -> Motion:
    """The first box flies along the second one: their facets pass with a gap, or overlap if the gap is negative."""
    height = a.half_extents[2] + b.half_extents[2] + gap
    start = np.array([-3.0, rng.uniform(-0.1, 0.1), height])
    end = start + (6, 0, 0)
    return Placed(a, start), Placed(b), Placed(a, end), Placed(b)


def at(start: Placed, end: Placed, ours: Callable[[float], np.ndarray], time: float) -> Placed:
    return Placed(start.shape, start.position + time * (end.position - start.position), ours(time))


def turning(start: Placed, end: Placed) -> Callable[[float], np.ndarray]:
    """The orientation at a time from 0 to 1, with a constant rate the shorter way."""
    p = start.orientation
    between = turned_by(end.orientation, p * (-1, -1, -1, 1))
    if between[3] < 0:
        between = -between
    sine = np.linalg.norm(between[:3])
    if sine < 1e-15:
        return lambda time: p
    vector = 2 * np.arctan2(sine, between[3]) * between[:3] / sine
    return lambda time: turned_by(turn(vector * time), p)


def ours_of(motion: Motion) -> TimeOfImpact:
    a, b, end_a, end_b = motion
    return time_of_impact(a, b, end_a, end_b)


def check(kind: Kind, motion: Motion, found: TimeOfImpact) -> None:
    """Raises Wrong if an answer of this package contradicts the exact time or the poses before and after it."""
    a, b, end_a, end_b = motion
    told = f"{kind.name}: {motion} gave {found}"
    if not kind.turn and isinstance(a.shape, Box):
        truth = exact_first_touch(a, b, end_a.position - a.position)
        if (truth is None or truth > 1) != (not found):
            raise Wrong(told)
        if found and not found.time <= truth <= found.time_upper:
            raise Wrong(told)
    ways = [(each, end, turning(each, end)) for each, end in ((a, end_a), (b, end_b))]
    until = found.time if found else 1.0
    for time in np.linspace(0, until, SAMPLES, endpoint=False):
        both = overlap(*(at(*way, time) for way in ways))
        if both and both.depth > 1e-12:
            raise Wrong(told)
    if found.status == "impact" and not overlap(*(at(*way, found.time_upper) for way in ways)):
        raise Wrong(told)
    if found.status not in ("impact", "separated"):
        raise Wrong(told)


# Names of FCL's settings: solver, and solver of distances. 1,000 poses of the naive solver.
CONSERVATIVE, NAIVE = fcl.CCDSolverType.CCDC_CONSERVATIVE_ADVANCEMENT, fcl.CCDSolverType.CCDC_NAIVE
SETTINGS = {
    "advancement, libccd": (CONSERVATIVE, fcl.GJKSolverType.GST_LIBCCD, 10),
    "advancement, indep": (CONSERVATIVE, fcl.GJKSolverType.GST_INDEP, 10),
    "1,000 poses": (NAIVE, fcl.GJKSolverType.GST_LIBCCD, 1000),
}


def of_peer(motion: Motion, setting: str) -> Callable[[], tuple[bool, float]]:
    """A call of FCL. The time is from 0 to 1. Each call needs a result of its own, as FCL's are sums over calls."""
    solver, distances, poses = SETTINGS[setting]
    request = fcl.ContinuousCollisionRequest(poses, 1e-9, fcl.CCDMotionType.CCDM_LINEAR, distances, solver)
    a, b = of_fcl(motion[0]), of_fcl(motion[1])
    ends = [fcl.Transform(rotation(end.orientation), end.position) for end in motion[2:]]

    def ask() -> tuple[bool, float]:
        result = fcl.ContinuousCollisionResult()
        fcl.continuousCollide(a, ends[0], b, ends[1], request, result)
        return result.is_collide, result.time_of_contact

    return ask


def figures(kind: Kind, count: int) -> Iterator[tuple[str, str, str, float]]:
    """Rows: kind, library, figure, value."""
    cases = list(motions(kind, 1, count))
    truths = [ours_of(motion) for motion in cases]
    for motion, truth in zip(cases, truths):
        check(kind, motion, truth)
    hits = [bool(truth) for truth in truths]
    yield kind.name, "truth", "hits", sum(hits)
    yield kind.name, "ours", "widest", max((t.time_upper - t.time for t in truths if t), default=0.0)
    peers = {name: [of_peer(motion, name) for motion in cases] for name in SETTINGS}
    for name, asked in peers.items():
        told = [ask() for ask in asked]
        early = [t.time - time for t, (hit, time) in zip(truths, told) if t and hit]
        late = [time - t.time_upper for t, (hit, time) in zip(truths, told) if t and hit]
        yield kind.name, name, "missed", sum(bool(t) and not hit for t, (hit, _) in zip(truths, told))
        yield kind.name, name, "false", sum(hit and not t for t, (hit, _) in zip(truths, told))
        yield kind.name, name, "early", max([0.0, *early])
        yield kind.name, name, "late", sum(each > 0 for each in late)
        yield kind.name, name, "latest", max([0.0, *late])
    spent: dict[str, list[float]] = {}
    for k, motion in enumerate(cases):
        calls = {"ours": lambda motion=motion: ours_of(motion), **{name: asked[k] for name, asked in peers.items()}}
        for name, samples in zip(calls, in_turn(list(calls.values()), ROUNDS)):
            spent.setdefault(name, []).append(1e6 * median(samples))
    spent["ours, one call"] = in_one_call(cases)
    for name, times in spent.items():
        yield kind.name, name, "us", median(times)
        yield kind.name, name, "us slowest", max(times)


def in_one_call(cases: list[Motion]) -> list[float]:
    """µs of a motion if one call of one thread takes all of them: a list of one."""
    starts, ends = ([body for case in cases for body in case[k : k + 2]] for k in (0, 2))
    poses = [np.array([getattr(body, name) for body in each]) for each in (starts, ends) for name in FRAME]
    shapes, pairs = [body.shape for body in starts], np.arange(2 * len(cases)).reshape(-1, 2)
    (samples,) = in_turn([lambda: times_of_impact(shapes, *poses, pairs)], ROUNDS)
    return [1e6 * median(samples) / len(cases)]


def measure(chosen: Namespace, path: Path) -> None:
    on_one_processor()
    note = f"{today()}; overlapper {version('overlapper')}, python-fcl {version('python-fcl')}"
    with writing(path, ("kind", "library", "figure", "value"), note) as write:
        for kind in KINDS:
            write(figures(kind, MOTIONS))
