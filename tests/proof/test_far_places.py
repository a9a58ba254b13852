"""Stated errors of volumes hold against the proof at places up to 1e6 m from the origin, at depths down to 1e-10 m."""

from fractions import Fraction
from itertools import combinations_with_replacement

import numpy as np
import pytest
from strategies import directions, quaternion

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
    overlap,
)


def points(rng, count):
    return directions(rng, count) * rng.uniform(0.3, 0.6, 3)


# The kinds of docs/round.md.
SHAPES = {
    "box": lambda rng: Box(rng.uniform(0.25, 0.5, 3)),
    "hull": lambda rng: Hull(points(rng, 20)),
    "half-space": lambda rng: HalfSpace(rng.normal(size=3), 0),
    "ball": lambda rng: Sphere(rng.uniform(0.3, 0.6)),
    "capsule": lambda rng: Capsule(rng.uniform(0.2, 0.4), rng.uniform(0.4, 1.0)),
    "cylinder": lambda rng: Cylinder(rng.uniform(0.2, 0.5), rng.uniform(0.4, 1.0)),
    "ellipsoid": lambda rng: Ellipsoid(rng.uniform(0.2, 0.6, 3)),
    "rounded hull": lambda rng: RoundedHull(points(rng, 20), rng.uniform(0.02, 0.1)),
    "mesh with margin": lambda rng: RoundedHull(points(rng, 60), 1e-3),
}
CLASSES = [pair for pair in combinations_with_replacement(SHAPES, 2) if pair != ("half-space", "half-space")]


def seen_from_far(a, b, rng):
    """The pair far from the origin. A half-space is given by a plane that far away, and without a pose of its own."""
    away = directions(rng, 1)[0] * 10.0 ** rng.uniform(0, 6)
    turn = quaternion(rng) if rng.random() < 0.5 else np.array([0, 0, 0, 1.0])
    bodies = []
    for body in (a, b):
        if isinstance(body.shape, HalfSpace):
            normal = np.array(body.shape.normal)
            bodies.append(Placed(HalfSpace(3 * normal, 3 * (body.shape.offset + normal @ away))))
        else:
            bodies.append(Placed(body.shape, body.position + away, turn if rng.random() < 0.5 else body.orientation))
    return bodies


def sunk(a, b, depth):
    """The pair with the first body moved until it is `depth` deep in the second, but for the rounding of its place."""
    for _ in range(3):
        if isinstance(a.shape, HalfSpace):
            return sunk(b, a, depth)
        found = overlap(a, b, tolerance=0.1)
        step = found.depth - depth if found else -found.distance - depth
        a = Placed(a.shape, a.position + step * np.array(found.normal), a.orientation)
    return a, b


def far_pair(kinds, seed):
    rng = np.random.default_rng([seed, *(list(SHAPES).index(kind) for kind in kinds)])
    a, b = (Placed(SHAPES[kind](rng), rng.normal(size=3) * 0.3, quaternion(rng)) for kind in kinds)
    if isinstance(a.shape, HalfSpace) or isinstance(b.shape, HalfSpace):
        a, b = (Placed(x.shape) if isinstance(x.shape, HalfSpace) else x for x in (a, b))
    return sunk(*seen_from_far(a, b, rng), 10.0 ** -rng.uniform(1, 10))


def proved_far_from(found):
    """By what part of the volume the stated bracket misses the proved one."""
    lower, upper = found.certificate().verify()
    volume, error = Fraction(found.volume), Fraction(found.volume_error)
    return float(max(lower - volume - error, volume - error - upper) / volume)


@pytest.mark.parametrize("kinds", CLASSES, ids=" and ".join)
def test_stated_errors_hold_at_far_places(kinds):
    found = overlap(*far_pair(kinds, 2026), tolerance=0.1)
    assert found
    assert proved_far_from(found) <= 0


# A cap so shallow that its plane is as uncertain, in double-double at that distance, as a part of 1e-14 of the volume.
def test_a_ball_in_a_half_space_a_million_metres_away_states_what_its_plane_loses():
    place = (857142.8571428572, 333333.3333333333, 200000.0)
    found = overlap(Placed(Sphere(1), place), HalfSpace([3, 2, 1], 3438091.4964378513))
    assert proved_far_from(found) <= 0
    assert found.volume_error <= 5e-12 * found.volume
