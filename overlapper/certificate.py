"""The certificate of an overlap: found in doubles, completed in rational arithmetic, so that its check is exact.

Of the core's answer only the combinatorics are used (which facets there are, whose they are, where they meet) and
directions of planes; offsets, corners and inner points are computed anew from the shapes. Coordinates are counted from
a reference near the common part, which keeps the fractions short.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from overlapper import Box, Capsule, Cylinder, HalfSpace, Hull, Overlap, Shape, Sphere
from overlapper.claims import (
    AXES,
    Certificate,
    CertificateError,
    Overlapping,
    OwnedPlane,
    Separated,
    Touching,
    support_above,
)
from overlapper.clipping import BORDER, ClippedPolytope
from overlapper.rational import Exact, RationalBody, cross, exact, fans, primitive, root, triple

Floats = NDArray[np.float64]

# Kelley's method on round bodies has no end.
ROUNDS = 200

# Bits of a coordinate below the thickness of the common part, and of a share below 1. Facets of hulls that differ only
# by rounding meet in corners that the first number cannot tell apart.
BITS = (64, 256)


def certificate(overlap: Overlap) -> Certificate:
    """What proves the status of `overlap`, and bounds of its volume, to somebody who does not trust us.

    `verify()` of the result checks it in rational arithmetic, without the core, and returns (lower, upper) bounds of
    the common volume in m³ as fractions. CertificateError says why there is no certificate.
    """
    bodies = [RationalBody(shape) for shape in overlap.shapes]
    match overlap.status:
        case "separated":
            return _separated(overlap, bodies)
        case "touching":
            return _touching(overlap, bodies)
        case _:
            return _overlapping(overlap, bodies)


def _supporting(bodies: Sequence[RationalBody], normal: Exact, owner: int) -> OwnedPlane:
    return OwnedPlane(normal, support_above(bodies[owner], normal), owner)


def _room(planes: Sequence[OwnedPlane]) -> Fraction:
    return sum((plane.offset for plane in planes), Fraction(0))


# ----------------------------------------------------------------------------------------------- separated and touching


def _separated(overlap: Overlap, bodies: list[RationalBody]) -> Separated:
    planes = _facing(overlap, bodies)
    if not planes or _room(planes) >= 0:
        planes = DeepestBall(bodies, planes).without_common_point()
    return Separated(overlap.shapes, tuple(planes))


def _facing(overlap: Overlap, bodies: list[RationalBody]) -> list[OwnedPlane]:
    """The supporting planes of a pair across its normal; of a half-space there is only one."""
    if overlap.normal is None:
        return []
    normal = exact(overlap.normal)
    for body, sign in zip(bodies, (-1, 1)):
        if isinstance(body.shape, HalfSpace):
            normal = sign * (body.axes @ exact(body.shape.given_normal))
    if any(body.support(sign * normal) is None for body, sign in zip(bodies, (-1, 1))):
        return []
    return [_supporting(bodies, -normal, 0), _supporting(bodies, normal, 1)]


def _touching(overlap: Overlap, bodies: list[RationalBody]) -> Touching:
    planes = _facing(overlap, bodies)
    if planes and any(isinstance(body.shape, Sphere | Capsule | Cylinder) for body in bodies):
        point: Exact = (exact(overlap.witness_a) + exact(overlap.witness_b)) / 2
    else:
        ball = DeepestBall(bodies, planes)
        planes, point = ball.settled()
    nearest = np.array([_nearest(body, point) for body in bodies])
    miss = max(root((point - other) @ (point - other))[1] for other in nearest)
    inradius = _room(planes) / sum(root(plane.normal @ plane.normal)[_room(planes) < 0] for plane in planes)
    return Touching(overlap.shapes, tuple(planes), inradius, point, nearest, miss)


def _nearest(body: RationalBody, point: Exact) -> Exact:
    """A point of the body, next to a point that is next to it: on the way to the middle of the body."""
    if body.contains(point[None])[0]:
        return point
    if isinstance(body.shape, HalfSpace):
        normal = body.axes @ exact(body.shape.given_normal)
        outside = normal @ point - support_above(body, normal)
        foot: Exact = point - normal * (outside / (normal @ normal))
        return foot
    middle = body.position + body.axes @ exact(body.shape.centroid)
    if not body.contains(middle[None])[0]:
        raise CertificateError("a body too thin for its centroid to lie in it has no certificate")
    shares = np.array([Fraction(1, 2**k) for k in range(128)])
    candidates = middle + (1 - shares)[:, None] * (point - middle)
    nearest: Exact = candidates[np.flatnonzero(body.contains(candidates))[-1]]
    return nearest


class DeepestBall:
    """The largest ball in the common part, by cutting planes in rational arithmetic (see common_point.h of the core).

    The linear programme is: the largest r with normal . x + length r <= offset for all supporting planes, `length`
    being that of the normal to rounding. Its dual weighs four planes so that the weighted normals add up to zero.
    """

    def __init__(self, bodies: list[RationalBody], hints: Sequence[OwnedPlane] = ()) -> None:
        self.bodies = bodies
        self.known = [BodyPlanes(body) for body in bodies]
        self.basis = self._simplex()
        self.weights = self._solve(np.array([self._row(plane) for plane in self.basis]).T, [0, 0, 0, 1])
        for plane in hints:
            self.exchange(plane)

    def without_common_point(self) -> list[OwnedPlane]:
        """Weighted planes whose normals add up to zero, and whose offsets to less."""
        for _ in range(ROUNDS):
            planes = self.weighted()
            if _room(planes) < 0:
                break
            centre, radius = self.ball()
            if not self.exchange(self.tightest(centre, radius)):
                break
        if _room(planes) >= 0 or any(plane.owner < 0 for plane in planes):
            raise CertificateError("no planes were found that prove the bodies apart: they may have a common point")
        return planes

    def settled(self) -> tuple[list[OwnedPlane], Exact]:
        """Weighted planes that leave the least room, and the centre of the ball between them."""
        for _ in range(ROUNDS):
            centre, radius = self.ball()
            if not self.exchange(self.tightest(centre, radius)):
                break
        planes = self.weighted()
        if any(plane.owner < 0 for plane in planes):
            raise CertificateError("no planes were found between which the common part is closed")
        return planes, centre

    def weighted(self) -> list[OwnedPlane]:
        return [OwnedPlane(w * p.normal, w * p.offset, p.owner) for w, p in zip(self.weights, self.basis) if w > 0]

    def ball(self) -> tuple[Exact, Fraction]:
        rows = np.array([self._row(plane) for plane in self.basis])
        *centre, radius = self._solve(rows, [plane.offset for plane in self.basis])
        return np.array(centre), radius

    def tightest(self, centre: Exact, radius: Fraction) -> OwnedPlane | None:
        """The plane that the ball reaches through farthest; None if it is inside of all."""
        found, farthest = None, Fraction(0)
        for owner, known in enumerate(self.known):
            plane = _supporting(self.bodies, known.tightest(centre), owner)
            length = self._row(plane)[3]
            outside = (plane.normal @ centre + length * radius - plane.offset) / length
            if outside > farthest:
                found, farthest = plane, outside
        return found

    def exchange(self, entering: OwnedPlane | None) -> bool:
        """Takes a plane into the basis for the one that keeps all weights from getting negative."""
        if entering is None:
            return False
        share = self._solve(np.array([self._row(plane) for plane in self.basis]).T, self._row(entering))
        ratios = [(weight / s, i) for i, (weight, s) in enumerate(zip(self.weights, share)) if s > 0]
        if not ratios:
            return False
        ratio, leaving = min(ratios)
        self.weights = self.weights - ratio * share
        self.weights[leaving] = ratio
        self.basis[leaving] = entering
        return True

    @staticmethod
    def _row(plane: OwnedPlane) -> Exact:
        return np.array([*plane.normal, Fraction(math.sqrt(plane.normal @ plane.normal))])

    def _simplex(self) -> list[OwnedPlane]:
        """Around one of the bodies, or around everything if none is bounded: then owned by nobody."""
        directions = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) * Fraction(1)
        for owner, body in enumerate(self.bodies):
            if not isinstance(body.shape, HalfSpace):
                return [_supporting(self.bodies, direction, owner) for direction in directions]
        reach = max(abs(x) for body, known in zip(self.bodies, self.known) for x in [*body.position, *known.levels])
        return [OwnedPlane(direction, Fraction(2**20 * (1 + reach)), -1) for direction in directions]

    @staticmethod
    def _solve(matrix: Exact, right: Iterable[Fraction | int]) -> Exact:
        """Gaussian elimination."""
        rows: Exact = np.column_stack([matrix, np.array([*right], object)]) * Fraction(1)
        size = len(rows)
        for k in range(size):
            pivot = k + int(np.argmax(rows[k:, k] != 0))
            rows[[k, pivot]] = rows[[pivot, k]]
            rows[k] = rows[k] / rows[k, k]
            others = np.arange(size) != k
            rows[others] = rows[others] - rows[others, k, None] * rows[k]
        return rows[:, -1]


class BodyPlanes:
    """Directions of the planes of a body in its own frame; exact for flat facets, which round bodies do not have."""

    def __init__(self, body: RationalBody) -> None:
        self.body = body
        self.normals, self.offsets = self._facets()
        lengths = np.array([math.sqrt(normal @ normal) for normal in self.normals])
        self.units = np.array([normal.astype(float) / length for normal, length in zip(self.normals, lengths)])
        self.levels = self.offsets.astype(float) / lengths

    def _facets(self) -> tuple[Exact, Exact]:
        match self.body.shape:
            case Box() as box:
                return np.vstack([AXES, -AXES]), exact(np.tile(box.half_extents, 2))
            case Hull():
                normals, offsets = self.body.facets
                # Integers of any size, brought to where doubles do not overflow.
                scale = np.array([Fraction(1, 2 ** max(map(int.bit_length, normal))) for normal in normals])
                return normals * scale[:, None], offsets * scale
            case HalfSpace() as half:
                return exact(half.given_normal)[None], exact([half.given_offset])
            case _:
                return np.empty((0, 3), object), np.empty(0, object)

    @property
    def flat(self) -> bool:
        return len(self.normals) > 0

    def along(self, normal: Floats) -> Exact:
        """The normal in the world of the flat facet whose normal is meant; the same normal on a round body."""
        if not self.flat:
            same: Exact = exact(normal)
            return same
        local = self.body.axes.astype(float).T @ normal
        direction: Exact = self.body.axes @ self.normals[np.linalg.norm(self.units - local, axis=1).argmin()]
        return direction

    def tightest(self, point: Exact) -> Exact:
        """The normal in the world of the plane of the body that a point in the world is farthest above."""
        local = (point - self.body.position) @ self.body.axes
        if self.flat:
            direction: Exact = self.normals[self._tightest_facet(local)]
        else:
            direction = exact(_round_normal(self.body.shape, local.astype(float)))
        normal: Exact = self.body.axes @ direction
        return normal

    def _tightest_facet(self, local: Exact) -> int:
        """Doubles leave a few facets to choose from, fractions choose."""
        x = local.astype(float)
        above = self.units @ x - self.levels
        few = np.flatnonzero(above >= above.max() - 1e-12 * (abs(x).sum() + abs(self.levels).max()))
        exactly = (self.normals[few] @ local - self.offsets[few]).astype(float)
        lengths = np.linalg.norm(self.normals[few].astype(float), axis=1)
        return int(few[(exactly / lengths).argmax()])


def _round_normal(shape: Shape, point: Floats) -> Floats:
    """The outward normal of the plane of a sphere, capsule or cylinder that the point is farthest above."""
    x, y, z = point
    if isinstance(shape, Cylinder) and abs(z) - shape.length / 2 >= math.hypot(x, y) - shape.radius:
        return np.array([0.0, 0.0, math.copysign(1.0, z)])
    if isinstance(shape, Capsule | Cylinder):
        z -= max(-shape.length / 2, min(z, shape.length / 2))
    outward = np.array([x, y, 0.0 if isinstance(shape, Cylinder) else z])
    return outward if outward.any() else np.array([1.0, 0.0, 0.0])


# ---------------------------------------------------------------------------------------------------------- overlapping


def _overlapping(overlap: Overlap, bodies: list[RationalBody]) -> Overlapping:
    known = [BodyPlanes(body) for body in bodies]
    planes = [
        _supporting(bodies, known[owner].along(halfspace[:3]), int(owner))
        for halfspace, owner in zip(overlap.halfspaces, overlap.owner)
    ]
    surfaces = [_common_polytope] if all(body.flat for body in known) else [_published_surface, _common_polytope]
    for surface, bits in product(surfaces, BITS):
        bounding, rings, facet, corners = surface(overlap, known, planes)
        point = _mean(corners)
        thickness = min(float(p.offset - p.normal @ point) / math.sqrt(p.normal @ p.normal) for p in bounding)
        if thickness > 0.0:
            grid = Fraction(2) ** (math.frexp(thickness)[1] - bits)
            centre, vertices = _rounded(point, grid), _rounded(corners, grid)
            if (triple(*np.moveaxis((vertices - centre)[fans(rings)], 1, 0)) >= 0).all():
                break
    else:
        raise CertificateError("the facets do not surround a point: the bodies may only touch")
    margin = _margin(bodies, centre, thickness)
    pull = np.minimum.reduce([_pull(body, centre, vertices, bits) for body in known])
    return Overlapping(overlap.shapes, tuple(bounding), vertices, tuple(rings), facet, centre, margin, pull)


class Surface(NamedTuple):
    """Planes, polygons of corners, the number of each polygon's plane, corners."""

    planes: list[OwnedPlane]
    rings: list[NDArray[np.int32]]
    facet: NDArray[np.int32]
    corners: Exact


def _published_surface(overlap: Overlap, known: list[BodyPlanes], planes: list[OwnedPlane]) -> Surface:
    """The facets of the overlap, where their exact planes meet: of round bodies there are too many to clip."""
    return _about_middles(planes, overlap.facets, _corners(overlap, planes))


def _mean(points: Exact) -> Exact:
    """Next to the mean of points (n, 3) whose coordinates may have long denominators."""
    size = float(abs(points - points[0]).max())
    mean: Exact = points[0] + _rounded(points - points[0], Fraction(2) ** (math.frexp(size)[1] - BITS[-1])).mean(axis=0)
    return mean


def _about_middles(planes: list[OwnedPlane], rings: list[NDArray[np.int32]], corners: Exact) -> Surface:
    """Triangles about the middle of every facet, which on round bodies needs less pull than the corners."""
    middles = np.array([_mean(corners[ring]) for ring in rings])
    fan = [(len(corners) + k, ring[i - 1], ring[i]) for k, ring in enumerate(rings) for i in range(len(ring))]
    facet = np.repeat(np.arange(len(middles), dtype=np.int32), [len(ring) for ring in rings])
    return Surface(planes, list(np.array(fan, np.int32)), facet, np.vstack([corners, middles]))


def _common_polytope(overlap: Overlap, known: list[BodyPlanes], planes: list[OwnedPlane]) -> Surface:
    """What is below the planes of the overlap's facets and of all flat facets of the bodies, without rounding."""
    box = exact(overlap.bounds)
    reference = box.sum(axis=0) / 2
    room = max(box[1] - box[0]) + max(abs(reference)) / 2**40
    polytope = ClippedPolytope(np.array([box[0] - reference - room, box[1] - reference + room]))
    planes = list(planes)
    for label, plane in enumerate(planes):
        polytope.cut(_row_about(reference, plane), label)
    for owner, body in ((i, body) for i, body in enumerate(known) if body.flat):
        normals = body.normals @ body.body.axes.T
        offsets = body.offsets + normals @ body.body.position
        rows = np.array([_row_about(reference, OwnedPlane(n, d, owner)) for n, d in zip(normals, offsets)], object)
        for missing in np.flatnonzero(polytope.reaches_past(rows)):
            planes.append(_supporting([body.body for body in known], normals[missing], owner))
            polytope.cut(_row_about(reference, planes[-1]), len(planes) - 1)
    if not polytope.rings:
        raise CertificateError("no point is strictly inside of all bodies: they only touch")
    if BORDER in polytope.labels:
        raise CertificateError("the common part must be bounded by the bodies")
    used = polytope.used()
    number = {point: i for i, point in enumerate(used)}
    corners = np.array([[Fraction(x, point[3]) for x in point[:3]] for point in map(polytope.points.__getitem__, used)])
    surface = Surface(
        [planes[label] for label in polytope.labels],
        [np.array([number[point] for point in ring], np.int32) for ring in polytope.rings],
        np.arange(len(polytope.rings), dtype=np.int32),
        corners + reference,
    )
    if all(body.flat for body in known):
        return surface
    return _about_middles(surface.planes, surface.rings, surface.corners)


def _row_about(reference: Exact, plane: OwnedPlane) -> tuple[int, ...]:
    return primitive([*plane.normal, plane.normal @ reference - plane.offset])


def _rounded(points: Exact, grid: Fraction) -> Exact:
    rounded: Exact = np.frompyfunc(lambda x: round(x / grid) * grid, 1, 1)(points)
    return rounded


def _corners(overlap: Overlap, planes: Sequence[OwnedPlane]) -> Exact:
    """Where the planes of the facets around each vertex meet; the vertex itself where none of them do."""
    around = defaultdict(list)
    for facet, ring in enumerate(overlap.facets):
        for vertex in ring:
            around[int(vertex)].append(facet)
    reference = exact(overlap.vertices.mean(axis=0))
    offsets = [plane.offset - plane.normal @ reference for plane in planes]
    units = np.array([plane.normal.astype(float) / math.sqrt(plane.normal @ plane.normal) for plane in planes])
    corners: Exact = exact(overlap.vertices)
    for vertex, facets in around.items():
        i, j, k = _spread(units, facets)
        u, v, w = planes[i].normal, planes[j].normal, planes[k].normal
        volume = triple(u, v, w)
        if volume != 0:
            meeting = offsets[i] * cross(v, w) + offsets[j] * cross(w, u) + offsets[k] * cross(u, v)
            corners[vertex] = reference + meeting / volume
    return corners


def _spread(units: Floats, facets: list[int]) -> tuple[int, int, int]:
    """Three of the facets whose planes meet at wide angles."""
    first = facets[0]
    across = np.cross(units[first], units[facets])
    second = facets[int((across * across).sum(axis=1).argmax())]
    third = facets[int(abs(units[facets] @ np.cross(units[first], units[second])).argmax())]
    return first, second, third


def _margin(bodies: Sequence[RationalBody], point: Exact, thickness: float) -> Fraction:
    """The radius of a ball about the point that lies in all bodies: next to the largest, from above."""
    margin = Fraction(thickness)
    for _ in range(64):
        if all(body.contains(point[None], margin)[0] for body in bodies):
            return margin
        margin *= Fraction(7, 8)
    raise CertificateError("no point was found strictly inside of all bodies: they may only touch")


def _pull(known: BodyPlanes, point: Exact, vertices: Exact, bits: int) -> Exact:
    """For each vertex the greatest share of the way to it, from a point inside, that does not leave the body."""
    body = known.body
    pull = np.full(len(vertices), Fraction(1))
    start = (point - body.position) @ body.axes
    for vertex in np.flatnonzero(~body.contains(vertices)):
        share = _exit(known, start, (vertices[vertex] - point) @ body.axes)
        pull[vertex] = Fraction(math.floor(share * 2**bits), 2**bits)
    return pull


def _exit(known: BodyPlanes, start: Exact, arm: Exact) -> Fraction:
    """Where the ray start + share * arm, in the body's frame, leaves the body: exact, or below by 1e-19 of it."""
    match known.body.shape:
        case Sphere() as ball:
            return _exit_of_ball(start, arm, ball.radius)
        case Capsule() as capsule:
            half = Fraction(capsule.length) / 2
            past = arm[2]
            if any(arm[:2]):
                side = _exit_of_ball(start[:2], arm[:2], capsule.radius)
                past = start[2] + side * arm[2]
                if abs(past) <= half:
                    return side
            end = np.array([0, 0, half if past > 0 else -half])
            return _exit_of_ball(start - end, arm, capsule.radius)
        case Cylinder() as cylinder:
            half = Fraction(cylinder.length) / 2
            exits = [(half - start[2] * sign) / abs(arm[2]) for sign in [1 if arm[2] > 0 else -1] if arm[2]]
            if any(arm[:2]):
                exits.append(_exit_of_ball(start[:2], arm[:2], cylinder.radius))
            return Fraction(min(exits))
        case _:
            slack, along = known.offsets - known.normals @ start, known.normals @ arm
            return Fraction(min(s / a for s, a in zip(slack, along) if a > 0))


def _exit_of_ball(start: Exact, arm: Exact, radius: float) -> Fraction:
    """The greater share at which |start + share * arm| is the radius, in two or three dimensions.

    Of the two usual forms the one that does not cancel.
    """
    inside, along, square = Fraction(radius) ** 2 - start @ start, start @ arm, arm @ arm
    lower, upper = root(along * along + square * inside)
    return Fraction(inside / (along + upper) if along > 0 else (lower - along) / square)
