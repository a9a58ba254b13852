"""Convex cells in a plane: the parts of a surface above them, and the cells of nearest points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from overlapper.simulation.model import Array

# A taxel reaches as far as a regular polygon with so many corners.
CORNERS = 16

# Rounding decides the direction of an edge that is shorter, over the breadth of its cell. Such an edge bounds nothing.
TINY = 1e-8


def moments(triangles: Array, cells: Array) -> Array:
    """(n, 3) integrals of the height h, of x h and of y h over what a surface has within each cell.

    `triangles` (t, 3, 3) have corners (x, y, h). Triangles that are clockwise, seen from above, count negative: for a
    closed surface, the first integral is the volume above the cell. `cells` (n, k, 2) are convex and counter-clockwise.
    Corners may repeat.
    """
    low, high = triangles[:, :, :2].min(axis=1), triangles[:, :, :2].max(axis=1)
    least, most = cells.min(axis=1), cells.max(axis=1)
    near = np.ones((len(triangles), len(cells)), dtype=bool)
    for axis in (0, 1):
        near &= low[:, None, axis] <= most[:, axis]
        near &= high[:, None, axis] >= least[:, axis]
    which, owner = np.nonzero(near)
    parts = triangles[which]
    starts = np.roll(cells, 1, axis=1)
    short = np.abs(cells - starts).max(axis=2) < TINY * (most - least).max(axis=1)[:, None]
    starts = np.where(short[..., None], cells, starts)
    for k in range(cells.shape[1]):
        parts, left = _left_of(parts, starts[owner, k], cells[owner, k])
        owner = owner[left]
    found = np.empty((len(cells), 3))
    for column, values in enumerate(_integrals(parts).T):
        found[:, column] = np.bincount(owner, values, len(cells))
    return found


def whole(triangles: Array) -> Array:
    """(3,) the integrals of `moments` over the whole surface."""
    return np.asarray(_integrals(triangles).sum(axis=0))


def nearest(offsets: Array, reach: float) -> Array:
    """(n, k, 2) for each of n points: the part of the plane that is nearest to it, about the point.

    `offsets` (n, m, 2) lead from each point to all others, and are infinite for others that do not count. No part goes
    beyond a regular polygon, whose corners are `reach` away.
    """
    angles = 2 * np.pi * np.arange(CORNERS) / CORNERS
    cells = np.tile(reach * np.stack([np.cos(angles), np.sin(angles)], axis=1), (len(offsets), 1, 1))
    distances = np.linalg.norm(offsets, axis=2)
    order = np.argsort(distances, axis=1)
    for rank in range(offsets.shape[1]):
        other = order[:, rank]
        distance = distances[np.arange(len(cells)), other]
        # A farther point does not cut a cell off.
        rows = np.flatnonzero(distance < 2 * np.linalg.norm(cells, axis=2).max(axis=1, initial=0.0))
        if not len(rows):
            break
        offset = offsets[rows, other[rows]]
        start = offset / 2
        cut, _ = _left_of(cells[rows], start, start + offset[:, ::-1] * (-1, 1))
        cells = _widened(cells, cut.shape[1])
        cells[rows] = cut
    return cells


def area(cells: Array) -> Array:
    """(n,) the areas of cells (n, k, 2)."""
    after = np.roll(cells, -1, axis=1)
    return np.asarray((cells[..., 0] * after[..., 1] - cells[..., 1] * after[..., 0]).sum(axis=1) / 2)


def _left_of(polygons: Array, start: Array, end: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return the parts of convex polygons (m, k, d) on the left of lines (m, 2), and the rows that have such a part.

    Coordinates beyond the first two are linear along each edge.
    """
    along, to = end - start, polygons[..., :2] - start[:, None]
    side = along[:, :1] * to[..., 1] - along[:, 1:] * to[..., 0]
    inside = side >= 0
    rows = np.flatnonzero(inside.any(axis=1))
    cut = np.flatnonzero(~inside[rows].all(axis=1))  # all others are wholly on the left
    if not len(cut):
        return polygons[rows], rows
    parts = _cut(polygons[rows[cut]], side[rows[cut]])
    width = max(parts.shape[1], polygons.shape[1])
    found = _widened(polygons[rows], width)
    found[cut] = _widened(parts, width)
    return found, rows


def _cut(polygons: Array, side: Array) -> Array:
    """Return the parts of polygons (m, k, d) where `side` (m, k), which is linear along each edge, is not negative."""
    inside = side >= 0
    crossing = inside != np.roll(inside, -1, axis=1)
    part = np.where(crossing, side, 0.0) / np.where(crossing, side - np.roll(side, -1, axis=1), 1.0)
    crossings = polygons + part[..., None] * (np.roll(polygons, -1, axis=1) - polygons)
    count = inside.sum(axis=1) + crossing.sum(axis=1)
    shape = len(polygons), 2 * polygons.shape[1]
    corners = np.stack([polygons, crossings], axis=2).reshape(*shape, polygons.shape[2])
    keep = np.stack([inside, crossing], axis=2).reshape(shape)
    order = np.argsort(~keep, axis=1, kind="stable")[:, : count.max()]
    order = np.where(np.arange(order.shape[1]) < count[:, None], order, order[:, :1])  # the first corner repeats
    return np.take_along_axis(corners, order[..., None], axis=1)


def _widened(polygons: Array, width: int) -> Array:
    """The same polygons with `width` corners, of which the first repeats."""
    more = np.repeat(polygons[:, :1], width - polygons.shape[1], axis=1)
    return np.concatenate([polygons, more], axis=1)


def _integrals(polygons: Array) -> Array:
    """(m, 3) integrals of h, x h and y h over each polygon (m, k, 3) with corners (x, y, h)."""
    first, second, third = polygons[:, :1], polygons[:, 1:-1], polygons[:, 2:]
    a, b = second - first, third - first
    twice = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    height = first[..., 2] + second[..., 2] + third[..., 2]
    found = [twice * height / 6]
    for axis in (0, 1):
        products = sum(each[..., 2] * each[..., axis] for each in (first, second, third))
        total = first[..., axis] + second[..., axis] + third[..., axis]
        found.append(twice / 24 * (products + height * total))
    return np.stack([each.sum(axis=1) for each in found], axis=1)
