"""Round bodies that are 1e-8 m deep in each other: the volumes and depths that peers give, beside the true ones.

    python benchmarks contacts           half a minute; writes benchmarks/results/stability_round.csv
    python benchmarks stability --page   then the page that has it, docs/stability.md

A contact is one function of a numpy generator that gives two shapes at poses and the way that leads the second out of
the first; it is then moved along that way until it is DEPTH deep. To add one, write it and name it in CONTACTS.
True volumes are what a proof in ball arithmetic comes to, true depths are exact (tests/support/exact_distance.py).
Each peer runs in a process of its own, as in `python benchmarks stability`.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from math import isfinite
from pathlib import Path
from zlib import crc32

import exact
import exact_distance
import numpy as np
from strategies import directions, product, quaternion, rotation

from harness import results
from harness.bodies import exact_points
from harness.peers import NO_ANSWER, NO_DISTANCE, PEERS, HardCase, hard_cases
from overlapper import Box, Capsule, Cylinder, HalfSpace, Placed, RoundedHull, Sphere, overlap
from speed.workloads import ball, by_proof, capsule, hull
from stability.hard_cases import Columns

RESULTS = results.FOLDER / "stability_round.csv"
DEPTH = 1e-8  # m
CASES = 20  # of each contact

Met = tuple[Placed, Placed, np.ndarray]


# Contacts, about an upright box or an upright first body


def box(rng: np.random.Generator) -> Box:
    return Box(rng.uniform(0.8, 1.2, 3))


def cylinder(rng: np.random.Generator) -> Cylinder:
    return Cylinder(rng.uniform(0.2, 0.4), rng.uniform(1.0, 1.5))


def rounded(rng: np.random.Generator) -> RoundedHull:
    return RoundedHull(hull(rng, 12).vertices, rng.uniform(0.05, 0.2))


def on_face(rng: np.random.Generator, below: Box) -> np.ndarray:
    """A point in the middle part of the upper face."""
    return np.array([*rng.uniform(-0.1, 0.1, 2), below.half_extents[2]])


def on_edge(rng: np.random.Generator, below: Box) -> tuple[np.ndarray, np.ndarray]:
    """A point in the middle part of an upright edge, and a way out between the normals of its faces."""
    angle = rng.uniform(0.3, np.pi / 2 - 0.3)
    return np.array([*below.half_extents[:2], rng.uniform(-0.1, 0.1)]), np.array([np.cos(angle), np.sin(angle), 0.0])


def along(axis: np.ndarray) -> np.ndarray:
    """The quaternion that turns z to a unit vector."""
    x, y, z = axis
    turned = np.array([-y, x, 0.0, 1.0 + z])
    return turned / np.linalg.norm(turned)


UP = np.array([0.0, 0.0, 1.0])


def level(rng: np.random.Generator) -> np.ndarray:
    angle = rng.uniform(0, 2 * np.pi)
    return np.array([np.cos(angle), np.sin(angle), 0.0])


def crossing_axis(rng: np.random.Generator, one: np.ndarray, out: np.ndarray) -> np.ndarray:
    """Upright on `out`, as `one` is, and not too near to it."""
    angle = rng.uniform(0.4, np.pi - 0.4)
    return np.cos(angle) * one + np.sin(angle) * np.cross(out, one)


def ball_on_face(rng: np.random.Generator) -> Met:
    below, above = box(rng), ball(rng)
    return Placed(below), Placed(above, on_face(rng, below) + above.radius * UP), UP


def ball_on_edge(rng: np.random.Generator) -> Met:
    below, above = box(rng), ball(rng)
    at, out = on_edge(rng, below)
    return Placed(below), Placed(above, at + above.radius * out), out


def ball_on_corner(rng: np.random.Generator) -> Met:
    below, above = box(rng), ball(rng)
    out = rng.uniform(0.4, 1.0, 3)
    out /= np.linalg.norm(out)
    return Placed(below), Placed(above, below.half_extents + above.radius * out), out


def ball_on_ball(rng: np.random.Generator) -> Met:
    below, above, out = ball(rng), ball(rng), directions(rng, 1)[0]
    return Placed(below), Placed(above, (below.radius + above.radius) * out), out


def capsule_on_face(rng: np.random.Generator) -> Met:
    """Lying, as level as doubles have it."""
    below, above = box(rng), capsule(rng)
    return Placed(below), Placed(above, on_face(rng, below) + above.radius * UP, along(level(rng))), UP


def capsule_on_edge(rng: np.random.Generator) -> Met:
    below, above = box(rng), capsule(rng)
    at, out = on_edge(rng, below)
    return Placed(below), Placed(above, at + above.radius * out, along(crossing_axis(rng, UP, out))), out


def crossing(rng: np.random.Generator, shape: Callable[[np.random.Generator], Capsule | Cylinder]) -> Met:
    """Two that meet with their sides, in the middle part of each."""
    below, above, out = shape(rng), shape(rng), level(rng)
    axis = crossing_axis(rng, UP, out)
    at = (below.radius + above.radius) * out + 0.1 * (rng.uniform(-1, 1) * UP + rng.uniform(-1, 1) * axis)
    return Placed(below), Placed(above, at, along(axis)), out


def rim_on_face(rng: np.random.Generator) -> Met:
    below, above = box(rng), cylinder(rng)
    tilt = rng.uniform(0.3, np.pi / 2 - 0.3)
    axis = np.cos(tilt) * UP + np.sin(tilt) * level(rng)
    lowest = -above.length / 2 * axis + above.radius * (np.cos(tilt) * axis - UP) / np.sin(tilt)
    return Placed(below), Placed(above, on_face(rng, below) - lowest, along(axis)), UP


def flat_on_face(rng: np.random.Generator) -> Met:
    below, above = box(rng), cylinder(rng)
    return Placed(below), Placed(above, on_face(rng, below) + above.length / 2 * UP), UP


def rounded_on_ground(rng: np.random.Generator) -> Met:
    above, turned = rounded(rng), quaternion(rng)
    lowest = (above.core.vertices @ rotation(turned).T)[:, 2].min() - above.radius
    return Placed(HalfSpace(UP, 0.0)), Placed(above, [*rng.uniform(-1, 1, 2), -lowest], turned), UP


def rounded_on_ball(rng: np.random.Generator) -> Met:
    below, above, turned, out = ball(rng), rounded(rng), quaternion(rng), directions(rng, 1)[0]
    corners = above.core.vertices @ rotation(turned).T
    lowest = corners[(corners @ out).argmin()] - above.radius * out
    return Placed(below), Placed(above, below.radius * out - lowest, turned), out


CONTACTS: dict[str, Callable[[np.random.Generator], Met]] = {
    "ball on a box's face": ball_on_face,
    "ball on its edge": ball_on_edge,
    "ball on its corner": ball_on_corner,
    "ball on ball": ball_on_ball,
    "capsule lying on a face": capsule_on_face,
    "capsule on an edge": capsule_on_edge,
    "capsules that cross": partial(crossing, shape=capsule),
    "cylinders that cross": partial(crossing, shape=cylinder),
    "cylinder's rim on a face": rim_on_face,
    "cylinder's end on a face": flat_on_face,
    "rounded hull on a half-space": rounded_on_ground,
    "rounded hull on a ball": rounded_on_ball,
}


@dataclass(frozen=True)
class Contact:
    """Two bodies, and what is true of them: the volume with what it may be off, and the depth."""

    kind: str
    number: int
    a: Placed
    b: Placed

    @property
    def volume(self) -> tuple[Fraction, Fraction]:
        return by_proof(self.a, self.b)

    @property
    def depth(self) -> Fraction:
        """ValueError if it cannot be told."""
        a, b = self.a, self.b
        if isinstance(a.shape, HalfSpace):  # { z <= 0 }
            low = min(z for _, _, z in exact.placed(b.shape.core.vertices, b.position, b.given_orientation))
            return Fraction(b.shape.radius) - low
        if isinstance(a.shape, Cylinder):
            # Between those of capsules in them and of capsules around them.
            found = {exact_distance.signed_distance(*(in_or_around(body, sign) for body in (a, b))) for sign in (0, 1)}
        else:
            solid = exact.hull(exact_points(a)) if isinstance(a.shape, Box) else a
            found = {exact_distance.signed_distance(solid, b)}
        (distance,) = found
        if distance is None:
            raise ValueError("the cylinder meets an edge")
        return -distance


def in_or_around(body: Placed, around: bool) -> Placed:
    """The longest capsule in a cylinder, or the one around it, of the same radius."""
    radius, length = body.shape.radius, body.shape.length
    return Placed(Capsule(radius, length if around else length - 2 * radius), body.position, body.given_orientation)


def contacts(cases: int) -> list[Contact]:
    """So many of each kind, all turned at random but on half-spaces, which stay level."""
    found = []
    for kind, make in CONTACTS.items():
        rng = np.random.default_rng(crc32(kind.encode()))
        for number in range(cases):
            a, b, out = make(rng)
            if not isinstance(a.shape, HalfSpace):
                turned, away = quaternion(rng), rng.uniform(-1, 1, 3)
                a, b = (
                    Placed(body.shape, away + rotation(turned) @ body.position, product(turned, body.orientation))
                    for body in (a, b)
                )
                out = rotation(turned) @ out
            found.append(Contact(kind, number, a, sunk(a, b, out)))
    return found


def sunk(a: Placed, b: Placed, out: np.ndarray) -> Placed:
    """The second body moved along a unit vector until it is DEPTH deep in the first, as well as doubles have it."""
    for _ in range(4):
        found = overlap(a, b)
        apart = -found.depth if found else found.distance
        b = Placed(b.shape, b.position - (apart + DEPTH) * out, b.given_orientation)
    return b


# A question without difficulty, asked before time counts
FIRST = (Placed(Box([1.0, 1.0, 1.0])), Placed(Sphere(1.0), (0.3, 0.2, 1.5)))


STATED = "auto: stated error"


def stated(a: Placed, b: Placed) -> float:
    """The error that this package states of its volume."""
    return overlap(a, b).volume_error


def told(truth: tuple[Fraction, Fraction], answer: float | str) -> str:
    """By how much of the true value an answer may be off at most, where the truth is known that well; or in words that
    there is no answer, or that it is for bodies apart."""
    value, within = truth
    if isinstance(answer, str):
        return answer
    if not isfinite(answer) or abs(answer) > NO_DISTANCE:
        return NO_ANSWER
    if answer * value <= 0:
        return "apart"
    return f"{float((abs(Fraction(answer) - value) + within) / abs(value)):.1e}"


def share(truth: tuple[Fraction, Fraction], error: float | str) -> str:
    return error if isinstance(error, str) else f"{error / float(truth[0]):.1e}"


def options(parser: ArgumentParser) -> None:
    parser.add_argument("--cases", type=int, default=CASES, help="of each contact")


def measure(chosen: Namespace, path: Path) -> None:
    asked = contacts(chosen.cases)
    volumes = [contact.volume for contact in asked]
    distances = [(-contact.depth, Fraction(0)) for contact in asked]
    table = Columns([{"contact": contact.kind, "case": str(contact.number)} for contact in asked], FIRST)
    table.fill("volume", [f"{float(volume):.6g}" for volume, _ in volumes])
    table.fill("known to", [f"{float(within / volume):.1e}" for volume, within in volumes])
    table.fill("depth", [f"{float(-distance):.6g}" for distance, _ in distances])
    pairs = [(contact.a, contact.b) for contact in asked]
    table.put(STATED, stated, pairs, share, volumes)
    for kind, word, truths in (("volume", "volume", volumes), ("distance", "depth", distances)):
        for name in hard_cases(kind):
            hard = PEERS[kind][name].hard
            segments = f", {hard} segments" if isinstance(hard, int) else ""
            table.put(f"{name}{segments}: {word}", HardCase(kind, name), pairs, told, truths)
    table.write(path, results.packages("overlap", "python-flint"))
