"""Counts of overlaps of pairs of links, added up over configurations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Counts = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Largest:
    """The largest `value` (p,) of each pair, and the first configuration `at` (p,) that has it.

    A pair that never overlapped has the value 0 at -1.
    """

    value: Array
    at: Counts

    def __or__(self, other: Largest) -> Largest:
        """The larger value of each pair; of equal values, the earlier configuration."""
        first = (other.at >= 0) & ((self.at < 0) | (other.at < self.at))
        better = (other.value > self.value) | ((other.value == self.value) & first)
        return Largest(np.where(better, other.value, self.value), np.where(better, other.at, self.at))


@dataclass(frozen=True, slots=True)
class Tally:
    """Counts of configurations, (p,) each, per pair of links.

    A pair was tested in `asked` configurations and overlapped in `met` of them. `random_asked` and `random_met` count
    only the random configurations. `volume` is in m³, summed over pairs of shapes. `depth` is in m, of the deepest pair
    of shapes.
    """

    asked: Counts
    met: Counts
    random_asked: Counts
    random_met: Counts
    volume: Largest
    depth: Largest

    @classmethod
    def none(cls, pairs: int) -> Tally:
        """The tally of no configuration."""
        zero, nothing = np.zeros(pairs, dtype=np.int64), Largest(np.zeros(pairs), np.full(pairs, -1))
        return cls(zero, zero, zero, zero, nothing, nothing)

    def __add__(self, other: Tally) -> Tally:
        """The sum of two tallies. The sum of several does not depend on their order."""
        return Tally(
            self.asked + other.asked,
            self.met + other.met,
            self.random_asked + other.random_asked,
            self.random_met + other.random_met,
            self.volume | other.volume,
            self.depth | other.depth,
        )


@dataclass(frozen=True, slots=True)
class ShapeOverlaps:
    """Overlaps of shapes: for each the index of the pair of links, the index of the configuration, volume and depth."""

    pairs: Counts
    rows: Counts
    volumes: Array
    depths: Array

    def tally(self, asked: NDArray[np.bool_], numbers: Counts, first_random: int) -> Tally:
        """The tally of the configurations `numbers` (n,), in which the pairs `asked` (p,) were tested.

        Links of several shapes may overlap several times in one configuration.
        """
        count, random = len(asked), int((numbers >= first_random).sum())
        codes, place = np.unique(self.pairs * len(numbers) + self.rows, return_inverse=True)
        volumes, depths = np.zeros(len(codes)), np.zeros(len(codes))
        np.add.at(volumes, place, self.volumes)
        np.maximum.at(depths, place, self.depths)
        pair, row = np.divmod(codes, len(numbers))
        at = numbers[row]
        return Tally(
            asked * len(numbers),
            np.bincount(pair, minlength=count),
            asked * random,
            np.bincount(pair[at >= first_random], minlength=count),
            _largest(volumes, pair, at, count),
            _largest(depths, pair, at, count),
        )


def _largest(values: Array, pair: Counts, at: Counts, count: int) -> Largest:
    order = np.lexsort((at, -values, pair))
    which, first = np.unique(pair[order], return_index=True)
    largest = Largest(np.zeros(count), np.full(count, -1))
    largest.value[which], largest.at[which] = values[order][first], at[order][first]
    return largest
