"""Hard cases by name and seed: bodies given as doubles, with their exact common part or a closed form.

Every family is a function of a numpy generator. `parameter` of a case says how degenerate it is: thickness, tilt,
offset, aspect, distance, as the family's docstring tells. Vertices are turned and moved in doubles first and then taken
as given, so that the exact truth and the core see the same numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import product
from math import pi
from random import Random
from typing import NamedTuple
from zlib import crc32

import exact
import numpy as np
from mpmath import mp
from plain_cases import MORE_SHAPES, SHAPES, sunk
from plain_cases import posed as plainly_posed
from published import PUBLISHED
from scipy.spatial import ConvexHull, cKDTree
from strategies import directions, hull_points, overlapping_points, quaternion, reach, rotation, turn
from strategies import product as turned_by

from overlapper import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, Placed, RoundedHull, Sphere

CORNERS = np.array(list(product((-1, 1), repeat=3)), float)
OCTAHEDRON = np.vstack([np.eye(3), -np.eye(3)])
TETRA = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)
GOLDEN = (1 + np.sqrt(5)) / 2
DODECAHEDRON = np.vstack(
    [CORNERS, *(np.roll([0, s / GOLDEN, t * GOLDEN], k) for k in range(3) for s in (-1, 1) for t in (-1, 1))]
)
ULP = 2.0**-52
FEATURES = ("face", "edge", "vertex")


class Below(NamedTuple):
    """{ x : normal . x <= offset }, the normal of any length."""

    normal: tuple[float, float, float]
    offset: float


class Posed(NamedTuple):
    """The hull of points, turned by a quaternion (x, y, z, w) of any length, then moved."""

    points: np.ndarray
    position: np.ndarray
    orientation: np.ndarray


class PosedBox(NamedTuple):
    half_extents: np.ndarray
    position: np.ndarray
    orientation: np.ndarray


@dataclass
class Case:
    detail: str
    parameter: float
    bodies: tuple[np.ndarray | Below | Posed | PosedBox | Placed, ...]
    closed_form: float | None = None  # the volume, of cases with round bodies
    moved: np.ndarray | None = None  # the vertices of the last body a moment later, in sequences
    family: str = ""
    seed: int = 0

    def __repr__(self) -> str:
        return f"{self.family}[{self.seed}] {self.detail} {self.parameter:.3g}"

    @property
    def round(self) -> bool:
        """Whether there are bodies that are no polytopes, so that there is no exact truth but a closed form."""
        return any(isinstance(body, Placed) for body in self.bodies)

    @property
    def placed(self) -> list:
        """The arguments of `overlap`."""
        return [placed(body) for body in self.bodies]

    @cached_property
    def solids(self) -> list[exact.Polytope]:
        return [solid(points_of(body)) for body in self.bodies if not isinstance(body, Below)]

    @cached_property
    def truth(self) -> exact.Polytope:
        """The common part without rounding. Owners of its facets are places in `bodies`."""
        bounded = [i for i, body in enumerate(self.bodies) if not isinstance(body, Below)]
        part = exact.common(*self.solids) if self.solids else exact.hull(CORNERS * 2.0**20)
        names = dict(enumerate(bounded))
        owned = (replace(facet, owners=tuple(names.get(i, -1) for i in facet.owners)) for facet in part.facets)
        part = replace(part, facets=tuple(owned))
        for i, body in enumerate(self.bodies):
            if isinstance(body, Below):
                part = exact.clipped(part, exact.halfspace(*body), i)
        return part

    @cached_property
    def boxes(self) -> list[np.ndarray]:
        """Lower and upper corner of each bounded body."""
        clouds = [np.array(points_of(body), float) for body in self.bodies if not isinstance(body, Below)]
        return [np.array([cloud.min(0), cloud.max(0)]) for cloud in clouds]

    @property
    def size(self) -> float:
        """The diagonal of the smallest body's box."""
        return min((float(np.linalg.norm(box[1] - box[0])) for box in self.boxes), default=1.0)

    @property
    def extent(self) -> float:
        """The diagonal of the box around all bodies, wherever they are in the world."""
        if not self.boxes:
            return 1.0
        lower, upper = np.min([b[0] for b in self.boxes], 0), np.max([b[1] for b in self.boxes], 0)
        return float(np.linalg.norm(upper - lower))


def placed(body):
    if isinstance(body, Below):
        return HalfSpace(*body)
    if isinstance(body, (Posed, PosedBox)):
        shape, *pose = body
        return Placed(Hull(shape) if isinstance(body, Posed) else Box(shape), *pose)
    return body


def solid(points):
    """The exact hull; of many points from a suggestion, which is seen to be right."""
    if len(points) < 1000:
        return exact.hull(points)
    return exact.checked_hull(points, ConvexHull(points).simplices.tolist())


def points_of(body):
    if isinstance(body, PosedBox):
        return exact.placed(CORNERS * body.half_extents, body.position, body.orientation)
    return exact.placed(*body) if isinstance(body, Posed) else body


# Parts


def power(rng, low, high):
    """10 to a random whole number, both ends included."""
    return 10.0 ** int(rng.integers(low, high + 1))


def coarse(values, bits=10):
    """Multiples of 2^-bits: sums and small multiples of them are exact."""
    return np.round(np.asarray(values, float) * 2.0**bits) / 2.0**bits


def polygon(rng, sides):
    angles = 2 * np.pi * (np.arange(sides) + rng.uniform(0, 0.4, sides)) / sides
    return rng.uniform(0.4, 1.0, (sides, 1)) * np.column_stack([np.cos(angles), np.sin(angles)])


def standing(rng, feature):
    """A body on the plane z = 0, with the origin inside of the face or edge or at the vertex it stands on."""
    if feature == "face":
        foot = coarse(polygon(rng, int(rng.integers(3, 7))))
    elif feature == "edge":
        along = coarse(directions(rng, 1)[0, :2] + [0.1, 0])
        foot = np.outer([-rng.integers(1, 4) / 4, rng.integers(1, 4) / 4], along)
    else:
        foot = np.zeros((1, 2))
    crown = coarse(polygon(rng, int(rng.integers(3, 8))) * rng.uniform(0.5, 1.5))
    height = coarse(rng.uniform(0.4, 1.2, len(crown)))
    return np.vstack([np.column_stack([foot, np.zeros(len(foot))]), np.column_stack([crown, height])])


def sheared(rng):
    """A matrix of small integers and determinant 1: it slants planes without rounding."""
    lower = np.tril(rng.integers(-2, 3, (3, 3)), -1) + np.eye(3)
    upper = np.triu(rng.integers(-2, 3, (3, 3)), 1) + np.eye(3)
    return lower @ upper


def mapped(points, matrix):
    """The points (n, 3) times the transposed matrix. Every point has the same roundings on every machine."""
    return points[:, :1] * matrix[:, 0] + points[:, 1:2] * matrix[:, 1] + points[:, 2:] * matrix[:, 2]


def turned(rng, points):
    return mapped(points, rotation(quaternion(rng)))


def somewhere(rng, bodies, ways=("straight", "sheared", "turned")):
    """The same bodies left as they are, slanted without rounding, or turned and moved with it."""
    way = str(rng.choice(ways))
    if way == "sheared":
        matrix, shift = sheared(rng), rng.integers(-3, 4, 3)
    elif way == "turned":
        matrix, shift = rotation(quaternion(rng)), rng.normal(size=3)
    else:
        matrix, shift = np.eye(3), np.zeros(3)
    return way, tuple(mapped(points, matrix) + shift for points in bodies)


def stacked(rng, low, high, gap, tilt=0.0):
    """A body hanging below z = 0 by a feature, and one standing on it, lifted by a gap or sunk where it is negative."""
    below = standing(rng, low) * [1, 1, -1]
    above = standing(rng, high)
    if tilt:
        axis = directions(rng, 1)[0] * [1, 1, 0]
        above = mapped(above, rotation(turn(tilt * axis)))
    return below, above + [0, 0, gap]


def two_features(rng):
    return str(rng.choice(FEATURES)), str(rng.choice(FEATURES))


def box_of(lower, upper):
    return np.array(list(product(*zip(lower, upper))), float)


def icosphere(subdivisions):
    """Vertices of an icosahedron, its triangles halved in every edge so many times: 20, 80, 320, 1280 facets."""
    points = [np.roll([0, s, t * GOLDEN], k) for k in range(3) for s in (-1, 1) for t in (-1, 1)]
    points = [p / np.linalg.norm(p) for p in points]
    reach = 1.2
    for _ in range(subdivisions):
        cloud = np.array(points)
        middles = [cloud[i] + cloud[j] for i, j in sorted(cKDTree(cloud).query_pairs(reach))]
        points += [m / np.linalg.norm(m) for m in middles]
        reach *= 0.55
    return np.array(points)


def prism(sides, height=1.0):
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.vstack([np.column_stack([ring, np.full(sides, z)]) for z in (-height / 2, height / 2)])


def globe(meridians, parallels):
    """Vertices of a unit sphere of meridians and parallels, with both poles."""
    tilt, turn_ = np.pi * np.arange(1, parallels) / parallels, 2 * np.pi * np.arange(meridians) / meridians
    rings = [
        np.column_stack([np.sin(t) * np.cos(turn_), np.sin(t) * np.sin(turn_), np.full(meridians, np.cos(t))])
        for t in tilt
    ]
    return np.vstack([*rings, [[0, 0, 1], [0, 0, -1]]])


def slender(rng, case, most):
    """The bodies of a case stretched by up to 10 to the power of `most`, turned, moved and scaled together."""
    scale, distance = power(rng, -9, 6), power(rng, -3, 6)
    thin = 10.0 ** -rng.integers(0, most + 1, 3).astype(float)
    thin[int(rng.integers(3))] = 1
    matrix, shift = rotation(quaternion(rng)), np.round(distance * directions(rng, 1)[0], 3)
    bodies = tuple((mapped(points * thin, matrix) + shift) * scale for points in case.bodies)
    return Case(f"{case.detail} at {distance:.0e} times {scale:.0e}", 1 / thin.min(), bodies)


# Families of pairs


def general(rng):
    """Hulls that share the origin as an inner point."""
    return Case("hulls", 1.0, tuple(overlapping_points(rng)))


def posed(rng):
    """Hulls under quaternions that nobody normalised, `parameter` metres from where their points are counted from."""
    reach = power(rng, -1, 3)
    centre = reach * rng.normal(size=3)
    clouds = overlapping_points(rng)
    return Case("quaternion", reach, tuple(Posed(p, centre, quaternion(rng) * rng.uniform(0.1, 10)) for p in clouds))


def posed_boxes(rng):
    """Boxes under quaternions, `parameter` metres from the origin."""
    reach = power(rng, -1, 3)
    centre = reach * rng.normal(size=3)
    boxes = [PosedBox(rng.uniform(0.5, 1.5, 3), centre + rng.uniform(-0.5, 0.5, 3), quaternion(rng)) for _ in range(2)]
    return Case("quaternion", reach, tuple(boxes))


def posed_slivers(rng):
    """A feature sunk into another by `parameter`, both bodies under one quaternion that nobody normalised."""
    low, high = two_features(rng)
    depth = float(rng.choice([0, 1e-3, 1e-6, 1e-9, 1e-10, 1e-11, 1e-12]))
    pose = (rng.normal(size=3), quaternion(rng) * rng.uniform(0.1, 10))
    return Case(f"{low}-{high}", depth, tuple(Posed(p, *pose) for p in stacked(rng, low, high, -depth)))


def levers(rng):
    """Hulls counted from `parameter` metres away, which quaternions of any length bring back; or one and a half-space.

    What a rounded quaternion turns by is off by that lever times its rounding.
    """
    lever = power(rng, 0, 6)
    bodies: list[Posed | Below] = []
    for points in overlapping_points(rng):
        centre = lever * directions(rng, 1)[0]
        length = float(rng.choice([1, 1, rng.uniform(0.1, 10), 2.0**-500, 2.0**500]) * rng.choice([1, 1.3]))
        turn_ = rng.integers(-9, 10, 4) + [0, 0, 0, 0.5] if rng.random() < 0.5 else quaternion(rng) * length
        (back,) = exact.placed([-centre], (0, 0, 0), turn_)
        bodies.append(Posed(points + centre, np.array(back, float), turn_))
    if rng.random() < 0.3:
        bodies[1] = Below(tuple(directions(rng, 1)[0]), 0.1)
    return Case("half-space" if isinstance(bodies[1], Below) else "hulls", lever, tuple(bodies))


def slivers(rng):
    """A feature sunk into another: `parameter` is the depth, from a tenth to 1e-12 of the size."""
    low, high = two_features(rng)
    depth = power(rng, -12, -1)
    way, bodies = somewhere(rng, stacked(rng, low, high, -depth))
    return Case(f"{low}-{high} {way}", depth, bodies)


def tilted_slivers(rng):
    """Slivers between two bodies, one of them tilted by 1e-3 to 1e-12. `parameter` is the tilt."""
    low, high = two_features(rng)
    tilt, depth = power(rng, -12, -3), power(rng, -12, -1)
    way, bodies = somewhere(rng, stacked(rng, low, high, -depth, tilt))
    return Case(f"{low}-{high} depth {depth:.0e} {way}", tilt, bodies)


def touching(rng):
    """Two features in contact without rounding."""
    low, high = two_features(rng)
    way, bodies = somewhere(rng, stacked(rng, low, high, 0.0), ("straight", "sheared"))
    return Case(f"{low}-{high} {way}", 0.0, bodies)


def parallel_edges(rng):
    """Two edges along one line, in contact without rounding or off by `parameter`."""
    along = coarse(directions(rng, 1)[0, :2] + [0.1, 0])
    gap = float(rng.choice([0, 0, ULP, -ULP, 1e-12, -1e-12, -1e-6]))
    bodies = []
    for sign in (-1, 1):
        foot = np.outer([-rng.integers(1, 4) / 4, rng.integers(1, 4) / 4], along)
        crown = standing(rng, "vertex")[1:] * [1, 1, sign]
        bodies.append(np.vstack([np.column_stack([foot, np.zeros(2)]), crown]))
    bodies[1] += [0, 0, gap]
    way, bodies = somewhere(rng, bodies, ("straight", "sheared"))
    return Case(way, gap, bodies)


def nearly_touching(rng):
    """Two features in contact but for `parameter`: an ulp to 1e-6, apart or sunk; or for the rounding of a turn."""
    low, high = two_features(rng)
    gap = float(rng.choice([0, ULP, 2 * ULP, 1e-15, 1e-14, 1e-13, 1e-12, 1e-11, 1e-9, 1e-6]) * rng.choice([-1, 1]))
    way, bodies = somewhere(rng, stacked(rng, low, high, gap))
    return Case(f"{low}-{high} {way}", gap, bodies)


def identical(rng):
    """A body with itself, or with its copy grown or turned by `parameter`."""
    points = hull_points(rng, int(rng.integers(4, 17))) if rng.random() < 0.5 else CORNERS * rng.uniform(0.5, 2, 3)
    change = float(rng.choice([0, 0, ULP, 1e-14, 1e-12, 1e-9, 1e-6]))
    if rng.random() < 0.5:
        way, bodies = somewhere(rng, (points, points * (1 + change)))
        return Case(f"grown {way}", change, bodies)
    copy = points if change == 0 else mapped(points, rotation(turn(change * directions(rng, 1)[0])))
    way, bodies = somewhere(rng, (points, copy))
    return Case(f"turned {way}", change, bodies)


def shared_planes(rng):
    """Boxes with `parameter` of their six face planes in common."""
    shared = int(rng.integers(1, 6))
    lower, upper = -rng.integers(2, 9, 3) / 4, rng.integers(2, 9, 3) / 4
    other = np.concatenate([lower, upper])
    for i in rng.permutation(6)[shared:]:
        other[i] += rng.choice([-0.375, -0.125, 0.125, 0.5])
    way, bodies = somewhere(rng, (box_of(lower, upper), box_of(other[:3], other[3:])))
    return Case(way, shared, bodies)


def shared_facets(rng):
    """Two hulls that share `parameter` triangles. Both bodies are on the same side of each shared triangle."""
    shared = int(rng.integers(1, 6))
    points = hull_points(rng, 14)
    triangles = rng.permutation(ConvexHull(points).simplices)
    common = points[np.unique(triangles[:shared])]
    clouds = [np.vstack([common, rng.dirichlet(np.full(14, 0.5), 6) @ points]) for _ in range(2)]
    way, bodies = somewhere(rng, clouds)
    return Case(way, shared, bodies)


def nested_flush(rng):
    """A hull in another one, with `parameter` of the other's vertices."""
    points = coarse(hull_points(rng, int(rng.integers(8, 17))))
    kept = int(rng.integers(3, 8))
    inner = np.vstack([points[:kept], coarse(0.25 * hull_points(rng, 4))])
    way, bodies = somewhere(rng, (points, inner))
    return Case(way, kept, bodies)


def needles_and_plates(rng):
    """Bodies stretched by up to `parameter`, a power of ten up to 1e6, in one or two directions each."""
    bodies, aspect = [], 1.0
    for points in overlapping_points(rng):
        thin = 10.0 ** -rng.integers(0, 7, 3).astype(float)
        thin[int(rng.integers(3))] = 1
        aspect = max(aspect, 1 / thin.min())
        bodies.append(turned(rng, points * thin))
    return Case("crossing", aspect, tuple(bodies))


def stacked_plates(rng):
    """Plates of thickness `parameter` sunk into each other by a part of it."""
    thin = power(rng, -6, -1)
    low, high = stacked(rng, "face", "face", 0.0)
    way, bodies = somewhere(rng, (low * [1, 1, thin], high * [1, 1, thin] - [0, 0, thin * power(rng, -6, -1)]))
    return Case(way, thin, bodies)


def any_pair(rng):
    choose = [general, slivers, tilted_slivers, touching, nearly_touching, identical, shared_planes, nested_flush]
    return choose[int(rng.integers(len(choose)))](rng)


def scaled(rng):
    """A pair of any other family, `parameter` times as large: 1e-9 to 1e6."""
    case, scale = any_pair(rng), power(rng, -9, 6)
    return Case(case.detail, scale, tuple(points * scale for points in case.bodies))


def tiny_in_huge(rng):
    """A body at the origin and one `parameter` times as large, with a vertex, an edge, a face or its inside there."""
    scale, corners = power(rng, 1, 15), int(rng.integers(1, 5))
    small = hull_points(rng, int(rng.integers(4, 13)), 1e6 / scale)
    large = hull_points(rng, int(rng.integers(4, 13)), 1e6)
    at = rng.dirichlet(np.ones(corners)) @ large[:corners]
    return Case(f"{corners} corners", scale, (small, large - at))


def far_away(rng):
    """A pair of any other family, `parameter` metres from the origin."""
    case, distance = any_pair(rng), power(rng, 2, 8)
    shift = np.round(distance * directions(rng, 1)[0])
    return Case(case.detail, distance, tuple(points + shift for points in case.bodies))


def combined(rng):
    """A pair of any other family, stretched by up to `parameter` in one or two directions, turned, moved and scaled."""
    return slender(rng, any_pair(rng), 6)


def round_hulls(rng):
    """Icospheres of 20 to 320 facets, centres apart by nearly their diameter or less: `parameter` is the depth."""
    depth = float(rng.choice([1.5, 1.0, 0.1, 1e-2, 1e-4, 1e-8]))
    a, b = (turned(rng, icosphere(int(rng.integers(0, 3)))) for _ in range(2))
    return Case("icospheres", depth, (a, b + (2 - depth) * directions(rng, 1)[0]))


def fine_round_hulls(rng):
    """Icospheres of 1280 facets against themselves moved by `parameter`, and against boxes."""
    ball = icosphere(3)
    depth = float(rng.choice([1.0, 0.05, 1e-3]))
    if rng.random() < 0.5:
        return Case("icospheres", depth, (ball, turned(rng, ball) + [2 - depth, 0, 0]))
    return Case("box", depth, (ball, turned(rng, CORNERS) + [2 - depth, 0, 0]))


def finest_round_hulls(rng):
    """Icospheres of 5120 and 20480 facets, `parameter` of them, cut by a half-space and perhaps a tetrahedron there."""
    subdivisions, depth = int(rng.integers(4, 6)), float(rng.choice([1.0, 1e-2, 1e-5]))
    ball, away = icosphere(subdivisions), directions(rng, 1)[0]
    top = (ball @ away).max()
    bodies = [ball, Below(tuple((-away).tolist()), float(depth - top))]
    way = "half-space"
    if rng.random() < 0.5:
        way, tetrahedron = "tetrahedron", turned(rng, TETRA)
        bodies.append(tetrahedron + away * (top - (tetrahedron @ away).min() - depth / 2))
    return Case(way, 20.0 * 4**subdivisions, tuple(bodies))


def prisms(rng):
    """Prisms of up to 256 sides: one in another, crossed, and stacked on a common flat; `parameter` is the number."""
    sides = int(rng.choice([16, 64, 256]))
    a = prism(sides)
    way = str(rng.choice(["coaxial", "stacked", "crossed", "boxed"]))
    if way == "coaxial":
        b = prism(int(rng.choice([16, sides])), 2.0)
    elif way == "stacked":
        b = prism(16) + [0.25, 0.25, 1.0 - float(rng.choice([0, 0, ULP, 1e-9, 1e-3]))]
    elif way == "crossed":
        b = turned(rng, prism(32, 4.0))
    else:
        b = mapped(CORNERS + [rng.uniform(0, 1.9), 0, 0], rotation(turn([0, 0, rng.uniform(0, 1)])))
    way_out, bodies = somewhere(rng, (a, b), ("straight", "turned"))
    return Case(f"{way} {way_out}", sides, bodies)


def pole_slivers(rng):
    """Globes of meridians and parallels. Each pole is a fan of `parameter` slender triangles. The second body is the
    turned globe, a box that ends at the pole, or another globe that meets it pole to pole."""
    meridians = int(rng.choice([8, 16, 32]))
    ball = globe(meridians, 6)
    way = str(rng.choice(["turned", "boxed", "poles"]))
    if way == "turned":
        other = turned(rng, ball) + rng.uniform(-0.7, 0.7, 3)
    elif way == "boxed":
        other = CORNERS + [0, 0, 2 - float(rng.choice([0, 0, ULP, 1e-9, 1e-3]))]
    else:
        other = ball + [0, 0, 2 - float(rng.choice([0, 0, 1e-12, 1e-6, 1e-2]))]
    return Case(way, meridians, (ball, other))


def published(rng):
    """A pair on which GJK or EPA of another library failed (see published.py). Two of three cases are turned or moved
    a little; `parameter` is that movement."""
    pair = PUBLISHED[int(rng.integers(len(PUBLISHED)))]
    change = float(rng.choice([0, 1e-15, 1e-9]))
    a, b = pair.bodies()
    return Case(pair.thread.split("github.com/")[1], change, (a, b + change * directions(rng, 1)[0] if change else b))


def sequences(rng):
    """A moment of a body that settles on another, rolls over an edge of it or passes through, and the next moment."""
    name = str(rng.choice(list(SEQUENCES)))
    floor, body, motion = SEQUENCES[name]
    step = float(rng.choice([1e-2, 1e-4, 1e-6, 1e-9]))
    start = float(rng.choice([0.0, 0.25, 0.5, rng.uniform(0, 1)])) - step * float(rng.choice([0, 0.5, 1]))
    way = str(rng.choice(["straight", "turned"]))
    now, later = (motion(body, time) for time in (start, start + step))
    if way == "turned":
        matrix = rotation(quaternion(rng))
        floor, now, later = (mapped(points, matrix) for points in (floor, now, later))
    case = Case(f"{name} {way}", step, (floor, now))
    case.moved = later
    return case


def rolled(body, time):
    """Turned by a right angle about the edge x = z = 0, to time 1."""
    return mapped(body, rotation(turn([0, time * np.pi / 2, 0])))


SEQUENCES = {
    "settling": (CORNERS - [0, 0, 1], CORNERS + [0.5, 0.25, 1], lambda body, time: body + [0, 0, (0.25 - time) * 0.1]),
    "rolling": (CORNERS * 2 - [0, 0, 2.0], CORNERS + [-1, 0, 1], rolled),
    "passing": (CORNERS, CORNERS * 0.5, lambda body, time: body + [8 * time - 2, 4 * time - 1, 0.5]),
    "passing an edge": (CORNERS, OCTAHEDRON, lambda body, time: body + [1.5, 8 * time - 4, 0.5]),
}


def cut_at_edges(rng):
    """A cube and a body with a plane through some of its vertices or edges without rounding, or `parameter` beside."""
    beside = float(rng.choice([0, 0, ULP, -ULP, 1e-12, -1e-12, 1e-6]))
    foot = np.array([float(rng.choice([-3, -1, 1, 3, 3])) + beside, 0, 0])
    plane = foot + 8.0 * np.array([[1, -1, 0], [0, 1, -1], [-1, 0, 1]])
    apex = foot + rng.choice([-8.0, 8.0])
    way, bodies = somewhere(rng, (CORNERS, np.vstack([plane, apex])))
    return Case(way, beside, bodies)


def dual_pairs(rng):
    """Tetrahedron and its mirror image, cube and octahedron, icosahedron and dodecahedron, the second of the pair as
    large as `parameter`: vertices touch faces or edges, or edges cross."""
    choices = [
        (TETRA, -TETRA, (1.0, 3.0, 1 / 3)),
        (CORNERS, OCTAHEDRON, (1.0, 1.5, 2.0, 3.0)),
        (icosphere(0), DODECAHEDRON, (1.0, 0.5, 1.5)),
    ]
    a, b, ratios = choices[int(rng.integers(3))]
    ratio = float(rng.choice(ratios))
    way, bodies = somewhere(rng, (a, b * ratio))
    return Case(way, ratio, bodies)


# Families of several bodies


def compounds(rng):
    """`parameter` copies of one body about one centre: turned evenly about a diagonal, or at random."""
    count = int(rng.integers(3, 7))
    points = [CORNERS, OCTAHEDRON, TETRA][int(rng.integers(3))]
    if rng.random() < 0.5:
        axis = np.array([1, 1, 1]) / np.sqrt(3)
        return Case(
            "diagonal", count, tuple(mapped(points, rotation(turn(2 * np.pi * k / count * axis))) for k in range(count))
        )
    return Case("random", count, tuple(turned(rng, points) for _ in range(count)))


def crowds(rng):
    """`parameter` bodies, 17 to 64, about a common point; or with one moved away so that none or little is common."""
    return gathered(rng, int(rng.integers(17, 65)))


def many_bodies(rng):
    """`parameter` bodies, 3 to 16, about a common point; or with one moved away so that none or little is common."""
    return gathered(rng, int(rng.integers(3, 17)))


def gathered(rng, count):
    bodies = overlapping_points(rng, count, 4, 12)
    way = str(rng.choice(["common", "little", "none"]))
    if way != "common":
        u = directions(rng, 1)[0]
        level = min((p @ u).max() for p in bodies[:-1])
        share = power(rng, -9, -2) * (1 if way == "none" else -1)
        bodies[-1] = bodies[-1] + u * (level - (bodies[-1] @ u).min() + share)
    return Case(way, count, tuple(bodies))


def empty_triples(rng):
    """Three or four bodies around a hole. All but any one of them have a common part. `parameter` is the size of the
    hole; if it is negative, all bodies have a common part of that size."""
    hole = float(rng.choice([0, 0, 1e-1, 1e-3, 1e-6, 1e-9, 1e-12, ULP]) * rng.choice([-1, 1]))
    x, y, z = np.eye(3)
    if rng.random() < 0.5:
        slabs = [(x, y, z), (y, x, z), (-x - y, x - y, z)]  # the normals sum to zero
    else:
        slabs = [(x, y, z), (y, x, z), (z, x, y), (-x - y - z, x - y, y - z)]
    bodies = []
    for normal, u, v in slabs:
        first = int(np.flatnonzero(normal)[0])
        up = np.eye(3)[first] * normal[first]
        corners = product((hole, hole + 2), (-4, 4), (-4, 4))
        bodies.append(np.array([level * up + i * u + j * v for level, i, j in corners]))
    way, bodies = somewhere(rng, bodies)
    return Case(f"{len(slabs)} bodies {way}", hole, bodies)


def slender_groups(rng):
    """Compounds and groups around a hole, stretched by up to `parameter`, turned, moved and scaled."""
    return slender(rng, [compounds, empty_triples][int(rng.integers(2))](rng), 4)


def half_spaces(rng):
    """A hull and one to four half-spaces through its vertices, or `parameter` beside them."""
    points = coarse(hull_points(rng, int(rng.integers(4, 17))), 6)
    while np.linalg.matrix_rank(points - points[0]) < 3:  # as few of them may be, so coarse
        points = coarse(hull_points(rng, int(rng.integers(4, 17))), 6)
    beside = float(rng.choice([0, 1e-12, -1e-12, 1e-9, 1e-3, -1e-3, 0.3]))
    planes = []
    for _ in range(int(rng.integers(1, 5))):
        normal = rng.integers(-3, 4, 3).astype(float) if rng.random() < 0.6 else rng.normal(size=3)
        if not normal.any():
            normal[0] = 1
        levels = np.sort(points @ normal)
        planes.append(Below(tuple(normal.tolist()), float(levels[int(rng.choice([0, 0, 1, 2, -1]))] + beside)))
    return Case(f"{len(planes)}", beside, (points, *planes))


def half_spaces_alone(rng):
    """Half-spaces around the origin that bound their common set, `parameter` of them."""
    normals = np.vstack([turned(rng, TETRA), rng.normal(size=(int(rng.integers(0, 13)), 3))])
    offsets = rng.uniform(0.2, 1, len(normals)) * power(rng, -6, 3)
    bodies = [Below(tuple(n.tolist()), float(d)) for n, d in zip(normals, offsets)]
    return Case("bounded", len(bodies), tuple(bodies))


# Round bodies with a closed form


def lenses(rng):
    """Two balls, or a ball, capsule or cylinder and a half-space, that overlap by `parameter` of a radius."""
    depth = float(rng.choice([1.0, 0.5, 1e-1, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12]))
    way = str(rng.choice(["balls", "ball", "capsule", "cylinder"]))
    r, s = rng.integers(4, 17, 2) / 8
    if way == "balls":
        step = coarse((r + s - depth * min(r, s)) / 7, 45)
        centre = step * np.array([2.0, 3.0, 6.0])  # as far as 7 steps, without rounding
        volume = lens(Fraction(r), Fraction(s), 7 * Fraction(float(step)))
        return Case(way, depth, (Placed(Sphere(r)), Placed(Sphere(s), centre)), volume)
    level = -r + depth * r
    h = Fraction(level) + Fraction(r)
    floor = Placed(HalfSpace((0, 0, 1), level))
    if way == "cylinder":
        return Case(way, depth, (Placed(Cylinder(s, 2 * r)), floor), float(h * Fraction(s) ** 2) * pi)
    ball = Placed(Sphere(r)) if way == "ball" else Placed(Capsule(r, 2.0), (0, 0, 1.0))
    return Case(way, depth, (ball, floor), float(h * h * (3 * Fraction(r) - h) / 3) * pi)


def posed_round(rng):
    """Two of ball, capsule, cylinder and box, at random poses: into each other by `parameter` or so. There is no closed
    form, and the bracket of the proof is the truth."""
    choices = [
        Sphere(rng.uniform(0.3, 1)),
        Capsule(rng.uniform(0.1, 1), rng.uniform(0, 2)),
        Cylinder(*rng.uniform(0.2, 2, 2)),
        Box(rng.uniform(0.2, 1, 3)),
    ]
    a, b = choices[int(rng.integers(3))], choices[int(rng.integers(4))]
    return posed_along_an_axis(rng, a, b, [0.3, 1e-2, 1e-4, 1e-8, -1e-8, -1e-2])


def posed_along_an_axis(rng, a, b, depths):
    """Two shapes at random poses, into each other along a random axis by one of the depths."""
    depth = float(rng.choice(depths))
    axis, p, q = directions(rng, 1)[0], quaternion(rng), quaternion(rng)
    room = reach(Placed(a, orientation=p), axis) + reach(Placed(b, orientation=q), -axis)
    where = rng.normal(size=3)
    bodies = (Placed(a, where, p), Placed(b, where + axis * (room - depth), q))
    return Case(f"{type(a).__name__} and {type(b).__name__}", depth, bodies)


def more_kinds(rng):
    """A shape of MORE_SHAPES and one of any kind, `parameter` into each other or apart."""
    plain = Random(int(rng.integers(2**32)))
    makers = {**SHAPES, **MORE_SHAPES}
    first, second = plain.choice([*MORE_SHAPES]), plain.choice([*makers])
    depth = plain.choice([0.1, 1e-2, 1e-4, -1e-4, -1e-2])
    bodies = sunk([plainly_posed(plain, makers[name](plain), 0.8) for name in (first, second)], depth)
    return Case(f"{first} and {second}", depth, tuple(bodies))


def round_contacts(rng):
    """An upright ball, capsule or cylinder sunk by `parameter` into another body, or held apart by as much. The other
    body is a ball, a capsule, or a turned box of another size that is met on a facet, an edge or a corner.

    A capsule that is met beside its end is less deep, or farther apart. Only the box is turned, by its vertices.
    """
    depth, size = power(rng, -12, -1) * float(rng.choice([1, 1, -1])), power(rng, 0, 4)
    r, s = rng.integers(4, 17, 2) / 8
    shape = [Sphere(r), Capsule(r, s), Cylinder(r, s)][int(rng.integers(3))]
    facing = ["facet", "facet"] if isinstance(shape, Cylinder) else ["facet", "edge", "corner", "ball", "capsule"]
    met, kind = str(rng.choice(facing)), type(shape).__name__.lower()
    away = directions(rng, 1)[0] * float(rng.choice([0, 0, 1e3, 1e6]))
    if met in ("ball", "capsule"):
        other = Sphere(s * size) if met == "ball" else Capsule(s * size, r)
        up = directions(rng, 1)[0]
        room = reach(Placed(shape), -up) + reach(Placed(other), up)
        return Case(f"{kind} on {met}", depth, (Placed(shape, away + up * (room - depth)), Placed(other, away)))
    matrix, extents = rotation(quaternion(rng)), size * rng.uniform(1, 2, 3)
    # The foot is at the end of one axis of the box for a facet, of two for an edge, of three for a corner.
    ends = np.array([1.0] * {"facet": 1, "edge": 2, "corner": 3}[met] + [0.0] * 2)[:3]
    up, foot = mapped(np.array([ends / np.linalg.norm(ends), ends * extents]), matrix)
    at = away + foot + up * (reach(Placed(shape), -up) - depth)
    return Case(f"{kind} on {met}", depth, (Placed(shape, at), mapped(CORNERS * extents, matrix) + away))


def rounded_hulls(rng):
    """A rounded box sunk into a half-space or into a rounded box of its own size, or inside a box. `parameter` is the
    depth as a fraction of its radius or of its height. Turns about the common axis are whole quarters."""
    depth = float(rng.choice([0.5, 0.1, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10]))
    sides, r = rng.integers(4, 17, 3) / 8, float(rng.choice([2.0**-10, 0.125, 1.0]))
    where = str(rng.choice(["in a half-space", "in another", "inside"]))
    body = RoundedHull(CORNERS * sides / 2, r)
    h = depth * r
    if where == "inside":
        volume = np.prod(sides) + 2 * r * sum(sides[i] * sides[i - 1] for i in range(3)) + pi * r**2 * sides.sum()
        room = Placed(Box([8, 8, 8]), (0.5, 0.25, 0), quaternion(rng))
        return Case(where, 1.0, (Placed(body), room), float(volume) + 4 / 3 * pi * r**3)
    if where == "in a half-space":
        level = -sides[2] / 2 - r + h
        h = float(Fraction(level) + Fraction(sides[2]) / 2 + Fraction(r))
        return Case(where, depth, (Placed(body), Placed(HalfSpace((0, 0, 1), level))), rounded_slab(sides, r, h))
    step = sides[2] + 2 * r - h
    h = float(Fraction(sides[2]) + 2 * Fraction(r) - Fraction(step))
    lower = Placed(body, (0, 0, -step), [(0, 0, 0, 1), (0, 0, 1, 0)][int(rng.integers(2))])
    return Case(where, depth, (Placed(body), lower), 2 * rounded_slab(sides, r, h / 2))


def rounded_meshes(rng):
    """A round body, or a rounded hull of few corners, deep in a mesh of `parameter` corners with a margin: most of its
    core has more facets there than slices have lines."""
    count, margin, r = int(rng.choice([30, 60])), float(rng.choice([1e-3, 0.05])), rng.uniform(0.25, 0.5)
    shape = [
        Sphere(r), Capsule(r, 1.5 * r), Cylinder(r, 2 * r), RoundedHull(directions(rng, 8) * r / 2, r / 2)
    ][int(rng.integers(4))]  # fmt: skip
    mesh = RoundedHull(directions(rng, count) * rng.uniform(0.3, 0.6, 3), margin)
    bodies = Placed(shape, rng.normal(size=3) * 0.1, quaternion(rng)), Placed(mesh, (0, 0, 0), quaternion(rng))
    return Case(f"{type(shape).__name__} and {margin:g}", count, bodies if rng.random() < 0.5 else bodies[::-1])


def folded_hulls(rng):
    """A round body or a box, and a rounded hull with two nearly coplanar facets. `parameter` bounds their distance from
    one plane, so the wedge between the facets is as narrow."""
    fold, margin, r = power(rng, -12, -2), float(rng.choice([1e-3, 0.1])), rng.uniform(0.2, 0.4)
    shape = [Sphere(r), Capsule(r, 1.5 * r), Cylinder(r, 2 * r), Box([r, r, r])][int(rng.integers(4))]
    folded = RoundedHull([[-0.5, 0, 0], [0.5, 0, 0], [0, 0.5, -fold], [0, -0.5, -fold], [0, 0, -0.5]], margin)
    bodies = Placed(shape, rng.normal(size=3) * 0.2, quaternion(rng)), Placed(folded, (0, 0, 0), quaternion(rng))
    return Case(f"{type(shape).__name__} and {margin:g}", fold, bodies if rng.random() < 0.5 else bodies[::-1])


def tilted_round(rng):
    """A rounded box and a cylinder or another rounded box, turned by quarters and by about `parameter`. Planes of the
    first are nearly parallel to planes and axes of the second."""
    tilt = power(rng, -11, -4)
    quarter = [(0, 0, 0, 1), (0, 0, 1, 1), (1, 0, 0, 1), (0, 1, 0, 1), (1, 1, 1, 1)][int(rng.integers(5))]
    turned = turned_by(np.append(tilt * rng.normal(size=3), 1.0), np.array(quarter, float))
    one, other = (RoundedHull(CORNERS * rng.uniform(0.3, 1, 3), rng.uniform(0.1, 0.5)) for _ in range(2))
    second = other if rng.random() < 0.5 else Cylinder(rng.uniform(0.3, 1), rng.uniform(0.5, 2))
    bodies = Placed(one), Placed(second, rng.uniform(-1, 1, 3), turned)
    return Case(type(second).__name__, tilt, bodies if rng.random() < 0.5 else bodies[::-1])


def flush_round(rng):
    """Two bodies about one axis, one of them round, that share surfaces up to rounding. Their common part is the
    smaller body, or the part of it up to a plane at which a capsule becomes a half ball."""
    r, h = rng.integers(4, 49, 2) / 32 if rng.random() < 0.5 else rng.uniform(0.1, 1.5, 2)
    sides = rng.uniform(0.2, 2, 3)
    cylinder, ball = pi * r * r * 2 * h, 4 / 3 * pi * r**3
    rounded = RoundedHull(CORNERS * sides / 2, r)
    of_rounded = sides.prod() + 2 * r * sum(sides[i] * sides[i - 1] for i in range(3)) + pi * r**2 * sides.sum() + ball
    pairs = {
        "a ball twice": (Sphere(r), Sphere(r), ball),
        "a capsule twice": (Capsule(r, 2 * h), Capsule(r, 2 * h), cylinder + ball),
        "a cylinder twice": (Cylinder(r, 2 * h), Cylinder(r, 2 * h), cylinder),
        "a rounded box twice": (rounded, rounded, of_rounded),
        "capsule in cylinder": (Capsule(r, 2 * h), Cylinder(r, 2 * (h + r)), cylinder + ball),
        "cylinder in capsule": (Cylinder(r, 2 * h), Capsule(r, 2 * h), cylinder),
        "cylinder in box": (Cylinder(r, 2 * h), Box([r, r, h]), cylinder),
        "capsule in box": (Capsule(r, 2 * h), Box([r, r, h + r]), cylinder + ball),
        "capsule between lids": (Capsule(r, 2 * h), Box([r, r, h]), cylinder),
        "capsule to where it is a ball": (Capsule(r, 2 * h), HalfSpace([0, 0, 1], h), cylinder + ball / 2),
        "the half ball of a capsule": (Capsule(r, 2 * h), HalfSpace([0, 0, 1], -h), ball / 2),
        "ball in capsule": (Sphere(r), Capsule(r, 2 * h), ball),
        "core of a rounded box": (Box(sides / 2), rounded, sides.prod()),
        "rounded box in box": (rounded, Box(sides / 2 + r), of_rounded),
    }
    way = str(rng.choice(list(pairs)))
    *shapes, volume = pairs[way]
    where = rng.normal(size=3) if rng.random() < 0.5 else np.zeros(3)
    turn = quaternion(rng) if rng.random() < 0.5 else rng.integers(1, 5, 4) * rng.choice([-0.25, 0.25], 4)
    again = float(rng.choice([-1.0, 0.5, 1.0, 2.0]))  # the same orientation
    bodies = (Placed(shapes[0], where, turn), Placed(shapes[1], where, turn * again))
    return Case(way, 0.0, bodies if rng.random() < 0.5 else bodies[::-1], float(volume))


def caps_on_edges(rng):
    """A flat cap of a cylinder on an edge of a box that is parallel to it but for a tilt, `parameter` deep."""
    q, depth = quaternion(rng), power(rng, -11, -3)
    tilt = float(rng.choice([0, 0, 1e-16, 1e-13, 1e-10])) * rng.normal(size=4)
    angle, r, h, half = rng.uniform(0.1, 0.6), rng.uniform(0.2, 0.4), rng.uniform(0.3, 1), rng.uniform(0.5, 1)
    edge = half * (np.sin(2 * angle) + np.cos(2 * angle))
    box = Placed(
        Box([half, half, half]), (0, 0, 0), turned_by(q, np.array([np.sin(angle), 0, 0, np.cos(angle)])) + tilt
    )
    beside = half * (np.cos(2 * angle) - np.sin(2 * angle)) + rng.uniform(-0.5, 0.5) * r
    at = rotation(q) @ [rng.uniform(-0.1, 0.1), beside, edge + h / 2 - depth]
    return Case("parallel", depth, (Placed(Cylinder(r, h), at, q), box))


def thin_plates(rng):
    """A ball or an ellipsoid, and a box or a hull through it that is `parameter` times as thick as wide."""
    thin = power(rng, -8, -3)
    flat = rng.permutation([thin, 1.0, 1.0]) * rng.uniform(0.4, 1, 3)
    plate = Box(flat) if rng.random() < 0.5 else Hull(rng.normal(size=(8, 3)) * flat)
    axes = rng.uniform(0.5, 1, 3)
    body = Sphere(axes[0]) if rng.random() < 0.3 else Ellipsoid(axes)
    where = rng.normal(size=3) * 0.2
    return Case(
        type(body).__name__, thin, (Placed(body, where, quaternion(rng)), Placed(plate, (0, 0, 0), quaternion(rng)))
    )


def thin_round(rng):
    return pierced(rng, power(rng, -12, -6))


def pierced(rng, thin):
    """A round body about a metre wide, and a plate or a needle of thickness `parameter` through its middle."""
    sides = rng.permutation([thin, 1.0, float(rng.choice([thin, 1.0]))]) * rng.uniform(0.4, 1, 3)
    wide, r = rng.uniform(0.4, 1), rng.uniform(0.4, 1)
    flat = [
        Capsule(thin, wide), Cylinder(thin, wide), Cylinder(wide, thin), Box(sides),
        Ellipsoid(sides),
    ][int(rng.integers(5))]  # fmt: skip
    other = [
        Sphere(r), Capsule(r, wide), Cylinder(r, wide), Ellipsoid(rng.uniform(0.4, 1, 3)),
        RoundedHull(CORNERS * rng.uniform(0.2, 0.6, 3), 0.1),
    ][int(rng.integers(5))]  # fmt: skip
    where = rng.normal(size=3) * float(rng.choice([0, 0.2]))
    turns = [(0, 0, 0, 1) if rng.random() < 0.3 else quaternion(rng) for _ in range(2)]
    bodies = Placed(other, where, turns[0]), Placed(flat, (0, 0, 0), turns[1])
    return Case(f"{type(other).__name__} and {type(flat).__name__}", thin, bodies)


def special_poses(rng):
    """Two bodies, one of them round, of few lengths, turned by few angles, so that centres, ends, rims, seams, edges or
    corners of the one lie on those of the other, or do but for `parameter` of a metre."""
    off = float(rng.choice([0, 0, *(10.0 ** -np.arange(4.0, 17))]))
    lengths = [1, 1, 1, 0.5, 0.5, 0.25, 2, 1 / 3, 0.1, np.sqrt(0.5)]
    cores = [CORNERS, CORNERS, TETRA, OCTAHEDRON, prism(3), prism(6), np.vstack([prism(12)[:12], [[0, 0, 1]]])]

    def body(kind):
        r, h, *sides = rng.choice(lengths, 5)
        rim = np.deg2rad(rng.choice([0, 30, 45, 60, 90, 120, 135, 180, 225, 270]))
        on_rim = [r * np.cos(rim), r * np.sin(rim), h * rng.integers(-1, 2)]
        ends = rng.integers(-1, 2, 3)
        if kind == "ball":
            return Sphere(r), r * ends / max(1.0, float(np.linalg.norm(ends)))
        if kind in ("capsule", "cylinder"):
            shape = Capsule(r, 2 * h) if kind == "capsule" else Cylinder(r, 2 * h)
            return shape, [on_rim, [0, 0, h * ends[2]], [0, 0, (h + r) * ends[2]]][int(rng.integers(3))]
        if kind == "half-space":
            return HalfSpace(ends + [0, 0, 0.5], 0.0), np.zeros(3)
        if kind == "box":
            return Box(sides), ends * np.array(sides)
        core = cores[int(rng.integers(len(cores)))] * (sides if rng.random() < 0.5 else r)
        on = core[rng.integers(len(core), size=2)].mean(0)
        if kind == "hull":
            return Hull(core), on
        margin = h * float(rng.choice([1, 1, 0.1, 1e-3]))
        return RoundedHull(core, margin), on + margin * ends * rng.integers(0, 2)

    def turned(q, axis, angle):
        return turned_by(np.append(np.sin(angle / 2) * axis / np.linalg.norm(axis), np.cos(angle / 2)), q)

    q = np.array(
        rng.choice([(0, 0, 0, 1), (0, 0, 1, 1), (1, 0, 0, 1), (0, 1, 0, 1), (1, 1, 1, 1), (1, -1, 1, 1)]), float
    )
    if rng.random() < 0.5:
        q = turned(q, rng.integers(-1, 2, 3) + [0, 0, 0.5], np.deg2rad(rng.choice([30, 45, 60, 90, 120])))
    if rng.random() < 0.4:
        q = turned(q, rng.integers(-1, 2, 3) + [0.5, 0, 0], off)
    round_ones = ["ball", "capsule", "cylinder", "rounded"]
    first, second = rng.choice(round_ones), rng.choice([*round_ones, "box", "box", "hull", "half-space"])
    (a, on_a), (b, on_b) = body(first), body(second)
    at = on_a - mapped(np.array([on_b], float), rotation(q))[0] + off * rng.integers(-1, 2, 3) * (rng.random() < 0.6)
    if rng.random() < 0.4:
        at = at + rng.integers(-1, 2, 3) * float(rng.choice([0.5, 0.1, 1e-2, 1e-4, 1e-6, 1e-8])) * 0.25
    bodies = (Placed(a), Placed(b, at, q))
    return Case(f"{first} and {second}", off, bodies if rng.random() < 0.5 else bodies[::-1])


def ellipsoids(rng):
    """An ellipsoid, up to 1000 times as long as thick, and a half-space or a box. The common part is a stretched cap of
    depth `parameter` times a half axis, or a number of octants, or the whole ellipsoid."""
    axes = 2.0 ** (rng.integers(0, 11, 3) + int(rng.integers(-15, 6)))
    depth = float(rng.choice([1.0, 0.5, 1e-1, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10]))
    where = str(rng.choice(["in a half-space", "askew", "on a box", "octants", "inside"]))
    whole, body = 4 / 3 * pi * float(axes.prod()), Placed(Ellipsoid(axes))
    longest = float(axes.max())
    if where in ("octants", "inside"):
        ends = rng.integers(0, 2, 3) if where == "octants" else np.zeros(3)  # at the centre, or beyond all
        bodies = (body, Placed(Box([4 * longest] * 3), 4 * longest * ends))
        return Case(where, 1.0, bodies if rng.random() < 0.5 else bodies[::-1], whole / 2 ** int(ends.sum()))
    # In the ball that it is made of, the plane's normal is (2, 3, 6) / 7, or an axis.
    normal, length = (np.array([2.0, 3.0, 6.0]), 7) if where == "askew" else (np.array([0.0, 0.0, 1.0]), 1)
    level = length * (depth - 1)
    h = Fraction(level) / length + 1
    other = Placed(HalfSpace(normal / axes, level))
    if where == "on a box":
        top = level * axes[2]
        other = Placed(Box([4 * longest] * 3), (0, 0, top - 4 * longest))
        h = (Fraction(float(other.position[2])) + 4 * Fraction(longest)) / Fraction(float(axes[2])) + 1
    bodies = (body, other) if rng.random() < 0.5 else (other, body)
    return Case(where, depth, bodies, whole * float(h * h * (3 - h) / 4))


def posed_ellipsoids(rng):
    """An ellipsoid and one of all kinds at random poses, into each other by `parameter` or so, or apart."""
    choices = [
        Sphere(rng.uniform(0.3, 1)),
        Capsule(rng.uniform(0.1, 1), rng.uniform(0, 2)),
        Cylinder(*rng.uniform(0.2, 2, 2)),
        Box(rng.uniform(0.2, 1, 3)),
        Hull(rng.normal(size=(8, 3))),
        RoundedHull(CORNERS * 0.3, 0.2),
        Ellipsoid(2 * np.exp(rng.uniform(-3, 0, 3))),
    ]
    a, b = Ellipsoid(2 * np.exp(rng.uniform(-3, 0, 3))), choices[int(rng.integers(len(choices)))]
    return posed_along_an_axis(rng, a, b, [1.0, 0.5, 0.3, 1e-2, 1e-4, 1e-8, -1e-8, -1e-2])


def rounded_slab(sides, r, h):
    """The volume of what a rounded box has below the height h <= r above its lowest plane: a slab of cuboid, and its
    rims, over quarters of a disc."""
    with mp.workdps(40):
        x = mp.mpf(h) / r
        half_segment = (mp.acos(1 - x) - (1 - x) * mp.sqrt(x * (2 - x))) / 2 * mp.mpf(r) ** 2
        cap = mp.pi * mp.mpf(h) ** 2 * (3 * r - mp.mpf(h)) / 3
        a, b = map(mp.mpf, sides[:2].tolist())
        return float(a * b * h + 2 * (a + b) * half_segment + cap)


def lens(r, s, d):
    """The volume of two balls' common part, their centres d apart, each outside of the other."""
    return float(lens_over_pi(r, s, d)) * pi


def lens_over_pi(r, s, d):
    return (r + s - d) ** 2 * (d * d + 2 * d * (r + s) - 3 * (r - s) ** 2) / (12 * d)


FAMILIES: dict[str, Callable[[np.random.Generator], Case]] = {
    family.__name__: family
    for family in (
        general, posed, posed_boxes, posed_slivers, levers, slivers, tilted_slivers, touching, parallel_edges,
        nearly_touching, identical, shared_planes, shared_facets, nested_flush, needles_and_plates,
        stacked_plates, scaled, tiny_in_huge, far_away, combined, round_hulls, fine_round_hulls,
        finest_round_hulls, prisms, pole_slivers, cut_at_edges, dual_pairs, published, sequences, compounds,
        many_bodies, crowds, empty_triples, slender_groups, half_spaces, half_spaces_alone, lenses, posed_round,
        round_contacts, rounded_hulls, rounded_meshes, folded_hulls, tilted_round, flush_round, caps_on_edges,
        thin_plates, thin_round, special_poses, ellipsoids, posed_ellipsoids, *([more_kinds] if MORE_SHAPES else []),
    )
}  # fmt: skip


def make(family: str, seed: int) -> Case:
    case = FAMILIES[family](np.random.default_rng([seed, crc32(family.encode())]))
    case.family, case.seed = family, seed
    return case


def cases(seed: int, count: int) -> Iterator[Case]:
    """So many cases, the families in turn."""
    names = list(FAMILIES)
    for i in range(count):
        yield make(names[i % len(names)], seed + i // len(names))
