"""Bodies as thin as the rounding of the other body's size, and thinner. Few digits of a volume may be known, and the
stated error says so."""

import numpy as np
import pytest
from families import pierced
from plain_cases import CUBE
from rules import (
    UNPROVED,
    answer,
    complaints,
    errors_of_depth_and_distance_are_small,
    volume_of_round_pairs_is_known_to_eleven_digits,
)
from strategies import quaternion, rotation

from overlapper import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, Placed, RoundedHull, Sphere, overlap

LOOSE = {errors_of_depth_and_distance_are_small, volume_of_round_pairs_is_known_to_eleven_digits}
RULES = tuple(rule for rule in UNPROVED if rule not in LOOSE)


@pytest.mark.parametrize("digits", [12, 13, 14])
def test_a_needle_or_a_plate_through_a_round_body_keeps_the_rules(digits):
    rng = np.random.default_rng(digits)
    for _ in range(20):
        case = pierced(rng, 10.0**-digits)
        assert dict(complaints(case, answer(case.placed), RULES)) == {}, case.placed


@pytest.mark.parametrize("seed", range(4))
def test_a_needle_through_a_ball_ends_in_caps_that_no_slice_resolves(seed):
    """The volume over the needle's section is the integral of 2 sqrt(r² - x² - y²). Two terms of its series suffice."""
    rng = np.random.default_rng(seed)
    for _ in range(25):
        r, (a, b) = rng.uniform(0.4, 1), 10.0 ** rng.uniform(-8, -5, 2)
        ball, needle = Placed(Sphere(r)), Placed(Box([a, b, 1.5]), (0, 0, 0), quaternion(rng))
        for found in (overlap(ball, needle), overlap(needle, ball)):
            exact = 8 * a * b * (r - (a * a + b * b) / (6 * r))
            assert abs(found.volume - exact) <= found.volume_error + 4e-16 * exact
            assert found.volume_error < 1e-10 * exact


@pytest.mark.parametrize("digits", [15, 16, 18, 20])
def test_a_ball_and_a_plate_within_the_rounding_of_its_size_touch_or_overlap(digits):
    rng = np.random.default_rng(digits)
    for _ in range(20):
        thin = 10.0**-digits
        ball = Placed(Sphere(thin * 1e17), np.append(rng.normal(size=2), 0.5) * thin, quaternion(rng))
        for other in (Cylinder(1e13 * thin, thin), Capsule(thin, 1e13 * thin), Box(np.array([1e14, 1e13, 1]) * thin)):
            found = overlap(ball, Placed(other, (0, 0, 0), quaternion(rng)))
            assert found.status in ("touching", "overlapping")
            assert not found or 0 < found.volume_error <= found.volume


@pytest.mark.parametrize(
    "make",
    [
        lambda thin: Box([1, thin, 2]),
        lambda thin: Capsule(thin, 2),
        lambda thin: Cylinder(thin, 2),
        lambda thin: Cylinder(2, thin),
        lambda thin: Ellipsoid([thin, 2, 1]),
    ],
)
def test_a_shape_thinner_than_the_rounding_of_its_size_is_refused(make):
    assert make(2.1e-15)
    with pytest.raises(
        ValueError, match=r"^(half_extents|half_axes|radius and length) must differ by a factor of at most 1e15$"
    ):
        make(1.9e-15)


def test_equal_hulls_all_but_cut_off_by_a_plane_have_a_part_no_larger_than_a_body():
    """The part is 1e-12 deep, along an edge."""
    hull = RoundedHull([[x, y, z] for x in (0, 0.25) for y in (0, 1) for z in (0, 1)], 0.75)
    plane = HalfSpace([-1, 0, 0], -1 + 1e-12)
    found = overlap(plane, hull, hull, hull)
    assert found.volume_error <= overlap(hull, hull).volume


def test_groups_of_plates_with_nearly_the_same_ends_agree_with_the_pair():
    """Slices of such a group end at one plane. The other plane, tilted by 1e-12, cuts off more than rounding."""
    rng = np.random.default_rng(5)
    for _ in range(40):
        orientation, place = rng.normal(size=4), 0.3 * rng.normal(size=3)
        tilted = orientation + 10.0 ** rng.uniform(-13, -11) * rng.normal(size=4)
        one, other = (
            Placed(Hull(np.array(CUBE) * [1, 1, 10.0 ** rng.uniform(-6, -4)]), place, turn)
            for turn in (orientation, tilted)
        )
        pair, group = overlap(one, other), overlap(one, other, Placed(Sphere(20)))
        assert abs(pair.volume - group.volume) <= pair.volume_error + group.volume_error


def test_groups_of_a_ball_beside_a_corner_of_its_own_radius_agree_with_the_pair():
    """Planes of the corner's bands are tilted by as little as 1e-14, against each other and against the plane between
    both balls. They cross inside the ball, and form thin wedges."""
    rng = np.random.default_rng(6)
    for _ in range(250):
        bump = np.array(CUBE) * [0.5, 0.5, 1 + 10.0 ** rng.uniform(-14, -10)]
        hull, place = RoundedHull(np.vstack([CUBE, bump]), 0.1), rng.normal(size=3)
        corner = hull.core.vertices[rng.integers(len(hull.core.vertices))]
        off = rotation(turn := quaternion(rng)) @ corner + 10.0 ** rng.uniform(-13, -10) * rng.normal(size=3)
        body, ball = Placed(hull, place, turn), Placed(Sphere(0.1), place + off)
        pair, group = overlap(body, ball), overlap(body, ball, HalfSpace([0, 0, 1], 50))
        assert abs(pair.volume - group.volume) <= pair.volume_error + group.volume_error
