"""Spheres."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from overlapper._core import Sphere
from overlapper.rational import Exact, exact
from overlapper.shapes.blocks import ball_block, up
from overlapper.shapes.choices import Round
from overlapper.shapes.drawing import Tessellation, capped
from overlapper.shapes.exits import in_units, out_of_ball
from overlapper.shapes.facts import Block, FclModel, Floats


class SphereFacts(Round):
    name = "a sphere"
    isotropic = True
    has_blocks = True
    has_exits = True
    bullet_margin = False
    half_axes = None

    def __init__(self, shape: Sphere) -> None:
        self.shape = shape
        self.rounding = shape.radius

    def parameters(self) -> list[float | Floats]:
        return [self.shape.radius]

    def words(self) -> tuple[str, str, int]:
        return "sphere", f"radius {self.shape.radius:.4g}", 0

    def tessellation(self) -> Tessellation:
        return capped(self.shape.radius, 0.0)

    def ball(self) -> tuple[Floats, float]:
        return np.zeros(3), self.shape.radius

    def fcl(self) -> FclModel:
        return "Sphere", (self.shape.radius,)

    def core_tip(self, direction: Floats) -> Floats:
        return np.zeros(3)

    def support(self, direction: Exact, scale: int) -> tuple[Fraction, Fraction]:
        return Fraction(0), Fraction(self.shape.radius) ** 2 * Fraction(direction @ direction, scale * scale)

    def holds(self, points: Exact, scale: int, margin: Fraction | int) -> NDArray[np.bool_]:
        room = (Fraction(self.shape.radius) - margin) * scale
        return np.asarray(((points * points).sum(axis=1) <= math.floor(room * room)) & (room >= 0), bool)

    def tightest(self, point: Exact) -> Exact:
        normal: Exact = exact(outward(point.astype(float)))
        return normal

    def exits(self, start: Exact, arms: Exact, scale: int, fine: int) -> Exact:
        (radius,), grow = in_units(scale, self.shape.radius)
        return out_of_ball(grow * start[None], grow * arms, radius, fine)

    def blocks(self) -> list[Block]:
        return [ball_block(up(0), self.shape.radius)]


def outward(arm: Floats) -> Floats:
    """The direction from the centre to a point at `arm`; along x if the point is the centre."""
    return arm if arm.any() else np.array([1.0, 0.0, 0.0])
