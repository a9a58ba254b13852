"""The volume that a ball or a cylinder shares with a polytope, by closed forms in ball arithmetic.

Every edge of the polytope spans a triangle. For a ball, its apex is the foot of the centre on the plane of a facet. For
a cylinder, its apex is the axis in a slice perpendicular to it. In polar coordinates about the apex, all integrals are
elementary, and the signed sum over all edges is the volume. The case of a formula is decided in ball arithmetic, and
exactly if the balls are too wide. All terms are continuous, so no digits are lost if a corner or an edge lies on the
quadric, and more bits give more digits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from flint import arb, fmpq

from overlapper.proof.corners import Polytope
from overlapper.proof.pieces import Ball, Tube
from overlapper.proof.signs import Undecided, is_positive, sign
from overlapper.proof.vectors import Vector, cross, dot, minus, plus, scaled

Number = Any  # fmpq, or arb
Triple = tuple[Number, Number, Number]


def root(square: Number) -> arb:
    """The square root of a number that is not negative."""
    found: arb = arb(square).nonnegative_part().sqrt()
    return found


def in_ball(ball: Ball, polytope: Polytope) -> arb:
    """The volume, as the sum of the cones from the centre over the facets.

    Where a facet is in the ball, the volume of its cone is a third of height times area. Where the facet is outside,
    the volume is a third of the radius times the area of the sphere that the facet covers.
    """
    kinds = _in_balls_or_exactly(polytope, ball.centre)
    total = arb(0)
    for facet in range(len(polytope.facets)):
        total += _decided(kinds, partial(_cone, square=ball.square, facet=facet))
    return total


def in_tube(tube: Tube, polytope: Polytope) -> arb:
    """The volume, as the integral of every facet's height over a slice perpendicular to the axis.

    The domain of each integral is the part of the facet's shadow in the disc.
    """
    kinds = _in_balls_or_exactly(polytope, tube.point, tube.axis)
    total = arb(0)
    for edge in polytope.edges():
        total += _decided(kinds, partial(_under, square=tube.square, edge=edge))
    return total * root(dot(tube.axis, tube.axis))


class _Numbers:
    """A polytope relative to a point, or its shadow along an axis, in numbers of one kind."""

    def __init__(self, polytope: Polytope, kind: Callable[[fmpq], Number], centre: Vector, axis: Vector | None) -> None:
        self.polytope, self.kind = polytope, kind
        self.centre = self.triple(centre)
        self.axis: Any = self.triple(axis) if axis else None
        self._corners: dict[int, Triple] = {}
        self._heights: dict[int, tuple[Number, Triple] | None] = {}

    def triple(self, v: Vector) -> Triple:
        return self.kind(v[0]), self.kind(v[1]), self.kind(v[2])

    def corner(self, number: int) -> Triple:
        if number not in self._corners:
            arm = minus(self.triple(self.polytope.corners[number]), self.centre)
            if self.axis:
                arm = plus(arm, self.axis, -dot(arm, self.axis) / dot(self.axis, self.axis))
            self._corners[number] = arm
        return self._corners[number]

    def plane(self, facet: int) -> tuple[Triple, Number]:
        """A normal of the facet, and the level of the facet along the normal."""
        plane = self.polytope.facets[facet].plane
        normal = self.triple(plane.normal)
        return normal, self.kind(plane.offset) - dot(normal, self.centre)

    def height(self, facet: int) -> tuple[Number, Triple] | None:
        """(level, slope): along the unit axis, a facet is at (level + slope · shadow) times the length of the axis."""
        if facet not in self._heights:
            normal, level = self.plane(facet)
            rise = dot(normal, self.axis)
            self._heights[facet] = (level / rise, scaled(normal, -1 / rise)) if sign(rise) else None
        return self._heights[facet]


def _in_balls_or_exactly(polytope: Polytope, centre: Vector, axis: Vector | None = None) -> list[_Numbers]:
    return [_Numbers(polytope, kind, centre, axis) for kind in (arb, fmpq)]


def _decided(kinds: list[_Numbers], ask: Callable[[_Numbers], arb]) -> arb:
    try:
        return ask(kinds[0])
    except Undecided:
        return ask(kinds[1])


def _cone(numbers: _Numbers, square: fmpq, facet: int) -> arb:
    """The volume in the ball between its centre and a facet."""
    normal, level = numbers.plane(facet)
    side = sign(level)
    if side == 0:
        return arb(0)
    over = _Over(numbers.kind(square), normal, level)
    ring = [numbers.corner(p) for p in numbers.polytope.facets[facet].ring]
    return side * sum((over.triangle(p, q) for p, q in zip(ring, ring[1:] + ring[:1])), arb(0))


class _Over:
    """The cones from the centre of a ball over triangles in a plane, which have a corner at the foot of the centre."""

    def __init__(self, square: Number, normal: Triple, level: Number) -> None:
        self.square, self.normal = square, normal
        self.normal_square = dot(normal, normal)
        height_square = level * level / self.normal_square
        self.disc_square = square - height_square
        self.height, self.radius = root(height_square), root(square)
        self.meets = is_positive(self.disc_square)
        self.inner = self.height * (arb(self.disc_square) / 6 + arb(square) / 3)

    def triangle(self, p: Triple, q: Triple) -> arb:
        edge = minus(q, p)
        around, length = dot(cross(p, edge), self.normal), dot(edge, edge)
        side = sign(around)
        if side == 0:
            return arb(0)
        near = around * around / (self.normal_square * length)
        low, high = (self._sector(near, dot(end, edge), length, dot(end, end)) for end in (p, q))
        return side * (high - low)

    def _sector(self, near: Number, along: Number, length: Number, end: Number) -> arb:
        """The term from the foot on the edge to the end of the edge; an odd function of `along`.

        The foot on the edge is at the distance sqrt(`near`) from the foot on the plane.
        """
        side = sign(along)
        if side == 0:
            return arb(0)
        h, d = self.height, root(near)
        way = root(along * along / length)
        if not is_positive(end - self.square):
            return side * (h * d * way / 6)
        outer = self.radius**3 / 3
        turn, seen = arb.atan2(way, d), arb.atan2(h * way, d * root(end))
        if not self.meets:
            return side * outer * (turn - seen)
        if not is_positive(self.disc_square - near):
            return side * (self.inner * turn - outer * seen)
        rim = root(self.disc_square - near)
        turn, seen = turn - arb.atan2(rim, d), seen - arb.atan2(h * rim, d * self.radius)
        return side * (h * d * rim / 6 + self.inner * turn - outer * seen)


def _under(numbers: _Numbers, square: fmpq, edge: tuple[int, int, int, int]) -> arb:
    """The volume below the facets on both sides of an edge, over the triangle from the axis to the edge's shadow."""
    p, q, left, right = edge
    heights = numbers.height(left), numbers.height(right)
    total = arb(0)
    if heights == (None, None):
        return total
    shadow = _Shadow(numbers.kind(square), numbers.axis, numbers.corner(p), numbers.corner(q))
    for height, side in zip(heights, (1, -1)):
        if height and shadow.side:
            total += side * shadow.integral(*height)
    return total


class _Shadow:
    """The part in a disc of a triangle between its centre and the ends of an edge."""

    def __init__(self, square: Number, axis: Triple, p: Triple, q: Triple) -> None:
        edge = minus(q, p)
        self.side = sign(dot(axis, cross(p, edge)))
        if self.side:
            self.edge, self.length = edge, dot(edge, edge)
            self.foot = plus(p, edge, -dot(p, edge) / self.length)
            self.near, self.square = dot(self.foot, self.foot), square
            ends = [list(self._sector(dot(end, edge), dot(end, end))) for end in (p, q)]
            self.area, self.outwards, self.sideways = (self.side * (b - a) for a, b in zip(*ends))

    def integral(self, level: Number, slope: Triple) -> arb:
        """The integral of level + slope · x."""
        outer, inner = arb(dot(slope, self.foot)), arb(dot(slope, self.edge)) / root(self.length)
        found: arb = arb(level) * self.area + outer * self.outwards + inner * self.sideways
        return found

    def _sector(self, along: Number, end: Number) -> Iterator[arb]:
        """From the foot on the edge to an end: the area, and the moments outwards through the foot and sideways."""
        d, r, side = root(self.near), root(self.square), sign(along)
        way = root(along * along / self.length)
        if not is_positive(end - self.square):
            yield side * d * way / 2
            yield side * d * way / 3
            yield d * arb(along * along / self.length) / 6
            return
        turn, far, third = arb.atan2(way, d), root(end), r**3 / 3
        if not is_positive(self.square - self.near):
            yield side * arb(self.square) / 2 * turn
            yield side * third * way / (far * d)
            yield -third * d / far
            return
        rim = root(self.square - self.near)
        yield side * (d * rim / 2 + arb(self.square) / 2 * (turn - arb.atan2(rim, d)))
        yield side * (d * rim / 3 + third * (way / far - rim / r) / d)
        yield d * arb(self.square - self.near) / 6 - third * (d / far - d / r)
