"""A cone: the one file that a new kind of shape needs in Python."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from overlapper.rational import exact, root
from overlapper.shapes.choices import Round
from overlapper.shapes.drawing import revolved


class ConeFacts(Round):
    """A cone about z, from a disc of `radius` at -length / 2 to its tip at length / 2."""

    name = "a cone"
    isotropic = False
    has_blocks = False
    has_exits = True
    bullet_margin = False
    rounding = 0.0
    half_axes = None

    def __init__(self, shape):
        self.radius, self.length = shape.radius, shape.length
        self._r, self._half = Fraction(shape.radius), Fraction(shape.length) / 2

    def parameters(self):
        return [self.radius, self.length]

    def words(self):
        return "cone", f"radius {self.radius:.4g}, length {self.length:.4g}", 0

    def tessellation(self):
        down, up = -math.pi / 2, math.atan2(self.radius, self.length)
        heights = self.length / 2 * np.array([-1, -1, -1, 1])
        return revolved(self.radius * np.array([0, 1, 1, 0]), heights, np.array([down, down, up, up]), (1,), (1,))

    def ball(self):
        return np.zeros(3), math.hypot(self.radius, self.length / 2)

    def fcl(self):
        return "Cone", (self.radius, self.length)

    def core_tip(self, direction):
        x, y, z = direction
        across = math.hypot(x, y)
        if self.radius * across <= self.length * z:
            return np.array([0.0, 0.0, self.length / 2])
        rim = self.radius / across if across else 0.0
        return np.array([rim * x, rim * y, -self.length / 2])

    def support(self, direction, scale):
        x, y, z = direction
        square, tip = self._r**2 * (x * x + y * y), self._half * z
        if z > 0 and square <= (2 * tip) ** 2:
            return tip / scale, Fraction(0)
        return -tip / scale, square / scale**2

    def holds(self, points, scale, margin):
        x, y, z = points.T
        slant = root(4 * self._half**2 + self._r**2)[1]
        rest = self._r * (self._half * scale - z) - margin * slant * scale
        above = z >= (margin - self._half) * scale
        return np.asarray(above & (rest >= 0) & (4 * self._half**2 * (x * x + y * y) <= rest * rest), bool)

    def tightest(self, point):
        x, y, z = point.astype(float)
        across = math.hypot(x, y)
        below = -z - self.length / 2
        beside = (self.length * across + self.radius * (z - self.length / 2)) / math.hypot(self.radius, self.length)
        if below > beside:
            return exact([0.0, 0.0, -1.0])
        if self.radius * across <= self.length * (z - self.length / 2) and across > 0:
            return exact([x, y, z - self.length / 2])
        outward = (x / across, y / across) if across else (1.0, 0.0)
        return exact([self.length * outward[0], self.length * outward[1], self.radius])

    def exits(self, start, arms, scale, fine):
        """By halving: the ray is inside up to its exit."""
        shares = np.zeros(len(arms), object)
        for bit in reversed(range(fine + 1)):
            further = shares + (1 << bit)
            inside = self.holds((start[None] << fine) + further[:, None] * arms, scale << fine, 0)
            shares = np.where(inside, further, shares)
        return shares

    def blocks(self):
        raise TypeError("a cone is not made of balls and cylinders")
