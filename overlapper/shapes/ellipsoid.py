"""Ellipsoids."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from overlapper._core import Ellipsoid
from overlapper.rational import Exact, exact, integers
from overlapper.shapes.blocks import ball_block, up
from overlapper.shapes.choices import Round
from overlapper.shapes.drawing import Tessellation, capped
from overlapper.shapes.exits import out_of_ball
from overlapper.shapes.facts import Block, Floats
from overlapper.shapes.sphere import outward
from overlapper.shapes.words import times

TINY = np.finfo(float).tiny


class EllipsoidFacts(Round):
    name = "an ellipsoid"
    isotropic = False
    has_blocks = True
    has_exits = True
    bullet_margin = False
    rounding = 0.0

    def __init__(self, shape: Ellipsoid) -> None:
        self.shape = shape
        self.half_axes: Exact = exact(shape.half_axes)

    def parameters(self) -> list[float | Floats]:
        return [self.shape.half_axes]

    def words(self) -> tuple[str, str, int]:
        return "ellipsoid", f"half axes {times(self.shape.half_axes)}", 0

    def tessellation(self) -> Tessellation:
        """The image of the tessellation of a ball of radius 1, with the normals of the ellipsoid."""
        half_axes, ball = self.shape.half_axes, capped(1.0, 0.0)
        assert ball.normals is not None
        normals = ball.normals / half_axes
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        vertices, edges, wires = (half_axes * points for points in (ball.vertices, ball.edges, ball.wires))
        return replace(ball, vertices=vertices, normals=normals, edges=edges, wires=wires)

    def ball(self) -> tuple[Floats, float]:
        return np.zeros(3), float(self.shape.half_axes.max())

    def fcl(self) -> str:
        return "FCL is not asked about ellipsoids, because no exact distance is known to compare with."

    def core_tip(self, direction: Floats) -> Floats:
        raise TypeError("shape must not be an ellipsoid, because its exact distance is not known")

    def support(self, direction: Exact, scale: int) -> tuple[Fraction, Fraction]:
        stretched = self.half_axes * direction
        return Fraction(0), Fraction(stretched @ stretched) / scale**2

    def holds(self, points: Exact, scale: int, margin: Fraction | int) -> NDArray[np.bool_]:
        """A ball is inside if its centre is in the ellipsoid shrunk by radius / shortest half axis."""
        inverse, unit = integers(1 / self.half_axes)
        room = (1 - margin / min(self.half_axes)) * scale * unit
        square = ((points * inverse) ** 2).sum(axis=1)
        return np.asarray((square <= math.floor(room * room)) & (room >= 0), bool)

    def tightest(self, point: Exact) -> Exact:
        """The normal of the smaller or larger ellipsoid through the point."""
        arm = point.astype(float) / self.shape.half_axes**2
        normal: Exact = exact(outward(arm / max(abs(arm).max(), TINY)))
        return normal

    def exits(self, start: Exact, arms: Exact, scale: int, fine: int) -> Exact:
        inverse, grow = integers(1 / self.half_axes)
        return out_of_ball((start * inverse)[None], arms * inverse, scale * grow, fine)

    def blocks(self) -> list[Block]:
        return [ball_block(up(0), 1.0)]
