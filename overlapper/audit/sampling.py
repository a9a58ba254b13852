"""The configurations of a robot that an audit tests: the rest pose, corners of the joint limits, then random ones.

Each configuration has a number and is drawn by the random generator of its block. It does not depend on which process
tests which blocks in which order.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from overlapper.audit.robot import Degree, Robot

Array = NDArray[np.float64]

BLOCK = 4096  # configurations that are drawn at once
ALL_CORNERS = 8  # the most joints with limits for which all corners (256) are tested
SOME_CORNERS = 256  # corners drawn at random if there are more joints


class Sampling:
    """`count` configurations of a robot, each with the columns `robot.columns`.

    Number 0 is the rest pose: joints are at 0, or halfway between their limits if the limits exclude 0. Then come
    corners, in which all joints with limits are at one of their limits. These are all corners or, with more than 8 such
    joints, each joint alone at either limit and 256 random corners. The configurations from `first_random` on are drawn
    uniformly: between the limits, once around for a joint without limits, and over all orientations of a spherical
    joint. ValueError if `count` is less than 1 or `seed` less than 0.
    """

    def __init__(self, robot: Robot, count: int, seed: int) -> None:
        if count < 1:
            raise ValueError(f"configurations must be 1 or more, not {count}")
        if seed < 0:
            raise ValueError(f"seed must be 0 or more, not {seed}")
        self.count, self.seed, self._degrees = count, seed, robot.degrees
        self._placed = self._rest_and_corners()[:count]
        self.first_random = len(self._placed)
        drawn = range(self.first_random, count, BLOCK)
        self.blocks = [range(self.first_random)] + [range(start, min(start + BLOCK, count)) for start in drawn]
        """The numbers of the configurations, block by block. The first block has those that are not random."""

    def block(self, number: int) -> Array:
        """(n, m): the configurations of a block."""
        if number == 0:
            return self._placed
        random = np.random.default_rng([self.seed, number]).random((BLOCK, sum(map(_draws, self._degrees))))
        random = random[: len(self.blocks[number])]
        columns: list[Array] = []
        used = 0
        for degree in self._degrees:
            drawn = random[:, used : used + _draws(degree)].T
            used += len(drawn)
            if degree.range == "spherical":
                columns += _any_turn(*drawn)
            else:
                columns.append(degree.lower + drawn[0] * (degree.upper - degree.lower))
        return np.asarray(np.array(columns).reshape(-1, len(random)).T)

    def configuration(self, number: int) -> Array:
        """(m,): the configuration with this number."""
        place = next(place for place, block in enumerate(self.blocks) if number in block)
        return np.asarray(self.block(place)[number - self.blocks[place].start])

    def _rest_and_corners(self) -> Array:
        rest = np.array([value for degree in self._degrees for value in _at_rest(degree)], dtype=float)
        limited = [degree for degree in self._degrees if degree.range == "limited" and degree.lower < degree.upper]
        places = [degree.column for degree in limited]
        lower, upper = np.array([(degree.lower, degree.upper) for degree in limited]).reshape(-1, 2).T
        if len(limited) <= ALL_CORNERS:
            sides = np.array(list(itertools.product((False, True), repeat=len(limited))), dtype=bool)
            alone = np.empty((0, len(rest)))
        else:
            sides = np.random.default_rng([self.seed, 0]).random((SOME_CORNERS, len(limited))) < 0.5
            alone = np.tile(rest, (2 * len(limited), 1))
            for k, degree in enumerate(limited):
                alone[2 * k : 2 * k + 2, degree.column] = degree.lower, degree.upper
        corners = np.tile(rest, (len(sides), 1))
        corners[:, places] = np.where(sides, upper, lower)
        return np.concatenate([rest[None], alone, corners if limited else corners[:0]])


def _at_rest(degree: Degree) -> tuple[float, ...]:
    if degree.range == "spherical":
        return 0.0, 0.0, 0.0, 1.0
    return (0.0 if degree.lower <= 0.0 <= degree.upper else (degree.lower + degree.upper) / 2,)


def _draws(degree: Degree) -> int:
    """The number of random numbers that a joint needs."""
    return 3 if degree.range == "spherical" else 1


def _any_turn(a: Array, b: Array, c: Array) -> list[Array]:
    """Uniform random quaternions xyzw, from numbers in 0..1 (K. Shoemake, "Uniform random rotations", 1992)."""
    inner, outer = np.sqrt(1 - a), np.sqrt(a)
    b, c = 2 * np.pi * b, 2 * np.pi * c
    return [inner * np.sin(b), inner * np.cos(b), outer * np.sin(c), outer * np.cos(c)]
