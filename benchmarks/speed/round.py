"""The cost of round bodies beside two boxes: every class of pairs in single calls, and meshes with margins.

    python benchmarks round              all again, a minute or two, then the page and its picture
    python benchmarks round --pairs 50   fewer pairs of a class, sooner and less surely
    python benchmarks round --page       only the page, from the results there are

Classes take turns, in several rounds of one run on one processor. In a round each pair of a class is asked once, so
that nothing is known of it; its time is the median of the rounds. Writes round.csv, a line per figure, to
benchmarks/results/MACHINE, and the page round.md with round.png to docs.
"""

from __future__ import annotations

import time
from argparse import ArgumentParser, Namespace
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from itertools import combinations_with_replacement
from operator import attrgetter
from pathlib import Path
from statistics import mean, median

import numpy as np

from harness import results
from harness.peers import Cold
from harness.timing import in_turn, on_one_processor
from overlapper import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, Placed, RoundedHull, Shape, Sphere, overlap

RESULTS = results.of_machine("round.csv")
PAGE = "speed.round_page"

ENCLOSED = 4  # a pair that is enclosed by planes takes milliseconds: of such classes, so many times fewer
MARGIN = 1e-3  # m, what Bullet adds around convex meshes
COLUMNS = ("part", "name", "figure", "value")

# Classes whose other quantities are measured, too, and what single calls are asked for.
QUANTITIES = (
    *("box, box", "box, ball", "box, capsule", "box, cylinder", "box, ellipsoid", "box, rounded hull", "ball, ball"),
    *("capsule, capsule", "cylinder, cylinder", "ellipsoid, ellipsoid"),
)
SIX = attrgetter("volume", "centroid", "area", "normal", "depth", "gradient")
ASKED = {"volume": attrgetter("volume"), "patch": attrgetter("patch_moments"), "errors": attrgetter("errors")}

Pair = tuple[Placed, Placed]
Figure = tuple[str, str, str, float]  # part, name, figure, value


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
# Two half-spaces share an unbounded set.
CLASSES = [pair for pair in combinations_with_replacement(SHAPES, 2) if pair != ("half-space", "half-space")]


def made(rng: np.random.Generator, kinds: tuple[str, str], count: int) -> list[Pair]:
    """Overlapping pairs at random poses; every second is pulled apart until it shares 10 to the -1 ... -6 m."""
    pairs: list[Pair] = []
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
    return pairs


def us_of(pairs: Iterable[Pair], rounds: int) -> list[float]:
    """The median of each. By the clock: reading the clock of the processor takes as long as a call."""
    calls = [lambda a=a, b=b: overlap(a, b).volume for a, b in pairs]
    return [1e6 * median(samples) for samples in in_turn(calls, rounds, clock=time.perf_counter)]


def measured_classes(classes: dict[str, list[Pair]], rounds: int) -> Iterator[Figure]:
    us = iter(us_of((pair for pairs in classes.values() for pair in pairs), rounds))
    for name, pairs in classes.items():
        taken = [next(us) for _ in pairs]
        yield "class", name, "median", median(taken)
        yield "class", name, "mean", mean(taken)
        yield "class", name, "99 %", float(np.quantile(taken, 0.99))
        for way, count in Counter(overlap(*pair).way for pair in pairs).most_common():
            yield "class", name, way, 100 * count / len(pairs)


def measured_quantities(classes: dict[str, list[Pair]], rounds: int) -> Iterator[Figure]:
    """The medians of single calls that are asked for other quantities, and the time of a pair in a batch."""
    for name in QUANTITIES:
        pairs = classes[name]
        batch = Cold(pairs)
        for figure, ask in ASKED.items():
            calls = [lambda a=a, b=b: ask(overlap(a, b)) for a, b in pairs]  # noqa: B023
            yield "quantity", name, figure, 1e6 * median(map(median, in_turn(calls, rounds, clock=time.perf_counter)))
        calls = [lambda a=a, b=b: SIX(overlap(a, b)) for a, b in pairs]

        def together() -> None:
            SIX(batch())  # noqa: B023

        def alone() -> None:
            for call in calls:  # noqa: B023
                call()

        both = in_turn([alone, together], max(rounds, 3), clock=time.perf_counter)
        for figure, samples in zip(("six, calls", "six, batch"), both):
            yield "quantity", name, figure, 1e6 * median(samples) / len(pairs)


def measured_margins(rng: np.random.Generator, count: int, rounds: int) -> Iterator[Figure]:
    """The same pairs of meshes as they are and with margins."""

    def grown(body: Placed) -> Placed:
        return Placed(RoundedHull(body.shape.vertices, MARGIN), body.position, body.orientation)

    for corners in (8, 20, 60, 200):
        both: list[Pair] = []
        while len(both) < 2 * count:
            clouds, turns, at = [points(rng, corners) for _ in range(2)], rng.normal(size=(2, 4)), rng.normal(size=3)
            a, b = (Placed(Hull(cloud), 0.3 * k * at, turns[k]) for k, cloud in enumerate(clouds))
            if overlap(a, b):
                both += [(a, b), (grown(a), grown(b))]
        us = us_of(both, rounds)
        for figure, values in (("nominal", us[::2]), ("with margins", us[1::2])):
            yield "margin", f"meshes of {corners} corners", figure, median(values)


def options(parser: ArgumentParser) -> None:
    parser.add_argument("--pairs", type=int, default=200, help="of each class")
    parser.add_argument("--rounds", type=int, default=5, help="how often each pair is asked")


def measure(chosen: Namespace, path: Path) -> None:
    on_one_processor()
    rng = np.random.default_rng(0)
    classes = {", ".join(kinds): made(rng, kinds, chosen.pairs) for kinds in CLASSES}
    found = [
        *measured_classes(classes, chosen.rounds),
        *measured_quantities(classes, chosen.rounds),
        *measured_margins(rng, chosen.pairs, chosen.rounds),
    ]
    with results.writing(path, COLUMNS, results.today()) as write:
        write((*names, f"{value:.4g}") for *names, value in found)
