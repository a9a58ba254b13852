"""The points at which rays leave balls, cylinders and planes, in integers, rounded towards the inside."""

from __future__ import annotations

import numpy as np

from overlapper.rational import Exact, exact, integer_root, integers


def in_units(scale: int, *sizes: float) -> tuple[list[int], int]:
    """Sizes as integers in a small enough unit, and the number of these units in 1 / scale."""
    numbers, grow = integers(exact([*sizes]))
    return [int(x) * scale for x in numbers], grow


def out_of_ball(start: Exact, arms: Exact, radius: int, fine: int) -> Exact:
    """The greater share at which |start + share * arm| is the radius, in two or three dimensions.

    Of the two usual formulas for the root, the formula without cancellation is used.
    """
    inside = radius * radius - (start * start).sum(axis=1)
    along, square = (start * arms).sum(axis=1), (arms * arms).sum(axis=1)
    lower = integer_root(along * along + square * inside)
    forwards = along > 0
    over, under = np.where(forwards, inside, lower - along), np.where(forwards, along + lower + 1, square)
    shares: Exact = (over << fine) // under
    return shares


def share_to_plane(slack: int, along: int, fine: int) -> int:
    """The share of a ray at which it meets a plane at distance `slack`; 1 if the ray does not approach the plane."""
    return (slack << fine) // along if along > 0 else 1 << fine
