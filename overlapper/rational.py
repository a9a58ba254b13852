"""Placed shapes in rational arithmetic: a double is a rational number, so all that it says can be taken exactly.

Only what defines a shape is used: radii, lengths, half extents, corners of hulls, normals and offsets as given,
position, quaternion. A quaternion stands for the exact rotation of its direction. The triangles of a hull are a
suggestion that is checked.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overlapper import Box, Capsule, Cylinder, HalfSpace, Hull, Placed, Sphere

Exact = NDArray[np.object_]  # of Fraction

exact: Any = np.frompyfunc(Fraction, 1, 1)


def rotation(quaternion: NDArray[np.float64]) -> Exact:
    """The rotation of a quaternion xyzw of any length: exactly orthogonal, as it is divided by the squared length."""
    x, y, z, w = exact(quaternion)
    s = 2 / (x * x + y * y + z * z + w * w)
    return np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
            [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
            [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
        ],
        dtype=object,
    )


def cross(u: Exact, v: Exact) -> Exact:
    """Of vectors (..., 3)."""
    (a, b, c), (x, y, z) = np.moveaxis(u, -1, 0), np.moveaxis(v, -1, 0)
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-1)


def triple(u: Exact, v: Exact, w: Exact) -> Exact:
    """Determinants (...) of vectors (..., 3)."""
    product: Exact = (u * cross(v, w)).sum(axis=-1)
    return product


def root(square: Fraction) -> tuple[Fraction, Fraction]:
    """(lower, upper) around the square root, equal where it is short, else apart by 1e-19 of it or less."""
    shift = 64 - (square.numerator.bit_length() - square.denominator.bit_length()) // 2
    scaled = square * (Fraction(4) ** shift)
    floor = math.isqrt(scaled.numerator // scaled.denominator)
    unit = Fraction(2) ** -shift
    return floor * unit, (floor if floor * floor == scaled else floor + 1) * unit


def primitive(row: Iterable[Fraction]) -> tuple[int, ...]:
    """Integers without a common divisor in the proportions of the row."""
    row = list(row)
    scale = math.lcm(*(x.denominator for x in row))
    numbers = [x.numerator * (scale // x.denominator) for x in row]
    divisor = math.gcd(*numbers) or 1
    return tuple(x // divisor for x in numbers)


def is_closed(triangles: NDArray[np.signedinteger]) -> bool:
    """Whether triangles (k, 3) of indices have no border: every directed edge is met by its reverse as often."""
    edges = Counter((int(t[i - 1]), int(t[i])) for t in triangles for i in range(3))
    return bool(edges) and all(count == edges[end, start] for (start, end), count in edges.items())


def fans(rings: Iterable[NDArray[np.int32]]) -> NDArray[np.intp]:
    """Triangles (k, 3) of polygons, all of a polygon at its first corner."""
    triangles = [(ring[0], *pair) for ring in rings for pair in pairwise(ring[1:])]
    return np.array(triangles, np.intp).reshape(-1, 3)


class RationalBody:
    """A placed shape as its numbers say, without any rounding."""

    def __init__(self, placed: Placed) -> None:
        self.shape = placed.shape
        self.position: Exact = exact(placed.position)
        self.axes = rotation(placed.orientation)

    def support(self, direction: Exact) -> tuple[Fraction, Fraction] | None:
        """(flat, square): flat + sqrt(square) is the greatest direction . x on the body; None if there is none."""
        base, (x, y, z) = direction @ self.position, self.axes.T @ direction
        none = Fraction(0)
        match self.shape:
            case Box() as box:
                return base + exact(box.half_extents) @ [abs(x), abs(y), abs(z)], none
            case Hull() as hull:
                return base + max(exact(hull.corners) @ [x, y, z]), none
            case Sphere() as ball:
                return base, Fraction(ball.radius) ** 2 * (x * x + y * y + z * z)
            case Capsule() as capsule:
                tip = Fraction(capsule.length) / 2 * abs(z)
                return base + tip, Fraction(capsule.radius) ** 2 * (x * x + y * y + z * z)
            case Cylinder() as cylinder:
                tip = Fraction(cylinder.length) / 2 * abs(z)
                return base + tip, Fraction(cylinder.radius) ** 2 * (x * x + y * y)
            case HalfSpace() as half:
                normal, local = exact(half.given_normal), np.array([x, y, z])
                if any(cross(normal, local)) or local @ normal < 0:
                    return None
                return base + Fraction(half.given_offset) * (local @ normal) / (normal @ normal), none

    def is_below(self, direction: Exact, offset: Fraction) -> bool:
        """Whether the body lies in { x : direction . x <= offset }: the squares are compared, no root is taken."""
        support = self.support(direction)
        return support is not None and support[0] <= offset and support[1] <= (offset - support[0]) ** 2

    def contains(self, points: Exact, margin: Fraction | int = 0) -> NDArray[np.bool_]:
        """Whether the body holds a ball of radius `margin` about each of the points (n, 3) in the world."""
        local = (points - self.position) @ self.axes
        x, y, z = local.T
        inside: Any

        def holds(square: Exact, radius: float) -> Any:
            return (square <= (Fraction(radius) - margin) ** 2) & (Fraction(radius) >= margin)

        match self.shape:
            case Box() as box:
                inside = (abs(local) + margin <= exact(box.half_extents)).all(axis=1)
            case Hull():
                inside = self._below(*self.facets, local, margin)
            case Sphere() as ball:
                inside = holds(x * x + y * y + z * z, ball.radius)
            case Capsule() as capsule:
                past = np.maximum(abs(z) - Fraction(capsule.length) / 2, 0)
                inside = holds(x * x + y * y + past * past, capsule.radius)
            case Cylinder() as cylinder:
                inside = (abs(z) + margin <= Fraction(cylinder.length) / 2) & holds(x * x + y * y, cylinder.radius)
            case HalfSpace() as half:
                row = np.array([primitive([*exact(half.given_normal), Fraction(half.given_offset)])], object)
                inside = self._below(row[:, :3], row[:, 3], local, margin)
        return np.asarray(inside, bool)

    @staticmethod
    def _below(normals: Exact, offsets: Exact, points: Exact, margin: Fraction | int) -> Any:
        """Planes of integers: over a common denominator a point is of integers too, which is faster by far."""
        scale = np.array([[math.lcm(*(x.denominator for x in point))] for point in points], object)
        slack = offsets * scale - np.frompyfunc(int, 1, 1)(points * scale) @ normals.T
        inside = (slack >= 0).all(axis=1)
        if margin:
            inside &= (slack * slack >= (margin * scale) ** 2 * (normals * normals).sum(axis=1)).all(axis=1)
        return inside

    @cached_property
    def facets(self) -> tuple[Exact, Exact]:
        """Normals (k, 3), outward, and offsets (k,), integers, of the planes of a hull's triangles in its own frame.

        What is below all of them is inside of the hull of the vertices: the triangles close, so their surface winds
        about a point that is on the inner side of each, and no plane can then separate the point from their corners.
        Points on some triangles are limits of such points, because the mean of the vertices is one. Triangles without
        area lie on the edges of others. The converse is not said: a hull may be larger than its facets.
        """
        assert isinstance(self.shape, Hull)
        vertices, triangles = exact(self.shape.corners), self.shape.triangles
        a, b, c = (vertices[corner] for corner in triangles.T)
        normals = cross(b - a, c - a)
        solid = np.array([any(normal) for normal in normals])
        normals, offsets = normals[solid], (normals * a).sum(axis=1)[solid]
        mean = vertices.sum(axis=0) / Fraction(len(vertices))
        if not is_closed(triangles) or any(normals @ mean >= offsets):
            raise ValueError("triangles of a hull must be a closed surface around the mean of its corners")
        rows = np.array(sorted({primitive(row) for row in np.column_stack([normals, offsets])}), object)
        return rows[:, :3], rows[:, 3]
