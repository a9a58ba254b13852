"""Bounds of the volume that two bodies share, as narrow as asked for: each piece of one with each piece of the other.

Decisions are made without rounding, or by balls that do not hold zero. Where a ball holds zero, more bits are taken.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction

import numpy as np
from flint import arb, ctx, fmpq

from overlapper import Placed
from overlapper.proof import one_quadric
from overlapper.proof.ball_and_tube import BallAndTube
from overlapper.proof.corners import Polytope, below
from overlapper.proof.pieces import DOUBT, Ball, Floats, Piece, Plane, Quadric, Tube, pieces
from overlapper.proof.rational_body import RationalBody
from overlapper.proof.refusal import Bounds, CertificateError
from overlapper.proof.signs import Undecided
from overlapper.proof.slices import Slices
from overlapper.proof.two_tubes import TwoTubes
from overlapper.proof.vectors import cross, dot, fraction, minus, plus, scaled

# Bits of a first try, and of a last one, after which doubt is taken for a fault of the input.
FIRST, LAST = 128, 1 << 11
# A summand is computed again while all doubts together exceed one part in ENOUGH of the volume.
ENOUGH = 1 << 60
# Bits at which an undecided sign is taken for a sign that no bits decide.
TIED = 512


class Common:
    """The common part of two placed shapes, as a sum of volumes."""

    def __init__(self, a: Placed, b: Placed) -> None:
        bodies = RationalBody(a), RationalBody(b)
        stretched = [body for body in bodies if body.facts.half_axes is not None]
        if stretched and not any(body.facts.planes for body in bodies):
            raise CertificateError(f"of {stretched[0].facts.name} and another round body no volume is proved")
        bounded = [body for body in bodies if body.facts.bounded]
        if not bounded:
            raise CertificateError("one of the bodies must be bounded")
        home = (stretched or bounded)[0]
        # The volume of a unit cube in the axes of home.
        self._unit = Fraction(1) if home.facts.half_axes is None else math.prod(home.facts.half_axes)
        self._summands: list[Summand] = []
        self.lost = fmpq(0)
        first, second = (_Pieces(pieces(body, home)) for body in bodies)
        for i, j in first.near(second):
            one, other = first.pieces[i], second.pieces[j]
            self._summands += summands(one, other)
            self.lost += one.lost + other.lost
        self._enough = arb(0)
        self._known: list[arb | None] = [None] * len(self._summands)

    def bounds(self, bits: int) -> Bounds | None:
        """Bounds by numbers of so many bits; None if these are too few for one of the summands.

        A summand that is known well enough is not computed again.
        """
        with ctx.workprec(bits):
            wide = [k for k, volume in enumerate(self._known) if volume is None or volume.rad() > self._enough]
            for k in wide or range(len(self._summands)):
                known = self._known[k]
                with suppress(Undecided):
                    found = finite(self._summands[k](bits))
                    if known is None or found.rad() < known.rad():
                        self._known[k] = found
            volumes = [volume for volume in self._known if volume is not None]
            if len(volumes) < len(self._summands):
                return None
            total = sum(volumes, arb(0))
            self._enough = total.lower().nonnegative_part() / (ENOUGH * len(volumes) + 1)
            lower, upper = dyadic(total.lower()), dyadic(total.upper()) + fraction(self.lost)
        return max(lower, Fraction(0)) * self._unit, upper * self._unit


Summand = Callable[[int], arb]


class OrBetween:
    """A volume by slices, or bounds of it by a thinner and a thicker cylinder.

    Where a plane goes through the curve in which the quadrics meet, three sides of every slice meet, and no bits tell
    their order. For the thinner and the thicker cylinder some bits do.
    """

    def __init__(self, slices: Callable[[Tube], Slices], tube: Tube) -> None:
        self.slices, self.tube = slices, tube
        self._as_given = slices(tube)

    def __call__(self, bits: int) -> arb:
        try:
            return finite(self._as_given(bits))
        except Undecided:
            if bits < TIED:
                raise
        off = fmpq(1, 1 << bits // 4)
        thin, thick = (self.slices(replace(self.tube, square=self.tube.square * x)) for x in (1 - off, 1 + off))
        return thin(bits).union(thick(bits))


def finite(number: arb) -> arb:
    """The number, if it has bounds. Undecided if it has none: two sides meet where an integral ends."""
    if not number.is_finite():
        raise Undecided
    return number


def dyadic(number: arb) -> Fraction:
    mantissa, exponent = number.man_exp()
    return Fraction(int(mantissa)) * Fraction(2) ** int(exponent)


class _Pieces:
    """The pieces of a body, with boxes around them."""

    def __init__(self, found: list[Piece]) -> None:
        self.pieces = found
        self.boxes = np.array([box(piece) for piece in found])
        self._planes: dict[int, Floats] = {}

    def near(self, other: _Pieces) -> Iterator[tuple[int, int]]:
        """Pairs of pieces that are not apart as far as doubles can tell."""
        lower, upper = self.boxes[:, None, 0], self.boxes[:, None, 1]
        apart = (lower >= other.boxes[None, :, 1]) | (upper <= other.boxes[None, :, 0])
        for i, j in np.argwhere(~apart.any(axis=2)):
            if not self._parted(i, other, j) and not other._parted(j, self, i):
                yield int(i), int(j)

    def _parted(self, i: int, other: _Pieces, j: int) -> bool:
        """Whether all of the other's piece is beyond one plane of the piece."""
        spine, reach = other.pieces[j].spine, other.pieces[j].reach
        if spine is None:
            return False
        if i not in self._planes:
            self._planes[i] = np.array([in_doubles(plane) for plane in self.pieces[i].planes]).reshape(-1, 4)
        normals, levels = self._planes[i][:, :3], self._planes[i][:, 3]
        least = (spine @ normals.T).min(axis=0) - reach * np.linalg.norm(normals, axis=1)
        return bool((least > levels + DOUBT * 4.0 * (np.abs(spine).max() + reach + np.abs(levels))).any())


def box(piece: Piece) -> Floats:
    """The box (2, 3) around a piece, in doubles that are rounded outwards."""
    if piece.spine is None:
        return np.array([[-np.inf] * 3, [np.inf] * 3])
    low, high = piece.spine.min(axis=0) - piece.reach, piece.spine.max(axis=0) + piece.reach
    margin = DOUBT * (np.abs(piece.spine).max() + piece.reach)
    return np.array([low - margin, high + margin])


def in_doubles(plane: Plane) -> list[float]:
    """Normal and offset, divided by the largest coordinate of the normal."""
    size = max(abs(x) for x in plane.normal)
    ratios = (number / size for number in (*plane.normal, plane.offset))
    return [int(x.p) / int(x.q) for x in ratios]


def summands(one: Piece, other: Piece) -> list[Summand]:
    """The common part of two pieces, as volumes that wait to be computed."""
    around = np.array([f(p, q) for f, p, q in zip((np.maximum, np.minimum), box(one), box(other))])
    planes = (*one.planes, *other.planes)
    quadrics = [piece.quadric for piece in (one, other) if piece.quadric is not None]
    if len(quadrics) == 2:
        return _of_two(quadrics[0], quadrics[1], planes, around)
    return _of_one(quadrics[0] if quadrics else None, planes, around)


def _of_one(quadric: Quadric | None, planes: tuple[Plane, ...], around: Floats) -> list[Summand]:
    polytope = _below(quadric, planes, around)
    if polytope is None:
        return []
    common = polytope
    match quadric:
        case None:
            volume = common.volume()
            return [lambda bits: arb(volume)]
        case Ball() as ball:
            return [lambda bits: one_quadric.in_ball(ball, common)]
        case Tube() as tube:
            return [lambda bits: one_quadric.in_tube(tube, common)]


def _below(quadric: Quadric | None, planes: tuple[Plane, ...], around: Floats) -> Polytope | None:
    """The polytope below the planes that cut a ball; None if one of them leaves nothing of the ball."""
    if isinstance(quadric, Ball):
        kept = []
        for plane in planes:
            height, square = plane.height(quadric.centre), dot(plane.normal, plane.normal)
            if height * height < quadric.square * square:
                kept.append(plane)
            elif height > 0:
                return None
        planes = tuple(kept)
    return below(planes, around)


def _of_two(one: Quadric, other: Quadric, planes: tuple[Plane, ...], around: Floats) -> list[Summand]:
    alike = isinstance(one, Ball) and isinstance(other, Ball)
    if isinstance(one, Tube) and isinstance(other, Tube):
        alike = not any(cross(one.axis, other.axis))
    if alike:
        return _split(one, other, planes, around)
    if isinstance(one, Tube) and isinstance(other, Tube):
        return _sliced(lambda tube, polytope: TwoTubes(one, tube, polytope), other, below(planes, around))
    ball, tube = (one, other) if isinstance(one, Ball) else (other, one)
    assert isinstance(ball, Ball) and isinstance(tube, Tube)
    arm = minus(ball.centre, tube.point)
    arm = plus(arm, tube.axis, -dot(arm, tube.axis) / dot(tube.axis, tube.axis))
    if is_within(dot(arm, arm), ball.square, tube.square):
        return _of_one(ball, planes, around)
    return _sliced(lambda tube, polytope: BallAndTube(ball, tube, polytope), tube, _below(ball, planes, around))


def _sliced(slices: Callable[[Tube, Polytope], Slices], tube: Tube, polytope: Polytope | None) -> list[Summand]:
    return [OrBetween(lambda thick: slices(thick, polytope), tube)] if polytope else []


def is_within(between: fmpq, small: fmpq, large: fmpq) -> bool:
    """Whether a circle is in another, by the squares of the distance of the centres and of the radii: d + r <= R."""
    # This is d² + r² - R² <= -2 d r. The right side is not positive, so the left side must not be positive.
    excess = between + small - large
    return small <= large and excess <= 0 and excess * excess >= 4 * between * small


def _split(one: Quadric, other: Quadric, planes: tuple[Plane, ...], around: Floats) -> list[Summand]:
    """Two balls or two parallel tubes. Their surfaces meet in a plane, and on each side of it one of them bounds."""
    if isinstance(one, Ball) and isinstance(other, Ball):
        centre, arm = one.centre, minus(other.centre, one.centre)
    else:
        assert isinstance(one, Tube) and isinstance(other, Tube)
        centre, arm = one.point, minus(other.point, one.point)
        arm = plus(arm, one.axis, -dot(arm, one.axis) / dot(one.axis, one.axis))
    if not any(arm):
        return _of_one(one if one.square <= other.square else other, planes, around)
    # |x - c|² - r² is less for the other beyond the plane, so that there the first is the one that bounds.
    level = dot(arm, centre) + (dot(arm, arm) + one.square - other.square) / 2
    found = _of_one(other, (*planes, Plane(arm, level)), around)
    return found + _of_one(one, (*planes, Plane(scaled(arm, -1), -level)), around)


def proved_bounds(a: Placed, b: Placed, is_narrow: Callable[[Bounds], bool]) -> Bounds:
    """Bounds of the volume that are narrow enough."""
    common = Common(a, b)
    bits = FIRST
    while bits <= LAST:
        bounds = common.bounds(bits)
        if bounds and is_narrow(bounds):
            return bounds
        bits += bits // 2
    raise CertificateError("the common volume could not be bounded: the bodies may only touch")
