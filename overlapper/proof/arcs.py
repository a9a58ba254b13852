"""Slices between quadrics and planes. Their outlines of arcs and chords are followed and proved, in ball arithmetic.

The proof of a guessed outline does not need the crossings of all other curves. Each arc lies on the curve of one
constraint and below all others, because the corners of a polygon of tangents around the arc lie below all others. So
all arcs lie on the boundary of the slice, which is convex. A closed chain of such arcs that goes round once is the
boundary.

Corners are proved by Kantorovich's theorem, with a Taylor polynomial P in place of a point: F(P + e) = 0 has a solution
with |e| <= 2 α if 4 α β γ < 1. Here α bounds |J⁻¹ F(P)|, β bounds |J⁻¹|, and γ bounds the quadratic terms.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

from flint import arb, arb_poly, arb_series, ctx

from overlapper.proof.outline import Outline
from overlapper.proof.round_frame import Constraint, Floats

# The number of coefficients of a Taylor polynomial of a corner.
ORDER = 10
# Bounds in doubles are multiplied by this factor, which exceeds all their rounding.
UP = 1.0 + 2.0**-40
# The most parts into which an interval is cut to prove its outline, and into which an arc is cut.
PARTS, FINEST = 16, 1 << 18


class Refused(ArithmeticError):
    """An outline that is not proved."""


class Curve:
    """A constraint in slices: a p² + 2 b p q + c q² + 2 d(t) p + 2 e(t) q + f(t) <= 0."""

    def __init__(self, constraint: Constraint) -> None:
        (f2, d1, e1), (_, a, b), (_, _, c) = constraint.form
        f1, d0, e0 = constraint.linear
        size = abs(constraint.constant)
        self.a, self.b, self.c = (arb(x / size) for x in (a, b, c))
        self.d0, self.d1, self.e0, self.e1 = (arb(x / size) for x in (d0, d1, e0, e1))
        self.f0, self.f1, self.f2 = (arb(x / size) for x in (constraint.constant, 2 * f1, f2))
        det = a * c - b * b
        self.is_flat = not any((a, b, c))
        if not self.is_flat and det <= 0:
            raise Refused
        self.det = arb(det / size**2)
        self.root = self.det.sqrt()
        self.bend = above(abs(self.a) + 2 * abs(self.b) + abs(self.c))

    def at(self, t: Any) -> tuple[Any, Any, Any]:
        return self.d0 + self.d1 * t, self.e0 + self.e1 * t, self.f0 + t * (self.f1 + self.f2 * t)

    def half_gradient(self, level: tuple[Any, Any, Any], p: Any, q: Any) -> tuple[Any, Any]:
        if self.is_flat:
            return level[0], level[1]
        return self.a * p + self.b * q + level[0], self.b * p + self.c * q + level[1]

    def value(self, level: tuple[Any, Any, Any], half: tuple[Any, Any], p: Any, q: Any) -> Any:
        return p * (half[0] + level[0]) + q * (half[1] + level[1]) + level[2]

    def square(self, p: Any, q: Any) -> Any:
        return p * (self.a * p + 2 * self.b * q) + self.c * q * q

    def arm(self, half: tuple[Any, Any]) -> tuple[Any, Any]:
        """The vector from the centre of the conic to a point, from half the gradient at the point."""
        u, v = half
        return (self.c * u - self.b * v) / self.det, (self.a * v - self.b * u) / self.det


def above(x: arb) -> float:
    """A double that is not below |x|."""
    return float(x.abs_upper()) * UP


def ceilings(poly: Any) -> list[float]:
    return [above(c) for c in poly.coeffs()]


def most(bounds: list[float], disc: float) -> float:
    total = 0.0
    for bound in reversed(bounds):
        total = total * disc + bound
    return total * UP


class Path:
    """t = anchor + side x², or t = anchor + side x."""

    def __init__(self, anchor: float, side: int) -> None:
        self.anchor, self.side = arb(anchor), side

    def t(self, x: Any) -> Any:
        return self.anchor + self.side * x * x

    def series(self, x: float, kind: Any) -> Any:
        return kind([self.t(arb(x)), 2 * self.side * arb(x), arb(self.side)])


class Corner:
    """A corner along a path, as a polynomial in x - middle, with an error bound in a disc by Kantorovich's theorem."""

    def __init__(self, one: Curve, other: Curve, path: Path, middle: float, start: Floats) -> None:
        p, q = self._series(one, other, path, middle, start)
        self.p, self.q = (arb_poly([float(c.mid()) for c in series.coeffs()]) for series in (p, q))
        t = path.series(middle, arb_poly)
        halves, values = [], []
        for curve in (one, other):
            level = curve.at(t)
            halves.append(curve.half_gradient(level, self.p, self.q))
            values.append(curve.value(level, halves[-1], self.p, self.q))
        (a, b), (c, d) = halves
        det = ceilings_and_first(2 * (a * d - b * c))
        self.first, self.rest = det
        self.residual = [ceilings(d * values[0] - b * values[1]), ceilings(a * values[1] - c * values[0])]
        self.adjugate = [[ceilings(as_poly(x)) for x in row] for row in ((d, b), (a, c))]
        self.bend = max(one.bend, other.bend)

    @staticmethod
    def _series(one: Curve, other: Curve, path: Path, middle: float, start: Floats) -> tuple[Any, Any]:
        """The power series of a corner, by Newton's method. The number of correct terms doubles in every step."""
        ctx.cap = 1
        p, q = arb_series([float(start[0])]), arb_series([float(start[1])])
        for cap in (1, 1, 1, 2, 4, 8, ORDER, ORDER):
            ctx.cap = cap
            t = path.series(middle, arb_series)
            p, q = arb_series(p.coeffs()), arb_series(q.coeffs())
            halves, values = [], []
            for curve in (one, other):
                level = curve.at(t)
                halves.append(curve.half_gradient(level, p, q))
                values.append(curve.value(level, halves[-1], p, q))
            (a, b), (c, d) = halves
            det = 2 * (a * d - b * c)
            if det[0].contains(0):
                raise Refused
            p -= (d * values[0] - b * values[1]) / det
            q -= (a * values[1] - c * values[0]) / det
            p, q = (arb_series([x.mid() for x in series.coeffs()]) for series in (p, q))
        return p, q

    def error(self, disc: float) -> float:
        """A bound of the distance of the corner from the polynomial in |x - middle| <= disc, or infinity."""
        least = self.first - most(self.rest, disc) * disc
        if not least > 0:
            return math.inf
        alpha = max(most(residual, disc) for residual in self.residual) / least * UP
        beta = max(sum(most(x, disc) for x in row) for row in self.adjugate) / least * UP
        # Half gradients are half the derivatives: the inverse of J is twice the adjugate over twice the determinant.
        if not 4 * alpha * beta * self.bend < 0.9:
            return math.inf
        self.unique = 0.49 / (beta * self.bend) if beta * self.bend > 0 else math.inf
        return 2 * alpha * UP


def as_poly(x: Any) -> arb_poly:
    return x if isinstance(x, arb_poly) else arb_poly([x])


def ceilings_and_first(poly: Any) -> tuple[float, list[float]]:
    coefficients = as_poly(poly).coeffs()
    return float(coefficients[0].abs_lower()) / UP, [above(c) for c in coefficients[1:]]


class Model:
    """A function that differs from a polynomial in ξ by at most `error` while |ξ| <= disc."""

    __slots__ = ("_most", "disc", "error", "poly")

    def __init__(self, poly: arb_poly, error: float, disc: float) -> None:
        if poly.length() > ORDER:
            coefficients = poly.coeffs()
            error += most([above(c) for c in coefficients[ORDER:]], disc) * disc**ORDER * UP
            poly = arb_poly(coefficients[:ORDER])
        self.poly, self.error, self.disc = poly, error, disc
        self._most = -1.0

    def most(self) -> float:
        if self._most < 0:
            self._most = (most(ceilings(self.poly), self.disc) + self.error) * UP
        return self._most

    def least(self) -> float:
        """A lower bound of the absolute value; not positive if the value may be zero."""
        first, rest = ceilings_and_first(self.poly)
        return first - (most(rest, self.disc) * self.disc + self.error) * UP

    def __add__(self, other: Model) -> Model:
        return Model(self.poly + other.poly, (self.error + other.error) * UP, self.disc)

    def __sub__(self, other: Model) -> Model:
        return Model(self.poly - other.poly, (self.error + other.error) * UP, self.disc)

    def __mul__(self, other: Model) -> Model:
        error = 0.0
        if self.error or other.error:
            error = (self.most() * other.error + other.most() * self.error) * UP
        return Model(self.poly * other.poly, error, self.disc)

    def times(self, factor: Any) -> Model:
        return Model(self.poly * factor, self.error * above(arb(factor)), self.disc)

    def at(self, away: arb) -> arb:
        return self.poly(away) + arb(0, self.error)


Pair = tuple[Model, Model]


def crossed(u: Pair, v: Pair) -> Model:
    return u[0] * v[1] - u[1] * v[0]


def dotted(u: Pair, v: Pair) -> Model:
    return u[0] * v[0] + u[1] * v[1]


class Arc:
    """An arc of a conic while |ξ| <= disc: angle(ξ) = middle + atan(across / along)."""

    def __init__(self, curve: Curve, level: tuple[Model, Model, Model], start: Pair, end: Pair) -> None:
        self.curve = curve
        u, v = _arm(curve, (level[0], level[1]))
        self.square = u * level[0] + v * level[1] - level[2]  # the squared radius, in the frame of the circle
        self.arms = (start[0] + u, start[1] + v), (end[0] + u, end[1] + v)
        way = end[0] - start[0], end[1] - start[1]
        self.way = way
        sine = crossed(self.arms[0], way).times(curve.root)
        cosine = self.square - _square(curve, way, way).times(arb(1) / 2)
        first = [float(x.poly[0].mid() / self.square.poly[0].mid()) for x in (sine, cosine)]
        self.angle = arb(angle_of(first[0], first[1]))
        s, c = self.angle.sin(), self.angle.cos()
        self.across, self.along = sine.times(c) - cosine.times(s), cosine.times(c) + sine.times(s)

    def turn(self, away: arb) -> arb:
        along = self.along.at(away)
        if not along > 0:
            raise Refused
        return self.angle + (self.across.at(away) / along).atan()

    def widest(self) -> float:
        """A bound of the segment's area in the disc."""
        least = self.along.least()
        ratio = self.across.most() / least if least > 0 else 1.0
        if not ratio < 0.95:
            raise Refused
        more = math.atanh(ratio) * UP
        wide = above(self.angle) + more
        return (
            self.square.most()
            / 2
            / float(self.curve.root.abs_lower())
            * UP
            * min(math.sinh(wide) - wide + 1e-9 * wide**3, wide + math.cosh(more))
            * UP
        )


def _arm(curve: Curve, half: Pair) -> Pair:
    u, v = half
    inverse = 1 / curve.det
    return (
        u.times(curve.c * inverse) - v.times(curve.b * inverse),
        v.times(curve.a * inverse) - u.times(curve.b * inverse),
    )


def _image(curve: Curve, u: Pair) -> Pair:
    return u[0].times(curve.a) + u[1].times(curve.b), u[0].times(curve.b) + u[1].times(curve.c)


def _square(curve: Curve, u: Pair, v: Pair) -> Model:
    return dotted(_image(curve, u), v)


class Following:
    """An outline that is followed along a path, in a neighbourhood of x = middle."""

    def __init__(self, curves: list[Curve], outline: Outline, path: Path, middle: float) -> None:
        self.curves, self.outline, self.path, self.middle = curves, outline, path, middle
        self.chain = outline.chain
        self.pairs = outline.pairs()
        self.corners = [
            Corner(curves[i], curves[j], path, middle, start)
            for (i, j), start in zip(self.pairs, outline.corners, strict=True)
        ]

    def disc(self, wanted: float) -> float:
        """The radius, at most `wanted`, of a disc in which the corners are proved to be analytic."""
        disc = wanted
        while any(corner.error(disc) == math.inf for corner in self.corners):
            disc *= 0.85
            if disc < 1e-3 * wanted:
                raise Refused
        return disc

    def model(self, disc: float) -> None:
        """Make models of all functions that determine the outline in a disc."""
        t = self.path.series(self.middle, arb_poly)

        def exact(x: Any) -> Model:
            return Model(as_poly(x), 0.0, disc)

        self.levels: list[tuple[Model, Model, Model]] = []
        for curve in self.curves:
            d, e, f = curve.at(t)
            self.levels.append((exact(d), exact(e), exact(f)))
        self.points: list[Pair] = []
        self.seen: list[list[tuple[Model | None, Pair]]] = []
        for corner, pair in zip(self.corners, self.pairs):
            error = corner.error(disc)
            point = Model(corner.p, error, disc), Model(corner.q, error, disc)
            there: list[tuple[Model | None, Pair]] = []
            for k, curve in enumerate(self.curves):
                d, e, f = self.levels[k]
                half = (d, e)
                if not curve.is_flat:
                    image = _image(curve, point)
                    half = image[0] + d, image[1] + e
                value = None if k in pair else point[0] * (half[0] + d) + point[1] * (half[1] + e) + f
                there.append((value, half))
            self.points.append(point)
            self.seen.append(there)
        self._sides: dict[tuple[int, int], list[list[Model | None]]] = {}
        self.arcs: list[Arc | None] = []
        if self.pairs:
            for k, number in enumerate(self.chain):
                curve = self.curves[number]
                arc = None if curve.is_flat else Arc(curve, self.levels[number], self.points[k - 1], self.points[k])
                self.arcs.append(arc)

    # In thin numbers.

    def area(self, x: arb) -> arb:
        """The area of the slice at x, up to rounding."""
        t = self.path.t(x)
        used = {k: self.curves[k].at(t) for k in self.chain}
        if not self.pairs:
            whole: arb = self._whole(self.curves[self.chain[0]], used[self.chain[0]])
            return whole
        away = x - self.middle
        points, halves = [], []
        for (i, j), corner in zip(self.pairs, self.corners):
            guess = corner.p(away).mid(), corner.q(away).mid()
            p, q = exactly(self.curves[i], self.curves[j], used[i], used[j], *guess)
            if not (abs(p - guess[0]) < corner.unique and abs(q - guess[1]) < corner.unique):
                raise Refused
            points.append((p, q))
            halves.append(self.curves[j].half_gradient(used[j], p, q))
        (p, q), *others = points
        arms = [(u - p, v - q) for u, v in others]
        total: arb = sum((a * d - b * c for (a, b), (c, d) in pairwise(arms)), arb(0)) / 2
        for k, number in enumerate(self.chain):
            curve = self.curves[number]
            if not curve.is_flat:
                way = points[k][0] - points[k - 1][0], points[k][1] - points[k - 1][1]
                total += segment(curve, halves[k - 1], way)
        return total

    @staticmethod
    def _whole(curve: Curve, level: tuple[Any, Any, Any]) -> Any:
        d, e, f = level
        u, v = curve.arm((d, e))
        return arb.pi() * (u * d + v * e - f) / curve.root

    # In a disc, after `model`.

    def bound(self) -> float:
        """A bound of the area in the disc; Refused unless it is proved to be analytic there."""
        if not self.pairs:
            curve, (d, e, f) = self.curves[self.chain[0]], self.levels[self.chain[0]]
            u, v = _arm(curve, (d, e))
            return (u * d + v * e - f).most() * 4 / float(curve.root.abs_lower())
        first = self.points[0]
        arms = [(p - first[0], q - first[1]) for p, q in self.points[1:]]
        total = sum((crossed(u, v).most() / 2 for u, v in pairwise(arms)), 0.0)
        total += sum((arc.widest() for arc in self.arcs if arc is not None), 0.0)
        if not total < 1e300:
            raise Refused
        return total * UP

    # The proof of the outline.

    def prove(self, low: float, high: float) -> None:
        """Prove that all slices between x = low and x = high have this outline, in as many parts as needed."""
        self._turns_once()
        work = [(low, high, 1)]
        while work:
            start, end, parts = work.pop()
            if not self._is_proved(start, end):
                if parts >= PARTS:
                    raise Refused
                middle = (start + end) / 2
                work += [(start, middle, 2 * parts), (middle, end, 2 * parts)]

    def _turns_once(self) -> None:
        """Prove that the corners go round a point once. The middle slice is enough, because corners never meet."""
        if len(self.points) < 3:
            return
        points = [(p.poly[0] + arb(0, p.error), q.poly[0] + arb(0, q.error)) for p, q in self.points]
        count = len(points)
        p, q = (sum((point[k].mid() for point in points), arb(0)) / count for k in (0, 1))
        arms = [(u - p, v - q) for u, v in points]
        total = arb(0)
        for (a, b), (c, d) in zip(arms, arms[1:] + arms[:1]):
            if not a * d - b * c > 0:
                raise Refused
            total += arb.atan2(a * d - b * c, a * c + b * d)
        if not total < 7:
            raise Refused

    def _is_proved(self, low: float, high: float) -> bool:
        x = arb(low).union(arb(high))
        away = x - self.middle
        if not self.pairs:
            return self._is_whole(away)
        for there in self.seen:
            for value, _ in there:
                if value is not None and not value.at(away) <= 0:
                    return False
        for k, arc in enumerate(self.arcs):
            if arc is None:
                continue
            half_turn = arc.turn(away) / 2
            if not half_turn > 0:
                return False
            if not all(self._half_is_below(k, side, half_turn, away) for side in (1, -1)):
                return False
        return True

    def _half_is_below(self, k: int, side: int, turn: arb, away: arb) -> bool:
        """Whether the half of an arc next to a corner is below all other constraints.

        A polygon of tangents around it has its points at `inwards * arm + sideways * tangent` from the corner.
        """
        if (k, side) not in self._sides:
            self._sides[k, side] = list(self._seen_along(k, side))
        # The polygon with fixed angles goes past the middle of the arc, but not past its end.
        enough = turn.upper()
        if not enough < 2 * turn.lower():
            return False
        cuts = 1 if enough < 1 else 2 if enough < 2 else 4
        steps: dict[tuple[int, int], tuple[Step, Step]] = {}

        def touching(m: int, count: int) -> tuple[Step, Step]:
            if (m, count) not in steps:
                steps[m, count] = tangents(enough, m, count)
            return steps[m, count]

        return all(
            is_arc_below(lambda step, form=form: is_below(form, step, away), touching, cuts)  # type: ignore[misc]
            for form in self._sides[k, side]
        )

    def _seen_along(self, k: int, side: int) -> Iterator[list[Model | None]]:
        """Each other constraint as a quadratic in (inwards, sideways). A constant term that is zero is None."""
        number, arc = self.chain[k], self.arcs[k]
        assert arc is not None
        arm, seen = (arc.arms[0], self.seen[k - 1]) if side > 0 else (arc.arms[1], self.seen[k])
        factor, half = side / arc.curve.root, seen[number][1]
        tangent = half[1].times(-factor), half[0].times(factor)
        for other, (value, slope) in enumerate(seen):
            if other == number:
                continue
            form: list[Model | None] = [value, dotted(slope, arm).times(2), dotted(slope, tangent).times(2)]
            curve = self.curves[other]
            if not curve.is_flat:
                image = _image(curve, arm)
                form += [dotted(image, arm), dotted(image, tangent).times(2), _square(curve, tangent, tangent)]
            yield form

    def _is_whole(self, away: arb) -> bool:
        """Whether a whole ellipse is below all other constraints.

        Points of a polygon around it are c + ρ w, with constants w. Another constraint at these points is
        L + 2 ρ N <= 0. Its sign is the sign of a polynomial, because L, N and ρ² are polynomials.
        """
        number = self.chain[0]
        curve, (d, e, f) = self.curves[number], self.levels[number]
        u, v = _arm(curve, (d, e))
        square = u * d + v * e - f
        if not square.at(away) > 0:
            return False
        centre = u.times(-1), v.times(-1)
        x = 1 / curve.a.sqrt()
        along = -curve.b * x / curve.root, curve.a * x / curve.root
        steps: dict[tuple[int, int], tuple[Step, Step]] = {}

        def touching(m: int, count: int) -> tuple[Step, Step]:
            if (m, count) not in steps:
                outer, end = (
                    ((inwards + 1) * x + sideways * along[0], sideways * along[1])
                    for inwards, sideways in tangents(2 * arb.pi(), m, count)
                )
                steps[m, count] = outer, end
            return steps[m, count]

        for k, other in enumerate(self.curves):
            if k == number:
                continue
            level = self.levels[k]
            half = level[0], level[1]
            if not other.is_flat:
                image = _image(other, centre)
                half = image[0] + level[0], image[1] + level[1]
            value = centre[0] * (half[0] + level[0]) + centre[1] * (half[1] + level[1]) + level[2]

            def holds(w: Step, other: Curve = other, half: Pair = half, value: Model = value) -> bool:
                still = value if other.is_flat else value + square.times(other.square(*w))
                rise = half[0].times(w[0]) + half[1].times(w[1])
                below, falls = still.at(away) <= 0, rise.at(away) <= 0
                if below and falls:
                    return True
                excess = (still * still - (square * rise * rise).times(4)).at(away)
                return bool((falls and excess <= 0) or (below and excess >= 0))

            if not is_arc_below(holds, touching, 8):
                return False
        return True


Step = tuple[arb, arb]


def is_arc_below(holds: Callable[[Step], bool], touching: Callable[[int, int], tuple[Step, Step]], cuts: int) -> bool:
    """Whether a convex constraint holds on a polygon of tangents around an arc. The arc is cut where necessary."""
    work = [(m, cuts) for m in range(cuts)]
    while work:
        m, count = work.pop()
        outer, end = touching(m, count)
        if not holds(end) or (count > FINEST and not holds(outer)):
            return False
        if not holds(outer):
            work += [(2 * m, 2 * count), (2 * m + 1, 2 * count)]
    return True


def tangents(turn: arb, m: int, count: int) -> tuple[Step, Step]:
    """For part m of an arc: the point where the tangents at its ends meet, and its end.

    Both are (cos - 1, sin), computed without cancellation.
    """
    part = turn / (2 * count)
    scale = part.cos()
    middle, end = part * (2 * m + 1), part * (2 * m + 2)
    inwards = -2 * ((middle + part) / 2).sin() * ((middle - part) / 2).sin()
    half = (end / 2).sin()
    return (inwards / scale, middle.sin() / scale), (-2 * half * half, end.sin())


def is_below(form: list[Model | None], step: Step, away: arb) -> bool:
    """Whether a quadratic in `step` is not positive for all values of `away`."""
    u, v = step
    parts = list(zip(form, (arb(1), u, v, u * u, u * v, v * v)))
    poly, error = arb_poly([0]), arb(0)
    for model, factor in parts:
        if model is not None:
            poly += model.poly * factor
            error += abs(factor) * model.error
    return bool(poly(away) + error <= 0)


def angle_of(sine: float, cosine: float) -> float:
    return math.atan2(sine, cosine) % (2 * math.pi)


def turned(sine: arb, cosine: arb) -> arb:
    """The angle in (0, 2π) of a point near the unit circle."""
    angle = arb(angle_of(float(sine.mid()), float(cosine.mid())))
    s, c = angle.sin(), angle.cos()
    return angle + arb.atan2(sine * c - cosine * s, cosine * c + sine * s)


def segment(curve: Curve, half: tuple[arb, arb], way: tuple[arb, arb]) -> arb:
    """The area between an arc and its chord: `half` is half the gradient at the arc's start, `way` leads to its end."""
    x = curve.arm(half)
    square = x[0] * half[0] + x[1] * half[1]
    sine = curve.root * (x[0] * way[1] - x[1] * way[0]) / square
    cosine = 1 - curve.square(*way) / (2 * square)
    area: arb = square / curve.root / 2 * (turned(sine, cosine) - sine)
    return area


def exactly(one: Curve, other: Curve, at_one: Any, at_other: Any, p: arb, q: arb) -> tuple[arb, arb]:
    """The corner near a point, by Newton's method and Kantorovich's theorem."""
    goal = 2.0 ** (-0.6 * ctx.prec)
    for _ in range(12):
        (a, b), (c, d) = one.half_gradient(at_one, p, q), other.half_gradient(at_other, p, q)
        f, g = one.value(at_one, (a, b), p, q), other.value(at_other, (c, d), p, q)
        det = 2 * (a * d - b * c)
        u, v = (d * f - b * g) / det, (a * g - c * f) / det
        alpha = max(above(u), above(v))
        beta = max(above((abs(a) + abs(c)) / det), above((abs(b) + abs(d)) / det)) * max(one.bend, other.bend)
        if not alpha < 1e9:
            raise Refused
        error = 4 * alpha * alpha * beta * UP
        if 4 * alpha * beta < 0.9 and error < goal:
            break
        p, q = (p - u).mid(), (q - v).mid()
    else:
        raise Refused
    around = arb(0, error)
    return p - u + around, q - v + around
