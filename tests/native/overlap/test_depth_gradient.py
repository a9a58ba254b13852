"""The derivatives of the depth, by pose and by shape, against differences of depths."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pairs_of_kinds import KINDS, PAIRS, PairOfKinds
from scipy.spatial.transform import Rotation

from overlapper import Box, HalfSpace, Hull, Placed, Sphere, overlap, overlaps

CUBE = Box([1, 1, 1])
FLOOR = HalfSpace([0, 0, 1], 0)
TURN = (0.1, -0.2, 0.3, 0.9)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kinds", PAIRS, ids=" and ".join)
def test_derivatives_by_pose_and_by_shape_against_differences_of_depths(kinds, seed):
    pair = PairOfKinds(kinds, seed)
    found, step = pair.overlap(pair.numbers), 1e-6
    assert found
    for body, kind in enumerate(kinds):
        count = len(KINDS[kind][1])
        sizes = found.depth_shape_gradient[body, :count]
        if kind == "hull":
            assert np.isnan(sizes).all()
        slopes = np.r_[[] if kind == "hull" else sizes, found.depth_gradient[body]]
        for k, slope in enumerate(slopes, start=-len(slopes)):
            depths = []
            for side in (-1, 1):
                numbers = [each.copy() for each in pair.numbers]
                numbers[body][k] += side * step
                depths.append(pair.overlap(numbers).depth)
            assert slope == pytest.approx((depths[1] - depths[0]) / (2 * step), abs=1e-8), k


@pytest.mark.parametrize("kinds", PAIRS, ids=" and ".join)
def test_a_motion_of_both_bodies_leaves_the_depth(kinds):
    pair = PairOfKinds(kinds, seed=4)
    found = pair.overlap(pair.numbers)
    gradient = found.depth_gradient
    moments = gradient[:, 3:] + np.cross([position for position, _ in pair.poses], gradient[:, :3])
    assert_allclose(gradient[:, :3], [-found.normal, found.normal], atol=1e-15)
    assert_allclose(moments.sum(0), 0, atol=1e-14)


def test_sizes_scale_the_depth():
    # The depth has the degree 1 in all lengths: sizes, and the way between the bodies.
    rng = np.random.default_rng(0)
    for _ in range(50):
        a, b = (Placed(Box(rng.uniform(0.5, 1, 3)), rng.normal(size=3) * 0.3, rng.normal(size=4)) for _ in range(2))
        found = overlap(a, b)
        scaled = sum(found.depth_shape_gradient[i] @ each.shape.half_extents for i, each in enumerate((a, b)))
        moved = sum(found.depth_gradient[i, :3] @ each.position for i, each in enumerate((a, b)))
        assert found.depth == pytest.approx(scaled + moved, abs=1e-13)


def test_a_face_on_a_floor_turns_about_one_of_its_points():
    found = overlap(Placed(CUBE, (3, 2, 0.9)), FLOOR)
    assert_allclose(found.depth_gradient[:, :3], [[0, 0, -1], [0, 0, 1]], atol=1e-15)
    turns = found.depth_gradient[0, 3:]
    assert max(abs(turns)) <= 1 and turns[2] == 0
    assert found.depth_shape_gradient.tolist() == [[0, 0, 1], [1, 0, 0]]


def test_far_and_small_bodies_keep_their_derivatives():
    for scale, away in ((1e-6, 0), (1e6, 0), (1, 1e5)):
        a = Placed(Box(np.array([1, 2, 3]) * scale), np.array([away, 0, 0]), TURN)
        b = Placed(Sphere(scale), np.array([away, 0, 0]) + scale * np.array([1.5, 0.5, 0.2]))
        found = overlap(a, b)
        assert found.depth_shape_gradient[1, 0] == 1
        along = Rotation.from_quat(TURN).inv().apply(found.normal)
        assert found.depth_shape_gradient[0] == pytest.approx(abs(along), abs=1e-12)
        # The ball does not turn the depth about its centre.
        assert_allclose(found.depth_gradient[1, 3:], 0, atol=1e-9 * scale)


def test_without_an_overlap_all_is_zero_and_groups_have_none():
    apart = overlap(CUBE, Placed(CUBE, (3, 0, 0)))
    assert not apart.depth_gradient.any() and not apart.depth_shape_gradient.any()
    assert apart.depth_gradient.shape == (2, 6) and apart.depth_shape_gradient.shape == (2, 3)
    three = overlap(CUBE, CUBE, CUBE)
    assert three.depth_gradient is None and three.depth_shape_gradient is None


def test_a_batch_has_the_same_bits():
    rng = np.random.default_rng(1)
    hull = Hull(rng.normal(size=(12, 3)))
    shapes = [CUBE, Sphere(0.8), hull, FLOOR]
    positions, orientations = rng.normal(size=(4, 3)) * 0.5, rng.normal(size=(4, 4))
    pairs = [(0, 1), (0, 2), (1, 3), (2, 3), (1, 2)]
    rows = overlaps(shapes, positions, orientations, pairs)
    assert rows.depth_gradient.shape == (5, 2, 6) and rows.depth_shape_gradient.shape == (5, 2, 3)
    for row, pair in enumerate(pairs):
        one = overlap(*(Placed(shapes[k], positions[k], orientations[k]) for k in pair))
        assert np.array_equal(rows.depth_gradient[row], one.depth_gradient)
        assert np.array_equal(rows.depth_shape_gradient[row], one.depth_shape_gradient, equal_nan=True)
