"""Who is timed on pairs of placed shapes: each peer is one function that prepares what may be prepared once.

A peer takes a `workloads.Pair` and one of its settings, imports its package itself, so that one that is not installed
is known by its ImportError, and returns a function of nothing: that is what is timed, and what it returns is compared
with the exact truth. Meshes, planes and collision objects are made before. A peer that cannot be asked about a pair
raises Unfit. To add a peer, write its function and name it in METHODS.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import cycle
from typing import Any

import numpy as np
from families import globe, prism
from peers import clipped, coal_hull, enclosed_volume, fcl_hull, primitive, volume_of_halfspaces
from strategies import rotation
from workloads import Pair, corners, is_round, vertices

from overlapper import (
    Batch,
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Placed,
    RoundedHull,
    Sphere,
    overlap,
    penetration_depth,
)

Setting = float | int | str | None
Asked = Callable[[], Any]


MOST_IN_NUMPY = 200  # vertices of either body, for a peer that looks at all of them for every plane of the other


class Unfit(Exception):
    """The peer cannot be asked about this pair; the text says why."""


@dataclass(frozen=True)
class Method:
    """A peer with the settings it is asked at, from cheap to expensive; others if a shape of the pair is round.

    `posed` says that it takes the shapes with their poses, not vertices in the world, whose rounding is then not its
    own. `exact` says that what it answers for polyhedra is to be right to rounding: otherwise it is a failure. With
    `together` it takes all pairs of a family and answers by an array of which each row counts as a pair. `by_clock` is
    for those with threads of their own: the time is that of the clock, on all processors.
    """

    prepare: Callable[[Any, Any], Asked]
    settings: tuple[Setting, ...] = (None,)
    round_settings: tuple[Setting, ...] = (None,)
    quantity: str = "volume"
    posed: bool = False
    exact: bool = True
    together: bool = False
    by_clock: bool = False

    def settings_for(self, pair: Pair) -> tuple[Setting, ...]:
        return self.round_settings if any(map(is_round, pair.bodies)) else self.settings


# This package


def auto(pair: Pair, tolerance: float) -> Asked:
    a, b = pair.bodies
    return lambda: overlap(a, b, tolerance=tolerance).volume


def auto_batch(pairs: list[Pair], tolerance: float) -> Asked:
    """All measures of many pairs in one call, the shapes made before and nothing known of the pairs: each call gives
    them the other way round and quaternions of another length, other pairs and poses that have the same answers."""
    shapes, positions, orientations, rows = in_rows(pairs)
    batch = Batch(shapes)
    turns = cycle([(orientations, rows), (2 * orientations, rows[:, ::-1].copy())])
    return lambda: batch.overlaps(positions, *next(turns), tolerance=tolerance).volume


def auto_warm(pairs: list[Pair], tolerance: float) -> Asked:
    """The same again and again as the second body of each pair moves to and fro, 1e-4 m a step."""
    shapes, positions, orientations, rows = in_rows(pairs)
    batch = Batch(shapes)
    moved = [positions.copy() for _ in range(4)]
    for step, places in zip((0, 1, 2, 1), moved):
        places[rows[:, 1]] += step * 1e-4 * np.array([0.36, 0.48, 0.8])
    places = cycle(moved)
    return lambda: batch.overlaps(next(places), orientations, rows, tolerance=tolerance).volume


def in_rows(pairs: list[Pair]) -> tuple[list, np.ndarray, np.ndarray, np.ndarray]:
    """Shapes, positions, orientations and pairs, these again and again so that a call is long enough to be timed."""
    large = any(is_round(body) or len(corners(body)) > 100 for body in pairs[0].bodies)
    bodies = [body for _ in range(4 if large else 32) for pair in pairs for body in pair.bodies]
    rows = np.arange(len(bodies), dtype=np.int32).reshape(-1, 2)
    return (
        [body.shape for body in bodies],
        np.array([body.position for body in bodies]),
        np.array([body.orientation for body in bodies]),
        rows,
    )


def paper(pair: Pair, _: None) -> Asked:
    a, b = pair.bodies
    if isinstance(a.shape, RoundedHull) or isinstance(b.shape, RoundedHull):
        raise Unfit("rounded hulls")
    return lambda: overlap(a, b, method="paper").volume


def auto_depth(pair: Pair, _: None) -> Asked:
    a, b = pair.bodies
    return lambda: penetration_depth(a, b)


# What peers are given


def points(body: Placed, segments: int | None) -> np.ndarray:
    """Vertices in the world; of round shapes, those of an inscribed polytope with so many segments around."""
    shape = body.shape
    if isinstance(shape, Cylinder):
        rough = prism(segments, shape.length) * [shape.radius, shape.radius, 1]
    elif is_round(body):
        ball = globe(segments, segments // 2)
        if isinstance(shape, Capsule):
            ends = [ball[sign * ball[:, 2] >= -1e-12] * shape.radius for sign in (1, -1)]
            rough = np.vstack([end + [0, 0, sign * shape.length / 2] for end, sign in zip(ends, (1, -1))])
        elif isinstance(shape, RoundedHull):
            rough = rounded(shape, ball)
        else:
            rough = ball * (shape.half_axes if isinstance(shape, Ellipsoid) else shape.radius)
    else:
        return vertices(body)
    return rough @ rotation(body.orientation).T + body.position


def rounded(shape: RoundedHull, ball: np.ndarray) -> np.ndarray:
    """The facets moved outwards, and the point that is farthest in each of so many directions."""
    core = shape.core
    facets = [core.vertices[ring] + shape.radius * plane[:3] for ring, plane in zip(core.facets, core.halfspaces)]
    farthest = np.concatenate(
        [(some @ core.vertices.T).argmax(1) for some in np.array_split(ball, -(-len(ball) // 4096))]
    )
    return np.vstack([*facets, core.vertices[farthest] + shape.radius * ball])


def mesh(body: Placed, segments: int | None) -> tuple[np.ndarray, np.ndarray]:
    hull = Hull(points(body, segments))
    fans = [(ring[0], ring[k], ring[k + 1]) for ring in hull.facets for k in range(1, len(ring) - 1)]
    return np.array(hull.vertices), np.array(fans)


def planes(body: Placed, segments: int | None = None) -> np.ndarray:
    """(k, 4) rows [n, b] with n · x + b <= 0 inside."""
    if isinstance(body.shape, HalfSpace):
        normal = rotation(body.orientation) @ body.shape.normal
        return np.array([[*normal, -body.shape.offset - normal @ body.position]])
    return Hull(points(body, segments)).halfspaces


def ground_as_box(body: Placed) -> None:
    if isinstance(body.shape, HalfSpace) and (body.shape.normal != [0, 0, 1]).any():
        raise Unfit("a slanted half-space")


# Peers that give volumes


def clipping(pair: Pair, _: None) -> Asked:
    """Planes cut off one by one in plain doubles, as r3d does it, but in numpy: see peers.clipping."""
    if any(map(is_round, pair.bodies)):
        raise Unfit("round shapes")
    if min(len(corners(body)) for body in pair.bodies) > MOST_IN_NUMPY:
        raise Unfit(f"more than {MOST_IN_NUMPY} vertices take minutes in numpy")
    hull = Hull(vertices(pair.a))
    corners_of_a, rings_of_a, cuts = list(hull.vertices), [ring.tolist() for ring in hull.facets], planes(pair.b)

    def cut() -> float:
        kept, rings = list(corners_of_a), rings_of_a
        for plane in cuts:
            rings = clipped(kept, rings, plane)
        return enclosed_volume(np.array(kept), rings)

    return cut


def scipy_volume(pair: Pair, way: str) -> Asked:
    """Qhull's dual hull about the centre of the largest ball, which linear programming finds, or which is given."""
    from scipy.spatial import ConvexHull, HalfspaceIntersection

    segments = 64 if any(map(is_round, pair.bodies)) else None
    both = np.vstack([planes(body, segments) for body in pair.bodies])
    if way == "linprog":
        return lambda: volume_of_halfspaces(both)
    inside = centre_of_ball(both)
    return lambda: ConvexHull(HalfspaceIntersection(both, inside).intersections).volume


def manifold(pair: Pair, setting: Setting) -> Asked:
    """Meshes made before; or both moved first, as at every step of a simulation."""
    from manifold3d import Manifold, Mesh64

    list(map(ground_as_box, pair.bodies))

    def made(body: Placed) -> Manifold:
        if is_round(body):
            return Manifold.hull_points(points(body, setting))
        corners_of, triangles = mesh(body, None)
        return Manifold(Mesh64(np.ascontiguousarray(corners_of), triangles.astype(np.uint64)))

    one, other = map(made, pair.bodies)
    # What is put off until it is asked for must not be timed.
    if min(one.volume(), other.volume()) <= 0:
        raise RuntimeError("manifold3d: no mesh")
    if setting == "moved":
        still = np.eye(3, 4)
        return lambda: (one.transform(still) ^ other.transform(still)).volume()
    return lambda: (one ^ other).volume()


HEXAHEDRON = [0, 4, 6, 2, 1, 5, 7, 3]  # CORNERS, z fastest, in the order that is wanted: around z = -1, then z = 1


def strobl(pair: Pair, _: None) -> Asked:
    """The package `overlap`: a ball and a hexahedron or a tetrahedron, both made before."""
    import overlap as peer

    balls = [body for body in pair.bodies if isinstance(body.shape, Sphere)]
    others = [body for body in pair.bodies if isinstance(body.shape, (Box, Hull)) and len(corners(body)) in (4, 8)]
    if len(balls) != 1 or len(others) != 1 or (isinstance(others[0].shape, Hull) and len(corners(others[0])) != 4):
        raise Unfit("knows balls with hexahedra, wedges and tetrahedra")
    where = vertices(others[0])
    if len(where) == 4:
        mirrored = np.linalg.det(where[1:] - where[0]) < 0
        element = peer.Tetrahedron(where[[0, 2, 1, 3] if mirrored else [0, 1, 2, 3]])
    else:
        element = peer.Hexahedron(where[HEXAHEDRON])
    sphere = peer.Sphere(balls[0].position, balls[0].shape.radius)
    return lambda: peer.overlap_volume(sphere, element)


def trimesh_volume(pair: Pair, segments: int | None) -> Asked:
    import manifold3d  # noqa: F401, the engine
    from trimesh import Trimesh
    from trimesh.boolean import intersection

    list(map(ground_as_box, pair.bodies))
    meshes = [Trimesh(*mesh(body, segments), process=False) for body in pair.bodies]

    def common() -> float:
        found = intersection(meshes, engine="manifold")
        return float(found.volume) if len(found.faces) else 0.0

    return common


def monte_carlo(pair: Pair, samples: int) -> Asked:
    """The share of points, drawn in the box where both boxes meet, that are in both."""
    lower, upper = box_of_both(pair)
    tests = [inside_test(body) for body in pair.bodies]
    rng = np.random.default_rng(0)

    def estimate() -> float:
        hits = sum(
            count_inside(lower[:, None] + (upper - lower)[:, None] * rng.random((3, size)), tests)
            for size in np.diff([*range(0, samples, 10_000), samples]).tolist()
        )
        return float(np.prod(upper - lower)) * hits / samples

    return estimate


def voxels(pair: Pair, across: int) -> Asked:
    """Cubes whose centres are in both, so many across the smaller body: what papers on data sets use."""
    lower, upper = box_of_both(pair)
    pitch = min(float(np.ptp(body.bounds, axis=0).max()) for body in pair.bodies) / across
    tests = [inside_test(body) for body in pair.bodies]

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


def inside_test(body: Placed) -> Callable[[np.ndarray], np.ndarray]:
    """Of points (3, n), those that are in a shape."""
    shape, turned, at = body.shape, rotation(body.orientation), body.position[:, None]
    if isinstance(shape, Sphere):
        return lambda where: where[:, ((where - at) ** 2).sum(0) <= shape.radius**2]
    if isinstance(shape, Ellipsoid):
        return lambda where: where[:, ((turned.T @ (where - at) / shape.half_axes[:, None]) ** 2).sum(0) <= 1]
    if isinstance(shape, Capsule):

        def in_capsule(where: np.ndarray) -> np.ndarray:
            x, y, z = turned.T @ (where - at)
            z = np.maximum(np.abs(z) - shape.length / 2, 0)
            return where[:, x * x + y * y + z * z <= shape.radius**2]

        return in_capsule
    if isinstance(shape, RoundedHull):
        raise Unfit("whether a point is in a rounded hull is no short question")
    if isinstance(shape, Cylinder):

        def in_cylinder(where: np.ndarray) -> np.ndarray:
            x, y, z = turned.T @ (where - at)
            return where[:, (x * x + y * y <= shape.radius**2) & (np.abs(z) <= shape.length / 2)]

        return in_cylinder
    walls = planes(body)

    def in_polytope(where: np.ndarray) -> np.ndarray:
        # A few planes at a time, so that points that one has outside need not be asked about by all.
        for some in np.array_split(walls, -(-len(walls) // 16)):
            where = where[:, (some[:, :3] @ where <= -some[:, 3:]).all(0)]
        return where

    return in_polytope


def box_of_both(pair: Pair) -> tuple[np.ndarray, np.ndarray]:
    (lower, upper), (low, high) = (body.bounds for body in pair.bodies)
    return np.maximum(lower, low), np.minimum(upper, high)


def centre_of_ball(both: np.ndarray) -> np.ndarray:
    from scipy.optimize import linprog

    objective, walls = [0, 0, 0, -1], np.column_stack([both[:, :3], np.ones(len(both))])
    return linprog(objective, walls, -both[:, 3], bounds=(None, None)).x[:3]


# Peers that give depths


def fcl_depth(pair: Pair, way: str) -> Asked:
    import fcl

    def placed(body: Placed) -> fcl.CollisionObject:
        model = fcl_hull(body.shape) if isinstance(body.shape, Hull) else primitive(fcl, body.shape)
        return fcl.CollisionObject(model, fcl.Transform(rotation(body.orientation), body.position))

    one, other = map(placed, pair.bodies)
    if way == "distance":
        if any(isinstance(body.shape, HalfSpace) for body in pair.bodies):
            raise Unfit("half-spaces")
        request = fcl.DistanceRequest(enable_signed_distance=True)
        return lambda: -fcl.distance(one, other, request, fcl.DistanceResult())
    asked = fcl.CollisionRequest(enable_contact=True)

    def collide() -> float:
        result = fcl.CollisionResult()
        fcl.collide(one, other, asked, result)
        return max((contact.penetration_depth for contact in result.contacts), default=0.0)

    return collide


def coal_depth(pair: Pair, _: None) -> Asked:
    import coal

    shapes = [
        coal_hull(body.shape.vertices) if isinstance(body.shape, Hull) else primitive(coal, body.shape)
        for body in pair.bodies
    ]
    poses = [coal.Transform3s(rotation(body.orientation), body.position) for body in pair.bodies]
    request = coal.CollisionRequest()

    def collide() -> float:
        result = coal.CollisionResult()
        coal.collide(shapes[0], poses[0], shapes[1], poses[1], request, result)
        return -result.getContact(0).penetration_depth if result.numContacts() else 0.0

    return collide


POWERS = tuple(10.0**-k for k in range(1, 13))
SEGMENTS = (16, 64, 256, 1024)

METHODS: dict[str, Method] = {
    "auto": Method(auto, (1e-1, 1e-3, 1e-12), POWERS, posed=True),
    "auto, batch": Method(auto_batch, (1e-3,), (1e-3,), posed=True, together=True),
    "auto, warm batch": Method(auto_warm, (1e-3,), (1e-3,), posed=True, together=True),
    "paper": Method(paper, posed=True),
    "clipping": Method(clipping),
    "scipy": Method(scipy_volume, ("point given", "linprog"), ("point given", "linprog")),
    "manifold3d": Method(manifold, ("prebuilt", "moved"), SEGMENTS),
    "manifold3d, by the clock": Method(manifold, ("prebuilt",), SEGMENTS, by_clock=True),
    "trimesh": Method(trimesh_volume, (None,), SEGMENTS[:3]),
    "overlap": Method(strobl),
    "Monte Carlo": Method(
        monte_carlo, tuple(10**k for k in range(3, 8)), tuple(10**k for k in range(3, 8)), exact=False
    ),
    "voxels": Method(voxels, (16, 32, 64), (16, 32, 64), exact=False),
    "auto, depth": Method(auto_depth, quantity="depth", posed=True),
    "fcl, depth": Method(fcl_depth, ("collide", "distance"), ("collide", "distance"), quantity="depth", posed=True),
    "coal, depth": Method(coal_depth, quantity="depth", posed=True),
}

# Asked where no chart compares everybody: volumes by those who stay fast.
FEW = ("auto", "auto, batch", "auto, warm batch", "paper", "scipy", "manifold3d", "manifold3d, by the clock", "trimesh")
