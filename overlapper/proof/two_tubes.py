"""The volume that two crossing cylinders and a polytope share. A slice is a parallelogram, cut by lines."""

from __future__ import annotations

from collections.abc import Iterator

from flint import acb, arb, fmpq, fmpq_poly

from overlapper.proof.corners import Polytope
from overlapper.proof.one_quadric import root
from overlapper.proof.pieces import Tube
from overlapper.proof.slices import (
    ZERO,
    Form,
    Line,
    Point,
    SliceArea,
    Slices,
    T,
    at,
    half_turn,
    integrated,
    of_form,
    points_between,
    product,
    roots,
)
from overlapper.proof.vectors import cross, dot, minus


class TwoTubes(Slices):
    """Coordinates: t along the common normal of both axes, p and q perpendicular to each axis."""

    def __init__(self, one: Tube, other: Tube, polytope: Polytope) -> None:
        a, b = one.axis, other.axis
        normal = cross(a, b)
        self.tt = dot(normal, normal)
        ways = cross(normal, a), cross(normal, b)
        shift = minus(other.point, one.point)
        self.levels = ZERO, dot(ways[1], shift)
        centres = ZERO, dot(normal, shift)
        self.squares = tuple(
            dot(way, way) * (tube.square - (T - centre) ** 2 / self.tt)
            for way, tube, centre in zip(ways, (one, other), centres)
        )
        self.corners = []
        for corner in polytope.corners:
            x = minus(corner, one.point)
            self.corners.append((dot(normal, x), dot(ways[0], x), dot(ways[1], x)))
        self.edges = polytope.edges()
        unit, level = fmpq(1), self.levels[1]
        self.lines = [
            Line((unit, ZERO), (ZERO, ZERO, unit, ZERO)),
            Line((ZERO, unit), (level, ZERO, ZERO, unit)),
            Line((-unit, ZERO), (ZERO, ZERO, unit, ZERO)),
            Line((ZERO, -unit), (-level, ZERO, ZERO, unit)),
        ]
        self.steep = []
        for facet in polytope.facets:
            n = facet.plane.normal
            rates = dot(n, normal) / self.tt, dot(n, b) / self.tt, -dot(n, a) / self.tt
            height = -facet.plane.height(one.point)
            if rates[1] or rates[2]:
                self.lines.append(Line(rates[1:], (height, -rates[0], ZERO, ZERO)))
            else:
                self.steep.append((rates[0], height))
        self.most = 16 * dot(ways[0], ways[0]) * one.square * dot(ways[1], ways[1]) * other.square
        self.scale = self.tt * self.tt
        self._forms: dict[tuple[int, int, int], Form] = {}

    def widest(self) -> arb:
        return root(self.most)

    def is_outside(self, point: Point, unknown: int = -1) -> bool:
        """Whether the point is certainly outside, for every value of the coordinate with the number `unknown`."""
        t, p, q = point
        for k, (x, level, square) in enumerate(zip((p, q), self.levels, self.squares)):
            off = arb(0) if k == unknown else x - level
            if off * off > at(square, t):
                return True
        return unknown < 0 and self.is_cut_off(point)

    def candidates(self) -> Iterator[tuple[Point, int]]:
        for corner in self.corners:
            yield (arb(corner[0]), arb(corner[1]), arb(corner[2])), -1
        for i, j, _, _ in self.edges:
            start, end = self.corners[i], self.corners[j]
            if start[0] != end[0]:
                # T is the share of the way along the edge.
                way = start[0] + T * (end[0] - start[0])
                for k, (middle, square) in enumerate(zip(self.levels, self.squares)):
                    off = start[k + 1] - middle + T * (end[k + 1] - start[k + 1])
                    shares = roots(off * off - square(way))
                    yield from ((point, -1) for point in points_between(start, end, shares))
        (p_square, q_square), level = self.squares, self.levels[1]
        for line in self.lines[4:]:
            (x, y), b = line.normal, line.offset[0] + line.offset[1] * T
            if y == 0:
                for t in roots((b / x) ** 2 - p_square):
                    yield (t, at(b, t) / x, arb(level)), 1
            elif x == 0:
                for t in roots((b / y - level) ** 2 - q_square):
                    yield (t, arb(0), at(b, t) / y), 0
            else:
                # ±x ρ₁ ± y ρ₂ = height
                height = b - y * level
                mixed = x * x * p_square + y * y * q_square - height * height
                for t in roots(mixed * mixed - 4 * x * x * y * y * p_square * q_square):
                    p_wide, q_wide = (at(square, t).nonnegative_part().sqrt() for square in self.squares)
                    for p_side in (-1, 1):
                        for q_side in (-1, 1):
                            yield (t, p_side * p_wide, level + q_side * q_wide), -1
        for k, square in enumerate(self.squares):
            for t in roots(square):
                yield (t, arb(0), arb(level)), 1 - k

    def area(self, t: arb) -> SliceArea | None:
        one, _, p_wide, q_wide = self.basis(t)
        bs = (line.offset for line in self.lines)
        around = self.polygon([b[0] * one + b[1] * t + b[2] * p_wide + b[3] * q_wide for b in bs])
        if not around:
            return None
        ids = [line for line, _ in around]
        return SliceArea(forms=list(zip([ids[-1], *ids], ids, [*ids[1:], ids[0]])))

    def form(self, before: int, line: int, after: int) -> Form:
        """Twice the area between the origin and the part of a line between two other lines."""
        key = (before, line, after)
        if key not in self._forms:
            (p, q), (u, v) = self.corner(before, line), self.corner(line, after)
            self._forms[key] = [x - y for x, y in zip(product(p, v), product(q, u))]
        return self._forms[key]

    def integral(self, area: SliceArea, low: arb, high: arb, goal: int) -> arb:
        coefficients = [arb(0)] * 10
        for before, line, after in area.forms:
            coefficients = [c + x for c, x in zip(coefficients, self.form(before, line, after))]
        moments = of_form(self.squares, low, high)
        total = sum((c * m for c, m in zip(coefficients, moments)), arb(0))
        if not coefficients[9].is_zero():
            total += coefficients[9] * self._of_both(low, high, goal)
        return total / 2

    def _of_both(self, low: arb, high: arb, goal: int) -> arb:
        """The integral of ρ₁ ρ₂. It is elliptic unless they are proportional, and analytic in the angle used here."""
        p, q = self.squares
        if all(p[i] * q[2] == q[i] * p[2] for i in (0, 1)):
            share = root(q[2] / p[2])
            return share * of_form((p,), low, high)[5]
        (p_low, p_high), (q_low, q_high) = sorted_roots(p), sorted_roots(q)
        start, under = (p_low, q_low) if p_low.mid() > q_low.mid() else (q_low, p_low)
        end, over = (p_high, q_high) if p_high.mid() < q_high.mid() else (q_high, p_high)
        middle, half = (start + end) / 2, (end - start) / 2
        scale = root(p[2] * q[2]) * half * half

        def slice_(angle: acb, analytic: bool) -> acb:
            sine, half_sine, half_cosine = angle.sin(), (angle / 2).sin(), (angle / 2).cos()
            above = start - under + 2 * half * half_sine * half_sine
            below = over - end + 2 * half * half_cosine * half_cosine
            return sine * sine * (above * below).sqrt(analytic=analytic)

        ends = [half_turn(((t - start) * (end - t)).nonnegative_part().sqrt(), middle - t) for t in (low, high)]
        return scale * integrated(slice_, ends[0], ends[1], 2 * (over - under), goal)


def sorted_roots(poly: fmpq_poly) -> list[arb]:
    return sorted(roots(poly), key=lambda x: x.mid())
