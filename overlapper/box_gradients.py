"""Common volumes of boxes and their derivatives, for libraries that differentiate.

Boxes are six arrays: sizes, positions and quaternions of `a`, then those of `b`. Arrays of more dimensions than rows
need are stacks of calls.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from overlapper import _core
from overlapper.arrays import UNIT_CORNERS, ShapeArray

Numbers = NDArray[np.float64]

WIDTHS = (3, 3, 4)


def volumes(six: Sequence[Any], aligned: bool, threads: int | None) -> Numbers:
    """Common volumes: (..., n, m) of every row of `a` with every row of `b`, or (...,) of aligned rows."""
    rows, stack, shape = _stacked(six, aligned)
    found = [_core.common_volumes(*_both(each), aligned, 1e-3, threads) for each in zip(*rows)]
    return np.reshape(found, stack + shape) if found else np.empty(stack + shape)


def gradients(six: Sequence[Any], weights: Any, aligned: bool, threads: int | None) -> list[Numbers]:
    """The derivatives of the weighted sum of the common volumes by each number of the six arrays."""
    rows, stack, shape = _stacked(six, aligned)
    count = math.prod(stack)
    weights = np.reshape(np.asarray(weights, dtype=float), (1, count) if aligned else (count, *shape))
    sums: list[list[Numbers]] = [[] for _ in six]
    for each, by in zip(zip(*rows), weights):
        for body, (shape_, position, rotation) in enumerate(
            _core.volume_gradients(*_both(each), by, aligned, 1e-3, threads)
        ):
            quaternion = by_quaternion(each[3 * body + 2], rotation)
            for k, found in enumerate((shape_ / 2, position, quaternion)):
                sums[3 * body + k].append(found)
    return [
        np.reshape(found, np.shape(given)) if found else np.zeros(np.shape(given)) for found, given in zip(sums, six)
    ]


def second_derivatives(
    six: Sequence[Any], weights: Any, cotangents: Sequence[Any], aligned: bool, threads: int | None
) -> tuple[Numbers, list[Numbers]]:
    """The derivatives of sum(cotangents * gradients(six, weights)): by the weights, and by each number of the six.

    NaN where a face of one box lies in the plane of a face of the other.
    """
    rows, stack, shape = _stacked(six, aligned)
    count = math.prod(stack)
    weights = np.reshape(np.asarray(weights, dtype=float), (1, count) if aligned else (count, *shape))
    along = _stacked(cotangents, aligned)[0]
    by_weights, sums = [], [[] for _ in six]  # type: tuple[list[Numbers], list[list[Numbers]]]
    for each, by, to in zip(zip(*rows), weights, zip(*along)):
        both = _both(each)
        turns = [by_quaternion_along(each[k], to[k]) for k in (2, 5)]
        along_a, along_b = (np.hstack([to[k] / 2, to[k + 1], turn]) for k, turn in zip((0, 3), turns))
        slopes, *second = _core.volume_second_derivatives(*both, by, along_a, along_b, aligned, 1e-3, threads)
        by_weights.append(slopes)
        first = _core.volume_gradients(*both, by, aligned, 1e-3, threads)
        for body, (shape_, position, rotation) in enumerate(second):
            k, moment = 3 * body, first[body][2]
            # A second turn is about axes that the first turn leaves where they are.
            rotation = rotation + np.cross(moment, turns[body]) / 2
            quaternion = by_quaternion(each[k + 2], rotation) + _bend(each[k + 2], to[k + 2], moment)
            for i, found in enumerate((shape_ / 2, position, quaternion)):
                sums[k + i].append(found)
    return np.reshape(by_weights, stack + shape), [
        np.reshape(found, np.shape(given)) if found else np.zeros(np.shape(given)) for found, given in zip(sums, six)
    ]


class Directions(NamedTuple):
    """The least translations that separate boxes: their lengths, and weights of the boxes' axes along them.

    A direction is a face normal of `a` or of `b`, or is orthogonal to an edge of each. The weights of all other kinds
    are zero.
    """

    depth: Any  # (...), 0 for boxes that are apart
    face_a: Any  # (..., 3)
    face_b: Any
    edge_a: Any
    edge_b: Any


def directions(six: Sequence[Any], aligned: bool, threads: int | None) -> Directions:
    """Depths and directions: (..., n, m) of every row of `a` with every row of `b`, or (...,) of aligned rows."""
    rows, stack, shape = _stacked(six, aligned)
    found = [_directions(each, aligned, threads) for each in zip(*rows)]
    return Directions(
        *(
            np.reshape([each[k] for each in found], (*stack, *shape, *((3,) if k else ())))
            for k in range(len(Directions._fields))
        )
    )


def depths(xp: Any, six: Sequence[Any], along: Directions, aligned: bool) -> Any:
    """The depths along given directions, by functions of torch or jax.numpy that can be differentiated.

    The depth is the sum of the extents of both boxes along the direction, less the distance of their centres.
    """

    def spread(each: Any, of_b: int) -> Any:
        return each if aligned else each[..., None, :, :] if of_b else each[..., :, None, :]

    (half_a, at_a, turn_a), (half_b, at_b, turn_b) = (
        (spread(size, of_b) / 2, spread(position, of_b), rotations(xp, spread(quaternion, of_b)))
        for of_b, (size, position, quaternion) in enumerate((six[:3], six[3:]))
    )

    def weighted(turn: Any, weights: Any) -> Any:
        return (turn * weights[..., None, :]).sum(-1)

    edges = xp.linalg.cross(weighted(turn_a, along.edge_a), weighted(turn_b, along.edge_b))
    normal = weighted(turn_a, along.face_a) + weighted(turn_b, along.face_b) + edges
    normal = normal / xp.sqrt((normal * normal).sum(-1))[..., None]
    extents = sum(
        (half * xp.abs((turn * normal[..., :, None]).sum(-2))).sum(-1)
        for half, turn in ((half_a, turn_a), (half_b, turn_b))
    )
    return (extents - (normal * (at_a - at_b)).sum(-1)) * (along.depth > 0)


def rotations(xp: Any, quaternions: Any) -> Any:
    """(..., 3, 3) rotation matrices of quaternions of any length, by functions of torch or jax.numpy."""
    unit = quaternions / xp.sqrt((quaternions * quaternions).sum(-1))[..., None]
    x, y, z, w = (unit[..., k] for k in range(4))
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return xp.stack([xp.stack(row, -1) for row in rows], -2)


def check(six: Sequence[Any], aligned: bool) -> None:
    """Raises ValueError unless the shapes of the arrays fit."""
    for name, each, width in zip("aaabbb", six, WIDTHS * 2):
        if each.ndim < (1 if aligned else 2) or each.shape[-1] != width:
            raise ValueError(
                f"{name} must be sizes (n, 3), positions (n, 3) and quaternions (n, 4), not an array of shape "
                f"{tuple(each.shape)}"
            )
    for name, three in (("a", six[:3]), ("b", six[3:])):
        if any(each.shape[:-1] != three[0].shape[:-1] for each in three):
            raise ValueError(f"{name} must have as many positions and quaternions as sizes")
    if aligned and six[0].shape[:-1] != six[3].shape[:-1]:
        raise ValueError("a and b must have the same number of rows if they are aligned")


def tangents(quaternions: Numbers, unit: bool = True) -> Numbers:
    """(n, 3, 4) the derivatives of quaternions xyzw by a rotation vector in the world; of unit length with `unit`."""
    length = np.linalg.norm(quaternions, axis=-1, keepdims=True) if unit else 1.0
    x, y, z, w = np.moveaxis(quaternions / length, -1, 0)
    rows = [[w, -z, y, -x], [z, w, -x, -y], [-y, x, w, -z]]
    return np.moveaxis(0.5 * np.array(rows), -1, 0)


def by_quaternion(quaternions: Numbers, by_rotation: Numbers) -> Numbers:
    """(n, 4) derivatives by quaternions of any length, from (n, 3) those by a rotation vector.

    The length of a quaternion changes nothing, so the derivative is orthogonal to the quaternion. The three tangents of
    a unit quaternion are orthogonal and have length 1/2.
    """
    length = np.linalg.norm(quaternions, axis=-1, keepdims=True)
    return np.asarray(4 * np.einsum("nkj,nk->nj", tangents(quaternions), by_rotation) / length)


def by_quaternion_along(quaternions: Numbers, along: Numbers) -> Numbers:
    """(n, 3) rotation vectors of small changes `along` (n, 4) of quaternions of any length."""
    length = np.linalg.norm(quaternions, axis=-1, keepdims=True)
    return np.asarray(4 * np.einsum("nkj,nj->nk", tangents(quaternions), along) / length)


def _bend(quaternions: Numbers, along: Numbers, moment: Numbers) -> Numbers:
    """(n, 4) derivatives of sum(by_quaternion_along(quaternions, along) * moment) by the quaternions.

    The rotation vector is 4 T(q) c / |q|², where T(q) c is linear in both q and c, and T(q) c = -T(c) q.
    """
    square = (quaternions**2).sum(-1, keepdims=True)
    slope = (by_quaternion_along(quaternions, along) * moment).sum(-1, keepdims=True)
    turned = np.einsum("nkj,nk->nj", tangents(along, unit=False), moment)
    return np.asarray(-2 * slope * quaternions / square - 4 * turned / square)


def corner_gradients(fitted: Sequence[Any], by_size: Numbers, by_position: Numbers, by_quaternion: Numbers) -> Numbers:
    """(n, 8, 3) derivatives by the corners, from those by sizes, positions and unit quaternions of the fitted boxes.

    A size is the length of the mean of four edges. A small change of the edges turns the nearest rotation by half of
    the sum of the turns of the three axes.
    """
    sizes, _, quaternions, order = fitted
    axes = np.swapaxes(_core.boxes(sizes, None, quaternions).rotations, 1, 2)  # a row for each axis
    by_rotation = np.einsum("nkj,nj->nk", tangents(quaternions), by_quaternion)
    by_edge = by_size[..., None] * axes + np.cross(by_rotation[:, None], axes) / (2 * sizes[..., None])
    by_corner = by_position[:, None] / 8 + np.einsum("ck,nkj->ncj", UNIT_CORNERS / 2, by_edge)
    found: Numbers = np.empty_like(by_corner)
    np.put_along_axis(found, np.asarray(order)[..., None], by_corner, axis=1)
    return found


def _stacked(six: Sequence[Any], aligned: bool) -> tuple[list[Numbers], tuple[int, ...], tuple[int, ...]]:
    """The arrays as stacks of rows, the shape of the stack, and the shape of an answer."""
    check(six, aligned)
    given = [np.asarray(each, dtype=float) for each in six]
    if aligned:
        stack = given[0].shape[:-1]
        return [each.reshape(1, math.prod(stack), each.shape[-1]) for each in given], stack, ()
    stack = given[0].shape[:-2]
    rows = [each.reshape(math.prod(stack), *each.shape[-2:]) for each in given]
    return rows, stack, (given[0].shape[-2], given[3].shape[-2])


def _both(six: Sequence[Numbers]) -> tuple[ShapeArray, ShapeArray]:
    return _named("a", six[:3]), _named("b", six[3:])


def _named(name: str, three: Sequence[Numbers]) -> ShapeArray:
    try:
        return _core.boxes(*three)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _directions(six: Sequence[Numbers], aligned: bool, threads: int | None) -> Directions:
    both = _both(six)
    n = len(six[0])
    pairs = np.indices((n, 1 if aligned else len(six[3]))).reshape(2, -1).T
    of_a, of_b = pairs[:, 0], pairs[:, 0] if aligned else pairs[:, 1]
    boxes = [_core.Box(half) for half in np.vstack([six[0], six[3]]) / 2]
    positions, orientations = (np.vstack([six[k], six[k + 3]]) for k in (1, 2))
    found = _core.overlaps(boxes, positions, orientations, np.c_[of_a, n + of_b], threads=threads)
    turn_a, turn_b = both[0].rotations[of_a], both[1].rotations[of_b]
    edges = np.cross(turn_a[:, :, :, None], turn_b[:, :, None, :], axis=1).reshape(-1, 3, 9)
    # Parallel edges have no direction. They are as far from any normal as can be.
    lengths = np.linalg.norm(edges, axis=1, keepdims=True)
    edges = np.divide(edges, lengths, out=np.zeros_like(edges), where=lengths > 0)
    every = np.concatenate([turn_a, turn_b, edges], axis=2)
    normal = found.normal[:, :, None]
    along = (every * normal).sum(1)
    off = np.linalg.norm(every - along[:, None] * normal, axis=1) + (along == 0)
    # A direction may be a face normal and orthogonal to two edges. Then the face counts.
    off[:, 6:] += 1e-9
    best = off.argmin(1)
    side = np.where(along[np.arange(len(best)), best] < 0, -1.0, 1.0)
    unit, edge = np.eye(3), best - 6
    kinds = (
        (best < 3, best, side),
        ((best >= 3) & (best < 6), best - 3, side),
        (best >= 6, edge // 3, side),
        (best >= 6, edge % 3, np.ones_like(side)),
    )
    return Directions(found.depth, *((chosen * size)[:, None] * unit[axis % 3] for chosen, axis, size in kinds))
