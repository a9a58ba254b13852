"""The one registry of peers: who is asked what bodies have in common, and how deep or how far apart they are.

A peer is a function of bodies and a setting. The bodies are those of `bodies.py`: hulls as vertices in the world, or
shapes at poses. The function prepares what may be prepared once, and returns a function of nothing, which is timed and
whose answer is compared with the exact truth:

- `volume`: of what the bodies have in common, 0.0 if that is nothing;
- `overlaps`: whether they have anything in common, a bool;
- `distance`: the signed distance, which is minus the least translation that separates bodies that overlap.

A function raises Unfit for bodies that the peer does not know; a chart then leaves the peer out. It imports its package
itself, so that a package that is not installed is known by its ImportError. To add a peer, write its function and name
it in PEERS: every chart then asks it what it answers.

Peers that must be given faces get those of `overlapper.Hull`, coplanar triangles merged, so that a failure is their
own; those that take points build the hull themselves, as their users would.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import cycle
from math import isfinite
from typing import Any

import numpy as np
from families import CORNERS

from harness.bodies import (
    Given,
    Unfit,
    bounded,
    box_of_both,
    corners,
    has,
    inside_test,
    is_round,
    mesh,
    of_coal,
    of_fcl,
    planes,
    points,
    vertices,
)
from overlapper import (
    Batch,
    Box,
    Cylinder,
    HalfSpace,
    Hull,
    Overlaps,
    Placed,
    RoundedHull,
    Sphere,
    overlap,
    penetration_depth,
)

Setting = float | int | str | None
Asked = Callable[[], Any]
GivenBodies = Sequence[Given]

# In tables: the peer was not asked; it has no answer; more iterations of coal change its answer.
NOT_ASKED, NO_ANSWER, OUT_OF_ITERATIONS = "-", "no answer", "out of iterations"

# m. A library that finds no distance returns a number above this one.
NO_DISTANCE = 1e300


@dataclass(frozen=True)
class Look:
    """How the speed chart draws a peer. A line joins the settings of a `joined` peer, from coarse to fine."""

    colour: str = "#555555"
    marker: str = "o"
    joined: bool = False
    size: float = 4.5
    hollow: bool = False
    ours: bool = False


@dataclass(frozen=True)
class Peer:
    """A peer with the settings that it is timed at, from cheap to expensive; others if a body is round.

    `hard` is the setting for hard cases. `posed` says that it takes shapes with their poses, and not vertices in the
    world, whose rounding is not its own fault. `exact` says that its answers for polyhedra are right to rounding.
    With `together` it takes a list of pairs and answers by an array. `by_clock` is for a peer with threads of its own:
    its time is that of the clock, on all processors. Without a `look` it is in no picture of speed.
    """

    prepare: Callable[[Any, Any], Asked]
    settings: tuple[Setting, ...] = (None,)
    round_settings: tuple[Setting, ...] = (None,)
    hard: Setting = None
    posed: bool = False
    exact: bool = True
    together: bool = False
    by_clock: bool = False
    look: Look | None = Look()

    def settings_for(self, bodies: GivenBodies) -> tuple[Setting, ...]:
        return self.round_settings if any(map(is_round, bodies)) else self.settings


# This package


def auto(bodies: GivenBodies, tolerance: float) -> Asked:
    if len(bodies) > 2:
        return lambda: overlap(*bodies, tolerance=tolerance).volume
    a, b = bodies  # two are a call without a star, which takes a tenth longer
    return lambda: overlap(a, b, tolerance=tolerance).volume


class Cold:
    """Many pairs in one call of a batch that knows nothing of them, the shapes made before. Each call gives the pairs
    the other way round and quaternions of another length: other pairs and poses that have the same answers."""

    def __init__(self, pairs: Iterable[GivenBodies]) -> None:
        shapes, self.positions, orientations, rows = in_rows(pairs)
        self.batch = Batch(shapes)
        self.turns = cycle([(orientations, rows), (2 * orientations, rows[:, ::-1].copy())])

    def __call__(self, **settings: Any) -> Overlaps:
        return self.batch.overlaps(self.positions, *next(self.turns), **settings)


def in_rows(pairs: Iterable[GivenBodies]) -> tuple[list, np.ndarray, np.ndarray, np.ndarray]:
    """Shapes, positions, orientations, and rows of two that are a pair."""
    bodies = [body for pair in pairs for body in pair]
    rows = np.arange(len(bodies), dtype=np.int32).reshape(-1, 2)
    names = ("position", "given_orientation")
    positions, orientations = (np.array([getattr(body, name) for body in bodies]) for name in names)
    return [body.shape for body in bodies], positions, orientations, rows


def repeated(pairs: list[GivenBodies]) -> list[GivenBodies]:
    """So often that a call is long enough to be timed."""
    large = any(is_round(body) or len(corners(body)) > 100 for body in pairs[0])
    return pairs * (4 if large else 32)


def auto_batch(pairs: list[GivenBodies], tolerance: float) -> Asked:
    """All measures of many pairs in one call."""
    ask = Cold(repeated(pairs))
    return lambda: ask(tolerance=tolerance).volume


def auto_warm(pairs: list[GivenBodies], tolerance: float) -> Asked:
    """The same pairs again and again while the second body of each moves to and fro, 1e-4 m a step."""
    shapes, positions, orientations, rows = in_rows(repeated(pairs))
    batch = Batch(shapes)
    moved = [positions.copy() for _ in range(4)]
    for step, places in zip((0, 1, 2, 1), moved):
        places[rows[:, 1]] += step * 1e-4 * np.array([0.36, 0.48, 0.8])
    places = cycle(moved)
    return lambda: batch.overlaps(next(places), orientations, rows, tolerance=tolerance).volume


def paper(bodies: GivenBodies, _: None) -> Asked:
    """The article's method, as this package has it."""
    if has(bodies, RoundedHull):
        raise Unfit("rounded hulls")
    return lambda: overlap(*bodies, method="paper").volume


def auto_distance(bodies: GivenBodies, way: str | None) -> Asked:
    """The depth alone is timed; hard cases are asked for whichever of depth and distance there is."""
    if way is None:
        a, b = bodies
        return lambda: -penetration_depth(a, b)

    def signed() -> float:
        found = overlap(*bodies)
        return -found.depth if found else found.distance

    return signed


# Volumes


def r3d(bodies: GivenBodies, _: None) -> Asked:
    """The first body cut by the planes of the others in doubles, in C."""
    from harness.r3d import volume

    if any(map(is_round, bodies)):
        raise Unfit("round shapes")
    first, *others = bodies
    return volume(Hull(vertices(first)), np.vstack([planes(other) for other in others]))


def scipy_volume(bodies: GivenBodies, way: str) -> Asked:
    """Qhull's dual hull about the centre of the largest ball, which linear programming finds, or which is given."""
    from scipy.spatial import ConvexHull, HalfspaceIntersection

    if any(isinstance(body, np.ndarray) for body in bodies):
        return lambda: volume_of_halfspaces(np.vstack([ConvexHull(body).equations for body in bodies]))
    segments = 64 if any(map(is_round, bodies)) else None
    both = np.vstack([planes(body, segments) for body in bodies])
    if way == "linprog":
        return lambda: volume_of_halfspaces(both)
    inside = largest_ball(both, np.ones(len(both))).x[:3]
    return lambda: ConvexHull(HalfspaceIntersection(both, inside).intersections).volume


def volume_of_halfspaces(walls: np.ndarray) -> float:
    from scipy.spatial import ConvexHull, HalfspaceIntersection

    ball = largest_ball(walls, np.linalg.norm(walls[:, :3], axis=1))
    if ball.status == 2 or (ball.status == 0 and ball.x[3] <= 0):  # 2: infeasible
        return 0.0
    if ball.status != 0:
        raise RuntimeError(f"linprog: {ball.message}")
    return float(ConvexHull(HalfspaceIntersection(walls, ball.x[:3]).intersections).volume)


def largest_ball(walls: np.ndarray, slack: np.ndarray) -> Any:
    """The answer of linprog: centre and radius."""
    from scipy.optimize import linprog

    return linprog([0, 0, 0, -1], np.column_stack([walls[:, :3], slack]), -walls[:, 3], bounds=(None, None))


def manifold(bodies: GivenBodies, setting: Setting) -> Asked:
    """Meshes made before; with "moved" both are moved first, as at every step of a simulation."""
    from manifold3d import Error, Manifold, Mesh64

    bounded(bodies)

    def made(body: Given) -> Manifold:
        if isinstance(body, np.ndarray) or is_round(body):
            return Manifold.hull_points(points(body, setting))
        corners_of, triangles = mesh(body, None)
        return Manifold(Mesh64(np.ascontiguousarray(corners_of), triangles.astype(np.uint64)))

    def common() -> Manifold:
        return reduce(Manifold.__xor__, solids)

    solids = [made(body) for body in bodies]
    # manifold3d builds a mesh when its volume is asked for. That must not be timed.
    if isinstance(bodies[0], Placed) and min(solid.volume() for solid in solids) <= 0:
        raise RuntimeError("manifold3d: no mesh")
    if setting == "moved":
        one, other = solids
        still = np.eye(3, 4)
        return lambda: (one.transform(still) ^ other.transform(still)).volume()
    if common().status() != Error.NoError:
        raise RuntimeError(f"manifold3d: {common().status()}")
    if len(solids) > 2:
        return lambda: common().volume()
    one, other = solids
    return lambda: (one ^ other).volume()


def trimesh_volume(bodies: GivenBodies, segments: int | None) -> Asked:
    import manifold3d  # noqa: F401, the engine
    from trimesh import PointCloud, Trimesh
    from trimesh.boolean import intersection

    bounded(bodies)

    def made(body: Given) -> Trimesh:
        if isinstance(body, np.ndarray):
            return PointCloud(body).convex_hull
        return Trimesh(*mesh(body, segments), process=False)

    meshes = [made(body) for body in bodies]

    def common() -> float:
        found = intersection(meshes, engine="manifold")
        return float(found.volume) if len(found.faces) else 0.0

    return common


HEXAHEDRON = [0, 4, 6, 2, 1, 5, 7, 3]  # CORNERS, z fastest, in the order that is wanted: around z = -1, then z = 1


def strobl(bodies: GivenBodies, _: None) -> Asked:
    """The package `overlap`: a ball and a hexahedron or a tetrahedron, both made before."""
    balls = [body for body in bodies if has([body], Sphere)]
    others = [b for b in bodies if has([b], Box) or (has([b], Hull) and len(corners(b)) == 4)]
    if len(balls) != 1 or len(others) != 1:
        raise Unfit("knows balls with hexahedra, wedges and tetrahedra")
    import overlap as peer

    where = vertices(others[0])
    if len(where) == 4:
        mirrored = np.linalg.det(where[1:] - where[0]) < 0
        element = peer.Tetrahedron(where[[0, 2, 1, 3] if mirrored else [0, 1, 2, 3]])
    else:
        element = peer.Hexahedron(where[HEXAHEDRON])
    sphere = peer.Sphere(balls[0].position, balls[0].shape.radius)
    return lambda: peer.overlap_volume(sphere, element)


def monte_carlo(bodies: GivenBodies, samples: int) -> Asked:
    """The share of points, drawn in the box where both boxes meet, that are in both."""
    lower, upper = box_of_both(bodies)
    tests = [inside_test(body) for body in bodies]
    rng = np.random.default_rng(0)

    def estimate() -> float:
        hits = sum(
            count_inside(lower[:, None] + (upper - lower)[:, None] * rng.random((3, size)), tests)
            for size in np.diff([*range(0, samples, 10_000), samples]).tolist()
        )
        return float(np.prod(upper - lower)) * hits / samples

    return estimate


def voxels(bodies: GivenBodies, across: int) -> Asked:
    """Cubes whose centres are in both, so many across the smaller body: what papers on data sets use."""
    lower, upper = box_of_both(bodies)
    pitch = min(float(np.ptp(body.bounds, axis=0).max()) for body in bodies) / across
    tests = [inside_test(body) for body in bodies]

    def count() -> float:
        x, y, z = (np.arange(np.floor(low / pitch), np.ceil(high / pitch)) for low, high in zip(lower, upper))
        sheet = np.stack(np.meshgrid(y, z, indexing="ij")).reshape(2, -1)
        layers = (np.vstack([np.full(sheet.shape[1], i), sheet]) for i in x)
        return pitch**3 * sum(count_inside((layer + 0.5) * pitch, tests) for layer in layers)

    return count


def count_inside(where: np.ndarray, tests: list[Callable[[np.ndarray], np.ndarray]]) -> int:
    for test in tests:
        where = test(where)
    return where.shape[1]


# Yes or no, and distances


def fcl_collide(bodies: GivenBodies, _: None) -> Asked:
    import fcl

    one, other = map(of_fcl, pair_of(bodies))
    return lambda: fcl.collide(one, other, fcl.CollisionRequest(), fcl.CollisionResult()) > 0


def fcl_distance(bodies: GivenBodies, way: str) -> Asked:
    """By the deepest contact, or by the signed distance, which is nearer to the truth."""
    import fcl

    if has(bodies, RoundedHull) or (way == "distance" and has(bodies, HalfSpace)):
        raise Unfit("rounded hulls" if has(bodies, RoundedHull) else "half-spaces")
    one, other = map(of_fcl, pair_of(bodies))
    if way == "distance":
        request = fcl.DistanceRequest(enable_signed_distance=True)
        return lambda: fcl.distance(one, other, request, fcl.DistanceResult())
    asked = fcl.CollisionRequest(enable_contact=True)

    def collide() -> float:
        result = fcl.CollisionResult()
        fcl.collide(one, other, asked, result)
        return -max((contact.penetration_depth for contact in result.contacts), default=0.0)

    return collide


def fcl_distance_below_0(bodies: GivenBodies, _: None) -> Asked:
    ask = fcl_distance(pair_of(bodies), "distance")
    return lambda: ask() < 0


def coal_collide(bodies: GivenBodies, _: None) -> Asked:
    import coal

    (one, at), (other, there) = map(of_coal, pair_of(bodies))
    return lambda: coal.collide(one, at, other, there, coal.CollisionRequest(), coal.CollisionResult()) > 0


def coal_distance(bodies: GivenBodies, tolerance: float | None) -> Asked:
    """By the depth of a contact; with a tolerance, by the distance in coal's own number of iterations.

    The answer is OUT_OF_ITERATIONS if a hundred times as many iterations change it.
    """
    import coal

    (one, at), (other, there) = map(of_coal, pair_of(bodies))
    if tolerance is None:
        contacts = coal.CollisionRequest()

        def collide() -> float:
            result = coal.CollisionResult()
            coal.collide(one, at, other, there, contacts, result)
            return result.getContact(0).penetration_depth if result.numContacts() else 0.0

        return collide

    def asked(patience: int) -> float:
        request = coal.DistanceRequest()
        request.gjk_tolerance = request.epa_tolerance = tolerance
        request.gjk_max_iterations *= patience
        request.epa_max_iterations *= patience
        return float(coal.distance(one, at, other, there, request, coal.DistanceResult()))

    def confirmed() -> float | str:
        found, more = asked(1), asked(100)
        # Only the limits of iterations differ between the two: answers of the same steps are the same bits.
        return OUT_OF_ITERATIONS if found != more and isfinite(more) and abs(more) < NO_DISTANCE else found

    return confirmed


def pybullet_overlaps(bodies: GivenBodies, _: None) -> Asked:
    """True if the distance without the margins of both hulls is below zero."""
    ask = pybullet_distance(pair_of(bodies), 0.0)

    def below_0() -> bool:
        found = ask()
        return found != NO_ANSWER and found < 0

    return below_0


def pybullet_distance(bodies: GivenBodies, reach: float | None) -> Asked:
    """The margin by which pybullet grows hulls is taken off, and nothing else. It looks for points within `reach` m,
    or as far as the bodies go."""
    import pybullet

    if has(bodies, HalfSpace, RoundedHull):
        raise Unfit("half-spaces and rounded hulls")

    def distance() -> float | str:
        if not pybullet.isConnected():
            pybullet.connect(pybullet.DIRECT)
        pybullet.resetSimulation()
        margin, ids, corners_of = 0.0, [], []
        for body in bodies:
            body = Placed(Hull(body)) if isinstance(body, np.ndarray) else body
            margin += 0.001 * has([body], Hull, Box)  # m
            ids.append(pybullet_body(pybullet, body))
            corners_of += list(body.bounds)
        farthest = float(np.ptp(corners_of, axis=0).sum()) if reach is None else reach
        found = pybullet.getClosestPoints(*ids, farthest)
        return min(point[8] for point in found) + margin if found else NO_ANSWER

    return distance


def pybullet_body(pybullet: Any, body: Placed) -> int:
    shape = body.shape
    if isinstance(shape, (Hull, Box)):
        # As a box, it would have round edges.
        cloud = shape.vertices if isinstance(shape, Hull) else CORNERS * shape.half_extents
        model = pybullet.createCollisionShape(pybullet.GEOM_MESH, vertices=cloud.tolist())
    elif isinstance(shape, Sphere):
        model = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=shape.radius)
    else:
        kind = pybullet.GEOM_CYLINDER if isinstance(shape, Cylinder) else pybullet.GEOM_CAPSULE
        model = pybullet.createCollisionShape(kind, radius=shape.radius, height=shape.length)
    place = {"basePosition": body.position.tolist(), "baseOrientation": body.orientation.tolist()}
    return pybullet.createMultiBody(0, model, **place)


def pair_of(bodies: GivenBodies) -> GivenBodies:
    if len(bodies) != 2:
        raise Unfit("more than two bodies")
    return bodies


POWERS = tuple(10.0**-k for k in range(1, 13))
SEGMENTS = (16, 64, 256, 1024)
SAMPLES, ACROSS, BY_QHULL = tuple(10**k for k in range(3, 8)), (16, 32, 64), ("point given", "linprog")
BY_FCL = ("collide", "distance")

PEERS: dict[str, dict[str, Peer]] = {
    "volume": {
        "auto": Peer(
            auto, (1e-1, 1e-3, 1e-12), POWERS, 1e-3, posed=True, look=Look("#d1001f", "o", True, 7, ours=True)
        ),
        "auto, batch": Peer(
            auto_batch, (1e-3,), (1e-3,), posed=True, together=True, look=Look("#ff6f61", "D", size=5.5, ours=True)
        ),
        "auto, warm batch": Peer(auto_warm, (1e-3,), (1e-3,), posed=True, exact=False, together=True, look=None),
        "paper": Peer(paper, posed=True, look=Look("#f08a00", "s", size=5.5)),
        "r3d": Peer(r3d, look=Look("#7a4a21", "v", size=5.5)),
        "scipy": Peer(scipy_volume, BY_QHULL, BY_QHULL, "linprog", look=Look("#1f5fbf", "^", size=6)),
        "manifold3d": Peer(manifold, ("prebuilt", "moved"), SEGMENTS, 64, look=Look("#1a8a3a", "P", size=7.5)),
        "manifold3d, by the clock": Peer(
            manifold, ("prebuilt",), SEGMENTS, by_clock=True, look=Look("#8cc99a", "P", size=5)
        ),
        "overlap": Peer(strobl, look=Look("#e0409a", "*", size=8.5)),
        "trimesh": Peer(trimesh_volume, (None,), SEGMENTS[:3], 64, look=Look("#19a7a7", "X", size=7)),
        "Monte Carlo": Peer(monte_carlo, SAMPLES, SAMPLES, exact=False, look=Look("#8d8d8d", ".", True, 6)),
        "voxels": Peer(voxels, ACROSS, ACROSS, exact=False, look=Look("#9467bd", "s", True, 3.5)),
    },
    "overlaps": {
        "fcl collide": Peer(fcl_collide),
        "fcl distance": Peer(fcl_distance_below_0),
        "coal": Peer(coal_collide),
        "pybullet": Peer(pybullet_overlaps),
    },
    "distance": {
        "auto": Peer(auto_distance, hard="signed", posed=True, look=Look("#d1001f", size=6, hollow=True, ours=True)),
        "fcl": Peer(fcl_distance, BY_FCL, BY_FCL, "distance", True, look=Look("#1f5fbf", "^", size=5.5, hollow=True)),
        "coal": Peer(coal_distance, hard=1e-6, posed=True, look=Look("#000000", "s", size=5, hollow=True)),
        "coal, 1e-12": Peer(coal_distance, (), (), 1e-12, posed=True),
        "pybullet": Peer(pybullet_distance, (), (), posed=True),
    },
}

# The peers that are timed: all volumes, and the depths of peers that know distances.
TIMED = PEERS["volume"] | {f"{name}, depth": peer for name, peer in PEERS["distance"].items() if peer.settings}

# The peers that stay fast: they are timed on meshes of all sizes and on bodies that are apart, too.
FEW = ("auto", "auto, batch", "auto, warm batch", "paper", "scipy", "manifold3d", "manifold3d, by the clock", "trimesh")


def quantity(timed: str) -> str:
    return "volume" if timed in PEERS["volume"] else "depth"


@dataclass(frozen=True)
class HardCase:
    """A peer as hard cases are put to it: a function of bodies that prepares and answers at once.

    It is sent to another process, and is therefore a class. The answer is NOT_ASKED if the peer is unfit.
    """

    kind: str
    name: str

    def __call__(self, *bodies: Given) -> Any:
        peer = PEERS[self.kind][self.name]
        try:
            return peer.prepare(bodies, peer.hard)()
        except Unfit:
            return NOT_ASKED


def hard_cases(kind: str) -> list[str]:
    """The peers of a kind that hard cases are put to: not variants of others, and no estimates."""
    return [name for name, peer in PEERS[kind].items() if peer.exact and not (peer.together or peer.by_clock)]
