"""Random polytopes: hulls of point clouds, and cells between random planes."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from overlapper._core import Hull
from overlapper.whole_number import whole

__all__ = ["Source", "random_polytope"]

Source = Literal["cube", "ball", "sphere", "halfspaces"]


def random_polytope(n: int, source: Source = "cube", *, rng: np.random.Generator | int | None = None) -> Hull:
    """A random polytope about the origin: the hull of random points, or the cell between random planes.

    Parameters
    ----------
    n : int
        Number of points or planes, at least 4.
    source : {'cube', 'ball', 'sphere', 'halfspaces'}, default 'cube'
        The set from which points or planes are drawn uniformly. Points lie in the cube [-1, 1]³, in the unit ball or on
        the unit sphere, in m. Planes of 'halfspaces' touch the unit sphere from outside.
    rng : numpy.random.Generator or int, optional
        A generator or a seed. Default: another polytope each time.

    Returns
    -------
    Hull
        The polytope. Every point on the sphere becomes a vertex, every half-space a facet. A cell that is unbounded or
        reaches beyond 10 m is drawn again.

    Raises
    ------
    TypeError
        If `n` is not a whole number.
    ValueError
        If `n` is below 4, or `source` is unknown.

    Examples
    --------
    >>> from overlapper import random_polytope
    >>> random_polytope(20, "sphere", rng=0)
    Hull(20 vertices, 36 facets)
    """
    if source not in get_args(Source):
        raise ValueError(f"source must be one of {', '.join(get_args(Source))}, not {source!r}")
    n = whole(n, "n")
    if n < 4:
        raise ValueError(f"n must be at least 4, because fewer points or planes enclose no volume, not {n}")
    generator = np.random.default_rng(rng)
    if source == "halfspaces":
        return _cell(n, generator)
    if source == "cube":
        return Hull(generator.uniform(-1.0, 1.0, (n, 3)))
    points = _directions(n, generator)
    if source == "ball":
        points *= np.cbrt(generator.uniform(size=(n, 1)))  # the volume within r grows as r³
    return Hull(points)


def _directions(n: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """(n, 3) unit vectors, uniform on the sphere, because the normal distribution has no preferred direction."""
    vectors = rng.normal(size=(n, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _cell(n: int, rng: np.random.Generator) -> Hull:
    # The cell is the polar dual of the hull of the touching points: that hull's facet n · x <= d is the corner n / d.
    # It is bounded if all d are positive, and within 10 if none is below a tenth; four planes do so once in 32 draws.
    while True:
        planes = Hull(_directions(n, rng)).halfspaces
        if np.all(planes[:, 3] < -0.1):
            return Hull(planes[:, :3] / -planes[:, 3:])
