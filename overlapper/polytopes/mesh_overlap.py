"""The volume that two closed triangle meshes share, concave or not, as a sum over convex bodies.

A closed mesh is a signed sum of prisms between its triangles and a plane below them. The sign is plus for triangles
that face up, and minus for triangles that face down. So the volume that two meshes share is a sum over pairs of prisms,
each with the product of the two signs. Prisms are convex, so every summand has its own error bound.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from overlapper._core import Batch, Hull

Array = NDArray[np.float64]

MOST = 1_000_000  # pairs of prisms, which take half a minute


def mesh_overlap(a: Array, b: Array, threads: int | None = None) -> tuple[float, float] | None:
    """Volume that closed meshes of triangles (t, 3, 3) and (u, 3, 3) share, and a bound of its error.

    Triangles must run along every edge once in each direction, counter-clockwise from outside. The volume is in the
    cube of the unit of the meshes. A region inside several shells of a mesh counts once for each shell. None if there
    are more than a million pairs of prisms.
    """
    lower, upper = window(a, b)
    if (lower >= upper).any():
        return 0.0, 0.0
    height = max(float(np.ptp(each[..., 2])) for each in (a, b))
    floor = float(min(each[..., 2].min() for each in (a, b))) - 0.1 * height
    (first, signs, lost), (second, others, missed) = (_prisms(each, lower, upper, floor) for each in (a, b))
    if not (first and second):
        return 0.0, lost + missed
    hulls = first + second
    where = np.zeros((len(hulls), 3)), np.tile([0.0, 0.0, 0.0, 1.0], (len(hulls), 1))
    batch = Batch(hulls)
    pairs = batch.candidate_pairs(*where)
    pairs = pairs[(pairs[:, 0] < len(first)) & (pairs[:, 1] >= len(first))]
    if len(pairs) > MOST:
        return None
    found = batch.overlaps(*where, pairs, threads=threads, separated=False)
    sign = signs[found.pairs[:, 0]] * others[found.pairs[:, 1] - len(first)]
    # The rounding error of a sum of n numbers is less than n roundings of the sum of their absolute values.
    rounding = len(sign) * 2.0**-52 * float(found.volume.sum())
    return float((sign * found.volume).sum()), float(found.volume_error.sum()) + rounding + lost + missed


def window(a: Array, b: Array) -> tuple[Array, Array]:
    """Lower and upper corner of the box that the boxes of two meshes share."""
    return np.maximum(a.min(axis=(0, 1)), b.min(axis=(0, 1))), np.minimum(a.max(axis=(0, 1)), b.max(axis=(0, 1)))


def _prisms(mesh: Array, lower: Array, upper: Array, floor: float) -> tuple[list[Hull], Array, float]:
    """The prisms above or below a box, their signs, and the volume of the prisms that are too thin for a hull."""
    low, high = mesh.min(axis=1), mesh.max(axis=1)
    mesh = mesh[((low < upper) & (high > lower))[:, :2].all(axis=1)]
    along, across = mesh[:, 1] - mesh[:, 0], mesh[:, 2] - mesh[:, 0]
    areas = (along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]) / 2
    # Rounding decides whether a nearly upright triangle faces up or down; its prism has next to no volume.
    doubt = 2.0**-49 * np.abs(mesh).max(initial=0.0) * (np.abs(along).max(axis=1) + np.abs(across).max(axis=1))
    heights = mesh[:, :, 2].max(axis=1) - floor
    hulls: list[Hull] = []
    signs: list[float] = []
    lost = 0.0
    for corners, area, height, least in zip(mesh, areas.tolist(), heights.tolist(), doubt.tolist()):
        if abs(area) > least:
            try:
                hulls.append(Hull(np.vstack([corners, np.column_stack([corners[:, :2], [floor] * 3])])))
                signs.append(1.0 if area > 0 else -1.0)
                continue
            except ValueError:  # too thin for a hull
                pass
        lost += (abs(area) + least) * height
    return hulls, np.array(signs), lost
