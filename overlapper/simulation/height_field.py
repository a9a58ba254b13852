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
        columns, rows = self.heights.shape
        j, i = divmod(number // 2, rows - 1)
        cut = [(i, j), (i + 1, j + 1)] if self.rising else [(i + 1, j), (i, j + 1)]
        corners = [*cut, (i + (number % 2 != self.rising), j + number % 2)]
        flat = [((u - (rows - 1) / 2) * self.spacing[0], (v - (columns - 1) / 2) * self.spacing[1]) for u, v in corners]
        tops = [self.heights[v, u] for u, v in corners]
        return Hull([(*at, z) for at, top in zip(flat, tops) for z in (top, self.base)])
