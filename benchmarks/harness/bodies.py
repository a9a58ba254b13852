"""Bodies as peers get them: hulls as vertices (n, 3) in the world, and shapes at poses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any

import exact
import families
import numpy as np
from strategies import rotation

from overlapper import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, Placed, RoundedHull, Sphere

Given = np.ndarray | Placed

GROUND = 10.0  # m, side of the box that stands for the ground where a peer takes no half-space


class Unfit(Exception):
    """The peer cannot be asked about these bodies; the text says why."""


def is_round(body: Given) -> bool:
    kinds = (Sphere, Capsule, Cylinder, Ellipsoid, RoundedHull)
    return isinstance(body, Placed) and isinstance(body.shape, kinds)


def corners(body: Placed) -> np.ndarray:
    """(n, 3) of a box, hull or half-space, in its own frame."""
    shape = body.shape
    if isinstance(shape, HalfSpace):
        # Only the ground is taken: { z <= 0 } in its own frame.
        return families.box_of((-GROUND / 2, -GROUND / 2, -GROUND), (GROUND / 2, GROUND / 2, 0.0))
    return families.CORNERS * shape.half_extents if isinstance(shape, Box) else shape.vertices


def exact_points(body: Placed) -> list[exact.Vector]:
    """The corners in the world, without rounding."""
    return exact.placed(corners(body).tolist(), body.position.tolist(), body.given_orientation.tolist())


def vertices(body: Given) -> np.ndarray:
    """(n, 3) in the world, rounded."""
    if isinstance(body, np.ndarray):
        return body
    return families.mapped(corners(body), rotation(body.orientation)) + body.position


def points(body: Given, segments: int | None) -> np.ndarray:
    """Vertices in the world; those of an inscribed polytope with so many segments around a round shape."""
    if not is_round(body):
        return vertices(body)
    shape = body.shape
    ball = families.globe(segments, segments // 2)
    if isinstance(shape, Cylinder):
        rough = families.prism(segments, shape.length) * [shape.radius, shape.radius, 1]
    elif isinstance(shape, Capsule):
        ends = [ball[sign * ball[:, 2] >= -1e-12] * shape.radius for sign in (1, -1)]
        rough = np.vstack([end + [0, 0, sign * shape.length / 2] for end, sign in zip(ends, (1, -1))])
    elif isinstance(shape, RoundedHull):
        rough = rounded(shape, ball)
    else:
        rough = ball * (shape.half_axes if isinstance(shape, Ellipsoid) else shape.radius)
    return rough @ rotation(body.orientation).T + body.position


def rounded(shape: RoundedHull, ball: np.ndarray) -> np.ndarray:
    """The facets moved outwards, and the farthest point in each direction of a ball."""
    core = shape.core
    facets = [core.vertices[ring] + shape.radius * plane[:3] for ring, plane in zip(core.facets, core.halfspaces)]
    parts = np.array_split(ball, -(-len(ball) // 4096))
    farthest = np.concatenate([(part @ core.vertices.T).argmax(1) for part in parts])
    return np.vstack([*facets, core.vertices[farthest] + shape.radius * ball])


def mesh(body: Given, segments: int | None) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles."""
    hull = Hull(points(body, segments))
    fans = [(ring[0], ring[k], ring[k + 1]) for ring in hull.facets for k in range(1, len(ring) - 1)]
    return np.array(hull.vertices), np.array(fans)


def planes(body: Given, segments: int | None = None) -> np.ndarray:
    """(k, 4) rows [n, b] with n · x + b <= 0 inside."""
    if isinstance(body, Placed) and isinstance(body.shape, HalfSpace):
        normal = rotation(body.orientation) @ body.shape.normal
        return np.array([[*normal, -body.shape.offset - normal @ body.position]])
    return Hull(points(body, segments)).halfspaces


def bounded(bodies: Sequence[Given]) -> None:
    """Raises Unfit if a half-space is not the ground, which a box can stand for."""
    for body in bodies:
        if isinstance(body, Placed) and isinstance(body.shape, HalfSpace) and (body.shape.normal != [0, 0, 1]).any():
            raise Unfit("a slanted half-space")


def has(bodies: Sequence[Given], *kinds: type) -> bool:
    return any(isinstance(body, Placed) and isinstance(body.shape, kinds) for body in bodies)


# The shapes of FCL and coal, which have the same names and arguments but for hulls


def primitive(library: ModuleType, shape: Box | Sphere | Capsule | Cylinder | HalfSpace) -> Any:
    if isinstance(shape, Box):
        return library.Box(*(2 * shape.half_extents))
    if isinstance(shape, Sphere):
        return library.Sphere(shape.radius)
    if isinstance(shape, HalfSpace):
        return library.Halfspace(shape.normal, shape.offset)
    return (library.Capsule if isinstance(shape, Capsule) else library.Cylinder)(shape.radius, shape.length)


def of_fcl(body: Given) -> Any:
    import fcl

    shape = Hull(body) if isinstance(body, np.ndarray) else body.shape
    if isinstance(shape, Hull):
        faces = np.concatenate([[len(ring), *ring] for ring in shape.facets])
        model = fcl.Convex(shape.vertices, len(shape.facets), faces)
    else:
        model = primitive(fcl, shape)
    if isinstance(body, np.ndarray):
        return fcl.CollisionObject(model)
    return fcl.CollisionObject(model, fcl.Transform(rotation(body.orientation), body.position))


def coal_hull(cloud: np.ndarray) -> Any:
    import coal

    corners_of = coal.StdVec_Vec3s()
    corners_of.extend(list(cloud))
    return coal.ConvexBase.convexHull(corners_of, True, "Qt")


def of_coal(body: Given) -> tuple[Any, Any]:
    """The shape and its pose."""
    import coal

    if isinstance(body, np.ndarray):
        return coal_hull(body), coal.Transform3s.Identity()
    shape = body.shape
    if isinstance(shape, RoundedHull):
        model = coal_hull(shape.core.vertices)
        model.setSweptSphereRadius(shape.radius)
    else:
        model = coal_hull(shape.vertices) if isinstance(shape, Hull) else primitive(coal, shape)
    return model, coal.Transform3s(rotation(body.orientation), body.position)


# Points inside


def box_of_both(bodies: Sequence[Placed]) -> tuple[np.ndarray, np.ndarray]:
    (lower, upper), (low, high) = (body.bounds for body in bodies)
    return np.maximum(lower, low), np.minimum(upper, high)


def inside_test(body: Placed) -> Callable[[np.ndarray], np.ndarray]:
    """A function that gives those of the points (3, n) that are in a shape."""
    shape, turned, at = body.shape, rotation(body.orientation), body.position[:, None]
    if isinstance(shape, RoundedHull):
        raise Unfit("whether a point is in a rounded hull is no short question")
    if isinstance(shape, Sphere):
        return lambda where: where[:, ((where - at) ** 2).sum(0) <= shape.radius**2]
    if isinstance(shape, Ellipsoid):
        return lambda where: where[:, ((turned.T @ (where - at) / shape.half_axes[:, None]) ** 2).sum(0) <= 1]
    walls = None if is_round(body) else planes(body)

    def kept(where: np.ndarray) -> np.ndarray:
        if walls is not None:
            # A few planes at a time: a point outside of one need not be tried with all.
            for some in np.array_split(walls, -(-len(walls) // 16)):
                where = where[:, (some[:, :3] @ where <= -some[:, 3:]).all(0)]
            return where
        x, y, z = turned.T @ (where - at)
        if isinstance(shape, Cylinder):
            return where[:, (x * x + y * y <= shape.radius**2) & (np.abs(z) <= shape.length / 2)]
        z = np.maximum(np.abs(z) - shape.length / 2, 0)
        return where[:, x * x + y * y + z * z <= shape.radius**2]

    return kept
