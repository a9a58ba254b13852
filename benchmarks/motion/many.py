"""Random and graded motions of all pairs of shapes: no time of impact is late, and each interval contains the truth.

    python benchmarks motions                  100,000 motions, the kinds in turn
    python benchmarks motions --record         keeps the table in benchmarks/results, and writes the page
    python benchmarks motions --count 2000     fewer, for a look
    python benchmarks motions --resume         goes on where a run ended that was stopped

Chunk by chunk, the counts are written to out/motions.csv. A motion again: `many.motions(KIND, SEED)[NUMBER]`. The
command fails if an answer is wrong. It names the first such motion of each chunk.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import version
from itertools import product
from typing import Any

import numpy as np
from first_touch import exact_first_touch
from strategies import hull_points, quaternion, turn
from strategies import product as turned_by

from harness import results
from harness.command import ROOT, Wrong
from motion import page
from overlapper import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Placed,
    RoundedHull,
    Sphere,
    TimeOfImpact,
    overlap,
    time_of_impact,
)

ROWS, TABLE = ROOT / "out" / "motions.csv", results.of_machine("motions.csv")

CHUNK = 250  # motions of a kind and a seed
SAMPLES = 40  # poses before the time of impact that are tested, of each motion
DEPTH = 1e-12  # m: rounding of the poses that are tested

COLUMNS = ("kind", "seed", "motions", "impact", "separated", "touching", "overlapping", "open", "wide", "late", "false")

SHAPES: dict[str, Callable[[np.random.Generator], Any]] = {
    "box": lambda rng: Box(rng.integers(200, 800, 3) / 1024),
    "plate": lambda rng: Box([0.8, 0.8, 10 ** -rng.uniform(2, 6)]),
    "sphere": lambda rng: Sphere(rng.uniform(0.2, 0.8)),
    "capsule": lambda rng: Capsule(*rng.uniform(0.2, 0.8, 2)),
    "cylinder": lambda rng: Cylinder(*rng.uniform(0.2, 0.8, 2)),
    "ellipsoid": lambda rng: Ellipsoid(rng.uniform(0.2, 0.8, 3)),
    "hull": lambda rng: Hull(hull_points(rng, 12) / 2),
    "rounded hull": lambda rng: RoundedHull(hull_points(rng, 8) / 3, 0.1),
    "half-space": lambda rng: HalfSpace(rng.normal(size=3), -0.5),
}
PAIRS = [pair for pair in product(SHAPES, repeat=2) if pair != ("half-space", "half-space")]

Velocities = tuple[np.ndarray, np.ndarray]

STILL = np.zeros(3)


@dataclass(frozen=True)
class Motion:
    """Two bodies with their velocities for 1 s. `meets` says whether they have a common point, if it is known."""

    a: Placed
    b: Placed
    of_a: Velocities
    of_b: Velocities
    meets: bool | None = None

    def at(self, time: float) -> tuple[Placed, Placed]:
        return placed(self.a, self.of_a, time), placed(self.b, self.of_b, time)

    @property
    def turns(self) -> bool:
        return bool(np.any([self.of_a[1], self.of_b[1]]))


def placed(body: Placed, velocities: Velocities, time: float) -> Placed:
    linear, angular = velocities
    orientation = turned_by(turn(angular * time), body.orientation) if angular.any() else body.given_orientation
    return Placed(body.shape, body.position + time * linear, orientation)


def direction(rng: np.random.Generator) -> np.ndarray:
    n = rng.normal(size=3)
    return n / np.linalg.norm(n)


def bodies(pair: tuple[str, str], rng: np.random.Generator) -> tuple[Placed, Placed]:
    first, second = (SHAPES[name](rng) for name in pair)
    return Placed(first, 3 * direction(rng), quaternion(rng)), Placed(second, (0, 0, 0), quaternion(rng))


def random(pair: tuple[str, str], rng: np.random.Generator, most: float = 3.0) -> Motion:
    a, b = bodies(pair, rng)
    spins = rng.normal(size=(2, 3)) * rng.choice([0, 0.5, most])
    linear = -a.position * rng.uniform(0.5, 1.5) + rng.normal(size=3) * 0.5
    return Motion(a, b, (linear, spins[0]), (rng.normal(size=3) * 0.2, spins[1]))


def fast(pair: tuple[str, str], rng: np.random.Generator) -> Motion:
    return random(pair, rng, most=10 ** rng.uniform(1, 2.5))


def bullet(pair: tuple[str, str], rng: np.random.Generator) -> Motion:
    """The first shape, a hundred times as fast as in other motions."""
    a, b = bodies(pair, rng)
    linear = -a.position * rng.uniform(50, 150) + rng.normal(size=3) * 20
    return Motion(a, b, (linear, rng.normal(size=3) * rng.choice([0, 3])), (STILL, STILL))


def near(pair: tuple[str, str], rng: np.random.Generator) -> tuple[Placed, Placed, np.ndarray, float] | None:
    """Two bodies with a gap of either sign between their nearest points, the normal there, and the gap."""
    a, b = bodies(pair, rng)
    apart = overlap(a, b)
    if apart.status != "separated":
        return None
    gap = 10 ** -rng.uniform(3, 10) * rng.choice([-1, 1])
    return Placed(a.shape, a.position - (apart.distance - gap) * apart.normal, a.orientation), b, apart.normal, gap


def grazing(pair: tuple[str, str], rng: np.random.Generator) -> Motion | None:
    """A pass at right angles to the normal. At 0.5 s the gap is the least, or the depth the largest."""
    found = near(pair, rng)
    if found is None:
        return None
    a, b, normal, gap = found
    along = np.cross(normal, direction(rng))
    along *= 6 / np.linalg.norm(along)
    return Motion(Placed(a.shape, a.position - along / 2, a.orientation), b, (along, STILL), (STILL, STILL), gap < 0)


def ending(pair: tuple[str, str], rng: np.random.Generator) -> Motion | None:
    """A gap or an overlap of a small depth at the end of the motion."""
    found = near(pair, rng)
    if found is None:
        return None
    a, b, normal, gap = found
    linear, spin = -3 * normal, rng.normal(size=3) * rng.choice([0, 1])
    start = placed(a, (-linear, -spin), 1.0)
    return Motion(start, b, (linear, spin), (STILL, STILL), True if gap < 0 else None if spin.any() else False)


KINDS: dict[str, Callable[[tuple[str, str], np.random.Generator], Motion | None]] = {
    "random": random,
    "fast spins": fast,
    "bullets": bullet,
    "grazing passes": grazing,
    "gaps at the end": ending,
}


def motions(kind: str, seed: int) -> Iterator[Motion]:
    """The pairs of shapes in turn."""
    rng = np.random.default_rng([seed, *kind.encode()])
    number = 0
    while number < CHUNK:
        motion = KINDS[kind](PAIRS[(seed * CHUNK + number) % len(PAIRS)], rng)
        if motion is not None:
            number += 1
            yield motion


def overlaps(motion: Motion, time: float) -> bool:
    both = overlap(*motion.at(time))
    return bool(both) and both.depth > DEPTH


def faults(motion: Motion, found: TimeOfImpact) -> Iterator[str]:
    """What is wrong with an answer: 'late' if there was a common point before `time`, 'false' if its interval or its
    status is wrong in another way."""
    if found.status == "overlapping":
        if overlap(motion.a, motion.b).status != "overlapping":
            yield "false"
        return
    until = found.time if found else 1.0
    near_end = (until - 1e-8, until - 1e-6, until * (1 - 1e-4)) if until > 1e-4 else ()
    if any(overlaps(motion, max(time, 0.0)) for time in (*np.linspace(0, until, SAMPLES, endpoint=False), *near_end)):
        yield "late"
    if found.status == "impact" and not overlap(*motion.at(found.time_upper)):
        yield "false"
    if motion.meets and not found:
        yield "late"
    if motion.meets is False and found.status == "impact":
        yield "false"
    boxes = isinstance(motion.a.shape, Box) and isinstance(motion.b.shape, Box)
    if boxes and not motion.turns:
        truth = exact_first_touch(motion.a, motion.b, motion.of_a[0] - motion.of_b[0])
        meets = truth is not None and truth <= 1
        if meets and (not found or truth < found.time):
            yield "late"
        elif found.status == "impact" and not (meets and truth <= found.time_upper):
            yield "false"


def examined(kind: str, seed: int) -> tuple[dict[str, Any], str]:
    """A row, and the first wrong answer in words."""
    row: Counter[str] = Counter()
    wrong = ""
    for number, motion in enumerate(motions(kind, seed)):
        found = time_of_impact(motion.a, motion.b, motion.of_a, motion.of_b)
        row[found.status] += 1
        row["wide"] += not found.converged
        told = set(faults(motion, found))
        row.update(told)
        if told and not wrong:
            wrong = f"{', '.join(sorted(told))}: {kind}, seed {seed}, number {number}: {motion} gave {found}"
    return {"kind": kind, "seed": seed, "motions": CHUNK} | {name: row[name] for name in COLUMNS[3:]}, wrong


def options(parser: ArgumentParser) -> None:
    parser.add_argument("--count", type=int, default=100_000, help="number of motions")
    parser.add_argument("--resume", action="store_true", help="go on where out/motions.csv ends")
    parser.add_argument("--record", action="store_true", help="keep the sums in benchmarks/results, and write the page")


def main(chosen: Namespace) -> None:
    done = results.read(ROWS)[1] if chosen.resume else []
    known = {(row["kind"], row["seed"]) for row in done}
    ROWS.parent.mkdir(exist_ok=True)
    wrongs = []
    with results.writing(ROWS, COLUMNS) as write:
        write([[row[name] for name in COLUMNS] for row in done])
        seeds = -(-chosen.count // (CHUNK * len(KINDS)))
        for seed, kind in product(range(seeds), KINDS):
            if (kind, str(seed)) in known:
                continue
            row, wrong = examined(kind, seed)
            if wrong:
                print(wrong, flush=True)
                wrongs.append(wrong)
            write([[row[name] for name in COLUMNS]])
    rows = results.read(ROWS)[1]
    sums = [
        [kind, *(sum(int(row[name]) for row in rows if row["kind"] == kind) for name in COLUMNS[2:])] for kind in KINDS
    ]
    for each in sums:
        print(*each, sep=", ")
    if wrongs or any(each[-2] or each[-1] for each in sums):
        raise Wrong(f"{sum(each[-2] + each[-1] for each in sums)} answers of {sum(each[1] for each in sums)}")
    if chosen.record:
        with results.writing(
            TABLE, [COLUMNS[0], *COLUMNS[2:]], f"{results.today()}; overlapper {version('overlapper')}"
        ) as write:
            write(sums)
        print(f"Written: {TABLE}")
        print(f"Written: {page.write_page(TABLE.with_name('motion.csv'), ROOT / 'docs')}")
