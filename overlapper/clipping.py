"""A convex polytope cut by planes in rational arithmetic, so that no degeneracy is a special case.

A point is a row of integers (x, y, z, w), w > 0, and stands for (x, y, z) / w. A plane is a row of integers
(a, b, c, d) and stands for the half-space a x + b y + c z + d <= 0.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np

from overlapper.rational import Exact, primitive

BORDER = -1
SIDES = ((0, 2, 6, 4), (1, 5, 7, 3), (0, 4, 5, 1), (2, 3, 7, 6), (0, 1, 3, 2), (4, 6, 7, 5))


class ClippedPolytope:
    """Begins as a box (2, 3) whose sides have the label BORDER; every cut that removes something adds a facet."""

    def __init__(self, box: Exact) -> None:
        self.points = [primitive([*corner, Fraction(1)]) for corner in product(*box.T)]
        self.rings: list[list[int]] = [list(side) for side in SIDES]
        self.labels = [BORDER] * len(SIDES)

    def used(self) -> list[int]:
        return sorted({point for ring in self.rings for point in ring})

    def reaches_past(self, planes: Exact) -> Exact:
        """Which of the planes (k, 4) would remove something."""
        corners = np.array([self.points[point] for point in self.used()], object)
        past: Exact = (planes @ corners.T > 0).any(axis=1)
        return past

    def cut(self, plane: tuple[int, ...], label: int) -> None:
        """Removes what is beyond the plane. Nothing is left, not even rings, if no point is strictly below it."""
        side = {p: sum(a * x for a, x in zip(plane, self.points[p])) for p in self.used()}
        if max(side.values()) <= 0:
            return
        if min(side.values()) >= 0:
            self.rings, self.labels = [], []
            return
        crossings: dict[tuple[int, int], int] = {}
        kept, labels, leads = [], [], {}
        for ring, owner in zip(self.rings, self.labels):
            clipped, leaves, returns = self._clip(ring, side, crossings)
            if leaves != returns:
                leads[returns] = leaves
            if len(clipped) > 2:
                kept.append(clipped)
                labels.append(owner)
        facet = [next(iter(leads))]
        while leads[facet[-1]] != facet[0]:
            facet.append(leads[facet[-1]])
        self.rings, self.labels = [*kept, facet], [*labels, label]

    def _clip(
        self, ring: list[int], side: dict[int, int], crossings: dict[tuple[int, int], int]
    ) -> tuple[list[int], int, int]:
        """What is left of a polygon, and the points at which it leaves through the plane and returns; or -1, -1."""
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
