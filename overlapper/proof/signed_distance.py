"""Proved bounds of the signed distance of a pair, to decide which of two programs is right when they differ.

The signed distance is the distance of separated bodies, and minus the depth of overlapping bodies. In the Minkowski
difference D = A - B, it is the signed distance from the origin to the boundary of D. Every direction therefore gives a
lower bound, by the two support values. Every polytope with vertices in D gives an upper bound. The polytope grows at
its feature nearest to the origin until the bounds meet (van den Bergen, Collision Detection in Interactive 3D
Environments, 2003, section 4.3). Its hull is built anew in each step, because these bounds are seldom needed.

If a shape is the sum of a ball and a core, the ball is left out, and its radius is subtracted at the end.

Doubles only propose directions, vertices and facets. The bounds are evaluated in rational arithmetic on the exact
doubles that describe the pair, and rounded once, outwards. Only points on the rim of a cylinder are irrational. They
are rounded to doubles in its own frame, to 1e-16 of its size.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from fractions import Fraction
from itertools import combinations_with_replacement, product

import numpy as np
from numpy.typing import NDArray

from overlapper import Hull, Placed
from overlapper.proof.rational_body import RationalBody
from overlapper.rational import Exact, cross, exact
from overlapper.shapes.nearest import nearest_weights

Floats = NDArray[np.float64]

# Three divisions and roots, each rounded correctly, and their product.
OUTWARDS = 4 * 2.0**-52

# The most steps. Polyhedra finish by themselves. Rims gain about a digit in ten steps; coaxial rims keep wide bounds.
STEPS = 100

# The directions to the 26 neighbours of a cell.
NEIGHBOURS = np.array([direction for direction in product((-1.0, 0.0, 1.0), repeat=3) if any(direction)])


def signed_distance_bounds(
    a: Placed, b: Placed, directions: Iterable[Floats] = (), resolution: float = 0.0
) -> tuple[float, float]:
    """(lower, upper), in m, around the exact signed distance: the distance if separated, minus the depth in overlap.

    `directions`, (3,) each, in the world frame, are tried first. They are normals, from A to B, of claimed answers.
    The search stops when the bounds differ by `resolution` m, or cannot become closer.
    """
    # A half-space is bounded only along its normal, so this direction gives the signed distance itself.
    bodies = RationalBody(a), RationalBody(b)
    for body, sign in zip(bodies, (1, -1)):
        if not body.facts.bounded:
            normal = body.tightest(body.position)
            return _gap(*bodies, sign * normal / max(abs(normal)))
    difference = Difference(*bodies)
    for direction in directions:
        difference.extend(np.asarray(direction, float))
    for _ in range(STEPS):
        outwards, distance = difference.nearest()
        grown = [difference.extend(outward) for outward in outwards]
        if not any(grown) or distance - difference.lower <= resolution:
            break
    return difference.certified()


class Difference:
    """A polytope inside the Minkowski difference A - B, round parts left out, with exact vertices."""

    def __init__(self, a: RationalBody, b: RationalBody) -> None:
        self.bodies = (a, b)
        self.radius = a.facts.rounding + b.facts.rounding
        self.offset = a.position - b.position
        self.points: dict[tuple[float, ...], Exact] = {}
        self.lower = -math.inf
        self.outward = NEIGHBOURS[0]
        for outward in NEIGHBOURS:
            self.extend(outward)
        # In a thin solid, the points may lie on a line or plane. Two steps in both directions across it leave it.
        for _ in range(2):
            points = np.array(list(self.points))
            for axis in np.linalg.svd(points - points.mean(axis=0))[2]:
                self.extend(axis)
                self.extend(-axis)

    def extend(self, outward: Floats) -> bool:
        """Adds a farthest point of A - B along `outward`. False if the point is already a vertex."""
        point = self.offset
        for body, sign in zip(self.bodies, (1.0, -1.0)):
            local = body.facts.core_tip((body.axes.T @ exact(sign * outward)).astype(float))
            point = point + exact(sign) * (body.axes @ exact(local))
        rounded = point.astype(float)
        gap = -float(rounded @ outward) / float(np.linalg.norm(outward))
        if gap > self.lower:
            self.lower, self.outward = gap, outward
        key = tuple(rounded)
        known = key in self.points
        self.points[key] = point
        return not known

    def surface(self) -> tuple[Floats, Floats]:
        """Triangles (k, 3, 3), counter-clockwise from outside, and half-spaces (f, 4) that bound the polytope."""
        points = np.array(list(self.points))
        try:
            hull = Hull(points)
        except ValueError:  # flat: a point, segment or parallelogram, from balls and capsules or from very thin plates
            across = np.linalg.svd(points - points.mean(axis=0))[2][2]
            return np.array(list(combinations_with_replacement(points, 3))), np.array([[*across, 0.0]])
        fans = [(ring[0], ring[i], ring[i + 1]) for ring in hull.facets for i in range(1, len(ring) - 1)]
        return hull.vertices[np.array(fans)], hull.halfspaces

    def nearest(self) -> tuple[list[Floats], float]:
        """The directions in which to grow next, and the signed distance of the polytope, in doubles."""
        triangles, halfspaces = self.surface()
        facet = halfspaces[halfspaces[:, 3].argmax()]
        if facet[3] < 0.0:
            return [facet[:3]], float(facet[3])
        points = np.einsum("ki,kij->kj", nearest_weights(triangles), triangles)
        distances = np.linalg.norm(points, axis=1)
        row = distances.argmin()
        # If the nearest point is very near the origin, its direction is only rounding; the facet's normal is reliable.
        return [facet[:3], -points[row]] if distances[row] > 0.0 else [facet[:3]], float(distances[row])

    def certified(self) -> tuple[float, float]:
        """(lower, upper) bounds of the signed distance of the pair, evaluated exactly and rounded outwards."""
        triangles, _ = self.surface()
        weights = nearest_weights(triangles)
        points = np.einsum("ki,kij->kj", weights, triangles)
        row = np.linalg.norm(points, axis=1).argmin()
        shares = exact(weights[row]) / sum(exact(weights[row]))
        nearest = sum(share * self.points[tuple(corner)] for share, corner in zip(shares, triangles[row]))
        distance = math.sqrt(nearest @ nearest)
        lower, _ = _gap(*self.bodies, exact(self.outward))
        inner = self._inscribed_radius(triangles, points) if lower <= -self.radius else None
        upper = distance if inner is None else -inner
        return lower, upper - self.radius + OUTWARDS * (abs(upper) + self.radius)

    def _inscribed_radius(self, triangles: Floats, nearest: Floats) -> float | None:
        """The radius of a ball about the origin inside the surface; None if it is open or the origin is outside."""
        edges = Counter((tuple(t[i]), tuple(t[i - 1])) for t in triangles for i in range(3))
        if any(count != edges[edge[::-1]] for edge, count in edges.items()):
            return None
        angle, radius = 0.0, math.inf
        for triangle, point in zip(triangles, nearest):
            corners = np.array([self.points[tuple(corner)] for corner in triangle])
            normal = cross(corners[1] - corners[0], corners[2] - corners[0])
            angle += _solid_angle(triangle, normal @ corners[0])
            # The triangle is beyond each of these planes; the second is for triangles with almost no area.
            radius = min(radius, max(_least(corners, normal), _least(corners, exact(point))))
        return radius if abs(angle - 4.0 * math.pi) < 1.0 and radius > 0.0 else None


def _gap(a: RationalBody, b: RationalBody, outward: Exact) -> tuple[float, float]:
    """The gap between the supports along a direction from A to B, rounded down and up."""
    flat, curved = Fraction(0), 0.0
    for body, direction in ((a, outward), (b, -outward)):
        support = body.support(direction)
        assert support is not None, "a half-space must be asked along its normal"
        flat, curved = flat - support[0], curved + math.sqrt(support[1])
    norm = math.sqrt(outward @ outward)
    value, rounding = (float(flat) - curved) / norm, OUTWARDS * (abs(float(flat)) + curved) / norm
    return value - rounding, value + rounding


def _solid_angle(triangle: Floats, volume: Fraction) -> float:
    """The solid angle, in steradian, of a triangle seen from the origin: negative from outside.

    The solid angles of a closed surface sum to 4 pi from within, and to 0 from outside (van Oosterom and Strackee,
    1983). `volume` is the triple product of the corners. Its sign must be right if the origin is near the triangle.
    """
    (p, q, r), (a, b, c) = triangle, np.linalg.norm(triangle, axis=1)
    return 2.0 * math.atan2(float(volume), a * b * c + (p @ q) * c + (q @ r) * a + (r @ p) * b)


def _least(corners: Exact, normal: Exact) -> float:
    """The least distance along `normal` of the corners from the origin."""
    squared = normal @ normal
    return float(min(corners @ normal)) / math.sqrt(squared) if squared else 0.0
