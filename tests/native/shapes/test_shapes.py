"""Shapes know their measures, refuse bad input in one sentence, and never change."""

import copy
import pickle
import re
from fractions import Fraction

import exact
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from strategies import (
    directions,
    hull_points,
    lattice_points,
    placed,
    placed_points,
    quaternion,
    quaternions,
    reach,
    rotation,
    solids,
)

from overlapper import Box, Capsule, Cylinder, HalfSpace, Hull, Placed, Sphere

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
AXES = np.eye(3)
CUBE = Box([0.5, 0.5, 0.5])
EPS = np.finfo(float).eps


def edge_count(hull):
    return sum(len(facet) for facet in hull.facets) // 2


def assert_is_a_convex_polytope(hull, points):
    """Euler's formula, each edge run once in each direction, all points in all half-spaces, normals out and unit."""
    vertices, planes = hull.vertices, hull.halfspaces
    extent = np.abs(points).max()
    assert len(vertices) - edge_count(hull) + len(hull.facets) == 2
    edges = [(u, v) for ring in hull.facets for u, v in zip(ring, np.roll(ring, -1), strict=True)]
    assert len(set(edges)) == len(edges)
    assert {(v, u) for u, v in edges} == set(edges)
    assert_allclose(np.linalg.norm(planes[:, :3], axis=1), 1, rtol=4 * EPS)
    assert (points @ planes[:, :3].T + planes[:, 3]).max() <= 64 * EPS * extent
    lengths = np.array(list(map(len, hull.facets)))
    for length in set(lengths):  # all facets of as many corners at once
        corners = vertices[np.array([ring for ring in hull.facets if len(ring) == length])]
        normals, offsets = planes[lengths == length, None, :3], planes[lengths == length, None, 3]
        assert_allclose((corners * normals).sum(axis=2) + offsets, 0, atol=64 * EPS * extent)
        sides = np.roll(corners, -1, 1) - corners
        assert (np.cross(sides, np.roll(sides, -1, 1)) * normals).sum(axis=2).min() > 0


# Attributes


def test_box_has_the_measures_of_its_edges():
    box = Box([1, 2, 3])
    assert_array_equal(box.half_extents, [1, 2, 3])
    assert box.volume == 48
    assert_array_equal(box.centroid, [0, 0, 0])
    assert_array_equal(box.bounds, [[-1, -2, -3], [1, 2, 3]])


def test_sphere_has_the_measures_of_its_radius():
    sphere = Sphere(2)
    assert sphere.radius == 2
    assert sphere.volume == pytest.approx(32 * np.pi / 3, rel=4 * EPS)
    assert_array_equal(sphere.centroid, [0, 0, 0])
    assert_array_equal(sphere.bounds, [[-2, -2, -2], [2, 2, 2]])


def test_capsule_length_lies_between_the_cap_centres():
    capsule = Capsule(0.5, 3)
    assert (capsule.radius, capsule.length) == (0.5, 3)
    assert capsule.volume == pytest.approx(np.pi * (3 / 4 + 1 / 6), rel=4 * EPS)
    assert_array_equal(capsule.bounds, [[-0.5, -0.5, -2], [0.5, 0.5, 2]])


def test_capsule_without_length_is_a_ball():
    assert Capsule(0.5, 0).volume == pytest.approx(Sphere(0.5).volume, rel=4 * EPS)
    assert_array_equal(Capsule(0.5, 0).bounds, Sphere(0.5).bounds)


def test_cylinder_stands_along_z():
    cylinder = Cylinder(0.5, 3)
    assert (cylinder.radius, cylinder.length) == (0.5, 3)
    assert cylinder.volume == pytest.approx(np.pi * 3 / 4, rel=4 * EPS)
    assert_array_equal(cylinder.bounds, [[-0.5, -0.5, -1.5], [0.5, 0.5, 1.5]])


def test_halfspace_is_normalised_by_the_length_of_its_normal():
    ground = HalfSpace([0, 3, 4], 10)
    assert_allclose(ground.normal, [0, 0.6, 0.8], rtol=4 * EPS)
    assert ground.offset == pytest.approx(2, rel=4 * EPS)
    assert ground.volume == np.inf
    assert_array_equal(ground.bounds, [[-np.inf] * 3, [np.inf] * 3])


@pytest.mark.parametrize("shape", [Box([1, 2, 3]), Sphere(1), Capsule(1, 1), Cylinder(1, 1), Hull(CORNERS)])
def test_attributes_are_double_arrays_of_the_documented_shape(shape):
    assert shape.centroid.shape == (3,)
    assert shape.bounds.shape == (2, 3)
    assert shape.centroid.dtype == shape.bounds.dtype == np.float64
    assert isinstance(shape.volume, float)


# Hulls of points


def test_cube_of_eight_corners_has_six_facets():
    cube = Hull(CORNERS)
    assert len(cube.facets) == 6
    assert [len(facet) for facet in cube.facets] == [4] * 6
    assert all(facet.dtype == np.int32 for facet in cube.facets)
    assert {tuple(v) for v in cube.vertices} == {tuple(v) for v in CORNERS}
    assert {tuple(row + 0.0) for row in np.round(cube.halfspaces, 15)} == {
        (*(s * e), -1) for e in AXES for s in (1, -1)
    }
    assert cube.volume == pytest.approx(8, rel=4 * EPS)
    assert_allclose(cube.centroid, 0, atol=4 * EPS)


def test_points_on_faces_edges_and_inside_leave_a_cube_a_cube():
    rng = np.random.default_rng(1)
    points = np.vstack([rng.integers(-4, 5, size=(300, 3)) / 4, CORNERS, CORNERS])
    cube = Hull(rng.permutation(points))
    assert (len(cube.vertices), len(cube.facets)) == (8, 6)
    assert {tuple(v) for v in cube.vertices} == {tuple(v) for v in CORNERS}
    assert_is_a_convex_polytope(cube, points)


@pytest.mark.parametrize("seed", range(40))
def test_turned_cubes_still_have_six_facets(seed):
    rng = np.random.default_rng(seed)
    half_extents = rng.uniform(0.01, 1, 3)
    corners = CORNERS * half_extents @ rotation(quaternion(rng)).T + rng.normal(size=3)
    extra = rng.dirichlet(np.ones(8), 10) @ corners
    cube = Hull(np.vstack([extra, corners]))
    assert (len(cube.vertices), len(cube.facets)) == (8, 6)
    assert cube.volume == pytest.approx(8 * half_extents.prod(), rel=1e-13)
    assert_is_a_convex_polytope(cube, corners)


def test_prism_of_a_hundred_sides_has_a_hundred_and_two_facets():
    angle = 2 * np.pi * np.arange(100) / 100
    rim = np.stack([np.cos(angle), np.sin(angle)], 1)
    points = np.vstack([np.column_stack([rim, np.full(100, z)]) for z in (0.0, 0.5)])
    prism = Hull(points)
    assert sorted(len(facet) for facet in prism.facets) == [4] * 100 + [100] * 2
    assert prism.volume == pytest.approx(0.5 * 50 * np.sin(2 * np.pi / 100), rel=1e-13)
    assert_is_a_convex_polytope(prism, points)


@pytest.mark.parametrize("seed", range(3))
def test_hull_of_five_thousand_points_is_right(seed):
    points = np.random.default_rng(seed).normal(size=(5000, 3))
    hull, truth = Hull(points), ConvexHull(points)
    assert {tuple(v) for v in hull.vertices} == {tuple(v) for v in points[truth.vertices]}
    assert hull.volume == pytest.approx(truth.volume, rel=1e-13)
    assert_is_a_convex_polytope(hull, points)


def test_hull_of_five_thousand_points_on_a_sphere_keeps_them_all():
    points = directions(np.random.default_rng(4), 5000)
    hull = Hull(points)
    assert len(hull.vertices) == 5000
    assert hull.volume == pytest.approx(ConvexHull(points).volume, rel=1e-13)
    assert_is_a_convex_polytope(hull, points)


@pytest.mark.parametrize("seed", range(30))
def test_hull_of_random_points_is_the_exact_one(seed):
    points = np.random.default_rng(seed).normal(size=(20, 3))
    hull, truth = Hull(points), exact.hull(points)
    assert {exact.point(v) for v in hull.vertices} == set(truth.vertices)
    assert len(hull.facets) == len(truth.facets)
    assert hull.volume == pytest.approx(float(truth.volume), rel=1e-14)
    assert_allclose(hull.centroid, [float(c) for c in truth.centroid], atol=1e-15)


@given(lattice_points())
def test_hull_of_lattice_points_is_the_exact_one(points):
    hull, truth = Hull(points), exact.hull(points)
    assert {exact.point(v) for v in hull.vertices} == set(truth.vertices)
    assert sorted(map(len, hull.facets)) == sorted(len(f.ring) for f in truth.facets)
    assert hull.volume == pytest.approx(float(truth.volume), rel=1e-14)
    assert_is_a_convex_polytope(hull, points)


@pytest.mark.parametrize("seed", range(12))
def test_hull_of_fans_with_points_in_their_planes_is_the_exact_one(seed):
    rng = np.random.default_rng(seed)
    x = np.arange(-1000, 1001)
    y = np.sqrt(1000**2 - x**2).astype(int)
    disc = np.column_stack([np.r_[x, x], np.r_[y, -y], np.full(2 * len(x), -1)])
    rim = disc[ConvexHull(disc[:, :2]).vertices]
    m = int(rng.integers(1, 4))
    top = np.array(list(np.ndindex(2 * m + 1, 2 * m + 1, 1))) - [m, m, 0]
    along = rng.integers(0, 3, (200, 1)) * rng.choice(rim, 200)  # edges from the top's middle to the rim
    below = rng.choice(top, 100) - [0, 0, 1]
    points = rng.permutation(np.vstack([64 * rim, top, rng.choice(top, 200), along, below]))
    hull = Hull(points)
    corners = hull.corners.astype(np.int64)
    a, b, c = (corners[hull.triangles[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    assert (normal @ points.T <= (normal * a).sum(1)[:, None]).all()


def test_hull_far_from_the_origin_keeps_its_digits():
    points = np.random.default_rng(2).integers(-1000, 1000, size=(30, 3)) / 1024
    far = np.array([2.0**20, -(2.0**21), 2.0**22])
    near, away = Hull(points), Hull(points + far)
    assert away.volume == pytest.approx(near.volume, rel=1e-14)
    assert len(away.facets) == len(near.facets)
    assert_array_equal(away.vertices[np.lexsort(away.vertices.T)] - far, near.vertices[np.lexsort(near.vertices.T)])


@pytest.mark.parametrize("size", [1e-24, 1e-9, 1e-3, 1e3, 1e9, 1e24])
def test_hull_of_any_size_is_the_same_polytope(size):
    points = hull_points(np.random.default_rng(6), 30)
    hull = Hull(points * size)
    assert (len(hull.vertices), len(hull.facets)) == (30, 56)
    assert hull.volume == pytest.approx(Hull(points).volume * size**3, rel=1e-13)


def test_needle_and_plate_are_hulls_like_others():
    for half_extents in ([1e-7, 1e-7, 1], [1, 1, 1e-7]):
        corners = CORNERS * half_extents
        hull = Hull(corners)
        assert len(hull.facets) == 6
        assert hull.volume == pytest.approx(8 * np.prod(half_extents), rel=1e-14)


def test_lists_integers_and_strided_arrays_are_welcome_as_points():
    strided = np.zeros((8, 6))
    strided[:, ::2] = CORNERS
    for points in (CORNERS.tolist(), CORNERS.astype(int), np.asfortranarray(CORNERS), strided[:, ::2]):
        assert Hull(points).volume == pytest.approx(8, rel=4 * EPS)


# Placed


@pytest.mark.parametrize("length", [7, 1e-300, 5e-324, 1e308])
def test_placed_shows_its_quaternion_as_a_unit_one_and_keeps_it_as_given(length):
    body = Placed(Box([1, 2, 3]), (1, 2, 3), (0, 0, length, length))
    assert_array_equal(body.position, [1, 2, 3])
    assert_array_equal(body.given_orientation, [0, 0, length, length])
    assert_allclose(body.orientation, [0, 0, np.sqrt(0.5), np.sqrt(0.5)], rtol=4 * EPS)
    assert_array_equal(body.bounds, [[-1, 1, 0], [3, 3, 6]])  # the quarter turn has no rounding


@given(placed(solids))
def test_the_unit_quaternion_that_is_shown_places_a_body_that_shows_it(body):
    again = Placed(body.shape, body.position, body.orientation)
    assert_array_equal(again.orientation, body.orientation)
    assert_array_equal(again.given_orientation, body.orientation)


@given(quaternions(), st.integers(-900, 900))
def test_a_rotation_is_right_to_half_an_ulp_whatever_the_length_of_its_quaternion(q, exponent):
    as_given = np.ldexp(q, exponent)
    for axis, image in zip(AXES, exact.placed(AXES, (0, 0, 0), as_given.tolist())):
        column = Placed(HalfSpace(axis, 1.0), (0, 0, 0), as_given).centroid  # nearest to the origin: the turned normal
        for entry, truth in zip(column.tolist(), image):
            assert abs(Fraction(entry) - truth) <= Fraction(np.spacing(abs(entry))) / 2 + Fraction(2) ** -98


def test_placed_stands_at_the_origin_by_default():
    body = Placed(Sphere(1))
    assert_array_equal(body.position, [0, 0, 0])
    assert_array_equal(body.orientation, [0, 0, 0, 1])


@given(quaternions())
def test_a_matrix_and_a_rotation_of_scipy_place_as_their_quaternion(q):
    turned = Rotation.from_quat(q)
    assert_array_equal(Placed(CUBE, (1, 2, 3), turned).given_orientation, turned.as_quat())
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turned.as_matrix(), (1, 2, 3)
    unit = turned.as_quat()
    for found in (Placed(CUBE, matrix), Placed(CUBE, matrix.tolist())):
        assert_array_equal(found.position, (1, 2, 3))
        assert_allclose(found.orientation * np.sign(found.orientation @ unit), unit, rtol=0, atol=8 * EPS)


def test_a_matrix_of_quarter_turns_is_an_exact_rotation():
    matrix = [[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]
    assert_array_equal(
        Placed(Hull([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 4]]), matrix).bounds, [[-2, -4, 0], [0, 0, 1]]
    )


SKEWED = np.eye(4)
SKEWED[:2, 1] = 0.6, 0.8


@pytest.mark.parametrize(
    ("matrix", "reason"),
    [
        (np.diag([1, 1, 1 + 2**-10, 1]), "must not scale: the length of an axis differs from 1 by 0.000976562"),
        (np.diag([2, 2, 2, 1]), "must not scale: the length of an axis differs from 1 by 1"),
        (np.diag([1, 1, 0, 1]), "must not scale: the length of an axis differs from 1 by 1"),
        (np.diag([1, 1, -1, 1]), "must not reflect: the determinant of its rotation is -1"),
        (SKEWED, "must have right angles between its axes: the cosine of an angle is 0.6"),
        (np.full((4, 4), np.nan), "must be finite"),
        (np.diag([1, 1, 1, 2]), "must have the last row (0, 0, 0, 1)"),
        (np.eye(4) + np.eye(4, k=-3), "must have the last row (0, 0, 0, 1)"),
    ],
)
def test_a_matrix_that_is_not_a_pose_is_refused(matrix, reason):
    with pytest.raises(ValueError, match=f"^{re.escape(f'position {reason}')}$"):
        Placed(CUBE, matrix)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["turn"], "position must be three numbers or a matrix of shape (4, 4)"),
        ([np.eye(3)], "position must be three numbers or a matrix of shape (4, 4), not an array of shape (3, 3)"),
        ([np.eye(4), (0, 0, 1, 1)], "orientation must be left out if the position is a matrix"),
    ],
)
def test_a_pose_of_another_shape_is_refused(arguments, sentence):
    with pytest.raises(ValueError, match=f"^{re.escape(sentence)}$"):
        Placed(CUBE, *arguments)


def test_a_matrix_in_single_precision_is_a_pose():
    turned = Rotation.from_rotvec([1, 2, 3])
    matrix = np.eye(4, dtype=np.float32)
    matrix[:3, :3] = turned.as_matrix()
    assert_allclose(rotation(Placed(CUBE, matrix).orientation), turned.as_matrix(), atol=1e-7)


@given(placed(solids))
def test_bounds_of_a_placed_shape_are_its_reach_along_the_axes(body):
    expected = [[-reach(body, -axis) for axis in AXES], [reach(body, axis) for axis in AXES]]
    assert_allclose(body.bounds, expected, atol=1e-14)


@given(placed(solids))
def test_placing_keeps_the_volume_and_moves_the_centroid(body):
    assert body.volume == pytest.approx(body.shape.volume, rel=4 * EPS)
    assert_allclose(body.centroid, rotation(body.orientation) @ body.shape.centroid + body.position, atol=1e-14)


@given(st.tuples(*[st.floats(0.2, 1.5)] * 3), quaternions())
def test_box_and_the_hull_of_its_corners_are_the_same_solid(half_extents, q):
    box = Placed(Box(half_extents), (1, 2, 3), q)
    hull = Hull(placed_points(box))
    assert hull.volume == pytest.approx(box.volume, rel=1e-13)
    assert_allclose(hull.centroid, box.centroid, atol=1e-13)
    assert_allclose(hull.bounds, box.bounds, atol=1e-13)


# Bad input

FLAT = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0.3, 0.2, 0]]
TILTED_FLAT = (np.array(FLAT) @ rotation([1, 2, 3, 4]).T).tolist()
NAN, INF = float("nan"), float("inf")
BAD = [
    (Box, ([1, 1, NAN],), "half_extents"),
    (Box, ([1, INF, 1],), "half_extents"),
    (Box, ([1, 1, 0],), "half_extents"),
    (Box, ([1, -1, 1],), "half_extents"),
    (Box, ([1, 1],), "half_extents"),
    (Box, ([[1, 1, 1]],), "half_extents"),
    (Box, ([],), "half_extents"),
    (Box, (1.0,), "half_extents"),
    (Box, ("box",), "half_extents"),
    (Box, (None,), "half_extents"),
    (Sphere, ("one",), "radius"),
    (Sphere, (None,), "radius"),
    (Sphere, ([1, 2],), "radius"),
    (Sphere, (0,), "radius"),
    (Sphere, (-1,), "radius"),
    (Sphere, (NAN,), "radius"),
    (Sphere, (INF,), "radius"),
    (Capsule, ("one", 1), "radius"),
    (Capsule, (0, 1), "radius"),
    (Capsule, (NAN, 1), "radius"),
    (Capsule, (1, -1), "length"),
    (Capsule, (1, NAN), "length"),
    (Capsule, (1, INF), "length"),
    (Capsule, (1, 1e25), "length"),
    (Cylinder, (-1, 1), "radius"),
    (Cylinder, (1, None), "length"),
    (Cylinder, (1, 0), "length"),
    (Cylinder, (1, -1), "length"),
    (Cylinder, (1, NAN), "length"),
    (Hull, ([],), "vertices"),
    (Hull, (CORNERS[:3],), "vertices"),
    (Hull, (CORNERS[:, :2],), "vertices"),
    (Hull, (CORNERS.ravel(),), "vertices"),
    (Hull, (CORNERS[None],), "vertices"),
    (Hull, (FLAT,), "vertices"),
    (Hull, (TILTED_FLAT,), "vertices"),
    (Hull, ([[i, 2 * i, 3 * i] for i in range(6)],), "vertices"),
    (Hull, ([[1, 1, 1]] * 6,), "vertices"),
    (Hull, ([*CORNERS.tolist(), [0, NAN, 0]],), "vertices"),
    (Hull, ([*CORNERS.tolist(), [0, 0, -INF]],), "vertices"),
    (Hull, ("cube.obj",), "vertices"),
    (Hull, ([["a", "b", "c"]] * 4,), "vertices"),
    (Hull, (None,), "vertices"),
    (Sphere, ("1",), "radius"),
    (Sphere, (b"1",), "radius"),
    (Box, ([1, 2, "3"],), "half_extents"),
    (Box, (np.array(["1", "2", "3"]),), "half_extents"),
    (HalfSpace, ([0, 0, 0], 1), "normal"),
    (HalfSpace, ([0, NAN, 1], 1), "normal"),
    (HalfSpace, ([0, 1], 1), "normal"),
    (HalfSpace, (None, 1), "normal"),
    (HalfSpace, ([0, 0, 1], "ground"), "offset"),
    (HalfSpace, ([0, 0, 1], NAN), "offset"),
    (HalfSpace, ([0, 0, 1], INF), "offset"),
    (Placed, (Sphere(1), [0, 0]), "position"),
    (Placed, (Sphere(1), [0, 0, NAN]), "position"),
    (Placed, (Sphere(1), "here"), "position"),
    (Placed, (Sphere(1), [0, 0, 0], [0, 0, 0, 0]), "orientation"),
    (Placed, (Sphere(1), [0, 0, 0], [0, 0, 1]), "orientation"),
    (Placed, (Sphere(1), [0, 0, 0], [0, 0, NAN, 1]), "orientation"),
    (Placed, (Sphere(1), [0, 0, 0], [0, INF, 0, 1]), "orientation"),
]


@pytest.mark.parametrize(("make", "arguments", "name"), BAD)
def test_bad_input_is_one_sentence_that_names_the_argument(make, arguments, name):
    numbers = not any(each is None or isinstance(each, str) for each in arguments)
    with pytest.raises(ValueError if numbers else (ValueError, TypeError), match=name) as caught:
        make(*arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("other", ["sphere", None, 3.0, object()])
def test_only_shapes_can_be_placed(other):
    with pytest.raises(TypeError, match="shape"):
        Placed(other)


@pytest.mark.parametrize("call", [Sphere, lambda: Capsule(1), lambda: Box([1, 1, 1], 2), lambda: Sphere(1, size=2)])
def test_missing_and_surplus_arguments_are_a_type_error(call):
    with pytest.raises(TypeError):
        call()


# Values


SHAPES = [Box([0.25, 0.5, 0.75]), Sphere(0.25), Capsule(0.25, 0.5), Cylinder(0.25, 0.5), Hull(CORNERS)]
SHAPES += [HalfSpace([0, 0, 1], 0.25), Placed(Sphere(0.25), (1, 2, 3), (0, 1, 0, 1))]


def names(value):
    return [name for name in dir(value) if not name.startswith("_")]


def assert_same(a, b):
    assert type(a) is type(b)
    if isinstance(a, (list, tuple)):
        assert len(a) == len(b)
        for x, y in zip(a, b, strict=True):
            assert_same(x, y)
    elif isinstance(a, (float, int, np.ndarray)):
        assert_array_equal(a, b)
    else:
        assert names(a) == names(b)
        for name in names(a):
            assert_same(getattr(a, name), getattr(b, name))


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_copies_and_pickles_are_the_same_shape(shape):
    for again in (copy.copy(shape), copy.deepcopy(shape), pickle.loads(pickle.dumps(shape))):
        assert_same(again, shape)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_shapes_cannot_be_assigned_to(shape):
    for name in names(shape):
        with pytest.raises(AttributeError):
            setattr(shape, name, getattr(shape, name))
    with pytest.raises(AttributeError):
        shape.colour = "red"


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_writing_to_a_returned_array_does_not_change_the_shape(shape):
    before = pickle.loads(pickle.dumps(shape))
    for name in names(shape):
        value = getattr(shape, name)
        for array in value if isinstance(value, list) else [value]:
            if isinstance(array, np.ndarray) and array.flags.writeable:
                array += 1
    assert_same(shape, before)


def test_changing_the_points_afterwards_does_not_change_the_hull():
    points = CORNERS.copy()
    hull = Hull(points)
    points *= 2
    assert hull.volume == pytest.approx(8, rel=4 * EPS)


def test_returned_arrays_outlive_their_shape():
    vertices, facets = Hull(CORNERS).vertices, Hull(CORNERS).facets
    Hull(3 * CORNERS)
    assert {tuple(v) for v in vertices} == {tuple(v) for v in CORNERS}
    assert sorted(np.concatenate(facets)) == sorted(list(range(8)) * 3)


@pytest.mark.parametrize(
    ("shape", "parts"),
    [
        (Box([0.25, 0.5, 0.75]), ["Box", "0.25", "0.5", "0.75"]),
        (Sphere(0.25), ["Sphere", "0.25"]),
        (Capsule(0.25, 0.5), ["Capsule", "radius", "0.25", "length", "0.5"]),
        (Cylinder(0.25, 0.5), ["Cylinder", "radius", "0.25", "length", "0.5"]),
        (Hull(CORNERS), ["Hull", "8 vertices", "6 facets"]),
        (HalfSpace([0, 0, 1], 0.25), ["HalfSpace", "1", "0.25"]),
        (Placed(Sphere(0.25), (1, 2, 3)), ["Placed", "Sphere", "0.25", "1", "2", "3"]),
    ],
)
def test_repr_says_what_the_shape_is(shape, parts):
    text = repr(shape)
    assert all(part in text for part in parts), text
    assert "\n" not in text


@pytest.mark.parametrize("tiny", [0.0, 1e-20, 1e-45, 3.9066743815899546e-97, 1e-150, 1e-244, 1e-300])
def test_hull_of_a_cube_with_noise_is_a_cube(tiny):
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    rng = np.random.default_rng(0)
    for _ in range(60):
        cube = Hull(corners + rng.normal(size=(8, 3)) * tiny)
        assert cube.volume == pytest.approx(1, rel=1e-14)
        assert np.isfinite(cube.halfspaces).all()
