"""Volumes of two quadrics and a polytope, by slices, in ball arithmetic.

A slice is parallel to the axes of all cylinders. In a slice, a cylinder is a strip between two lines, a ball is a disc,
and the polytope is a polygon. Each line keeps its direction and has the offset b₀ + b₁ t + b₂ ρ₁(t) + b₃ ρ₂(t). Here t
is along the normal of the slices, and ρ(t)² is quadratic. So the area of a polygon is a quadratic form in 1, t, ρ₁ and
ρ₂. Its integral is elementary except for ρ₁ ρ₂. Integrals that are not elementary are computed by `acb.integral`, whose
error is proved (Petras; Johansson, Numerical integration in arbitrary-precision ball arithmetic, 2018).

The sides of a slice and their order change only at breakpoints. At some breakpoints, three curves that bound slices
meet in a point of the common body, or a line touches the disc in such a point. At others, parallel lines meet, or a
strip or the disc ends. These t are roots of polynomials with rational coefficients, of degree four or less, which FLINT
encloses. Superfluous breakpoints do no harm. Three sides of the polytope meet only in its corners, and two only in its
edges. Where an edge lies in a slice, parallel lines meet. Between breakpoints that are too close to separate, a slice
has at most the widest area.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from flint import acb, arb, ctx, fmpq, fmpq_poly

from overlapper.proof.one_quadric import root
from overlapper.proof.signs import is_positive
from overlapper.proof.vectors import Vector, minus

# A line bounds { (p, q) : normal · (p, q) <= offset }. The offset is a combination of 1, t, ρ₁ and ρ₂.
Combination = tuple[fmpq, fmpq, fmpq, fmpq]
Point = tuple[arb, arb, arb]  # (t, p, q)
ZERO = fmpq(0)
T = fmpq_poly([0, 1])

# The share between two breakpoints at which a slice is examined. In the middle, symmetry may make more lines meet.
SHARE = fmpq(3331, 7919)

# The share of the bits of a number to which an integral that is not elementary is computed.
INTEGRATED = 0.75
# SPARE: bits that an integral may lose by rounding. The number of evaluations is limited to the square of the bits
# divided by EVALUATIONS, and to MOST_EVALUATIONS, which take seconds.
SPARE, EVALUATIONS, MOST_EVALUATIONS = 16, 2, 1 << 16

Form = list[fmpq]  # coefficients of 1, t, t², ρ₁, t ρ₁, ρ₁², ρ₂, t ρ₂, ρ₂², ρ₁ ρ₂


@dataclass(frozen=True)
class Line:
    normal: tuple[fmpq, fmpq]
    offset: Combination


@dataclass
class SliceArea:
    """The area of a slice: quadratic forms, segments taken from the disc, and the angle of its arcs."""

    forms: list[tuple[int, ...]] = field(default_factory=list)
    segments: Counter[int] = field(default_factory=Counter)
    turn: arb = field(default_factory=lambda: arb(0))


class Slices:
    """A volume by slices. Coordinates t, p, q are rational combinations of the coordinates of space."""

    corners: list[Vector]  # of the polytope
    edges: list[tuple[int, int, int, int]]
    lines: list[Line]  # the first four are a parallelogram, counter-clockwise
    squares: tuple[fmpq_poly, ...]  # ρ₁² and, for two cylinders, ρ₂²
    steep: list[tuple[fmpq, fmpq]]  # (rate, offset) of planes rate t <= offset

    scale: fmpq  # the volume in these coordinates divided by that in space

    def __call__(self, bits: int) -> arb:
        with ctx.workprec(bits):
            return self._volume(bits) / self.scale

    def _volume(self, bits: int) -> arb:
        total = arb(0)
        low: arb | None = None
        for start, end in clusters(self.marks()):
            if low is not None:
                total += self._between(low, start, int(bits * INTEGRATED))
            total += (end - start).union(0) * self.widest()
            low = end
        return total

    def _between(self, low: arb, high: arb, goal: int) -> arb:
        middle = (low + SHARE * (high - low)).mid()
        for rate, offset in self.steep:
            if is_positive(rate * middle - offset):
                return arb(0)
        if not all(is_positive(at(square, middle)) for square in self.squares):
            return arb(0)
        area = self.area(middle)
        return self.integral(area, low, high, goal) if area else arb(0)

    # Answers that differ between the two kinds of slices.

    def candidates(self) -> Iterator[tuple[Point, Any]]:
        """The points at which the sides of a slice may change, each with an argument for `is_outside`."""
        raise NotImplementedError

    def is_outside(self, point: Point, known: Any) -> bool:
        raise NotImplementedError

    def widest(self) -> arb:
        """More than the area of any slice."""
        raise NotImplementedError

    def area(self, t: arb) -> SliceArea | None:
        raise NotImplementedError

    def integral(self, area: SliceArea, low: arb, high: arb, goal: int) -> arb:
        raise NotImplementedError

    # Steps that both kinds share.

    def marks(self) -> Iterator[arb]:
        yield from self.level_edges()
        for point, known in self.candidates():
            if not self.is_outside(point, known):
                yield point[0]

    def is_cut_off(self, point: Point) -> bool:
        """Whether a plane certainly cuts the point off."""
        t, p, q = point
        for line in self.lines[4:]:
            if line.normal[0] * p + line.normal[1] * q > line.offset[0] + line.offset[1] * t:
                return True
        return any(rate * t > offset for rate, offset in self.steep)

    def level_edges(self) -> Iterator[arb]:
        """The slices that hold whole edges. A part of such an edge may be in the quadrics although its ends are not."""
        for i, j, _, _ in self.edges:
            if self.corners[i][0] == self.corners[j][0]:
                yield arb(self.corners[i][0])

    def basis(self, t: arb) -> list[arb]:
        return [arb(1), t, *(at(square, t).nonnegative_part().sqrt() for square in self.squares)]

    def polygon(self, offsets: list[arb]) -> list[tuple[int, tuple[arb, arb]]]:
        """The lines around the polygon below all lines, and where each meets the next; empty without a polygon."""
        around = [(k, self.meeting(k, (k + 1) % 4, offsets)) for k in range(4)]
        for new in range(4, len(self.lines)):
            x, y = self.lines[new].normal
            above = [is_positive(x * p + y * q - offsets[new]) for _, (p, q) in around]
            if not any(above):
                continue
            if all(above):
                return []
            count = len(around)
            last = next(k for k in range(count) if above[k] and not above[(k + 1) % count])
            first = next(k for k in range(count) if above[k] and not above[k - 1])
            entering, leaving = around[first][0], around[(last + 1) % count][0]
            kept = [around[(last + 1 + k) % count] for k in range((first - last - 1) % count)]
            corners = [(entering, self.meeting(entering, new, offsets)), (new, self.meeting(new, leaving, offsets))]
            around = [*kept, *corners]
        return around

    def meeting(self, i: int, j: int, offsets: list[arb]) -> tuple[arb, arb]:
        (a, b), (c, d) = self.lines[i].normal, self.lines[j].normal
        det = a * d - b * c
        return (offsets[i] * d - offsets[j] * b) / det, (offsets[j] * a - offsets[i] * c) / det

    def corner(self, i: int, j: int) -> tuple[Combination, Combination]:
        """The point where two lines meet, as combinations."""
        (a, b), (c, d) = self.lines[i].normal, self.lines[j].normal
        det = a * d - b * c
        e, f = self.lines[i].offset, self.lines[j].offset
        return combined(d / det, e, -b / det, f), combined(a / det, f, -c / det, e)


def combined(x: fmpq, u: Combination, y: fmpq, v: Combination) -> Combination:
    a, b, c, d = (x * s + y * t for s, t in zip(u, v))
    return a, b, c, d


def product(u: Combination, v: Combination) -> Form:
    return [
        u[0] * v[0],
        u[0] * v[1] + u[1] * v[0],
        u[1] * v[1],
        u[0] * v[2] + u[2] * v[0],
        u[1] * v[2] + u[2] * v[1],
        u[2] * v[2],
        u[0] * v[3] + u[3] * v[0],
        u[1] * v[3] + u[3] * v[1],
        u[3] * v[3],
        u[2] * v[3] + u[3] * v[2],
    ]


def clusters(marks: Iterable[arb]) -> list[tuple[arb, arb]]:
    """Bounds of the marks, in order. Bounds that overlap are merged."""
    found: list[tuple[arb, arb]] = []
    for low, high in sorted(((mark.lower(), mark.upper()) for mark in marks), key=lambda pair: pair[0].mid()):
        if found and not found[-1][1] < low:
            found[-1] = found[-1][0], high if high > found[-1][1] else found[-1][1]
        else:
            found.append((low, high))
    return found


def at(poly: fmpq_poly, x: arb) -> arb:
    value = arb(0)
    for coefficient in reversed(poly.coeffs()):
        value = value * x + coefficient
    return value


def roots(poly: fmpq_poly) -> list[arb]:
    """The real roots; an empty list for the zero polynomial."""
    match poly.degree():
        case -1 | 0:
            return []
        case 1:
            return [arb(-poly[0] / poly[1])]
        case 2:
            discriminant = poly[1] * poly[1] / 4 - poly[0] * poly[2]
            if discriminant < 0:
                return []
            far = root(discriminant)
            return [(-poly[1] / 2 + side * far) / poly[2] for side in (-1, 1)]
        case _:
            pairs: list[Any] = poly.numer().complex_roots()
            found = (acb(x) for x, _ in pairs)
            return [x.real for x in found if x.imag == 0]


def along(start: Vector, end: Vector, form: Callable[[Vector, Vector], fmpq], constant: fmpq) -> list[arb]:
    """Shares of the way from start to end at which the form of a point with itself is the constant."""
    way = minus(end, start)
    return roots(fmpq_poly([form(start, start) - constant, 2 * form(start, way), form(way, way)]))


def points_between(start: Vector, end: Vector, shares: Iterable[arb]) -> Iterator[Point]:
    """The points at shares of the way from start to end, without points that are certainly beyond the ends."""
    for share in shares:
        if not (share < 0 or share > 1):
            t, p, q = (x + share * (y - x) for x, y in zip(start, end))
            yield t, p, q


class Parabola:
    """R(t) = most - bend (t - peak)². The integrals of its root are elementary."""

    def __init__(self, constant: arb, slope: arb, bend: arb) -> None:
        self.bend = bend
        self.peak = slope / (2 * bend)
        self.most = constant + slope * slope / (4 * bend)

    def __call__(self, t: arb) -> arb:
        off = t - self.peak
        return (self.most - self.bend * off * off).nonnegative_part()

    def moments(self, t: arb) -> tuple[arb, arb, arb, arb, arb]:
        """Antiderivatives of 1/√R, t/√R, t²/√R, √R and t √R."""
        off, value = t - self.peak, self(t).sqrt()
        stretch = self.bend.sqrt()
        one = arb.atan2(stretch * off, value) / stretch
        two = self.peak * one - value / self.bend
        squared = (self.most * one - off * value) / (2 * self.bend)
        three = squared + self.peak * (2 * two - self.peak * one)
        area = (off * value + self.most * one) / 2
        return one, two, three, area, self.peak * area - value**3 / (3 * self.bend)


def of_form(squares: tuple[fmpq_poly, ...], low: arb, high: arb) -> list[arb]:
    """The integrals of 1, t, t², ρ₁, t ρ₁, ρ₁², ρ₂, t ρ₂, ρ₂²."""

    def power(k: int) -> arb:
        return (high**k - low**k) / k

    found = [power(1), power(2), power(3)]
    for square in squares:
        parabola = Parabola(arb(square[0]), arb(square[1]), arb(-square[2]))
        ends = [parabola.moments(t) for t in (low, high)]
        found += [ends[1][3] - ends[0][3], ends[1][4] - ends[0][4]]
        found.append(square[0] * power(1) + square[1] * power(2) + square[2] * power(3))
    return found


def integrated(f: Callable[[acb, bool], acb], low: arb, high: arb, most: arb, goal: int) -> arb:
    """The integral of a function of at most `most`, between ends that are known up to rounding.

    Smaller steps gain nothing below the rounding of `most`, and the number of steps is limited. The worst interval is
    halved first. If a root begins at an end, the interval that remains after all steps is therefore narrow.
    """
    start, end = low.mid(), high.mid()
    rounding = most * (end - start) * arb(2) ** (SPARE - ctx.prec)
    evaluations = min(ctx.prec**2 // EVALUATIONS, MOST_EVALUATIONS)
    inner = acb.integral(
        f,
        start,
        end,
        rel_tol=arb(2) ** -goal,
        abs_tol=rounding,
        eval_limit=evaluations,
        depth_limit=evaluations,
        use_heap=True,
    ).real
    return inner + (low.rad() + high.rad()) * most.union(-most)


def half_turn(y: arb, x: arb) -> arb:
    """The angle of (x, y) in [0, π]. The true y is not negative, but its ball may hold negative numbers."""
    return arb.pi() / 2 - arb.atan2(x, y)
