"""Blocks with a curved side."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from overlapper.rational import Exact
from overlapper.shapes.facts import Block


def up(height: Fraction | int) -> Exact:
    """A vector along z."""
    return np.array([Fraction(0), Fraction(0), Fraction(height)])


def ball_block(centre: Exact, radius: float, planes: Sequence[tuple[Exact, Fraction]] = ()) -> Block:
    return Block(planes, centre[None], radius, centre)


def tube_block(radius: float, half: Fraction) -> Block:
    """A cylinder about z, as long as twice `half`."""
    ends = np.array([up(-half), up(half)])
    return Block([(up(-1), half), (up(1), half)], ends, radius, up(0), up(1))
