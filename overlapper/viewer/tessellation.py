"""Triangles and lines to draw a shape by, in the shape's own frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overlapper import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, RoundedHull, Shape, Sphere

Array = NDArray[np.float64]
SMOOTH = np.cos(np.deg2rad(40))  # of the angle between two facets: more is an edge to be seen
Facets = Sequence[NDArray[np.integer[Any]]]


@dataclass(frozen=True)
class Tessellation:
    """Triangles `faces` (k, 3), counter-clockwise from outside, over `vertices` (n, 3).

    `normals` (n, 3) are the directions to shade by, None if the triangles are meant flat. `edges` (m, 2, 3) are lines
    that show the shape beside its faces: creases, rims, a grid. `wires` (w, 2, 3) are lines that show it without them:
    every edge, or circles and meridians of what is round.
    """

    vertices: Array
    faces: NDArray[np.integer[Any]]
    normals: Array | None
    edges: Array
    wires: Array


@dataclass(frozen=True)
class Mesh:
    """A closed surface, concave or not, that is drawn and never measured: triangles (t, 3, 3), counter-clockwise."""

    triangles: Array


def tessellation(shape: Shape | Mesh) -> Tessellation:
    """The surface of a bounded shape; round ones within 0.3 % of the radius, rounded hulls with bevelled edges."""
    assert not isinstance(shape, HalfSpace)
    if isinstance(shape, Mesh):
        vertices, faces = np.unique(shape.triangles.reshape(-1, 3), axis=0, return_inverse=True)
        faces = faces.reshape(-1, 3)
        lines = _mesh_creases(vertices, faces)
        return Tessellation(vertices, faces, None, lines, lines)
    if isinstance(shape, RoundedHull):
        core = shape.core
        outward = [core.vertices[ring] + shape.radius * plane[:3] for ring, plane in zip(core.facets, core.halfspaces)]
        shape = Hull(np.concatenate(outward))
    if isinstance(shape, Box | Hull):
        vertices, facets = _box(shape) if isinstance(shape, Box) else (shape.vertices, shape.facets)
        return Tessellation(
            vertices, triangles(facets), None, _creases(vertices, facets), vertices[polytope_edges(facets)]
        )
    if isinstance(shape, Cylinder):
        half = shape.length / 2
        slopes = np.deg2rad([-90, -90, 0, 0, 90, 90])
        radii, rims = shape.radius * np.array([0, 1, 1, 1, 1, 0]), (1, 4)
        return _revolved(radii, np.repeat([-half, half], 3), slopes, rims, rims)
    if isinstance(shape, Ellipsoid):
        return _stretched(tessellation(Sphere(1.0)), shape.half_axes)
    half = shape.length / 2 if isinstance(shape, Capsule) else 0.0
    slopes = np.concatenate([np.linspace(-np.pi / 2, 0, 13), np.linspace(0, np.pi / 2, 13)])
    heights = shape.radius * np.sin(slopes) + np.repeat([-half, half], 13)
    return _revolved(shape.radius * np.cos(slopes), heights, slopes, circles=(4, 8, 12, 13, 17, 21))


def _stretched(ball: Tessellation, half_axes: Array) -> Tessellation:
    """What a ball of radius 1 becomes; normals keep to the surface."""
    assert ball.normals is not None
    normals = ball.normals / half_axes
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    vertices, edges, wires = (half_axes * points for points in (ball.vertices, ball.edges, ball.wires))
    return replace(ball, vertices=vertices, normals=normals, edges=edges, wires=wires)


@dataclass(frozen=True)
class Ground(Tessellation):
    """The part of a plane that is seen of a ground, around `middle`, fading out as far as `reach` metres from there.

    The grid, among `edges` and `wires`, is 1, 0.1, ... m wide.
    """

    middle: Array
    reach: float

    def strength(self, points: Array) -> Array:
        """How much is seen at points (..., 3), from 1 to 0."""
        faded: Array = np.clip(1 - (np.linalg.norm(points - self.middle, axis=-1) / self.reach) ** 2, 0, 1)
        return faded


def ground(shape: Shape, center: Array, size: float) -> Ground | None:
    """A half-space, or the side of a box or a hull on which the scene is, with `center` and `size`; None if round.

    Of a hull it is the rectangle around that side.
    """
    reach = 1.5 * size
    if isinstance(shape, HalfSpace):
        normal, offset = np.asarray(shape.normal), float(shape.offset)
        sides = np.empty((0, 2))
    elif isinstance(shape, Box | Hull):
        vertices, facets = _box(shape) if isinstance(shape, Box) else (shape.vertices, shape.facets)
        planes = [_plane(vertices[ring]) for ring in facets]
        nearest = int(np.argmax([center @ normal - offset for normal, offset in planes]))
        normal, offset = planes[nearest]
        sides = (vertices[facets[nearest]] @ rotation_from_z(normal))[:, :2]
    else:
        return None
    basis = rotation_from_z(normal)
    middle = (center @ basis)[:2]
    lower, upper = middle - reach, middle + reach
    if len(sides):
        lower, upper = (np.clip(each, sides.min(axis=0), sides.max(axis=0)) for each in (lower, upper))

    def in_shape(flat: Array) -> Array:
        placed: Array = np.insert(flat, 2, offset, axis=-1) @ basis.T
        return placed

    cells = 24  # each way: fine enough to fade
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
        lines.append(_polylines(in_shape(line[..., ::-1] if k == 0 else line)))
    grid = np.concatenate(lines)
    where = in_shape(middle[None])[0]
    return Ground(in_shape(lattice.reshape(-1, 2)), faces, None, grid, grid, where, reach)


def _plane(corners: Array) -> tuple[Array, float]:
    """The unit normal of a facet, counter-clockwise from outside, and how far it is from the origin."""
    normal = np.cross(corners - corners[0], np.roll(corners, -1, axis=0) - corners[0]).sum(axis=0)
    normal /= np.linalg.norm(normal)
    return normal, float(corners.mean(axis=0) @ normal)


def cone(radius: float, bottom: float, top: float, upper: float = 0.0) -> Tessellation:
    """A cone about z from height `bottom` to `top`, where it has the radius `upper`: a tip."""
    return _revolved(np.array([0, radius, upper]), np.array([bottom, bottom, top]), np.zeros(3))


def triangles(facets: Facets) -> NDArray[np.integer[Any]]:
    """Convex facets, rings of indices, cut into len(ring) - 2 triangles each: (k, 3), in the order of the facets."""
    return np.array([(ring[0], ring[i], ring[i + 1]) for ring in facets for i in range(1, len(ring) - 1)])


def rotation_from_z(direction: Array) -> Array:
    """A rotation (3, 3) whose third column is the unit `direction`."""
    across = np.cross((0, 1, 0) if abs(direction[1]) < 0.8 else (0, 0, 1), direction)
    across /= np.linalg.norm(across)
    return np.column_stack([across, np.cross(direction, across), direction])


def _box(shape: Box) -> tuple[Array, Facets]:
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    rings = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return signs * shape.half_extents, [np.array(ring) for ring in rings]


def polytope_edges(facets: Facets) -> NDArray[np.integer[Any]]:
    """The edges (k, 2) of a closed surface, each once."""
    pairs = np.concatenate([np.stack([ring, np.roll(ring, -1)], axis=1) for ring in facets])
    return pairs[pairs[:, 0] < pairs[:, 1]]


def _creases(vertices: Array, facets: Facets) -> Array:
    """The edges where two facets, counter-clockwise from outside, meet at an angle of more than 40°."""
    normals: dict[tuple[int, int], Array] = {}
    for ring in facets:
        corners = vertices[ring]
        normal = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
        normals.update(dict.fromkeys(zip(ring, np.roll(ring, -1), strict=True), normal / np.linalg.norm(normal)))
    creases = [(i, j) for (i, j), normal in normals.items() if i < j and normal @ normals[j, i] < SMOOTH]
    edges: Array = vertices[np.array(creases, dtype=int).reshape(-1, 2)]
    return edges


def _mesh_creases(vertices: Array, faces: NDArray[np.integer[Any]]) -> Array:
    """As `_creases`, of many triangles, every edge of which is run along once in each direction."""
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


def _revolved(
    radii: Array, heights: Array, slopes: Array, rims: Sequence[int] = (), circles: Sequence[int] = ()
) -> Tessellation:
    """A profile turned about z: radius, height, and how far its normal points above the horizon.

    Of its points, `rims` are turned into edges, and `circles` into wires, which meridians join.
    """
    turn = np.linspace(0, 2 * np.pi, 49)
    outward, up = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=-1), np.array([0.0, 0.0, 1.0])
    rings = radii[:, None, None] * outward + heights[:, None, None] * up
    normals = np.cos(slopes)[:, None, None] * outward + np.sin(slopes)[:, None, None] * up
    index = np.arange(rings[..., 0].size).reshape(rings.shape[:2])
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    edges, wires = (_polylines(rings[list(rows)]) for rows in (rims, circles))
    wires = np.concatenate([wires, _polylines(rings[:, :-1:4].swapaxes(0, 1))])
    return Tessellation(rings.reshape(-1, 3), faces, normals.reshape(-1, 3), edges, wires)


def _polylines(points: Array) -> Array:
    """Lines (k, n, 3) through n points each, as segments (k (n - 1), 2, 3)."""
    return np.stack([points[:, :-1], points[:, 1:]], axis=2).reshape(-1, 2, 3)
