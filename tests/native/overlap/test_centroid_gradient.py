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
    overlaps,
    random_polytope,
)

FLAT = {"box", "half-space", "hull"}


def checked_pair(kinds, seed, tolerance, step):
    """Compares with central differences of the fourth order."""
    pair = PairOfKinds(kinds, seed)
    found = pair.overlap(pair.numbers)
    assert_allclose(found.centroid_gradient[:, :, :3].sum(axis=0), np.eye(3), atol=1e-13)
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


@pytest.mark.parametrize("kinds", PAIRS, ids=" and ".join)
def test_every_two_kinds_of_shapes_against_differences_of_centroids(kinds):
    for seed in (1, 2):
        if FLAT.issuperset(kinds):
            checked_pair(kinds, seed, 1e-10, 1e-4)
        else:
            checked_pair(kinds, seed, 2e-8, 2e-5)


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


@pytest.mark.parametrize("inner", [Sphere(0.3), Capsule(0.2, 0.4), Cylinder(0.3, 0.5), Ellipsoid((0.2, 0.3, 0.4))])
@pytest.mark.parametrize("outer", [Box((2, 2, 2)), Sphere(3.0), Cylinder(3.0, 5.0)])
def test_an_inner_round_body_carries_the_centroid(inner, outer):
    found = overlap(outer, Placed(inner, (0.1, 0.2, 0.3), (0.1, 0.2, 0.3, 1)))
    assert_allclose(found.centroid_gradient[0], 0, atol=1e-12)
    assert_allclose(found.centroid_gradient[1], np.eye(3, 6), atol=1e-12)
    assert_allclose(found.centroid_shape_gradient, 0, atol=1e-12)


def test_bodies_that_are_apart_or_touch_have_zeros():
    box = Box((1, 1, 1))
    for x in (2, 3):
        found = overlap(box, Placed(box, (x, 0, 0)))
        assert found.centroid_gradient.shape == (2, 3, 6) and not found.centroid_gradient.any()
        assert found.centroid_shape_gradient.shape == (2, 3, 3) and not found.centroid_shape_gradient.any()


SIZED = {kind: numbers for kind, (_, numbers) in KINDS.items() if "hull" not in kind}


@pytest.mark.parametrize("depth", [0.3, 1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("kinds", [kinds for kinds in PAIRS if SIZED.keys() >= set(kinds)], ids=" and ".join)
def test_scaling_and_turning_a_pair_at_any_depth(kinds, depth):
    """The centroid has the degree 1 in all sizes and places, and turns with the pair."""
    rng = np.random.default_rng(5)
    turns = [quaternion(rng) for _ in kinds]
    ahead = quaternion(rng)[:3]
    if "half-space" in kinds:
        ahead = Rotation.from_quat(turns[kinds.index("half-space")]).apply([0.6, 0, 0.8])
        ahead *= 1 if kinds[0] == "half-space" else -1
    one, two = (KINDS[kind][0](*SIZED[kind]) for kind in kinds)
    low, high = -5.0 if "half-space" in kinds else 0.0, 5.0
    for _ in range(50):
        middle = (low + high) / 2
        found = overlap(Placed(one, (0, 0, 0), turns[0]), Placed(two, middle * ahead, turns[1]))
        low, high = (middle, high) if found and found.depth > depth else (low, middle)
    found = overlap(Placed(one, (0, 0, 0), turns[0]), Placed(two, low * ahead, turns[1]))
    pose, shape, places = found.centroid_gradient, found.centroid_shape_gradient, (np.zeros(3), low * ahead)
    grown, turned = np.zeros(3), np.zeros((3, 3))
    for body, kind in enumerate(kinds):
        grown += pose[body, :, :3] @ places[body] + shape[body, :, : len(SIZED[kind])] @ SIZED[kind]
        turned += pose[body, :, 3:] + pose[body, :, :3] @ np.cross(np.eye(3), places[body]).T
    # Rounding moves the nodes of a seam on a cylinder more.
    long = {"capsule", "cylinder"}.intersection(kinds)
    tolerance = max(1e-11, 1e-14 / depth) * np.abs(pose).max() if depth > 1e-5 or not long else 1e-4
    assert_allclose(grown, found.centroid, rtol=0, atol=tolerance)
    assert_allclose(turned, np.cross(np.eye(3), found.centroid).T, rtol=0, atol=tolerance)


@pytest.mark.parametrize("depth", [1e-7, 1e-6, 1e-4, 0.3, 0.6, 1.0])
def test_a_ball_in_a_half_space_has_a_closed_form(depth):
    rng, radius = np.random.default_rng(6), 0.6
    for _ in range(5):
        plane = Placed(HalfSpace((0.6, 0, 0.8), 0.1), (0, 0, 0), quaternion(rng))
        n = Rotation.from_quat(plane.orientation).apply([0.6, 0, 0.8])
        found = overlap(Placed(Sphere(radius), n * (0.1 + radius - depth)), plane)
        # The centroid of a cap is 3 (2 r − d)² / (4 (3 r − d)) from the centre of the ball.
        a, b = 2 * radius - depth, 3 * radius - depth
        slope = 3 / 4 * (-2 * a * b + a**2) / b**2
        by_radius = 3 / 4 * (4 * a * b - 3 * a**2) / b**2
        atol = 1e-9 + 1e-14 / depth
        assert_allclose(found.centroid_gradient[0, :, :3], np.eye(3) + slope * np.outer(n, n), rtol=0, atol=atol)
        assert_allclose(found.centroid_gradient[0, :, 3:], 0, atol=atol)
        assert_allclose(found.centroid_shape_gradient[1, :, 0], -slope * n, rtol=0, atol=atol)
        # A ball that grows about its centre also sinks.
        assert_allclose(found.centroid_shape_gradient[0, :, 0], -(by_radius + slope) * n, rtol=0, atol=atol)


def test_groups_with_a_round_body_have_none():
    found = overlap(Box((1, 1, 1)), Sphere(1.0), Box((2, 1, 1)))
    assert np.isnan(found.centroid_gradient).all() and np.isnan(found.centroid_shape_gradient).all()


def test_pairs_without_derivatives_have_none():
    core = random_polytope(8, rng=1).vertices * 0.4
    cylinder = Cylinder(0.5, 2.0)
    for a, b in (
        (RoundedHull(core, 0.2), RoundedHull(core, 0.2)),
        (Sphere(1.0), Sphere(1.0)),
        (cylinder, Placed(cylinder, (0, 0, 0.5))),
        (cylinder, Placed(Box((1, 1, 1)), (0.5, 0, 0))),  # the ends of both are in one plane
    ):
        found = overlap(a, b)
        assert np.isnan(found.centroid_gradient).all() and np.isnan(found.centroid_shape_gradient).all()
    short = overlap(Capsule(0.5, 0), Placed(Box((0.3, 0.3, 0.3)), (0.4, 0, 0))).centroid_shape_gradient[0]
    assert np.isfinite(short[:, 0]).all() and np.isnan(short[:, 1]).all() and not short[:, 2].any()


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
