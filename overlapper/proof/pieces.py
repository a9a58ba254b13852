"""The blocks of placed shapes as exact pieces in common axes. Rotations are rational, too."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from flint import fmpq
from numpy.typing import NDArray

from overlapper.proof.rational_body import RationalBody
from overlapper.proof.refusal import CertificateError
from overlapper.proof.vectors import Vector, dot, plus, rational, scaled, vector
from overlapper.shapes.facts import Block

Floats = NDArray[np.float64]

NOTHING = fmpq(0)

# The rounding of doubles that decide which pieces are separated is less than this share of the largest of them.
DOUBT = 2.0**-40


@dataclass(frozen=True)
class Plane:
    """{ x : normal · x <= offset }."""

    normal: Vector
    offset: fmpq

    def height(self, point: Vector) -> fmpq:
        return dot(self.normal, point) - self.offset


@dataclass(frozen=True)
class Ball:
    centre: Vector
    square: fmpq  # of the radius


@dataclass(frozen=True)
class Tube:
    """A circular cylinder without ends, about a line; the axis is of any length."""

    point: Vector
    axis: Vector
    square: fmpq  # of the radius


@dataclass(frozen=True)
class Egg:
    """An ellipsoid: { x : |rows · (x - centre)| <= 1 }."""

    centre: Vector
    rows: tuple[Vector, Vector, Vector]


Quadric = Ball | Tube | Egg


@dataclass(frozen=True)
class Piece:
    """A block (see `overlapper.shapes.facts`) in common axes: the part of a quadric, if any, below planes.

    It lies within `reach` of the hull of `spine` (k, 3), in doubles; `spine` is None if the piece is unbounded. Its
    planes cut off at most the volume `lost` of the body.
    """

    quadric: Quadric | None
    planes: tuple[Plane, ...]
    spine: Floats | None
    reach: float = 0.0
    lost: fmpq = NOTHING


class Frame:
    """The map from the axes of a body, in units of its half axes, if it has any, to the axes of `home`."""

    def __init__(self, body: RationalBody, home: RationalBody) -> None:
        turn = home.axes.T @ body.axes
        self._rows = [vector(row) for row in turn]
        self._shift = vector(home.axes.T @ (body.position - home.position))
        self.units = vector([1, 1, 1] if body.facts.half_axes is None else body.facts.half_axes)
        x, y, z = self.units
        self.is_stretched = not x == y == z

    def direction(self, v: Vector) -> Vector:
        return dot(self._rows[0], v), dot(self._rows[1], v), dot(self._rows[2], v)

    def point(self, v: Vector) -> Vector:
        x, y, z = (a * unit for a, unit in zip(v, self.units))
        return plus(self.direction((x, y, z)), self._shift)

    def plane(self, normal: Vector, offset: fmpq) -> Plane:
        x, y, z = (a / unit for a, unit in zip(normal, self.units))
        turned = self.direction((x, y, z))
        return Plane(turned, offset + dot(turned, self._shift))

    def piece(self, block: Block) -> Piece:
        quadric: Quadric | None = None
        if block.centre is not None:
            centre, radius = self.point(vector(block.centre)), rational(block.radius)
            if block.axis is not None:
                quadric = Tube(centre, self.direction(vector(block.axis)), radius**2)
            elif self.is_stretched:
                quadric = Egg(centre, self._stretched(radius))
            else:
                quadric = Ball(centre, (radius * self.units[0]) ** 2)
        planes = tuple(self.plane(vector(normal), rational(offset)) for normal, offset in block.planes)
        spine = None if block.spine is None else doubles(self.point(vector(point)) for point in block.spine)
        reach = block.radius * max(int(unit.p) / int(unit.q) for unit in self.units)
        return Piece(quadric, planes, spine, reach, rational(block.lost))

    def _stretched(self, radius: fmpq) -> tuple[Vector, Vector, Vector]:
        one, zero = fmpq(1), fmpq(0)
        x, y, z = ((one, zero, zero), (zero, one, zero), (zero, zero, one))
        rows = [scaled(self.direction(way), 1 / (radius * unit)) for way, unit in zip((x, y, z), self.units)]
        return rows[0], rows[1], rows[2]


def doubles(points: Iterable[Vector]) -> Floats:
    return np.array([[int(x.p) / int(x.q) for x in point] for point in points])


def pieces(body: RationalBody, home: RationalBody) -> list[Piece]:
    """The pieces of a body in the axes of `home`."""
    if not body.facts.has_blocks:
        raise CertificateError(f"{body.facts.name} has no certificate, because it is not made of balls and cylinders")
    frame = Frame(body, home)
    try:
        return [frame.piece(block) for block in body.facts.blocks()]
    except ValueError as error:
        raise CertificateError(str(error)) from None
