"""Triangles and lines that draw shapes, meshes and grounds, in their own frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overlapper import Shape
from overlapper.shapes.drawing import SMOOTH, Tessellation, polylines, revolved
from overlapper.shapes.table import facts

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mesh:
    """A closed surface, concave or not, for drawing alone: `triangles` (t, 3, 3), counter-clockwise from outside."""

    triangles: Array


def bounded(shape: Shape | Mesh) -> bool:
    """False for a half-space."""
    return isinstance(shape, Mesh) or facts(shape).bounded


def tessellation(shape: Shape | Mesh) -> Tessellation:
    """The surface of a bounded shape: round shapes within 0.3 % of the radius, rounded hulls with bevelled edges."""
    if not isinstance(shape, Mesh):
        return facts(shape).tessellation()
    vertices, faces = np.unique(shape.triangles.reshape(-1, 3), axis=0, return_inverse=True)
    faces = faces.reshape(-1, 3)
    lines = _mesh_creases(vertices, faces)
    return Tessellation(vertices, faces, None, lines, lines)


@dataclass(frozen=True)
class Ground(Tessellation):
    """The part of a ground that is drawn: a plane around `middle` that fades out at `reach`, m, from there.

    The grid, among `edges` and `wires`, is 1, 0.1, ... m wide.
    """

    middle: Array
    reach: float

    def strength(self, points: Array) -> Array:
        """The strength of the plane at points (..., 3), from 1 to 0."""
        faded: Array = np.clip(1 - (np.linalg.norm(points - self.middle, axis=-1) / self.reach) ** 2, 0, 1)
        return faded


def ground(shape: Shape | Mesh, center: Array, size: float) -> Ground | None:
    """The plane of a half-space, or the side of a box or hull that faces the scene; None for a round shape.

    `center` and `size`, m, are those of the scene. The side of a hull is drawn as the rectangle around it.
    """
    side = None if isinstance(shape, Mesh) else facts(shape).side(center)
    if side is None:
        return None
    normal, offset, corners = side
    reach = 1.5 * size
    basis = rotation_from_z(normal)
    middle = (center @ basis)[:2]
    lower, upper = middle - reach, middle + reach
    if len(corners):
        sides = (corners @ basis)[:, :2]
        lower, upper = (np.clip(each, sides.min(axis=0), sides.max(axis=0)) for each in (lower, upper))

    def in_shape(flat: Array) -> Array:
        placed: Array = np.insert(flat, 2, offset, axis=-1) @ basis.T
        return placed

    cells = 24  # each way: enough to fade smoothly
    across, along = (np.linspace(lower[k], upper[k], cells + 1) for k in (0, 1))
    lattice = np.stack(np.meshgrid(across, along), axis=-1)
    number = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    step = 10 ** np.floor(np.log10(size / 2))
    lines = []
    for k, ticks in enumerate((along, across)):
        places = np.arange(np.ceil(lower[k] / step), np.floor(upper[k] / step) + 1) * step
        line = np.stack(np.meshgrid(ticks, places), axis=-1)  # (place, tick, 2)
        lines.append(polylines(in_shape(line[..., ::-1] if k == 0 else line)))
    grid = np.concatenate(lines)
    where = in_shape(middle[None])[0]
    return Ground(in_shape(lattice.reshape(-1, 2)), faces, None, grid, grid, where, reach)


def cone(radius: float, bottom: float, top: float, upper: float = 0.0) -> Tessellation:
    """A cone about z from height `bottom` to `top`, where it has the radius `upper`: a tip."""
    return revolved(np.array([0, radius, upper]), np.array([bottom, bottom, top]), np.zeros(3))


def rotation_from_z(direction: Array) -> Array:
    """A rotation (3, 3) whose third column is the unit `direction`."""
    across = np.cross((0, 1, 0) if abs(direction[1]) < 0.8 else (0, 0, 1), direction)
    across /= np.linalg.norm(across)
    return np.column_stack([across, np.cross(direction, across), direction])


def _mesh_creases(vertices: Array, faces: NDArray[np.integer[Any]]) -> Array:
    """The edges where two of many triangles meet at an angle of more than 40°; each edge is run along both ways."""
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)[:, None]
    normals = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    start, end = faces.ravel().astype(np.int64), np.roll(faces, -1, axis=1).ravel().astype(np.int64)
    there, back = start * len(vertices) + end, end * len(vertices) + start
    order = np.argsort(there)
    across = order[np.searchsorted(there[order], back)]
    sharp = (normals[np.arange(len(start)) // 3] * normals[across // 3]).sum(axis=1) < SMOOTH
    chosen = sharp & (start < end)
    edges: Array = vertices[np.column_stack([start, end])[chosen]]
    return edges
