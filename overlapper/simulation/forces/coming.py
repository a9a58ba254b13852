"""The contacts that a step will bring, and the number of substeps that they need."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from overlapper import Overlaps
from overlapper.simulation.asked_pairs import Among
from overlapper.simulation.forces.forces import have_patches
from overlapper.simulation.forces.masses import Masses
from overlapper.simulation.layout import Pose
from overlapper.simulation.model import Array

# A body that moves by less than that (m, rad) in a step rests.
STILL = 1e-9

# How often a step is halved to find when what is swallowed by its end has a patch.
BISECTIONS = 8


class Coming(NamedTuple):
    """The contacts that come within a step."""

    deep: bool = False
    """Whether a pair that does not overlap yet would be too deep at the end of the step."""
    highest: float = 0.0
    """The square of the highest frequency (rad/s) of all overlaps. 0 if nobody asked for it."""
    swallowed: float = 0.0
    """The square of the frequency of small bodies that are swallowed within the step."""


def coming(
    masses: Masses,
    frames: Sequence[Pose],
    now: Overlaps,
    duration: float,
    velocity: Array,
    among: Among,
    frequencies: bool,
) -> Coming:
    """Return the contacts that come within `duration` (s), with their `frequencies` or without.

    `frames` are the frames of the links. `now` are the overlaps in these frames. All coordinates are assumed to keep
    their `velocity`.

    If a body came in with a long step, it would be deeper than its speed can carry it, and it would be thrown back.
    Steps are therefore short before they have to be: before two bodies touch at speed, and before an edge comes down to
    a face.
    """
    # Bodies at rest bring no new contact.
    if np.abs(velocity).max(initial=0.0) * duration < STILL:
        return Coming()
    ways = masses.ways(duration, velocity)
    if not frequencies and not masses.may_meet(ways):
        return Coming()
    solver = masses.dynamics.solver.copy() if frequencies else None
    deep, highest = False, 0.0
    overlapping = _codes(now.pairs[now.volume > 0])  # sorted, as all pairs are
    known: set[tuple[int, int]] | None = None
    # A small and fast body is swallowed within the step: then it counts when it was half in, and for how long.
    lost: set[tuple[int, int]] = set()
    early, late, part = 0.0, 1.0, 1.0
    for _ in range(BISECTIONS):
        pairs, poses = masses.pairs_ahead(part * duration, velocity, among)
        if not frequencies:
            # A pair that overlaps already and moves by less than half of a size is not swallowed.
            pairs = pairs[~_among(_codes(pairs), overlapping) | masses.are_far(pairs, ways)]
            if not len(pairs) and not lost:
                break
        found = masses.overlaps_at(pairs, poses)
        if solver:
            highest = max(highest, float(masses.place(solver, frames, found)[0].max(initial=0.0)))
        new = np.flatnonzero((found.volume > 0) & ~_among(_codes(found.pairs), overlapping))
        deep = deep or masses.are_deep(found.pairs[new], found.depth[new])
        swallowed = _swallowed(found)
        if swallowed:
            known = _swallowed(now) if known is None else known
            swallowed -= known
        if swallowed:
            late, lost = part, swallowed
        elif lost and lost.isdisjoint(map(tuple, found.pairs[found.volume > 0].tolist())):
            early = part
        else:
            break
        part = (early + late) / 2
    return Coming(deep, highest, (2 / (late - early) / duration) ** 2 if lost else 0.0)


def followed(frequency2: float, duration: float) -> int:
    """Return how many substeps of a duration follow an oscillation, given the square of its frequency."""
    return max(1, math.ceil(math.sqrt(frequency2) * duration))


def _swallowed(found: Overlaps) -> set[tuple[int, int]]:
    """Return the pairs in which one body lies wholly in the other: their overlap has no patch."""
    rows = (found.volume > 0) & ~have_patches(found, np.linalg.norm(found.gradient[:, 1, :3], axis=1))
    return {(a, b) for a, b in found.pairs[rows].tolist()} if rows.any() else set()


def _codes(pairs: NDArray[np.int32]) -> NDArray[np.int64]:
    """Return a number for each pair."""
    wide = pairs.astype(np.int64)
    return np.asarray(wide[:, 0] << 32 | wide[:, 1])


def _among(codes: NDArray[np.int64], known: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return whether each number is among the `known` ones, which are sorted."""
    if not len(known):
        return np.zeros(len(codes), dtype=bool)
    places = np.minimum(np.searchsorted(known, codes), len(known) - 1)
    return np.asarray(known[places] == codes)
