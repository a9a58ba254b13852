"""Placed shapes in rational arithmetic. Every double is a rational number, so its value can be taken exactly.

Only the numbers that define a shape are used: radii, lengths, half extents, corners of hulls, given normals and
offsets, position, quaternion. A quaternion of any length stands for the exact rotation by its direction.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from overlapper import Placed
from overlapper.rational import Exact, exact, integers, rotation
from overlapper.shapes.table import facts


class RationalBody:
    """A placed shape exactly as its numbers define it. All points and directions are in the world frame."""

    def __init__(self, placed: Placed) -> None:
        self.facts = facts(placed.shape)
        self.position: Exact = exact(placed.position)
        self.axes = rotation(placed.given_orientation)
        self._turn = integers(self.axes)

    def support(self, direction: Exact) -> tuple[Fraction, Fraction] | None:
        """(flat, square): flat + sqrt(square) is the greatest direction . x on the body; None if there is none."""
        numbers, scale = integers(direction)
        found = self.facts.support(numbers @ self._turn[0], scale * self._turn[1])
        return found and (direction @ self.position + found[0], found[1])

    def is_below(self, direction: Exact, offset: Fraction) -> bool:
        """Whether the body lies in { x : direction . x <= offset }. Squares are compared, so no root is needed."""
        support = self.support(direction)
        return support is not None and support[0] <= offset and support[1] <= (offset - support[0]) ** 2

    def contains(self, points: Exact, margin: Fraction | int = 0, scale: int = 1) -> NDArray[np.bool_]:
        """Whether the body holds a ball of radius `margin` about each of the points (n, 3) / scale.

        True is proved. False may be returned for a ball that just fits (see `Facts.holds`).
        """
        numbers, unit = integers(np.vstack([points, scale * self.position]))
        local = (numbers[:-1] - numbers[-1]) @ self._turn[0]
        return self.facts.holds(local, scale * unit * self._turn[1], margin)

    def facing(self, normal: NDArray[np.float64]) -> Exact:
        """The exact normal of the flat side whose rounded unit normal is given; for a round body, `normal` itself."""
        if self.facts.planes is None:
            same: Exact = exact(normal)
            return same
        direction: Exact = self.axes @ self.facts.planes.facing(self.axes.astype(float).T @ normal)
        return direction

    def tightest(self, point: Exact) -> Exact:
        """The normal of the plane of the body above which a point is highest."""
        normal: Exact = self.axes @ self.facts.tightest((point - self.position) @ self.axes)
        return normal

    def exits(self, start: Exact, arms: Exact, fine: int) -> Exact:
        """The greatest shares (n,) of `arms` (n, 3) that stay in the body from `start`, a point inside.

        The shares are at most 1, in units of 2^-fine and rounded down.
        """
        numbers, unit = integers(np.vstack([arms, start - self.position]))
        local = numbers @ self._turn[0]
        shares = self.facts.exits(local[-1], local[:-1], unit * self._turn[1], fine)
        return np.asarray(np.minimum(shares, 1 << fine))
