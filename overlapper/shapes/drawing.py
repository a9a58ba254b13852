"""Triangles and lines for drawing surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SMOOTH = np.cos(np.deg2rad(40))  # of the angle between two facets: at larger angles, their edge is drawn
Facets = Sequence[NDArray[np.integer[Any]]] | NDArray[np.integer[Any]]


@dataclass(frozen=True)
class Tessellation:
    """Triangles `faces` (k, 3), counter-clockwise from outside, over `vertices` (n, 3).

    `normals` (n, 3) are the normals for shading, None for flat triangles. `edges` (m, 2, 3) are lines to draw together
    with the faces: creases, rims, a grid. `wires` (w, 2, 3) are lines to draw without the faces: every edge, or circles
    and meridians of round shapes.
    """

    vertices: Array
    faces: NDArray[np.integer[Any]]
    normals: Array | None
    edges: Array
    wires: Array


def polyhedron(vertices: Array, facets: Facets) -> Tessellation:
    """A surface of convex facets. The facets are rings of indices, counter-clockwise from outside."""
    edges = vertices[polytope_edges(facets)]
    return Tessellation(vertices, triangles(facets), None, _creases(vertices, facets), edges)


def side_of_polyhedron(vertices: Array, facets: Facets, towards: Array) -> tuple[Array, float, Array]:
    """Unit normal, offset and corners (k, 3) of the facet above whose plane the point `towards` is highest."""
    planes = [_plane(vertices[ring]) for ring in facets]
    nearest = int(np.argmax([towards @ normal - offset for normal, offset in planes]))
    return *planes[nearest], vertices[facets[nearest]]


def _plane(corners: Array) -> tuple[Array, float]:
    """The unit normal of a facet, counter-clockwise from outside, and the offset of its plane from the origin."""
    normal = np.cross(corners - corners[0], np.roll(corners, -1, axis=0) - corners[0]).sum(axis=0)
    normal /= np.linalg.norm(normal)
    return normal, float(corners.mean(axis=0) @ normal)


def capped(radius: float, half: float) -> Tessellation:
    """A capsule about z whose caps have their centres at -half and half, within 0.3 % of the radius; a sphere for 0."""
    slopes = np.concatenate([np.linspace(-np.pi / 2, 0, 13), np.linspace(0, np.pi / 2, 13)])
    heights = radius * np.sin(slopes) + np.repeat([-half, half], 13)
    return revolved(radius * np.cos(slopes), heights, slopes, circles=(4, 8, 12, 13, 17, 21))


def revolved(
    radii: Array, heights: Array, slopes: Array, rims: Sequence[int] = (), circles: Sequence[int] = ()
) -> Tessellation:
    """A profile rotated about z: radii, heights, and the angles of its normals above the xy plane.

    The points with numbers in `rims` make edges. The points with numbers in `circles` make wires, joined by meridians.
    """
    turn = np.linspace(0, 2 * np.pi, 49)
    outward, up = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=-1), np.array([0.0, 0.0, 1.0])
    rings = radii[:, None, None] * outward + heights[:, None, None] * up
    normals = np.cos(slopes)[:, None, None] * outward + np.sin(slopes)[:, None, None] * up
    index = np.arange(rings[..., 0].size).reshape(rings.shape[:2])
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    edges, wires = (polylines(rings[list(rows)]) for rows in (rims, circles))
    wires = np.concatenate([wires, polylines(rings[:, :-1:4].swapaxes(0, 1))])
    return Tessellation(rings.reshape(-1, 3), faces, normals.reshape(-1, 3), edges, wires)


def polylines(points: Array) -> Array:
    """Polylines (k, n, 3) through n points each, as segments (k (n - 1), 2, 3)."""
    return np.stack([points[:, :-1], points[:, 1:]], axis=2).reshape(-1, 2, 3)


def triangles(facets: Facets) -> NDArray[np.integer[Any]]:
    """Triangles (k, 3) of convex facets, len(ring) - 2 for each ring of indices, in the order of the facets."""
    if isinstance(facets, np.ndarray) and facets.shape[1:] == (3,):
        return facets
    return np.array([(ring[0], ring[i], ring[i + 1]) for ring in facets for i in range(1, len(ring) - 1)])


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
