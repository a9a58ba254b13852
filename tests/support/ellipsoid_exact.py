"""Measures of what two ellipsoids or balls share, to twenty digits, by code of its own in 300 bits.

The first body is mapped to the unit ball. Slices in which both bodies are discs follow from the principal axes of the
second. Measures are integrals of lenses of two discs between the roots of a quartic. Gauss-Legendre rules of two sizes
have to agree; intervals are halved where they do not. No place is taken with care, as bits are plenty. Ellipsoids that
are similar and parallel are not for this code: the roots of their quartics coincide.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from itertools import pairwise

import mpmath
import numpy as np
from flint import arb, ctx

from overlapper import Ellipsoid, Placed, Sphere

BITS = 320
NODES, FEWER = 48, 32
AGREED = arb("1e-24")
MOST_HALVINGS = 60

Vector = list[arb]
Matrix = list[Vector]


@dataclass
class Given:
    """A body as it is given: a Placed rounds the length of its quaternion."""

    shape: Ellipsoid | Sphere
    position: np.ndarray
    orientation: np.ndarray

    @property
    def placed(self) -> Placed:
        return Placed(self.shape, self.position, self.orientation)


def exact(x: float) -> arb:
    f = Fraction(float(x))
    return arb(f.numerator) / f.denominator


def dot(a: Vector, b: Vector) -> arb:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def times(m: Matrix, v: Vector) -> Vector:
    return [dot(row, v) for row in m]


def product(a: Matrix, b: Matrix) -> Matrix:
    return [[sum(a[i][k] * b[k][j] for k in range(3)) for j in range(3)] for i in range(3)]


def transposed(m: Matrix) -> Matrix:
    return [list(row) for row in zip(*m, strict=True)]


def rotation(quaternion: np.ndarray) -> Matrix:
    x, y, z, w = map(exact, quaternion)
    length = x * x + y * y + z * z + w * w
    rows = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), w * w - x * x + y * y - z * z, 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), w * w - x * x - y * y + z * z],
    ]
    return [[entry / length for entry in row] for row in rows]


def half_axes(body: Given) -> Vector:
    shape = body.shape
    return [exact(h) for h in (shape.half_axes if isinstance(shape, Ellipsoid) else [shape.radius] * 3)]


def principal(q: Matrix) -> tuple[Vector, Matrix]:
    """The principal values, in ascending order, and the axes of a symmetric matrix, by Jacobi's rotations."""
    q = [[x.mid() for x in row] for row in q]
    small = arb(2) ** (8 - BITS) * max(abs(x) for row in q for x in row)
    u = [[arb(int(i == j)) for j in range(3)] for i in range(3)]
    for _ in range(14):
        for i, j in ((0, 1), (0, 2), (1, 2)):
            if abs(q[i][j]) < small:
                continue
            half = ((q[j][j] - q[i][i]) / (2 * q[i][j])).mid()
            tangent = (1 if half >= 0 else -1) / (abs(half) + (half * half + 1).sqrt())
            cosine = (1 / (tangent * tangent + 1).sqrt()).mid()
            sine = (tangent * cosine).mid()
            turn = [[arb(int(a == b)) for b in range(3)] for a in range(3)]
            turn[i][i] = turn[j][j] = cosine
            turn[i][j], turn[j][i] = sine, -sine
            q = [[x.mid() for x in row] for row in product(transposed(turn), product(q, turn))]
            u = [[x.mid() for x in row] for row in product(u, turn)]
    order = sorted(range(3), key=lambda k: float(q[k][k]))
    columns = transposed(u)
    return [q[k][k] for k in order], [columns[k] for k in order]


def at(p: Vector, t: arb) -> arb:
    return p[0] + t * (p[1] + t * p[2])


def convolved(a: Vector, b: Vector) -> Vector:
    result = [arb(0)] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            result[i + j] += x * y
    return result


def real_roots(polynomial: Vector, low: arb, high: arb) -> list[arb]:
    with mpmath.workdps(85):
        coefficients = [mpmath.mpf(c.mid().str(90, radius=False, more=True)) for c in polynomial]
        largest = max(abs(c) for c in coefficients)
        while coefficients and abs(coefficients[-1]) <= largest * mpmath.mpf(10) ** -80:
            coefficients.pop()
        if len(coefficients) < 2:
            return []
        roots = mpmath.polyroots(coefficients, maxsteps=600, extraprec=600, error=False, asc=True)
        real = [mpmath.re(z) for z in roots if abs(mpmath.im(z)) < mpmath.mpf(10) ** -15]
        found = [arb(mpmath.nstr(x, 85)) for x in real]
    return [x for x in found if low < x < high]


@dataclass
class Sums:
    """Integrals in the first body's ball, about its centre; `moved` is of y Nᵀ over its surface in the second."""

    volume: arb = field(default_factory=lambda: arb(0))
    first: Vector = field(default_factory=lambda: [arb(0)] * 3)
    second: Matrix = field(default_factory=lambda: [[arb(0)] * 3 for _ in range(3)])
    force: Vector = field(default_factory=lambda: [arb(0)] * 3)
    moved: Matrix = field(default_factory=lambda: [[arb(0)] * 3 for _ in range(3)])
    area: arb = field(default_factory=lambda: arb(0))

    def add(self, weight: arb, other: Sums) -> None:
        self.volume += weight * other.volume
        self.area += weight * other.area
        for i in range(3):
            self.first[i] += weight * other.first[i]
            self.force[i] += weight * other.force[i]
            for j in range(3):
                self.second[i][j] += weight * other.second[i][j]
                self.moved[i][j] += weight * other.moved[i][j]


def legendre(n: int) -> list[tuple[arb, arb]]:
    """Nodes on [0, π] and weights that take sin θ in."""
    result = []
    for k in range(n):
        x, w = arb.legendre_p_root(n, k, weight=True)
        angle = arb.pi() / 2 * (1 + x)
        result.append((angle, w * arb.pi() / 2))
    return result


class Pair:
    def __init__(self, a: Given, b: Given, with_area: bool) -> None:
        self.with_area = with_area
        self.ra, self.rb = rotation(a.orientation), rotation(b.orientation)
        self.ha, self.hb = half_axes(a), half_axes(b)
        self.centre = [exact(x) for x in a.position]
        between = [exact(q) - exact(p) for p, q in zip(a.position, b.position, strict=True)]
        own = times(transposed(self.ra), between)
        c = self.c = [own[i] / self.ha[i] for i in range(3)]
        k = product(transposed(self.rb), self.ra)
        self.k = [[k[i][j] * self.ha[j] / self.hb[i] for j in range(3)] for i in range(3)]
        q = product(transposed(self.k), self.k)
        (low, middle, high), axes = principal(q)
        self.value = middle
        whole = high - low
        if whole < arb("1e-60") * high:
            n = axes[0]
        else:
            sine, cosine = (abs(high - middle) / whole).sqrt(), (abs(middle - low) / whole).sqrt()
            n = [cosine * axes[0][i] + sine * axes[2][i] for i in range(3)]
        self.n = [x.mid() for x in n]
        self.x = axes[1]
        cross = [
            self.n[1] * self.x[2] - self.n[2] * self.x[1],
            self.n[2] * self.x[0] - self.n[0] * self.x[2],
            self.n[0] * self.x[1] - self.n[1] * self.x[0],
        ]
        self.y = [z.mid() for z in cross]
        kn, kx, ky = (times(self.k, v) for v in (self.n, self.x, self.y))
        # In the slice n·y = t about t n, the second body's centre is at g − t m.
        kc = times(self.k, c)
        g = [dot(kc, kx) / middle, dot(kc, ky) / middle]
        m = [dot(kn, kx) / middle, dot(kn, ky) / middle]
        self.g, self.m = g, m
        self.r2 = [arb(1), arb(0), arb(-1)]
        self.s2 = [
            (1 - dot(kc, kc)) / middle + g[0] * g[0] + g[1] * g[1],
            2 * (dot(kc, kn) / middle - g[0] * m[0] - g[1] * m[1]),
            -dot(kn, kn) / middle + m[0] * m[0] + m[1] * m[1],
        ]
        self.d2 = [g[0] * g[0] + g[1] * g[1], -2 * (g[0] * m[0] + g[1] * m[1]), m[0] * m[0] + m[1] * m[1]]

    def range(self) -> tuple[arb, arb] | None:
        a, b, c = self.s2[2], self.s2[1], self.s2[0]
        root = b * b - 4 * a * c
        if not root > 0:
            return None
        ends = sorted([((-b + root.sqrt()) / (2 * a)).mid(), ((-b - root.sqrt()) / (2 * a)).mid()], key=float)
        low, high = max(arb(-1), ends[0]), min(arb(1), ends[1])
        return (low, high) if low < high else None

    def breaks(self, low: arb, high: arb) -> list[arb]:
        k = [self.d2[i] - self.r2[i] - self.s2[i] for i in range(3)]
        q = [x - 4 * y for x, y in zip(convolved(k, k), convolved(self.r2, self.s2), strict=True)]
        inner = real_roots(q, low, high)
        equal = real_roots([x - y for x, y in zip(self.r2, self.s2, strict=True)], low, high)
        return [low, *sorted([*inner, *equal], key=float), high]

    def slice(self, t: arb) -> Sums | None:
        r2, s2 = at(self.r2, t), at(self.s2, t)
        if not (r2 > 0 and s2 > 0):
            return None
        r, s = r2.sqrt(), s2.sqrt()
        e = [self.g[i] - t * self.m[i] for i in range(2)]
        d = (e[0] * e[0] + e[1] * e[1]).sqrt() if at(self.d2, t) > arb("1e-150") else arb(0)
        if d >= r + s:
            return None
        pi = arb.pi()
        if d <= abs(r - s):
            first = r < s
            alpha, beta = (pi, arb(0)) if first else (arb(0), pi)
            u = [arb(1), arb(0)]
            sine_a, cosine_a = arb(0), arb(-1 if first else 1)
            sine_b, cosine_b = arb(0), arb(1 if first else -1)
        else:
            u = [e[0] / d, e[1] / d]
            cosine_a = (d * d + r2 - s2) / (2 * d * r)
            cosine_b = (d * d + s2 - r2) / (2 * d * s)
            sine_a, sine_b = abs(1 - cosine_a * cosine_a).sqrt(), abs(1 - cosine_b * cosine_b).sqrt()
            alpha, beta = arb.atan2(sine_a, cosine_a), arb.atan2(sine_b, cosine_b)
        ux = [u[0] * self.x[i] + u[1] * self.y[i] for i in range(3)]
        uy = [-u[1] * self.x[i] + u[0] * self.y[i] for i in range(3)]
        found = Sums()
        for radius, angle, sine, cosine, side in (
            (r, alpha, sine_a, cosine_a, 1),
            (s, beta, sine_b, cosine_b, -1),
        ):
            if not angle > 0:
                continue
            centre = [t * self.n[i] for i in range(3)]
            if side < 0:
                centre = [centre[i] + e[0] * self.x[i] + e[1] * self.y[i] for i in range(3)]
            area = radius * radius * (angle - sine * cosine)
            first_moment = side * 2 * (radius * sine) ** 3 / 3
            # ∫ cos² and sin² over the segment, about the disc's centre
            along = radius**4 / 4 * (angle - sine * cosine + 2 * sine**3 * cosine)
            across = radius**4 / 4 * (angle - sine * cosine - 2 * sine**3 * cosine / 3)
            found.volume += area
            for i in range(3):
                found.first[i] += area * centre[i] + first_moment * ux[i]
                for j in range(3):
                    found.second[i][j] += (
                        area * centre[i] * centre[j]
                        + first_moment * (ux[i] * centre[j] + centre[i] * ux[j])
                        + along * ux[i] * ux[j]
                        + across * uy[i] * uy[j]
                    )
        # Over the arc of the first body's surface, N = y.
        n, force = self.n, [2 * alpha * t * self.n[i] + 2 * r * sine_a * ux[i] for i in range(3)]
        found.force = force
        for i in range(3):
            for j in range(3):
                found.moved[i][j] = (
                    2 * alpha * t * t * n[i] * n[j]
                    + 2 * r * sine_a * t * (n[i] * ux[j] + ux[i] * n[j])
                    + r2 * (alpha + sine_a * cosine_a) * ux[i] * ux[j]
                    + r2 * (alpha - sine_a * cosine_a) * uy[i] * uy[j]
                )
        if self.with_area:
            found.area = self.area(t, r, s, e, ux, uy, alpha, beta)
        return found

    def area(self, t: arb, r: arb, s: arb, e: Vector, ux: Vector, uy: Vector, alpha: arb, beta: arb) -> arb:
        """The element of area per t, along the arcs on both surfaces, by Gauss and Legendre in pieces of the arc."""
        det = self.ha[0] * self.ha[1] * self.ha[2]
        rise = (self.s2[2] * -self.value).sqrt()
        det_b = self.hb[0] * self.hb[1] * self.hb[2]
        total = arb(0)
        kx, ky, kn = times(self.k, ux), times(self.k, uy), times(self.k, [t * x for x in self.n])
        ke = times(self.k, [e[0] * self.x[i] + e[1] * self.y[i] - self.c[i] for i in range(3)])
        level = [kn[i] + ke[i] for i in range(3)]
        for angle, first in ((alpha, True), (beta, False)):
            if not angle > 0:
                continue
            pieces = 8
            for piece in range(pieces):
                for x, w in NODES_OF_ARC:
                    psi = angle * (2 * arb(piece) + 1 + x - pieces) / pieces
                    sine, cosine = psi.sin(), psi.cos()
                    if first:
                        v = [t * self.n[i] + r * (cosine * ux[i] + sine * uy[i]) for i in range(3)]
                        element = sum((det / self.ha[i] * v[i]) ** 2 for i in range(3)).sqrt()
                    else:
                        v = [level[i] + s * (-cosine * kx[i] + sine * ky[i]) for i in range(3)]
                        element = rise * sum((det_b / self.hb[i] * v[i]) ** 2 for i in range(3)).sqrt()
                    total += w * angle / pieces * element
        return total


def integrate(pair: Pair, low: arb, high: arb, halvings: int = 0) -> Sums:
    def rule(nodes: list[tuple[arb, arb]]) -> Sums:
        middle, half = ((low + high) / 2).mid(), ((high - low) / 2).mid()
        total = Sums()
        for angle, weight in nodes:
            found = pair.slice((middle - half * angle.cos()).mid())
            if found:
                total.add((weight * half * angle.sin()).mid(), found)
        return total

    fine, coarse = rule(RULES[0]), rule(RULES[1])
    if halvings >= MOST_HALVINGS or abs(fine.volume - coarse.volume) <= AGREED * pair.scale:
        return fine
    middle = ((low + high) / 2).mid()
    total = integrate(pair, low, middle, halvings + 1)
    total.add(arb(1), integrate(pair, middle, high, halvings + 1))
    return total


ctx.prec = BITS
RULES = [legendre(NODES), legendre(FEWER)]
NODES_OF_ARC = [arb.legendre_p_root(24, k, weight=True) for k in range(24)]


@dataclass
class Common:
    """In the world; the gradient's moments are about the position of each body."""

    volume: arb
    area: arb
    centroid: Vector
    inertia: Matrix
    force: Vector
    moments: tuple[Vector, Vector]


def common(a: Given, b: Given, with_area: bool = False) -> Common:
    pair = Pair(a, b, with_area)
    span = pair.range()
    total = Sums()
    if span:
        breaks = pair.breaks(*span)
        parts = [*pairwise(breaks)]
        rough = [0.0 for _ in parts]
        for i, (low, high) in enumerate(parts):
            found = pair.slice(((low + high) / 2).mid())
            rough[i] = float(found.volume * (high - low)) if found else 0.0
        pair.scale = exact(sum(rough))
        for (low, high), volume in zip(parts, rough, strict=True):
            if volume > 0:
                total.add(arb(1), integrate(pair, low, high))
    h, turn = pair.ha, pair.ra
    det = h[0] * h[1] * h[2]
    volume = det * total.volume
    first = [det * h[i] * total.first[i] for i in range(3)]
    second = [[det * h[i] * h[j] * total.second[i][j] for j in range(3)] for i in range(3)]
    mean = [x / volume for x in first]
    spread = [[second[i][j] - first[i] * mean[j] for j in range(3)] for i in range(3)]
    trace = spread[0][0] + spread[1][1] + spread[2][2]
    own = [[(trace if i == j else arb(0)) - spread[i][j] for j in range(3)] for i in range(3)]
    inertia = product(turn, product(own, transposed(turn)))
    centroid = [x + y for x, y in zip(pair.centre, times(turn, mean), strict=True)]
    force = times(turn, [det / h[i] * total.force[i] for i in range(3)])
    w = [[h[i] * det / h[j] * total.moved[i][j] for j in range(3)] for i in range(3)]
    about_a = times(turn, [w[1][2] - w[2][1], w[2][0] - w[0][2], w[0][1] - w[1][0]])
    lever = [exact(p) - exact(q) for p, q in zip(a.position, b.position, strict=True)]
    about_b = [
        -(about_a[0] + lever[1] * force[2] - lever[2] * force[1]),
        -(about_a[1] + lever[2] * force[0] - lever[0] * force[2]),
        -(about_a[2] + lever[0] * force[1] - lever[1] * force[0]),
    ]
    return Common(volume, total.area, centroid, inertia, force, (about_a, about_b))
