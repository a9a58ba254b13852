"""Derivatives of the centroid by poses and sizes: rational arithmetic, and differences of exact centroids."""

from fractions import Fraction

import exact
import numpy as np
import pytest
from families import make, points_of
from numpy.testing import assert_allclose
from pairs_of_kinds import KINDS, PAIRS, PairOfKinds
from scipy.spatial.transform import Rotation
from strategies import quaternion

from overlapper import Box, HalfSpace, Hull, Placed, Sphere, overlap, overlaps, random_polytope

FLAT = {"box", "half-space", "hull"}
FLAT_PAIRS = [kinds for kinds in PAIRS if FLAT.issuperset(kinds)]


def checked_pair(kinds, seed, tolerance, step=1e-4):
    """Compares with central differences of the fourth order."""
    pair = PairOfKinds(kinds, seed)
    found = pair.overlap(pair.numbers)
    assert_allclose(found.centroid_gradient[:, :, :3].sum(axis=0), np.eye(3), atol=tolerance)
    for body, kind in enumerate(kinds):
        count = len(KINDS[kind][1])
        by_shape = found.centroid_shape_gradient[body]
        assert np.isnan(by_shape).all() if kind == "hull" else not by_shape[:, count:].any()
        for k in range(count if kind == "hull" else 0, count + 6):
            slope = np.zeros(3)
            for side, weight in ((1, 8), (-1, -8), (2, -1), (-2, 1)):
                numbers = [row.copy() for row in pair.numbers]
                numbers[body][k] += side * step
                slope += weight / (12 * step) * pair.overlap(numbers).centroid
            column = by_shape[:, k] if k < count else found.centroid_gradient[body, :, k - count]
            assert_allclose(column, slope, rtol=0, atol=tolerance, err_msg=f"{kinds} {seed} {body} {k}")


@pytest.mark.parametrize("kinds", FLAT_PAIRS, ids=" and ".join)
def test_polyhedra_against_differences_of_centroids(kinds):
    for seed in (1, 2):
        checked_pair(kinds, seed, 1e-10)


@pytest.mark.parametrize("name", ["posed_boxes", "posed", "general"])
def test_poses_against_differences_in_rational_arithmetic(name):
    step, compared = Fraction(1, 2**70), 0
    for seed in range(3):
        case = make(name, seed)
        if case.truth.dimension < 3 or any(len(facet.owners) > 1 for facet in case.truth.facets):
            continue
        first, points = case.solids[0], [exact.vector(p) for p in points_of(case.bodies[1])]
        position = exact.vector(getattr(case.bodies[1], "position", (0, 0, 0)))
        about = [exact.subtract(p, position) for p in points]

        def centroid(position, turn, first=first, about=about):
            return exact.common(first, exact.hull(exact.placed(about, position, turn))).centroid

        truth, start = np.empty((3, 6)), centroid(position, (0, 0, 0, 1))
        for k in range(6):
            by = [step if i == k else Fraction(0) for i in range(6)]
            # A quaternion (r / 2, 1) turns by the vector r, but for the third power.
            there = centroid(exact.add(position, by[:3]), (*(r / 2 for r in by[3:]), 1))
            truth[:, k] = [float(each / step) for each in exact.subtract(there, start)]
        found = overlap(*case.placed).centroid_gradient
        assert_allclose(found[1], truth, rtol=0, atol=1e-9 * np.abs(truth).max(), err_msg=repr(case))
        assert_allclose(found[0, :, :3], np.eye(3) - truth[:, :3], rtol=0, atol=1e-9 * np.abs(truth).max())
        compared += 1
    assert compared >= 1


def test_a_group_of_polyhedra_against_differences_of_centroids():
    rng = np.random.default_rng(1)
    half = np.array([0.6, 0.5, 0.7])
    hull = Placed(Hull(random_polytope(12, rng=rng).vertices), rng.uniform(-0.2, 0.2, 3), quaternion(rng))
    water, turn = HalfSpace((1, 2, 3), 0.2), Rotation.from_quat(quaternion(rng))

    def group(numbers):
        turned = Rotation.from_rotvec(numbers[6:]) * turn
        return overlap(hull, Placed(Box(half + numbers[:3]), numbers[3:6], turned.as_quat()), water)

    found = group(np.zeros(9))
    columns = np.hstack([found.centroid_shape_gradient[1], found.centroid_gradient[1]])
    for k, column in enumerate(columns.T):
        by = 1e-5 * np.eye(9)[k]
        assert_allclose(column, (group(by).centroid - group(-by).centroid) / 2e-5, rtol=0, atol=1e-8)
    assert_allclose(found.centroid_gradient[:, :, :3].sum(axis=0), np.eye(3), atol=1e-14)


@pytest.mark.parametrize("depth", [0.5, 1e-3, 1e-6, 1e-9])
def test_the_corner_of_a_cube_in_a_half_space_has_a_closed_form(depth):
    # The common set is a pyramid. Its tip is the corner, and its base is the section, a regular triangle.
    corner, n = np.ones(3), np.ones(3) / np.sqrt(3)
    found = overlap(Placed(Box((1, 1, 1)), -corner), HalfSpace(-n, depth))
    assert_allclose(found.centroid, -n * depth * 3 / 4, rtol=0, atol=1e-15)
    # The pyramid grows with the offset.
    assert_allclose(found.centroid_shape_gradient[1, :, 0], -n * 3 / 4, rtol=0, atol=1e-9)
    assert_allclose(found.centroid_gradient[1, :, :3], np.outer(n, n) * 3 / 4, rtol=0, atol=1e-9)
    # A face that moves out by t lets the three edges grow by t √3 / √3 each, and moves the tip.
    by_size = np.eye(3) - np.outer(np.ones(3), np.ones(3)) / 4
    assert_allclose(found.centroid_shape_gradient[0], by_size, rtol=0, atol=1e-9)


def test_faces_in_one_plane_have_finite_one_sided_derivatives():
    box = Box((1, 1, 1))
    for other in (box, Placed(box, (0.5, 0, 0)), Placed(box, (0.5, 0.25, 0))):
        found = overlap(box, other)
        assert np.isfinite(found.centroid_gradient).all() and np.isfinite(found.centroid_shape_gradient).all()
        assert_allclose(found.centroid_gradient[:, :, :3].sum(axis=0), np.eye(3), atol=1e-14)


def test_the_inner_one_of_two_bodies_carries_the_centroid():
    inner = Placed(Box((0.5, 0.4, 0.3)), (0.1, 0.2, 0.3), (0.1, 0.2, 0.3, 1))
    found = overlap(Box((2, 2, 2)), inner)
    assert not found.centroid_gradient[0].any() and not found.centroid_shape_gradient[0].any()
    assert_allclose(found.centroid_gradient[1], np.eye(3, 6), atol=1e-14)
    assert_allclose(found.centroid_shape_gradient[1], 0, atol=1e-14)


def test_bodies_that_are_apart_or_touch_have_zeros():
    box = Box((1, 1, 1))
    for x in (2, 3):
        found = overlap(box, Placed(box, (x, 0, 0)))
        assert found.centroid_gradient.shape == (2, 3, 6) and not found.centroid_gradient.any()
        assert found.centroid_shape_gradient.shape == (2, 3, 3) and not found.centroid_shape_gradient.any()


def test_groups_with_a_round_body_have_none():
    found = overlap(Box((1, 1, 1)), Sphere(1.0), Box((2, 1, 1)))
    assert np.isnan(found.centroid_gradient).all() and np.isnan(found.centroid_shape_gradient).all()


def test_rows_of_a_batch_have_those_of_their_overlaps():
    rng = np.random.default_rng(4)
    shapes = [
        Box((1, 0.5, 0.7)),
        Hull(random_polytope(20, rng=rng).vertices),
        HalfSpace((0, 0, 1), 0.1),
        Box((1, 1, 1)),
    ]
    positions = np.r_[rng.uniform(-0.3, 0.3, (3, 3)), [[9, 0, 0]]]
    turns = np.array([quaternion(rng) for _ in shapes])
    found = overlaps(shapes, positions, turns, pairs=[(0, 1), (0, 2), (0, 3)])
    assert found.centroid_gradient.shape == (3, 2, 3, 6) and found.centroid_shape_gradient.shape == (3, 2, 3, 3)
    for row in range(2):
        assert np.array_equal(found.centroid_gradient[row], found[row].centroid_gradient)
        assert np.array_equal(found.centroid_shape_gradient[row], found[row].centroid_shape_gradient, equal_nan=True)
    assert not found.centroid_gradient[2].any() and not found.centroid_shape_gradient[2].any()
    assert np.array_equal(found[[1, 0]].centroid_gradient, found.centroid_gradient[[1, 0]])
