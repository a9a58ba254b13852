"""Rational arithmetic in arrays: every double is a rational number, so sums and products of doubles are exact."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

Exact = NDArray[np.object_]  # of Fraction

exact: Any = np.frompyfunc(Fraction, 1, 1)
integer_root: Any = np.frompyfunc(math.isqrt, 1, 1)

# The error of a sum of a few products of doubles below 1 is at most DOUBT times the sum of magnitudes, plus UNDERFLOW.
DOUBT, UNDERFLOW = 2.0**-48, 2.0**-1000


def rotation(quaternion: NDArray[np.float64]) -> Exact:
    """The exactly orthogonal matrix (3, 3) of a quaternion xyzw of any length, divided by the squared length."""
    x, y, z, w = exact(quaternion)
    s = 2 / (x * x + y * y + z * z + w * w)
    return np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
            [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
            [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
        ],
        dtype=object,
    )


def integers(values: Any) -> tuple[Exact, int]:
    """The values times their least common denominator, and the denominator. Sums of integers are much faster."""
    values = np.asarray(values, object)
    scale = math.lcm(*(x.denominator for x in values.flat))
    numbers: Exact = np.frompyfunc(lambda x: x.numerator * (scale // x.denominator), 1, 1)(values)
    return numbers, scale


def in_doubles(numbers: Exact, scale: int) -> NDArray[np.float64]:
    """The quotients of integers of any size by `scale`, rounded once."""
    doubles: NDArray[np.float64] = np.frompyfunc(lambda x: x / scale, 1, 1)(numbers).astype(float)
    return doubles


def bits(numbers: Exact) -> int:
    """The number of bits of the largest integer."""
    return max((abs(x).bit_length() for x in numbers.flat), default=0)


def cross(u: Exact, v: Exact) -> Exact:
    """The cross products of vectors (..., 3)."""
    (a, b, c), (x, y, z) = np.moveaxis(u, -1, 0), np.moveaxis(v, -1, 0)
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-1)


def triple(u: Exact, v: Exact, w: Exact) -> Exact:
    """The determinants (...) of vectors (..., 3)."""
    product: Exact = (u * cross(v, w)).sum(axis=-1)
    return product


def root(square: Fraction) -> tuple[Fraction, Fraction]:
    """(lower, upper) bounds of the square root: equal if the root is short, else they differ by 1e-38 of it or less."""
    shift = 128 - (square.numerator.bit_length() - square.denominator.bit_length()) // 2
    scaled = square * (Fraction(4) ** shift)
    floor = math.isqrt(scaled.numerator // scaled.denominator)
    unit = Fraction(2) ** -shift
    return floor * unit, (floor if floor * floor == scaled else floor + 1) * unit


def primitive(row: Iterable[Fraction]) -> tuple[int, ...]:
    """Integers without a common divisor in the proportions of the row."""
    row = list(row)
    scale = math.lcm(*(x.denominator for x in row))
    numbers = [x.numerator * (scale // x.denominator) for x in row]
    divisor = math.gcd(*numbers) or 1
    return tuple(x // divisor for x in numbers)


def is_closed(triangles: NDArray[np.signedinteger]) -> bool:
    """Whether triangles (k, 3) of indices have no border: every directed edge occurs as often as its reverse."""
    edges = Counter((int(t[i - 1]), int(t[i])) for t in triangles for i in range(3))
    return bool(edges) and all(count == edges[end, start] for (start, end), count in edges.items())


def fans(rings: Iterable[NDArray[np.int32]]) -> NDArray[np.intp]:
    """Triangles (k, 3) that fan out from the first corner of each polygon."""
    triangles = [(ring[0], *pair) for ring in rings for pair in pairwise(ring[1:])]
    return np.array(triangles, np.intp).reshape(-1, 3)
