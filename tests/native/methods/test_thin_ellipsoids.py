"""Thin ellipsoids in shallow contact with a polyhedron: half axes of 1 : 1e-4 to 1 : 1e-8."""

from fractions import Fraction

import graded
import numpy as np
import pytest
from strategies import directions

from overlapper import Box, Ellipsoid, Hull, Placed, overlap

THIN = {
    "plate": lambda thin: [1, 1, thin],
    "blade": lambda thin: [1, thin**0.5, thin],
    "needle": lambda thin: [1, thin, thin],
}


def contact(kind: str, seed: int) -> tuple[Placed, Placed]:
    """An ellipsoid whose contact is 1e-1 to 1e-7 of its smallest half axis deep."""
    rng = np.random.default_rng([seed, len(kind)])
    half_axes = rng.permutation(THIN[kind](10 ** -rng.uniform(4, 8)) * rng.uniform(0.5, 1, 3))
    ellipsoid = Placed(Ellipsoid(half_axes), 0.3 * rng.normal(size=3), rng.normal(size=4))
    shape = Box(rng.uniform(0.2, 1, 3)) if seed % 2 else Hull(directions(rng, 12) * rng.uniform(0.2, 1, 3))
    polyhedron = Placed(shape, (0, 0, 0), rng.normal(size=4))
    deep = half_axes.min() * 10 ** -rng.uniform(1, 7)
    for _ in range(3):
        found = overlap(ellipsoid, polyhedron)
        step = (found.depth if found else -found.distance) - deep
        ellipsoid = graded.moved(ellipsoid, step * np.array(found.normal))
    return ellipsoid, polyhedron


@pytest.mark.parametrize("kind", THIN)
def test_volumes_of_shallow_contacts_have_ten_digits(kind):
    """Closed forms and slices know these. A polytope of tangent planes knows three digits."""
    ways = set()
    for seed in range(40):
        found = overlap(*contact(kind, seed))
        if not found:
            continue
        ways.add(found.way)
        lower, upper = graded.bounds(found)
        volume, error = Fraction(found.volume), Fraction(found.volume_error)
        assert lower - error <= volume <= upper + error, seed
        assert abs(volume - upper) <= 1e-10 * float(upper), seed
        assert error <= 1e-8 * volume, (seed, found.way)
    assert ways <= {"closed form", "slicing"}


@pytest.mark.parametrize("kind", THIN)
def test_the_volume_is_the_same_whether_or_not_the_area_was_asked_for(kind):
    """Slices leave out the surface of an ellipsoid until its area is asked for."""
    sliced = 0
    for seed in range(40):
        a, b = contact(kind, seed)
        found, other = overlap(a, b), overlap(a, b)
        if not found or found.way != "slicing":
            continue
        sliced += 1
        volume = found.volume
        area = other.area
        assert found.area == area and other.volume == volume
        # A convex set has no more surface than a box around it.
        low, high = found.bounds
        assert 0 < area <= sum(2 * np.prod(np.delete(high - low, axis)) for axis in range(3)) * (1 + 1e-9)
    assert sliced
