"""Shapes and poses to test with: seeded numpy generators, hypothesis strategies, and support functions."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from overlapper import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, Placed, RoundedHull, Sphere

# Seeded


def quaternion(rng):
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def hull_points(rng, n, size=1.0):
    """n points on an ellipsoid about the origin, none inside the hull of the others: general position, n vertices."""
    points = rng.normal(size=(n, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    return points * size * rng.uniform(0.5, 1.0, 3)


def inner_point(rng, points):
    """A point well inside the hull: near the mean of all vertices."""
    weights = rng.uniform(0.5, 1.5, len(points))
    return weights @ points / weights.sum()


def overlapping_points(rng, count=2, low=6, high=20):
    """Vertex arrays of hulls that certainly overlap: each holds the origin as an inner point."""
    clouds = [hull_points(rng, int(rng.integers(low, high + 1)), rng.uniform(0.5, 1.5)) for _ in range(count)]
    return [cloud - inner_point(rng, cloud) for cloud in clouds]


def directions(rng, n):
    u = rng.normal(size=(n, 3))
    return u / np.linalg.norm(u, axis=1, keepdims=True)


# Poses


def rotation(q):
    x, y, z, w = np.asarray(q, float) / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def product(p, q):
    """The quaternion of turning by q first, then by p."""
    (a, b, c, d), (x, y, z, w) = p, q
    return np.array(
        [
            d * x + a * w + b * z - c * y,
            d * y - a * z + b * w + c * x,
            d * z + a * y - b * x + c * w,
            d * w - a * x - b * y - c * z,
        ]
    )


def turn(rotation_vector):
    """The quaternion of a rotation vector."""
    v = np.asarray(rotation_vector, float)
    angle = np.linalg.norm(v)
    return np.append(v * (np.sinc(angle / (2 * np.pi)) / 2), np.cos(angle / 2))


def moved(body, translation=(0, 0, 0), orientation=(0, 0, 0, 1)):
    """A placed shape under a rigid motion of the world: turned about the origin, then moved."""
    position = rotation(orientation) @ body.position + translation
    return Placed(body.shape, position, product(orientation, body.orientation))


def placed_points(body):
    """The world vertices of a placed box or hull."""
    if isinstance(body.shape, Box):
        corners = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), -1).reshape(-1, 3) * body.shape.half_extents
    else:
        corners = body.shape.vertices
    return corners @ rotation(body.orientation).T + body.position


def reach(body, direction):
    """The greatest value of direction . x on a placed shape."""
    shape = body.shape
    local = rotation(body.orientation).T @ direction
    base = float(np.dot(body.position, direction))
    if isinstance(shape, Box):
        return base + float(np.abs(local) @ shape.half_extents)
    if isinstance(shape, Hull):
        return base + float((shape.vertices @ local).max())
    if isinstance(shape, Sphere):
        return base + shape.radius * float(np.linalg.norm(local))
    if isinstance(shape, Capsule):
        return base + shape.radius * float(np.linalg.norm(local)) + abs(local[2]) * shape.length / 2
    if isinstance(shape, Cylinder):
        return base + shape.radius * float(np.hypot(local[0], local[1])) + abs(local[2]) * shape.length / 2
    if isinstance(shape, Ellipsoid):
        return base + float(np.linalg.norm(shape.half_axes * local))
    if isinstance(shape, RoundedHull):
        return base + float((shape.core.vertices @ local).max()) + shape.radius * float(np.linalg.norm(local))
    assert isinstance(shape, HalfSpace)
    along = float(shape.normal @ local)
    return base + shape.offset * along if np.allclose(along, np.linalg.norm(local), atol=0, rtol=1e-12) else np.inf


# Drawn by hypothesis

numbers = st.floats(-1.0, 1.0, allow_subnormal=False)
lengths = st.floats(0.2, 1.5)
seeds = st.integers(0, 2**32 - 1)


@st.composite
def quaternions(draw):
    q = np.array([draw(numbers) for _ in range(4)])
    return q if np.linalg.norm(q) > 1e-3 else np.array([0.0, 0.0, 0.0, 1.0])


def vectors(bound=1.0):
    return st.tuples(numbers, numbers, numbers).map(lambda v: bound * np.array(v))


boxes = st.builds(Box, st.tuples(lengths, lengths, lengths))
spheres = st.builds(Sphere, lengths)
capsules = st.builds(Capsule, lengths, st.floats(0.0, 2.0))
cylinders = st.builds(Cylinder, lengths, lengths)
ellipsoids = st.builds(Ellipsoid, st.tuples(lengths, lengths, lengths))


# Hypothesis prints a drawn example as the calls that make it again, so these calls must hold all its data.


@st.composite
def points_of_hulls(draw, low, high):
    """In general position."""
    rng = np.random.default_rng(draw(seeds))
    while True:
        points = hull_points(rng, draw(st.integers(low, high)))
        if np.linalg.svd(points - points.mean(0), compute_uv=False)[2] > 0.05:
            return points.tolist()


def hulls(low=4, high=16):
    return st.builds(Hull, points_of_hulls(low, high))


@st.composite
def lattice_points(draw, reach=3):
    """Points on a small integer lattice, not all in one plane: coplanar, collinear and equal ones are common."""
    ints = st.integers(-reach, reach)
    corner, *others = draw(st.lists(st.tuples(ints, ints, ints), min_size=4, max_size=10, unique=True))
    rank = np.linalg.matrix_rank(np.array(others) - corner)
    if rank < 3:
        others += [tuple(np.add(corner, e)) for e in np.eye(3, dtype=int)]
    return np.array([corner, *others], float)


polyhedra = st.one_of(boxes, hulls())
solids = st.one_of(boxes, spheres, capsules, cylinders, hulls(), ellipsoids)


def placed(shapes, spread=1.0):
    return st.builds(Placed, shapes, vectors(spread), quaternions())


@st.composite
def in_general_position(draw, shapes, low, high):
    """Bodies that share no plane, so that every facet has one owner."""
    rng = np.random.default_rng(draw(seeds))
    chosen = draw(st.lists(shapes, min_size=low, max_size=high))
    poses = [(rng.uniform(-0.5, 0.5, 3).tolist(), quaternion(rng).tolist()) for _ in chosen]
    return [draw(st.builds(Placed, st.just(shape), *map(st.just, pose))) for shape, pose in zip(chosen, poses)]
