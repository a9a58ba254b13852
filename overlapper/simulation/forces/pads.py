"""The taxels of a tactile sensor: flat grids, and points with normals."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from overlapper.quaternion import rotated
from overlapper.simulation.forces.cells import area, nearest
from overlapper.simulation.model import Array
from overlapper.whole_number import whole

# A taxel feels a direction if the cosine of the angle to its normal is larger.
FACING = 1e-6

# Messages show arguments of so many numbers.
SHOWN = 4


class Pad(ABC):
    """Taxels that are fixed to a link, all in the frame of the link."""

    shape: tuple[int, ...]
    """The shape of the arrays that have an entry for each taxel."""

    axes: Array
    """(*shape, 3, 3) unit axes x, y and z of each taxel, in rows. z is the normal, which points out of the pad."""

    @property
    @abstractmethod
    def areas(self) -> Array:
        """The area of each taxel in m², an array of `shape`."""

    @abstractmethod
    def cells(self, sight: Array) -> tuple[NDArray[np.intp], Array]:
        """The taxels that face a direction, and their cells as they are seen from there."""


class TaxelGrid(Pad):
    """A flat rectangle of equal taxels, fixed to a link.

    The rectangle lies in the plane z = 0 of the grid's own frame, with its centre at the origin. The z axis points out
    of the pad, towards whatever presses it. `position` and `orientation` place this frame in the frame of the link. In
    pybullet, that is the frame of the link's centre of mass, as in `getLinkState()[:2]` and for collision shapes. In
    MuJoCo, it is the frame of the geom, as in `data.geom_xpos`.

    Parameters
    ----------
    size : (2,) array_like
        Extents of the rectangle along x and y, m.
    shape : (int, int)
        Numbers of taxels along x and y.
    position : (3,) array_like, default (0, 0, 0)
        The centre of the rectangle in the frame of the link, m.
    orientation : (4,) array_like, default (0, 0, 0, 1)
        Quaternion x, y, z, w of the grid's frame in the frame of the link, of any length but 0.

    Raises
    ------
    TypeError
        If `shape` is not two whole numbers.
    ValueError
        If another argument is invalid. The message names it.

    Examples
    --------
    >>> from overlapper.simulation import TaxelGrid
    >>> grid = TaxelGrid(size=(0.02, 0.01), shape=(4, 2))
    >>> grid.points[0, 0].tolist(), grid.areas[0].round(9).tolist()
    ([-0.0075, -0.0025, 0.0], [2.5e-05, 2.5e-05])
    """

    def __init__(
        self,
        size: ArrayLike,
        shape: tuple[int, int],
        position: ArrayLike = (0, 0, 0),
        orientation: ArrayLike = (0, 0, 0, 1),
    ) -> None:
        self.size = _numbers(size, "size", (2,), "two lengths greater than 0 in m", lambda each: bool((each > 0).all()))
        counts = shape if isinstance(shape, (tuple, list)) and len(shape) == 2 else ()
        if not counts:
            raise TypeError(f"shape must be two whole numbers, not {shape!r}")
        self.shape = whole(counts[0], "shape"), whole(counts[1], "shape")
        if min(self.shape) < 1:
            raise ValueError(f"shape must be two whole numbers from 1, not {shape!r}")
        self.position = _numbers(position, "position", (3,), "three coordinates in m")
        turn = _numbers(orientation, "orientation", (4,), "a quaternion x, y, z, w that is not 0", np.any)
        turn = turn / np.abs(turn).max()
        self.orientation = turn / np.linalg.norm(turn)
        self.axes = np.broadcast_to(rotated(self.orientation, np.eye(3)), (*self.shape, 3, 3))

    @property
    def points(self) -> Array:
        """(nx, ny, 3) the centres of the taxels in the frame of the link, m."""
        return self._at(*((np.arange(count) + 0.5) / count for count in self.shape))

    @cached_property
    def areas(self) -> Array:
        """(nx, ny) the area of each taxel, m²."""
        return np.full(self.shape, self.size.prod() / math.prod(self.shape))

    def cells(self, sight: Array) -> tuple[NDArray[np.intp], Array]:
        """The taxels that face a direction, and their cells as they are seen from there.

        Parameters
        ----------
        sight : (3, 3) ndarray
            In rows: two unit axes of the picture, then the direction to the viewer, in the frame of the link.

        Returns
        -------
        taxels : (n,) ndarray of int
            Indices of flattened arrays.
        cells : (n, k, 2) ndarray
            Convex polygons along both axes, counter-clockwise, m.
        """
        if not self.axes[0, 0, 2] @ sight[2] > FACING:
            return np.empty(0, dtype=np.intp), np.empty((0, 4, 2))
        corners = self._at(*(np.arange(count + 1) / count for count in self.shape)) @ sight[:2].T
        around = [corners[:-1, :-1], corners[1:, :-1], corners[1:, 1:], corners[:-1, 1:]]
        return np.arange(math.prod(self.shape)), np.stack(around, axis=2).reshape(-1, 4, 2)

    def _at(self, x: Array, y: Array) -> Array:
        """Points at parts of the way along both sides, from 0 to 1."""
        along = [(part - 0.5) * extent for part, extent in zip((x, y), self.size)]
        flat = np.stack([*np.meshgrid(*along, indexing="ij"), np.zeros((len(x), len(y)))], axis=-1)
        return np.asarray(self.position + rotated(self.orientation, flat))

    def __repr__(self) -> str:
        return f"TaxelGrid(size={self.size.tolist()}, shape={self.shape})"


class Taxels(Pad):
    """Points with normals that feel pressure, fixed to a link: for curved pads, and for taxels in any order.

    All numbers are in the frame of the link, as for `TaxelGrid`. A contact is felt by the taxels that face it. Each
    point of its patch counts for the nearest of these taxels, as seen along the normal of the contact. If it is farther
    than `reach`, it is outside. The limit is a regular polygon of 16 corners around each taxel.

    Parameters
    ----------
    points : (n, 3) array_like
        The taxels, m.
    normals : (n, 3) array_like
        Directions that point out of the pad, of any length but 0.
    reach : float
        The greatest distance at which a taxel feels a pressure, m. About the distance of neighbours leaves no gaps.

    Raises
    ------
    ValueError
        If an argument is invalid, or two taxels are at the same point. The message names it.

    Examples
    --------
    >>> from overlapper.simulation import Taxels
    >>> taxels = Taxels([[0, 0, 0.01], [0.004, 0, 0.01]], [[0, 0, 1], [0, 0, 1]], reach=0.002)
    >>> taxels.axes[0].tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """

    def __init__(self, points: ArrayLike, normals: ArrayLike, reach: float) -> None:
        self.points = _numbers(points, "points", (-1, 3), "an (n, 3) array of coordinates in m")
        count = len(self.points)
        given = _numbers(
            normals,
            "normals",
            (count, 3),
            f"an ({count}, 3) array of directions that are not 0, one for each point",
            lambda each: bool(each.any(axis=1).all()),
        )
        said = "a length greater than 0 in m"
        self.reach = float(_numbers(reach, "reach", (), said, lambda each: bool(each > 0)))
        same, times = np.unique(self.points, axis=0, return_counts=True)
        if (times > 1).any():
            raise ValueError(f"points must be different, but {times.max()} of them are {same[times.argmax()].tolist()}")
        self.shape = (count,)
        given = given / np.abs(given).max(axis=1, keepdims=True)
        z = given / np.linalg.norm(given, axis=1, keepdims=True)
        # x is the link's x axis, or its y axis where that one is nearly normal, projected on the taxel's plane.
        axis = np.where(np.abs(z[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
        x = axis - (axis * z).sum(axis=1, keepdims=True) * z
        x /= np.linalg.norm(x, axis=1, keepdims=True)
        self.axes = np.stack([x, np.cross(z, x), z], axis=1)

    @cached_property
    def areas(self) -> Array:
        """(n,) the area of each taxel, m²: of its cell in its own plane."""
        z = self.axes[:, 2]
        away = self.points - self.points[:, None]
        offsets = np.einsum("ijk,ilk->ijl", away, self.axes[:, :2])
        offsets[~(z @ z.T > FACING)] = np.inf
        offsets[np.arange(len(z)), np.arange(len(z))] = np.inf
        return area(nearest(offsets, self.reach))

    def cells(self, sight: Array) -> tuple[NDArray[np.intp], Array]:
        """The taxels that face a direction, and their cells as they are seen from there.

        Parameters
        ----------
        sight : (3, 3) ndarray
            In rows: two unit axes of the picture, then the direction to the viewer, in the frame of the link.

        Returns
        -------
        taxels : (n,) ndarray of int
            Indices of flattened arrays.
        cells : (n, k, 2) ndarray
            Convex polygons along both axes, counter-clockwise, m.
        """
        facing = np.flatnonzero(self.axes[:, 2] @ sight[2] > FACING)
        # A taxel that is exactly behind another one is hidden.
        facing = facing[np.argsort(-self.points[facing] @ sight[2], kind="stable")]
        seen, first = np.unique(self.points[facing] @ sight[:2].T, axis=0, return_index=True)
        offsets = seen - seen[:, None]
        offsets[np.arange(len(seen)), np.arange(len(seen))] = np.inf
        return facing[first], seen[:, None] + nearest(offsets, self.reach)

    def __repr__(self) -> str:
        return f"Taxels({len(self.points)} points, reach={self.reach})"


def _numbers(
    given: Any, name: str, shape: tuple[int, ...], said: str, good: Callable[[Array], object] | None = None
) -> Array:
    """The argument `name` as an array. -1 in `shape` is any length from 1. ValueError if it is not what is `said`."""
    try:
        array = np.array(given, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be {said}, not {given!r}") from None
    fits = len(array.shape) == len(shape) and all(
        has == wanted or (wanted == -1 and has > 0) for has, wanted in zip(array.shape, shape)
    )
    if not fits and array.size > SHOWN:
        raise ValueError(f"{name} must be {said}, not an array of shape {array.shape}")
    if not np.isfinite(array).all() and array.size > SHOWN:
        raise ValueError(f"{name} must be {said}, but some of them are not finite")
    if not fits or not np.isfinite(array).all() or (good and not good(array)):
        raise ValueError(f"{name} must be {said}, not {given!r}")
    return array
