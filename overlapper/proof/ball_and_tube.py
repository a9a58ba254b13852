"""The common volume of a ball, a cylinder and a polytope, by slices along the cylinder's axis.

In a slice, the ball is a disc, the cylinder is a strip between two lines, and each facet is a line. A line that cuts
the disc removes a circular segment. The integral of the segment's area over all slices is elementary for a line of the
polytope, but not for a line of the cylinder.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

from flint import acb, arb, fmpq

from overlapper.proof.corners import Polytope
from overlapper.proof.one_quadric import root
from overlapper.proof.pieces import Ball, Tube
from overlapper.proof.signs import Undecided, is_positive
from overlapper.proof.slices import (
    ZERO,
    Form,
    Line,
    Parabola,
    Point,
    SliceArea,
    Slices,
    T,
    along,
    at,
    combined,
    half_turn,
    integrated,
    of_form,
    points_between,
    product,
    roots,
)
from overlapper.proof.vectors import Vector, across, cross, dot, minus, plus


class BallAndTube(Slices):
    """Coordinates about the centre of the ball: t across, p from the centre to the axis, q along the axis."""

    def __init__(self, ball: Ball, tube: Tube, polytope: Polytope) -> None:
        axis = tube.axis
        self.qq = dot(axis, axis)
        arm = minus(tube.point, ball.centre)
        arm = plus(arm, axis, -dot(arm, axis) / self.qq)
        way = arm if any(arm) else across(axis)
        normal = cross(way, axis)
        self.pp, self.tt = dot(way, way), dot(normal, normal)
        self.level = dot(way, arm)  # p of the axis
        self.thin, self.thick = tube.square, ball.square
        self.corners = []
        for corner in polytope.corners:
            x = minus(corner, ball.centre)
            self.corners.append((dot(normal, x), dot(way, x), dot(axis, x)))
        self.edges = polytope.edges()
        self.squares = (self.pp * (self.thin - T * T / self.tt),)
        self.disc = self.thick - T * T / self.tt
        far = max(abs(corner[2]) for corner in self.corners) + 1
        one = fmpq(1)
        self.lines = [
            Line((one, ZERO), (self.level, ZERO, one, ZERO)),
            Line((ZERO, one), (far, ZERO, ZERO, ZERO)),
            Line((-one, ZERO), (-self.level, ZERO, one, ZERO)),
            Line((ZERO, -one), (far, ZERO, ZERO, ZERO)),
        ]
        self.steep = []
        for facet in polytope.facets:
            n = facet.plane.normal
            rates = dot(n, normal) / self.tt, dot(n, way) / self.pp, dot(n, axis) / self.qq
            level = -facet.plane.height(ball.centre)
            if rates[1] or rates[2]:
                self.lines.append(Line(rates[1:], (level, -rates[0], ZERO, ZERO)))
            else:
                self.steep.append((rates[0], level))
        self.scale = self.pp * self.qq
        self._forms: dict[tuple[int, int], Form] = {}

    def widest(self) -> arb:
        return arb.pi() * self.thick * root(self.pp * self.qq)

    # Breakpoints

    def _in_ball(self, u: Vector, v: Vector) -> fmpq:
        return u[0] * v[0] / self.tt + u[1] * v[1] / self.pp + u[2] * v[2] / self.qq

    def _in_tube(self, u: Vector, v: Vector) -> fmpq:
        return u[0] * v[0] / self.tt + u[1] * v[1] / self.pp

    def is_outside(self, point: Point, flat: bool = False) -> bool:
        """Whether the point is certainly outside. A flat point represents all points that differ from it only in q."""
        t, p, q = point
        off = p - self.level
        if t * t / self.tt + off * off / self.pp > self.thin:
            return True
        if t * t / self.tt + p * p / self.pp + (arb(0) if flat else q * q / self.qq) > self.thick:
            return True
        return not flat and self.is_cut_off(point)

    def candidates(self) -> Iterator[tuple[Point, bool]]:
        for corner in self.corners:
            yield (arb(corner[0]), arb(corner[1]), arb(corner[2])), False
        axis = (ZERO, self.level, ZERO)
        for i, j, _, _ in self.edges:
            start, end = self.corners[i], self.corners[j]
            if start[0] != end[0]:
                shares = along(start, end, self._in_ball, self.thick)
                shares += along(minus(start, axis), minus(end, axis), self._in_tube, self.thin)
                yield from ((point, False) for point in points_between(start, end, shares))
        (square,) = self.squares
        for line in self.lines[4:]:
            (x, y), b = line.normal, line.offset[0] + line.offset[1] * T
            norm = x * x * self.pp + y * y * self.qq
            for t in roots(b * b - norm * self.disc):
                foot = at(b, t) / norm
                yield (t, x * self.pp * foot, y * self.qq * foot), False
            if y == 0:
                for t in roots((b / x - self.level) ** 2 - square):
                    yield (t, at(b, t) / x, arb(0)), True
                continue
            # p = level ± ρ, q = (b - x p) / y, in the equation of the ball: even ± odd ρ = 0.
            high = (b - x * self.level) / y
            tilt = x / y
            even = (self.level**2 + square) / self.pp + (high * high + tilt * tilt * square) / self.qq - self.disc
            odd = 2 * self.level / self.pp - 2 * tilt * high / self.qq
            for t in roots(even * even - odd * odd * square):
                wide = at(square, t).nonnegative_part().sqrt()
                for side in (-1, 1):
                    p = self.level + side * wide
                    yield (t, p, (at(b, t) - x * p) / y), False
        even = (self.level**2 + square) / self.pp - self.disc
        for t in roots(even * even - (2 * self.level / self.pp) ** 2 * square):
            wide = at(square, t).nonnegative_part().sqrt()
            for side in (-1, 1):
                yield (t, self.level + side * wide, arb(0)), False
        for t in roots(square):
            yield (t, arb(self.level), arb(0)), True
        for t in roots(self.disc):
            yield (t, arb(0), arb(0)), False

    # Areas

    def area(self, t: arb) -> SliceArea | None:
        disc = at(self.disc, t)
        if not is_positive(disc):
            return None
        one, _, wide = self.basis(t)
        offsets = [b[0] * one + b[1] * t + b[2] * wide for b in (line.offset for line in self.lines)]
        around = self.polygon(offsets)
        if not around:
            return None
        found = SliceArea()
        kept: list[tuple[int, int | None, int | None]] = []  # a line, and the lines that meet it in the disc
        for k, (line, end) in enumerate(around):
            before, start = around[k - 1]
            after = around[(k + 1) % len(around)][0]
            x, y = self.lines[line].normal
            rest = disc * self.norms[line] - offsets[line] ** 2
            if not is_positive(rest):
                continue
            reach = (rest * self.pp * self.qq).sqrt()
            here, there = (x * self.pp * q - y * self.qq * p for p, q in (start, end))
            if is_positive(here - reach) or is_positive(-reach - there):
                continue
            by_disc = is_positive(-reach - here), is_positive(there - reach)
            kept.append((line, None if by_disc[0] else before, None if by_disc[1] else after))
        if not kept:
            # No precision decides the side of a line through the centre. It is in the disc unless others cut it off.
            if any(offsets[line] < 0 for line, _ in around):
                return None
            assert all(is_positive(offsets[line]) for line, _ in around)
            found.turn = 2 * arb.pi()
            return found
        for k, (line, start_at, end_at) in enumerate(kept):
            following, next_start, _ = kept[(k + 1) % len(kept)]
            if start_at is None:
                found.segments[line] += 1
            else:
                found.forms.append((line, start_at, -1))
            if end_at is None:
                found.segments[line] += 1
                if next_start is not None:
                    raise Undecided
                found.turn += self._turn(line, following, offsets, disc)
            else:
                found.forms.append((line, end_at, 1))
        return found

    @cached_property
    def norms(self) -> list[fmpq]:
        return [x * x * self.pp + y * y * self.qq for x, y in (line.normal for line in self.lines)]

    def _direction(self, line: int) -> arb:
        x, y = self.lines[line].normal
        return arb.atan2(y * root(self.qq), x * root(self.pp))

    def _turn(self, line: int, following: int, offsets: list[arb], disc: arb) -> arb:
        """The angle from the normal of `line` to the normal of `following`, the line after an arc, with all turns."""
        turn = self._direction(following) - self._direction(line) if following != line else arb(0)
        arc = turn
        for k in (line, following):
            height = offsets[k] / root(self.norms[k])
            arc -= half_turn((disc - height * height).nonnegative_part().sqrt(), height)
        whole = (arc / (2 * arb.pi())).floor()
        if not whole.is_exact():
            raise Undecided
        return turn - whole * 2 * arb.pi()

    # Integrals

    def form(self, line: int, other: int) -> Form:
        """Twice the area of a triangle, as a form over the slices.

        Its corners are the origin, the foot of the origin on `line`, and the point where `line` meets `other`.
        """
        key = (line, other)
        if key not in self._forms:
            p, q = self.corner(line, other)
            x, y = self.lines[line].normal
            norm = self.norms[line]
            way = combined(-y * self.qq / norm, p, x * self.pp / norm, q)
            self._forms[key] = product(self.lines[line].offset, way)[:6]
        return self._forms[key]

    def integral(self, area: SliceArea, low: arb, high: arb, goal: int) -> arb:
        moments = of_form(self.squares, low, high)
        total = arb(0)
        for line, other, side in area.forms:
            total += side * sum((c * m for c, m in zip(self.form(line, other), moments) if c), arb(0))
        disc = self.disc[0] * moments[0] + self.disc[2] * moments[2]
        round_part = area.turn * disc
        for line, count in area.segments.items():
            ends = low / root(self.tt), high / root(self.tt)
            segment = self._strip_segment(line, *ends, goal) if line < 4 else self._plane_segment(line, *ends)
            round_part -= count * root(self.tt) * segment
        return (total + root(self.pp * self.qq) * round_part) / 2

    def _plane_segment(self, line: int, low: arb, high: arb) -> arb:
        """The integral of ρ² acos(d/ρ) - d √D with D = ρ² - d², d linear: by parts, and by partial fractions."""
        norm, offset = root(self.norms[line]), self.lines[line].offset
        d0, d1 = offset[0] / norm, offset[1] * root(self.tt) / norm
        square, radius = arb(self.thick), root(self.thick)
        rest = Parabola(square - d0 * d0, -2 * d0 * d1, 1 + d1 * d1)
        ends = []
        for t in (low, high):
            one, two, three, area, moment = rest.moments(t)
            value = rest(t).sqrt()
            found = (square * t - t**3 / 3) * half_turn(value, d0 + d1 * t)
            found += (d1 * square * two + d0 * three - 2 * square * d0 * one) / 3
            ends.append(found - d0 * area - d1 * moment)
        total = ends[1] - ends[0]
        through_pole = offset[0] * offset[0] == offset[1] * offset[1] * self.tt * self.thick
        for side, pole in ((-1, radius), (1, -radius)):
            if through_pole and side * offset[0] * offset[1] >= 0:
                continue  # the slack and the term of the pole are zero, but ball arithmetic may not show it
            slack = d0 + d1 * pole
            slope = -2 * pole - 2 * slack * d1
            turns = [
                arb.atan2(slope * (t - pole) - 2 * slack * slack, 2 * abs(slack) * rest(t).sqrt()) for t in (low, high)
            ]
            sign = arb(1) if slack > 0 else arb(-1) if slack < 0 else arb(0, 1)
            total += side * sign * (turns[1] - turns[0]) * radius**3 / 3
        return total

    def _strip_segment(self, line: int, low: arb, high: arb, goal: int) -> arb:
        """The integral of `_plane_segment` with d = ±level + ρ₁.

        The variable is an angle. Its cosine is proportional to the smaller half width, of the disc or of the strip.
        """
        side = 1 if line == 0 else -1
        away = arb(side * self.level) / root(self.pp)
        thin, thick = arb(self.thin), arb(self.thick)
        radius = root(self.thin)
        # The value at t = 0. The loss at other t is no difference: ball arithmetic might not decide its sign.
        rest = thick - thin - away * away - 2 * away * radius
        tube_is_thin = self.thin <= self.thick
        least = root(min(self.thin, self.thick))
        pi, turned = arb.pi(), acb(0, 1)
        excess, least_square = arb(abs(self.thick - self.thin)), least * least

        def slice_(angle: acb, analytic: bool) -> acb:
            cosine = angle.cos()
            long_square = excess + least_square * cosine * cosine
            long = long_square.sqrt(analytic=analytic)
            short = least * cosine
            tube, disc = (short, long) if tube_is_thin else (long, short)
            if tube_is_thin:
                less = 2 * radius * (angle / 2).sin() ** 2
            else:
                less = least_square * angle.sin() ** 2 / (radius + tube)
            height = away + tube
            reach = (rest + 2 * away * less).sqrt(analytic=analytic)
            other = turned * reach
            if height.real.mid() >= 0:
                turn = -turned * ((height + other) / disc).log(analytic=analytic)
            else:
                turn = pi + turned * ((other - height) / disc).log(analytic=analytic)
            found = (disc * disc * turn - height * reach) * short
            if not analytic and not found.is_finite():
                # Near a pole of the ball, the angle has no bounds. The area is between 0 and the area of the disc.
                return acb((pi * disc * disc * short).real.union(arb(0)))
            return found

        ends = [arb.atan2(t, (least * least - t * t).nonnegative_part().sqrt()) for t in (low, high)]
        return integrated(slice_, ends[0], ends[1], 8 * thick * least, goal)
