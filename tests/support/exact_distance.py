"""The signed distance of convex bodies without rounding: how far they are apart, or minus the least translation that
separates them.

A body is a core, which is the hull of rational points, and a radius by which it is grown: a ball has a point for a
core, a capsule a segment. Cylinders are held between what is inside of them and what they are inside of. The last step
is one square root, to as many digits as are asked for.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations
from math import isqrt, lcm

import exact
import numpy as np

from overlapper import Capsule, Cylinder, Placed, RoundedHull

DIGITS = 50

# A direction is known to so many half-ulps of itself, divided by the sine between the edges that it is upright on.
LOST = 32

Integers = tuple[int, int, int]


@dataclass(frozen=True)
class Core:
    """The hull of points, its facets' normals and its edges, each of any length, and the radius that is around it."""

    points: tuple[exact.Vector, ...]
    normals: tuple[exact.Vector, ...] = ()
    edges: tuple[exact.Vector, ...] = ()
    radius: Fraction = Fraction(0)


def core(body: exact.Polytope | Placed) -> Core:
    """The core of an exact polytope, or of a ball, a capsule or a rounded hull at a pose."""
    if isinstance(body, exact.Polytope):
        around = {frozenset(edge) for facet in body.facets for edge in exact.edges_of(facet.ring)}
        return Core(
            tuple(map(exact.coordinates, body.vertices)),
            tuple(exact.vector(plane[:3]) for plane in body.planes),
            tuple(exact.subtract(*map(exact.coordinates, edge)) for edge in around),
        )
    if isinstance(body.shape, RoundedHull):
        grown = exact.hull(exact.placed(body.shape.core.vertices, body.position, body.given_orientation))
        return replace(core(grown), radius=Fraction(body.shape.radius))
    half = Fraction(body.shape.length) / 2 if isinstance(body.shape, Capsule) else Fraction(0)
    ends = exact.placed([(0, 0, z) for z in {half, -half}], body.position, body.given_orientation)
    edges = (exact.subtract(ends[0], ends[1]),) if half else ()
    return Core(tuple(ends), (), edges, Fraction(body.shape.radius))


def signed_distance(a: exact.Polytope | Placed, b: exact.Polytope | Placed) -> Fraction | None:
    """To DIGITS digits; None if it is not known of a cylinder, which meets the other body with an edge or a rim."""
    for one, other in ((a, b), (b, a)):
        if isinstance(one, Placed) and isinstance(one.shape, Cylinder):
            return of_cylinder(one, other) if isinstance(other, exact.Polytope) else None
    return of_cores(core(a), core(b))


def of_cores(a: Core, b: Core) -> Fraction:
    squared = distance_squared(a.points, b.points)
    between = root(squared) if squared else -root(depth_squared(a, b))
    return between - a.radius - b.radius


def root(square: Fraction) -> Fraction:
    """The square root, to DIGITS digits of itself."""
    if square == 0:
        return Fraction(0)
    shift = max(0, 4 * DIGITS - (square.numerator.bit_length() - square.denominator.bit_length()) // 2)
    return Fraction(isqrt((square.numerator << 2 * shift) // square.denominator), 1 << shift)


# How far apart: GJK, which without rounding ends after finitely many steps


def distance_squared(a: Sequence[exact.Vector], b: Sequence[exact.Vector]) -> Fraction:
    """The squared distance of the hulls of two lists of points; zero if the hulls have a common point."""
    (p, q), scale = integers(a, b)
    corners = [minus(p[0], q[0])]
    while True:
        nearest, corners = nearest_point(corners)
        if not any(nearest):
            return Fraction(0)
        towards = whole(nearest)
        farthest = minus(min(p, key=lambda x: times(x, towards)), max(q, key=lambda x: times(x, towards)))
        if times(farthest, towards) >= exact.dot(nearest, exact.vector(towards)):
            return exact.dot(nearest, nearest) / scale**2
        corners.append(farthest)


def nearest_point(corners: list[Integers]) -> tuple[exact.Vector, list[Integers]]:
    """The point of a simplex that is nearest to the origin, and the corners of the face that it is inside of."""
    found = []
    for count in range(1, len(corners) + 1):
        for face in combinations(corners, count):
            weights = foot(face)
            if weights is not None and min(weights) > 0:
                x, y, z = (sum((w * c[i] for w, c in zip(weights, face)), Fraction(0)) for i in range(3))
                found.append(((x, y, z), list(face)))
    return min(found, key=lambda each: exact.dot(each[0], each[0]))


def foot(face: Sequence[Integers]) -> list[Fraction] | None:
    """The weights of the corners in the foot of the origin on their plane or line; None if a corner lies on that of the
    others."""
    sides = [minus(corner, face[0]) for corner in face[1:]]
    rows = [[Fraction(times(u, v)) for v in sides] + [Fraction(-times(u, face[0]))] for u in sides]
    for i in range(len(rows)):
        pivot = next((row for row in rows[i:] if row[i]), None)
        if pivot is None:
            return None
        rows.remove(pivot)
        pivot = [c / pivot[i] for c in pivot]
        rows = [[c - row[i] * d for c, d in zip(row, pivot)] for row in rows]
        rows.insert(i, pivot)
    weights = [row[-1] for row in rows]
    return [1 - sum(weights, Fraction(0)), *weights]


# How deep: all directions in which a facet of the difference may face


def depth_squared(a: Core, b: Core) -> Fraction:
    """The squared penetration depth of two hulls that have a common point.

    The normal of the nearest face of their difference is the normal of a facet of either body, or the cross product of
    an edge of each. Doubles bound the distance along each such direction from below. The nearest directions are then
    computed exactly until no other can be nearer. A difference without such a direction is flat and has no inside.
    """
    (p, q), scale = integers(a.points, b.points)
    least, bound = None, None
    for level, direction in likely_directions(a, b):
        if bound is not None and Fraction(level) > bound:
            break
        for way in (direction, (-direction[0], -direction[1], -direction[2])):
            extent = max(times(x, way) for x in p) - min(times(x, way) for x in q)
            square = Fraction(extent * abs(extent), times(way, way) * scale**2)
            if least is None or square < least:
                least, bound = square, root(max(square, Fraction(0)))
    return max(least or Fraction(0), Fraction(0))


def likely_directions(a: Core, b: Core) -> Iterator[tuple[float, Integers]]:
    """Those that may be the way out, and how near the boundary is there at least, the nearest first."""
    clouds = [relative(body.points, a.points[0]) for body in (a, b)]
    reach = sum(float(np.abs(cloud).max()) for cloud in clouds)
    edges = [relative(body.edges) for body in (a, b)]
    normals = [*a.normals, *b.normals]
    levels, names = [np.empty(0)], [np.empty((0, 2), int)]
    for i, sides in [(-1, relative(normals)), *((i, np.cross(edge, edges[1])) for i, edge in enumerate(edges[0]))]:
        length = np.linalg.norm(sides, axis=1)
        across = 1.0 if i < 0 else np.linalg.norm(edges[0][i]) * np.linalg.norm(edges[1], axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            unit = np.nan_to_num(sides / length[:, None])
            lost = np.minimum(LOST * np.finfo(float).eps * reach * across / length, 2 * reach)
        up, down = ((clouds[0] @ way).max(0) - (clouds[1] @ way).min(0) for way in (unit.T, -unit.T))
        levels.append(np.minimum(up, down) - lost)
        names.append(np.column_stack([np.full(len(sides), i), np.arange(len(sides))]))
    level, name = np.concatenate(levels), np.concatenate(names)
    for k in np.argsort(level):
        i, j = name[k].tolist()
        direction = normals[j] if i < 0 else exact.cross(a.edges[i], b.edges[j])
        if any(direction):
            yield float(level[k]), whole(direction)


# Cylinders


def of_cylinder(cylinder: Placed, other: exact.Polytope) -> Fraction | None:
    """From both sides: by the facets of the other body, and by a polytope in the cylinder that has the point which is
    farthest that way. None if the two differ."""
    shape, body = cylinder.shape, core(other)
    (centre,) = exact.placed([(0, 0, 0)], cylinder.position, (0, 0, 0, 1))
    axis, first, second = exact.placed(np.eye(3)[[2, 0, 1]], (0, 0, 0), cylinder.given_orientation)
    radius, half = Fraction(shape.radius), Fraction(shape.length) / 2

    def on_rim(x: Fraction, y: Fraction, z: Fraction) -> exact.Vector:
        return exact.add(centre, tuple(x * first[i] + y * second[i] + z * axis[i] for i in range(3)))

    best = None
    for normal in body.normals:
        length = root(exact.dot(normal, normal))
        across = exact.dot(normal, first), exact.dot(normal, second)
        wide = root(across[0] ** 2 + across[1] ** 2)
        lowest = exact.dot(normal, centre) - half * abs(exact.dot(normal, axis)) - radius * wide
        level = (lowest - max(exact.dot(normal, p) for p in body.points)) / length
        if best is None or level > best[0]:
            best = (level, normal, across, wide)
    assert best is not None
    outer, normal, across, wide = best
    fifths = ((5, 0), (0, 5), (3, 4))
    ring = {(Fraction(s * x, 5), Fraction(t * y, 5)) for x, y in fifths for s in (1, -1) for t in (1, -1)}
    if wide:
        down = -across[0] / wide, -across[1] / wide
        inside = 1 - Fraction(1, 10 ** (DIGITS - 2))  # the root is rounded: the point must not be outside of the rim
        ring.add((down[0] * inside, down[1] * inside))
    inner = exact.hull(on_rim(radius * x, radius * y, z) for x, y in ring for z in (-half, half))
    within = of_cores(core(inner), body)
    return outer if abs(within - outer) <= abs(outer) / 10**20 else None


def outside(body: exact.Polytope | Placed, point: exact.Vector) -> Fraction:
    """How far a point is outside of a body."""
    if not (isinstance(body, Placed) and isinstance(body.shape, Cylinder)):
        return max(root(distance_squared(core(body).points, [point])) - core(body).radius, Fraction(0))
    (axis,) = exact.placed([(0, 0, 1)], (0, 0, 0), body.given_orientation)
    arm = exact.subtract(point, exact.vector(body.position))
    height = exact.dot(axis, arm)
    across = root(exact.dot(arm, arm) - height * height) - Fraction(body.shape.radius)
    along = abs(height) - Fraction(body.shape.length) / 2
    return root(max(across, Fraction(0)) ** 2 + max(along, Fraction(0)) ** 2)


# Numbers


def integers(*clouds: Sequence[exact.Vector]) -> tuple[list[list[Integers]], int]:
    """The points by a common denominator, and that denominator."""
    scale = lcm(*(c.denominator for cloud in clouds for p in cloud for c in p))
    return [[(int(x * scale), int(y * scale), int(z * scale)) for x, y, z in cloud] for cloud in clouds], scale


def whole(direction: exact.Vector) -> Integers:
    """A vector of whole numbers along the direction. Its length is arbitrary."""
    ((row,),), _ = integers([direction])
    return row


def relative(rows: Iterable[exact.Vector], origin: exact.Vector | None = None) -> np.ndarray:
    """As doubles: points from an origin, or else directions, each divided by its largest component."""
    if origin is not None:
        return np.array([exact.subtract(p, origin) for p in rows], float).reshape(-1, 3)
    scaled = ([c / max(map(abs, row)) for c in row] for row in rows)
    return np.array(list(scaled), float).reshape(-1, 3)


def minus(u: Integers, v: Integers) -> Integers:
    return u[0] - v[0], u[1] - v[1], u[2] - v[2]


def times(u: Integers, v: Integers) -> int:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
