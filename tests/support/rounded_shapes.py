"""Rounded hulls at random, rounded boxes, and volumes in closed form by mpmath."""

from __future__ import annotations

import numpy as np
from mpmath import mp, mpf

from overlapper import Box, Overlap, Placed, RoundedHull, overlap

CUBE_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
HALF = np.array([0.5, 0.25, 0.125])
UNTURNED = (0, 0, 0, 1)
# A polygon that is flat but for rounding. Its corner number 3 is 30 m outside of the other five.
FLAT_TO_ROUNDING = [
    [-228.19018762913493, 168.64895585679642, 49.94688694664977],
    [208.89060241078056, 91.20957163156146, 241.2532994344141],
    [-1.5218986605436082, -289.2615215173071, -336.8837252444207],
    [369.4785276482767, -243.63975097199156, -44.943498982643604],
    [67.44932784485637, 218.22931835339494, 297.97333844466164],
    [334.93212040715406, -158.65599274463904, 31.690779149099114],
]


def points(rng, count):
    rows = rng.normal(size=(count, 3))
    return rows / np.linalg.norm(rows, axis=1)[:, None] * rng.uniform(0.3, 0.6, 3)


def rounded_box(r, at=(0, 0, 0), turn=UNTURNED, half=HALF):
    return Placed(RoundedHull(CUBE_CORNERS * half, r), at, turn)


def sliced(a: Placed, b: Placed) -> Overlap:
    """By slices: three bodies have no other way."""
    found = overlap(a, b, Placed(Box([60, 60, 60]), a.position))
    assert found.way == "slicing"
    return found


def agree(a: Placed, b: Placed) -> bool:
    """Whether the pair and its slices differ by no more than both errors."""
    found, by_slices = overlap(a, b), sliced(a, b)
    return abs(found.volume - by_slices.volume) <= found.volume_error + by_slices.volume_error


def within(found: Overlap, expected, beside=2e-15):
    """The stated error holds, but for the rounding of a position that the test gives."""
    return abs(mpf(found.volume) - expected) <= mpf(found.volume_error) + beside * abs(expected)


def cap(radius, depth):
    return mp.pi * depth**2 * (3 * radius - depth) / 3


def lens(a, b, apart):
    depth = a + b - apart
    return mp.pi * depth**2 * (apart**2 + 2 * apart * (a + b) - 3 * (a - b) ** 2) / (12 * apart)
