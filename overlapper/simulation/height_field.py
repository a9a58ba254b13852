"""Height fields: a grid of heights with two triangles per cell, and solid ground below them, down to a flat base."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overlapper import Hull

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class HeightField:
    """The ground under a grid of heights, in the frame of its shape.

    `heights` (c, r) in m are those at x = (i - (r - 1) / 2) * spacing[0], y = (j - (c - 1) / 2) * spacing[1] for row j
    and column i of the array. Each cell is cut into two triangles, from its corner at i + 1 to its corner at j + 1, or
    with `rising` from its corner (i, j) to its corner (i + 1, j + 1). The triangles of the cell (i, j) have the numbers
    n = 2 * (j * (r - 1) + i) and n + 1. The bottom of the ground is at z = `base`, m.
    """

    heights: Array
    spacing: tuple[float, float]
    base: float
    rising: bool = False
    middle: float = 0.0
    """The height that the simulator has subtracted from the given heights, m."""

    @property
    def count(self) -> int:
        """The number of triangles."""
        columns, rows = self.heights.shape
        return int(2 * (columns - 1) * (rows - 1))

    def under(self, lower: Array, upper: Array) -> Numbers:
        """The numbers of the triangles whose ground a box may meet; `lower` and `upper` are corners of the box."""
        columns, rows = self.heights.shape
        if lower[2] > self.heights.max():
            return np.empty(0, dtype=np.int64)
        spans = []
        for axis, cells in ((0, rows - 1), (1, columns - 1)):
            first, last = (np.floor(at / self.spacing[axis] + cells / 2) for at in (lower[axis], upper[axis]))
            spans.append(np.arange(max(first, 0), min(last, cells - 1) + 1, dtype=np.int64))
        j, i = np.meshgrid(spans[1], spans[0], indexing="ij")
        tops = np.max([self.heights[j + v, i + u] for u in (0, 1) for v in (0, 1)], axis=0)
        cells_met = (j * (rows - 1) + i)[tops >= lower[2]]
        return np.concatenate([2 * cells_met, 2 * cells_met + 1])

    def prism(self, number: int) -> Hull:
        """The ground below a triangle, down to the base."""
        return Hull([(x, y, height) for x, y, z in self._triangle(number) for height in (z, self.base)])

    def top(self, number: int) -> tuple[float, float, float]:
        """The upward unit normal of a triangle. It is 0 at the border, where a wall of the prism is free, too."""
        columns, rows = self.heights.shape
        corners = self._corners(number)
        for at, last in zip(zip(*corners), (rows - 1, columns - 1)):
            if at.count(0) == 2 or at.count(last) == 2:
                return 0.0, 0.0, 0.0
        first, second, third = np.array(self._triangle(number))
        normal = np.cross(second - first, third - first)
        x, y, z = (normal / np.copysign(np.linalg.norm(normal), normal[2])).tolist()
        return x, y, z

    def _corners(self, number: int) -> list[tuple[int, int]]:
        """The columns and rows of the corners of a triangle."""
        j, i = divmod(number // 2, self.heights.shape[1] - 1)
        cut = [(i, j), (i + 1, j + 1)] if self.rising else [(i + 1, j), (i, j + 1)]
        return [*cut, (i + (number % 2 != self.rising), j + number % 2)]

    def _triangle(self, number: int) -> list[tuple[float, float, float]]:
        """The corners of a triangle, m."""
        columns, rows = self.heights.shape
        return [
            (
                (u - (rows - 1) / 2) * self.spacing[0],
                (v - (columns - 1) / 2) * self.spacing[1],
                float(self.heights[v, u]),
            )
            for u, v in self._corners(number)
        ]
