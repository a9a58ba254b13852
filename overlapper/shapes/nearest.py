"""The point of a triangle nearest to the origin, in doubles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def nearest_weights(triangles: Floats) -> Floats:
    """Barycentric weights (k, 3) of the point nearest to the origin on each of the triangles (k, 3, 3)."""
    corner = triangles[:, 0]
    u, v = triangles[:, 1] - corner, triangles[:, 2] - corner
    uu, uv, vv = (np.einsum("ki,ki->k", *pair) for pair in ((u, u), (u, v), (v, v)))
    cu, cv = -np.einsum("ki,ki->k", corner, u), -np.einsum("ki,ki->k", corner, v)
    candidates = np.zeros((len(triangles), 4, 3))
    candidates[:, 0, 0] = 1.0
    with np.errstate(divide="ignore", invalid="ignore"):  # for a triangle without area, its edges are used
        second, third = np.array([vv * cu - uv * cv, uu * cv - uv * cu]) / (uu * vv - uv * uv)
        first = 1.0 - second - third
        inside = (first >= 0.0) & (second >= 0.0) & (third >= 0.0)
    candidates[inside, 0] = np.column_stack([first, second, third])[inside]
    for i, j in ((0, 1), (1, 2), (2, 0)):
        start, edge = triangles[:, i], triangles[:, j] - triangles[:, i]
        squared = np.einsum("ki,ki->k", edge, edge)
        share = np.clip(-np.einsum("ki,ki->k", start, edge) / np.where(squared > 0.0, squared, 1.0), 0.0, 1.0)
        candidates[:, i + 1, i], candidates[:, i + 1, j] = 1.0 - share, share
    lengths = np.linalg.norm(candidates @ triangles, axis=2)
    nearest: Floats = candidates[np.arange(len(triangles)), lengths.argmin(axis=1)]
    return nearest
