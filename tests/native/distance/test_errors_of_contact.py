"""The errors stated of depth, distance and witness points, against support functions in rational arithmetic, whose
roots are taken to fifty digits. Any direction bounds a distance from below and a depth from above; any two points
of the bodies bound the distance from above."""

from fractions import Fraction

import exact
import families
import numpy as np
import pytest
from exact_distance import outside, root
from families import prism
from numpy.testing import assert_allclose
from strategies import directions, hull_points, quaternion, rotation

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
    overlap,
    penetration_depth,
)

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
KINDS = ("sphere", "capsule", "cylinder", "box", "hull", "rounded hull")


def support(body, direction):
    """The greatest value of direction . x on a placed shape, of a direction of any length."""
    shape, u = body.shape, exact.vector(direction)
    length, centre = root(exact.dot(u, u)), exact.dot(u, exact.vector(body.position))
    (axis,) = exact.placed([(0, 0, 1)], (0, 0, 0), body.given_orientation)
    along = exact.dot(axis, u)
    if isinstance(shape, Sphere):
        return centre + Fraction(shape.radius) * length
    if isinstance(shape, Capsule):
        return centre + Fraction(shape.radius) * length + abs(along) * Fraction(shape.length) / 2
    if isinstance(shape, Cylinder):
        across = root(exact.dot(u, u) - along * along)
        return centre + Fraction(shape.radius) * across + abs(along) * Fraction(shape.length) / 2
    radius = Fraction(shape.radius) if isinstance(shape, RoundedHull) else Fraction(0)
    return max(exact.dot(u, p) for p in points_of(body)) + radius * length


def points_of(body):
    shape = body.shape
    if isinstance(shape, Box):
        points = CORNERS * shape.half_extents
    else:
        points = (shape.core if isinstance(shape, RoundedHull) else shape).vertices
    return exact.placed(points, body.position, body.given_orientation)


def way_out(a, b, normal):
    """How far a has to go along a direction to leave b; negative if the two are apart along it."""
    n = exact.vector(normal)
    return (support(a, [-c for c in n]) + support(b, n)) / root(exact.dot(n, n))


def near_supports(body, rows):
    """support() in doubles, of many unit directions."""
    shape, local = body.shape, rows @ rotation(body.orientation)
    base = rows @ body.position
    if isinstance(shape, Sphere):
        return base + shape.radius
    if isinstance(shape, Capsule):
        return base + shape.radius + np.abs(local[:, 2]) * shape.length / 2
    if isinstance(shape, Cylinder):
        return base + shape.radius * np.hypot(local[:, 0], local[:, 1]) + np.abs(local[:, 2]) * shape.length / 2
    if isinstance(shape, Box):
        return base + np.abs(local) @ shape.half_extents
    if isinstance(shape, RoundedHull):
        return base + (local @ shape.core.vertices.T).max(1) + shape.radius
    return base + (local @ shape.vertices.T).max(1)


def shortest_way_out(rng, a, b):
    """A direction along which a leaves b soonest, by going downhill from many, axes and rims among them."""

    def ways(rows):
        return near_supports(a, -rows) + near_supports(b, rows)

    axes = np.vstack([rotation(body.orientation).T for body in (a, b)])
    turns = np.linspace(0, 2 * np.pi, 360, endpoint=False)[:, None]
    rings = [np.cos(turns) * axes[i] + np.sin(turns) * axes[i + 1] for i in (0, 3)]
    products = np.cross(axes[:3, None], axes[None, 3:]).reshape(-1, 3)
    products = products[np.linalg.norm(products, axis=1) > 1e-9]
    start = np.vstack([directions(rng, 3000), axes, -axes, *rings, products, -products])
    start /= np.linalg.norm(start, axis=1)[:, None]
    best = start[np.argsort(ways(start))[:40]]
    length, step = ways(best), np.full(len(best), 0.03)
    for _ in range(400):
        near = best + step[:, None] * rng.normal(size=best.shape)
        near /= np.linalg.norm(near, axis=1)[:, None]
        shorter = ways(near) < length
        best[shorter] = near[shorter]
        length = ways(best)
        step = np.maximum(np.where(shorter, 1.6 * step, 0.87 * step), 1e-13)
    return best[length.argmin()]


def shape_of(rng, kind, size=1.0):
    if kind == "sphere":
        return Sphere(size * rng.uniform(0.3, 1))
    if kind == "capsule":
        return Capsule(size * rng.uniform(0.1, 1), size * rng.uniform(0, 2))
    if kind == "cylinder":
        return Cylinder(*(size * rng.uniform(0.2, 2, 2)))
    if kind == "box":
        return Box(size * rng.uniform(0.2, 1, 3))
    points = size * hull_points(rng, int(rng.integers(4, 12)))
    return Hull(points) if kind == "hull" else RoundedHull(points, size * rng.uniform(0.01, 0.5))


def orientations(rng, axes):
    """Quaternions, of any length, of two bodies whose axes are at random, parallel or nearly parallel."""
    one = quaternion(rng)
    if axes == "crossed":
        return one * 10 ** rng.uniform(-3, 3), quaternion(rng)
    tilt = 0 if axes == "parallel" else 10 ** rng.uniform(-16, -2)
    return one, 7 * (one + tilt * rng.normal(size=4))


def size_of(body):
    return float(np.linalg.norm(np.diff(body.bounds, axis=0)))


@pytest.mark.parametrize("axes", ["crossed", "parallel", "nearly parallel"])
@pytest.mark.parametrize("kind", KINDS)
def test_no_separating_translation_is_shorter_than_the_depth_minus_its_error(kind, axes):
    rng = np.random.default_rng([KINDS.index(kind), len(axes)])
    deep = 0
    for scale in (1e-3, 1, 1, 1e3):
        p, q = orientations(rng, axes)
        centre = 10 * scale * rng.normal(size=3)
        beside = rotation(p) @ (rng.choice([0, 1], 3) * rng.normal(size=3)) * scale * 10 ** rng.uniform(-3, 0)
        a = Placed(shape_of(rng, kind, scale), centre, p)
        b = Placed(shape_of(rng, "cylinder", scale * rng.choice([1, 1e-3, 0.3])), centre + beside, q)
        for one, other in ((a, b), (b, a)):
            answer = overlap(one, other)
            if not answer:
                continue
            deep += 1
            size = size_of(a) + size_of(b)
            error = Fraction(answer.errors.depth)
            assert error <= 1e-11 * size
            assert answer.errors.distance == 0
            assert abs(way_out(one, other, answer.normal) - Fraction(answer.depth)) <= error + Fraction(1e-14 * size)
            shortest = way_out(one, other, shortest_way_out(rng, one, other))
            assert shortest >= Fraction(answer.depth) - error
    assert deep > 1


@pytest.mark.parametrize("axes", ["crossed", "parallel", "nearly parallel"])
@pytest.mark.parametrize("kind", [*KINDS, "on the ground"])
def test_the_distance_lies_between_planes_and_points_that_its_error_reaches(kind, axes):
    rng = np.random.default_rng([len(kind), len(axes)])
    for scale in (1e-3, 1, 1, 1, 1, 1e3):
        for other in KINDS:
            p, q = orientations(rng, axes)
            up = directions(rng, 1)[0] if rng.random() < 0.6 else rotation(p) @ rng.choice([0.0, 1.0, 1.0], 3)
            up = up / np.linalg.norm(up) if up.any() else np.array([0.0, 0, 1])
            b = Placed(shape_of(rng, other, scale), (0, 0, 0), q)
            height = float(support(b, up)) + scale * 10 ** rng.uniform(-12, 1)
            if kind == "on the ground":
                a = HalfSpace(-up, -height)
            else:
                a = Placed(shape_of(rng, kind, scale), (0, 0, 0), p)
                a = Placed(a.shape, up * (float(support(a, -up)) + height), p)
            # GJK sees only a cap where caps that are nearly level meet at their rims.
            check_distance(a, b, 1e-9 if kind == other == "cylinder" and axes == "nearly parallel" else 1e-12)


@pytest.mark.parametrize("ratio", [1e3, 1e6, 1e16])
@pytest.mark.parametrize("kind", KINDS)
def test_the_distance_to_a_huge_body_is_as_right_as_the_small_one(kind, ratio):
    rng = np.random.default_rng([KINDS.index(kind), int(np.log10(ratio))])
    for _ in range(4):
        up, q = directions(rng, 1)[0], quaternion(rng)
        small, large = shape_of(rng, kind, 1e-3), shape_of(rng, "box", 1e-3 * ratio)
        large = Placed(large, (0, 0, 0), q)
        near = Placed(small, (0, 0, 0), quaternion(rng))
        near = Placed(small, up * float(support(near, -up) + support(large, up)) * (1 + 1e-6), near.orientation)
        check_distance(near, large)


def check_distance(a, b, share=1e-12):
    answer = overlap(a, b)
    if answer.status != "separated":
        assert answer.status == "touching"
        return
    a, b = answer.shapes
    errors = answer.errors
    witnesses = exact.vector(answer.witness_a), exact.vector(answer.witness_b)
    apart = exact.subtract(*witnesses)
    between = root(exact.dot(apart, apart))
    beside = max(beyond(body, point) for body, point in zip((a, b), witnesses, strict=True))
    most, stated, error = between + 2 * beside, Fraction(answer.distance), Fraction(errors.distance)
    bounded = [body for body in (a, b) if not isinstance(body.shape, HalfSpace)]
    size = sum(map(size_of, bounded)) + answer.distance
    world = max(float(np.abs(body.bounds).max()) for body in bounded) + size
    # Along the normal in doubles, which is off by its last bits, planes are a little nearer.
    least = -way_out(a, b, answer.normal) if len(bounded) == 2 else stated - error
    assert least - Fraction(1e-13 * size) <= stated + error
    assert most >= stated - error
    assert beside + max(between - stated - error, Fraction(0)) <= Fraction(errors.witnesses)
    assert error <= share * size
    assert errors.witnesses <= share * size + 1e-15 * world
    assert errors.depth == 0
    # Planes and points leave as little between them as the errors say, whatever these were computed from.
    assert most - least <= Fraction(share * size + 1e-14 * world)
    assert_allclose(np.cross(answer.normal, answer.witness_a - answer.witness_b), 0, atol=share * size + 1e-14 * world)


def beyond(body, point):
    """How far a point is outside of a body."""
    shape = body.shape
    if isinstance(shape, HalfSpace):
        normal = exact.vector(shape.normal)
        return max(exact.dot(normal, point) - Fraction(shape.offset), Fraction(0)) / root(exact.dot(normal, normal))
    if isinstance(shape, RoundedHull):
        core = exact.hull(points_of(body))
        return max(outside(core, point) - Fraction(shape.radius), Fraction(0))
    return outside(exact.hull(points_of(body)) if isinstance(shape, (Box, Hull)) else body, point)


@pytest.mark.parametrize("depth", [0.7, 1e-3, 1e-8, 1e-15, 0, -1e-15, -1e-8, -1e-3, -1])
def test_functions_give_what_the_answer_gives(depth):
    rng = np.random.default_rng(0)
    for kind in KINDS:
        for other in KINDS:
            up = directions(rng, 1)[0]
            a = Placed(shape_of(rng, kind), (0, 0, 0), quaternion(rng))
            b = Placed(shape_of(rng, other), (0, 0, 0), quaternion(rng))
            b = Placed(b.shape, up * float(support(a, up) + support(b, -up) - Fraction(depth)), b.orientation)
            answer = overlap(a, b)
            assert (distance(a, b), penetration_depth(a, b)) == (answer.distance, answer.depth)


# Cylinders, in closed form


@pytest.mark.parametrize("seed", range(20))
def test_coaxial_cylinders_separate_sideways_or_lengthwise(seed):
    rng = np.random.default_rng(seed)
    q = quaternion(rng)
    (r, s), (k, m) = rng.uniform(0.2, 2, (2, 2))
    answer = overlap(Placed(Cylinder(r, k), (0, 0, 0), q), Placed(Cylinder(s, m), (0, 0, 0), q))
    truth = min(Fraction(r) + Fraction(s), (Fraction(k) + Fraction(m)) / 2)
    assert abs(Fraction(answer.depth) - truth) <= answer.errors.depth <= 1e-14


@pytest.mark.parametrize("seed", range(20))
def test_crossing_cylinders_separate_perpendicular_to_both_axes(seed):
    rng = np.random.default_rng(seed)
    r, s, apart = rng.uniform(0.2, 1), rng.uniform(0.2, 1), rng.uniform(0.01, 1)
    turn = rng.uniform(0.1, 3)
    a = Cylinder(r, 40)
    b = Placed(Cylinder(s, 40), (0, apart * (r + s), 0), (0, np.sin(turn / 2), 0, np.cos(turn / 2)))
    answer = overlap(a, b)
    truth = Fraction(r) + Fraction(s) - Fraction(float(b.position[1]))
    assert abs(Fraction(answer.depth) - truth) <= answer.errors.depth <= 1e-12
    assert_allclose(answer.normal, (0, -1, 0), atol=1e-15)


@pytest.mark.parametrize("seed", range(8))
def test_a_corner_in_the_side_of_a_cylinder_leaves_it_straight_away_from_the_axis(seed):
    rng = np.random.default_rng(seed)
    q = quaternion(rng)
    outward = np.array([0.9, 0.3, 0]) / np.hypot(0.9, 0.3)
    aside, along = np.cross([0, 0, 1], outward), np.array([0, 0, 1])
    turns = rng.uniform(0, 0.5) + np.arange(3)[:, None] * 2 * np.pi / 3
    tip = rng.uniform(0.05, 0.9) * outward + 0.2 * along
    corners = np.vstack([tip, tip + 3 * outward + np.cos(turns) * aside + np.sin(turns) * along])
    cylinder = Placed(Cylinder(1, 40), rng.normal(size=3), q)
    hull = Placed(Hull(corners @ rotation(q).T + cylinder.position))
    (axis,) = exact.placed([(0, 0, 1)], (0, 0, 0), cylinder.given_orientation)
    arms = [exact.subtract(exact.vector(corner), exact.vector(cylinder.position)) for corner in hull.shape.vertices]
    truth = 1 - root(min(exact.dot(arm, arm) - exact.dot(arm, axis) ** 2 for arm in arms))
    for bodies in ((cylinder, hull), (hull, cylinder)):
        answer = overlap(*bodies)
        assert abs(Fraction(answer.depth) - truth) <= answer.errors.depth <= 1e-15


@pytest.mark.parametrize("sunk", [1e-2, 1e-9])
@pytest.mark.parametrize("seed", range(6))
def test_a_tilted_cylinder_in_a_facet_of_a_hull_leaves_it_along_the_normal_of_the_facet(seed, sunk):
    rng = np.random.default_rng(seed)
    q, p = quaternion(rng), quaternion(rng)
    x, _, normal = rotation(q).T
    hull = Placed(Hull(np.array([[6, 0, 0], [-3, 5, 0], [-3, -5, 0], [0.1, 0.2, -7]]) @ rotation(q).T))
    a, b, c = (exact.vector(corner) for corner in hull.shape.vertices if corner @ normal > -1)
    outward = exact.cross(exact.subtract(b, a), exact.subtract(c, a))
    outward = outward if exact.dot(outward, exact.vector(normal)) > 0 else [-each for each in outward]
    lowest = float(support(Placed(Cylinder(1, 2), orientation=p), -normal))
    cylinder = Placed(Cylinder(1, 2), normal * (lowest - sunk) + x * rng.normal() * 0.5, p)
    truth = way_out(cylinder, hull, outward)
    for bodies in ((cylinder, hull), (hull, cylinder)):
        answer = overlap(*bodies)
        assert abs(Fraction(answer.depth) - truth) <= answer.errors.depth <= 1e-15 * answer.depth


@pytest.mark.parametrize("tilt", [1e-1, 1e-4, 1e-8, 1e-12, 0])
def test_a_cylinder_that_stands_askew_in_another_has_the_depth_of_its_lowest_rim_point(tilt):
    """Its rim is inside of the other's cap, whose normal is the way out; only the cap itself is as deep."""
    lower, upper = Cylinder(2, 2), Cylinder(0.5, 2)
    cosine, sine, sunk = np.cos(tilt / 2), np.sin(tilt / 2), 0.01
    b = Placed(upper, (0.3, -0.2, 2 - sunk), (sine, 0, 0, cosine))
    answer = overlap(b, lower)
    truth = Fraction(1) + support(b, (0, 0, -1))
    assert abs(Fraction(answer.depth) - truth) <= answer.errors.depth <= 1e-13
    assert_allclose(answer.normal, (0, 0, 1), atol=1e-15)


def test_the_errors_of_bodies_that_touch_bound_how_deep_and_how_far_apart_they_may_be():
    a, b = Cylinder(0.5, 1), Placed(Cylinder(0.5, 1), (1, 0, 0))
    answer = overlap(a, b)
    assert answer.status == "touching"
    assert (answer.depth, answer.distance) == (0, 0)
    assert max(answer.errors.depth, answer.errors.distance, answer.errors.witnesses) <= 1e-15


@pytest.mark.parametrize("seed", [500064, 500112, 500152])
def test_the_depth_of_rims_that_are_parallel_within_rounding_is_as_right_as_others(seed):
    found = overlap(*(families.placed(body) for body in families.make("prisms", seed).bodies))
    assert found.depth == pytest.approx(1e-9, rel=1e-5)
    assert found.errors.depth <= 1e-15 * found.depth


@pytest.mark.parametrize("sides", [8, 24])
@pytest.mark.parametrize("seed", range(6))
def test_the_depth_of_prisms_on_each_other_is_as_right_as_stated(sides, seed):
    rng = np.random.default_rng(seed)
    turned, sunk = rotation(rng.normal(size=4)) if seed % 2 else np.eye(3), rng.choice([1e-12, 1e-9, 1e-3, 0.3])
    a, b = (points @ turned.T for points in (prism(sides), prism(max(3, sides // 4)) + [0.25, 0.25, 1 - sunk]))
    found = overlap(Hull(a), Hull(b))
    way = root(exact.depth_squared(exact.hull(a), exact.hull(b)))
    assert abs(Fraction(found.depth) - way) <= Fraction(found.errors.depth)
    assert found.errors.depth <= max(1e-9 * found.depth, 1e-16)


@pytest.mark.parametrize("sides", [200, 600])
def test_the_depth_of_lids_of_very_many_sides_has_an_error_bound_that_holds(sides):
    """200 sides have too many corners to ask along all products of ridges; 600 sides have too many ridges."""
    lower, upper = prism(sides), prism(sides) + [0, 0, 1 - 1e-9]
    truth = Fraction(lower[:, 2].max()) - Fraction(upper[:, 2].min())
    found = overlap(Hull(lower), Hull(upper))
    assert_allclose(found.normal, (0, 0, -1), atol=1e-15)
    assert abs(Fraction(found.depth) - truth) <= Fraction(found.errors.depth)
    assert 1e-16 < found.errors.depth <= 1e-13
