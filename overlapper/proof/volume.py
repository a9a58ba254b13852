"""Bounds of the volume that bodies share, as narrow as requested: a sum over combinations of one piece of each body.

Decisions are exact, or use balls that do not contain zero. If a ball contains zero, more bits are used.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from itertools import combinations

import numpy as np
from flint import arb, ctx, fmpq

from overlapper import Placed
from overlapper.proof import one_quadric
from overlapper.proof.arc_slices import ByArcs
from overlapper.proof.ball_and_tube import BallAndTube
from overlapper.proof.corners import Polytope, below
from overlapper.proof.pieces import DOUBT, Ball, Egg, Floats, Piece, Plane, Quadric, Tube, pieces
from overlapper.proof.rational_body import RationalBody
from overlapper.proof.refusal import Bounds, CertificateError
from overlapper.proof.round_frame import constraint, determinant, is_alike, scale_of, within
from overlapper.proof.signs import Undecided
from overlapper.proof.slices import Slices
from overlapper.proof.two_tubes import TwoTubes
from overlapper.proof.vectors import ORIGIN, dot, fraction, minus, plus, scaled

# The bits of the first try and of the last try. A sign that is then undecided is reported as a fault of the input.
FIRST, LAST = 128, 1 << 11
# The bits of the last try if slices bounded by arcs are needed. With more bits, each of them takes a second or more.
LAST_BY_ARCS = 192
# A summand is computed again while all uncertainties together exceed one part in ENOUGH of the volume.
ENOUGH = 1 << 60
# If a sign is undecided with this many bits, it is assumed that more bits do not decide it.
TIED = 512


class Common:
    """The common part of placed shapes, as a sum of volumes."""

    def __init__(self, *shapes: Placed) -> None:
        bodies = [RationalBody(shape) for shape in shapes]
        bounded = [body for body in bodies if body.facts.bounded]
        if not bounded:
            raise CertificateError("one of the bodies must be bounded")
        self._summands: list[Summand] = []
        self.lost = fmpq(0)
        for together in _near([_Pieces(pieces(body, bounded[0])) for body in bodies]):
            self._summands += summands(together)
            self.lost += sum((piece.lost for piece in together), fmpq(0))
        self._enough = arb(0)
        self._known: list[arb | None] = [None] * len(self._summands)

    @property
    def last(self) -> int:
        """The most bits to try."""
        return LAST_BY_ARCS if any(isinstance(each, ByArcs) for each in self._summands) else LAST

    def bounds(self, bits: int) -> Bounds | None:
        """Bounds by numbers with `bits` bits; None if these are too few for one of the summands.

        A summand that is known accurately enough is not computed again.
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
        return max(lower, Fraction(0)), upper


Summand = Callable[[int], arb]


class OrBetween:
    """A volume by slices, or bounds of the volume by a thinner and a thicker cylinder.

    If a plane contains the curve in which the quadrics meet, three sides of every slice meet, and no number of bits
    decides their order. For the thinner and the thicker cylinder, some number of bits does.
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
    """The number, if it has bounds. Undecided if it has none, because two sides meet where an integral ends."""
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
        """Pairs of pieces that are not proved to be separated in doubles."""
        lower, upper = self.boxes[:, None, 0], self.boxes[:, None, 1]
        apart = (lower >= other.boxes[None, :, 1]) | (upper <= other.boxes[None, :, 0])
        for i, j in np.argwhere(~apart.any(axis=2)):
            if not self._parted(i, other, j) and not other._parted(j, self, i):
                yield int(i), int(j)

    def _parted(self, i: int, other: _Pieces, j: int) -> bool:
        """Whether the whole piece j of the other body is beyond one plane of piece i."""
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


def _near(bodies: list[_Pieces]) -> Iterator[list[Piece]]:
    """Combinations of one piece of each body, without two pieces that are proved to be separated in doubles."""
    first, *others = bodies
    near = [{tuple(pair) for pair in one.near(other)} for one, other in combinations(bodies, 2)]
    number = {pair: k for k, pair in enumerate(combinations(range(len(bodies)), 2))}
    chosen: list[tuple[int, ...]] = [(k,) for k in range(len(first.pieces))]
    for j, other in enumerate(others, start=1):
        chosen = [
            (*those, k)
            for those in chosen
            for k in range(len(other.pieces))
            if all((piece, k) in near[number[i, j]] for i, piece in enumerate(those))
        ]
    for those in chosen:
        yield [body.pieces[k] for body, k in zip(bodies, those)]


def summands(together: list[Piece]) -> list[Summand]:
    """The common part of pieces, as volumes to be computed later."""
    boxes = [box(piece) for piece in together]
    around = np.array([np.max([each[0] for each in boxes], axis=0), np.min([each[1] for each in boxes], axis=0)])
    if (around[0] >= around[1]).any():
        return []
    planes = tuple(plane for piece in together for plane in piece.planes)
    return _of_all([piece.quadric for piece in together if piece.quadric is not None], planes, around)


def _of_all(quadrics: list[Quadric], planes: tuple[Plane, ...], around: Floats) -> list[Summand]:
    """The volume of quadrics below planes, as summands.

    Quadrics of the same form differ by a linear function, so a plane separates the parts of space in which each bounds.
    """
    classes: list[list[Quadric]] = []
    for quadric in quadrics:
        alike = next((those for those in classes if is_alike(those[0], quadric)), None)
        if alike is None:
            classes.append([quadric])
        else:
            alike.append(quadric)
    found: list[Summand] = []
    for cells in itertools.product(*(list(_cells(those)) for those in classes)):
        bounding = [quadric for quadric, _ in cells]
        found += _of_different(bounding, (*planes, *(plane for _, more in cells for plane in more)), around)
    return found


def _cells(alike: list[Quadric]) -> Iterator[tuple[Quadric, tuple[Plane, ...]]]:
    """Each of some quadrics of the same form, with the planes of the part of space in which this quadric bounds."""
    functions = [constraint(quadric) for quadric in alike]
    for k, one in enumerate(functions):
        cell: list[Plane] = []
        for j, other in enumerate(functions):
            share = scale_of(other.form, one.form)
            normal = scaled(minus(scaled(other.linear, share), one.linear), 2)
            offset = one.constant - share * other.constant
            if any(normal):
                cell.append(Plane(normal, offset))
            elif offset < 0 or (offset == 0 and j < k):
                break
        else:
            yield alike[k], tuple(cell)


def _of_different(quadrics: list[Quadric], planes: tuple[Plane, ...], around: Floats) -> list[Summand]:
    if not quadrics:
        return _of_one(None, planes, around)
    if len(quadrics) == 1:
        return _of_one(quadrics[0], planes, around)
    if len(quadrics) == 2 and not any(isinstance(quadric, Egg) for quadric in quadrics):
        return _of_two(quadrics[0], quadrics[1], planes, around)
    polytope = below(planes, around)
    if polytope is None:
        return []
    bounding = [each for each in quadrics if not _holds(each, polytope)]
    if len(bounding) < len(quadrics):
        return _of_different(bounding, planes, around)
    given = {id(plane) for plane in planes}
    kept = [facet.plane for facet in polytope.facets if id(facet.plane) in given]
    return [ByArcs([constraint(each) for each in (*quadrics, *kept)], around)]


def _holds(quadric: Quadric, polytope: Polytope) -> bool:
    """Whether a polytope is within a quadric, which then bounds nothing of it."""
    function = constraint(quadric)
    return all(function.value(corner) <= 0 for corner in polytope.corners)


def _of_one(quadric: Quadric | None, planes: tuple[Plane, ...], around: Floats) -> list[Summand]:
    if isinstance(quadric, Egg):
        egg = quadric
        local = tuple(within(plane, egg) for plane in planes)
        det = abs(determinant(egg.rows))
        return [
            lambda bits, summand=summand: summand(bits) / det  # type: ignore[misc]
            for summand in _of_one(Ball(ORIGIN, fmpq(1)), local, np.array([[-1.125] * 3, [1.125] * 3]))
        ]
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
    """Whether a circle is in another: d + r <= R, from the squares of the distance of the centres and of the radii."""
    # This is d² + r² - R² <= -2 d r. The right side is not positive, so the left side must not be positive.
    excess = between + small - large
    return small <= large and excess <= 0 and excess * excess >= 4 * between * small


def proved_bounds(shapes: Sequence[Placed], is_narrow: Callable[[Bounds], bool]) -> Bounds:
    """Bounds of the volume that are narrow enough."""
    common = Common(*shapes)
    bits = FIRST
    while bits <= common.last:
        bounds = common.bounds(bits)
        if bounds and is_narrow(bounds):
            return bounds
        bits += bits // 2
    raise CertificateError("the common volume could not be bounded: the bodies may only touch")
