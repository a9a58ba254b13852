"""On what speed is measured: families of pairs of placed shapes, deep and shallow, with their exact truth.

A family is one function of a numpy generator that makes one pair; to add one, write it and name it in FAMILIES with the
number of pairs that are made of it. Each pair has an exact truth: rational arithmetic (tests/support/exact.py) for
polyhedra; for round shapes a closed form, slices in sixty digits (tests/support/round_exact.py), or the bounds that the
proof in ball arithmetic (overlapper/proof) comes to, which asks nothing of the core.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import cached_property
from zlib import crc32

import families
import numpy as np
from round_exact import exactly
from strategies import directions, product, quaternion, rotation, turn

from harness.bodies import exact_points, is_round, vertices
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
    distance,
    overlap,
)
from speed import truth

PI = Fraction(Decimal("3.14159265358979323846264338327950288419716939937510582"))


@dataclass(frozen=True)
class Pair:
    """Two placed shapes. Round ones bring their volume along, or how it and its error are found, and their depth if it
    is known."""

    a: Placed
    b: Placed
    volume_of_round: Fraction | Callable[[Placed, Placed], tuple[Fraction, Fraction]] | None = None
    depth_of_round: Fraction | None = None

    @property
    def bodies(self) -> tuple[Placed, Placed]:
        return self.a, self.b

    @cached_property
    def volume(self) -> Fraction:
        """The volume common to the shapes as placed, without any rounding."""
        if self.volume_of_round is not None:
            return self._found[0]
        return truth.common_volume(*map(exact_points, self.bodies))

    @cached_property
    def volume_within(self) -> Fraction:
        """How far the volume may be off: nothing if it is a closed form or rational arithmetic."""
        return self._found[1] if callable(self.volume_of_round) else Fraction(0)

    @cached_property
    def _found(self) -> tuple[Fraction, Fraction]:
        known = self.volume_of_round
        return known(self.a, self.b) if callable(known) else (known, Fraction(0))

    @cached_property
    def volume_of_points(self) -> Fraction:
        """The volume common to the hulls of the rounded vertices. Peers that take no poses get these."""
        if self.volume_of_round is not None or all(map(unrounded, self.bodies)):
            return self.volume
        return truth.common_volume(*map(vertices, self.bodies))

    @cached_property
    def depth(self) -> Fraction | None:
        return self._depth(exact_points, self.depth_of_round)

    @cached_property
    def depth_of_points(self) -> Fraction | None:
        return self.depth if all(map(unrounded, self.bodies)) else self._depth(vertices, self.depth_of_round)

    def _depth(self, points: Callable[[Placed], Iterable], of_round: Fraction | None) -> Fraction | None:
        if self.volume_of_round is not None:
            return of_round
        return truth.depth(*map(points, self.bodies))


def unrounded(body: Placed) -> bool:
    """True if placing the vertices in doubles gives the exact ones."""
    if is_round(body):
        return True
    return [tuple(map(Fraction, p)) for p in vertices(body).tolist()] == [tuple(p) for p in exact_points(body)]


# Families


def apart(rng: np.random.Generator, first: np.ndarray, second: np.ndarray, gap: float) -> Pair:
    """Two hulls as given, turned at random and their centres `gap` apart."""
    one, other = quaternion(rng), quaternion(rng)
    at = directions(rng, 1)[0]
    return Pair(Placed(Hull(first), at, one), Placed(Hull(second), at + gap * directions(rng, 1)[0], other))


def pushed_in(rng: np.random.Generator, points: np.ndarray, depth: float) -> Pair:
    """Two hulls of the same points, turned at random. One reaches `depth` into the other along a line."""
    one, other, along = quaternion(rng), quaternion(rng), directions(rng, 1)[0]
    reach = (points @ rotation(one).T @ along).max() + (points @ rotation(other).T @ -along).max() - depth
    at = directions(rng, 1)[0]
    return Pair(Placed(Hull(points), at, one), Placed(Hull(points), at + reach * along, other))


def on_sphere(count: int) -> Callable[[np.random.Generator], Pair]:
    return lambda rng: apart(rng, directions(rng, count), directions(rng, count), 0.5)


def icospheres(subdivisions: int, depth: float | None = None) -> Callable[[np.random.Generator], Pair]:
    """Half a radius apart, or pushed in."""
    points = families.icosphere(subdivisions)
    if depth is None:
        return lambda rng: apart(rng, points, points, 0.5)
    return lambda rng: pushed_in(rng, points, depth)


def boxes_deep(rng: np.random.Generator) -> Pair:
    one, other = (Box(rng.uniform(0.5, 1.0, 3)) for _ in range(2))
    at = directions(rng, 1)[0]
    return Pair(Placed(one, at, quaternion(rng)), Placed(other, at + 0.5 * directions(rng, 1)[0], quaternion(rng)))


def box_sliver(rng: np.random.Generator) -> Pair:
    """A box on another, turned about the normal between them and sunk in by 1e-4 m; both turned at random."""
    one, other = (Box(rng.uniform(0.5, 1.0, 3)) for _ in range(2))
    tilt, yaw = quaternion(rng), turn([0, 0, rng.uniform(0.1, 1.0)])
    offset = np.array([0.3, -0.2, one.half_extents[2] + other.half_extents[2] - 1e-4])
    at = directions(rng, 1)[0]
    return Pair(Placed(one, at, tilt), Placed(other, at + rotation(tilt) @ offset, product(tilt, yaw)))


def box_on_ground(rng: np.random.Generator) -> Pair:
    """A box that rests 1e-3 m deep and not quite level."""
    box = Box(rng.uniform(0.5, 1.0, 3))
    turned = product(turn(1e-4 * rng.normal(size=3)), turn([0, 0, rng.uniform(0, 3)]))
    at = (*rng.uniform(-1, 1, 2), box.half_extents[2] - 1e-3)
    return Pair(Placed(box, at, turned), Placed(HalfSpace([0, 0, 1], 0)))


def boxes_apart(rng: np.random.Generator) -> Pair:
    """Boxes that do not touch, but whose boxes along the axes meet, as is left over when a scene has been culled."""
    while True:
        one, other = (Placed(Box(rng.uniform(0.5, 1.0, 3)), 0.8 * at, quaternion(rng)) for at in (directions(rng, 2)))
        lower, upper = np.maximum(one.bounds[0], other.bounds[0]), np.minimum(one.bounds[1], other.bounds[1])
        if (lower < upper).all() and distance(one, other) > 0.01:
            return Pair(one, other)


def tetrahedra(rng: np.random.Generator) -> Pair:
    return apart(rng, families.TETRA, families.TETRA, 0.5)


def prism_and_box(rng: np.random.Generator) -> Pair:
    """A prism of 64 sides, as cylinders are often given, and a box."""
    pair = apart(rng, families.prism(64, 1.5), families.CORNERS, 0.5)
    return Pair(pair.a, Placed(Box(rng.uniform(0.5, 1.0, 3)), pair.b.position, pair.b.orientation))


# Round shapes. All numbers are multiples of a power of two and all turns permute the axes, so that nothing is rounded.

ONWARDS = (0.5, 0.5, 0.5, 0.5)  # x to y, y to z, z to x


def balls(rng: np.random.Generator) -> Pair:
    r, s = (Fraction(int(k), 16) for k in rng.integers(8, 17, 2))
    step = Fraction(int(rng.integers(60, 100)), 1024) * (r + s)
    volume, d = families.lens_over_pi(r, s, 7 * step) * PI, 7 * step
    centre = [float(k * step) for k in (2, 3, 6)]  # as far as 7 steps
    return Pair(Placed(Sphere(float(r))), Placed(Sphere(float(s)), centre), volume, r + s - d)


def ball_on_ground(rng: np.random.Generator) -> Pair:
    r, h = Fraction(int(rng.integers(8, 17)), 16), Fraction(1, 1024)
    at = (*(rng.integers(-16, 17, 2) / 16), float(r - h))
    return Pair(Placed(Sphere(float(r)), at), Placed(HalfSpace([0, 0, 1], 0)), h * h * (3 * r - h) / 3 * PI, h)


def ball_at_corner(rng: np.random.Generator) -> Pair:
    """A ball whose centre is a box's corner: an eighth of it is common."""
    r = Fraction(int(rng.integers(8, 16)), 16)
    at = rng.integers(-16, 17, 3) / 16
    return Pair(Placed(Sphere(float(r)), at), Placed(Box([1, 1, 1]), at + 1), r**3 * PI / 6)


def crossing_cylinders(rng: np.random.Generator) -> Pair:
    """Two cylinders of one radius whose axes meet at a right angle share 16/3 of its cube, as Archimedes knew."""
    r = Fraction(int(rng.integers(8, 16)), 16)
    at = rng.integers(-16, 17, 3) / 16
    cylinder = Cylinder(float(r), 4.0)
    return Pair(Placed(cylinder, at), Placed(cylinder, at, ONWARDS), r**3 * 16 / 3)


def cylinder_wedge(rng: np.random.Generator) -> Pair:
    """A cylinder and a half-space whose plane rises through the middle of its foot: 2/3 of height times radius²."""
    r = Fraction(int(rng.integers(8, 16)), 16)
    below = HalfSpace([-3, 0, 4], -8)  # its plane meets the foot, z = -2, at x = 0
    return Pair(Placed(Cylinder(float(r), 4.0)), Placed(below), r**2 * (r * 3 / 4) * 2 / 3)


# Round shapes at any pose

SHALLOW = 1e-6  # m


def by_slices(a: Placed, b: Placed) -> tuple[Fraction, Fraction]:
    """The volume of a ball, capsule or cylinder and a polyhedron, as a double, and its error."""
    volume = Fraction(exactly(a, b).volume)
    return volume, volume / 2**53


def by_proof(a: Placed, b: Placed) -> tuple[Fraction, Fraction]:
    """The middle of the bounds that a certificate proves, and half their distance."""
    low, high = overlap(a, b).certificate().verify()
    return (low + high) / 2, (high - low) / 2


def by_stretching(ellipsoid: Placed, hull: Placed) -> tuple[Fraction, Fraction]:
    """Where the ellipsoid is a unit ball. Half axes are powers of two along the axes, so that nothing is rounded."""
    half = ellipsoid.shape.half_axes
    volume, within = by_slices(Placed(Sphere(1.0)), Placed(Hull(hull.shape.vertices / half)))
    share = Fraction(float(half.prod()))
    return volume * share, within * share


Make = Callable[[np.random.Generator], Shape]


def crossing(one: Make, other: Make, how: Callable = by_slices) -> Callable[[np.random.Generator], Pair]:
    """A third of a metre apart, turned at random."""

    def make(rng: np.random.Generator) -> Pair:
        first, second = one(rng), other(rng)
        at = directions(rng, 1)[0]
        moved = Placed(first, at, quaternion(rng))
        return Pair(moved, Placed(second, at + directions(rng, 1)[0] / 3, quaternion(rng)), how)

    return make


def ball(rng: np.random.Generator) -> Sphere:
    return Sphere(rng.uniform(0.4, 0.6))


def box(rng: np.random.Generator) -> Box:
    return Box(rng.uniform(0.3, 0.5, 3))


def capsule(rng: np.random.Generator) -> Capsule:
    return Capsule(rng.uniform(0.2, 0.4), rng.uniform(0.5, 1))


def cylinder(rng: np.random.Generator) -> Cylinder:
    return Cylinder(rng.uniform(0.2, 0.4), rng.uniform(0.5, 1))


def hull(rng: np.random.Generator, corners: int = 20) -> Hull:
    return Hull(directions(rng, corners) * rng.uniform(0.4, 0.6, 3))


def rounded_hull(rng: np.random.Generator, corners: int = 12, radius: float = 0.05) -> RoundedHull:
    return RoundedHull(hull(rng, corners).vertices, radius)


def mesh_with_margin(rng: np.random.Generator) -> RoundedHull:
    """As Bullet has convex meshes."""
    return rounded_hull(rng, 40, 1e-3)


def ball_over_edge(rng: np.random.Generator) -> Pair:
    """A ball that reaches SHALLOW deep over the edge of a box."""
    r, sides = rng.uniform(0.4, 0.6), rng.uniform(0.5, 1.0, 3)
    out = (r - SHALLOW) / np.sqrt(2)
    tilt, at = quaternion(rng), directions(rng, 1)[0]
    centre = rotation(tilt) @ [sides[0] + out, sides[1] + out, rng.uniform(-0.1, 0.1)]
    return Pair(Placed(Sphere(r), at + centre), Placed(Box(sides), at, tilt), by_slices)


def capsule_on_ground(rng: np.random.Generator) -> Pair:
    """Lying 1e-3 m deep and not quite level, so that one end is out."""
    shape, tilt = capsule(rng), product(turn([0, 0.05, 0]), turn([0, np.pi / 2, 0]))
    lowest = shape.length / 2 * abs((rotation(tilt) @ [0, 0, 1])[2]) + shape.radius
    at = (*rng.uniform(-1, 1, 2), lowest - 1e-3)
    return Pair(Placed(shape, at, tilt), Placed(HalfSpace([0, 0, 1], 0)), by_slices)


def ellipsoid_and_hull(rng: np.random.Generator) -> Pair:
    """Fit for by_stretching."""
    half = 2.0 ** -rng.permutation([0, 1, 2])
    points = np.round(families.mapped(hull(rng).vertices, rotation(quaternion(rng))) * 2**20) / 2**20
    return Pair(Placed(Ellipsoid(half)), Placed(Hull(points)), by_stretching)


def rounded_hull_on_ground(rng: np.random.Generator) -> Pair:
    shape, turned = rounded_hull(rng), quaternion(rng)
    lowest = (shape.core.vertices @ rotation(turned).T)[:, 2].min() - shape.radius
    return Pair(Placed(shape, (0, 0, -lowest - 1e-3), turned), Placed(HalfSpace([0, 0, 1], 0)), by_proof)


FAMILIES: dict[str, tuple[Callable[[np.random.Generator], Pair], int]] = {
    "box deep": (boxes_deep, 16),
    "box sliver": (box_sliver, 16),
    "box on ground": (box_on_ground, 16),
    "tetra": (tetrahedra, 16),
    "h20": (on_sphere(20), 16),
    "h50": (on_sphere(50), 8),
    "h100": (on_sphere(100), 4),
    "h500": (on_sphere(500), 2),
    "i320 deep": (icospheres(2), 4),
    "i320 shallow": (icospheres(2, 0.01), 4),
    "i1280 deep": (icospheres(3), 2),
    "i1280 shallow": (icospheres(3, 0.01), 2),
    "i5120 deep": (icospheres(4), 1),
    "i5120 shallow": (icospheres(4, 0.01), 1),
    "prism 64 and box": (prism_and_box, 8),
    "balls": (balls, 8),
    "ball on ground": (ball_on_ground, 8),
    "ball at box corner": (ball_at_corner, 4),
    "crossing cylinders": (crossing_cylinders, 4),
    "cylinder wedge": (cylinder_wedge, 4),
    "ball and box": (crossing(ball, box), 8),
    "ball over edge, 1 µm": (ball_over_edge, 8),
    "capsule and box": (crossing(capsule, box), 8),
    "capsule on ground": (capsule_on_ground, 8),
    "cylinder and hull": (crossing(cylinder, hull), 8),
    "ball and capsule": (crossing(ball, capsule, by_proof), 4),
    "two capsules": (crossing(capsule, capsule, by_proof), 4),
    "capsule and cylinder": (crossing(capsule, cylinder, by_proof), 4),
    "ellipsoid and hull": (ellipsoid_and_hull, 4),
    "rounded hull and box": (crossing(rounded_hull, box, by_proof), 4),
    "rounded hull on ground": (rounded_hull_on_ground, 4),
    "meshes with margins": (crossing(mesh_with_margin, mesh_with_margin, by_proof), 2),
}


# For time over size, with icospheres of the families above, and for the time of finding nothing: few peers are asked.
MORE: dict[str, tuple[Callable[[np.random.Generator], Pair], int]] = {
    "i80 deep": (icospheres(1), 4),
    "i20480 deep": (icospheres(5), 1),
    "i20480 shallow": (icospheres(5, 0.01), 1),
    "boxes apart": (boxes_apart, 16),
}


# Facets of either mesh, from small to large, of the families that a chart shows time over size for.
SIZES = (80, 320, 1280, 5120, 20480)


def pairs_of(family: str) -> list[Pair]:
    make, count = (FAMILIES | MORE)[family]
    rng = np.random.default_rng(crc32(family.encode()))
    return [make(rng) for _ in range(count)]
