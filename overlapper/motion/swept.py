"""The convex hull of the space that a moving shape passes through, between an inner and an outer polytope.

Sandwich algorithm: the inner polytope is the hull of points of the body at some times. The normal of each of its facets
is asked how far the body reaches along it during the motion. The points that reach farthest are added.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from overlapper._core import Hull, Placed, swept_supports
from overlapper.motion.maximum import Motion, checked_tolerance
from overlapper.shapes import Shape

MOST_POINTS = 30_000


@dataclass(frozen=True, slots=True)
class SweptHull:
    """The convex hull of a swept volume, between two polytopes.

    Parameters
    ----------
    inner : Placed
        A hull of points that the body passes through, up to rounding. `inner.volume` is not larger than the volume.
    outer : Placed
        A hull that contains the body at all times. `outer.volume` is not smaller than the volume.
    converged : bool
        False if the volumes differ by more than the tolerance.
    """

    inner: Placed
    outer: Placed
    converged: bool


def swept_hull(
    body: Shape | Placed, motion: Motion = None, duration: float = 1.0, tolerance: float = 1e-2
) -> SweptHull:
    """The convex hull of the swept volume of a shape along a motion, as an inner and an outer polytope.

    The swept volume is the union of the body at all times. If the body does not turn, the swept volume is convex, and
    this is the swept volume itself. If the body turns, its swept volume may be hollow, and this is the smallest convex
    set around it. To follow a long turn closer, call this for parts of the motion: the swept volume lies in the union
    of their outer polytopes.

    Parameters
    ----------
    body : shape, Placed, (n, 3) array_like or trimesh.Trimesh
        The body at time 0. A half-space has no swept volume.
    motion : tuple of two (3,) array_like, or Placed, optional
        Linear velocity in m/s and angular velocity in rad/s, both in the world; or the body at the end of the motion.
        The position moves along a line, and the body turns about its position. None: at rest.
    duration : float, default 1.0
        Length of the motion in s.
    tolerance : float, default 1e-2
        Wanted difference of the two volumes, as a fraction of the larger one.

    Returns
    -------
    SweptHull
        Both polytopes with their volumes. The truth lies between them.

    Raises
    ------
    ValueError
        If the body is a half-space, if `duration` is not positive, or if the motion is not finite.

    Examples
    --------
    >>> from overlapper import Box, swept_hull
    >>> swept = swept_hull(Box([0.5, 0.5, 0.5]), ((2, 0, 0), (0, 0, 0)))
    >>> round(swept.inner.volume, 9), round(swept.outer.volume, 9)
    (3.0, 3.0)
    """
    within = checked_tolerance(tolerance)
    placed = body if isinstance(body, Placed) else Placed(body)
    ratio = (1 - within) ** (-1 / 3) - 1
    directions = np.array([each for each in product((-1, 0, 1), repeat=3) if any(each)], float)
    _, points = swept_supports(placed, motion, duration, directions, np.inf)
    for _ in range(2):  # thin bodies may be flat between these directions
        axes = np.linalg.svd(points - points.mean(axis=0))[2]
        points = np.concatenate([points, swept_supports(placed, motion, duration, [*axes, *-axes], np.inf)[1]])
    size = float(np.abs(points).max())
    while True:
        hull = Hull(points)
        centre, planes = hull.centroid, hull.halfspaces
        normals, offsets = planes[:, :3], -planes[:, 3]
        heights = offsets - normals @ centre
        fine = ratio * float(heights.min()) / 8
        upper, farther = swept_supports(placed, motion, duration, normals, fine)
        beyond = (upper + 2.0**-44 * size - offsets) / heights
        most = max(0.0, float(beyond.max()))
        enough = most <= ratio
        missing = beyond > ratio
        if enough or len(points) + missing.sum() > MOST_POINTS:
            break
        points = np.concatenate([hull.corners, farther[missing]])
        if len(np.unique(points, axis=0)) == len(hull.corners):
            break  # rounding allows no better hull
    outer = Hull(centre + (1 + most) * (hull.corners - centre))
    at = placed.position
    return SweptHull(Placed(hull, at), Placed(outer, at), enough)
