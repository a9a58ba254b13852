"""A convex polytope cut by planes in rational arithmetic, so that no degeneracy is a special case.

A point is a row of integers (x, y, z, w), w > 0, and stands for (x, y, z) / w. A plane is a row of integers
(a, b, c, d) and stands for the half-space a x + b y + c z + d <= 0.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np
from numpy.typing import NDArray

from overlapper.rational import DOUBT, UNDERFLOW, Exact, bits, in_doubles, primitive

BORDER = -1
SIDES = ((0, 2, 6, 4), (1, 5, 7, 3), (0, 4, 5, 1), (2, 3, 7, 6), (0, 1, 3, 2), (4, 6, 7, 5))


class ClippedPolytope:
    """At first a box (2, 3) whose sides have the label BORDER. Every cut that removes something adds a facet."""

    def __init__(self, box: Exact) -> None:
        self.points = [primitive([*corner, Fraction(1)]) for corner in product(*box.T)]
        self._facets: dict[int, tuple[list[int], int]] = {}  # ring and label
        self._around: dict[int, set[int]] = {}  # the facets of every point in use
        self._made = 0
        for side in SIDES:
            self._add([*side], BORDER)

    @property
    def rings(self) -> list[list[int]]:
        return [ring for ring, _ in self._facets.values()]

    @property
    def labels(self) -> list[int]:
        return [label for _, label in self._facets.values()]

    def used(self) -> list[int]:
        return sorted(self._around)

    def reaches_past(self, planes: Exact) -> NDArray[np.bool_]:
        """Which of the planes (k, 4) would remove something. Doubles decide most of them."""
        corners = np.array([self.points[point] for point in self.used()], object)
        a, b = (np.array([in_doubles(row, 1 << bits(row)) for row in rows]) for rows in (planes, corners))
        value, doubt = a @ b.T, DOUBT * (abs(a) @ abs(b).T) + UNDERFLOW
        past: NDArray[np.bool_] = (value > doubt).any(axis=1)
        for plane in np.flatnonzero(~past):
            near = corners[value[plane] >= -doubt[plane]]
            past[plane] = len(near) > 0 and bool((near @ planes[plane] > 0).any())
        return past

    def cut(self, plane: tuple[int, ...], label: int) -> None:
        """Removes everything beyond the plane. No ring is left if no point is strictly below the plane."""
        if not self._around:
            return
        used = [*self._around]
        side = dict(zip(used, np.array([self.points[p] for p in used], object) @ np.array(plane, object)))
        beyond = [p for p in used if side[p] > 0]
        if not beyond:
            return
        if min(side.values()) >= 0:
            self._facets, self._around = {}, {}
            return
        crossings: dict[tuple[int, int], int] = {}
        leads: dict[int, int] = {}
        for facet in sorted({facet for p in beyond for facet in self._around[p]}):
            ring, owner = self._remove(facet)
            clipped, leaves, returns = self._clip(ring, side, crossings)
            if leaves != returns:
                leads[returns] = leaves
            if len(clipped) > 2:
                self._add(clipped, owner)
        ring = [next(iter(leads))]
        while leads[ring[-1]] != ring[0]:
            ring.append(leads[ring[-1]])
        self._add(ring, label)

    def _add(self, ring: list[int], label: int) -> None:
        self._facets[self._made] = ring, label
        for point in ring:
            self._around.setdefault(point, set()).add(self._made)
        self._made += 1

    def _remove(self, facet: int) -> tuple[list[int], int]:
        ring, label = self._facets.pop(facet)
        for point in ring:
            self._around[point].discard(facet)
            if not self._around[point]:
                del self._around[point]
        return ring, label

    def _clip(
        self, ring: list[int], side: dict[int, int], crossings: dict[tuple[int, int], int]
    ) -> tuple[list[int], int, int]:
        """The rest of a polygon, and the points at which its ring leaves through the plane and returns; or -1, -1."""
        clipped, leaves, returns = [], -1, -1
        for p, q in zip(ring, ring[1:] + ring[:1]):
            if side[p] <= 0:
                clipped.append(p)
            if side[p] * side[q] < 0:
                clipped.append(self._crossing(p, q, side, crossings))
            if side[p] <= 0 < side[q]:
                leaves = clipped[-1]
            elif side[q] <= 0 < side[p]:
                returns = clipped[-1] if side[q] < 0 else q
        return clipped, leaves, returns

    def _crossing(self, p: int, q: int, side: dict[int, int], crossings: dict[tuple[int, int], int]) -> int:
        edge = (min(p, q), max(p, q))
        if edge not in crossings:
            crossings[edge] = len(self.points)
            s, t = abs(side[q]), abs(side[p])
            self.points.append(primitive([Fraction(s * x + t * y) for x, y in zip(self.points[p], self.points[q])]))
        return crossings[edge]
