"""Who is asked how deep two bodies are in each other or how far apart: each peer is one function, and its answer in m.

A peer takes two bodies, each the vertices (n,3) of a hull or a shape at a pose, and
returns the signed distance, which is minus the least translation that separates them where they overlap. A peer that
gives none says so in words. It imports its package itself, so that one that is not installed is known by its
ImportError. To add a peer, write its function and name it in DISTANCE_PEERS.

Peers are asked in the most exact way that they have: FCL's signed distance is nearer to the truth than the depths of
its contacts.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite

import numpy as np
from families import CORNERS
from peers import coal_hull, fcl_hull, primitive
from stability_results import NO_ANSWER, NO_DISTANCE, NOT_ASKED
from strategies import rotation

from overlapper import Box, Cylinder, HalfSpace, Hull, Placed, RoundedHull, Sphere, overlap

Body = np.ndarray | Placed
Answer = float | str

OUT_OF_ITERATIONS = "out of iterations"


def auto(a: Body, b: Body) -> float:
    found = overlap(a, b)
    return -found.depth if found else found.distance


def way(*bodies: Body) -> str:
    """By which way the package itself answers."""
    return overlap(*bodies).way


def fcl(a: Body, b: Body) -> Answer:
    import fcl

    def placed(body: Body) -> fcl.CollisionObject:
        if isinstance(body, np.ndarray):
            return fcl.CollisionObject(fcl_hull(Hull(body)))
        where = fcl.Transform(rotation(body.orientation), body.position)
        return fcl.CollisionObject(primitive(fcl, body.shape), where)

    if any(isinstance(body, Placed) and isinstance(body.shape, (HalfSpace, RoundedHull)) for body in (a, b)):
        return NOT_ASKED
    return fcl.distance(placed(a), placed(b), fcl.DistanceRequest(enable_signed_distance=True))


def coal(a: Body, b: Body) -> Answer:
    return coal_distance(a, b, 1e-6)


def coal_tight(a: Body, b: Body) -> Answer:
    return coal_distance(a, b, 1e-12)


def coal_distance(a: Body, b: Body, tolerance: float) -> Answer:
    """With as many iterations as it makes by itself: an answer that a hundred times as many do not confirm is none."""
    import coal

    def shape_and_pose(body: Body) -> tuple[coal.ShapeBase, coal.Transform3s]:
        if isinstance(body, np.ndarray):
            return coal_hull(body), coal.Transform3s.Identity()
        shape = body.shape
        if isinstance(shape, RoundedHull):
            model = coal_hull(shape.core.vertices)
            model.setSweptSphereRadius(shape.radius)
        else:
            model = primitive(coal, shape)
        return model, coal.Transform3s(rotation(body.orientation), body.position)

    (one, at), (other, there) = shape_and_pose(a), shape_and_pose(b)

    def asked(patience: int) -> float:
        request = coal.DistanceRequest()
        request.gjk_tolerance = request.epa_tolerance = tolerance
        request.gjk_max_iterations *= patience
        request.epa_max_iterations *= patience
        return float(coal.distance(one, at, other, there, request, coal.DistanceResult()))

    found, confirmed = asked(1), asked(100)
    # Nothing but the limits of iterations differs between the two, so that answers of the same steps are the same bits.
    if found != confirmed and isfinite(confirmed) and abs(confirmed) < NO_DISTANCE:
        return OUT_OF_ITERATIONS
    return found


def pybullet(a: Body, b: Body) -> Answer:
    """The margin by which pybullet grows hulls, and nothing else, is taken off."""
    import pybullet

    if any(isinstance(body, Placed) and isinstance(body.shape, (HalfSpace, RoundedHull)) for body in (a, b)):
        return NOT_ASKED
    if not pybullet.isConnected():
        pybullet.connect(pybullet.DIRECT)
    pybullet.resetSimulation()
    margin, ids, corners = 0.0, [], []
    for body in (a, b):
        if isinstance(body, np.ndarray):
            body = Placed(Hull(body))
        shape = body.shape
        if isinstance(shape, (Hull, Box)):
            # As a box, it would have round edges.
            points = shape.vertices if isinstance(shape, Hull) else CORNERS * shape.half_extents
            model = pybullet.createCollisionShape(pybullet.GEOM_MESH, vertices=points.tolist())
            margin += 0.001  # m
        elif isinstance(shape, Sphere):
            model = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=shape.radius)
        else:
            kind = pybullet.GEOM_CYLINDER if isinstance(shape, Cylinder) else pybullet.GEOM_CAPSULE
            model = pybullet.createCollisionShape(kind, radius=shape.radius, height=shape.length)
        place = {"basePosition": body.position.tolist(), "baseOrientation": body.orientation.tolist()}
        ids.append(pybullet.createMultiBody(0, model, **place))
        corners += list(body.bounds)
    farthest = float(np.ptp(corners, axis=0).sum())
    points = pybullet.getClosestPoints(*ids, farthest)
    return min(point[8] for point in points) + margin if points else NO_ANSWER


DISTANCE_PEERS: dict[str, Callable[[Body, Body], Answer]] = {
    "auto": auto,
    "fcl": fcl,
    "coal": coal,
    "coal, 1e-12": coal_tight,
    "pybullet": pybullet,
}
