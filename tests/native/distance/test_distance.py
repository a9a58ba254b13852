"""Distance, depth, witness points and separating planes: closed forms, exact arithmetic, their own definition."""

import exact
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from plain_cases import NEEDLES
from strategies import (
    capsules,
    directions,
    hull_points,
    moved,
    overlapping_points,
    placed,
    placed_points,
    polyhedra,
    quaternion,
    reach,
    rotation,
    solids,
    spheres,
    turn,
)

from overlapper import (
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    Hull,
    Placed,
    RoundedHull,
    Sphere,
    distance,
    iou,
    overlap,
    penetration_depth,
)

CUBE = Box([0.5, 0.5, 0.5])
CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
OCTAHEDRON = Hull([(s * e).tolist() for e in np.eye(3) for s in (1, -1)])
QUARTER_X = (np.sqrt(0.5), 0, 0, np.sqrt(0.5))
QUARTER_Y = (0, np.sqrt(0.5), 0, np.sqrt(0.5))
EPS = np.finfo(float).eps


def gap(a, b, direction):
    """How far apart two shapes lie along a unit direction from b to a; negative if their shadows overlap."""
    return -reach(a, -direction) - reach(b, direction)


def assert_separation_proves_itself(a, b, answer, slack):
    """The witness points are d n apart, one on each body, and the plane between has the bodies on its two sides."""
    n, d = answer.normal, answer.distance
    assert answer.status == "separated"
    assert not answer
    assert np.linalg.norm(n) == pytest.approx(1, rel=8 * EPS)
    assert_allclose(answer.witness_a - answer.witness_b, d * n, atol=slack)
    assert gap(a, b, n) == pytest.approx(d, abs=slack)
    assert np.dot(answer.witness_a, n) == pytest.approx(-reach(a, -n), abs=slack)
    assert np.dot(answer.witness_b, n) == pytest.approx(reach(b, n), abs=slack)
    *m, offset = answer.separating_plane
    assert np.linalg.norm(m) == pytest.approx(1, rel=8 * EPS)
    assert -reach(a, -np.array(m)) + offset >= 0
    assert reach(b, np.array(m)) + offset <= 0
    assert (answer.volume, answer.volume_error, answer.depth) == (0, 0, 0)


# Distance


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        (Sphere(0.5), Placed(Sphere(0.25), (3, 4, 0)), 4.25),
        (CUBE, Placed(CUBE, (3, 0.25, 0)), 2),
        (CUBE, Placed(CUBE, (4, 5, 0.25)), 5),
        (CUBE, Placed(CUBE, (2, 3, 3)), 3),
        (CUBE, Placed(Sphere(0.5), (2, 3.5, 0.25)), np.hypot(1.5, 3) - 0.5),
        (CUBE, Placed(Capsule(0.25, 2), (3, 0, 0)), 2.25),
        (Capsule(0.5, 2), Placed(Capsule(0.25, 2), (0, 0, 3.5)), 0.75),
        (Capsule(0.5, 2), Placed(Capsule(0.25, 2), (3, 0, 0), QUARTER_X), 2.25),
        (Capsule(0.25, 0), Placed(Capsule(0.25, 0), (3, 4, 0)), 4.5),
        (Cylinder(0.5, 2), Placed(Cylinder(0.25, 2), (3, 4, 1)), 4.25),
        (Cylinder(0.5, 2), Placed(Cylinder(0.25, 2), (0.25, 0, 4)), 2),
        (Cylinder(0.5, 2), Placed(Sphere(0.25), (0, 3.5, 5)), 4.75),
        (Sphere(0.5), HalfSpace([0, 0, 2], -4), 1.5),
        (Placed(CUBE, (0, 0, 3), QUARTER_Y), HalfSpace([0, 0, 1], 0), 2.5),
        (Placed(OCTAHEDRON, (0, 0, 3)), HalfSpace([0, 0, 1], 0), 2),
        (Placed(Capsule(0.5, 2), (0, 0, 3)), HalfSpace([0, 0, 1], 0), 1.5),
        (Placed(Cylinder(0.5, 2), (0, 0, 3), QUARTER_X), HalfSpace([0, 0, 1], 0), 2.5),
        (HalfSpace([0, 0, 1], 0), HalfSpace([0, 0, -1], -2), 2),
    ],
)
def test_distance_has_its_closed_form(a, b, expected):
    slack = 64 * EPS * 5
    assert distance(a, b) == pytest.approx(expected, abs=slack)
    assert distance(b, a) == pytest.approx(expected, abs=slack)
    answer = overlap(a, b)
    assert answer.distance == pytest.approx(expected, abs=slack)
    assert_separation_proves_itself(*answer.shapes, answer, slack)


@pytest.mark.parametrize("seed", range(60))
def test_distance_of_hulls_is_the_exact_one(seed):
    rng = np.random.default_rng(seed)
    p = hull_points(rng, int(rng.integers(4, 15)))
    q = hull_points(rng, int(rng.integers(4, 15)))
    q += directions(rng, 1)[0] * rng.uniform(2.1, 4)
    truth = float(exact.distance_squared(exact.hull(p), exact.hull(q))) ** 0.5
    assert truth > 0
    assert distance(p, q) == pytest.approx(truth, rel=1e-14)
    answer = overlap(p, q)
    assert_separation_proves_itself(*answer.shapes, answer, slack=64 * EPS * 5)


@pytest.mark.parametrize("power", range(1, 14))
def test_nearly_touching_hulls_keep_their_small_distance(power):
    rng = np.random.default_rng(power)
    p, q = (hull_points(rng, 12) for _ in range(2))
    u = directions(rng, 1)[0]
    q += u * ((p @ u).max() - (q @ u).min() + 10.0**-power)
    truth = float(exact.distance_squared(exact.hull(p), exact.hull(q))) ** 0.5
    assert truth > 0
    assert distance(p, q) == pytest.approx(truth, abs=16 * EPS * 3)


@given(placed(solids, spread=4), placed(solids, spread=4))
def test_a_separated_pair_proves_its_distance(a, b):
    answer = overlap(a, b)
    assume(answer.status == "separated")
    assert answer.distance == pytest.approx(distance(a, b), rel=1e-12)
    assert_separation_proves_itself(a, b, answer, slack=1e-9 * 8)


@given(placed(solids, spread=2), placed(solids, spread=2))
def test_distance_and_depth_do_not_depend_on_the_order(a, b):
    assert distance(a, b) == pytest.approx(distance(b, a), rel=1e-9, abs=64 * EPS * 4)
    assert penetration_depth(a, b) == pytest.approx(penetration_depth(b, a), rel=1e-9, abs=64 * EPS * 4)
    assert distance(a, b) == 0 or penetration_depth(a, b) == 0


# The nearest point of a rim is approached, not reached: to 1e-9 in the distance, hence to its root in the direction.
WITHOUT_RIMS = st.one_of(polyhedra, spheres, capsules)
ROUND_OR_FLAT = [pytest.param(WITHOUT_RIMS, 1e-13, 1e-10, id="finite"), pytest.param(solids, 1e-9, 3e-5, id="rims")]


@pytest.mark.parametrize(("shapes", "slack", "angle"), ROUND_OR_FLAT)
@given(data=st.data())
def test_swapping_a_pair_turns_its_normal_round(shapes, slack, angle, data):
    a, b = data.draw(placed(shapes, spread=3)), data.draw(placed(shapes, spread=3))
    ab, ba = overlap(a, b), overlap(b, a)
    assert ab.status == ba.status
    assert ab.distance == pytest.approx(ba.distance, abs=slack)
    assume(ab.distance > 1e-2)
    assert_allclose(ab.normal, -ba.normal, atol=angle)


@pytest.mark.parametrize(("shapes", "slack", "angle"), ROUND_OR_FLAT)
@given(data=st.data())
def test_distance_of_a_pair_is_that_of_the_moved_pair(shapes, slack, angle, data):
    a, b = data.draw(placed(shapes, spread=3)), data.draw(placed(shapes, spread=3))
    pose = {"translation": (0.3, -0.7, 1.1), "orientation": turn([0.3, 2.0, -1.0])}
    here, there = overlap(a, b), overlap(moved(a, **pose), moved(b, **pose))
    assert there.distance == pytest.approx(here.distance, abs=slack)
    assume(here.distance > 1e-2)
    assert_allclose(there.normal, rotation(pose["orientation"]) @ here.normal, atol=angle)


# Depth


@pytest.mark.parametrize(
    ("a", "b", "expected", "normal"),
    [
        (Sphere(1), Placed(Sphere(0.5), (1, 0, 0)), 0.5, (-1, 0, 0)),
        (Sphere(1), Placed(Sphere(0.5), (0, 0.25, 0)), 1.25, (0, -1, 0)),
        (CUBE, Placed(CUBE, (0.25, 0.125, 0.75)), 0.25, (0, 0, -1)),
        (CUBE, Placed(Box([2, 2, 2]), (0, 1.75, 0)), 0.75, (0, -1, 0)),
        (Placed(Sphere(0.5), (0, 0, 0.25)), HalfSpace([0, 0, 1], 0), 0.25, (0, 0, 1)),
        (Placed(Sphere(0.5), (0, 0, -3)), HalfSpace([0, 0, 1], 0), 3.5, (0, 0, 1)),
        (Placed(CUBE, (0, 0, 0.25)), HalfSpace([0, 0, 1], 0), 0.25, (0, 0, 1)),
        (HalfSpace([0, 0, 1], 0), Placed(CUBE, (0, 0, 0.25)), 0.25, (0, 0, -1)),
        (Placed(OCTAHEDRON, (0, 0, 0.5)), HalfSpace([0, 0, 1], 0), 0.5, (0, 0, 1)),
        (Placed(Capsule(0.5, 2), (0, 0, 1)), HalfSpace([0, 0, 1], 0), 0.5, (0, 0, 1)),
        (Placed(Cylinder(0.5, 2), (0, 0, 0.25)), HalfSpace([0, 0, 1], 0), 0.75, (0, 0, 1)),
        (Capsule(0.5, 4), Placed(Capsule(0.25, 4), (0.5, 0, 0), QUARTER_X), 0.25, (-1, 0, 0)),
        (Cylinder(0.5, 4), Placed(Cylinder(0.25, 4), (0.5, 0, 0)), 0.25, (-1, 0, 0)),
        (Placed(Sphere(0.5), (0, 0, 0.75)), CUBE, 0.25, (0, 0, 1)),
    ],
)
def test_depth_has_its_closed_form(a, b, expected, normal):
    assert penetration_depth(a, b) == pytest.approx(expected, rel=1e-9)
    answer = overlap(a, b)
    assert answer.depth == pytest.approx(expected, rel=1e-9)
    # The depth is quadratic in a tilt of the normal, so the normal has half of the digits.
    assert_allclose(answer.normal, normal, atol=1e-4)


def test_depth_of_one_ball_about_the_centre_of_another_is_both_radii():
    assert penetration_depth(Sphere(1), Sphere(0.5)) == pytest.approx(1.5, rel=1e-9)


@pytest.mark.parametrize("seed", range(60))
def test_depth_of_hulls_is_the_exact_one(seed):
    rng = np.random.default_rng(seed)
    p, q = overlapping_points(rng, low=4, high=12)
    q += directions(rng, 1)[0] * rng.uniform(0, 0.3)
    truth = float(exact.depth_squared(exact.hull(p), exact.hull(q))) ** 0.5
    assert penetration_depth(p, q) == pytest.approx(truth, rel=1e-12)
    answer = overlap(p, q)
    assert answer.depth == pytest.approx(truth, rel=1e-12)
    assert gap(*answer.shapes, answer.normal) == pytest.approx(-truth, rel=1e-12)


@pytest.mark.parametrize("slenderness", [1e-1, 1e-2, 1e-3, 1e-6])
def test_depth_of_slender_hulls_is_the_exact_one(slenderness):
    rng = np.random.default_rng(0)
    for _ in range(60):
        p, q = (hull_points(rng, 10) * [1, *slenderness ** rng.random(2)] @ rotation(quaternion(rng)).T for _ in "pq")
        truth = float(exact.depth_squared(exact.hull(p), exact.hull(q))) ** 0.5
        assert penetration_depth(p, q) == pytest.approx(truth, rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("seed", range(30))
def test_depth_of_hulls_of_grid_points_is_the_exact_one(seed):
    """Edges of the two are parallel, facets coplanar, and many ways out equally long."""
    rng = np.random.default_rng(seed)
    p, q = (np.vstack([CORNERS[[0, 1, 2, 4]], rng.integers(-2, 3, (int(rng.integers(1, 12)), 3)) / 2]) for _ in "pq")
    q += rng.integers(-1, 2, 3) / 4
    truth = float(exact.depth_squared(exact.hull(p), exact.hull(q))) ** 0.5
    assert penetration_depth(p, q) == pytest.approx(truth, rel=1e-14)
    assert penetration_depth(q, p) == pytest.approx(truth, rel=1e-14)


@pytest.mark.parametrize("power", [0, 10, 20, 30])
def test_depth_of_hulls_far_from_their_own_origin_is_right_to_the_rounding_of_that_distance(power):
    rng = np.random.default_rng(power)
    for _ in range(20):
        p, q = overlapping_points(rng, low=4, high=10)
        lever, orientation = 2.0**power * directions(rng, 1)[0], quaternion(rng)
        far, position = p + lever, -rotation(orientation) @ lever
        placed_far = exact.hull(exact.placed(far, position, orientation))
        truth = float(exact.depth_squared(placed_far, exact.hull(q))) ** 0.5
        assert penetration_depth(Placed(Hull(far), position, orientation), q) == pytest.approx(
            truth, abs=16 * EPS * 2.0**power
        )


@pytest.mark.parametrize("seed", range(40))
def test_depth_of_a_tiny_body_in_a_huge_one_is_as_right_as_the_tiny_one(seed):
    """At a corner, an edge or a face of a box up to 1e17 times as large, turned, so that its planes hold no doubles."""
    rng = np.random.default_rng(seed)
    half, orientation, tilt = 10 ** rng.uniform(2, 8) * rng.uniform(0.3, 1, 3), quaternion(rng), quaternion(rng)
    side = rng.choice([-1.0, 1.0, rng.uniform(-1, 1)], 3)
    side[int(rng.integers(3))] = rng.choice([-1.0, 1.0])
    size = 10 ** rng.uniform(-8, -3)
    points = hull_points(rng, 8, size)
    at = np.array(exact.placed([side * half], (0, 0, 0), orientation)[0], float) + size * directions(rng, 1)[0] / 4
    huge = exact.hull(exact.placed(CORNERS * 2 * half, (0, 0, 0), orientation))
    tiny = exact.hull(exact.placed(points, at, tilt))
    answer = overlap(Placed(Box(half), (0, 0, 0), orientation), Placed(Hull(points), at, tilt))
    truth = float(exact.depth_squared(huge, tiny)) ** 0.5
    assert answer.depth == pytest.approx(truth, rel=1e-11)
    assert answer.distance == pytest.approx(float(exact.distance_squared(huge, tiny)) ** 0.5, rel=1e-11)


@pytest.mark.parametrize(("a", "b", "moved_by"), NEEDLES.values(), ids=NEEDLES)
def test_depth_of_needles_is_the_exact_one_where_their_difference_looks_flat_at_first(a, b, moved_by):
    """Whichever way EPA looks first, it sees their ends alone, which are in one plane, and no other corner."""
    radius = 2.0**-10
    truth = float(exact.depth_squared(exact.hull(a), exact.hull(b + moved_by))) ** 0.5 + 2 * radius
    needles = Placed(RoundedHull(a, radius)), Placed(RoundedHull(b, radius), moved_by)
    assert penetration_depth(*needles) == pytest.approx(truth, rel=1e-12)


def points_of_small_polytopes(rng):
    """Tetrahedra, hulls of 20 and 80 points, boxes, prisms, needles and plates, each with its own corners."""
    kind = rng.integers(6)
    if kind < 3:
        return hull_points(rng, (4, 20, 80)[kind])
    if kind == 3:
        return CORNERS * 10 ** rng.uniform(-2, 0.3, 3)
    if kind == 4:
        angle = np.linspace(0, 2 * np.pi, int(rng.integers(3, 20)), endpoint=False)
        rim = np.transpose([np.cos(angle), np.sin(angle), np.full_like(angle, rng.uniform(0.05, 1))])
        return np.vstack([rim, rim * [1, 1, -1]])
    return hull_points(rng, 10) * [1, *10 ** rng.uniform(-6, 0, 2)]


@pytest.mark.parametrize("tilt", [0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3, 1])
def test_facets_and_arcs_contain_the_direction_that_epa_finds(tilt):
    """Small polytopes part along a facet's normal or an arc between two; grown by next to nothing, they go to EPA."""
    rng = np.random.default_rng(0)
    deepest = 0
    for _ in range(300):
        p, q = points_of_small_polytopes(rng), points_of_small_polytopes(rng)
        if rng.random() < 0.2:
            q = p
        orientation = quaternion(rng)
        a = Placed(Hull(p), (0, 0, 0), orientation)
        b = Placed(Hull(q), rng.normal(size=3) * rng.choice([1e-3, 0.1, 0.4]), orientation + tilt * rng.normal(size=4))
        depth = penetration_depth(a, b)
        grown = Placed(RoundedHull(p, 1e-24), a.position, a.orientation)
        assert depth == pytest.approx(penetration_depth(grown, b), rel=1e-12, abs=64 * EPS)
        assert penetration_depth(b, a) == depth
        deepest = max(deepest, depth)
    assert deepest > 0.5


@pytest.mark.parametrize("angle", [1e-2, 1e-4, 1e-6, 1e-8])
def test_ridges_that_cross_at_a_small_angle_part_upright(angle):
    """The product of two nearly parallel edges is known across both, and must not tilt along them."""
    rng = np.random.default_rng(0)
    roof = np.array([(x, y, -abs(y)) for x in (-1, 1) for y in (-1, 0, 1)], dtype=float)
    upside_down = roof * [1, 1, -1] @ rotation((0, 0, np.sin(angle / 2), np.cos(angle / 2))).T
    for _ in range(20):
        depth = angle * rng.uniform(0.01, 0.3)
        turned = rotation(quaternion(rng)).T
        found = penetration_depth(roof @ turned, (upside_down - [0, 0, depth]) @ turned)
        assert found == pytest.approx(depth, abs=16 * EPS)


@given(placed(solids), placed(solids))
def test_no_direction_separates_sooner_than_the_depth(a, b):
    answer = overlap(a, b)
    assume(answer.status == "overlapping")
    depth = answer.depth
    assert depth > 0
    assert np.linalg.norm(answer.normal) == pytest.approx(1, rel=8 * EPS)
    assert gap(a, b, answer.normal) == pytest.approx(-depth, rel=1e-9, abs=64 * EPS * 4)
    for u in directions(np.random.default_rng(0), 200):
        assert depth <= -gap(a, b, u) * (1 + 1e-9)


@given(placed(polyhedra), placed(polyhedra))
def test_moving_a_by_depth_along_the_normal_separates_the_pair(a, b):
    answer = overlap(a, b)
    assume(answer.status == "overlapping")
    short = overlap(moved(a, answer.depth * (1 - 1e-6) * answer.normal), b)
    assert short.status == "overlapping"
    far = overlap(moved(a, answer.depth * (1 + 1e-9) * answer.normal), b)
    assert far.volume <= 1e-12
    further = overlap(moved(a, answer.depth * (1 + 1e-6) * answer.normal), b)
    assert further.status == "separated"
    assert further.distance == pytest.approx(answer.depth * 1e-6, rel=1e-3, abs=1e-13)


@given(placed(polyhedra), placed(polyhedra))
def test_depth_has_the_scale_of_the_pair(a, b):
    def scaled(body, size):
        shape = body.shape
        small = Box(shape.half_extents * size) if isinstance(shape, Box) else Hull(shape.vertices * size)
        return Placed(small, body.position * size, body.orientation)

    depth = penetration_depth(a, b)
    for size in (2.0**-10, 2.0**10):
        assert penetration_depth(scaled(a, size), scaled(b, size)) == pytest.approx(depth * size, rel=1e-9)


@pytest.mark.parametrize("tilt", [0, 1e-16, 1e-12, 1e-8, 1e-3, 1])
def test_boxes_have_the_depth_and_normal_of_the_hulls_of_their_corners(tilt):
    """Fifteen axes hold the way out of a box; the hulls are searched facet by facet."""
    rng = np.random.default_rng(0)
    for _ in range(60):
        a, b = Box(10 ** rng.uniform(-3, 0, 3)), Box(10 ** rng.uniform(-3, 0, 3))
        position = rng.uniform(-0.9, 0.9, 3) * (a.half_extents + b.half_extents)
        orientation = (*(tilt * rng.normal(size=3)), 1.0)
        boxes = overlap(a, Placed(b, position, orientation))
        hulls = overlap(placed_points(Placed(a)), Placed(Hull(placed_points(Placed(b))), position, orientation))
        assert boxes.status == hulls.status
        if not boxes:
            continue
        assert boxes.depth == pytest.approx(hulls.depth, rel=1e-12, abs=32 * EPS)
        # Either normal is right where two ways out are equally long to rounding.
        for body, other in ((boxes, hulls), (hulls, boxes)):
            assert -gap(*body.shapes, other.normal) == pytest.approx(body.depth, rel=1e-12, abs=64 * EPS)


@pytest.mark.parametrize("seed", range(40))
def test_depth_of_equally_turned_boxes_is_the_exact_one(seed):
    rng = np.random.default_rng(seed)
    q, shape = (
        rng.integers(1, 3, 4) * rng.choice([-1.0, 1.0], 4),
        Box(rng.choice([0.2, 0.5, 1, 1.5, 1.4746420954724861], 3)),
    )
    for _ in range(20):
        a, b = (Placed(shape, rng.integers(-1, 2, 3) * shape.half_extents, q) for _ in range(2))
        truth = float(exact.depth_squared(*(exact.hull(placed_points(body)) for body in (a, b)))) ** 0.5
        assert penetration_depth(a, b) == pytest.approx(truth, abs=1e-14)
        assert penetration_depth(b, a) == pytest.approx(truth, abs=1e-14)


# Touching


@pytest.mark.parametrize(
    ("a", "b", "normal"),
    [
        (CUBE, Placed(CUBE, (1, 0, 0)), (-1, 0, 0)),
        (CUBE, Placed(CUBE, (0, 1, 0.25)), (0, -1, 0)),
        (CUBE, Placed(Box([2, 2, 0.25]), (0.5, 0.25, -0.75)), (0, 0, 1)),
        (CUBE, Placed(CUBE, (1, 1, 0)), None),
        (CUBE, Placed(CUBE, (1, -1, 0.5)), None),
        (CUBE, Placed(CUBE, (1, 1, 1)), None),
        (CUBE, Placed(OCTAHEDRON, (0, 0, 1.5)), (0, 0, -1)),
        (CUBE, Placed(OCTAHEDRON, (0.25, 0.125, 1.5)), (0, 0, -1)),
        (CUBE, Placed(OCTAHEDRON, (0.5, 0.125, 1.5)), None),
        (OCTAHEDRON, Placed(OCTAHEDRON, (2, 0, 0)), None),
        (OCTAHEDRON, Placed(OCTAHEDRON, (1, 1, 0)), None),
        (Sphere(0.5), Placed(Sphere(0.25), (0.75, 0, 0)), (-1, 0, 0)),
        (Sphere(0.5), Placed(CUBE, (0, 1, 0.25)), (0, -1, 0)),
        (Capsule(0.5, 2), Placed(Sphere(0.5), (0, 0, 2)), (0, 0, -1)),
        (Cylinder(0.5, 2), Placed(Cylinder(0.25, 2), (0, 0.25, 2)), (0, 0, -1)),
        (Placed(Sphere(0.5), (0, 0, 0.5)), HalfSpace([0, 0, 1], 0), (0, 0, 1)),
        (Placed(CUBE, (3, 4, 0.5)), HalfSpace([0, 0, 1], 0), (0, 0, 1)),
        (Placed(OCTAHEDRON, (3, 4, 1)), HalfSpace([0, 0, 1], 0), (0, 0, 1)),
    ],
)
def test_touching_is_neither_apart_nor_overlapping(a, b, normal):
    for answer, sign in ((overlap(a, b), 1), (overlap(b, a), -1)):
        assert answer.status == "touching"
        assert not answer
        assert (answer.volume, answer.distance, answer.depth) == (0, 0, 0)
        assert answer.centroid is None
        assert len(answer.vertices) == len(answer.facets) == len(answer.owner) == 0
        assert np.linalg.norm(answer.normal) == pytest.approx(1, rel=8 * EPS)
        first, second = answer.shapes
        assert gap(first, second, answer.normal) == pytest.approx(0, abs=16 * EPS)
        if normal is not None:
            assert_allclose(sign * answer.normal, normal, atol=1e-7)
    assert distance(a, b) == penetration_depth(a, b) == 0


def test_edges_that_cross_in_one_point_touch():
    roof = Hull([(-1, 0, 0), (1, 0, 0), (0, 1, -1), (0, -1, -1)])
    saddle = Hull([(0, -1, 0), (0, 1, 0), (1, 0, 1), (-1, 0, 1)])
    answer = overlap(saddle, roof)
    assert answer.status == "touching"
    assert_allclose(answer.normal, (0, 0, 1), atol=1e-7)
    assert_allclose(answer.witness_a, 0, atol=1e-12)
    assert_allclose(answer.witness_b, 0, atol=1e-12)


def test_a_body_in_the_hole_of_its_own_corner_touches_there():
    first = Hull(CORNERS)
    second = Hull(-CORNERS + (1, 1, 1))
    assert_array_equal(first.bounds[1], second.bounds[0])
    assert overlap(first, second).status == "touching"


@pytest.mark.parametrize("seed", range(20))
def test_functions_and_the_answer_agree_on_what_touches(seed):
    rng = np.random.default_rng(seed)
    q, shape = rng.integers(1, 3, 4) * rng.choice([-1.0, 1.0], 4), Box(rng.uniform(0.2, 1.5, 3))
    for _ in range(10):
        a, b = (Placed(shape, rng.integers(-1, 2, 3) * shape.half_extents, q) for _ in "ab")
        answer = overlap(a, b)
        assert (distance(a, b), penetration_depth(a, b)) == (answer.distance, answer.depth)


# Intersection over union


def test_iou_of_a_body_with_itself_is_one():
    for body in (CUBE, Placed(CUBE, (1, 2, 3), (0.1, 0.2, 0.3, 0.4)), OCTAHEDRON):
        assert iou(body, body) == pytest.approx(1, rel=1e-14)
        assert iou(body, body) <= 1


def test_iou_of_half_shifted_boxes_is_a_third():
    assert iou(CUBE, Placed(CUBE, (0.5, 0, 0))) == pytest.approx(1 / 3, rel=1e-14)


def test_iou_of_a_ball_in_a_box_is_the_ratio_of_their_volumes():
    assert iou(Sphere(0.5), CUBE, tolerance=1e-4) == pytest.approx(np.pi / 6, rel=3e-4)


def test_iou_of_bodies_apart_or_touching_is_zero():
    assert iou(CUBE, Placed(CUBE, (2, 0, 0))) == 0
    assert iou(CUBE, Placed(CUBE, (1, 0, 0))) == 0


@given(placed(polyhedra), placed(polyhedra))
def test_iou_is_the_ratio_of_the_volumes_and_never_above_one(a, b):
    part = overlap(a, b).volume
    assert iou(a, b) == pytest.approx(part / (a.volume + b.volume - part), rel=1e-12)
    assert 0 <= iou(a, b) <= 1


# Accepted arguments


def test_bare_shapes_and_arrays_stand_at_the_origin():
    away = Placed(CUBE, (3, 0, 0))
    for body in (CUBE, Placed(CUBE), Hull(CORNERS), CORNERS, CORNERS.tolist()):
        assert distance(body, away) == pytest.approx(2, rel=8 * EPS)
    assert distance(CORNERS @ rotation(QUARTER_X).T, away) == pytest.approx(2, rel=8 * EPS)


@pytest.mark.parametrize("function", [overlap, distance, penetration_depth, iou])
@pytest.mark.parametrize("other", [None, 3, "box", object()])
def test_an_argument_that_is_not_a_shape_is_a_type_error(function, other):
    with pytest.raises(TypeError):
        function(CUBE, other)


@pytest.mark.parametrize("function", [overlap, distance, penetration_depth, iou])
@pytest.mark.parametrize("other", [CORNERS[:3], CORNERS[:4], CORNERS * np.nan])
def test_points_that_make_no_hull_are_a_value_error(function, other):
    with pytest.raises(ValueError, match=r"\w"):
        function(CUBE, other)
