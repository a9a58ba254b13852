"""The largest depth and the largest common volume of two moving shapes, bracketed.

Branch and bound: the interval of time with the largest bound is halved. The bound of the depth follows directions that
turn with the bodies, as `time_of_impact` does. The bound of the volume uses the Brunn–Minkowski inequality: while a
convex body is translated through another, the cube root of their common volume is concave. To cover a rotation, one
body is enlarged by what a rotation can move within the interval, in the frame of the other.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from heapq import heappop, heappush
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike, NDArray

from overlapper._core import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    MovingPair,
    Overlap,
    Placed,
    RoundedHull,
    Sphere,
    overlap,
    time_of_impact,
)
from overlapper.shapes import Shape

Motion = tuple[ArrayLike, ArrayLike] | Placed | None

MOST_STEPS = 20_000


@dataclass(frozen=True, slots=True)
class Maximum:
    """The largest value of a quantity during a motion. True unless the bodies are separated all the time.

    Parameters
    ----------
    lower, upper : float
        Bounds of the largest value, m or m³. Rounding is included.
    time : float
        Time in s at which the best value was found. The value at this time is at least `lower`. If the bodies are
        separated all the time, the least distance was seen then.
    converged : bool
        False if `upper - lower` is larger than the tolerance allows.
    steps : int
        Number of poses whose value was computed.
    """

    lower: float
    upper: float
    time: float
    converged: bool
    steps: int

    def __bool__(self) -> bool:
        return self.upper > 0


def maximum_depth(
    a: Shape | Placed,
    b: Shape | Placed,
    motion_a: Motion = None,
    motion_b: Motion = None,
    duration: float = 1.0,
    tolerance: float = 1e-6,
) -> Maximum:
    """The largest penetration depth of two moving shapes.

    The depth is the length of the shortest translation that separates the bodies at one time, as from
    `penetration_depth`. The motions are those of `time_of_impact`.

    Parameters
    ----------
    a, b : shape, Placed, (n, 3) array_like or trimesh.Trimesh
        The two bodies at time 0, as `distance` takes them.
    motion_a, motion_b : tuple of two (3,) array_like, or Placed, optional
        Linear velocity in m/s and angular velocity in rad/s, both in the world; or the body at the end of the motion.
        None: at rest.
    duration : float, default 1.0
        Length of the motion in s.
    tolerance : float, default 1e-6
        Wanted difference of the bounds, as a fraction of the upper bound.

    Returns
    -------
    Maximum
        Bounds of the largest depth in m. Both are 0 if the bodies are separated all the time.

    Raises
    ------
    ValueError
        If both bodies are half-spaces, if `duration` is not positive, or if a motion is not finite.

    Examples
    --------
    >>> from overlapper import Box, Placed, Sphere, maximum_depth
    >>> ball, crate = Placed(Sphere(0.5), (-2, 0, 0.8)), Box([0.5, 0.5, 0.5])
    >>> deepest = maximum_depth(ball, crate, ((4, 0, 0), (0, 0, 0)))
    >>> round(deepest.lower, 6), round(deepest.upper, 6)
    (0.2, 0.2)
    """
    within = checked_tolerance(tolerance)
    met = time_of_impact(a, b, motion_a, motion_b, duration)
    if met.time is None:
        return Maximum(0.0, 0.0, met.distance_time, True, 0)
    pair = MovingPair(a, b, motion_a, motion_b, duration)
    seen: dict[float, tuple[float, NDArray[np.float64]]] = {}

    def signed(time: float) -> tuple[float, NDArray[np.float64]]:
        if time not in seen:
            seen[time] = _signed_depth(overlap(*pair.at(time)))
        return seen[time]

    def most(start: float, end: float) -> tuple[float, float, float]:
        at_start, at_end = signed(start), signed(end)
        deeper = (at_start[0], start) if at_start[0] >= at_end[0] else (at_end[0], end)
        return pair.most_depth(start, at_start[1], end, at_end[1]), *deeper

    upper, _, time, steps = _largest(most, met.time, duration, within, 8 * pair.lost)
    reached = overlap(*pair.at(time))
    lower = max(0.0, (reached.depth or 0.0) - (reached.errors.depth or 0.0) - pair.lost)
    return _result(lower, max(upper, 0.0), time, within, 16 * pair.lost, steps + len(seen))


def maximum_volume(
    a: Shape | Placed,
    b: Shape | Placed,
    motion_a: Motion = None,
    motion_b: Motion = None,
    duration: float = 1.0,
    tolerance: float = 1e-3,
) -> Maximum:
    """The largest common volume of two moving shapes.

    Parameters
    ----------
    a, b : shape, Placed, (n, 3) array_like or trimesh.Trimesh
        The two bodies at time 0, as `distance` takes them.
    motion_a, motion_b : tuple of two (3,) array_like, or Placed, optional
        Linear velocity in m/s and angular velocity in rad/s, both in the world; or the body at the end of the motion.
        None: at rest.
    duration : float, default 1.0
        Length of the motion in s.
    tolerance : float, default 1e-3
        Wanted difference of the bounds, as a fraction of the upper bound. The search ends after 20,000 poses. Volumes
        of round bodies that graze by less than 1e-5 m may need more: then `converged` is False.

    Returns
    -------
    Maximum
        Bounds of the largest common volume in m³. Both are 0 if the bodies are separated all the time.

    Raises
    ------
    ValueError
        If both bodies are half-spaces, if `duration` is not positive, or if a motion is not finite.

    Examples
    --------
    >>> from overlapper import Box, Placed, maximum_volume
    >>> cube = Box([0.5, 0.5, 0.5])
    >>> largest = maximum_volume(Placed(cube, (-2, 0.25, 0)), cube, ((4, 0, 0), (0, 0, 0)))
    >>> largest.lower <= 0.75 <= largest.upper, round(largest.upper, 2), round(largest.time, 2)
    (True, 0.75, 0.5)
    """
    within = checked_tolerance(tolerance)
    met = time_of_impact(a, b, motion_a, motion_b, duration)
    if met.time is None:
        return Maximum(0.0, 0.0, met.distance_time, True, 0)
    pair = MovingPair(a, b, motion_a, motion_b, duration)
    measured = _Volumes(pair, within / 8)
    upper, lower, time, steps = _largest(measured.most, met.time, duration, within, 0.0)
    return _result(lower, upper, time, within, 0.0, steps)


def checked_tolerance(given: float) -> float:
    """The tolerance. ValueError unless it is a number between 0 and 1."""
    if not isinstance(given, Real):
        raise ValueError("tolerance must be a number")
    if not 0 < given < 1:
        raise ValueError(f"tolerance must be greater than 0 and less than 1, not {given!r}")
    return float(given)


def _result(lower: float, upper: float, time: float, within: float, rounding: float, steps: int) -> Maximum:
    return Maximum(lower, upper, time, upper - lower <= 1.01 * within * upper + rounding, steps)


def _largest(
    most: Callable[[float, float], tuple[float, float, float]],
    start: float,
    end: float,
    within: float,
    rounding: float,
) -> tuple[float, float, float, int]:
    """An upper bound of a quantity between two times, the largest value seen, its time, and the number of intervals.

    `most` gives, for an interval, an upper bound, a value that is reached in it, and when.
    """
    start = min(start, end * (1 - 1e-9))
    upper, best, time = most(start, end)
    open_intervals = [(-upper, start, end)]
    closed = -math.inf
    steps = 1
    while open_intervals and steps < MOST_STEPS:
        highest = -open_intervals[0][0]
        if highest <= closed or highest - best <= within * highest + rounding:
            break
        _, first, last = heappop(open_intervals)
        middle = first + (last - first) / 2
        if not first < middle < last:
            closed = max(closed, highest)
            continue
        for part in ((first, middle), (middle, last)):
            upper, value, at = most(*part)
            steps += 1
            if value > best:
                best, time = value, at
            heappush(open_intervals, (-min(upper, highest), *part))
    return max([closed, *(-each[0] for each in open_intervals[:1])]), best, time, steps


def _signed_depth(common: Overlap) -> tuple[float, NDArray[np.float64]]:
    """The depth, or the distance with a minus, and the normal from b to a."""
    depth, gap, normal = common.depth, common.distance, common.normal
    assert depth is not None and gap is not None and normal is not None  # of a pair
    return depth - gap, normal


class _Volumes:
    """Bounds of the common volume of a moving pair."""

    def __init__(self, pair: MovingPair, tolerance: float) -> None:
        self._pair, self._tolerance = pair, tolerance
        a, b = pair.at(0.0)
        self._a_moves = _thickness(a.shape) >= _thickness(b.shape)  # a thin body would become much larger
        smaller = a if a.volume <= b.volume else b
        self._whole = smaller.volume * (1 + 1e-12)
        x, y, z = smaller.bounds[1] - smaller.bounds[0]
        # Rounding moves the bodies by `lost` m; the surface of their common set is less than that of a box.
        self._margin = 2 * pair.lost * float(x * y + y * z + z * x)

    def most(self, start: float, end: float) -> tuple[float, float, float]:
        middle = start + (end - start) / 2
        half = math.nextafter(max(middle - start, end - middle), math.inf)
        a, b = self._pair.at(middle)
        moving, fixed = (a, b) if self._a_moves else (b, a)
        common = overlap(moving, fixed, tolerance=self._tolerance)
        value = common.volume - common.volume_error - self._pair.lost * common.area
        velocity, beside = self._pair.drift(middle, half, self._a_moves)
        margin = self._margin
        if beside > 0 or not isinstance(moving.shape, Hull):  # larger hulls are round, which takes longer
            moving, margin = _enlarged(moving, beside + self._pair.lost), 0.0
        bound = self._while_translated(moving, fixed, half * velocity) + margin
        return min(bound, self._whole), max(0.0, value), middle

    def _volume(self, a: Placed, b: Placed) -> tuple[float, float]:
        """Bounds of the common volume."""
        common = overlap(a, b, tolerance=self._tolerance)
        return max(0.0, common.volume - common.volume_error), common.volume + common.volume_error

    def _while_translated(self, a: Placed, b: Placed, way: NDArray[np.float64]) -> float:
        """A bound of the common volume while a is translated from -way to way."""
        upper = self._volume(a, b)[1]
        if not way.any():
            return upper
        least = min(self._volume(_moved(a, each), b)[0] for each in (-way, way))
        if least > 0:  # the cube root is concave between both ends
            return float((2 * upper ** (1 / 3) - least ** (1 / 3)) ** 3) * (1 + 1e-12)
        return self._volume(_enlarged(a, float(np.linalg.norm(way))), b)[1]


def _thickness(shape: Shape) -> float:
    """About the least extent, m."""
    if isinstance(shape, HalfSpace):
        return math.inf
    _, *longer = sorted(shape.bounds[1] - shape.bounds[0])
    return float(shape.volume / np.prod(longer))


def _moved(body: Placed, by: NDArray[np.float64]) -> Placed:
    return Placed(body.shape, body.position + by, body.given_orientation)


def _enlarged(body: Placed, by: float) -> Placed:
    """The body with all points within `by` m of it, or a little more."""
    shape = body.shape
    larger: Shape
    if by == 0:
        return body
    if isinstance(shape, Sphere):
        larger = Sphere(shape.radius + by)
    elif isinstance(shape, Capsule):
        larger = Capsule(shape.radius + by, shape.length)
    elif isinstance(shape, Cylinder):
        larger = Cylinder(shape.radius + by, shape.length + 2 * by)
    elif isinstance(shape, Box):
        larger = Box(shape.half_extents + by)
    elif isinstance(shape, Ellipsoid):
        larger = Ellipsoid(shape.half_axes * (1 + by / shape.half_axes.min()))
    elif isinstance(shape, Hull):
        larger = RoundedHull(shape.vertices, by)
    elif isinstance(shape, RoundedHull):
        larger = RoundedHull(shape.core.vertices, shape.radius + by)
    else:
        larger = HalfSpace(shape.normal, shape.offset + by)
    return Placed(larger, body.position, body.given_orientation)
