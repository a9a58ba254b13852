"""What contact forces need to know of a common volume, and how it changes as the two bodies move.

Derivatives are found by complex steps: a function of real numbers is computed at x + i h, and the imaginary part over h
is its derivative. There is no difference of near values, so h may be 1e-30, and the derivative is right to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from overlapper import Box, HalfSpace, Hull, Overlap, Sphere
from overlapper.quaternion import rotated
from overlapper.shapes.table import facts
from overlapper.simulation.model import Array

# The length of a complex step.
TINY = 1e-30

# Vertices whose planes cross at less than this sine are not followed: their motion is rounding.
CROSSING = 1e-9


class Unfollowed(Exception):
    """The patch has no derivatives by poses that are known here. The message is the rest of a sentence."""


class Geometry(NamedTuple):
    """Volume, centroid, area vector, and the patch as an `Overlap` has them; the second moments of the volume.

    Leading axes are of directions and of patches. Numbers may be complex.
    """

    volume: Any  # m³
    centroid: Any  # (3,) m
    area: Any  # (3,) m², the area vector
    centre: Any  # (3,) m
    moments: Any  # (3, 3) m⁴, of the area about its centre
    distance: Any  # m
    spread: Any  # (3, 3) m⁵, ∫ x xᵀ dV about the centroid; used with a hardening alone

    def flat(self) -> Any:
        """The numbers in a row (..., 29)."""
        rows = [np.asarray(each) for each in self]
        lead = rows[0].shape
        return np.concatenate([each.reshape(*lead, -1) for each in rows], axis=-1)

    @classmethod
    def of(cls, flat: Any) -> Geometry:
        """The inverse of `flat`."""
        lead = flat.shape[:-1]
        return cls(
            flat[..., 0],
            flat[..., 1:4],
            flat[..., 4:7],
            flat[..., 7:10],
            flat[..., 10:19].reshape(*lead, 3, 3),
            flat[..., 19],
            flat[..., 20:29].reshape(*lead, 3, 3),
        )


@dataclass(frozen=True)
class MovingPatch:
    """The geometry (29,) of a patch, and its derivatives (29, 12) by the motions of two links.

    The motions are the linear and angular velocity of each link at its centre of mass, in the world.
    """

    geometry: Array
    by_motion: Array


def dot(a: Any, b: Any) -> Any:
    """The product of vectors along the last axis, also complex ones, without a conjugate."""
    return (a * b).sum(axis=-1)


def norm(a: Any) -> Any:
    """The length of vectors, also complex ones near real ones."""
    return np.sqrt(dot(a, a))


def following(overlap: Overlap, centres: Array) -> MovingPatch:
    """Return the patch of an overlap and how it moves; `centres` (2, 3) in m are the links' centres of mass.

    Raises
    ------
    Unfollowed
        If the shapes are neither polyhedra nor a ball and a half-space, or if the overlap has no patch.
    """
    a, b = overlap.shapes
    kinds: list[type] = [type(each.shape) for each in (a, b)]
    if Sphere in kinds and HalfSpace in kinds:
        return _ball(overlap, centres)
    if not all(isinstance(each.shape, (Box, Hull, HalfSpace)) for each in (a, b)):
        names = " and ".join(f"a {each.__name__}" for each in kinds)
        raise Unfollowed(f"of {names}: they are known for polyhedra, and for a Sphere on a HalfSpace")
    return _polyhedra(overlap, centres)


def _moved(points: Array, centres: Array) -> Array:
    """(2, n, 3, 12) the motions of points that are fixed to each link, by the motions of both links."""
    found = np.zeros((2, len(points), 3, 12))
    for side in range(2):
        arm = points - centres[side]
        found[side, :, :, 6 * side : 6 * side + 3] = np.eye(3)
        for axis, unit in enumerate(np.eye(3)):
            found[side, :, :, 6 * side + 3 + axis] = np.cross(unit, arm)
    return found


def _polyhedra(overlap: Overlap, centres: Array) -> MovingPatch:
    vertices, owner, planes = overlap.vertices, np.asarray(overlap.owner), overlap.halfspaces
    faces: list[list[int]] = [[] for _ in vertices]
    edges = []  # of the patch: from the second body's facets
    other: dict[tuple[int, int], int] = {}
    for face, ring in enumerate(overlap.facets):
        for one, two in zip(ring.tolist(), np.roll(ring, -1).tolist()):
            other[one, two] = face
        for vertex in ring.tolist():
            faces[vertex].append(face)
    for (one, two), face in other.items():
        back = other.get((two, one))
        if owner[face] == 1 and back is not None and owner[back] == 0:
            edges.append((one, two))
    if not edges:
        raise Unfollowed("without a direction")
    if not np.isfinite(overlap.hessian).all():
        raise Unfollowed("where a face lies in the plane of another face")
    fixed = _moved(vertices, centres)
    motion = np.empty((len(vertices), 3, 12))
    for vertex, around in enumerate(faces):
        sides = owner[around]
        if (sides == sides[0]).all():
            motion[vertex] = fixed[sides[0], vertex]
            continue
        normals = planes[around, :3]
        sizes = np.linalg.svd(normals, compute_uv=False)
        if sizes[2] < CROSSING:
            raise Unfollowed("where a face lies in the plane of another face")
        if len(around) > 3:
            raise Unfollowed("where a vertex or an edge lies in the plane of a face")
        motion[vertex] = np.linalg.solve(normals, np.einsum("fi,fij->fj", normals, fixed[sides, vertex]))
    reference = overlap.centroid
    assert reference is not None
    about = vertices - reference
    moving = about + 1j * TINY * np.moveaxis(motion, 2, 0)  # (12, n, 3)
    triangles = [(ring[0], ring[k], ring[k + 1]) for ring in overlap.facets for k in range(1, len(ring) - 1)]
    complex_ = _sums(moving, np.array(triangles), np.array(edges), reference)
    flat = complex_.flat()
    return MovingPatch(flat[0].real, flat.imag.T / TINY)


def _sums(vertices: Any, triangles: Any, edges: Any, reference: Array) -> Geometry:
    """The geometry of polyhedra: `vertices` (d, n, 3) are about a reference, triangles and edges are numbers."""
    corners = vertices[:, triangles]  # (d, t, 3, 3)
    det = dot(corners[:, :, 0], np.cross(corners[:, :, 1], corners[:, :, 2]))
    volume = det.sum(axis=1) / 6
    middle = corners.sum(axis=2)
    centroid = (det[..., None] * middle).sum(axis=1) / 24 / volume[:, None]
    squares = np.einsum("dt,dtki,dtkj->dij", det, corners, corners) + np.einsum("dt,dti,dtj->dij", det, middle, middle)
    spread = squares / 120 - volume[:, None, None] * centroid[:, :, None] * centroid[:, None, :]
    one, two = vertices[:, edges[:, 0]] - centroid[:, None], vertices[:, edges[:, 1]] - centroid[:, None]
    area = np.cross(one, two).sum(axis=1) / 2  # of the second body's part, out of the second body
    normal = area / norm(area)[:, None]
    along, across = plane_axes(normal)
    p = np.stack([dot(one, along[:, None]), dot(one, across[:, None])], axis=-1)
    q = np.stack([dot(two, along[:, None]), dot(two, across[:, None])], axis=-1)
    twice = p[..., 0] * q[..., 1] - p[..., 1] * q[..., 0]
    size = twice.sum(axis=1) / 2
    first = (twice[..., None] * (p + q)).sum(axis=1) / 6 / size[:, None]
    both = p + q
    second = (
        np.einsum("de,dei,dej->dij", twice, p, p)
        + np.einsum("de,dei,dej->dij", twice, q, q)
        + np.einsum("de,dei,dej->dij", twice, both, both)
    ) / 24 - size[:, None, None] * first[:, :, None] * first[:, None, :]
    axes = np.stack([along, across], axis=-1)  # (d, 3, 2)
    moments = np.einsum("dia,dab,djb->dij", axes, second, axes)
    centre = centroid + np.einsum("dia,da->di", axes, first)
    return Geometry(
        volume, reference + centroid, area, reference + centre, moments, _distances(p, q).sum(axis=1) / size, spread
    )


def plane_axes(normal: Any, along: Any = None) -> tuple[Any, Any]:
    """Two unit vectors (..., 3) across a normal, so that the three are right-handed. They turn with the normal.

    The first is near `along`, if that is given.
    """
    if along is None:
        least = np.eye(3)[np.abs(normal.real).argmin(axis=-1)]
        along = np.cross(normal.real, least)
        along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    along = along - normal * dot(along, normal)[..., None]
    return along, np.cross(normal, along)


def _distances(p: Any, q: Any) -> Any:
    """∫ |x| dA over the triangles from the origin to edges from p to q (..., 2), with their orientation."""
    way = q - p
    length = np.sqrt(dot(way, way))
    length = np.where(length == 0, 1, length)
    unit = way / length[..., None]
    height = p[..., 0] * unit[..., 1] - p[..., 1] * unit[..., 0]
    far = np.where(height.real < 0, -height, height)
    start, end = dot(p, unit), dot(q, unit)
    radii = [np.sqrt(dot(each, each)) for each in (p, q)]
    with np.errstate(all="ignore"):
        turned = height**3 * (np.arcsinh(end / far) - np.arcsinh(start / far))
    turned = np.where(far == 0, 0, turned)
    return (height * (end * radii[1] - start * radii[0]) + turned) / 6


def _ball(overlap: Overlap, centres: Array) -> MovingPatch:
    """A ball on a half-space: its cap, and the disc that the plane cuts."""
    a, b = overlap.shapes
    on_b = isinstance(b.shape, HalfSpace)
    ball, half = (a, b) if on_b else (b, a)
    side = facts(half.shape).side(np.zeros(3))
    assert side is not None and isinstance(ball.shape, Sphere)
    out = rotated(half.orientation, side[0])
    point = half.position + side[1] * out
    motions = _moved(np.array([ball.position, point]), centres)
    centre = ball.position + 1j * TINY * motions[0 if on_b else 1, 0].T  # (12, 3)
    plane_point = point + 1j * TINY * motions[1 if on_b else 0, 1].T
    turn = np.zeros((12, 3))
    turn[(9 if on_b else 3) : (12 if on_b else 6)] = np.eye(3)
    normal = out + 1j * TINY * np.cross(turn, out)
    r = ball.shape.radius
    up = dot(centre - plane_point, normal)  # of the ball's centre above the plane
    depth = r - up
    square = depth * (2 * r - depth)  # of the disc's radius
    volume = np.pi * depth**2 * (3 * r - depth) / 3
    below = depth * (4 * r - depth) / (4 * (3 * r - depth))
    centroid = centre - (up + below)[:, None] * normal
    along = np.pi * (square * depth**3 / 3 - up * depth**4 / 2 - depth**5 / 5) - volume * below**2
    squared = square**2 * depth + 4 * up**2 * depth**3 / 3 + depth**5 / 5
    across = np.pi / 4 * (squared - 2 * square * up * depth**2 - 2 * square * depth**3 / 3 + up * depth**4)
    outer = normal[:, :, None] * normal[:, None, :]
    flat = np.eye(3) - outer
    area = np.pi * square
    geometry = Geometry(
        volume,
        centroid,
        (1 if on_b else -1) * area[:, None] * normal,
        centroid,
        (area * square / 4)[:, None, None] * flat,
        2 / 3 * np.sqrt(square),
        along[:, None, None] * outer + across[:, None, None] * flat,
    ).flat()
    return MovingPatch(geometry[0].real, geometry.imag.T / TINY)
