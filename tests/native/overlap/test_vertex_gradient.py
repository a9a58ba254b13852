"""The derivatives of the volume by the vertices of hulls: rational arithmetic, and differences of exact volumes."""

from fractions import Fraction
from itertools import pairwise

import exact
import numpy as np
import pytest
from families import make
from numpy.testing import assert_allclose
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
    penetration_depth,
    random_polytope,
)


def by_vertices(case, body):
    """The derivative by each vertex of a hull of triangles, without rounding.

    Over a triangle of the common surface, the mean of a barycentric coordinate is its value at the centroid.
    """
    found = {point: exact.vector((0, 0, 0)) for point in case.solids[body].vertices}
    for ring, part in exact.triangles_of(case.solids[body], case.truth, body):
        for q, r in pairwise(part[1:]):
            area = exact.cross(exact.subtract(q, part[0]), exact.subtract(r, part[0]))
            middle = tuple((x + y + z) / 3 for x, y, z in zip(part[0], q, r))
            for k in range(3):
                share = tuple(exact.barycentric(ring, k, middle) * each / 2 for each in area)
                found[ring[k]] = exact.add(found[ring[k]], share)
    return found


@pytest.mark.parametrize("seed", range(25))
def test_vertices_of_hulls_of_triangles_against_rational_arithmetic(seed):
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.integers(-3, 3)
    clouds = [size * (rng.normal(size=(n, 3)) + 0.5 * rng.normal(size=3)) for n in (6, 14)]
    case = type(make("general", 0))("random", 0, tuple(clouds))
    if case.truth.dimension < 3:
        return
    found = overlap(*case.placed)
    for body in (0, 1):
        exactly = by_vertices(case, body)
        rows = case.placed[body].vertices if isinstance(case.placed[body], Hull) else Hull(clouds[body]).vertices
        expected = np.array([[float(x) for x in exactly[exact.point(p)]] for p in rows])
        off = np.linalg.norm(found.vertex_gradients[body] - expected, axis=1)
        assert off.max() <= 1e-12 * case.truth.area
        assert (off <= found.errors.vertex_gradients[body]).all()
        assert found.errors.vertex_gradients[body].max() <= 1e-8 * case.truth.area
        assert_allclose(found.vertex_gradients[body].sum(0), found.gradient[body, :3], atol=1e-13 * case.truth.area)


@pytest.mark.parametrize("family", ["slivers", "tilted_slivers", "needles_and_plates", "tiny_in_huge", "far_away"])
def test_stated_errors_of_hard_pairs_hold(family):
    compared = 0
    for seed in range(12):
        case = make(family, seed)
        found = overlap(*case.placed)
        if case.truth.dimension < 3 or any(len(facet.owners) > 1 for facet in case.truth.facets):
            continue
        for body, points in enumerate(case.bodies):
            hull = Hull(points)
            exact_points = [exact.point(p) for p in hull.vertices]
            triangles = all(len(facet) == 3 for facet in hull.facets)
            if not triangles or {*exact_points} != {*case.solids[body].vertices} or found.status != "overlapping":
                continue
            exactly = by_vertices(case, body)
            expected = np.array([[float(x) for x in exactly[p]] for p in exact_points])
            off = np.linalg.norm(found.vertex_gradients[body] - expected, axis=1)
            assert (off <= found.errors.vertex_gradients[body]).all(), case
            assert off.max() <= 1e-4 * case.truth.area, case
            compared += 1
    assert compared >= 4


def test_a_moved_vertex_against_differences_of_exact_volumes():
    # The volume is a polynomial in the place of a vertex until the next corner passes a plane.
    rng = np.random.default_rng(5)
    points, other = rng.normal(size=(8, 3)), exact.hull(rng.normal(size=(9, 3)) + 0.3)
    hull = Hull(points)
    found = overlap(hull, Hull([[float(x) for x in exact.coordinates(p)] for p in other.vertices])).vertex_gradients[0]
    step = Fraction(1, 2**60)
    for v, vertex in enumerate(hull.vertices):
        for axis in range(3):
            volumes = []
            for side in (-1, 1):
                cloud = [list(exact.vector(p)) for p in hull.vertices]
                cloud[v][axis] += side * step
                volumes.append(exact.common(exact.hull(cloud), other).volume)
            assert found[v, axis] == pytest.approx(float((volumes[1] - volumes[0]) / (2 * step)), abs=1e-13), vertex


@pytest.mark.parametrize("others", [1, 2])
def test_a_box_as_a_hull_has_the_derivatives_of_the_box(others):
    # Facets of four corners: stretching along an axis keeps them flat.
    rng = np.random.default_rng(6)
    for _ in range(6):
        half, position, turn = rng.uniform(0.5, 1, 3), rng.uniform(-0.5, 0.5, 3), quaternion(rng)
        rest = [Placed(Box(rng.uniform(0.5, 1, 3)), rng.uniform(-0.4, 0.4, 3), quaternion(rng)) for _ in range(others)]
        corners = half * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        hull = Hull(corners)
        by_size = overlap(Placed(Box(half), position, turn), *rest).shape_gradient[0]
        found = overlap(Placed(hull, position, turn), *rest)
        own = Rotation.from_quat(turn).inv().apply(found.vertex_gradients[0])
        assert_allclose((own * hull.vertices / half).sum(0), by_size, rtol=0, atol=1e-13)
        assert found.vertex_gradients[1:] == [None] * others


def test_vertices_that_the_other_body_does_not_reach():
    hull = Hull(random_polytope(30, rng=1).vertices)
    whole = overlap(hull, Box((9, 9, 9)))
    assert_allclose((whole.vertex_gradients[0] * hull.vertices).sum(), 3 * hull.volume, rtol=1e-12)
    half = overlap(hull, HalfSpace((0, 0, 1), 0.0))
    reached = np.linalg.norm(half.vertex_gradients[0], axis=1) > 0
    assert reached[hull.vertices[:, 2] < 0].all() and not reached.all()
    assert not overlap(hull, Placed(hull, (9, 0, 0))).vertex_gradients[1].any()
    assert overlap(hull, Placed(hull, (9, 0, 0))).errors.vertex_gradients[0].shape == (len(hull.vertices),)
    rounded = overlap(RoundedHull(hull.vertices, 0.1), Sphere(0.5), Box((1, 1, 1)))
    assert np.isnan(rounded.vertex_gradients[0]).all() and np.isnan(rounded.errors.vertex_gradients[0]).all()
    assert overlap(Sphere(1), Box((1, 1, 1))).vertex_gradients == [None, None]


ROUND = {
    "sphere": Sphere(0.5),
    "capsule": Capsule(0.3, 0.8),
    "cylinder": Cylinder(0.4, 0.7),
    "ellipsoid": Ellipsoid((0.5, 0.3, 0.4)),
    "rounded hull": RoundedHull(random_polytope(8, rng=3).vertices * 0.3, 0.2),
}
HULLS = {
    "triangles": random_polytope(14, rng=1).vertices * 0.7,
    "cube": np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]),
}


def differences(volume, vertices, step):
    """Central differences of a function of vertices by each coordinate."""
    slopes = np.empty_like(vertices)
    for at in np.ndindex(vertices.shape):
        by = np.zeros_like(vertices)
        by[at] = step
        slopes[at] = (volume(vertices + by) - volume(vertices - by)) / (2 * step)
    return slopes


@pytest.mark.parametrize("kind", ROUND)
def test_vertices_in_a_round_body_against_differences_of_volumes(kind):
    # Random hulls have triangles: a vertex that moves folds no facet.
    hull = Hull(HULLS["triangles"])
    body = Placed(ROUND[kind], (0.3, 0.25, -0.2), (0.3, -0.2, 0.5, 0.7))
    found, step = overlap(hull, body), 1e-5
    expected = differences(lambda vertices: overlap(Hull(vertices), body).volume, hull.vertices, step)
    assert_allclose(found.vertex_gradients[0], expected, rtol=0, atol=2e-9)


@pytest.mark.parametrize("name", HULLS)
@pytest.mark.parametrize("kind", ROUND)
def test_vertices_in_a_round_body_add_up_to_force_and_moment(kind, name):
    # The force and the moment come from slices or closed forms, at depths from half of the body to 1e-8 of it.
    rng = np.random.default_rng(7)
    hull = Hull(HULLS[name])
    for depth in (0.2, 1e-2, 1e-5, 1e-8):
        for turn in ((0, 0, 0, 1), quaternion(rng)):
            ahead = rng.normal(size=3)
            ahead /= np.linalg.norm(ahead)
            low, high = 0.0, 5.0
            for _ in range(50):
                middle = (low + high) / 2
                deep = penetration_depth(hull, Placed(ROUND[kind], middle * ahead, turn)) > depth
                low, high = (middle, high) if deep else (low, middle)
            found = overlap(hull, Placed(ROUND[kind], low * ahead, turn))
            vertices, stated = found.vertex_gradients[0], found.errors.vertex_gradients[0]
            off = vertices.sum(0) - found.gradient[0, :3]
            turning = np.cross(hull.vertices, vertices).sum(0) - found.gradient[0, 3:]
            assert np.isfinite(vertices).all() and (stated >= np.linalg.norm(off)).all()
            assert np.linalg.norm(off) <= 1e-6 * found.area and np.linalg.norm(turning) <= 1e-6 * found.area
            assert stated.max() <= 1e-4 * found.area


def test_a_hull_and_an_ellipsoid_that_are_stretched_together():
    # Along each axis of both, the volume has the degree 1 in their sizes.
    rng = np.random.default_rng(8)
    for points in HULLS.values():
        hull, half_axes = Hull(points + rng.uniform(-0.3, 0.3, 3)), rng.uniform(0.3, 0.8, 3)
        found = overlap(hull, Ellipsoid(half_axes))
        along = (hull.vertices * found.vertex_gradients[0]).sum(0) + half_axes * found.shape_gradient[1]
        assert_allclose(along, np.full(3, found.volume), rtol=1e-11)


def test_a_hull_around_a_round_body_or_within_it():
    hull = Hull(HULLS["triangles"])
    for body in ROUND.values():
        assert not overlap(Hull(hull.vertices * 20), body).vertex_gradients[0].any()
    within = overlap(hull, Placed(Sphere(5.0), (0.5, 0.2, 0)))
    expected = overlap(hull, Box((5, 5, 5))).vertex_gradients[0]
    assert_allclose(within.vertex_gradients[0], expected, rtol=0, atol=1e-14)


BESIDE_ROUNDED = {
    **ROUND,
    "box": Box((0.5, 0.4, 0.3)),
    "hull": Hull(HULLS["cube"] * 0.8),
    "half-space": HalfSpace((0.6, 0, 0.8), 0.1),
}


def placed_by_chance(kind, rng):
    shape = BESIDE_ROUNDED[kind]
    if kind == "half-space":
        return HalfSpace(rng.normal(size=3), 0.1)
    ahead = rng.normal(size=3)
    return Placed(shape, rng.uniform(0.1, 0.6) * ahead / np.linalg.norm(ahead), quaternion(rng))


@pytest.mark.parametrize("kind", BESIDE_ROUNDED)
def test_core_of_a_rounded_hull_against_differences_of_volumes(kind):
    # The core has triangles, so that a vertex that moves folds no facet.
    rng, step = np.random.default_rng(9), 1e-5
    rounded = RoundedHull(random_polytope(9, rng=7).vertices * 0.4, 0.2)
    vertices = rounded.core.vertices
    assert all(len(facet) == 3 for facet in rounded.core.facets)
    for _ in range(2):
        body = placed_by_chance(kind, rng)
        found = overlap(rounded, body)
        assert found.status == "overlapping"
        expected = differences(lambda moved, body=body: overlap(RoundedHull(moved, 0.2), body).volume, vertices, step)
        assert_allclose(found.vertex_gradients[0], expected, rtol=0, atol=5e-9)


@pytest.mark.parametrize("core", HULLS)
@pytest.mark.parametrize("kind", BESIDE_ROUNDED)
def test_vertices_of_a_core_add_up_to_force_moment_and_volume(kind, core):
    # In all lengths, the volume has the degree 3. Turned about its position, the core turns the rounded hull.
    rng = np.random.default_rng(10)
    rounded = RoundedHull(HULLS[core] * 0.7, 0.15)
    vertices = rounded.core.vertices
    for depth in (0.2, 1e-2, 1e-5, 1e-8):
        ahead, turn = rng.normal(size=3), quaternion(rng)
        ahead /= np.linalg.norm(ahead)

        def at(distance, ahead=ahead, turn=turn):
            if kind == "half-space":
                return HalfSpace(ahead, -distance)
            return Placed(BESIDE_ROUNDED[kind], distance * ahead, turn)

        low, high = 0.0, 5.0
        for _ in range(50):
            middle = (low + high) / 2
            deep = penetration_depth(rounded, at(middle)) > depth
            low, high = (middle, high) if deep else (low, middle)
        found = overlap(rounded, at(low))
        by_vertex, stated = found.vertex_gradients[0], found.errors.vertex_gradients[0]
        off = by_vertex.sum(0) - found.gradient[0, :3]
        turning = np.cross(vertices, by_vertex).sum(0) - found.gradient[0, 3:]
        assert np.isfinite(by_vertex).all() and (stated >= np.linalg.norm(off)).all()
        assert np.linalg.norm(off) <= 1e-6 * found.area and np.linalg.norm(turning) <= 1e-6 * found.area
        assert stated.max() <= 1e-4 * found.area
        if kind == "half-space":
            lengths = (vertices * by_vertex).sum() + rounded.radius * found.shape_gradient[0, 0]
            lengths += -low * found.shape_gradient[1, 0]
            assert lengths == pytest.approx(3 * found.volume, abs=1e-9 * found.area)


def test_two_rounded_hulls_that_are_stretched_together():
    rng = np.random.default_rng(12)
    for names in (("triangles", "cube"), ("cube", "cube"), ("triangles", "triangles")):
        bodies = [RoundedHull(HULLS[name] * 0.6 + rng.uniform(-0.3, 0.3, 3), rng.uniform(0.1, 0.3)) for name in names]
        found = overlap(*bodies)
        lengths = sum(
            (body.core.vertices * found.vertex_gradients[i]).sum() + body.radius * found.shape_gradient[i, 0]
            for i, body in enumerate(bodies)
        )
        assert lengths == pytest.approx(3 * found.volume, rel=1e-11)


def test_a_rounded_hull_around_a_body_or_within_it():
    rounded = RoundedHull(HULLS["triangles"], 0.1)
    for body in BESIDE_ROUNDED.values():
        if not isinstance(body, HalfSpace):
            assert not overlap(RoundedHull(rounded.core.vertices * 20, 0.1), body).vertex_gradients[0].any()
    within = overlap(rounded, Sphere(9.0))
    lengths = (within.vertex_gradients[0] * rounded.core.vertices).sum() + 0.1 * within.shape_gradient[0, 0]
    assert lengths == pytest.approx(3 * rounded.volume, rel=1e-12)
    apart = overlap(rounded, Placed(Sphere(1.0), (9, 0, 0)))
    assert not apart.vertex_gradients[0].any() and not apart.errors.vertex_gradients[0].any()


@pytest.mark.parametrize("kind", ROUND)
def test_hulls_in_groups_with_a_round_body_against_differences_of_volumes(kind):
    hull, step = Hull(HULLS["triangles"]), 1e-3
    rest = Placed(ROUND[kind], (0.2, 0.1, -0.1), (0.3, -0.2, 0.5, 0.7)), Placed(Box((0.5, 0.4, 0.6)), (0, 0.2, 0.1))
    found = overlap(hull, *rest, tolerance=1e-5)
    by_vertex, stated = found.vertex_gradients[0], found.errors.vertex_gradients[0]
    # All vertices at once, since such a group takes seconds.
    by = np.random.default_rng(1).normal(size=hull.vertices.shape)
    volumes = [overlap(Hull(hull.vertices + s * step * by), *rest, tolerance=1e-5).volume for s in (-1, 1)]
    assert (by_vertex * by).sum() == pytest.approx((volumes[1] - volumes[0]) / (2 * step), abs=1e-4)
    assert (stated >= np.linalg.norm(by_vertex.sum(0) - found.gradient[0, :3])).all() and stated.max() <= found.area
    assert found.vertex_gradients[2] is None
