"""Placed shapes in rational arithmetic: a double is a rational number, so all that it says can be taken exactly.

Only what defines a shape is used: radii, lengths, half extents, corners of hulls, normals and offsets as given,
position, quaternion. A quaternion stands for the exact rotation of its direction. The triangles of a hull are a
suggestion that is checked.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overlapper import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, Placed, RoundedHull, Sphere
from overlapper.proof.nearest import nearest_weights

Exact = NDArray[np.object_]  # of Fraction

exact: Any = np.frompyfunc(Fraction, 1, 1)


def rotation(quaternion: NDArray[np.float64]) -> Exact:
    """The rotation of a quaternion xyzw of any length: exactly orthogonal, as it is divided by the squared length."""
    x, y, z, w = exact(quaternion)
    s = 2 / (x * x + y * y + z * z + w * w)
    return np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
            [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
            [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
        ],
        dtype=object,
    )


def integers(values: Any) -> tuple[Exact, int]:
    """Integers, and the least by which to divide them: many sums and products are faster by far so."""
    values = np.asarray(values, object)
    scale = math.lcm(*(x.denominator for x in values.flat))
    numbers: Exact = np.frompyfunc(lambda x: x.numerator * (scale // x.denominator), 1, 1)(values)
    return numbers, scale


def in_doubles(numbers: Exact, scale: int) -> NDArray[np.float64]:
    """Integers of any size divided by another, rounded once."""
    doubles: NDArray[np.float64] = np.frompyfunc(lambda x: x / scale, 1, 1)(numbers).astype(float)
    return doubles


def bits(numbers: Exact) -> int:
    """Of the largest of the integers."""
    return max((abs(x).bit_length() for x in numbers.flat), default=0)


def cross(u: Exact, v: Exact) -> Exact:
    """Of vectors (..., 3)."""
    (a, b, c), (x, y, z) = np.moveaxis(u, -1, 0), np.moveaxis(v, -1, 0)
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-1)


def triple(u: Exact, v: Exact, w: Exact) -> Exact:
    """Determinants (...) of vectors (..., 3)."""
    product: Exact = (u * cross(v, w)).sum(axis=-1)
    return product


def root(square: Fraction) -> tuple[Fraction, Fraction]:
    """(lower, upper) around the square root, equal where it is short, else apart by 1e-38 of it or less."""
    shift = 128 - (square.numerator.bit_length() - square.denominator.bit_length()) // 2
    scaled = square * (Fraction(4) ** shift)
    floor = math.isqrt(scaled.numerator // scaled.denominator)
    unit = Fraction(2) ** -shift
    return floor * unit, (floor if floor * floor == scaled else floor + 1) * unit


def primitive(row: Iterable[Fraction]) -> tuple[int, ...]:
    """Integers without a common divisor in the proportions of the row."""
    row = list(row)
    scale = math.lcm(*(x.denominator for x in row))
    numbers = [x.numerator * (scale // x.denominator) for x in row]
    divisor = math.gcd(*numbers) or 1
    return tuple(x // divisor for x in numbers)


def is_closed(triangles: NDArray[np.signedinteger]) -> bool:
    """Whether triangles (k, 3) of indices have no border: every directed edge is met by its reverse as often."""
    edges = Counter((int(t[i - 1]), int(t[i])) for t in triangles for i in range(3))
    return bool(edges) and all(count == edges[end, start] for (start, end), count in edges.items())


def fans(rings: Iterable[NDArray[np.int32]]) -> NDArray[np.intp]:
    """Triangles (k, 3) of polygons, all of a polygon at its first corner."""
    triangles = [(ring[0], *pair) for ring in rings for pair in pairwise(ring[1:])]
    return np.array(triangles, np.intp).reshape(-1, 3)


# A sum of a few products of doubles that are numbers below 1, rounded, is right to this share of the sum of their
# magnitudes, and, where they underflow, to that much.
DOUBT, UNDERFLOW = 2.0**-48, 2.0**-1000


class RationalBody:
    """A placed shape as its numbers say, without any rounding."""

    def __init__(self, placed: Placed) -> None:
        self.shape = placed.shape
        self.position: Exact = exact(placed.position)
        self.axes = rotation(placed.given_orientation)
        self._turn = integers(self.axes)

    def local(self, points: Exact, scale: int = 1) -> tuple[Exact, int]:
        """Points (n, 3) / scale of the world in the body's frame: integers, and what to divide them by."""
        numbers, unit = integers(np.vstack([points, scale * self.position]))
        turned: Exact = (numbers[:-1] - numbers[-1]) @ self._turn[0]
        return turned, scale * unit * self._turn[1]

    def support(self, direction: Exact) -> tuple[Fraction, Fraction] | None:
        """(flat, square): flat + sqrt(square) is the greatest direction . x on the body; None if there is none."""
        base = direction @ self.position
        numbers, scale = integers(direction)
        x, y, z = local = numbers @ self._turn[0]
        scale *= self._turn[1]
        match self.shape:
            case Box() as box:
                return base + exact(box.half_extents) @ [abs(x), abs(y), abs(z)] / scale, Fraction(0)
            case Hull():
                return base + Fraction(self._farthest(local), scale * self.corners[1]), Fraction(0)
            case RoundedHull() as rounded:
                tip = Fraction(self._farthest(local), scale * self.corners[1])
                return base + tip, Fraction(rounded.radius) ** 2 * Fraction(local @ local, scale * scale)
            case Sphere() as ball:
                return base, Fraction(ball.radius) ** 2 * Fraction(local @ local, scale * scale)
            case Capsule() as capsule:
                tip = Fraction(capsule.length) / 2 * Fraction(abs(z), scale)
                return base + tip, Fraction(capsule.radius) ** 2 * Fraction(local @ local, scale * scale)
            case Cylinder() as cylinder:
                tip = Fraction(cylinder.length) / 2 * Fraction(abs(z), scale)
                return base + tip, Fraction(cylinder.radius) ** 2 * Fraction(x * x + y * y, scale * scale)
            case HalfSpace() as half:
                normal = exact(half.given_normal)
                if any(cross(normal, local)) or local @ normal < 0:
                    return None
                level = Fraction(half.given_offset) * (local @ normal) / (normal @ normal)
                return base + level / scale, Fraction(0)
            case Ellipsoid() as ellipsoid:
                stretched = exact(ellipsoid.half_axes) * local
                return base, Fraction(stretched @ stretched) / scale**2

    @property
    def hull(self) -> Hull:
        """The shape itself, or the core of a rounded hull."""
        assert isinstance(self.shape, Hull | RoundedHull)
        return self.shape if isinstance(self.shape, Hull) else self.shape.core

    @cached_property
    def corners(self) -> tuple[Exact, int]:
        """Of a hull or of the core of a rounded one, in its own frame: integers (n, 3), and by what to divide them."""
        return integers(exact(self.hull.corners))

    def next_on_core(self, point: NDArray[np.float64]) -> Exact:
        """A point of the core, exactly, that is to rounding the nearest to one outside; both in the body's axes."""
        corners, triangles = self.hull.corners, self.hull.triangles
        weights = nearest_weights(corners[triangles] - point)
        near = np.einsum("ki,kij->kj", weights, corners[triangles] - point)
        row = int((near * near).sum(axis=1).argmin())
        shares = exact(weights[row])
        nearest: Exact = shares @ exact(corners[triangles[row]]) / shares.sum()
        return nearest

    @cached_property
    def _corners_in_doubles(self) -> NDArray[np.float64]:
        corners, _ = self.corners
        return in_doubles(corners, 1 << bits(corners))

    def _farthest(self, direction: Exact) -> int:
        """The greatest product with a corner, both in integers: doubles leave a few to choose from."""
        d = in_doubles(direction, 1 << bits(direction))
        along = self._corners_in_doubles @ d
        doubt = DOUBT * (abs(self._corners_in_doubles) @ abs(d)) + UNDERFLOW
        few = np.flatnonzero(along + doubt >= (along - doubt).max())
        return int(max(self.corners[0][few] @ direction))

    def is_below(self, direction: Exact, offset: Fraction) -> bool:
        """Whether the body lies in { x : direction . x <= offset }: the squares are compared, no root is taken."""
        support = self.support(direction)
        return support is not None and support[0] <= offset and support[1] <= (offset - support[0]) ** 2

    def contains(self, points: Exact, margin: Fraction | int = 0, scale: int = 1) -> NDArray[np.bool_]:
        """Whether the body holds a ball of radius `margin` about each of the points (n, 3) / scale in the world.

        Of points on the surface of a rounded hull this may be said to be false, as the nearest point of the core is
        only known to rounding; and of a ball in an ellipsoid, unless it is in one that is smaller by as much of the
        shortest half axis.
        """
        local, scale = self.local(points, scale)
        x, y, z = local.T
        inside: Any

        def least(size: Fraction) -> int:
            return math.floor((size - margin) * scale)

        def holds(square: Exact, radius: float) -> Any:
            return (square <= math.floor(((Fraction(radius) - margin) * scale) ** 2)) & (Fraction(radius) >= margin)

        match self.shape:
            case Box() as box:
                inside = (abs(local) <= [least(half) for half in exact(box.half_extents)]).all(axis=1)
            case Sphere() as ball:
                inside = holds(x * x + y * y + z * z, ball.radius)
            case Capsule() as capsule:
                # Twice the length past its ends, by the denominator of the length: so that it is an integer.
                length = Fraction(capsule.length)
                past = np.maximum(2 * length.denominator * abs(z) - length.numerator * scale, 0)
                own = (2 * length.denominator) ** 2
                square = own * (x * x + y * y) + past * past
                reach = (Fraction(capsule.radius) - margin) * scale
                inside = (square <= math.floor(own * reach * reach)) & (reach >= 0)
            case Cylinder() as cylinder:
                inside = (abs(z) <= least(Fraction(cylinder.length) / 2)) & holds(x * x + y * y, cylinder.radius)
            case Ellipsoid() as ellipsoid:
                half_axes = exact(ellipsoid.half_axes)
                inverse, unit = integers(1 / half_axes)
                left = (1 - margin / min(half_axes)) * scale * unit
                square = ((local * inverse) ** 2).sum(axis=1)
                inside = (square <= math.floor(left * left)) & (left >= 0)
            case Hull() | HalfSpace():
                inside = self._below_facets(local, scale, margin)
            case RoundedHull() as rounded:
                room = Fraction(rounded.radius) - margin
                inside = self._below_facets(local, scale, max(-room, Fraction(0)))
                for i in np.flatnonzero(~inside) if room >= 0 else ():
                    arm = local[i] - scale * self.next_on_core(in_doubles(local[i], scale))
                    inside[i] = arm @ arm <= (room * scale) ** 2
        return np.asarray(inside, bool)

    def _below_facets(self, points: Exact, scale: int, margin: Fraction | int) -> NDArray[np.bool_]:
        normals, offsets = self.facets
        inside = np.ones(len(points), bool)
        for i, point in enumerate(points) if margin else ():
            slack = offsets * scale - normals @ point
            deep = slack * slack >= (margin * scale) ** 2 * (normals * normals).sum(axis=1)
            inside[i] = ((slack >= 0) & deep).all()
        if not margin:
            for some in np.array_split(np.arange(len(points)), 1 + len(points) * len(offsets) // 2**20):
                point, facet = self._not_surely_below(points[some], scale)
                slack = offsets[facet] * scale - (normals[facet] * points[some[point]]).sum(axis=1)
                inside[some[point[slack < 0]]] = False
        return inside

    def _not_surely_below(self, points: Exact, scale: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Pairs of a point and a plane of which doubles, with all their rounding, do not say that it is below."""
        unit = 1 << max(bits(points), scale.bit_length())
        x, (normals, offsets) = in_doubles(points, unit), self._facets_in_doubles
        level = offsets * (scale / unit)
        slack = level - x @ normals.T
        point, facet = np.nonzero(slack <= DOUBT * (abs(level) + abs(x) @ abs(normals.T)) + UNDERFLOW)
        return point, facet

    @cached_property
    def _facets_in_doubles(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        rows = np.column_stack(self.facets)
        doubles = np.array([in_doubles(row, 1 << bits(row)) for row in rows])
        return doubles[:, :3], doubles[:, 3]

    @cached_property
    def facets(self) -> tuple[Exact, Exact]:
        """Normals (k, 3), outward, and offsets (k,), integers, of the planes of a hull, core or half-space in its axes.

        What is below all planes of a hull's triangles is inside of the hull of the corners: the triangles close, so
        their surface winds about a point that is on the inner side of each, and no plane can then separate the point
        from their corners. Points on some triangles are limits of such points, because the mean of the corners is one.
        Triangles without area lie on the edges of others. The converse is not said: a hull may be larger than its
        facets.
        """
        if isinstance(self.shape, HalfSpace):
            row = primitive([*exact(self.shape.given_normal), Fraction(self.shape.given_offset)])
            return np.array([row[:3]], object), np.array(row[3:], object)
        (corners, unit), triangles = self.corners, self.hull.triangles
        a, b, c = (corners.take(corner, axis=0) for corner in triangles.T)  # indexing may crash for want of memory
        normals = cross(b - a, c - a)
        solid = np.array([any(normal) for normal in normals])
        normals, offsets = normals[solid], (normals * a).sum(axis=1)[solid]
        total = corners.sum(axis=0)
        if not is_closed(triangles) or any(normals @ total >= len(corners) * offsets):
            raise ValueError("triangles of a hull must be a closed surface around the mean of its corners")
        # The offsets are in units of the corners, once more than the normals.
        rows = np.array(sorted({_lowest(row) for row in np.column_stack([normals * unit, offsets])}), object)
        return rows[:, :3], rows[:, 3]

    def is_closed_by_facets(self) -> bool:
        """Whether all corners are below all facets, so that the hull is no larger than what is below these."""
        numbers, scale = self.corners
        return bool(self._below_facets(numbers, scale, 0).all())


def _lowest(row: Exact) -> tuple[int, ...]:
    divisor = math.gcd(*row)
    return tuple(x // divisor for x in row)
