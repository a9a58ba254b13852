"""Outlines of the slices of a convex body between quadrics and planes, found in doubles.

An outline is the cyclic order of the constraints around a slice, and the corners between neighbours. It changes only at
events. At an event, a corner reaches a third surface, or two corners meet because the slice is tangent to an edge. All
results of this module are guesses, which `overlapper.proof.arcs` proves or refuses.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overlapper.proof.round_frame import Barrier, Constraint

Floats = NDArray[np.float64]

# The number of directions from inside in which a slice is sampled, and of slices that are compared at first.
DIRECTIONS, SLICES = 720, 25
TURNS = np.linspace(0.0, 2 * np.pi, DIRECTIONS, endpoint=False)
# How many times the sampling around each change is refined, and the number of new directions between two.
CLOSER, FINER = 2, 16
PARTS = np.arange(FINER + 1) / FINER
# A surface that misses the outline by less than this share of its distance may meet it between two directions. The
# place is sought with so many refinements.
CLOSE, CLOSEST = 1e-3, 4
# A surface that misses the outline by less than this share of its distance is tested for where it meets the outline.
NEAR = 0.25
# A point is on a surface if doubles tell no larger value or distance there.
SAME = 1e-14
# The bisection steps for the place of an event before Newton's method.
HALVINGS = 12
# The weight of the barrier at the ends of a body. The ends are then known to about this share of its length.
END = 1e-12


@dataclass(frozen=True)
class Outline:
    """Corner k, at `corners[k]` = (p, q), is between `chain[k]` and `chain[k + 1]`, counter-clockwise."""

    chain: tuple[int, ...]
    corners: Floats

    def pairs(self) -> list[tuple[int, int]]:
        if len(self.chain) == 1:
            return []
        return list(zip(self.chain, self.chain[1:] + self.chain[:1]))


class Outlines:
    """The slices y₀ = t of constraints that hold at the origin."""

    def __init__(self, constraints: list[Constraint]) -> None:
        self.barrier = Barrier(constraints)
        size = -self.barrier.constant
        self.forms = self.barrier.forms / size[:, None, None]
        self.linear = self.barrier.linear / size[:, None]
        ends = []
        for side in (1.0, -1.0):
            y = np.zeros(3)
            for weight in (1.0, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10, END):
                y, _ = self.barrier.centre(y, np.array([side / weight, 0.0, 0.0]))
            ends.append(y)
        self.low, self.high = ends

    def inner(self, t: float) -> Floats:
        """A point inside of the slice."""
        end = self.high if t > 0 else self.low
        point: Floats = end[1:] * (t / end[0])
        return point

    def at(self, t: float) -> Outline | None:
        """The outline of a slice. None if the slice is not found, or if its order of sides is not cyclic."""
        p = self.inner(t)
        values, half = self._values(np.array([t, *p]))
        if not (values < 0).all():
            return None
        turns = np.sort(np.append(TURNS, self._short_sides(half, values)))
        nearest, reach = self._nearest(half, values, turns)
        changes = np.flatnonzero(nearest != np.roll(nearest, -1))
        if len(changes) == 0:
            return Outline((int(nearest[0]),), np.zeros((0, 2)))
        steps = np.diff(turns, append=2 * np.pi)[changes]
        for _ in range(CLOSER):
            turns = (turns[changes][:, None] + steps[:, None] * PARTS).ravel()
            steps = np.repeat(steps / FINER, FINER + 1)
            nearest, reach = self._nearest(half, values, turns)
            changes = np.flatnonzero(nearest[:-1] != nearest[1:])
            steps = steps[changes]
        chain = tuple(int(k) for k in nearest[changes])
        following = [int(k) for k in nearest[changes + 1]]
        if following != [*chain[1:], chain[0]]:
            return None
        far = (reach[changes] + reach[changes + 1]) / 2
        guesses = p + np.array([np.cos(turns[changes]), np.sin(turns[changes])]).T * far[:, None]
        corners = [self.corner(i, j, t, guess) for i, j, guess in zip(chain, following, guesses)]
        return self._with_corners_cut(chain, corners, t)

    def _short_sides(self, half: Floats, values: Floats) -> list[float]:
        """Directions of surfaces that bound the slice only between two of the directions in which it is sampled."""
        reach = self._reach(half, values, TURNS)
        found = []
        for k in range(len(reach)):
            gap = reach[k] / np.delete(reach, k, 0).min(axis=0, initial=np.inf) - 1
            least = (gap > SAME) & (gap < CLOSE) & (gap <= np.roll(gap, 1)) & (gap <= np.roll(gap, -1))
            for middle in TURNS[least]:
                step = TURNS[1]
                for _ in range(CLOSEST):
                    turns = middle + step * np.linspace(-1.0, 1.0, 2 * FINER + 1)
                    near = self._reach(half, values, turns)
                    gaps = near[k] / np.delete(near, k, 0).min(axis=0, initial=np.inf) - 1
                    middle, step = turns[gaps.argmin()], step / FINER
                    if gaps.min() < 0:
                        found.append(middle % (2 * np.pi))
                        break
        return found

    def _with_corners_cut(self, chain: tuple[int, ...], corners: list[Floats], t: float) -> Outline:
        """The outline with the sides that are shorter than a step of directions, where they cut off a corner."""
        sides, places = list(chain), list(corners)
        k = 0
        while k < len(sides) < len(chain) + len(self.forms):
            i, j = sides[k], sides[(k + 1) % len(sides)]
            values, _ = self._values(np.array([t, *places[k]]))
            values[[i, j]] = 0.0
            between = int(values.argmax())
            if values[between] > SAME:
                sides.insert(k + 1, between)
                places[k : k + 1] = [self.corner(i, between, t, places[k]), self.corner(between, j, t, places[k])]
            else:
                k += 1
        return Outline(tuple(sides), np.array(places))

    def _values(self, y: Floats) -> tuple[Floats, Floats]:
        half = self.forms @ y + self.linear
        return (half + self.linear) @ y - 1, half

    def _reach(self, half: Floats, values: Floats, turns: Floats) -> Floats:
        """The distance (k, n) to each constraint in each direction."""
        rays = np.array([np.cos(turns), np.sin(turns)])
        along = half[:, 1:] @ rays
        bend = np.einsum("kij,in,jn->kn", self.forms[:, 1:, 1:], rays, rays)
        under = along + np.sqrt(np.maximum(along**2 - bend * values[:, None], 0.0))
        with np.errstate(divide="ignore"):
            return np.where(under > 0, -values[:, None] / under, np.inf)

    def _nearest(self, half: Floats, values: Floats, turns: Floats) -> tuple[NDArray[np.intp], Floats]:
        """The constraint that is met first in each direction, and the distance to it."""
        reach = self._reach(half, values, turns)
        nearest = reach.argmin(axis=0)
        return nearest, reach[nearest, np.arange(len(turns))]

    def _near_misses(self, t: float) -> Iterator[float | None]:
        """Slices that are tangent to edges. They are sought where one surface is near another but does not meet it."""
        p = self.inner(t)
        values, half = self._values(np.array([t, *p]))
        reach = self._reach(half, values, TURNS[::4])
        nearest = reach.argmin(axis=0)
        least = reach[nearest, np.arange(len(nearest))]
        for k, row in enumerate(reach):
            gap = np.where(nearest == k, np.inf, row / least - 1)
            for at in np.flatnonzero((gap < NEAR) & (gap <= np.roll(gap, 1)) & (gap <= np.roll(gap, -1))):
                ray = np.array([np.cos(TURNS[4 * at]), np.sin(TURNS[4 * at])])
                yield self._newton(np.array([t, *(p + least[at] * ray)]), [int(nearest[at]), k], True)

    def corner(self, i: int, j: int, t: float, guess: Floats) -> Floats:
        """The point where two surfaces meet in a slice, by Newton's method."""
        y = np.array([t, *guess])
        both = [i, j]
        for _ in range(8):
            image = self.forms[both] @ y + self.linear[both]
            value = (image + self.linear[both]) @ y - 1
            (a, b), (c, d) = 2 * image[:, 1:]
            det = a * d - b * c
            if det == 0.0:
                break
            step = np.array([value[0] * d - value[1] * b, value[1] * a - value[0] * c]) / det
            if not np.abs(step).max() < 10.0:
                break
            y[1:] -= step
            if np.abs(step).max() < 1e-14:
                break
        return y[1:]

    def events(self) -> list[float]:
        """The places where the outline changes, in order, and both ends."""
        low, high = float(self.low[0]), float(self.high[0])
        turn = (np.arange(SLICES) + 0.5) / SLICES * np.pi
        places = (low + high) / 2 - (high - low) / 2 * np.cos(turn)
        seen = [(float(t), self.at(float(t))) for t in places]
        found = [low, high]
        work = list(itertools.pairwise(seen))
        while work and len(found) < 64:
            (t, left), (u, right) = work.pop()
            if left is None or right is None or cyclic(left) == cyclic(right) or u - t < 1e-9 * (high - low):
                continue
            before, after = (t, left), (u, right)
            for _ in range(HALVINGS):
                middle = (before[0] + after[0]) / 2
                outline = self.at(middle)
                if outline is None:
                    break
                if cyclic(outline) == cyclic(left):
                    before = middle, outline
                else:
                    after = middle, outline
            found += [event for event in self._between(before, after) if low < event < high]
            work.append((after, (u, right)))
        for t in places:
            found += [event for event in self._near_misses(float(t)) if event is not None and low < event < high]
        found.sort()
        return [event for k, event in enumerate(found) if k == 0 or event - found[k - 1] > 1e-9 * (high - low)]

    def _between(self, before: tuple[float, Outline | None], after: tuple[float, Outline | None]) -> list[float]:
        """The events between outlines that differ, by Newton's method; the middle if it finds none."""
        (t, left), (u, right) = before, after
        assert left is not None and right is not None
        sides = [Counter(tuple(sorted(pair)) for pair in outline.pairs()) for outline in (left, right)]
        found = []
        for outline, gone in ((left, sides[0] - sides[1]), (right, sides[1] - sides[0])):
            level = t if outline is left else u
            for pair, count in gone.items():
                places = [c for p, c in zip(outline.pairs(), outline.corners) if tuple(sorted(p)) == pair]
                if count > 1:
                    start = np.array([level, *np.mean(places, axis=0)])
                    found.append(self._newton(start, list(pair), True))
                    continue
                others = {k for other in (sides[0] - sides[1]) + (sides[1] - sides[0]) for k in other} - set(pair)
                starts = [np.array([level, *place]) for place in places]
                found += [self._newton(start, [*pair, k], False) for start in starts for k in others]
        margin = 0.5 * (u - t) + 1e-3 * abs(float(self.high[0] - self.low[0]))
        near = sorted({event for event in found if event is not None and t - margin < event < u + margin})
        return [event for k, event in enumerate(near) if k == 0 or event - near[k - 1] > 1e-12] or [(t + u) / 2]

    def _newton(self, y: Floats, curves: list[int], tangent: bool) -> float | None:
        """The t at which three surfaces meet, or at which a slice is tangent to the edge of two surfaces."""
        forms, linear = self.forms[curves], self.linear[curves]
        for _ in range(30):
            image = forms @ y + linear
            value = (image + linear) @ y - 1
            rows = 2 * image
            if tangent:
                (a, b), (c, d) = image[:, 1:]
                value = np.append(value, a * d - b * c)
                bend = image[0, 1] * forms[1, 2] + image[1, 2] * forms[0, 1]
                rows = np.vstack([rows, bend - image[0, 2] * forms[1, 1] - image[1, 1] * forms[0, 2]])
            try:
                step = np.linalg.solve(rows, value)
            except np.linalg.LinAlgError:
                return None
            if not np.abs(step).max() < 1e3:
                return None
            y = y - step
            if np.abs(step).max() < 1e-14:
                break
        values = (self.forms @ y + 2 * self.linear) @ y - 1
        return float(y[0]) if np.abs(step).max() < 1e-6 and values.max() < 1e-6 else None


def cyclic(outline: Outline) -> tuple[int, ...]:
    """The chain rotated to its least rotation, so that equal cyclic orders are equal."""
    chain = outline.chain
    return min(chain[k:] + chain[:k] for k in range(len(chain)))
