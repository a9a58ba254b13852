"""Bounds of the errors of all measures. The rules of the families test the bounds for polyhedra."""

import numpy as np
import pytest
from families import CORNERS, make
from numpy.testing import assert_allclose
from rules import the_errors_hold_the_measures
from strategies import quaternion

from overlapper import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, Placed, RoundedHull, Sphere, overlap

CUBE = Box([1, 1, 1])


def random_shape(rng):
    size = rng.uniform(0.3, 1.2)
    shapes = (
        lambda: Sphere(size),
        lambda: Capsule(size / 2, size),
        lambda: Cylinder(size / 2, size),
        lambda: Ellipsoid(rng.uniform(0.2, 1, 3) * size),
        lambda: RoundedHull(rng.normal(size=(6, 3)) * size / 2, size / 3),
        lambda: Box(rng.uniform(0.2, 1, 3) * size),
        lambda: Hull(rng.normal(size=(12, 3)) * size),
    )
    return shapes[rng.integers(len(shapes))]()


def overlapping_bodies(seed):
    """A pair, or three, near enough to each other."""
    rng = np.random.default_rng(seed)
    return [Placed(random_shape(rng), rng.normal(size=3) * 0.1, quaternion(rng)) for _ in range(2 + seed % 2)]


@pytest.mark.parametrize("seed", range(40))
def test_measures_of_round_bodies_at_two_tolerances_are_within_the_errors_of_both(seed):
    bodies = overlapping_bodies(seed)
    coarse, fine = overlap(*bodies, tolerance=1e-2), overlap(*bodies, tolerance=1e-3)
    assert coarse and fine
    size = float(np.linalg.norm(np.ptp(fine.bounds, axis=0)))
    assert abs(coarse.area - fine.area) <= coarse.errors.area + fine.errors.area
    assert np.linalg.norm(coarse.centroid - fine.centroid) <= coarse.errors.centroid + fine.errors.centroid
    assert np.abs(coarse.inertia - fine.inertia).max() <= coarse.errors.inertia + fine.errors.inertia
    slopes = coarse.errors.gradient + fine.errors.gradient
    assert (np.abs(coarse.gradient - fine.gradient) <= slopes).all()
    along = np.random.default_rng(seed).normal(size=(50, 3))
    along /= np.linalg.norm(along, axis=1)[:, None]
    reach = np.abs((coarse.vertices @ along.T).max(0) - (fine.vertices @ along.T).max(0)).max()
    assert reach <= coarse.errors.vertices + fine.errors.vertices
    assert coarse.errors.vertices <= 0.05 * size


@pytest.mark.parametrize("family", ["general", "slivers", "shared_planes", "touching", "tilted_slivers"])
def test_the_errors_of_method_paper_hold_what_it_loses(family):
    for seed in range(6):
        case = make(family, seed)
        found = overlap(*case.placed, method="paper")
        assert not the_errors_hold_the_measures(case, found), case
        if not found and case.truth.dimension == 3:
            assert found.errors.area >= case.truth.area
            assert found.errors.centroid is None


def test_bodies_apart_have_no_errors_and_bodies_that_touch_may_share_what_rounding_hides():
    apart = overlap(CUBE, Placed(CUBE, (3, 0, 0))).errors
    assert (apart.volume, apart.area, apart.inertia, apart.centroid, apart.vertices) == (0, 0, 0, None, None)
    assert not apart.gradient.any() and apart.gradient.shape == (2, 6)
    found = overlap(CUBE, Placed(CUBE, (2, 0, 0)))
    assert found.status == "touching" and found.errors.volume == found.volume_error > 0
    assert 8 <= found.errors.area <= 24 and np.isfinite(found.errors.gradient).all()
    assert 0 < found.errors.inertia < 1e-10


def test_the_error_of_the_gradient_includes_facets_that_both_bodies_may_own():
    flush = overlap(CUBE, Placed(CUBE, (1, 0, 0)))
    assert_allclose(flush.errors.gradient[:, 0], 4 * 2, rtol=1e-6)  # four walls of 2 m² in common
    drum = overlap(Cylinder(1, 2), Placed(Box([2, 2, 0.75]), (0, 0, 0.25)))  # the lid, in the plane of a facet
    assert_allclose(drum.errors.gradient[:, 0], np.pi, rtol=1e-2)
    twins = overlap(Sphere(1), Sphere(1))
    assert_allclose(twins.errors.gradient[:, 0], 4 * np.pi, rtol=1e-2)
    beyond = overlap(CUBE, Placed(Box([2, 2, 2]), (2, 0, 0)))
    assert (beyond.errors.gradient < 1e-10).all()


def test_the_error_of_the_gradient_includes_strips_where_surfaces_are_tangent_within_rounding():
    lying = overlap(Capsule(0.5, 2), Box([0.5, 1, 2]))
    slopes = lying.errors.gradient[:, 0]
    assert (slopes > 1e-8).all() and (slopes < 1e-5).all()  # as wide as the root of 1e-16, on either side
    assert lying.errors.area < 1e-8
    rounded = overlap(RoundedHull(CORNERS, 0.3), Box([1.3, 2, 2]))
    assert_allclose(rounded.errors.gradient[:, 0], 8, rtol=1e-6)  # two facets


def test_errors_are_small_where_surfaces_meet_at_an_angle():
    for seed in range(0, 60, 2):
        found = overlap(*overlapping_bodies(seed))
        if found.way not in ("slicing", "closed form"):
            continue
        size = float(np.linalg.norm(np.ptp(found.bounds, axis=0)))
        errors = found.errors
        assert errors.area <= 1e-10 * found.area
        assert errors.centroid <= 1e-10 * size
        assert errors.inertia <= 1e-10 * found.volume * size**2
        assert (errors.gradient[:, 0] <= 1e-10 * found.area).all()


def test_half_of_a_ball_at_the_end_of_a_capsule_has_a_face():
    half = overlap(Capsule(1, 2), Placed(HalfSpace([0, 0, 1], -1)))
    assert_allclose(half.area, 3 * np.pi, rtol=1e-14)
    assert_allclose(half.gradient[:, :3], [[0, 0, -np.pi], [0, 0, np.pi]], rtol=1e-14, atol=1e-14)


def test_errors_are_finite_at_any_size():
    for scale in (1e-24, 1e24):
        errors = overlap(Box([scale] * 3), Placed(Box([scale] * 3), (scale, 0, scale / 3), (1, 2, 3, 4))).errors
        assert 0 < errors.area <= 1e-12 * scale**2
        assert 0 < errors.centroid <= 1e-12 * scale
        assert 0 < errors.vertices <= 1e-12 * scale
        assert 0 < errors.inertia <= 1e-12 * scale**5
        assert np.isfinite(errors.gradient).all()


def test_errors_have_a_readable_repr():
    text = repr(overlap(CUBE, Placed(CUBE, (1, 0, 0))).errors)
    assert text.startswith("Errors(volume=") and " m³, area=" in text and ", centroid=" in text
    assert ", depth=" in text and ", distance=" in text
    three = overlap(CUBE, Placed(CUBE, (1, 0, 0)), Placed(CUBE, (0, 1, 0))).errors
    assert (three.depth, three.distance, three.witnesses) == (None, None, None) and "depth" not in repr(three)
    assert "centroid" not in repr(overlap(CUBE, Placed(CUBE, (3, 0, 0))).errors)


@pytest.mark.parametrize("tolerance", [0.9, 0.1, 1e-2, 1e-4])
def test_a_tolerance_is_kept_by_all_shapes(tolerance):
    for seed in range(30):
        found = overlap(*overlapping_bodies(seed), tolerance=tolerance)
        assert found.converged and found.volume_error <= tolerance * found.volume


def test_converged_says_whether_the_tolerance_is_kept():
    three = CUBE, Placed(CUBE, (1, 0, 0), (1, 2, 3, 4)), Placed(CUBE, (0, 1, 0))
    assert overlap(*three).converged and not overlap(*three, tolerance=1e-16).converged
    assert overlap(CUBE, Placed(CUBE, (2, 0, 0)), tolerance=1e-16).converged


def prism(sides, low):
    """The corners of a prism of height 1 on the unit circle."""
    angle = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.vstack([np.column_stack([circle, np.full(sides, z)]) for z in (low, low + 1)])


def test_two_lids_of_many_corners_in_one_plane_within_rounding_are_one_shared_facet():
    found = overlap(Hull(prism(400, 0)), Hull(prism(400, 1 - 1e-6)))
    walls = 1e-6 * 800 * np.sin(np.pi / 400)
    assert found.errors.gradient[0, 0] == pytest.approx(walls, rel=1e-2)
    assert found.errors.depth <= 1e-13


def test_vertices_that_are_too_many_to_be_compared_are_bounded_by_the_bodies():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(4000, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    found = overlap(Hull(points), Placed(Hull(points), (1e-3, 0, 0)), method="paper")
    assert found and 1 < found.errors.vertices < 4
