"""Derivatives of the centroid by the vertices of hulls: integers, differences, and what vertices add up to."""

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

FINE = 400  # bits behind the point: lengths are integers times 2^-400
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


def whole(vector):
    return [round(x * 2**FINE) for x in vector]


def by_vertices(case, body):
    """V dC = ∫ x λ n dA for each vertex of a hull of triangles, by its point.

    λ is linear. The integral over a triangle is area / 12 times the sum of x λ at the corners and of their sums.
    """
    found = {p: np.zeros((3, 3)) for p in case.solids[body].vertices}
    centroid = case.truth.centroid
    for ring, part in exact.triangles_of(case.solids[body], case.truth, body):
        places = [whole(exact.subtract(p, centroid)) for p in part]
        for k in range(3):
            share = [round(exact.barycentric(ring, k, p) * 2**FINE) for p in part]
            for i, j in pairwise(range(1, len(part))):
                p, q, r = places[0], places[i], places[j]
                total = exact.add(exact.add(p, q), r)
                shares = share[0], share[i], share[j], share[0] + share[i] + share[j]
                twice = exact.cross(exact.subtract(q, p), exact.subtract(r, p))
                moment = [sum(v[axis] * s for v, s in zip((p, q, r, total), shares)) for axis in range(3)]
                scale = 24 << (4 * FINE)
                found[ring[k]] += [[float(Fraction(m * a, scale) / case.truth.volume) for a in twice] for m in moment]
    return found


def compared(case, most):
    """How many hulls of triangles were compared; asserts that the stated errors hold, and are at most `most`."""
    found, count = overlap(*case.placed), 0
    if case.truth.dimension < 3 or any(len(facet.owners) > 1 for facet in case.truth.facets) or not found:
        return 0
    for body, points in enumerate(case.bodies):
        hull = Hull(points)
        places = [exact.point(p) for p in hull.vertices]
        if not all(len(facet) == 3 for facet in hull.facets) or {*places} != {*case.solids[body].vertices}:
            continue
        truth = by_vertices(case, body)
        expected = np.array([truth[p] for p in places])
        off = np.abs(found.centroid_vertex_gradients[body] - expected).max(axis=(1, 2))
        stated = found.errors.centroid_vertex_gradients[body]
        assert found.centroid_vertex_gradients[body].shape == (len(places), 3, 3) and stated.shape == (len(places),)
        assert (off <= stated).all(), case
        assert stated.max() <= most * max(1.0, np.abs(expected).max()), case
        count += 1
    return count


@pytest.mark.parametrize("seed", range(12))
def test_vertices_of_hulls_of_triangles_against_integers(seed):
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.integers(-3, 3)
    clouds = [size * (rng.normal(size=(n, 3)) + 0.5 * rng.normal(size=3)) for n in (6, 14)]
    compared(type(make("general", 0))("random", 0, tuple(clouds)), 1e-8)


@pytest.mark.parametrize(
    ("family", "most"),
    [
        ("slivers", 1e-2),
        ("tilted_slivers", 1e-1),
        ("needles_and_plates", 1e-1),
        ("tiny_in_huge", 1e-3),
        ("far_away", 1),
    ],
)
def test_stated_errors_of_hard_pairs_hold(family, most):
    assert sum(compared(make(family, seed), most) for seed in range(10)) >= 2


def differences(centroid, vertices, step):
    """Central differences by each coordinate of a vertex: (k, 3, 3), with a row for each coordinate of the centroid."""
    slopes = np.empty((*vertices.shape, 3))
    for at in np.ndindex(vertices.shape):
        by = np.zeros_like(vertices)
        by[at] = step
        slopes[at] = (centroid(vertices + by) - centroid(vertices - by)) / (2 * step)
    return slopes.transpose(0, 2, 1)


@pytest.mark.parametrize("kind", [*ROUND, "box", "half-space", "group"])
def test_vertices_against_differences_of_centroids(kind):
    # Random hulls have triangles: a vertex that moves folds no facet.
    hull, turn = Hull(HULLS["triangles"]), (0.3, -0.2, 0.5, 0.7)
    box = Placed(Box((0.5, 0.4, 0.3)), (0.3, 0.25, -0.2), turn)
    others = {"box": (box,), "half-space": (HalfSpace((0.6, 0, 0.8), 0.1),), "group": (box, HalfSpace((0, 0, 1), -0.1))}
    rest = others.get(kind) or (Placed(ROUND[kind], (0.3, 0.25, -0.2), turn),)
    found = overlap(hull, *rest)
    expected = differences(lambda vertices: overlap(Hull(vertices), *rest).centroid, hull.vertices, 1e-5)
    assert_allclose(found.centroid_vertex_gradients[0], expected, rtol=0, atol=2e-8)
    if kind != "rounded hull":
        assert found.centroid_vertex_gradients[1:] == [None] * len(rest)


@pytest.mark.parametrize("name", HULLS)
@pytest.mark.parametrize("kind", [*ROUND, "box"])
def test_vertices_add_up_to_the_derivatives_by_poses(kind, name):
    rng, position = np.random.default_rng(7), np.array([0.2, -0.1, 0.3])
    other = ROUND.get(kind, Box((0.4, 0.5, 0.3)))
    for depth in (0.2, 1e-2, 1e-4, 1e-6):
        ahead, own, turn = rng.normal(size=3), quaternion(rng), quaternion(rng)
        ahead /= np.linalg.norm(ahead)
        hull = Placed(Hull(HULLS[name]), position, own)
        low, high = 0.0, 5.0
        for _ in range(50):
            middle = (low + high) / 2
            deep = penetration_depth(hull, Placed(other, position + middle * ahead, turn)) > depth
            low, high = (middle, high) if deep else (low, middle)
        found = overlap(hull, Placed(other, position + low * ahead, turn))
        if np.isnan(found.centroid_gradient).any():
            continue
        vertices, stated = found.centroid_vertex_gradients[0], found.errors.centroid_vertex_gradients[0]
        places = Rotation.from_quat(own).apply(hull.shape.vertices)
        turning = np.cross(places[:, None], vertices).sum(0)
        errors = found.errors.centroid_gradient[0]
        assert (np.abs(vertices.sum(0) - found.centroid_gradient[0, :, :3]) <= stated.sum() + errors[:, :3]).all()
        assert (np.abs(turning - found.centroid_gradient[0, :, 3:]) <= stated.sum() + errors[:, 3:]).all()
        assert stated.max() <= max(1e-8, 1e-9 / depth) * np.abs(found.centroid_gradient).max()


def test_a_box_as_a_hull_has_the_derivatives_of_the_box():
    # Facets of four corners: stretching along an axis keeps them flat.
    rng = np.random.default_rng(6)
    for other in (Box((0.6, 0.8, 0.7)), Ellipsoid((0.5, 0.8, 0.6)), Cylinder(0.5, 0.9)):
        half, position, turn = rng.uniform(0.5, 1, 3), rng.uniform(-0.5, 0.5, 3), quaternion(rng)
        corners = half * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        by_size = overlap(Placed(Box(half), position, turn), other).centroid_shape_gradient[0]
        found = overlap(Placed(Hull(corners), position, turn), other).centroid_vertex_gradients[0]
        own = found @ Rotation.from_quat(turn).as_matrix()
        signs = overlap(Placed(Hull(corners), position, turn), other).shapes[0].shape.vertices / half
        assert_allclose((own * signs[:, None]).sum(0), by_size, rtol=0, atol=1e-11)


BESIDE_ROUNDED = {**ROUND, "box": Box((0.5, 0.4, 0.3)), "hull": Hull(HULLS["cube"] * 0.8)}


@pytest.mark.parametrize("kind", [*BESIDE_ROUNDED, "half-space"])
def test_core_of_a_rounded_hull_against_differences_of_centroids(kind):
    # The core has triangles, so that a vertex that moves folds no facet.
    rng = np.random.default_rng(9)
    rounded = RoundedHull(random_polytope(9, rng=7).vertices * 0.4, 0.2)
    vertices = rounded.core.vertices
    for _ in range(2):
        ahead = rng.normal(size=3)
        ahead *= rng.uniform(0.1, 0.6) / np.linalg.norm(ahead)
        body = HalfSpace(ahead, 0.1) if kind == "half-space" else Placed(BESIDE_ROUNDED[kind], ahead, quaternion(rng))
        found = overlap(rounded, body)
        expected = differences(lambda moved, body=body: overlap(RoundedHull(moved, 0.2), body).centroid, vertices, 1e-5)
        assert_allclose(found.centroid_vertex_gradients[0], expected, rtol=0, atol=5e-8)
        assert found.errors.centroid_vertex_gradients[0].max() <= 1e-7


@pytest.mark.parametrize("core", HULLS)
@pytest.mark.parametrize("kind", BESIDE_ROUNDED)
def test_vertices_of_a_core_add_up_to_the_derivatives_by_poses(kind, core):
    # Lengths scale together: the centroid has the degree 1 in the core's vertices, the radius, and the other body.
    rng = np.random.default_rng(10)
    rounded = RoundedHull(HULLS[core] * 0.7, 0.15)
    vertices = rounded.core.vertices
    for depth in (0.2, 1e-2, 1e-4, 1e-6):
        ahead, turn = rng.normal(size=3), quaternion(rng)
        ahead /= np.linalg.norm(ahead)
        low, high = 0.0, 5.0
        for _ in range(50):
            middle = (low + high) / 2
            deep = penetration_depth(rounded, Placed(BESIDE_ROUNDED[kind], middle * ahead, turn)) > depth
            low, high = (middle, high) if deep else (low, middle)
        found = overlap(rounded, Placed(BESIDE_ROUNDED[kind], low * ahead, turn))
        if np.isnan(found.centroid_gradient).any():
            continue
        by_vertex, stated = found.centroid_vertex_gradients[0], found.errors.centroid_vertex_gradients[0]
        errors = found.errors.centroid_gradient[0]
        turning = np.cross(vertices[:, None], by_vertex).sum(0)
        assert (np.abs(by_vertex.sum(0) - found.centroid_gradient[0, :, :3]) <= stated.sum() + errors[:, :3]).all()
        assert (np.abs(turning - found.centroid_gradient[0, :, 3:]) <= stated.sum() + errors[:, 3:]).all()
        if depth > 1e-3:
            assert stated.max() <= 1e-5 * np.abs(found.centroid_gradient).max()


def test_where_there_are_none():
    hull, box = Hull(HULLS["cube"]), Box((0.5, 0.5, 0.5))
    assert overlap(box, Sphere(1)).centroid_vertex_gradients == [None, None]
    assert overlap(box, Sphere(1)).errors.centroid_vertex_gradients == [None, None]
    rounded = RoundedHull(HULLS["cube"], 0.1)
    for bodies in ((rounded, Sphere(0.5), box), (hull, Sphere(0.5), Placed(box, (0.1, 0, 0))), (rounded, rounded)):
        found = overlap(*bodies)
        assert np.isnan(found.centroid_vertex_gradients[0]).all() and found.centroid_vertex_gradients[0].ndim == 3
        assert np.isnan(found.errors.centroid_vertex_gradients[0]).all()
    apart, touching = overlap(hull, Placed(box, (3, 0, 0))), overlap(hull, Placed(box, (1, 0, 0)))
    assert not apart.centroid_vertex_gradients[0].any() and not apart.errors.centroid_vertex_gradients[0].any()
    assert touching.status == "touching" and not touching.centroid_vertex_gradients[0].any()
    assert np.isinf(touching.errors.centroid_vertex_gradients[0]).all()
    within = overlap(Hull(HULLS["cube"] * 20), box)
    assert not within.centroid_vertex_gradients[0].any()
