"""The volume that an ellipsoid shares with a capsule or a cylinder, to some twenty digits, by code of its own.

Slices are orthogonal to the axis of the capsule or the cylinder, which is a disc there. The ellipsoid is an ellipse.
The crossings of both are roots of a quartic. Areas of slices follow from Green's theorem, in 400 bits. Where the number
of crossings changes, halving finds the height. Between such heights, Gauss-Legendre rules of two sizes have to agree.
Intervals are halved where they do not.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import mpmath
import numpy as np
from ellipsoid_exact import Matrix, exact, product, transposed
from flint import acb_poly, arb, arb_poly, ctx

from overlapper import Capsule, Cylinder, Ellipsoid

BITS = 400
NODES, FEWER = 24, 16
MOST_HALVINGS = 20
NEWTON_STEPS = 6
CHANGE_STEPS = 120
SAMPLES = 48


def turn(orientation) -> Matrix:
    x, y, z, w = (exact(q) for q in orientation)
    n = x * x + y * y + z * z + w * w
    return [
        [1 - 2 * (y * y + z * z) / n, 2 * (x * y - z * w) / n, 2 * (x * z + y * w) / n],
        [2 * (x * y + z * w) / n, 1 - 2 * (x * x + z * z) / n, 2 * (y * z - x * w) / n],
        [2 * (x * z - y * w) / n, 2 * (y * z + x * w) / n, 1 - 2 * (x * x + y * y) / n],
    ]


@cache
def rule(count: int) -> list[tuple[arb, arb]]:
    with mpmath.workprec(BITS):
        found = []
        for x, w in zip(*np.polynomial.legendre.leggauss(count), strict=True):
            x = mpmath.findroot(lambda v: mpmath.legendre(count, v), mpmath.mpf(float(x)))
            d = count * (x * mpmath.legendre(count, x) - mpmath.legendre(count - 1, x)) / (x * x - 1)
            w = 2 / ((1 - x * x) * d * d)
            found.append((arb(mpmath.nstr(x, 110)), arb(mpmath.nstr(w, 110))))
        return found


def middle(x: arb) -> arb:
    return x.mid()


class Pair:
    """An ellipsoid in the axes of a capsule or a cylinder about its centre: { x : x·M x − 2 b·x + c <= 0 }."""

    def __init__(self, ellipsoid, at, orientation, tube, tube_at, tube_orientation):
        assert isinstance(ellipsoid, Ellipsoid) and isinstance(tube, (Capsule, Cylinder))
        ctx.prec = BITS
        own, other = turn(orientation), turn(tube_orientation)
        rows = product(transposed(own), other)
        h = [exact(v) for v in ellipsoid.half_axes]
        scaled = [[rows[i][j] / h[i] for j in range(3)] for i in range(3)]
        self.m = product(transposed(scaled), scaled)
        away = [exact(p) - exact(q) for p, q in zip(at, tube_at, strict=True)]
        c = [sum(other[k][i] * away[k] for k in range(3)) for i in range(3)]
        self.b = [sum(self.m[i][k] * c[k] for k in range(3)) for i in range(3)]
        self.c = sum(c[i] * self.b[i] for i in range(3)) - 1
        self.radius, self.half = exact(tube.radius), exact(tube.length) / 2
        self.round_ends = isinstance(tube, Capsule)

    def square(self, t: arb) -> arb:
        """The squared radius of the disc."""
        beyond = abs(t) - self.half
        if not beyond > 0:
            return self.radius * self.radius
        return self.radius * self.radius - beyond * beyond if self.round_ends else arb(-1)

    def area(self, t: arb) -> arb:
        return self.slice(t)[0]

    def slice(self, t: arb) -> tuple[arb, int]:
        """The area, and the number of crossings: -1 for a whole disc, -2 for a whole ellipse."""
        square = self.square(t)
        if not square > 0:
            return arb(0), 0
        r = square.sqrt()
        m, b = self.m, self.b
        p, q, s = m[0][0], m[0][1], m[1][1]
        u, v = b[0] - m[0][2] * t, b[1] - m[1][2] * t
        w = m[2][2] * t * t - 2 * b[2] * t + self.c
        det = p * s - q * q
        centre = ((s * u - q * v) / det, (p * v - q * u) / det)
        left = u * centre[0] + v * centre[1] - w  # the ellipse: (x - centre)·(p q; q s)(x - centre) <= left
        if not left > 0:
            return arb(0), 0

        def on_ellipse(x, y):
            return p * x * x + 2 * q * x * y + s * y * y - 2 * (u * x + v * y) + w

        # On the circle, with x = r (1 − z²) / (1 + z²) and y = r 2 z / (1 + z²).
        quartic = arb_poly([p * square - 2 * u * r + w, 4 * q * square - 4 * v * r,
                            4 * s * square - 2 * p * square + 2 * w, -4 * q * square - 4 * v * r,
                            p * square + 2 * u * r + w])  # fmt: skip
        quartic = arb_poly([middle(k) for k in quartic.coeffs()])
        slope = quartic.derivative()
        roots = []
        for z in acb_poly(quartic).roots(maxprec=8 * BITS):
            if not z.imag.contains(arb(0)):
                continue
            x = middle(z.real)
            for _ in range(NEWTON_STEPS):
                x = middle(x - quartic(x) / slope(x))
            roots.append(x)
        angles = sorted((2 * z.atan() for z in roots), key=float_key)
        # The ellipse is centre + stretch (cos, sin).
        first = (left / p).sqrt(), arb(0)
        second = -q / p * (left * p / det).sqrt(), (left * p / det).sqrt()
        if not angles:
            if on_ellipse(r, arb(0)) < 0:
                return arb.pi() * square, -1
            inside = centre[0] * centre[0] + centre[1] * centre[1] < square
            return (arb.pi() * left / det.sqrt(), -2) if inside else (arb(0), 0)
        total = arb(0)
        turns = 2 * arb.pi()
        for low, high in zip(angles, [*angles[1:], angles[0] + turns], strict=True):
            half = (low + high) / 2
            if on_ellipse(r * half.cos(), r * half.sin()) < 0:
                total += square * (high - low) / 2
        places = []
        for angle in angles:
            x, y = r * angle.cos() - centre[0], r * angle.sin() - centre[1]
            places.append(arb.atan2(y / second[1], (x - second[0] * y / second[1]) / first[0]))
        places.sort(key=float_key)
        cross = first[0] * second[1]
        for low, high in zip(places, [*places[1:], places[0] + turns], strict=True):
            half = (low + high) / 2
            x = centre[0] + first[0] * half.cos() + second[0] * half.sin()
            y = centre[1] + second[1] * half.sin()
            if x * x + y * y < square:
                cosine, sine = high.cos() - low.cos(), high.sin() - low.sin()
                way = first[0] * cosine + second[0] * sine, second[1] * sine
                total += (cross * (high - low) + centre[0] * way[1] - centre[1] * way[0]) / 2
        return total, len(angles)


def float_key(x: arb):
    return mpmath.mpf(x.str(60, radius=False))


def change(pair: Pair, low: arb, high: arb) -> arb:
    """A height between two slices of different kinds, where the kind of slices changes."""
    kind = pair.slice(low)[1]
    for _ in range(CHANGE_STEPS):
        between = middle((low + high) / 2)
        if pair.slice(between)[1] == kind:
            low = between
        else:
            high = between
    return low


def samples(low: arb, high: arb) -> list[arb]:
    """Heights between two others, many of them near the ends."""
    shares = [arb(k) / SAMPLES for k in range(1, SAMPLES)]
    near = [arb(2) ** -k for k in range(6, 60, 2)]
    return sorted((middle(low + (high - low) * x) for x in [*shares, *near, *(1 - x for x in near)]), key=float_key)


def volume(pair: Pair, inside: float, agreed: str = "1e-18") -> float:
    """The volume, by slices on both sides of one with a positive area, at a height along the axis."""
    ctx.prec = BITS
    start, most = exact(inside), pair.half + pair.radius
    kind = pair.slice(start)[1]
    assert kind != 0
    low, high = (end_of_slices(pair, start, middle(side * most)) for side in (-1, 1))
    ends = sorted([low, high, *(k for k in (-pair.half, pair.half) if low < k < high)], key=float_key)
    changes = []
    for a, b in pairwise(ends):
        at = samples(a, b)
        changes += [change(pair, p, q) for p, q in pairwise(at) if pair.slice(p)[1] != pair.slice(q)[1]]
    ends = sorted([*ends, *changes], key=float_key)
    fine_rule, coarse_rule = rule(NODES), rule(FEWER)

    def by(which, a, b, low_share, high_share):
        """Over a part of an interval, in the angle θ of t = middle − half cos θ."""
        half, mid = (b - a) / 2, (a + b) / 2
        from_angle, to_angle = arb.pi() * low_share, arb.pi() * high_share
        step, at = (to_angle - from_angle) / 2, (to_angle + from_angle) / 2
        angles = [(w, at + step * x) for x, w in which]
        return middle(
            half * step * sum(w * angle.sin() * pair.area(middle(mid - half * angle.cos())) for w, angle in angles)
        )

    scale = sum(by(coarse_rule, a, b, arb(0), arb(1)) for a, b in pairwise(ends))
    result = arb(0)
    parts = [(a, b, arb(0), arb(1), 0) for a, b in pairwise(ends)]
    while parts:
        a, b, p, q, halvings = parts.pop()
        fine, coarse = by(fine_rule, a, b, p, q), by(coarse_rule, a, b, p, q)
        if abs(fine - coarse) < arb(agreed) * scale or halvings == MOST_HALVINGS:
            result += fine
            continue
        parts += [(a, b, p, (p + q) / 2, halvings + 1), (a, b, (p + q) / 2, q, halvings + 1)]
    return float(result.mid().str(25, radius=False))


def end_of_slices(pair: Pair, inside: arb, outside: arb) -> arb:
    """The height from which slices are empty, seen from a slice that is not."""
    for _ in range(CHANGE_STEPS):
        between = middle((inside + outside) / 2)
        if pair.area(between) > 0:
            inside = between
        else:
            outside = between
    return inside
