"""Cylinders."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from overlapper._core import Cylinder
from overlapper.rational import Exact, exact
from overlapper.shapes.blocks import tube_block
from overlapper.shapes.choices import Round
from overlapper.shapes.drawing import Tessellation, revolved
from overlapper.shapes.exits import in_units, out_of_ball, share_to_plane
from overlapper.shapes.facts import Block, FclModel, Floats
from overlapper.shapes.sphere import outward


class CylinderFacts(Round):
    name = "a cylinder"
    isotropic = False
    has_blocks = True
    has_exits = True
    bullet_margin = False
    rounding = 0.0
    half_axes = None

    def __init__(self, shape: Cylinder) -> None:
        self.shape = shape

    def parameters(self) -> list[float | Floats]:
        return [self.shape.radius, self.shape.length]

    def words(self) -> tuple[str, str, int]:
        return "cylinder", f"radius {self.shape.radius:.4g}, length {self.shape.length:.4g}", 0

    def tessellation(self) -> Tessellation:
        half = self.shape.length / 2
        slopes = np.deg2rad([-90, -90, 0, 0, 90, 90])
        radii, rims = self.shape.radius * np.array([0, 1, 1, 1, 1, 0]), (1, 4)
        return revolved(radii, np.repeat([-half, half], 3), slopes, rims, rims)

    def ball(self) -> tuple[Floats, float]:
        return np.zeros(3), math.hypot(self.shape.radius, self.shape.length / 2)

    def fcl(self) -> FclModel:
        return "Cylinder", (self.shape.radius, self.shape.length)

    def core_tip(self, direction: Floats) -> Floats:
        tip = np.array([0.0, 0.0, math.copysign(1.0, direction[2])])
        radial = np.array([direction[0], direction[1], 0.0])
        farthest: Floats = self.shape.length / 2 * tip + self.shape.radius * radial / (np.linalg.norm(radial) or 1.0)
        return farthest

    def support(self, direction: Exact, scale: int) -> tuple[Fraction, Fraction]:
        x, y, z = direction
        tip = Fraction(self.shape.length) / 2 * Fraction(abs(z), scale)
        return tip, Fraction(self.shape.radius) ** 2 * Fraction(x * x + y * y, scale * scale)

    def holds(self, points: Exact, scale: int, margin: Fraction | int) -> NDArray[np.bool_]:
        x, y, z = points.T
        between = abs(z) <= math.floor((Fraction(self.shape.length) / 2 - margin) * scale)
        room = (Fraction(self.shape.radius) - margin) * scale
        return np.asarray(between & (x * x + y * y <= math.floor(room * room)) & (room >= 0), bool)

    def tightest(self, point: Exact) -> Exact:
        x, y, z = point.astype(float)
        if abs(z) - self.shape.length / 2 >= math.hypot(x, y) - self.shape.radius:
            normal: Exact = exact([0.0, 0.0, math.copysign(1.0, z)])
        else:
            normal = exact(outward(np.array([x, y, 0.0])))
        return normal

    def exits(self, start: Exact, arms: Exact, scale: int, fine: int) -> Exact:
        (radius, half), grow = in_units(scale, self.shape.radius, self.shape.length / 2)
        start, arms = grow * start, grow * arms
        ends = [share_to_plane(half - start[2] if z > 0 else half + start[2], abs(z), fine) for z in arms[:, 2]]
        shares = np.array(ends, object)
        across = (arms[:, :2] != 0).any(axis=1)
        shares[across] = np.minimum(shares[across], out_of_ball(start[None, :2], arms[across, :2], radius, fine))
        return shares

    def blocks(self) -> list[Block]:
        return [tube_block(self.shape.radius, Fraction(self.shape.length) / 2)]
