"""Cases whose numbers every machine makes alike, so that answers to them can be recorded.

The families of families.py turn by sines and draw normal deviates, which differ by a unit in the last place from one
machine to another. Here, all numbers come from Python's own `random` and from sums and products.
"""

from collections.abc import Callable, Iterator
from random import Random
from typing import NamedTuple

import numpy as np

from overlapper import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Placed,
    RoundedHull,
    Shape,
    Sphere,
    _core,
    overlap,
)

CUBE = [(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]
WAYS = [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) != (0, 0, 0)]
SQUARE = [(x, y) for x in (-1.0, 1.0) for y in (-1.0, 1.0)]


# Two needles, and by how much the second is moved: their ends are in one plane, and their other corners off it by a
# thousandth of their length.
NEEDLES = {
    "with three corners between": tuple(
        np.array(numbers) / 1024
        for numbers in (
            [(-2048, 8192, 8192), (-2, -4, -1), (3072, -9216, -8192), (-507, 2048, 2046), (-520, 2055, 2041)],
            [(1024, 8192, -3072), (-760, -6151, 2310), (-1024, -8192, 3072), (249, 2055, -771), (-254, -2045, 770)],
            (-2, 1, -4),
        )
    ),
    "with two corners between": tuple(
        np.array(numbers) / 1024
        for numbers in (
            [(8192, -7168, 6144), (-8192, 7168, -6144), (-4089, 3590, -3076), (-2044, 1789, -1529)],
            [(7168, 8192, 5120), (-8192, -7168, -7168), (-3583, -4091, -2566), (5371, 6141, 3834)],
            (3, 1, 4),
        )
    ),
}


COARSE = 0.03  # so that round bodies take no longer than others


class PlainCase(NamedTuple):
    name: str
    bodies: list[Placed]
    tolerance: float = 1e-3
    method: str = "auto"


def vector(rng: Random, size: float = 1.0) -> np.ndarray:
    return np.array([rng.uniform(-size, size) for _ in range(3)])


def sixteenths(rng: Random, low: int, high: int) -> np.ndarray:
    return np.array([rng.randint(low, high) / 16 for _ in range(3)])


def quaternion(rng: Random) -> tuple[int, ...]:
    """A quaternion of small whole numbers. Its length is arbitrary."""
    return (*(rng.randint(-9, 9) for _ in range(3)), rng.randint(1, 9))


def posed(rng: Random, shape: Shape, reach: float = 0.5) -> Placed:
    return Placed(shape, vector(rng, reach), quaternion(rng))


def cloud(rng: Random, count: int) -> np.ndarray:
    """Points in a cube."""
    return np.array([vector(rng) for _ in range(count)])


def ball_of_points(rng: Random, count: int) -> np.ndarray:
    """Points near a sphere, all of them corners but for a few."""
    points = []
    while len(points) < count:
        x, y, z = vector(rng)
        square = x * x + y * y + z * z
        if 0.01 < square < 1:
            points.append(np.array([x, y, z]) / np.sqrt(square))
    return np.array(points)


def prism(sides: int) -> np.ndarray:
    """Two whole circles of points, whose coordinates are fractions, at the heights -1 and 1."""
    steps = [(2 * k + 1 - sides // 4) / (sides // 4) for k in range(sides // 4)]
    arc = [((1 - t * t) / (1 + t * t), 2 * t / (1 + t * t)) for t in steps]
    rim = [(x, y) for a, b in arc for x, y in ((a, b), (-b, a), (-a, -b), (b, -a))]
    return np.array([(x, y, z) for x, y in rim for z in (-1.0, 1.0)])


def wedge(rng: Random, feature: str, sign: int) -> np.ndarray:
    """A body on the plane z = 0 with a face, an edge or a corner, above it or below."""
    foot = {
        "face": [(x / 2, y / 2, 0) for x, y in SQUARE],
        "edge": [(-0.75, rng.randint(-4, 4) / 16, 0), (0.5, rng.randint(-4, 4) / 16, 0)],
        "corner": [(0, 0, 0)],
    }[feature]
    crown = [(x + rng.randint(-4, 4) / 16, y + rng.randint(-4, 4) / 16, 1 + rng.randint(0, 8) / 16) for x, y in SQUARE]
    return np.array([*foot, *crown]) * [1, 1, sign]


SHAPES: dict[str, Callable[[Random], Shape]] = {
    "ball": lambda rng: Sphere(rng.uniform(0.3, 1)),
    "box": lambda rng: Box([rng.uniform(0.3, 1) for _ in range(3)]),
    "capsule": lambda rng: Capsule(rng.uniform(0.2, 0.7), rng.uniform(0, 2)),
    "cylinder": lambda rng: Cylinder(rng.uniform(0.2, 1), rng.uniform(0.2, 2)),
    "hull": lambda rng: Hull(cloud(rng, rng.randint(4, 30))),
    "fine hull": lambda rng: Hull(ball_of_points(rng, 90)),
    "rounded hull": lambda rng: RoundedHull(cloud(rng, 8) * 0.6, rng.choice([1e-3, 0.1])),
    "half-space": lambda rng: HalfSpace(vector(rng), rng.uniform(-0.3, 0.3)),
    "ellipsoid": lambda rng: Ellipsoid([rng.uniform(0.2, 1) for _ in range(3)]),
}

# Kinds that came after the answers were recorded, and kinds that a header adds to the core, such as the cone of
# tests/native/shapes/cone.h. Recorded answers depend on every kind in SHAPES.
MORE_SHAPES: dict[str, Callable[[Random], Shape]] = {}
if hasattr(_core, "Cone"):
    MORE_SHAPES["cone"] = lambda rng: _core.Cone(rng.uniform(0.3, 1), rng.uniform(0.3, 2))


def kinds(rng: Random) -> Iterator[PlainCase]:
    """Every kind of shape with every other, deep, shallow and apart."""
    names = list(SHAPES)
    for i, a in enumerate(names):
        for b in names[i:]:
            if a == b == "half-space":
                continue
            for reach in (0.3, 0.9, 1.5):
                bodies = [posed(rng, SHAPES[name](rng), reach) for name in (a, b)]
                yield PlainCase(f"{a} and {b} within {reach}", bodies if rng.random() < 0.5 else bodies[::-1])


def slivers(rng: Random) -> Iterator[PlainCase]:
    """A feature of a hull sunk into one of another, less and less."""
    for low in ("face", "edge", "corner"):
        for high in ("face", "edge", "corner"):
            for exponent in (1, 3, 6, 8, 10, 11, 12, 13, 14, 15, 16):
                depth = 10.0**-exponent if exponent < 16 else 0.0
                pose = (vector(rng), quaternion(rng)) if rng.random() < 0.6 else ()
                clouds = wedge(rng, low, -1), wedge(rng, high, 1) - [0, 0, depth]
                yield PlainCase(f"{low} in {high} by {depth:.0e}", [Placed(Hull(points), *pose) for points in clouds])


def boxes(rng: Random) -> Iterator[PlainCase]:
    """Boxes on a lattice, that share planes, edges and corners; turned together, stretched, and far away."""
    for i in range(60):
        halves = [sixteenths(rng, 4, 24) * (1, 1, rng.choice([1, 1, 1e-3, 1e-6])) for _ in range(2)]
        centres = [
            np.zeros(3),
            np.round((halves[0] + halves[1]) * [rng.choice([-1, 0, 1]) for _ in range(3)] * 16) / 16,
        ]
        slip = rng.choice([0, 0, 1e-15, -1e-12, 1e-9, 1e-6, -1e-3, -0.25])
        turn = (0, 0, rng.choice([0, 0, 1e-12, 1e-6]), 1)
        far = rng.choice([0, 0, 1e3, 1e6])
        bodies = [
            Placed(Box(halves[0]), centres[0] + far),
            Placed(Box(halves[1]), centres[1] * (1 + slip) + far, turn),
        ]
        yield PlainCase(f"boxes {i}, slip {slip:.0e}, turn {turn[2]:.0e}, far {far:.0e}", bodies)


def slender(rng: Random) -> Iterator[PlainCase]:
    """Needles and plates across each other, up to 1e8 times as long as thick."""
    for i in range(40):
        bodies = []
        for _ in range(2):
            thin = [10.0 ** -rng.randint(0, 8) for _ in range(3)]
            thin[rng.randrange(3)] = 1.0
            shape = Hull(cloud(rng, 8) * thin) if rng.random() < 0.7 else Box(thin)
            bodies.append(Placed(shape, np.array(thin) * 0.1, quaternion(rng)))
        yield PlainCase(f"slender {i}", bodies)


def many(rng: Random) -> Iterator[PlainCase]:
    """Three to twelve bodies: with a common part, with a small one, and with none."""
    names = ["box", "hull", "fine hull", "half-space", "ball", "capsule", "cylinder", "rounded hull"]
    for i in range(36):
        count = rng.choice([3, 4, 6, 12])
        several = [posed(rng, SHAPES[rng.choice(names[: 4 if i % 3 else 8])](rng), 0.3) for _ in range(count)]
        several[0] = posed(rng, SHAPES["box"](rng), 0.3)
        push = rng.choice([0, 0, 0.5, 1])
        several[-1] = posed(rng, SHAPES["hull"](rng), 0.3 + push)
        yield PlainCase(f"{count} bodies {i}", several)
    for i in range(12):
        hole = rng.choice([0, -1e-3, 1e-3, -1e-9, -1e-12, 1e-12])
        turn = quaternion(rng)
        slabs = [
            Hull([(hole, s, t) for s in (-4, 4) for t in (-4, 4)] + [(2, s, t) for s in (-4, 4) for t in (-4, 4)]),
            Hull([(s, hole, t) for s in (-4, 4) for t in (-4, 4)] + [(s, 2, t) for s in (-4, 4) for t in (-4, 4)]),
            Hull([(-hole - s, -hole + s, t) for s in (-4, 4) for t in (-4, 4)]
                 + [(-2 - s, -2 + s, t) for s in (-4, 4) for t in (-4, 4)]),
        ]  # fmt: skip
        yield PlainCase(f"around a hole of {hole:.0e} {i}", [Placed(slab, (0, 0, 0), turn) for slab in slabs])


def copies(rng: Random) -> Iterator[PlainCase]:
    """A body with itself, as it is, grown by a little or turned by a little."""
    for count in (4, 8, 24, 60):
        points = ball_of_points(rng, count)
        for change in (0.0, 2.0**-52, 1e-13, 1e-9, 1e-5):
            yield PlainCase(
                f"{count} points grown by {change:.0e}", [Placed(Hull(points)), Placed(Hull(points * (1 + change)))]
            )
            turn = (change, -change, change, 1)
            yield PlainCase(
                f"{count} points turned by {change:.0e}", [Placed(Hull(points)), Placed(Hull(points), (0, 0, 0), turn)]
            )


def rough(rng: Random) -> Iterator[PlainCase]:
    """Hulls with a base that is nearly flat, on a box and on a tetrahedron by next to nothing, and in a third body."""
    square = [(x / 4, y / 4) for x in range(-4, 5, 2) for y in range(-4, 5, 2)]
    bar, spike = Box((0.5, 0.5, 0.5)), Hull([(0, 0, 0.5), (1, 0, -0.5), (-1, 1, -0.5), (-1, -1, -0.5)])
    for roughness in (1e-16, 1e-15, 1e-14, 1e-13):
        base = [(x, y, rng.uniform(0, roughness)) for x, y in square]
        hull = Placed(Hull(base + [(0.3 * x, 0.3 * y, 1) for x, y in SQUARE]))
        for gap in (5e-17, 1e-15, 4e-15, 2e-14, 1e-13, 3e-13, 1e-12):
            for below in (bar, spike):
                for side in (-1, 1):
                    other = Placed(below, (0.1, 0.05, -0.5 + side * gap))
                    name = f"{roughness:.0e} rough, {side * gap:.0e} into a {type(below).__name__}"
                    yield PlainCase(name, [hull, other])
                    yield PlainCase(f"{name}, and a box", [hull, other, Placed(Box((2, 2, 2)), (0.5, 0.25, 0.125))])


def fine(rng: Random) -> Iterator[PlainCase]:
    """Hulls of so many facets that the common part is traced, deep, shallow, hardly and not at all; in a box, too."""
    for count in (60, 120, 300, 700):
        for apart in (0.2, 1.0, 1.8, 1.96, 2.2):
            a, b = Hull(ball_of_points(rng, count)), Hull(ball_of_points(rng, 80))
            bodies = [Placed(a, (0.1, 0.2, 0.3), quaternion(rng)), Placed(b, (0.1 + apart, 0.2, 0.3), quaternion(rng))]
            yield PlainCase(f"{count} and 80 corners {apart} apart", bodies)
        yield PlainCase(
            f"{count} corners in a box", [Placed(a), Placed(Box((0.6, 0.7, 0.8)), (0.3, 0, 0), (1, 2, 3, 4))]
        )
        yield PlainCase(f"{count} corners on a plate", [Placed(a), Placed(HalfSpace((1, 2, 3), rng.uniform(-2, 2)))])
    for sides, others in ((40, 64), (64, 64)):
        for shift in ((0, 0, 0), (0, 0, 0.5), (0.25, 0, 0), (0.5, 0.5, 1), (1, 0, 1), (2, 0, 0), (0, 0, 2)):
            for slip in (0.0, 1e-15, -1e-12, -1e-6):
                second = Placed(Hull(prism(others)), np.array(shift) * (1 + slip), (0, 0, slip, 1))
                yield PlainCase(
                    f"prisms of {sides} and {others} sides by {shift}, {slip:.0e} off",
                    [Placed(Hull(prism(sides))), second],
                )
    for count in (60, 200):
        for exponent in (0, 2, 4, 6, 8, 10, 12, 13, 14, 15, 16):
            size = 2.0 ** rng.choice([-8, 0, 8])
            globe = ball_of_points(rng, count) * size
            step = vector(rng, size * 10.0**-exponent)
            turn = (*vector(rng, 10.0**-exponent), 1)
            yield PlainCase(f"{count} corners moved by 1e-{exponent}", [Placed(Hull(globe)), Placed(Hull(globe), step)])
            yield PlainCase(
                f"{count} corners turned by 1e-{exponent}", [Placed(Hull(globe)), Placed(Hull(globe), step * 0, turn)]
            )
    for gap in (1e-3, 1e-6, 1e-9, 1e-12):
        globe = ball_of_points(rng, 200)
        low, high = globe[:, 2].min(), globe[:, 2].max()
        bodies = [Placed(Hull(globe - [0, 0, low])), Placed(Hull(globe - [0, 0, high - gap]))]
        yield PlainCase(f"poles {gap:.0e} in each other", bodies)


def round_bodies(rng: Random) -> Iterator[PlainCase]:
    """Round bodies by tangent planes at other tolerances, and those that a formula measures."""
    names = ["ball", "capsule", "cylinder", "rounded hull"]
    for tolerance in (0.3, 1e-2, 1e-3):
        for name in names:
            bodies = [posed(rng, SHAPES[name](rng), 0.2), posed(rng, SHAPES[rng.choice(["box", "hull"])](rng), 0.2)]
            yield PlainCase(f"{name} at {tolerance}", bodies, tolerance)
    for depth in (1.0, 0.1, 1e-3, 1e-6, 1e-9, 0.0, -0.1):
        yield PlainCase(f"balls by {depth:.0e}", [Placed(Sphere(0.75)), Placed(Sphere(0.5), (1.25 - depth, 0, 0))])
        floor = Placed(HalfSpace((0, 0, 1), depth - 0.5))
        for shape, high in ((Sphere(0.5), 0.0), (Capsule(0.5, 1), 0.5), (Cylinder(0.75, 1), 0.0)):
            yield PlainCase(
                f"{type(shape).__name__} on the ground by {depth:.0e}", [floor, Placed(shape, (0, 0, high))]
            )
        table = Placed(Box((2, 2, 0.5)), (0, 0, depth - 1.0))
        yield PlainCase(f"capsule on a table by {depth:.0e}", [table, Placed(Capsule(0.5, 1), (0, 0, 0), (1, 0, 0, 1))])


def narrow_tip(way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A pyramid whose apex alone is in a block, five of the article's steps deep: most shifts lead out of it."""
    up = way / np.sqrt(way @ way)
    across = np.array([up[2], up[0], up[1]]) if abs(up).min() < abs(up).max() else np.array([1.0, -1, 0]) * up
    u = across - (across @ up) * up
    u = u / np.sqrt(u @ u)
    v = np.array([up[1] * u[2] - up[2] * u[1], up[2] * u[0] - up[0] * u[2], up[0] * u[1] - up[1] * u[0]])
    tip = np.array([0 * up, *(up + 0.2 * (s * u + t * v) for s, t in SQUARE)])
    block = np.array([w * up + s * u + t * v for w in (5 * 2.0**-26, -1) for s, t in SQUARE])
    return tip, block


def by_the_article(rng: Random) -> Iterator[PlainCase]:
    """Cases for the article's method. In some, the common point is on a boundary and has to be shifted."""
    for i in range(16):
        bodies = [posed(rng, SHAPES[rng.choice(["box", "hull", "ball", "half-space"])](rng)) for _ in range(2)]
        bodies[0] = posed(rng, SHAPES["hull"](rng))
        yield PlainCase(f"article {i}", bodies, COARSE, method="paper")
    for name in ("ball", "capsule", "cylinder", "half-space", "box"):
        for tolerance in (0.3, 0.1, 0.05):
            bodies = [posed(rng, SHAPES[name](rng), 0.2), posed(rng, SHAPES["hull"](rng), 0.2)]
            yield PlainCase(f"article, {name} at {tolerance}", bodies, tolerance, "paper")
    for x, y, z in WAYS:
        bodies = [Placed(Hull(CUBE)), Placed(Hull(CUBE), np.array([x, y, z]) * 1.5)]
        yield PlainCase(f"article, cubes along {x} {y} {z}", bodies, method="paper")
    for x, y, z in WAYS:
        tip, lid = narrow_tip(np.array([x, y, z]))
        yield PlainCase(f"article, a tip along {x} {y} {z}", [Placed(Hull(tip)), Placed(Hull(lid))], method="paper")
    for count in (3, 5):
        several = [posed(rng, SHAPES["hull"](rng), 0.2) for _ in range(count)]
        yield PlainCase(f"article, {count} bodies", several, method="paper")


def far_off(rng: Random) -> Iterator[PlainCase]:
    """Hulls far from their own origin, turned in place or moved back, and needles whose difference looks flat."""
    for far in (8.0, 1e3, 1e6):
        for name in ("turned", "moved", "both", "neither"):
            for depth in (0.3, 1e-6, 1e-12):
                away = sixteenths(rng, -16, 16) * far
                points = [cloud(rng, 12) + away, cloud(rng, 12) + away]
                turn = (*(rng.randint(-9, 9) for _ in range(3)), 9) if name in ("turned", "both") else (0, 0, 0, 1)
                back = -away if name in ("moved", "both") else np.zeros(3)
                bodies = [Placed(Hull(cloud), back, turn) for cloud in points]
                yield PlainCase(f"{name}, {far:.0e} away, by {depth:.0e}", sunk(bodies, depth))
            yield PlainCase(f"{name}, {far:.0e} away, as they are", bodies)
    for name, (a, b, moved_by) in NEEDLES.items():
        for radius in (2.0**-10, 2.0**-4):
            needles = [Placed(RoundedHull(a, radius)), Placed(RoundedHull(b, radius), moved_by)]
            yield PlainCase(f"needles {name}, rounded by {radius}", needles, 0.3)


def half_spaces(rng: Random) -> Iterator[PlainCase]:
    """Half-spaces alone, which close up, or not at all but for a box; some of them twice, some opposite."""
    for count in (4, 5, 6, 8, 12):
        for offset in (1.0, 1e-3, 0.0, -0.1):
            normals = [np.array(way, float) for way in rng.sample(WAYS, count)]
            walls = [Placed(HalfSpace(normal, offset)) for normal in normals]
            yield PlainCase(f"{count} half-spaces at {offset} and a box", [*walls, posed(rng, SHAPES["box"](rng), 0.2)])
            normals[:4] = [
                np.array(way) + vector(rng, 0.2) for way in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))
            ]
            walls = [Placed(HalfSpace(normal, offset), vector(rng, 0.01)) for normal in normals]
            yield PlainCase(f"{count} half-spaces at {offset}", walls)
    for left_open in (WAYS[-1], (1, 0, 0), (1, 1, 0), (0, 0, 1)):
        normals = [np.array(way) for way in WAYS if np.dot(way, left_open) <= 0]
        yield PlainCase(f"half-spaces open towards {left_open}", [Placed(HalfSpace(normal, 1)) for normal in normals])


GROUPS = {
    group.__name__: group
    for group in (
        kinds,
        slivers,
        boxes,
        slender,
        many,
        copies,
        rough,
        fine,
        round_bodies,
        by_the_article,
        far_off,
        half_spaces,
    )
}


def plain_cases(group: str) -> list[PlainCase]:
    return list(GROUPS[group](Random(group)))


def lattice_points(rng: Random) -> np.ndarray:
    """Few points of few places, so that facets, edges and corners of two such hulls coincide."""
    corners = [CUBE[i] for i in (0, 1, 2, 4)]
    return np.array(corners + [[rng.randint(-2, 2) / 2 for _ in range(3)] for _ in range(rng.randint(0, 10))])


# Sunk into each other by so much, or that far apart.
SUNK = (0.1, 1e-3, 1e-5, 1e-8, 1e-11, 1e-13, 1e-14, 1e-15, 0.0, -1e-13, -1e-9, -1e-3)


def plain_crowds(count: int = 12) -> Iterator[PlainCase]:
    """Several cases of each name: pairs of every two kinds, by chance and in contact, and three and more bodies."""
    rng = Random("crowds")
    names = list(SHAPES)
    for i, a in enumerate(names):
        for b in names[i:]:
            if a == b == "half-space":
                continue
            for _ in range(count):
                yield PlainCase(f"{a} and {b}", [posed(rng, SHAPES[name](rng), 0.8) for name in (a, b)], COARSE)
            for depth in SUNK:
                bodies = [posed(rng, SHAPES[name](rng), 0.8) for name in (a, b)]
                yield PlainCase(f"{a} and {b} in contact", sunk(bodies, depth, rng.choice([0, 0, 1e3])), COARSE)
    for turned in (False, True):
        for step in (0.0, 0.5, 1.0, 2.0, 3.0):
            for bodies in (2, 2, 3):
                name = f"{bodies} lattice hulls{', turned' if turned else ''}, {step} apart"
                turn = quaternion(rng) if turned else (0, 0, 0, 1)
                for _ in range(3 * count):
                    size = 2.0 ** rng.choice([-10, 0, 0, 10])
                    places = [np.array([rng.randint(-1, 1) for _ in range(3)]) * step / 2 for _ in range(bodies)]
                    yield PlainCase(
                        name, [Placed(Hull((lattice_points(rng) + place) * size), (0, 0, 0), turn) for place in places]
                    )
    for count_of_bodies in (3, 4, 6):
        for _ in range(3 * count):
            several = [posed(rng, SHAPES[rng.choice(names[1:])](rng), 0.5) for _ in range(count_of_bodies)]
            yield PlainCase(f"{count_of_bodies} bodies", [posed(rng, SHAPES["box"](rng), 0.3), *several[1:]], COARSE)
        for depth in SUNK:
            several = sunk(
                [posed(rng, SHAPES[rng.choice(["box", "hull", "fine hull"])](rng), 0.8) for _ in "ab"], depth
            )
            several += [posed(rng, SHAPES[rng.choice(names)](rng), 0.3) for _ in range(count_of_bodies - 2)]
            yield PlainCase(f"{count_of_bodies} bodies, two in contact", several, COARSE)


def sunk(bodies: list[Placed], depth: float, far: float = 0.0) -> list[Placed]:
    """A pair, the second moved so that the two are by `depth` in each other, and both far away."""
    found = overlap(*bodies)
    a, b = bodies
    moved = b.position + (found.distance - found.depth + depth) * np.asarray(found.normal)
    return [
        Placed(body.shape, position + far, body.given_orientation) for body, position in ((a, a.position), (b, moved))
    ]
