"""Exact volumes and depths of large polytopes, by tests/support/exact.py on parts that are small.

What is common to two polytopes is the sum of what is common in either half of space. Halved along an axis until few
facets are left, meshes of thousands of facets take seconds.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from fractions import Fraction

import exact
import numpy as np
from exact_distance import core, of_cores
from scipy.spatial import ConvexHull

# Facets of one body times facets of the other, up to which they are clipped as a whole.
SMALL = 2500

# Edges of one body times edges of the other, up to which all pairs of them are tried for the depth.
MOST_EDGE_PAIRS = 500_000


def common_volume(a: Iterable, b: Iterable) -> Fraction:
    """The volume common to the hulls of two sets of points, whose coordinates are doubles or fractions."""
    return exact.total(volumes(polytope(a), polytope(b)))


def volumes(a: exact.Polytope, b: exact.Polytope) -> list[Fraction]:
    if len(a.facets) * len(b.facets) <= SMALL:
        common = exact.common(a, b)
        return [common.volume] if common.dimension == 3 else []
    boxes = [np.array([[c / p[3] for c in p[:3]] for p in body.vertices]) for body in (a, b)]
    lower, upper = np.max([box.min(0) for box in boxes], 0), np.min([box.max(0) for box in boxes], 0)
    if (lower > upper + 1e-9).any():  # a part in which only one of them is
        return []
    axis = int(np.argmax(upper - lower))
    middle = float(lower[axis] + upper[axis]) / 2
    found = []
    for sign in (1.0, -1.0):
        normal = [0.0, 0.0, 0.0]
        normal[axis] = sign
        half = exact.halfspace(normal, sign * middle)
        parts = exact.clipped(a, half, 0), exact.clipped(b, half, 0)
        if all(part.dimension == 3 for part in parts):
            found += volumes(*parts)
    return found


def polytope(points: Iterable) -> exact.Polytope:
    """The hull of points, its triangles from qhull if they are exactly those of a convex surface."""
    rows = [exact.vector(p) for p in points]
    qhull = ConvexHull(np.array(rows, float), qhull_options="Qt")
    cloud = [exact.point(row) for row in rows]
    triangles = {}
    for simplex, equation in zip(qhull.simplices, qhull.equations):
        p, q, r = (cloud[i] for i in simplex)
        outwards = np.cross(*(qhull.points[simplex[1:]] - qhull.points[simplex[0]])) @ equation[:3] > 0
        ring = (p, q, r) if outwards else (p, r, q)
        plane = exact.plane_through(*ring)
        if plane is None:
            return exact.hull(rows)
        triangles[ring] = plane
    return exact.merged(triangles) if is_convex(triangles, cloud) else exact.hull(rows)


def is_convex(triangles: dict[exact.Ring, exact.Plane], cloud: list[exact.Point]) -> bool:
    """True if a closed surface without holes, of all points, is nowhere bent inwards: then it is convex."""
    over = {edge: ring for ring in triangles for edge in exact.edges_of(ring)}
    used = Counter(p for ring in triangles for p in ring)
    if len(over) != 3 * len(triangles) or len(used) != len(set(cloud)) or 2 * len(used) - len(triangles) != 4:
        return False
    return all(
        (other := over.get((v, u))) is not None and all(exact.side(triangles[ring], p) <= 0 for p in other)
        for (u, v), ring in over.items()
    )


def depth(a: Iterable, b: Iterable) -> Fraction | None:
    """The least translation that separates two hulls, 0 if they are apart; None for too many edges."""
    bodies = [core(polytope(points)) for points in (a, b)]
    if len(bodies[0].edges) * len(bodies[1].edges) > MOST_EDGE_PAIRS:
        return None
    return max(-of_cores(*bodies), Fraction(0))
