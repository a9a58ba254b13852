"""Quaternions (x, y, z, w), many at once. Quaternions that rotate vectors must be unit quaternions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def rotated(quaternions: Array, vectors: Array) -> Array:
    """Vectors (..., 3) rotated by unit quaternions (..., 4) xyzw."""
    axis, w = quaternions[..., :3], quaternions[..., 3:]
    twice = 2 * _cross(axis, vectors)
    return np.asarray(vectors + w * twice + _cross(axis, twice))


def composed(first: Array, second: Array) -> Array:
    """The products first * second of quaternions (..., 4) xyzw of any length: rotate by second, then by first."""
    a, b, v, w = first[..., :3], second[..., :3], first[..., 3:], second[..., 3:]
    vector = v * b + w * a + _cross(a, b)
    return np.concatenate([vector, v * w - (a * b).sum(axis=-1, keepdims=True)], axis=-1)


def _cross(a: Array, b: Array) -> Array:
    """The cross products of vectors (..., 3). np.cross takes twice as long for few vectors."""
    return np.asarray(a[..., [1, 2, 0]] * b[..., [2, 0, 1]] - a[..., [2, 0, 1]] * b[..., [1, 2, 0]])
