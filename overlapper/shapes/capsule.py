"""Capsules."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from overlapper._core import Capsule
from overlapper.rational import Exact, exact
from overlapper.shapes.blocks import ball_block, tube_block, up
from overlapper.shapes.choices import Round
from overlapper.shapes.drawing import Tessellation, capped
from overlapper.shapes.exits import in_units, out_of_ball
from overlapper.shapes.facts import Block, FclModel, Floats
from overlapper.shapes.sphere import outward


class CapsuleFacts(Round):
    name = "a capsule"
    isotropic = False
    has_blocks = True
    has_exits = True
    bullet_margin = False
    half_axes = None

    def __init__(self, shape: Capsule) -> None:
        self.shape = shape
        self.rounding = shape.radius

    def parameters(self) -> list[float | Floats]:
        return [self.shape.radius, self.shape.length]

    def words(self) -> tuple[str, str, int]:
        return "capsule", f"radius {self.shape.radius:.4g}, length {self.shape.length:.4g}", 0

    def tessellation(self) -> Tessellation:
        return capped(self.shape.radius, self.shape.length / 2)

    def ball(self) -> tuple[Floats, float]:
        return np.zeros(3), self.shape.radius + self.shape.length / 2

    def fcl(self) -> FclModel:
        return "Capsule", (self.shape.radius, self.shape.length)

    def core_tip(self, direction: Floats) -> Floats:
        return np.array([0.0, 0.0, math.copysign(self.shape.length / 2, direction[2])])

    def support(self, direction: Exact, scale: int) -> tuple[Fraction, Fraction]:
        tip = Fraction(self.shape.length) / 2 * Fraction(abs(direction[2]), scale)
        return tip, Fraction(self.shape.radius) ** 2 * Fraction(direction @ direction, scale * scale)

    def holds(self, points: Exact, scale: int, margin: Fraction | int) -> NDArray[np.bool_]:
        x, y, z = points.T
        # Twice the length beyond the ends, times the denominator of the length, so that it is an integer.
        length = Fraction(self.shape.length)
        past = np.maximum(2 * length.denominator * abs(z) - length.numerator * scale, 0)
        own = (2 * length.denominator) ** 2
        room = (Fraction(self.shape.radius) - margin) * scale
        inside = (own * (x * x + y * y) + past * past <= math.floor(own * room * room)) & (room >= 0)
        return np.asarray(inside, bool)

    def tightest(self, point: Exact) -> Exact:
        x, y, z = point.astype(float)
        half = self.shape.length / 2
        normal: Exact = exact(outward(np.array([x, y, z - max(-half, min(z, half))])))
        return normal

    def exits(self, start: Exact, arms: Exact, scale: int, fine: int) -> Exact:
        """Rays leave through the side if they meet it between the ends, else through the cap ahead."""
        (radius, half), grow = in_units(scale, self.shape.radius, self.shape.length / 2)
        arms, starts = grow * arms, np.repeat(grow * start[None], len(arms), axis=0)
        shares, past = np.zeros(len(arms), object), arms[:, 2] << fine
        across = (arms[:, :2] != 0).any(axis=1)
        shares[across] = out_of_ball(starts[across, :2], arms[across, :2], radius, fine)
        past[across] = (starts[across, 2] << fine) + shares[across] * arms[across, 2]
        cap = ~across | (abs(past) > half << fine)
        starts[:, 2] -= np.array([half if z > 0 else -half for z in past], object)
        shares[cap] = out_of_ball(starts[cap], arms[cap], radius, fine)
        return shares

    def blocks(self) -> list[Block]:
        half = Fraction(self.shape.length) / 2
        tube = [tube_block(self.shape.radius, half)] if half else []
        return tube + [ball_block(up(side * half), self.shape.radius, [(up(-side), -half)]) for side in (-1, 1)]
