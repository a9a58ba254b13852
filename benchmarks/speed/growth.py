"""Which inputs take time out of proportion to their size: families of them, sizes in steps, and the exponent of growth.

    python benchmarks growth                             every family and question, as far as a second or two each
    python benchmarks growth --family cone --ask paper   one family, one question
    python benchmarks growth --rounds 200 --seed 1       then so many changes of the worst, keeping what is worse

A family is a function of a number of points and a generator; a question is asked of its hull, placed twice. Each answer
is timed in processor time in a process that is watched, and of three the median kept; sizes are doubled until one takes
two seconds. The exponent is that from the third last size to the last: 1 is in proportion, 2 is quadratic.
The command fails if one is above the limit at a size that takes a tenth of a second or more, or has no answer in time:
of quicker ones, caches and first calls are what is measured.
"""

from __future__ import annotations

import math
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray
from strategies import directions

from harness.timing import timed
from harness.watched import Watched
from overlapper import Capsule, Cylinder, Hull, Placed, RoundedHull, Shape, Sphere, distance, overlap

TIME_LIMIT = 20.0  # s, for three answers of one size; a larger one is not asked for after a tenth of it
WORTH_TIMING = 0.1  # s, of the largest size, below which an exponent says little
MOST_EXPONENT = 1.6

Points = NDArray[np.float64]


def around(turns: np.ndarray, z: float = 0.0) -> Points:
    """On a circle of radius one."""
    return np.column_stack([np.cos(turns), np.sin(turns), np.full(len(turns), z)])


def circle(n: int, rng: np.random.Generator) -> Points:
    return around(rng.uniform(0, 2 * np.pi, n))


def evenly(n: int) -> np.ndarray:
    """Angles."""
    return 2 * np.pi * np.arange(n) / n


def prism(n: int) -> Points:
    return np.vstack([around(evenly(n // 2), 1.0), around(evenly(n // 2), -1.0)])


def globe(n: int) -> Points:
    """Points on eight parallels, and two poles."""
    tilts = np.pi * (np.arange(8) + 0.5) / 8
    rings = [around(evenly(n // 8)) * np.sin(t) + [0, 0, np.cos(t)] for t in tilts]
    return np.vstack([*rings, [[0, 0, 1], [0, 0, -1]]])


def trigonometric_curve(n: int) -> Points:
    return around(evenly(n)) + np.cos(2 * evenly(n))[:, None] * [0, 0, 1]


def skew(n: int, rng: np.random.Generator, bulge: float) -> Points:
    """Two lines or arcs that cross each other at a distance."""
    t, u = rng.uniform(-1, 1, (2, n // 2))
    one, other = bulge * (1 - t**2), bulge * (1 - u**2)
    return np.vstack([np.c_[t, 0 * t, -1 - one], np.c_[0 * u, u, 1 + other]])


def grid(n: int) -> Points:
    side = max(2, round(math.sqrt(n / 2)))
    return np.array(list(np.ndindex(side, side, 2)), float)


def spiral(t: np.ndarray) -> Points:
    return np.column_stack([t * np.cos(40 * t), t * np.sin(40 * t), t])


FAMILIES: dict[str, Callable[[int, np.random.Generator], Points]] = {
    "cone": lambda n, rng: np.vstack([circle(n, rng), [[0, 0, 1]]]),
    "double_cone": lambda n, rng: np.vstack([circle(n, rng), [[0, 0, 1], [0.1, 0, -1]]]),
    "blunt_cone": lambda n, rng: np.vstack([circle(n // 2, rng), circle(n // 2, rng) * 1e-9 + [0, 0, 1]]),
    "prism": lambda n, _: prism(n),
    "plate": lambda n, _: prism(n) * [1, 1, 1e-6],
    "needle": lambda n, rng: directions(rng, n) * [1e-5, 1e-5, 1],
    "lens": lambda n, rng: directions(rng, n) * [1, 1, 1e-5],
    "ball": lambda n, rng: directions(rng, n),
    "cloud": lambda n, rng: rng.normal(size=(n, 3)),
    "globe": lambda n, _: globe(n),
    "moment_curve": lambda n, _: np.linspace(0, 1, n)[:, None] ** [1, 2, 3],
    "trigonometric_curve": lambda n, _: trigonometric_curve(n),
    "skew_lines": lambda n, rng: skew(n, rng, 0.0),
    "skew_arcs": lambda n, rng: skew(n, rng, 0.5),
    "grid": lambda n, _: grid(n),
    "duplicates": lambda n, rng: rng.choice(directions(rng, 20), n),
    "nearly_duplicates": lambda n, rng: rng.choice(directions(rng, 20), n) + rng.normal(size=(n, 3)) * 1e-15,
    "spiral": lambda n, _: spiral(np.linspace(0, 1, n)),
}

ROUND: dict[str, Callable[[float], Shape]] = {
    "ball": lambda extent: Sphere(extent / 2),
    "capsule": lambda extent: Capsule(extent / 4, extent / 2),
    "cylinder": lambda extent: Cylinder(extent / 3, extent / 2),
    "small_ball": lambda extent: Sphere(extent / 50),
}
QUESTIONS = (
    "hull", "volume", "depth", "vertices", "errors", "distance", "paper", "rounded", "rounded_errors", "ball_errors",
    *ROUND,
)  # fmt: skip


@dataclass(frozen=True)
class Input:
    """A question but for its size: where the second body lies, in extents, and how the points were changed."""

    family: str
    ask: str
    seed: int = 0
    away: tuple[float, float, float] = (0.0, 0.0, 1e-6)
    turn: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    stretch: tuple[float, float, float] = (1.0, 1.0, 1.0)
    noise: float = 0.0

    def points(self, n: int) -> Points:
        rng = np.random.default_rng(self.seed)
        points = FAMILIES[self.family](n, rng) * self.stretch
        return points + rng.normal(size=points.shape) * self.noise


def seconds(given: Input, n: int) -> tuple[float, int]:
    """Processor time of one answer, and of how many facets. Only what is asked is timed, not what it is asked of."""
    points = given.points(n)
    bodies: list[Hull] = []
    took = timed(lambda: bodies.append(Hull(points)))
    (body,) = bodies
    return took if given.ask == "hull" else timed(question(given, points, body)), len(body.triangles)


def question(given: Input, points: Points, body: Hull) -> Callable[[], Any]:
    extent, ask = float(np.ptp(points, axis=0).max()), given.ask
    other = Placed(body, np.multiply(given.away, extent), given.turn)
    if ask == "volume":
        return lambda: overlap(body, other).volume_error
    if ask == "distance":
        return lambda: distance(body, Placed(body, (2 * extent, 0.1 * extent, 0), given.turn))
    if ask == "paper":
        return lambda: overlap(body, other, method="paper")
    if ask in ("rounded", "rounded_errors"):
        rounded, ball = Placed(RoundedHull(points, extent / 100), (extent, 0, 0), given.turn), Sphere(extent / 2)
        if ask == "rounded":
            return lambda: overlap(ball, rounded).volume_error
        return lambda: overlap(ball, rounded).errors.volume
    if ask == "ball_errors":
        return lambda: overlap(body, Placed(Sphere(extent / 2), given.away, given.turn)).errors.volume
    if ask in ROUND:
        return lambda: overlap(body, Placed(ROUND[ask](extent), given.away, given.turn)).volume_error
    common = overlap(body, other)
    return lambda: getattr(common, ask)


@dataclass(frozen=True)
class Growth:
    """How the time of an input grows: seconds by number of points, and why a larger one has no answer."""

    given: Input
    times: dict[int, float]
    facets: int
    ended: str = ""

    @property
    def exponent(self) -> float:
        timed = [(n, t) for n, t in self.times.items() if t > 0][-3:]
        if len(timed) < 2:
            return 0.0
        (small, before), (large, after) = timed[0], timed[-1]
        return math.log(after / before) / math.log(large / small)

    @property
    def worth_it(self) -> bool:
        return bool(self.times) and max(self.times.values()) >= WORTH_TIMING

    @property
    def too_steep(self) -> bool:
        return bool(self.ended) or (self.worth_it and self.exponent > MOST_EXPONENT)

    def line(self) -> str:
        n = max(self.times, default=0)
        spent = self.times.get(n, math.nan)
        rate = 1e6 * spent / max(1, self.facets)
        what = f"{self.given.family:22}{self.given.ask:10}{n:9}{spent:9.3f} s{rate:9.1f} µs a facet"
        return f"{what}   n^{self.exponent:.2f}   {self.ended}".rstrip()


def growth(given: Input, ask: Callable[..., Any], largest: int, smallest: int = 1000) -> Growth:
    times: dict[int, float] = {}
    facets, n = 0, smallest
    while n <= largest:
        answers = []
        while len(answers) < 3:
            answers.append(ask(given, n))
            if isinstance(answers[-1], str):  # why there is no answer; too flat to have an inside is no failure
                why = "" if answers[-1] == "raises ValueError" else f"{answers[-1]} at {n} points"
                return Growth(given, times, facets, why)
        times[n], facets = median(t for t, _ in answers), answers[0][1]
        if times[n] > TIME_LIMIT / 10:
            break
        n *= 2
    return Growth(given, times, facets)


def changed(given: Input, rng: np.random.Generator) -> Input:
    """The input with one thing about it drawn anew."""
    small = float(10.0 ** rng.uniform(-14, 0))
    match rng.integers(5):
        case 0:
            axis = rng.integers(3)
            return replace(given, away=tuple(small if i == axis else 0.0 for i in range(3)))
        case 1:
            turn = rng.normal(size=4) if rng.random() < 0.5 else np.array([small, 0, 0, 1.0])
            return replace(given, turn=tuple(float(q) for q in turn))
        case 2:
            axis = rng.integers(3)
            return replace(given, stretch=tuple(small if i == axis else 1.0 for i in range(3)))
        case 3:
            return replace(given, noise=float(10.0 ** rng.uniform(-17, -1)))
    return replace(given, seed=int(rng.integers(1 << 30)))


def searched(found: list[Growth], rounds: int, seed: int, ask: Callable[..., Any], largest: int) -> Iterator[Growth]:
    """Climbs from the worst: an input that grows faster than the one that it was changed from takes its place."""
    rng = np.random.default_rng(seed)
    worst = sorted(found, key=lambda each: each.exponent * each.worth_it, reverse=True)[:8]
    for _ in range(rounds if worst else 0):
        place = int(rng.integers(len(worst)))
        other = growth(changed(worst[place].given, rng), ask, largest)
        if other.too_steep or (other.worth_it and other.exponent > worst[place].exponent):
            worst[place] = other
            yield other


def options(parser: ArgumentParser) -> None:
    parser.add_argument("--family", choices=sorted(FAMILIES), action="append", help="only this, or these")
    parser.add_argument("--ask", choices=QUESTIONS, action="append", help="only this, or these")
    parser.add_argument("--rounds", type=int, default=0, help="changes of the worst that are tried")
    parser.add_argument("--seed", type=int, default=0, help="of these changes")
    parser.add_argument("--largest", type=int, default=1 << 17, help="points")


def main(chosen: Namespace) -> bool:
    """True if the time of an input is out of proportion to its size."""
    found = []
    with Watched(seconds, TIME_LIMIT, (Input("ball", "hull"), 100)) as process:
        for family, ask in product(chosen.family or FAMILIES, chosen.ask or QUESTIONS):
            found.append(growth(Input(family, ask), process.ask, chosen.largest))
            print(found[-1].line(), flush=True)
        for better in searched(found, chosen.rounds, chosen.seed, process.ask, chosen.largest):
            found.append(better)
            print(better.line(), better.given, flush=True)
    steep = [each for each in found if each.too_steep]
    print(f"{len(steep)} of {len(found)} grow faster than n^{MOST_EXPONENT}" + ":" * bool(steep))
    for each in sorted(steep, key=lambda each: each.exponent, reverse=True):
        print(" ", each.line(), each.given)
    return bool(steep)
