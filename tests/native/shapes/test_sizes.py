"""Bodies within the limits of size get an answer with a finite, true bound. Others are refused in one sentence."""

from fractions import Fraction
from itertools import combinations_with_replacement

import numpy as np
import pytest

from overlapper import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, Placed, RoundedHull, Sphere, overlap

TETRA = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
TURN = (1, 0.25, 3, 0.75)
MADE = {
    "sphere": Sphere,
    "box": lambda s: Box([s] * 3),
    "capsule": lambda s: Capsule(s, s),
    "cylinder": lambda s: Cylinder(s, s),
    "ellipsoid": lambda s: Ellipsoid([s, 0.75 * s, 0.875 * s]),
    "hull": lambda s: Hull(CORNERS * s),
    "rounded hull": lambda s: RoundedHull(CORNERS * s, s),
    "half-space": lambda s: HalfSpace((0, 0, 1), s),
}
ENDS = (1.5e-25, 0.9e25)


@pytest.mark.parametrize("size", [1e-31, 1e-100, 1e-258, 1e31, 1e100, 1e257])
@pytest.mark.parametrize("name", MADE)
def test_sizes_beyond_the_limits_are_refused(name, size):
    if name == "half-space" and size < 1:
        return  # an offset has no least size
    with pytest.raises(ValueError, match=r"(1e-25|1e25)"):
        MADE[name](size)
    with pytest.raises(ValueError, match=r"normal must be of a length between 1e-25 and 1e25"):
        HalfSpace((0, 0, size), 0.0)
    with pytest.raises(ValueError, match="offset must be closer to the origin than 1e25 m"):
        HalfSpace((0, 0, 1), 1e25)
    if size > 1:
        with pytest.raises(ValueError, match="position must be closer to the origin than 1e25 m"):
            Placed(Sphere(1), (0, size, 0))
        with pytest.raises(ValueError, match="length must be less than 1e25 m"):
            Capsule(1, size)


@pytest.mark.parametrize("way", np.vstack([np.eye(3), -np.eye(3)]))
def test_a_hull_beyond_the_limits_on_one_side_and_one_just_as_small_as_them_are_refused(way):
    with pytest.raises(ValueError, match="vertices must be closer to the origin than 1e25 m"):
        Hull(CORNERS + 2e25 * way)
    with pytest.raises(ValueError, match="vertices must span more than 1e-25 m"):
        Hull(np.clip(CORNERS, 0, 1) * way.sum() * 1e-25)


@pytest.mark.parametrize("size", ENDS)
@pytest.mark.parametrize(("one", "other"), [*combinations_with_replacement(list(MADE)[:-1], 2)])
def test_bodies_at_either_end_of_the_limits_have_a_finite_bound(one, other, size):
    """The same in units of their size, to the bounds of both."""

    def share(s):
        found = overlap(Placed(MADE[one](s)), Placed(MADE[other](s), (0.3 * s, 0.1 * s, 0.1 * s), TURN), tolerance=0.1)
        return found.status, Fraction(found.volume) / Fraction(s) ** 3, Fraction(found.volume_error) / Fraction(s) ** 3

    (status, volume, error), (at_one, expected, allowed) = share(size), share(1.0)
    assert status == at_one == "overlapping"
    assert abs(volume - expected) <= error + allowed
    assert 0 < error <= 4 * allowed + Fraction(1, 10**9)


@pytest.mark.parametrize("power", range(1, 25, 4))
@pytest.mark.parametrize("name", list(MADE)[:-1])
def test_a_box_inside_a_huge_body_has_its_volume(name, power):
    found = overlap(Placed(Box([0.75] * 3)), Placed(MADE[name](10.0**power), (0.3, 0.1, 0.1), TURN))
    assert abs(Fraction(found.volume) - Fraction(27, 8)) <= Fraction(found.volume_error)


@pytest.mark.parametrize("name", list(MADE)[:-1])
def test_the_smallest_body_inside_the_largest_has_its_volume(name):
    small = MADE[name](1.5e-25)
    found = overlap(small, Box([0.9e25] * 3))
    assert abs(found.volume - small.volume) <= found.volume_error + 1e-15 * small.volume


@pytest.mark.parametrize("size", [1e-24, 1e24])
def test_hulls_at_either_end_are_bounded(size):
    found = overlap(Hull(TETRA * size), Hull(TETRA * size * 0.5))
    assert abs(Fraction(found.volume) - Fraction(size * 0.5) ** 3 / 6) <= Fraction(found.volume_error)
