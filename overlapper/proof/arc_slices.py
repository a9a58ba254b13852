"""The volume between quadrics and planes, by slices bounded by arcs of conics, in ball arithmetic.

While the outline of the slices y₀ = t keeps its order, the area is an analytic function of t. Near an event at s, it is
analytic in x with t = s ± x². The error of the Gauss–Legendre rule follows from a bound of the function in a complex
disc (Trefethen, Approximation Theory and Approximation Practice, theorem 19.3).

Slices whose outline is not proved are bounded by the Brunn–Minkowski theorem: the square root of the area is concave.
These are slices next to an event, and slices in which four surfaces meet or nearly meet.
"""

from __future__ import annotations

import math
from collections import deque
from functools import lru_cache
from itertools import pairwise

import numpy as np
from flint import arb, ctx

from overlapper.proof.arcs import UP, Curve, Following, Path, Refused, above
from overlapper.proof.outline import Outline, Outlines
from overlapper.proof.round_frame import Constraint, Floats, RoundFrame, framed
from overlapper.proof.vectors import rational

# Half the length of an interval, as a share of the radius of the disc in which its area is proved to be analytic.
SHARE = 0.62
# The share of the bits of a number to which a volume is computed.
ACCURACY = 0.42
# The most points of the rule, and the most intervals.
POINTS, INTERVALS = 96, 600


@lru_cache(maxsize=256)
def rule(points: int, bits: int) -> list[tuple[arb, arb]]:
    """Nodes in (-1, 1) and weights of the Gauss–Legendre rule."""
    with ctx.workprec(bits):
        return [arb.legendre_p_root(points, k, weight=True) for k in range(points)]


class Run:
    """Adjacent slices whose outline is proved: their volume, and both ends as seen from inside."""

    def __init__(self, parts: list[Part]) -> None:
        self.volume = sum((part.volume for part in parts), arb(0))
        self.low, self.high = (
            min(parts, key=lambda part: part.low_t.mid()),
            max(parts, key=lambda part: part.high_t.mid()),
        )


class Part:
    """The slices between x = low and x = high, and the outline that is proved for them."""

    def __init__(self, following: Following, low: float, high: arb, disc: float, tolerance: float) -> None:
        self.following, self.low, self.high = following, arb(low), high
        following.model(disc)
        bound = following.bound()
        following.prove(low, float(high.upper()) * UP)
        half, middle = (high - low) / 2, (high + low) / 2
        reach = (disc - abs(middle - following.middle)) / half
        if not reach > 1:
            raise Refused
        rho = reach + (reach * reach - 1).sqrt()
        most_of_all = arb(bound) * 2 * (abs(following.middle) + disc) * half * 64 / 15 / (1 - 1 / rho**2)
        points = 2 + max(0, math.ceil(float((most_of_all / tolerance).log() / (2 * rho.log()))))
        if points > POINTS:
            raise Refused
        total = arb(0)
        for place, weight in rule(points, ctx.prec):
            x = middle + half * place
            total += weight * following.area(x) * 2 * x
        self.volume = total * half + arb(0, above(most_of_all / rho ** (2 * points)))
        ends = following.path.t(self.low), following.path.t(self.high)
        self.low_t, self.high_t = ends if following.path.side > 0 else ends[::-1]

    def end(self, upper: bool) -> tuple[arb, arb, arb]:
        """At the upper or lower end: t, the square root of the area, and its growth outwards by secants."""
        at_high = upper == (self.following.path.side > 0)
        share = arb(1) / 64
        x, y = (
            (self.high, self.high - (self.high - self.low) * share)
            if at_high
            else (self.low, self.low + (self.high - self.low) * share)
        )
        t, u = self.following.path.t(x), self.following.path.t(y)
        f, g = self.following.area(x).sqrt(), self.following.area(y).sqrt()
        return t, f, (f - g) / abs(t - u)


class ByArcs:
    """The volume that constraints leave of a box, by slices in a frame in which this part is round.

    All constraints together leave nothing near the sides of the box. Constraints that remove nothing from the box may
    be left out. If a point inside the remaining constraints is in the box, their whole set is in the box: a path out of
    the box would cross its sides. Otherwise the constraints leave nothing of the box.
    """

    def __init__(self, constraints: list[Constraint], around: Floats) -> None:
        self.constraints, self.around = constraints, around
        self.sides = [(rational(float(low)), rational(float(high))) for low, high in around.T]
        self._prepared: tuple[RoundFrame, Outlines, list[float]] | arb | None = None

    def _prepare(self) -> tuple[RoundFrame, Outlines, list[float]] | arb:
        frame = framed(self.constraints, self.around)
        if isinstance(frame, arb):
            return frame
        if not all(low < x < high for x, (low, high) in zip(frame.origin, self.sides)):
            return arb(0)
        outlines = Outlines(frame.constraints)
        return frame, outlines, outlines.events()

    def __call__(self, bits: int) -> arb:
        if self._prepared is None:
            self._prepared = self._prepare()
        if isinstance(self._prepared, arb):
            return self._prepared
        frame, outlines, events = self._prepared
        with ctx.workprec(bits):
            cap = ctx.cap
            try:
                return Slicing([Curve(c) for c in frame.constraints], outlines, bits).volume(events) * arb(frame.unit)
            except Refused:
                return self._at_most()
            finally:
                ctx.cap = cap

    def _at_most(self) -> arb:
        """More than the volume of the box `around`."""
        x, y, z = (arb(size) for size in self.around[1] - self.around[0])
        return arb(0).union(2 * x * y * z)


class Slicing:
    def __init__(self, curves: list[Curve], outlines: Outlines, bits: int) -> None:
        self.curves, self.outlines = curves, outlines
        accuracy = ACCURACY * bits
        self.tolerance, self.near = 2.0**-accuracy / 16, 2.0 ** (-accuracy / 2 - 2)
        self.tries = 0

    def volume(self, events: list[float]) -> arb:
        length = events[-1] - events[0]
        runs: list[Run] = []
        work = deque((a, b, 0) for a, b in pairwise(events))
        while work and self.tries < INTERVALS:
            a, b, depth = work.popleft()
            if b - a < 8 * self.near * length:
                continue
            run = self._run(a, b)
            if run is None:
                if depth < 3:
                    share = a + (b - a) * 0.4871
                    work += [(a, share, depth + 1), (share, b, depth + 1)]
                continue
            runs.append(run)
            low, high = float(run.low.low_t.mid()), float(run.high.high_t.mid())
            if depth < 6:
                work += [(x, y, depth + 1) for x, y in ((a, low), (high, b)) if y - x > 64 * self.near * length]
        if not runs:
            raise Refused
        runs.sort(key=lambda run: float(run.low.low_t.mid()))
        total = sum((run.volume for run in runs), arb(0))
        total += beyond(*runs[0].low.end(False)) + beyond(*runs[-1].high.end(True))
        for one, other in pairwise(runs):
            total += between(*one.high.end(True), *other.low.end(False))
        return total

    def _run(self, a: float, b: float) -> Run | None:
        middle = (a + b) / 2
        if self.outlines.at(middle) is None:
            return None
        parts: list[Part] = []
        for anchor, side in ((a, 1), (b, -1)):
            parts += self._half(Path(anchor, side), middle)
        return Run(parts) if parts else None

    def _half(self, path: Path, middle: float) -> list[Part]:
        """The parts from the middle of a gap towards the event at the anchor."""
        high = (path.side * (arb(middle) - path.anchor)).sqrt()
        lowest = math.sqrt(self.near * (float(self.outlines.high[0]) - float(self.outlines.low[0])))
        parts: list[Part] = []
        last: Following | None = None
        ratio = 0.0
        while self.tries < INTERVALS:
            top = float(high.mid())
            if top <= lowest * 1.0001:
                break
            part = None
            reach = min((top - lowest) / 2, top * ratio / (1 + ratio)) if ratio else (top - lowest) / 2
            for _ in range(8):
                self.tries += 1
                following = self._following(path, top - reach, last)
                if following is None:
                    return parts
                try:
                    disc = following.disc(reach / SHARE * 1.0001)
                    if SHARE * disc < reach:
                        ratio = SHARE * disc / (top - reach)
                        reach = min(reach * 0.7, top * ratio / (1 + ratio))
                        continue
                    low = lowest if top - 2 * reach < lowest * 1.0001 else top - 2 * reach
                    part = Part(following, low, high, disc, self.tolerance)
                except Refused:
                    reach *= 0.6
                    continue
                break
            if part is None:
                break
            parts.append(part)
            last, high = following, part.low
            ratio = max(ratio, reach / (top - reach)) * 1.05
        return parts

    def _following(self, path: Path, middle: float, last: Following | None) -> Following | None:
        try:
            if last is None:
                outline = self.outlines.at(float(path.t(arb(middle)).mid()))
                return None if outline is None else Following(self.curves, outline, path, middle)
            away = arb(middle - last.middle)
            corners = np.array([[float(c.p(away).mid()), float(c.q(away).mid())] for c in last.corners]).reshape(-1, 2)
            return Following(self.curves, Outline(last.chain, corners), path, middle)
        except Refused:
            return None


def beyond(t: arb, f: arb, growth: arb) -> arb:
    """Bounds of the volume beyond the last slice. The square root of the area falls there no slower than before."""
    if not growth < 0:
        raise Refused
    return arb(0).union(-(f**3) / (3 * growth))


def between(t: arb, f: arb, rate: arb, u: arb, g: arb, growth: arb) -> arb:
    """Bounds of the volume between the slices at t < u, whose areas are f² and g².

    The square root of the area is concave. It is above the chord from f to g. It is below two lines: a line from f with
    the slope `rate`, and a line from g that rises by `growth` towards t.
    """
    length = u - t
    least = length * (f * f + f * g + g * g) / 3
    # The two lines meet at this share of the length.
    share = float(((g + growth * length - f) / (length * (rate + growth))).mid())
    share = min(max(share, 0.0), 1.0) if share == share else 0.5
    greatest = arb(0)
    for value, slope, way in ((f, rate, length * share), (g, growth, length * (1 - share))):
        rise = slope * way
        greatest += way * (value * (value + rise) + rise * rise / 3)
    return least.union(greatest)
