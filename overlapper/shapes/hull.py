"""Convex hulls, by the corners and triangles of the hull of the given points.

The corners are exact. The triangles are only proposed and are then checked.
"""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cached_property

import numpy as np

from overlapper._core import Hull
from overlapper.rational import (
    DOUBT,
    UNDERFLOW,
    Exact,
    bits,
    cross,
    exact,
    in_doubles,
    integers,
    is_closed,
)
from overlapper.shapes.choices import Flat
from overlapper.shapes.drawing import Tessellation, polyhedron, side_of_polyhedron
from overlapper.shapes.facts import Block, FclModel, Floats
from overlapper.shapes.nearest import nearest_weights
from overlapper.shapes.planes import Planes
from overlapper.shapes.words import times

Row = tuple[int, ...]


class HullFacts(Flat):
    name = "a hull"
    bounded = True
    bullet_margin = True

    def __init__(self, shape: Hull) -> None:
        self.shape = shape

    def parameters(self) -> list[float | Floats]:
        vertices = self.shape.vertices
        return [vertices[np.lexsort(vertices.T[::-1])]]

    def words(self) -> tuple[str, str, int]:
        low, high = self.shape.bounds
        corners = len(self.shape.vertices)
        return "hull", f"{corners} corners in {times(high - low)}", corners

    def tessellation(self) -> Tessellation:
        return polyhedron(self.shape.vertices, self.shape.facets)

    def side(self, towards: Floats) -> tuple[Floats, float, Floats]:
        return side_of_polyhedron(self.shape.vertices, self.shape.facets, towards)

    def ball(self) -> tuple[Floats, float]:
        centre: Floats = self.shape.bounds.mean(axis=0)
        return centre, float(np.linalg.norm(self.shape.corners - centre, axis=1).max())

    def fcl(self) -> FclModel:
        faces = np.concatenate([[len(ring), *ring] for ring in self.shape.facets]).astype(np.int32)
        return "Convex", (self.shape.vertices.tobytes(), faces.tobytes(), len(self.shape.facets))

    def core_tip(self, direction: Floats) -> Floats:
        return np.asarray(self.shape.vertices[np.argmax(self.shape.vertices @ direction)])

    @cached_property
    def corners(self) -> tuple[Exact, int]:
        """Integers (n, 3), and the number to divide them by."""
        return integers(exact(self.shape.corners))

    @cached_property
    def plane_of_triangle(self) -> list[Row | None]:
        """Normal and offset of the plane of each triangle, as the least integers; None for triangles without area."""
        (corners, unit), triangles = self.corners, self.shape.triangles
        a, b, c = (corners.take(corner, axis=0) for corner in triangles.T)  # indexing may crash if memory is short
        normals = cross(b - a, c - a)
        offsets = (normals * a).sum(axis=1)
        solid = np.array([any(normal) for normal in normals])
        total = corners.sum(axis=0)
        if not is_closed(triangles) or any(normals[solid] @ total >= len(corners) * offsets[solid]):
            raise ValueError("triangles of a hull must be a closed surface around the mean of its vertices")
        # The normals are in squared units of the corners, the offsets in cubed units.
        rows = np.column_stack([normals * unit, offsets])
        return [_lowest(row) if has_area else None for row, has_area in zip(rows, solid)]

    @cached_property
    def planes(self) -> Planes:
        """The planes of the triangles.

        A point below all planes of a hull's triangles is inside the hull of the corners. The triangles form a closed
        surface, which winds about every point on the inner side of all triangles. No plane can then separate the point
        from the corners. Points on some triangles are limits of such points, because the mean of the corners is such a
        point. Triangles without area lie on the edges of others. The converse is not claimed: a hull may be larger than
        its facets.
        """
        rows = np.array(sorted({row for row in self.plane_of_triangle if row}), object)
        # The rows are integers of any size; the factors scale them so that doubles do not overflow.
        return Planes(rows, np.array([Fraction(1, 2 ** max(map(int.bit_length, row[:3]))) for row in rows]))

    def support(self, direction: Exact, scale: int) -> tuple[Fraction, Fraction]:
        return Fraction(self._farthest(direction), scale * self.corners[1]), Fraction(0)

    @cached_property
    def _corners_in_doubles(self) -> Floats:
        corners, _ = self.corners
        return in_doubles(corners, 1 << bits(corners))

    def _farthest(self, direction: Exact) -> int:
        """The greatest product with a corner, in integers. Doubles leave only a few candidates."""
        d = in_doubles(direction, 1 << bits(direction))
        along = self._corners_in_doubles @ d
        doubt = DOUBT * (abs(self._corners_in_doubles) @ abs(d)) + UNDERFLOW
        few = np.flatnonzero(along + doubt >= (along - doubt).max())
        return int(max(self.corners[0][few] @ direction))

    def nearest(self, point: Floats) -> Exact:
        """An exact point of the hull that is, up to rounding, the nearest to a point outside."""
        corners, triangles = self.shape.corners, self.shape.triangles
        weights = nearest_weights(corners[triangles] - point)
        near = np.einsum("ki,kij->kj", weights, corners[triangles] - point)
        row = int((near * near).sum(axis=1).argmin())
        shares = exact(weights[row])
        nearest: Exact = shares @ exact(corners[triangles[row]]) / shares.sum()
        return nearest

    def blocks(self) -> list[Block]:
        """The hull itself, if all its corners are below all facets, so that the hull is not larger than its facets."""
        corners, unit = self.corners
        if not self.planes.hold(corners, unit, 0).all():
            raise ValueError("a hull has no certificate if a vertex lies above a facet")
        return [Block([(row[:3], row[3]) for row in self.planes.rows], corners * Fraction(1, unit))]


def _lowest(row: Exact) -> Row:
    divisor = math.gcd(*row)
    return tuple(x // divisor for x in row)
