"""The volume that a ball or a cylinder shares with a polytope, by closed forms in ball arithmetic.

Every edge of the polytope spans a triangle: of a ball with the foot of the centre on the plane of a facet, of a
cylinder with the axis in a slice across it. In polar coordinates about the apex of a triangle all integrals are
elementary, and the signed sum over all edges is the volume. Which case of a formula holds is decided without rounding.
No term jumps, so that nothing is lost where a corner or an edge lies on the quadric, and more bits are more digits.
"""

from __future__ import annotations

from flint import arb, fmpq

from overlapper.proof.corners import Polytope
from overlapper.proof.pieces import Ball, Tube
from overlapper.proof.vectors import Vector, cross, dot, minus, plus, scaled


def root(square: fmpq) -> arb:
    """Of what is not negative."""
    return arb(square).nonnegative_part().sqrt()


def in_ball(ball: Ball, polytope: Polytope) -> arb:
    """A cone from the centre over a facet: as far as the facet is in the ball a third of height times area, and where
    it is outside a third of the radius times the area of the sphere that is seen."""
    corners = [minus(corner, ball.centre) for corner in polytope.corners]
    total = arb(0)
    for facet in polytope.facets:
        normal = facet.plane.normal
        level = -facet.plane.height(ball.centre)
        if level:
            ring = [corners[p] for p in facet.ring]
            cone = _Cone(ball.square, normal, level)
            cones = sum((cone.over(p, q) for p, q in zip(ring, ring[1:] + ring[:1])), arb(0))
            total += cones if level > 0 else -cones
    return total


class _Cone:
    """Between the centre of a ball and triangles in a plane, all with a corner at the foot of the centre."""

    def __init__(self, square: fmpq, normal: Vector, level: fmpq) -> None:
        self.square, self.normal = square, normal
        self.normal_square = dot(normal, normal)
        self.height_square = level * level / self.normal_square
        self.disc_square = square - self.height_square
        self.height, self.radius = root(self.height_square), root(square)
        self.inner = self.height * (arb(self.disc_square) / 6 + arb(square) / 3) if self.disc_square > 0 else None

    def over(self, p: Vector, q: Vector) -> arb:
        edge = minus(q, p)
        around, length = dot(cross(p, edge), self.normal), dot(edge, edge)
        if not around:
            return arb(0)
        square = around * around / (self.normal_square * length)
        ends = [self._sector(square, dot(end, edge), length, dot(end, end)) for end in (p, q)]
        return ends[1] - ends[0] if around > 0 else ends[0] - ends[1]

    def _sector(self, square: fmpq, along: fmpq, length: fmpq, end: fmpq) -> arb:
        """From the foot on the edge, at the root of `square` from the foot on the plane, to the end, odd in `along`."""
        if not along:
            return arb(0)
        h, d = self.height, root(square)
        way = root(along * along / length)
        if end <= self.square:
            volume = h * d * way / 6
        else:
            outer = self.radius**3 / 3
            turn, seen = arb.atan2(way, d), arb.atan2(h * way, d * root(end))
            if self.inner is None:
                volume = outer * (turn - seen)
            elif square >= self.disc_square:
                volume = self.inner * turn - outer * seen
            else:
                rim = root(self.disc_square - square)
                turn, seen = turn - arb.atan2(rim, d), seen - arb.atan2(h * rim, d * self.radius)
                volume = h * d * rim / 6 + self.inner * turn - outer * seen
        return volume if along > 0 else -volume


def in_tube(tube: Tube, polytope: Polytope) -> arb:
    """The height of every facet over a slice across the axis, integrated over the part of its shadow in the disc."""
    axis, axis_square = tube.axis, dot(tube.axis, tube.axis)
    corners = []
    for corner in polytope.corners:
        arm = minus(corner, tube.point)
        corners.append(plus(arm, axis, -dot(arm, axis) / axis_square))
    # Along the unit axis a facet is at (offset - normal · shadow) / rise times the length of the axis.
    heights: list[tuple[fmpq, Vector] | None] = []
    for facet in polytope.facets:
        rise = dot(facet.plane.normal, axis)
        level = -facet.plane.height(tube.point)
        heights.append((level / rise, scaled(facet.plane.normal, -1 / rise)) if rise else None)
    total = arb(0)
    for p, q, left, right in polytope.edges():
        sides = heights[left], heights[right]
        if sides == (None, None):
            continue
        level, slope = sides[0] or (fmpq(0), (fmpq(0),) * 3)
        other, other_slope = sides[1] or (fmpq(0), (fmpq(0),) * 3)
        total += _shadow(
            tube.square, axis, axis_square, corners[p], corners[q], level - other, minus(slope, other_slope)
        )
    return total * root(axis_square)


def _shadow(square: fmpq, axis: Vector, axis_square: fmpq, p: Vector, q: Vector, level: fmpq, slope: Vector) -> arb:
    """The integral of level + slope · x over the part in a disc of a triangle between its centre, p and q."""
    edge = minus(q, p)
    length = dot(edge, edge)
    around = dot(axis, cross(p, edge))
    if not around:
        return arb(0)
    foot = plus(p, edge, -dot(p, edge) / length)
    near = dot(foot, foot)
    ends = [_sector(square, near, dot(end, edge), length, dot(end, end)) for end in (p, q)]
    area, outwards, sideways = (b - a for a, b in zip(*ends))
    outer, inner = arb(dot(slope, foot)), arb(dot(slope, edge)) / root(length)
    integral: arb = arb(level) * area + outer * outwards + inner * sideways
    return integral if around > 0 else -integral


def _sector(square: fmpq, near: fmpq, along: fmpq, length: fmpq, end: fmpq) -> tuple[arb, arb, arb]:
    """From the foot on an edge, at the root of `near`, to the end: area, moment outwards by the foot, and sideways."""
    d, r = root(near), root(square)
    way = root(along * along / length)
    if end <= square:
        area, outwards, sideways = d * way / 2, d * way / 3, d * arb(along * along / length) / 6
    else:
        turn, far = arb.atan2(way, d), root(end)
        third = r**3 / 3
        if near >= square:
            area, outwards, sideways = arb(square) / 2 * turn, third * way / (far * d), -third * d / far
        else:
            rim = root(square - near)
            turn -= arb.atan2(rim, d)
            area = d * rim / 2 + arb(square) / 2 * turn
            outwards = d * rim / 3 + third * (way / far - rim / r) / d
            sideways = d * arb(square - near) / 6 - third * (d / far - d / r)
    if along < 0:
        area, outwards = -area, -outwards
    return area, outwards, sideways
