"""Shapes as arrays: common volumes and IoU of many boxes, rectangles, spheres, capsules, cylinders and ellipsoids.

A function of two arrays pairs row i of both if `aligned`. Otherwise it pairs every row of `a` with every row of `b`.
Arrays may be float64 or float32, read-only, of any strides, or of any library with DLPack. Volumes are float64.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from overlapper import _core
from overlapper._core import ShapeArray

__all__ = [
    "Gradient",
    "ShapeArray",
    "boxes",
    "boxes_of_corners",
    "capsules",
    "corners",
    "cylinders",
    "diou",
    "ellipsoids",
    "giou",
    "iou",
    "rectangles",
    "spheres",
    "volume",
    "volume_gradient",
]

UNIT_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]) - 0.5

# The numbers of a shape's size.
SIZES = {"boxes": 3, "rectangles": 2, "spheres": 1, "capsules": 2, "cylinders": 2, "ellipsoids": 3}

Shapes = ShapeArray | ArrayLike
Numbers = NDArray[np.float64]


def boxes(sizes: ArrayLike, positions: ArrayLike | None = None, orientations: ArrayLike | None = None) -> ShapeArray:
    """Oriented boxes.

    Parameters
    ----------
    sizes : (n, 3) array_like
        Side lengths along x, y, z of each box, m.
    positions : (n, 3) array_like, optional
        Centres, m. The origin if left out.
    orientations : (n, 4) or (n, 3, 3) array_like or scipy.spatial.transform.Rotation, optional
        Quaternions x, y, z, w of any length but 0, or rotation matrices.

    Returns
    -------
    ShapeArray
        The boxes.

    Raises
    ------
    ValueError
        If an array has the wrong shape, or a row is not finite, not positive, or no rotation. The sentence names the
        array and the row.

    Examples
    --------
    >>> from overlapper import arrays
    >>> a = arrays.boxes([[2, 2, 2], [1, 1, 1]])
    >>> b = arrays.boxes([[2, 2, 2]], positions=[[1, 0, 0]])
    >>> arrays.volume(a, b).round(12).tolist()
    [[4.0], [0.5]]
    """
    return _core.boxes(_array(sizes), _array(positions), _array(orientations))


def boxes_of_corners(corners: ArrayLike) -> ShapeArray:
    """Boxes from their 8 corners, as pytorch3d takes them.

    The centre is the mean of the corners. A size is the length of the mean of four edges. The axes are the rotation
    nearest to the directions of these means.

    Parameters
    ----------
    corners : (n, 8, 3) array_like
        Corners, m. The order is that of pytorch3d: around the bottom, then around the top. Other orders are sorted.

    Returns
    -------
    ShapeArray
        The boxes.

    Raises
    ------
    ValueError
        If a corner is off the box by more than a thousandth of the longest side, and by more than the rounding of
        float32 coordinates.

    Examples
    --------
    >>> from overlapper import arrays
    >>> unit = arrays.corners([[1, 1, 1]])
    >>> arrays.iou(unit, unit + [0.5, 0, 0]).round(12).tolist()
    [[0.333333333333]]
    """
    return _of_corners(corners, "corners")


def corners(sizes: ArrayLike, positions: ArrayLike | None = None, orientations: ArrayLike | None = None) -> Numbers:
    """The 8 corners of each box, in the order of pytorch3d.

    Parameters
    ----------
    sizes : (n, 3) array_like
        Side lengths, m.
    positions : (n, 3) array_like, optional
        Centres, m.
    orientations : (n, 4) or (n, 3, 3) array_like, optional
        Quaternions x, y, z, w, or rotation matrices.

    Returns
    -------
    (n, 8, 3) ndarray
        Corners in m: around the bottom, then around the top.

    Raises
    ------
    ValueError
        As for `boxes`.
    """
    made = boxes(sizes, positions, orientations)
    local = UNIT_CORNERS * np.reshape(_array(sizes), (-1, 1, 3))
    return np.asarray(np.einsum("nij,nkj->nki", made.rotations, local) + made.positions[:, None])


def rectangles(rectangles: ArrayLike) -> ShapeArray:
    """Rotated rectangles in the plane. Volumes of rectangles are areas.

    Parameters
    ----------
    rectangles : (n, 5) array_like
        Rows x, y, width, height, angle: the centre, the sizes, and the angle in radians, counter-clockwise.

    Returns
    -------
    ShapeArray
        The rectangles.

    Raises
    ------
    ValueError
        If a row is not finite, or a size is not positive.

    Examples
    --------
    >>> from math import pi
    >>> from overlapper import arrays
    >>> arrays.iou([[0, 0, 1, 1, 0]], [[0, 0, 1, 1, pi / 4]]).round(9).tolist()
    [[0.707106781]]
    """
    return _core.rectangles(_array(rectangles), "rectangles")


def spheres(radii: ArrayLike, positions: ArrayLike | None = None) -> ShapeArray:
    """Spheres.

    Parameters
    ----------
    radii : (n,) array_like
        Radii, m.
    positions : (n, 3) array_like, optional
        Centres, m.

    Returns
    -------
    ShapeArray
        The spheres.

    Raises
    ------
    ValueError
        As for `boxes`.

    Examples
    --------
    >>> from overlapper import arrays
    >>> arrays.spheres([1.0, 2.0]).volume.round(6).tolist()
    [4.18879, 33.510322]
    """
    return _core.spheres(_array(radii), _array(positions))


def capsules(
    radii: ArrayLike, lengths: ArrayLike, positions: ArrayLike | None = None, orientations: ArrayLike | None = None
) -> ShapeArray:
    """Capsules along their own z axis.

    Parameters
    ----------
    radii, lengths : (n,) array_like
        Radii, and lengths between the centres of the half balls, m.
    positions : (n, 3) array_like, optional
        Centres, m.
    orientations : (n, 4) or (n, 3, 3) array_like, optional
        Quaternions x, y, z, w, or rotation matrices.

    Returns
    -------
    ShapeArray
        The capsules.

    Raises
    ------
    ValueError
        As for `boxes`.
    """
    return _core.capsules(_array(radii), _array(lengths), _array(positions), _array(orientations))


def cylinders(
    radii: ArrayLike, lengths: ArrayLike, positions: ArrayLike | None = None, orientations: ArrayLike | None = None
) -> ShapeArray:
    """Cylinders along their own z axis.

    Parameters
    ----------
    radii, lengths : (n,) array_like
        Radii and lengths, m.
    positions : (n, 3) array_like, optional
        Centres, m.
    orientations : (n, 4) or (n, 3, 3) array_like, optional
        Quaternions x, y, z, w, or rotation matrices.

    Returns
    -------
    ShapeArray
        The cylinders.

    Raises
    ------
    ValueError
        As for `boxes`.
    """
    return _core.cylinders(_array(radii), _array(lengths), _array(positions), _array(orientations))


def ellipsoids(
    half_axes: ArrayLike, positions: ArrayLike | None = None, orientations: ArrayLike | None = None
) -> ShapeArray:
    """Ellipsoids.

    Parameters
    ----------
    half_axes : (n, 3) array_like
        Half axes along x, y, z, m.
    positions : (n, 3) array_like, optional
        Centres, m.
    orientations : (n, 4) or (n, 3, 3) array_like, optional
        Quaternions x, y, z, w, or rotation matrices.

    Returns
    -------
    ShapeArray
        The ellipsoids.

    Raises
    ------
    ValueError
        As for `boxes`.
    """
    return _core.ellipsoids(_array(half_axes), _array(positions), _array(orientations))


def volume(a: Shapes, b: Shapes, *, aligned: bool = False, tolerance: float = 1e-3, threads: int | None = 1) -> Numbers:
    """Common volumes of the pairs of two arrays.

    A volume of two boxes or rectangles is off by at most 1e-12 of itself, or has the bits of `overlap`. All other
    volumes have the bits of `overlap`.

    Parameters
    ----------
    a, b : ShapeArray, (n, 8, 3) array_like or (n, 5) array_like
        Two arrays of shapes. Corners (n, 8, 3) stand for boxes, rows (n, 5) for rectangles.
    aligned : bool, default False
        True for row i of `a` with row i of `b`. False for every row of `a` with every row of `b`.
    tolerance : float, default 0.001
        Allowed relative error of the volume for curved shapes, as for `overlap`. Boxes and rectangles ignore it.
    threads : int or None, default 1
        Number of threads; None for one per processor.

    Returns
    -------
    (n, m) or (n,) ndarray
        Volumes in m³, or areas of rectangles in m². 0 for pairs that do not overlap.

    Raises
    ------
    ValueError
        If an array has the wrong shape, or aligned arrays differ in length.

    Examples
    --------
    >>> from overlapper import arrays
    >>> a = arrays.boxes([[2, 2, 2]])
    >>> arrays.volume(a, arrays.spheres([1.0], [[1, 0, 0]])).round(6).tolist()
    [[2.094395]]
    """
    return _core.common_volumes(_shapes(a, "a"), _shapes(b, "b"), aligned, tolerance, threads)


def iou(a: Shapes, b: Shapes, *, aligned: bool = False, tolerance: float = 1e-3, threads: int | None = 1) -> Numbers:
    """Intersection over union of the pairs of two arrays: the common volume over the volume of the union.

    Parameters
    ----------
    a, b : ShapeArray, (n, 8, 3) array_like or (n, 5) array_like
        Two arrays of shapes, as `volume` takes them.
    aligned : bool, default False
        True for row i of `a` with row i of `b`. False for every row of `a` with every row of `b`.
    tolerance : float, default 0.001
        Allowed relative error of the common volume for curved shapes.
    threads : int or None, default 1
        Number of threads; None for one per processor.

    Returns
    -------
    (n, m) or (n,) ndarray
        Ratios from 0 to 1.

    Raises
    ------
    ValueError
        As for `volume`.

    Examples
    --------
    >>> from overlapper import arrays
    >>> a = arrays.boxes([[1, 1, 1]])
    >>> arrays.iou(a, arrays.boxes([[1, 1, 1]], [[0.5, 0, 0]])).round(12).tolist()
    [[0.333333333333]]
    """
    return _ratios(_shapes(a, "a"), _shapes(b, "b"), aligned, tolerance, threads)[0]


def giou(a: Shapes, b: Shapes, *, aligned: bool = False, threads: int | None = 1) -> Numbers:
    """Generalized IoU of boxes or rectangles (Rezatofighi et al. 2019).

    It is the IoU, minus the fraction of the convex hull of both boxes that the union does not fill.

    Parameters
    ----------
    a, b : ShapeArray, (n, 8, 3) array_like or (n, 5) array_like
        Two arrays of boxes, or two of rectangles.
    aligned : bool, default False
        True for row i of `a` with row i of `b`. False for every row of `a` with every row of `b`.
    threads : int or None, default 1
        Number of threads; None for one per processor.

    Returns
    -------
    (n, m) or (n,) ndarray
        Numbers above -1, and at most 1.

    Raises
    ------
    ValueError
        As for `volume`, or if a shape is round.

    Examples
    --------
    >>> from overlapper import arrays
    >>> a = arrays.boxes([[1, 1, 1]])
    >>> arrays.giou(a, arrays.boxes([[1, 1, 1]], [[3, 0, 0]])).round(12).tolist()
    [[-0.5]]
    """
    of_a, of_b = _shapes(a, "a"), _shapes(b, "b")
    ratio, union = _ratios(of_a, of_b, aligned, 1e-3, threads)
    around = np.maximum(_core.volumes_around(of_a, of_b, aligned, threads), union)
    return ratio - (around - union) / around


def diou(a: Shapes, b: Shapes, *, aligned: bool = False, tolerance: float = 1e-3, threads: int | None = 1) -> Numbers:
    """Distance IoU (Zheng et al. 2020).

    It is the IoU, minus the squared distance of the centres over the squared diagonal of the axis-aligned box around
    both shapes.

    Parameters
    ----------
    a, b : ShapeArray, (n, 8, 3) array_like or (n, 5) array_like
        Two arrays of shapes, as `volume` takes them.
    aligned : bool, default False
        True for row i of `a` with row i of `b`. False for every row of `a` with every row of `b`.
    tolerance : float, default 0.001
        Allowed relative error of the common volume for curved shapes.
    threads : int or None, default 1
        Number of threads; None for one per processor.

    Returns
    -------
    (n, m) or (n,) ndarray
        Numbers above -1, and at most 1.

    Raises
    ------
    ValueError
        As for `volume`.

    Examples
    --------
    >>> from overlapper import arrays
    >>> a = arrays.rectangles([[0, 0, 1, 1, 0]])
    >>> arrays.diou(a, arrays.rectangles([[3, 0, 1, 1, 0]])).round(9).tolist()
    [[-0.529411765]]
    """
    of_a, of_b = _shapes(a, "a"), _shapes(b, "b")
    ratio, _ = _ratios(of_a, of_b, aligned, tolerance, threads)
    plane = slice(0, 2 if of_a.kind == "rectangles" else 3)
    p, bounds = of_a.positions[:, plane], of_a.bounds[:, :, plane]
    if not aligned:
        p, bounds = p[:, None], bounds[:, None]
    lower = np.minimum(bounds[..., 0, :], of_b.bounds[:, 0, plane])
    upper = np.maximum(bounds[..., 1, :], of_b.bounds[:, 1, plane])
    between = p - of_b.positions[:, plane]
    return np.asarray(ratio - (between**2).sum(-1) / ((upper - lower) ** 2).sum(-1))


class Gradient(NamedTuple):
    """Derivatives by the numbers of shapes, a row each.

    Parameters
    ----------
    sizes : (n, k) ndarray
        By the side lengths of boxes (k = 3) or rectangles (2), by the radius of spheres (1), by the radius and the
        length of capsules and cylinders (2), or by the half axes of ellipsoids (3). NaN where
        `Overlap.shape_gradient` is NaN.
    positions : (n, 3) ndarray
        By the centres. (n, 2) for rectangles.
    rotations : (n, 3) ndarray
        By a rotation vector about the centre, in world axes. (n, 1) by the angle for rectangles.
    """

    sizes: Numbers
    positions: Numbers
    rotations: Numbers


def volume_gradient(
    a: Shapes, b: Shapes, weights: ArrayLike | None = None, *, aligned: bool = False, threads: int | None = 1
) -> tuple[Gradient, Gradient]:
    """Derivatives of a weighted sum of common volumes.

    Where sides of two boxes lie in one plane, the volume has two one-sided derivatives, and the result is one of both.
    Pairs that do not overlap have the derivative 0.

    Parameters
    ----------
    a, b : ShapeArray, (n, 8, 3) array_like or (n, 5) array_like
        Two arrays of shapes, as `volume` takes them.
    weights : (n, m) or (n,) array_like, optional
        A factor for each common volume, as `volume` arranges them. 1 if left out.
    aligned : bool, default False
        True for row i of `a` with row i of `b`. False for every row of `a` with every row of `b`.
    threads : int or None, default 1
        Number of threads; None for one per processor.

    Returns
    -------
    tuple of Gradient
        The derivatives by the rows of `a`, and by the rows of `b`.

    Raises
    ------
    ValueError
        As for `volume`, or if the weights do not fit or are not finite.

    Examples
    --------
    >>> from overlapper import arrays
    >>> a, b = arrays.boxes([[2, 2, 2]]), arrays.boxes([[4, 4, 4]], [[2, 0, 0]])
    >>> by_a, by_b = arrays.volume_gradient(a, b)
    >>> by_a.positions.round(12).tolist(), by_a.sizes.round(12).tolist()
    ([[4.0, 0.0, 0.0]], [[2.0, 2.0, 2.0]])
    """
    of_a, of_b = _shapes(a, "a"), _shapes(b, "b")
    if weights is None:
        weights = np.ones(len(of_a) if aligned else (len(of_a), len(of_b)))
    weights = _array(weights)
    found = _core.volume_gradients(of_a, of_b, weights, aligned, 1e-3, threads)
    if not np.isfinite(np.asarray(weights, dtype=float)).all():
        raise ValueError("weights must be finite")
    one, other = (
        Gradient(
            by[0][:, : SIZES[rows.kind]] / (2 if rows.kind in ("boxes", "rectangles") else 1),
            by[1][:, : 2 if rows.kind == "rectangles" else 3],
            by[2][:, 2 if rows.kind == "rectangles" else 0 :],
        )
        for rows, by in zip((of_a, of_b), found)
    )
    return one, other


def _array(given: Any) -> Any:
    """An array of any library that has DLPack; other arguments as they are."""
    if given is None or isinstance(given, np.ndarray) or not hasattr(given, "__dlpack__"):
        return given
    return np.from_dlpack(given)


def _of_corners(given: ArrayLike, name: str) -> ShapeArray:
    return _core.boxes(*_core.fit_boxes(_array(given), name)[:3])


def _shapes(given: Shapes, name: str) -> ShapeArray:
    if isinstance(given, ShapeArray):
        return given
    try:
        array = np.asarray(_array(given), dtype=float)
    except (TypeError, ValueError):
        array = np.empty(1)
    if array.shape == (0,) or array.shape[1:] == (8, 3):
        return _of_corners(array, name)
    if array.ndim == 2 and array.shape[1] == 5:
        return _core.rectangles(array, name)
    raise ValueError(
        f"{name} must be shapes of overlapper.arrays, corners of shape (n, 8, 3) or rectangles of shape (n, 5)"
    )


def _ratios(
    a: ShapeArray, b: ShapeArray, aligned: bool, tolerance: float, threads: int | None
) -> tuple[Numbers, Numbers]:
    """The ratios and the volumes of the unions."""
    shared = _core.common_volumes(a, b, aligned, tolerance, threads)
    union = (a.volume if aligned else a.volume[:, None]) + b.volume - shared
    return np.minimum(1.0, shared / union), union
