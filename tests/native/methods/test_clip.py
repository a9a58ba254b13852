"""Pairs decided by static filters: what clipping finds without looking closer, against the exact truth."""

from fractions import Fraction

import exact
import numpy as np
import pytest
from families import Below, Case, Posed, PosedBox, make
from numpy.testing import assert_allclose
from strategies import quaternion

from overlapper import Box, HalfSpace, Placed, overlap

EVERYDAY = [
    make(family, seed) for family in ("general", "posed", "posed_boxes", "slivers", "half_spaces") for seed in range(12)
]
PAIRS = [case for case in EVERYDAY if len(case.placed) == 2]


@pytest.mark.parametrize("case", PAIRS, ids=repr)
def test_a_clipped_pair_has_the_exact_volume_area_centroid_and_gradient(case):
    found = overlap(*case.placed)
    if case.truth.dimension < 3:
        assert not found
        return
    assert abs(Fraction(found.volume) - case.truth.volume) <= Fraction(found.volume_error)
    assert_allclose(found.area, case.truth.area, rtol=1e-9)
    size = float(np.abs(case.truth.centroid).max()) + 1
    assert_allclose(found.centroid, np.array(case.truth.centroid, float), atol=1e-9 * size)
    for body in (0, 1) if case.family != "half_spaces" else ():
        pull = np.array(case.truth.pull(body), float)
        assert_allclose(found.gradient[body, :3], pull, atol=1e-9 * case.truth.area)


def test_the_moment_of_the_gradient_is_the_slope_of_the_volume_by_turning():
    still = Placed(Box((1, 1.5, 0.5)), (0.2, -0.1, 0.3), (0.3, 0.2, -0.4, 0.8))
    step = 1e-5

    def turned(angle, axis):
        half = angle / 2
        quaternion = [0.0, 0.0, 0.0, np.cos(half)]
        quaternion[axis] = np.sin(half)
        return Placed(Box((1, 1, 1)), (0.5, 0.25, 0.125), quaternion)

    found = overlap(turned(0, 0), still)
    slopes = [
        (overlap(turned(step, axis), still).volume - overlap(turned(-step, axis), still).volume) / (2 * step)
        for axis in range(3)
    ]
    assert_allclose(found.gradient[0, 3:], slopes, atol=1e-7)


def test_a_body_inside_another_is_all_that_is_common():
    found = overlap(Box((3, 3, 3)), Placed(Box((1, 0.5, 0.25)), (0.3, 0.2, 0.1), (0.1, 0.2, 0.3, 0.9)))
    assert found.volume == pytest.approx(1.0, rel=1e-14)
    assert_allclose(found.gradient, 0, atol=1e-14)


def test_a_bar_through_a_plate_leaves_by_both_sides():
    found = overlap(Box((2, 2, 0.25)), Placed(Box((0.25, 0.5, 3)), orientation=(0, 0, 0.2, 1)))
    assert found.volume == pytest.approx(0.25, rel=1e-14)
    assert_allclose(found.centroid, 0, atol=1e-15)


def test_flush_sides_are_clipped():
    found = overlap(Box((1, 1, 1)), Placed(Box((1, 1, 1)), (0, 0, 1.5)))
    assert found.way == "clipping"
    assert abs(found.volume - 2) <= found.volume_error


def test_a_corner_under_the_ground_is_a_tetrahedron():
    corner = Placed(Box((1, 1, 1)), (0, 0, 0), (0, 0, 0, 1))
    level = -3 + 0.5  # the plane x + y + z = level cuts a corner with legs of a half
    found = overlap(corner, HalfSpace((1, 1, 1), level))
    assert found.volume == pytest.approx(0.5**3 / 6, rel=1e-12)


def sunk(way, depth, rng):
    """A box in another one by `depth`, with a face, an edge or a corner, or in the ground with a hull's corner."""
    still = PosedBox(np.ones(3), np.zeros(3), np.array([0, 0, 0, 1.0]))
    if way == "face":
        return still, PosedBox(
            np.array([0.5, 0.75, 1.5]), np.array([0.3, 0.2, 2.5 - depth]), np.array([0, 0, 0.4, 0.8])
        )
    if way == "edge":
        eighth = np.pi / 8
        along_x, along_y = ([np.sin(eighth), 0, 0, np.cos(eighth)], [0, np.sin(eighth), 0, np.cos(eighth)])
        up = np.array([0.1, 0.05, np.sqrt(8) - depth])
        return still._replace(orientation=np.array(along_x)), PosedBox(np.ones(3), up, np.array(along_y))
    body = Posed(rng.normal(size=(12, 3)), rng.normal(size=3), quaternion(rng))
    lowest = float(np.array(exact.placed(*body), float)[:, 2].min())
    return body, Below((0.0, 0.0, 1.0), lowest + depth)


@pytest.mark.parametrize("way", ["face", "edge", "corner"])
def test_a_sliver_of_any_thickness_is_right_to_twelve_digits(way):
    rng = np.random.default_rng(5)
    widened = []
    for exponent in range(1, 13):
        case = Case(way, 10.0**-exponent, sunk(way, 10.0**-exponent, rng))
        found = overlap(*case.placed)
        off = abs(Fraction(found.volume) - case.truth.volume)
        assert off <= min(Fraction(found.volume_error), case.truth.volume / 10**12)
        assert_allclose(found.area, case.truth.area, rtol=1e-9)
        assert_allclose(found.centroid, np.array(case.truth.centroid, float), atol=1e-15)
        widened.append(found.widened)
    assert widened == sorted(widened) and widened[-1]


@pytest.mark.parametrize("case", [make("many_bodies", seed) for seed in range(0, 24, 2)], ids=repr)
def test_bodies_clipped_in_turn_have_the_exact_volume_and_gradients(case):
    found = overlap(*case.placed)
    if case.truth.dimension < 3:
        assert not found
        return
    off = abs(Fraction(found.volume) - case.truth.volume)
    assert off <= min(Fraction(found.volume_error), case.truth.volume / 10**12)
    assert_allclose(found.area, case.truth.area, rtol=1e-9)
    assert_allclose(found.centroid, np.array(case.truth.centroid, float), atol=1e-9)
    pulls = np.array([case.truth.pull(body) for body in range(len(case.bodies))], float)
    assert_allclose(found.gradient[:, :3], pulls, atol=1e-9 * case.truth.area)
    # Moved and turned together, the bodies have as much in common as before.
    about_origin = found.gradient[:, 3:]
    assert_allclose(about_origin.sum(0), 0, atol=1e-9 * case.truth.area)


TILTS = [0, 1e-16, 1e-15, 1e-14, 1e-13, 1e-12, 1e-10, 1e-8, 1e-6]
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
ROUND = 2 * np.pi * np.arange(5) / 5
STACKED = {
    "boxes": CORNERS,
    "prisms": np.array([[np.cos(a), np.sin(a), z] for a in ROUND for z in (-1, 1)]),
    "frustums": CORNERS * np.where(CORNERS[:, 2:] > 0, [0.75, 0.5, 1], 1),
}


def stacked(kind, tilt, place, depth, shift=0.0):
    """Two equal bodies whose sides are flush, one in the other by `depth` along z; the second is tilted and shifted."""
    turn, at = np.array([0.3, -0.2, 0.5, 0.7]), np.full(3, place)
    other = np.array([0.7 * tilt, -0.4 * tilt, 0.6 * tilt, 2.0])  # half of the angle
    up = np.array(exact.placed([(0, shift, 2 - depth)], (0, 0, 0), turn), float)[0]
    product = 2 * turn + np.array([*(turn[3] * other[:3] + np.cross(turn[:3], other[:3])), -turn[:3] @ other[:3]])
    if kind == "boxes":
        return PosedBox(np.ones(3), at, turn), PosedBox(np.ones(3), at + up, product)
    points = STACKED[kind]
    return Posed(points, at, turn), Posed(points, at + up, product)


@pytest.mark.parametrize("kind", STACKED)
@pytest.mark.parametrize("tilt", TILTS)
def test_bodies_with_flush_walls_are_right_to_twelve_digits(kind, tilt):
    for place in (0.0, 1.0, 1e3, 1e6):
        for depth in (0.3, 1e-3, 1e-6):
            for shift in (0.0, 2.0**-52, -1e-12, 0.4):
                case = Case(kind, tilt, stacked(kind, tilt, place, depth, shift))
                found = overlap(*case.placed)
                off = abs(Fraction(found.volume) - case.truth.volume)
                assert off <= min(Fraction(found.volume_error), case.truth.volume / 10**12)
                if tilt in (0, 1e-16):
                    assert found.way in ("clipping", "wide clipping")


@pytest.mark.parametrize("depth", [1e-5, 1e-6])
def test_walls_that_are_nearly_parallel_are_clipped(depth):
    """As in a stack of boxes that lean against each other."""
    for tilt in (1e-9, 1e-8, 1e-7):
        case = Case("stack", tilt, stacked("boxes", tilt, 0.1, depth, 3e-9))
        found = overlap(*case.placed)
        assert found.way == "wide clipping"
        assert abs(Fraction(found.volume) - case.truth.volume) <= Fraction(found.volume_error)
        assert found.volume_error <= 1e-12 * found.volume
        size = float(np.abs(case.truth.centroid).max()) + 1
        assert_allclose(found.centroid, np.array(case.truth.centroid, float), atol=1e-15 * size)
        for body in (0, 1):
            pull = np.array(case.truth.pull(body), float)
            assert_allclose(found.gradient[body, :3], pull, atol=1e-12 * case.truth.area)


def test_a_patch_of_flush_boxes_is_the_whole_face():
    found = overlap(Box((1, 1, 1)), Placed(Box((1, 1, 1)), (0, 0, 2 - 1e-7)))
    assert_allclose(found.gradient[1, :3], [0, 0, -4], atol=1e-12)
    assert_allclose(found.centroid, [0, 0, 1 - 5e-8], atol=1e-15)


def test_walls_with_corners_of_four_facets_stay_where_they_are():
    """Moved, such a corner would become two."""
    points = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    turn = np.array([0.3, -0.2, 0.5, 0.7])
    case = Case("octahedra", 0, (Posed(points, np.zeros(3), turn), Posed(points, np.zeros(3), turn)))
    found = overlap(*case.placed)
    assert "dual" in found.way
    assert abs(Fraction(found.volume) - case.truth.volume) <= Fraction(found.volume_error)
