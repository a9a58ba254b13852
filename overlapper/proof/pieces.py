"""Placed shapes cut by planes into pieces of at most one quadric, without rounding.

A capsule is a cylinder between its ends and two half balls. A rounded hull is its core, a prism on every facet, a wedge
of a cylinder on every edge and a wedge of a ball at every corner. All numbers are rational, as those of rotations are;
only the height of a prism, the radius times the length of a normal, need not be, and is rounded down.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from flint import fmpq
from numpy.typing import NDArray

from overlapper import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, RoundedHull, Sphere
from overlapper.proof.rational import RationalBody
from overlapper.proof.refusal import CertificateError
from overlapper.proof.vectors import ORIGIN, Vector, cross, dot, minus, plus, rational, scaled, vector

Floats = NDArray[np.float64]

# Doubles that decide which pieces are apart are rounded by less than this share of the largest of them.
DOUBT = 2.0**-40
ZERO = fmpq(0)
# Bits to which the height of a prism is known, below 1.
PRISM = 320


@dataclass(frozen=True)
class Plane:
    """{ x : normal · x <= offset }."""

    normal: Vector
    offset: fmpq

    def height(self, point: Vector) -> fmpq:
        return dot(self.normal, point) - self.offset


@dataclass(frozen=True)
class Ball:
    centre: Vector
    square: fmpq  # of the radius


@dataclass(frozen=True)
class Tube:
    """A circular cylinder without ends, about a line; the axis is of any length."""

    point: Vector
    axis: Vector
    square: fmpq  # of the radius


Quadric = Ball | Tube


@dataclass(frozen=True)
class Piece:
    """What is in the quadric, if there is one, and below the planes.

    It lies within `reach` of the hull of `spine` (k, 3), in doubles; `spine` is None of what has no end. Of the body
    its planes cut off no more than the volume `lost`.
    """

    quadric: Quadric | None
    planes: tuple[Plane, ...]
    spine: Floats | None
    reach: float = 0.0
    lost: fmpq = ZERO


class Frame:
    """From the axes of a body to those in which all is measured: of an ellipsoid, each in units of its half axis."""

    def __init__(self, body: RationalBody, home: RationalBody) -> None:
        turn = home.axes.T @ body.axes
        self._rows = [vector(row) for row in turn]
        self._shift = vector(home.axes.T @ (body.position - home.position))
        self.units = vector(home.shape.half_axes) if isinstance(home.shape, Ellipsoid) else None

    def direction(self, v: Vector) -> Vector:
        return dot(self._rows[0], v), dot(self._rows[1], v), dot(self._rows[2], v)

    def point(self, v: Vector) -> Vector:
        x, y, z = plus(self.direction(v), self._shift)
        return (x / self.units[0], y / self.units[1], z / self.units[2]) if self.units else (x, y, z)

    def plane(self, normal: Vector, offset: fmpq) -> Plane:
        x, y, z = turned = self.direction(normal)
        placed = offset + dot(turned, self._shift)
        return Plane((x * self.units[0], y * self.units[1], z * self.units[2]) if self.units else turned, placed)


def doubles(points: Iterable[Vector]) -> Floats:
    return np.array([[int(x.p) / int(x.q) for x in point] for point in points])


def pieces(body: RationalBody, home: RationalBody) -> list[Piece]:
    """In the axes of `home`. An ellipsoid has pieces only at home, and is a ball there; other round bodies are not."""
    frame = Frame(body, home)
    assert not frame.units or body is home or isinstance(body.shape, Box | Hull | HalfSpace)
    match body.shape:
        case Sphere() as ball:
            return [_ball(frame.point(ORIGIN), ball.radius, ())]
        case Cylinder() as cylinder:
            return [_tube(frame, cylinder.radius, cylinder.length)]
        case Capsule() as capsule:
            return _capsule(frame, capsule)
        case Box() as box:
            return [_box(frame, box)]
        case HalfSpace() as half:
            return [Piece(None, (frame.plane(vector(half.given_normal), rational(half.given_offset)),), None)]
        case Hull() | RoundedHull():
            return _Facets(body, frame).pieces()
        case Ellipsoid():
            assert body is home
            return [_ball(ORIGIN, 1.0, ())]


def _ball(centre: Vector, radius: float, planes: tuple[Plane, ...]) -> Piece:
    return Piece(Ball(centre, rational(radius) ** 2), planes, doubles([centre]), radius)


def _tube(frame: Frame, radius: float, length: float) -> Piece:
    half = rational(length) / 2
    ends = [frame.point((ZERO, ZERO, side * half)) for side in (-1, 1)]
    planes = tuple(frame.plane((ZERO, ZERO, fmpq(side)), half) for side in (-1, 1))
    axis = frame.direction((ZERO, ZERO, fmpq(1)))
    return Piece(Tube(frame.point(ORIGIN), axis, rational(radius) ** 2), planes, doubles(ends), radius)


def _capsule(frame: Frame, capsule: Capsule) -> list[Piece]:
    half = rational(capsule.length) / 2
    parts = [_tube(frame, capsule.radius, capsule.length)] if half else []
    for side in (-1, 1):
        centre = frame.point((ZERO, ZERO, side * half))
        beyond = frame.plane((ZERO, ZERO, fmpq(-side)), -half)
        parts.append(_ball(centre, capsule.radius, (beyond,)))
    return parts


def _box(frame: Frame, box: Box) -> Piece:
    half = vector(box.half_extents)
    planes = []
    for k in range(3):
        for side in (-1, 1):
            normal = [ZERO] * 3
            normal[k] = fmpq(side)
            planes.append(frame.plane((normal[0], normal[1], normal[2]), half[k]))
    corners = [(x * half[0], y * half[1], z * half[2]) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    return Piece(None, tuple(planes), doubles(map(frame.point, corners)))


class _Facets:
    """The facets of a hull, of which each may be several triangles, and what a radius puts on them."""

    def __init__(self, body: RationalBody, frame: Frame) -> None:
        assert isinstance(body.shape, Hull | RoundedHull)
        self.frame, self.radius = frame, body.shape.radius if isinstance(body.shape, RoundedHull) else 0.0
        (normals, offsets), (corners, scale) = body.facets, body.corners
        if not body.is_closed_by_facets():
            raise CertificateError("a hull whose corners are not all below its facets has no certificate")
        self.planes = [(vector(normal), rational(int(offset))) for normal, offset in zip(normals, offsets)]
        self.corners = [vector(Fraction(x, scale) for x in corner) for corner in corners]
        self.placed = [frame.point(corner) for corner in self.corners]
        self.triangles = body.hull.triangles

    def pieces(self) -> list[Piece]:
        planes = tuple(self.frame.plane(*plane) for plane in self.planes)
        found = [Piece(None, planes, doubles(self.placed))]
        if self.radius > 0.0:
            sides = self._sides()
            found += [self._prism(facet, edges) for facet, edges in enumerate(sides)]
            found += self._wedges(sides)
        return found

    def _sides(self) -> list[list[tuple[int, int]]]:
        """For each plane the edges around its triangles; those without area go with the triangle at their long side."""
        plane_of = {self._key(*plane): k for k, plane in enumerate(self.planes)}
        owner: dict[tuple[int, int], int] = {}
        thin = []
        for triangle in self.triangles.tolist():
            p, q, r = (self.corners[i] for i in triangle)
            normal = cross(minus(q, p), minus(r, p))
            edges = [(triangle[i - 1], triangle[i]) for i in range(3)]
            if any(normal):
                facet = plane_of[self._key(normal, dot(normal, p))]
                owner.update((edge, facet) for edge in edges)
            else:
                thin.append(edges)
        while thin:
            left = []
            for edges in thin:
                long = max(edges, key=lambda edge: self._square(*edge))
                if long[::-1] in owner:
                    owner.update((edge, owner[long[::-1]]) for edge in edges)
                else:
                    left.append(edges)
            if len(left) == len(thin):
                raise CertificateError("a hull of triangles without area has no certificate")
            thin = left
        sides: list[list[tuple[int, int]]] = [[] for _ in self.planes]
        for (p, q), facet in owner.items():
            if owner[q, p] != facet:
                sides[facet].append((p, q))
        return sides

    @staticmethod
    def _key(normal: Vector, offset: fmpq) -> tuple[fmpq, ...]:
        """Equal for the same plane, seen from the same side."""
        size = max(abs(x) for x in normal)
        return tuple(x / size for x in (*normal, offset))

    def _square(self, p: int, q: int) -> fmpq:
        edge = minus(self.corners[q], self.corners[p])
        return dot(edge, edge)

    def _prism(self, facet: int, edges: list[tuple[int, int]]) -> Piece:
        normal, offset = self.planes[facet]
        square = dot(normal, normal)
        rise, exact = _root_below(square * rational(self.radius) ** 2)
        planes = [self.frame.plane(normal, offset + rise), self.frame.plane(scaled(normal, -1), -offset)]
        for p, q in edges:
            outward = cross(minus(self.corners[q], self.corners[p]), normal)
            planes.append(self.frame.plane(outward, dot(outward, self.corners[p])))
        ring = sorted({p for edge in edges for p in edge})
        top = self.frame.direction(scaled(normal, rise / square))
        spine = doubles([self.placed[p] for p in ring] + [plus(self.placed[p], top) for p in ring])
        area = rational(float(np.linalg.norm(np.ptp(spine, axis=0))) * (1.0 + DOUBT)) ** 2
        # The height lost is 2^-PRISM of all or less.
        lost = ZERO if exact else area * rational(self.radius) / fmpq(2) ** PRISM
        return Piece(None, tuple(planes), spine, 0.0, lost)

    def _wedges(self, sides: Sequence[Sequence[tuple[int, int]]]) -> list[Piece]:
        facet_of = {edge: facet for facet, edges in enumerate(sides) for edge in edges}
        away: dict[int, list[Vector]] = {}
        found = []
        for (p, q), facet in facet_of.items():
            along = minus(self.corners[q], self.corners[p])
            away.setdefault(p, []).append(along)
            if p < q:
                a = self.corners[p]
                n, m = self.planes[facet][0], self.planes[facet_of[q, p]][0]
                # Seen along the edge the first facet is on the left, so that the wedge is on the right of its normal.
                walls = [cross(n, along), cross(along, m)]
                planes = [(wall, dot(wall, a)) for wall in walls]
                planes += [(along, dot(along, self.corners[q])), (scaled(along, -1), -dot(along, a))]
                tube = Tube(self.placed[p], self.frame.direction(along), rational(self.radius) ** 2)
                ends = doubles([self.placed[p], self.placed[q]])
                found.append(Piece(tube, tuple(self.frame.plane(*plane) for plane in planes), ends, self.radius))
        for corner, directions in away.items():
            planes = [(along, dot(along, self.corners[corner])) for along in directions]
            placed = tuple(self.frame.plane(*plane) for plane in planes)
            found.append(_ball(self.placed[corner], self.radius, placed))
        return found


def _root_below(square: fmpq) -> tuple[fmpq, bool]:
    """The square root, not above and by at most 2^-PRISM of it below; and whether it is exact."""
    p, q = int(square.p), int(square.q)
    shift = max(0, PRISM + (q.bit_length() - p.bit_length()) // 2 + 1)
    scaled_down = (p << 2 * shift) // q
    floor = math.isqrt(scaled_down)
    found = fmpq(floor, 1 << shift)
    return found, found * found == square
