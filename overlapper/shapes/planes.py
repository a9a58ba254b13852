"""The exact planes of the flat sides of a shape: which points are below them, and where rays meet them."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from overlapper.rational import DOUBT, UNDERFLOW, Exact, bits, in_doubles, integers
from overlapper.shapes.exits import share_to_plane

Floats = NDArray[np.float64]

AXES: Exact = np.array([[Fraction(int(i == j)) for j in range(3)] for i in range(3)])


class Planes:
    """{ x : normals @ x <= offsets }. Normals (k, 3) point outward; `rows` (k, 4) are integers, both times a factor.

    Doubles select a few candidates, and exact numbers choose among them.
    """

    def __init__(self, rows: Exact, factors: Exact) -> None:
        self.rows = rows
        self._factors = factors

    @classmethod
    def of(cls, normals: Exact, offsets: Exact) -> Planes:
        rows, scales = zip(*(integers([*normal, offset]) for normal, offset in zip(normals, offsets)))
        return cls(np.array(rows, object), np.array([Fraction(1, scale) for scale in scales], object))

    @cached_property
    def normals(self) -> Exact:
        return np.asarray(self.rows[:, :3] * self._factors[:, None])

    @cached_property
    def offsets(self) -> Exact:
        return np.asarray(self.rows[:, 3] * self._factors)

    @cached_property
    def _lengths(self) -> Floats:
        return np.array([math.sqrt(normal @ normal) for normal in self.normals])

    @cached_property
    def units(self) -> Floats:
        """(k, 3) unit normals."""
        return np.array([normal.astype(float) / length for normal, length in zip(self.normals, self._lengths)])

    @cached_property
    def levels(self) -> Floats:
        """(k,) offsets along the unit normals."""
        return np.asarray(self.offsets.astype(float) / self._lengths)

    @cached_property
    def _in_doubles(self) -> tuple[Floats, Floats]:
        doubles = np.array([in_doubles(row, 1 << bits(row)) for row in self.rows])
        return doubles[:, :3], doubles[:, 3]

    def facing(self, normal: Floats) -> Exact:
        """The exact normal that is nearest to a unit vector."""
        nearest: Exact = self.normals[np.linalg.norm(self.units - normal, axis=1).argmin()]
        return nearest

    def tightest(self, point: Exact) -> Exact:
        """The normal of the plane above which a point is highest."""
        x = point.astype(float)
        above = self.units @ x - self.levels
        few = np.flatnonzero(above >= above.max() - 1e-12 * (abs(x).sum() + abs(self.levels).max()))
        exactly = (self.normals[few] @ point - self.offsets[few]).astype(float)
        lengths = np.linalg.norm(self.normals[few].astype(float), axis=1)
        normal: Exact = self.normals[few[(exactly / lengths).argmax()]]
        return normal

    def hold(self, points: Exact, scale: int, margin: Fraction | int) -> NDArray[np.bool_]:
        """Whether the ball of radius `margin` about each of points (n, 3) / scale is below all planes."""
        normals, offsets = self.rows[:, :3], self.rows[:, 3]
        inside = np.ones(len(points), bool)
        for i, point in enumerate(points) if margin else ():
            slack = offsets * scale - normals @ point
            deep = slack * slack >= (margin * scale) ** 2 * (normals * normals).sum(axis=1)
            inside[i] = ((slack >= 0) & deep).all()
        if not margin:
            for some in np.array_split(np.arange(len(points)), 1 + len(points) * len(offsets) // 2**20):
                point, facet = self._not_surely_below(points[some], scale)
                slack = offsets[facet] * scale - (normals[facet] * points[some[point]]).sum(axis=1)
                inside[some[point[slack < 0]]] = False
        return inside

    def _not_surely_below(self, points: Exact, scale: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Pairs of a point and a plane for which doubles, with their rounding, do not prove that the point is below."""
        unit = 1 << max(bits(points), scale.bit_length())
        x, (normals, offsets) = in_doubles(points, unit), self._in_doubles
        level = offsets * (scale / unit)
        slack = level - x @ normals.T
        point, facet = np.nonzero(slack <= DOUBT * (abs(level) + abs(x) @ abs(normals.T)) + UNDERFLOW)
        return point, facet

    def exits(self, start: Exact, arms: Exact, scale: int, fine: int) -> Exact:
        """As `Facts.exits`."""
        slack = self.rows[:, 3] * scale - self.rows[:, :3] @ start
        unit = 1 << bits(arms)
        sizes = [1 << bits(row) for row in self.rows[:, :3]]
        normals = np.array([in_doubles(row, size) for row, size in zip(self.rows[:, :3], sizes)])
        slacks = np.array([x / (unit * size) for x, size in zip(slack, sizes)])
        shares = []
        for arm, x in zip(arms, in_doubles(arms, unit)):
            along, doubt = normals @ x, DOUBT * (abs(normals) @ abs(x)) + UNDERFLOW
            with np.errstate(all="ignore"):
                least = np.where(along + doubt > 0, slacks / (along + doubt), np.inf) * (1 - DOUBT)
                most = np.where(along - doubt > 0, slacks / (along - doubt), np.inf) * (1 + DOUBT)
            few = np.flatnonzero((along + doubt > 0) & (least <= most.min()))
            nearest = (share_to_plane(slack[k], self.rows[k, :3] @ arm, fine) for k in few)
            shares.append(min(nearest, default=1 << fine))
        return np.array(shares, object)
