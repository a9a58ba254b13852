"""The cost of round bodies beside two boxes: every class of pairs, cold single calls and batches, margins, and scenes.

    python benchmarks round              all again, two or three minutes, then the page and its picture
    python benchmarks round --pairs 50   fewer pairs of a class, sooner and less surely
    python benchmarks round --page       only the page, from the results there are

Classes take turns, in several rounds of one run on one processor, and in a round each pair of a class is asked once, so
that nothing is known of it; its time is the median of the rounds. Volumes of batches are compared with those of single
calls: if one bit differs, the run ends. Writes round.csv, a line per figure, to benchmarks/results/MACHINE, and the
page round.md with round.png and round.svg to docs.
"""

from __future__ import annotations

import time
import warnings
from argparse import ArgumentParser, Namespace
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations_with_replacement
from pathlib import Path
from statistics import mean, median
from typing import Any

import numpy as np
import pybullet as p
import pybullet_data

from harness import results
from harness.command import ROOT, Wrong
from harness.peers import Cold, strobl
from harness.timing import Stopwatch, in_turn, on_one_processor
from overlapper import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Overlaps,
    Placed,
    RoundedHull,
    Shape,
    Sphere,
    overlap,
)
from overlapper.scenes.scene import load_scene
from overlapper.simulation import Bodies, SkippedShapeWarning

RESULTS = results.of_machine("round.csv")
PAGE = "speed.round_page"

PAIRS, ROUNDS = 200, 5  # of each class, and how often each pair is asked
ENCLOSED = 4  # a pair that is enclosed by planes takes milliseconds: of such classes, so many times fewer
MARGIN = 1e-3  # m, what Bullet adds around convex meshes

MEASURES = (
    "volume", "volume_error", "centroid", "area", "normal", "depth", "gradient", "patch_area", "patch_centre",
    "patch_moments", "patch_distance",
)  # fmt: skip
COLUMNS = ("part", "name", "figure", "value")


def points(rng: np.random.Generator, count: int) -> np.ndarray:
    """On an ellipsoid, so that all are corners."""
    rows = rng.normal(size=(count, 3))
    return rows / np.linalg.norm(rows, axis=1)[:, None] * rng.uniform(0.3, 0.6, 3)


SHAPES: dict[str, Callable[[np.random.Generator], Shape]] = {
    "box": lambda rng: Box(rng.uniform(0.25, 0.5, 3)),
    "hull": lambda rng: Hull(points(rng, 20)),
    "half-space": lambda rng: HalfSpace([0, 0, 1], 0),
    "ball": lambda rng: Sphere(rng.uniform(0.3, 0.6)),
    "capsule": lambda rng: Capsule(rng.uniform(0.2, 0.4), rng.uniform(0.4, 1.0)),
    "cylinder": lambda rng: Cylinder(rng.uniform(0.2, 0.5), rng.uniform(0.4, 1.0)),
    "ellipsoid": lambda rng: Ellipsoid(rng.uniform(0.2, 0.6, 3)),
    "rounded hull": lambda rng: RoundedHull(points(rng, 20), rng.uniform(0.02, 0.1)),
    "mesh with margin": lambda rng: RoundedHull(points(rng, 60), MARGIN),
}
POLYHEDRA = ("box", "hull", "half-space")
BOXES = "box, box"
CLASSES = [
    pair for pair in combinations_with_replacement(SHAPES, 2) if pair != ("half-space", "half-space")
]  # what is common to two half-spaces is unbounded


@dataclass
class Class:
    """Pairs of two kinds of shapes that overlap, and how long each of them took."""

    name: str
    pairs: list[tuple[Placed, Placed]]
    ways: Counter[str]
    us: list[float]

    def figures(self) -> Iterator[tuple[str, float]]:
        yield "median", median(self.us)
        yield "mean", mean(self.us)
        yield "99 %", float(np.quantile(self.us, 0.99))
        for way, count in self.ways.most_common():
            yield way, 100 * count / len(self.pairs)


def made(rng: np.random.Generator, kinds: tuple[str, str], count: int) -> Class:
    """At random poses; half of the pairs as they come, half pulled apart until they share 10 to the -1 ... -6 m."""
    pairs: list[tuple[Placed, Placed]] = []
    while len(pairs) < count:
        shapes = [SHAPES[kind](rng) for kind in kinds]
        at = rng.normal(size=3) * 0.4
        a, b = Placed(shapes[0], at, rng.normal(size=4)), Placed(shapes[1], (0, 0, 0), rng.normal(size=4))
        found = overlap(a, b)
        if found and len(pairs) % 2:
            shallow = 10.0 ** -rng.uniform(1, 6)
            a = Placed(a.shape, at + max(0.0, found.depth - shallow) * found.normal, a.orientation)
            found = overlap(a, b)
        if found:
            pairs.append((a, b))
        if len(pairs) == count // ENCLOSED and all(overlap(*pair).way == "dual hull" for pair in pairs):
            break
    return Class(", ".join(kinds), pairs, Counter(overlap(*pair).way for pair in pairs), [])


Figure = tuple[str, str, str, float]  # part, name, figure, value


def us_of(calls: list[Callable[[], Any]], rounds: int) -> list[float]:
    """The median of each call. By the clock: that of the processor takes too long for calls of a microsecond."""
    return [1e6 * median(samples) for samples in in_turn(calls, rounds, clock=time.perf_counter)]


def volume_of(a: Placed, b: Placed) -> Callable[[], float]:
    return lambda: overlap(a, b).volume


def measured_classes(classes: list[Class], rounds: int) -> Iterator[Figure]:
    us = iter(us_of([volume_of(*pair) for each in classes for pair in each.pairs], rounds))
    for each in classes:
        each.us += [next(us) for _ in each.pairs]
        for figure, value in each.figures():
            yield "class", each.name, figure, value


def all_of(found: Any) -> None:
    for name in MEASURES:
        getattr(found, name)


BATCHES = ("a call, volume", "a call, all", "a batch", "a batch, all")


def measured_batches(classes: list[Class], rounds: int) -> Iterator[Figure]:
    """All pairs of a class in one call. Raises Wrong if a volume is not that of a call for its pair alone."""
    asked: list[Callable[[], Any]] = []
    for each in classes:
        batch = Cold(each.pairs)
        if batch().volume.tolist() != [overlap(*pair).volume for pair in each.pairs]:
            raise Wrong(f"{each.name}: volumes of a batch are not those of single calls")
        asked += [
            lambda pairs=each.pairs: [overlap(a, b).volume for a, b in pairs],
            lambda pairs=each.pairs: [all_of(overlap(a, b)) for a, b in pairs],
            batch,
            lambda batch=batch: all_of(batch()),
        ]
    us = iter(us_of(asked, rounds))
    for each in classes:
        for figure in BATCHES:
            yield "batch", each.name, figure, next(us) / len(each.pairs)


def measured_margins(rng: np.random.Generator, count: int, rounds: int) -> Iterator[Figure]:
    """Pairs of meshes as they are, and with margins."""
    for corners in (8, 20, 60, 200):
        bare = []
        while len(bare) < count:
            clouds, turns, at = [points(rng, corners) for _ in range(2)], rng.normal(size=(2, 4)), rng.normal(size=3)
            pair = [Placed(Hull(cloud), 0.3 * k * at, turns[k]) for k, cloud in enumerate(clouds)]
            if overlap(*pair):
                bare.append(pair)
        grown = [
            [Placed(RoundedHull(each.shape.vertices, MARGIN), each.position, each.orientation) for each in pair]
            for pair in bare
        ]
        us = us_of([volume_of(*pair) for both in zip(bare, grown) for pair in both], rounds)
        for figure, values in (("nominal", us[::2]), ("with margins", us[1::2])):
            yield "margin", f"meshes of {corners} corners", figure, median(values)


def measured_peer(balls: list[tuple[Placed, Placed]], rounds: int) -> Iterator[Figure]:
    """The package `overlap`: balls and boxes, and a ball of 0.5 m over a right edge, shallower and shallower."""
    cube = Placed(Box([1, 1, 1]))
    pairs = {"at random": balls}
    for k in range(1, 11):
        place = 1 + (0.5 - 10.0**-k) / 2**0.5
        pairs[f"1e-{k}"] = [(Placed(Sphere(0.5), (place, place, 0.0625)), cube)]
    for name, some in pairs.items():
        try:
            peers = [strobl(pair, None) for pair in some]
        except ImportError:
            return
        us = us_of([ask for pair, peer in zip(some, peers) for ask in (volume_of(*pair), peer)], 20 * rounds)
        yield "overlap", name, "ours", median(us[::2])
        yield "overlap", name, "overlap", median(us[1::2])
        if name != "at random":
            (pair,), (peer,) = some, peers
            truth = over_an_edge(pair[0])
            yield "overlap", name, "error, ours", abs(overlap(*pair).volume - truth) / truth
            yield "overlap", name, "error, overlap", abs(peer() - truth) / truth


def over_an_edge(ball: Placed) -> float:
    """The volume that a ball over the edge x = y = 1 shares with a cube: discs cut by two lines, in 50 digits."""
    import mpmath

    with mpmath.workdps(50):
        r, out = mpmath.mpf(ball.shape.radius), mpmath.mpf(float(ball.position[0])) - 1

        def area(u: Any) -> Any:
            """The part of the disc of radius r cos u that is within both lines, each as far from the centre."""
            rho = r * mpmath.cos(u)
            if rho**2 <= 2 * out**2:
                return mpmath.mpf(0)
            end = mpmath.sqrt(rho**2 - out**2)
            angle = mpmath.pi / 2 - 2 * mpmath.asin(out / rho)
            return rho**2 * angle / 2 - out * (end - out)

        last = mpmath.acos(out * mpmath.sqrt(2) / r)
        return float(2 * mpmath.quad(lambda u: area(u) * r * mpmath.cos(u), [0, last / 2, last]))


# Scenes


def humanoids(client: int) -> None:
    """Fifty of pybullet's humanoids of eight capsules, five balls and two boxes, limp, fallen on a heap."""
    for k in range(50):
        place = [0.7 * (k % 5 - 2), 0.7 * (k // 5 % 5 - 2), 1.0 + 1.5 * (k // 25)]
        turn = p.getQuaternionFromEuler([0.3 * k, 0.7 * k, 0.2 * k])
        p.loadURDF("humanoid/humanoid.urdf", place, turn, globalScaling=0.25, physicsClientId=client)


ROBOTS = (
    "r2d2.urdf", "humanoid/humanoid.urdf", "laikago/laikago_toes_zup.urdf", "a1/a1.urdf",
    "mini_cheetah/mini_cheetah.urdf", "husky/husky.urdf",
)  # fmt: skip


def robots(client: int) -> None:
    """Six of each of six kinds, fallen on a heap."""
    for k in range(36):
        name, place = ROBOTS[k % 6], [0.6 * (k // 6 % 3 - 1), 0.6 * (k // 18 - 0.5), 0.6 + 0.5 * (k % 6)]
        scaling = 0.25 if "humanoid" in name else 1.0
        p.loadURDF(name, place, globalScaling=scaling, physicsClientId=client)


def on_a_plane(build: Callable[[int], None]) -> Callable[[int], None]:
    def filled(client: int) -> None:
        p.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=client)
        p.setGravity(0, 0, -9.81, physicsClientId=client)
        p.loadURDF("plane.urdf", physicsClientId=client)
        build(client)

    return filled


@dataclass(frozen=True)
class Heap:
    """A scene; the first steps are not timed if bodies have to fall first."""

    build: Callable[[int], Any]
    falling: int
    steps: int
    surface: str = "nominal"
    measures: tuple[str, ...] = ("volume",)


def heaps() -> dict[str, Heap]:
    balls, objects = (load_scene(ROOT / "scenes" / f"{name}.py") for name in ("bin_of_balls", "random_objects_pile"))
    return {
        "bin_of_balls": Heap(balls.build, 0, balls.steps),
        "fifty capsule humanoids": Heap(on_a_plane(humanoids), 200, 60),
        "random_objects_pile, with margins": Heap(objects.build, 0, objects.steps, "margin"),
        "36 mixed robots, all measures": Heap(on_a_plane(robots), 200, 60, measures=MEASURES),
    }


def measured_scene(name: str, heap: Heap) -> Iterator[Figure]:
    client, watch = p.connect(p.DIRECT), Stopwatch()
    ours, theirs, overlapping, round_ones = [], [], [], []
    try:
        heap.build(client)
        bodies = Bodies(client, surface=heap.surface)
        flat = np.array([isinstance(shape, (Box, Hull, HalfSpace)) for shape in bodies.shapes])

        def ask() -> Overlaps:
            bodies.update()
            found = bodies.overlaps().overlaps
            for measure in heap.measures:
                getattr(found, measure)
            return found

        for step in range(heap.falling + heap.steps):
            watch("theirs", p.stepSimulation, client)
            if step < heap.falling:
                continue
            found = watch("ours", ask)
            taken = watch.take()
            ours.append(taken["ours"])
            theirs.append(taken["theirs"])
            overlapping.append(int((found.volume > 0).sum()))
            round_ones.append(int((~flat[found.pairs].all(axis=1) & (found.volume > 0)).sum()))
    finally:
        p.disconnect(client)
    for figure, value in (
        ("ours", median(ours)),
        ("stepSimulation", median(theirs)),
        ("pairs", mean(overlapping)),
        ("round", mean(round_ones)),
    ):
        yield "scene", name, figure, value


def measured(pairs: int, rounds: int) -> Iterator[Figure]:
    warnings.simplefilter("ignore", SkippedShapeWarning)
    rng = np.random.default_rng(0)
    classes = [made(rng, kinds, pairs) for kinds in CLASSES]
    yield from measured_classes(classes, rounds)
    yield from measured_batches(classes, rounds)
    yield from measured_margins(rng, pairs, rounds)
    yield from measured_peer(next(each.pairs for each in classes if each.name == "box, ball"), rounds)
    for name, heap in heaps().items():
        yield from measured_scene(name, heap)


def options(parser: ArgumentParser) -> None:
    parser.add_argument("--pairs", type=int, default=PAIRS, help="of each class")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="how often each pair is asked")


def measure(chosen: Namespace, path: Path) -> None:
    on_one_processor()
    found = list(measured(chosen.pairs, chosen.rounds))
    with results.writing(path, COLUMNS, results.today()) as write:
        write((*names, f"{value:.4g}") for *names, value in found)
