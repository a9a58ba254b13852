"""Half-spaces."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cached_property

import numpy as np

from overlapper._core import HalfSpace
from overlapper.rational import Exact, cross, exact
from overlapper.shapes.choices import Flat
from overlapper.shapes.drawing import Tessellation
from overlapper.shapes.facts import Block, FclModel, Floats
from overlapper.shapes.planes import Planes


class HalfSpaceFacts(Flat):
    name = "a half-space"
    bounded = False
    bullet_margin = False

    def __init__(self, shape: HalfSpace) -> None:
        self.shape = shape

    @cached_property
    def planes(self) -> Planes:
        """The plane as given, without rounding."""
        return Planes.of(exact(self.shape.given_normal)[None], exact([self.shape.given_offset]))

    def parameters(self) -> list[float | Floats]:
        return [self.shape.normal, self.shape.offset]

    def words(self) -> tuple[str, str, int]:
        return "plane", f"normal {', '.join(f'{x:.4g}' for x in self.shape.normal)}", 0

    def tessellation(self) -> Tessellation:
        raise TypeError("a half-space has no bounded surface to draw")

    def side(self, towards: Floats) -> tuple[Floats, float, Floats]:
        return np.asarray(self.shape.normal), float(self.shape.offset), np.empty((0, 3))

    def ball(self) -> tuple[Floats, float]:
        return np.zeros(3), math.inf

    def fcl(self) -> FclModel:
        return "Halfspace", (*self.shape.normal, self.shape.offset)

    def core_tip(self, direction: Floats) -> Floats:
        raise TypeError(f"shape must be bounded, not {self.shape!r}")

    def support(self, direction: Exact, scale: int) -> tuple[Fraction, Fraction] | None:
        """A half-space is bounded only along its normal."""
        normal, offset = self.planes.normals[0], self.planes.offsets[0]
        if any(cross(normal, direction)) or direction @ normal < 0:
            return None
        return offset * (direction @ normal) / (normal @ normal) / scale, Fraction(0)

    def blocks(self) -> list[Block]:
        return [Block([(self.planes.normals[0], self.planes.offsets[0])], None)]
