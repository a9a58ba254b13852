"""Rounded hulls: a core, prisms on its facets, wedges of cylinders on its edges, wedges of balls at its corners."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from overlapper._core import Hull, RoundedHull
from overlapper.rational import Exact, cross, exact, in_doubles
from overlapper.shapes.blocks import ball_block
from overlapper.shapes.choices import Round
from overlapper.shapes.drawing import Tessellation
from overlapper.shapes.facts import Block, Floats
from overlapper.shapes.hull import HullFacts, Row

# The number of bits after the point to which the height of a prism is computed.
PRISM = 320
Edge = tuple[int, int]


class RoundedHullFacts(Round):
    name = "a rounded hull"
    isotropic = False
    has_blocks = True
    has_exits = False
    bullet_margin = False
    half_axes = None

    def __init__(self, shape: RoundedHull) -> None:
        self.core = HullFacts(shape.core)
        self.rounding = shape.radius

    def parameters(self) -> list[float | Floats]:
        return [*self.core.parameters(), self.rounding]

    def words(self) -> tuple[str, str, int]:
        kind, size, corners = self.core.words()
        return kind, f"{size}, rounded by {self.rounding:.4g}", corners

    def tessellation(self) -> Tessellation:
        """A tessellation with bevelled edges: the hull of the facets, each moved outwards by the radius."""
        core = self.core.shape
        outward = [core.vertices[ring] + self.rounding * plane[:3] for ring, plane in zip(core.facets, core.halfspaces)]
        return HullFacts(Hull(np.concatenate(outward))).tessellation()

    def ball(self) -> tuple[Floats, float]:
        centre, radius = self.core.ball()
        return centre, radius + self.rounding

    def fcl(self) -> str:
        return "FCL has no rounded hulls."

    def core_tip(self, direction: Floats) -> Floats:
        return self.core.core_tip(direction)

    def support(self, direction: Exact, scale: int) -> tuple[Fraction, Fraction]:
        tip, _ = self.core.support(direction, scale)
        return tip, Fraction(self.rounding) ** 2 * Fraction(direction @ direction, scale * scale)

    def holds(self, points: Exact, scale: int, margin: Fraction | int) -> NDArray[np.bool_]:
        """A point on the surface may count as outside: the nearest point of the core is only known up to rounding."""
        room = Fraction(self.rounding) - margin
        inside = self.core.holds(points, scale, max(-room, Fraction(0)))
        for i in np.flatnonzero(~inside) if room >= 0 else ():
            arm = points[i] - scale * self.core.nearest(in_doubles(points[i], scale))
            inside[i] = arm @ arm <= (room * scale) ** 2
        return inside

    def tightest(self, point: Exact) -> Exact:
        local, halfspaces = point.astype(float), self.core.shape.halfspaces
        above = halfspaces[:, :3] @ local + halfspaces[:, 3]
        outward = halfspaces[above.argmax(), :3]
        if above.max() > 0.0:
            arm = local - self.core.nearest(local).astype(float)
            outward = arm if arm.any() else outward
        normal: Exact = exact(outward)
        return normal

    def exits(self, start: Exact, arms: Exact, scale: int, fine: int) -> Exact:
        raise TypeError("the exact points where rays leave a rounded hull are not known")

    def blocks(self) -> list[Block]:
        core = self.core.blocks()
        if self.rounding == 0.0:
            return core
        sides = self._sides()
        prisms = [self._prism(plane, edges) for plane, edges in sides.items()]
        return [*core, *prisms, *self._wedges(sides), *self._caps(sides)]

    def _sides(self) -> dict[Row, list[Edge]]:
        """For each plane, the edges around its triangles. A triangle without area joins the one at its long side."""
        owner: dict[Edge, Row] = {}
        thin = []
        for triangle, plane in zip(self.core.shape.triangles.tolist(), self.core.plane_of_triangle):
            edges = [(triangle[i - 1], triangle[i]) for i in range(3)]
            if plane:
                owner.update((edge, plane) for edge in edges)
            else:
                thin.append(edges)
        while thin:
            left = []
            for edges in thin:
                p, q = max(edges, key=self._square)
                if (q, p) in owner:
                    owner.update((edge, owner[q, p]) for edge in edges)
                else:
                    left.append(edges)
            if len(left) == len(thin):
                raise ValueError("a hull has no certificate if its triangles have no area")
            thin = left
        sides: dict[Row, list[Edge]] = {tuple(row): [] for row in self.core.planes.rows}
        for (p, q), plane in owner.items():
            if owner[q, p] != plane:
                sides[plane].append((p, q))
        return sides

    def _along(self, edge: Edge) -> Exact:
        """The vector along an edge, in units of the corners."""
        corners, _ = self.core.corners
        along: Exact = corners[edge[1]] - corners[edge[0]]
        return along

    def _square(self, edge: Edge) -> int:
        along = self._along(edge)
        return int(along @ along)

    @cached_property
    def _points(self) -> Exact:
        """(n, 3) corners of the core."""
        corners, unit = self.core.corners
        points: Exact = corners * Fraction(1, unit)
        return points

    def _plane(self, normal: Exact, corner: int) -> tuple[Exact, Fraction]:
        """The plane with this normal through a corner."""
        corners, unit = self.core.corners
        return normal, Fraction(normal @ corners[corner], unit)

    def _prism(self, plane: Row, edges: Sequence[Edge]) -> Block:
        normal, offset = np.array(plane[:3], object), plane[3]
        square = int(normal @ normal)
        rise, is_exact = _root_below(square * Fraction(self.rounding) ** 2)
        planes = [(normal, offset + rise), (-normal, Fraction(-offset))]
        outward = cross(np.array([self._along(edge) for edge in edges]), normal)
        planes += [self._plane(wall, p) for wall, (p, _) in zip(outward, edges)]
        ring = self._points[sorted({p for edge in edges for p in edge})]
        spine = np.vstack([ring, ring + normal * (rise / square)])
        area = Fraction(float(np.linalg.norm(np.ptp(ring.astype(float), axis=0))) * (1.0 + 2.0**-40)) ** 2
        # At most the share 2^-PRISM of the height is lost.
        lost = Fraction(0) if is_exact else area * Fraction(self.rounding) / 2**PRISM
        return Block(planes, spine, lost=lost)

    def _wedges(self, sides: dict[Row, list[Edge]]) -> list[Block]:
        plane_at = {edge: plane for plane, edges in sides.items() for edge in edges}
        once = [(p, q) for p, q in plane_at if p < q]
        alongs = np.array([self._along(edge) for edge in once])
        left = np.array([plane_at[edge][:3] for edge in once], object)
        right = np.array([plane_at[q, p][:3] for p, q in once], object)
        # Seen along the edge, the first facet is on the left. The wedge is therefore on the right of its normal.
        walls = zip(cross(left, alongs), cross(alongs, right))
        found = []
        for (p, q), along, (one, other) in zip(once, alongs, walls):
            planes = [self._plane(one, p), self._plane(other, p), self._plane(along, q), self._plane(-along, p)]
            ends = self._points[[p, q]]
            found.append(Block(planes, ends, self.rounding, ends[0], along))
        return found

    def _caps(self, sides: dict[Row, list[Edge]]) -> list[Block]:
        from_corner: dict[int, list[Edge]] = {}
        for edges in sides.values():
            for edge in edges:
                from_corner.setdefault(edge[0], []).append(edge)
        return [
            ball_block(self._points[p], self.rounding, [self._plane(self._along(edge), p) for edge in edges])
            for p, edges in from_corner.items()
        ]


def _root_below(square: Fraction) -> tuple[Fraction, bool]:
    """A lower bound of the square root, less by at most 2^-PRISM of it, and whether the bound is exact."""
    p, q = square.numerator, square.denominator
    shift = max(0, PRISM + (q.bit_length() - p.bit_length()) // 2 + 1)
    floor = math.isqrt((p << 2 * shift) // q)
    found = Fraction(floor, 1 << shift)
    return found, found * found == square
