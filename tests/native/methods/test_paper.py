"""The article's method, step for step, against the default method and against the exact truth."""

import exact
import numpy as np
import pytest
from numpy.testing import assert_allclose
from strategies import overlapping_points, quaternion

from overlapper import Box, Capsule, Cylinder, HalfSpace, Hull, Placed, Sphere, overlap


def random_pairs(count, seed):
    rng = np.random.default_rng(seed)
    return (overlapping_points(rng, low=6, high=20) for _ in range(count))


def test_paper_agrees_with_auto_on_two_thousand_pairs_in_general_position():
    ratios = []
    for p, q in random_pairs(2_000, seed=0):
        a, b = Hull(p), Hull(q)
        ratios.append(overlap(a, b, method="paper").volume / overlap(a, b).volume)
    assert_allclose(ratios, 1, rtol=1e-9)


def test_both_methods_agree_with_the_exact_truth_on_two_hundred_pairs():
    truth, paper, auto, bounds = [], [], [], []
    for p, q in random_pairs(200, seed=1):
        truth.append(float(exact.common(exact.hull(p), exact.hull(q)).volume))
        first, second = overlap(p, q, method="paper"), overlap(p, q)
        paper.append(first.volume)
        auto.append(second.volume)
        bounds.append((first.volume_error, second.volume_error))
    assert_allclose(auto, truth, rtol=1e-12)
    assert_allclose(paper, truth, rtol=1e-12)
    errors = np.abs(np.stack([paper, auto], 1) - np.array(truth)[:, None])
    assert (errors <= np.array(bounds)).all()


@pytest.mark.parametrize("seed", range(20))
def test_paper_gives_the_same_polytope_as_auto(seed):
    p, q = overlapping_points(np.random.default_rng(seed))
    paper, auto = overlap(p, q, method="paper"), overlap(p, q)
    assert paper.method == "paper"
    assert (len(paper.vertices), len(paper.facets)) == (len(auto.vertices), len(auto.facets))
    assert sorted(paper.owner) == sorted(auto.owner)
    assert_allclose(paper.centroid, auto.centroid, atol=1e-10)
    assert_allclose(paper.inertia, auto.inertia, atol=1e-10)
    assert_allclose(paper.gradient, auto.gradient, atol=1e-9)
    assert paper.area == pytest.approx(auto.area, rel=1e-9)
    assert paper.depth == pytest.approx(auto.depth, rel=1e-9)
    assert_allclose(paper.normal, auto.normal, atol=1e-7)
    assert sum(map(len, paper.patch)) == sum(map(len, auto.patch))


@pytest.mark.parametrize("count", range(3, 11))
def test_many_bodies_by_divide_and_conquer_agree_with_auto_and_the_truth(count):
    for seed in range(4):
        clouds = overlapping_points(np.random.default_rng([count, seed]), count, low=6, high=12)
        paper, auto = overlap(*clouds, method="paper"), overlap(*clouds)
        assert paper.volume == pytest.approx(auto.volume, rel=1e-9)
        assert paper.volume == pytest.approx(float(exact.common(*map(exact.hull, clouds)).volume), rel=1e-11)
        assert sorted(paper.owner) == sorted(auto.owner)
        assert_allclose(paper.gradient, auto.gradient, atol=1e-8)


SMOOTH = [
    [Sphere(1), Placed(Sphere(1), (1, 0, 0))],
    [Sphere(1), Placed(Box([1, 1, 1]), (0.8, 0.7, 0.6), (0.1, 0.2, 0.3, 0.4))],
    [Cylinder(1, 4), Placed(Cylinder(1, 4), (0.1, 0.2, 0.3), (0.1, 0.8, 0.2, 0.6))],
    [Capsule(0.5, 2), Placed(Capsule(0.4, 1), (0.3, 0.2, 0.1), (0.7, 0.1, 0.2, 0.6))],
    [Placed(Sphere(1), (0.1, 0.2, 0.5)), HalfSpace([0.1, 0.2, 1], 0)],
    [Sphere(1), Placed(Sphere(1), (0.7, 0.1, 0.2)), Placed(Cylinder(0.5, 3), (0.3, 0, 0), (0.2, 0.3, 0.4, 0.5))],
]


@pytest.mark.parametrize("shapes", SMOOTH)
def test_smooth_shapes_are_tessellated_to_the_tolerance(shapes):
    tolerance = 1e-2
    truth = overlap(*shapes, tolerance=1e-4)
    paper = overlap(*shapes, tolerance=tolerance, method="paper")
    assert abs(paper.volume - truth.volume) <= paper.volume_error + truth.volume_error
    # Each smooth body has lost up to the tolerance of its volume. The lost volume may all have been common.
    assert paper.volume_error <= tolerance * sum(body.volume for body in paper.shapes if np.isfinite(body.volume))


@pytest.mark.parametrize("seed", range(10))
def test_separated_hulls_are_separated_for_the_paper_too(seed):
    rng = np.random.default_rng(seed)
    p, q = overlapping_points(rng)
    answer = overlap(p, q + np.array([5.0, 1.0, 2.0]), method="paper")
    assert answer.status == "separated"
    assert answer.volume == answer.volume_error == 0
    assert answer.distance == pytest.approx(overlap(p, q + np.array([5.0, 1.0, 2.0])).distance, rel=1e-12)


def test_paper_takes_boxes_at_any_pose():
    rng = np.random.default_rng(2)
    for _ in range(50):
        a, b = (Placed(Box(rng.uniform(0.3, 1, 3)), rng.normal(size=3) * 0.2, quaternion(rng)) for _ in range(2))
        paper, auto = overlap(a, b, method="paper"), overlap(a, b)
        assert paper.volume == pytest.approx(auto.volume, rel=1e-9)


def test_a_half_space_far_from_a_tiny_ball_cuts_off_all_or_nothing():
    far = Placed(HalfSpace([0, 1, 2], 6), (-1, 0, 0), (0, -0.99893578348605228, 0, 0.046122667649506732))
    ball = Placed(Sphere(2e-12), (-0.75, 1, -1))
    inside, outside = overlap(far, ball, tolerance=0.025, method="paper"), overlap(ball, far, method="auto")
    assert inside.status == outside.status == "overlapping"
    assert inside.volume == pytest.approx(4 / 3 * np.pi * 8e-36, rel=0.05)
    ridges = sum(map(len, inside.facets)) / 2
    assert len(inside.vertices) - ridges + len(inside.facets) == 2


def test_overlapping_bodies_that_it_calls_separated_have_distance_zero():
    capsule = Placed(Capsule(1, 1), (0, -(2.0**-32), 0))
    corners = [(-0.25, -1.1444091796875e-05, 3.0000000000000004), (1, 3, 0.75), (-3, -0.5, -3)]
    corners += [(3.0000000000000004, 2.9999999999999996, 0.25), (-2.0000000000000004, -2, -0.25)]
    hull = Placed(corners, (-3.7071067813029619, -3.7071067813029619, -0.75))
    assert overlap(capsule, hull, tolerance=0.1, method="paper").distance == 0


def test_touching_bodies_that_it_calls_separated_have_a_normal():
    cylinder = Placed(Cylinder(0.020492852902879832, 0.5), (0.5, 0.5, 0.5), (0.5, 0.5, 0.5, 0.5))
    box = Placed(Box([0.5, 0.5, 0.5]), (0.5, 0.5, 1.0204928529028798))
    answer = overlap(cylinder, box, tolerance=0.0125, method="paper")
    assert answer.status == "separated" and overlap(cylinder, box).status == "touching"
    assert answer.normal == pytest.approx([0, 0, -1], abs=1e-9)


def test_a_polytope_that_rounding_turned_inside_out_is_not_a_solid():
    thick_and_thin = (
        Placed(Capsule(3, 0.5), (-0.25, 1.75, 1.75)),
        Placed(Capsule(2.3283064365386963e-10, 0.25), (0, 0.75, 0), (3, 5, 11, 3)),
    )
    answer = overlap(*thick_and_thin, tolerance=0.1, method="paper")
    assert (answer.status, answer.volume) == ("touching", 0)
    assert overlap(*thick_and_thin).status == "overlapping"


def test_an_overlap_of_needles_has_a_volume_and_an_area():
    needle = Placed(
        Capsule(2.7284841053187847e-12, 0.75),
        (-0.75, -1.3969838619232178e-09, 0),
        (0, -2.9802322387695312e-08, -9.0949470177292824e-13, -1.4901161193847656e-08),
    )
    ball = Placed(Capsule(0.7176470588235293, 1.4901161193847656e-08), 3 * (-1.4901161193847656e-08,))
    assert overlap(ball, needle, tolerance=0.1, method="paper").status == "touching"  # its area came out negative
    rng = np.random.default_rng(5)
    for _ in range(1_000):
        needle = Placed(Capsule(10 ** rng.uniform(-13, -6), 1), rng.normal(size=3), quaternion(rng))
        common = overlap(Sphere(2), needle, tolerance=0.1, method="paper")
        if common.status == "overlapping":
            assert common.volume > 0
            assert common.area > 0
