"""Who is asked what bodies have in common: each peer is one function of vertex arrays, and its answer its type.

A peer takes the vertices (n,3) of two bodies, or of any number if it is declared with `*bodies`, and returns the volume
of what the hulls have in common (a float; 0.0 for nothing), or only whether they overlap (a bool). It imports its
package itself, so that one that is not installed is known by its ImportError. To add a peer, write its function and
name it in PEERS.

Peers that must be given faces get those of `overlapper.Hull`, coplanar triangles merged, so that a failure is their
own; those that take points build the hull themselves, as their users would.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import reduce
from types import ModuleType
from typing import Any

import numpy as np

from overlapper import Box, Capsule, Cylinder, HalfSpace, Hull, Sphere, overlap

Ring = list[int]
Primitive = Box | Sphere | Capsule | Cylinder | HalfSpace


# The shapes of FCL and coal, which have the same names and arguments but for hulls


def primitive(library: ModuleType, shape: Primitive) -> Any:
    if isinstance(shape, Box):
        return library.Box(*(2 * shape.half_extents))
    if isinstance(shape, Sphere):
        return library.Sphere(shape.radius)
    if isinstance(shape, HalfSpace):
        return library.Halfspace(shape.normal, shape.offset)
    return (library.Capsule if isinstance(shape, Capsule) else library.Cylinder)(shape.radius, shape.length)


def fcl_hull(hull: Hull) -> Any:
    import fcl

    faces = np.concatenate([[len(ring), *ring] for ring in hull.facets])
    return fcl.Convex(hull.vertices, len(hull.facets), faces)


def coal_hull(points: np.ndarray) -> Any:
    import coal

    cloud = coal.StdVec_Vec3s()
    cloud.extend(list(points))
    return coal.ConvexBase.convexHull(cloud, True, "Qt")


# Peers


def auto(*bodies: np.ndarray) -> float:
    return overlap(*bodies).volume


def paper(*bodies: np.ndarray) -> float:
    """The article's method, as this package has it."""
    return overlap(*bodies, method="paper").volume


def clipping(*bodies: np.ndarray) -> float:
    """The first body cut by the planes of the others in plain doubles, as r3d does it: the signs of the vertices decide
    what is kept, so that the mesh stays closed whatever the rounding."""
    first, *others = (Hull(body) for body in bodies)
    vertices, rings = list(first.vertices), [ring.tolist() for ring in first.facets]
    for plane in np.vstack([other.halfspaces for other in others]):
        rings = clipped(vertices, rings, plane)
    return enclosed_volume(np.array(vertices), rings)


def clipped(vertices: list[np.ndarray], rings: list[Ring], plane: np.ndarray) -> list[Ring]:
    """The facets left on the inner side of a plane, and those that close the cut. New vertices are appended."""
    level = np.array(vertices) @ plane[:3] + plane[3]
    old, crossings = len(vertices), {}

    def crossing(u: int, v: int) -> int:
        edge = (min(u, v), max(u, v))
        if edge not in crossings:
            crossings[edge] = len(vertices)
            vertices.append(vertices[u] + level[u] / (level[u] - level[v]) * (vertices[v] - vertices[u]))
        return crossings[edge]

    kept, following = [], {}
    for ring in rings:
        part = []
        for u, v in edges(ring):
            if level[u] <= 0:
                part.append(u)
            if (level[u] <= 0) != (level[v] <= 0):
                part.append(crossing(u, v))
        if part:
            kept.append(part)
            # Two new vertices in a row are a way out and the next way in; the cut runs along them the other way.
            following.update({v: u for u, v in edges(part) if min(u, v) >= old})
    return kept + list(cycles(following))


def edges(ring: Ring) -> Iterable[tuple[int, int]]:
    return zip(ring, ring[1:] + ring[:1])


def cycles(following: dict[int, int]) -> Iterator[Ring]:
    while following:
        ring = [next(iter(following))]
        while (v := following.pop(ring[-1])) != ring[0]:
            ring.append(v)
        yield ring


def enclosed_volume(vertices: np.ndarray, rings: list[Ring]) -> float:
    if not rings:
        return 0.0
    vertices = vertices - vertices[rings[0][0]]
    return sum(
        float(np.cross(vertices[ring[1:-1]], vertices[ring[2:]]).sum(0) @ vertices[ring[0]]) / 6
        for ring in rings
        if len(ring) > 2
    )


def scipy_halfspaces(*bodies: np.ndarray) -> float:
    from scipy.spatial import ConvexHull

    return volume_of_halfspaces(np.vstack([ConvexHull(body).equations for body in bodies]))


def volume_of_halfspaces(planes: np.ndarray) -> float:
    """The usual recipe: the centre of the largest ball by linear programming, then qhull's dual hull about it."""
    from scipy.optimize import linprog
    from scipy.spatial import ConvexHull, HalfspaceIntersection

    slack = np.linalg.norm(planes[:, :3], axis=1)
    ball = linprog([0, 0, 0, -1], np.column_stack([planes[:, :3], slack]), -planes[:, 3], bounds=(None, None))
    if ball.status == 2 or (ball.status == 0 and ball.x[3] <= 0):  # 2: infeasible
        return 0.0
    if ball.status != 0:
        raise RuntimeError(f"linprog: {ball.message}")
    return float(ConvexHull(HalfspaceIntersection(planes, ball.x[:3]).intersections).volume)


def manifold(*bodies: np.ndarray) -> float:
    from manifold3d import Error, Manifold

    common = reduce(Manifold.__xor__, map(Manifold.hull_points, bodies))
    if common.status() != Error.NoError:
        raise RuntimeError(f"manifold3d: {common.status()}")
    return float(common.volume())


def trimesh_boolean(*bodies: np.ndarray) -> float:
    import manifold3d  # noqa: F401, the engine
    from trimesh import PointCloud
    from trimesh.boolean import intersection

    common = intersection([PointCloud(body).convex_hull for body in bodies], engine="manifold")
    return float(common.volume) if len(common.faces) else 0.0


def fcl_collide(a: np.ndarray, b: np.ndarray) -> bool:
    import fcl

    one, other = (fcl.CollisionObject(fcl_hull(Hull(body))) for body in (a, b))
    return fcl.collide(one, other, fcl.CollisionRequest(), fcl.CollisionResult()) > 0


def fcl_distance(a: np.ndarray, b: np.ndarray) -> bool:
    import fcl

    one, other = (fcl.CollisionObject(fcl_hull(Hull(body))) for body in (a, b))
    return fcl.distance(one, other, fcl.DistanceRequest(enable_signed_distance=True)) < 0


def coal_collide(a: np.ndarray, b: np.ndarray) -> bool:
    import coal

    at_rest = coal.Transform3s.Identity()
    result = coal.CollisionResult()
    return coal.collide(coal_hull(a), at_rest, coal_hull(b), at_rest, coal.CollisionRequest(), result) > 0


def pybullet_closest(a: np.ndarray, b: np.ndarray) -> bool:
    """Overlapping is what remains below zero once both hulls' margins are taken off."""
    import pybullet

    margin = 0.001  # m; pybullet grows every hull by it, so that two of them are reported too near by two of it
    if not pybullet.isConnected():
        pybullet.connect(pybullet.DIRECT)
    pybullet.resetSimulation()
    hulls = [pybullet.createCollisionShape(pybullet.GEOM_MESH, vertices=body.tolist()) for body in (a, b)]
    first, second = (pybullet.createMultiBody(0, hull) for hull in hulls)
    points = pybullet.getClosestPoints(first, second, 0.0)
    return min((point[8] for point in points), default=0.0) + 2 * margin < 0


PEERS: dict[str, Callable[..., float | bool]] = {
    "auto": auto,
    "paper": paper,
    "clipping": clipping,
    "scipy": scipy_halfspaces,
    "manifold3d": manifold,
    "trimesh": trimesh_boolean,
    "fcl collide": fcl_collide,
    "fcl distance": fcl_distance,
    "coal": coal_collide,
    "pybullet": pybullet_closest,
}
