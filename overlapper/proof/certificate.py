"""The certificate of an overlap. It is found in doubles and completed in rational arithmetic, so its check is exact.

The core's answer supplies only combinatorics (the facets, their owners, how they meet) and directions of planes.
Offsets, corners and inner points are computed anew from the shapes. Coordinates are relative to a reference point near
the common part, which keeps the fractions short.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from overlapper import Overlap, Shape
from overlapper.proof.claims import (
    Bounds,
    Bracketed,
    Certificate,
    CertificateError,
    Overlapping,
    OwnedPlane,
    Separated,
    Touching,
    support_above,
    volume_bounds,
)
from overlapper.proof.clipping import BORDER, ClippedPolytope
from overlapper.proof.deepest_ball import DeepestBall, room, supporting
from overlapper.proof.rational_body import RationalBody
from overlapper.rational import Exact, cross, exact, fans, integers, primitive, root, triple

Floats = NDArray[np.float64]

# Bits of a coordinate below the thickness of the common part, and of a share below 1. The second number is for facets
# that differ only by rounding, because the first does not distinguish their corners.
BITS = (64, 256)

# Bits to which a volume with a round body is proved, and bits of the rounded bounds.
NARROW, DIGITS = 49, 52


def certificate(overlap: Overlap) -> Certificate:
    """A proof of the status of `overlap` and of bounds of its volume, which does not rely on the core.

    `verify()` of the result checks it in rational arithmetic, without the core, and returns (lower, upper) bounds of
    the common volume in m³ as fractions. CertificateError says why there is no certificate.
    """
    bodies = [RationalBody(shape) for shape in overlap.shapes]
    match overlap.status:
        case "separated":
            return _separated(overlap, bodies)
        case "touching":
            return _touching(overlap, bodies)
        case _ if all(body.facts.has_blocks for body in bodies) and not _are_flat(bodies):
            return _bracketed(overlap) or between_planes(overlap)
        case _:
            return between_planes(overlap)


# ----------------------------------------------------------------------------------------------- separated and touching


def _separated(overlap: Overlap, bodies: list[RationalBody]) -> Separated:
    planes = _facing(overlap, bodies)
    if not planes or room(planes) >= 0:
        planes = DeepestBall(bodies, planes).without_common_point()
    return Separated(overlap.shapes, tuple(planes))


def _facing(overlap: Overlap, bodies: list[RationalBody]) -> list[OwnedPlane]:
    """The supporting planes of a pair perpendicular to its normal, or to the normal of a half-space."""
    if overlap.normal is None:
        return []
    normal = exact(overlap.normal)
    for body, sign in zip(bodies, (-1, 1)):
        if not body.facts.bounded:
            normal = sign * body.tightest(body.position)
    if any(body.support(sign * normal) is None for body, sign in zip(bodies, (-1, 1))):
        return []
    return [supporting(bodies, -normal, 0), supporting(bodies, normal, 1)]


def _touching(overlap: Overlap, bodies: list[RationalBody]) -> Touching:
    planes = _facing(overlap, bodies)
    if planes and any(body.facts.planes is None for body in bodies):
        point: Exact = (exact(overlap.witness_a) + exact(overlap.witness_b)) / 2
    else:
        ball = DeepestBall(bodies, planes)
        planes, point = ball.settled()
    nearest = np.array([_nearest(body, shape.shape, point) for body, shape in zip(bodies, overlap.shapes)])
    miss = max(root((point - other) @ (point - other))[1] for other in nearest)
    inradius = room(planes) / sum(root(plane.normal @ plane.normal)[room(planes) < 0] for plane in planes)
    return Touching(overlap.shapes, tuple(planes), inradius, point, nearest, miss)


def _nearest(body: RationalBody, shape: Shape, point: Exact) -> Exact:
    """A point of the body near a point just outside, on the line from this point to the middle of the body."""
    if body.contains(point[None])[0]:
        return point
    if not body.facts.bounded:
        normal = body.tightest(point)
        outside = normal @ point - support_above(body, normal)
        foot: Exact = point - normal * (outside / (normal @ normal))
        return foot
    middle = body.position + body.axes @ exact(shape.centroid)
    if not body.contains(middle[None])[0]:
        raise CertificateError("a body has no certificate if it is so thin that its rounded centroid lies outside")
    shares = np.array([Fraction(1, 2**k) for k in range(128)])
    candidates = middle + (1 - shares)[:, None] * (point - middle)
    nearest: Exact = candidates[np.flatnonzero(body.contains(candidates))[-1]]
    return nearest


# ---------------------------------------------------------------------------------------------------------- overlapping


def _bracketed(overlap: Overlap) -> Bracketed | None:
    """Bounds that stay narrow when they are rounded to a few digits; None if no common volume is proved."""
    found: list[Bounds] = []

    def is_narrow(bounds: Bounds) -> bool:
        found.append(bounds)
        return bounds[1] - bounds[0] <= bounds[0] / (1 << NARROW)

    try:
        lower, upper = volume_bounds(overlap.shapes, is_narrow)
    except CertificateError:
        if not found or not found[-1][0]:
            return None
        lower, upper = found[-1]
    if not lower:
        raise CertificateError("the bodies share no volume")
    unit = Fraction(2) ** (lower.numerator.bit_length() - lower.denominator.bit_length() - DIGITS)
    return Bracketed(overlap.shapes, math.floor(lower / unit) * unit, math.ceil(upper / unit) * unit)


def between_planes(overlap: Overlap) -> Overlapping:
    """A proof of bounds of the volume by planes only: exact for polyhedra, but wide for round bodies."""
    bodies = [RationalBody(shape) for shape in overlap.shapes]
    for number, body in enumerate(bodies):
        if not body.facts.has_exits:
            others = bodies[1 - number].facts.name if len(bodies) == 2 else "two bodies or more"
            raise CertificateError(f"{body.facts.name} that overlaps with {others} has no certificate")
    planes = [
        supporting(bodies, bodies[owner].facing(halfspace[:3]), int(owner))
        for halfspace, owner in zip(overlap.halfspaces, overlap.owner)
    ]
    ways = [_common_polytope] if _are_flat(bodies) else [_published_polytope, _common_polytope]
    made = (way(overlap, bodies, planes) for way in ways)
    for found, fine in ((polytope, fine) for polytope in made for fine in BITS):
        bounding, rings, facet, corners, point = found
        thickness = min(float(p.offset - p.normal @ point) / math.sqrt(p.normal @ p.normal) for p in bounding)
        if thickness > 0.0:
            exponent = math.frexp(thickness)[1] - fine
            centre, vertices = _rounded(point, exponent), _rounded(corners, exponent)
            arms, _ = integers(vertices - centre)
            if (triple(*np.moveaxis(arms[fans(rings)], 1, 0)) >= 0).all():
                break
    else:
        raise CertificateError("the facets do not surround a point: the bodies may only touch")
    margin = _margin(bodies, centre, thickness)
    pull = np.minimum.reduce([_pull(body, centre, vertices, fine) for body in bodies]) * Fraction(1, 1 << fine)
    return Overlapping(overlap.shapes, tuple(bounding), vertices, tuple(rings), facet, centre, margin, pull)


def _are_flat(bodies: list[RationalBody]) -> bool:
    return all(body.facts.planes for body in bodies)


class Star(NamedTuple):
    """Polygons around a point: planes, rings of corners, the plane of each ring, the corners, and a point inside."""

    planes: list[OwnedPlane]
    rings: list[NDArray[np.int32]]
    facet: NDArray[np.int32]
    corners: Exact
    middle: Exact


def _published_polytope(overlap: Overlap, bodies: list[RationalBody], planes: list[OwnedPlane]) -> Star:
    """The facets of the overlap, with corners where their exact planes meet. Round bodies have too many to clip.

    The point inside is the centroid. Most corners lie on round parts, so from their mean the vertices would need more
    pull. The core's inner polytope has another point inside. The middles of the edges compensate for this difference.
    """
    rings, corners = _with_middles(overlap.facets, _corners(overlap, planes))
    return _about_middles(planes, rings, corners)._replace(middle=exact(overlap.centroid))


def _with_middles(rings: Sequence[NDArray[np.int32]], corners: Exact) -> tuple[list[NDArray[np.int32]], Exact]:
    """The polygons and their corners, with an added corner in the middle of every edge."""
    edges = [np.sort([ring, np.roll(ring, -1)], axis=0).T for ring in rings]
    ends, place = np.unique(np.vstack(edges), axis=0, return_inverse=True)
    middles = np.split(len(corners) + place.ravel(), np.cumsum([len(ring) for ring in rings])[:-1])
    finer = [np.stack([ring, middle], axis=1).ravel() for ring, middle in zip(rings, middles)]
    return finer, np.vstack([corners, (corners[ends[:, 0]] + corners[ends[:, 1]]) / 2])


def _on_fine_grid(points: Exact) -> tuple[Exact, int, Exact]:
    """(numbers, scale, first): first + numbers / scale is near each of points (n, 3), whose fractions may be long."""
    arms = points - points[0]
    numbers, scale = integers(_rounded(arms, math.frexp(float(abs(arms).max()))[1] - BITS[-1]))
    return numbers, scale, points[0]


def _about_middles(planes: list[OwnedPlane], rings: list[NDArray[np.int32]], corners: Exact) -> Star:
    """Triangles around the middle of every facet. On round bodies, the middle needs less pull than the corners."""
    numbers, scale, first = _on_fine_grid(corners)
    middles = np.array([numbers[ring].sum(axis=0) // len(ring) for ring in rings])
    fan = [(len(corners) + k, ring[i - 1], ring[i]) for k, ring in enumerate(rings) for i in range(len(ring))]
    facet = np.repeat(np.arange(len(middles), dtype=np.int32), [len(ring) for ring in rings])
    numbers = np.vstack([numbers, middles])
    middle = first + numbers.sum(axis=0) * Fraction(1, scale * len(numbers))
    return Star(planes, list(np.array(fan, np.int32)), facet, first + numbers * Fraction(1, scale), middle)


def _common_polytope(overlap: Overlap, bodies: list[RationalBody], planes: list[OwnedPlane]) -> Star:
    """The exact polytope below the planes of the overlap's facets and of all flat sides of the bodies."""
    box = exact(overlap.bounds)
    reference = box.sum(axis=0) / 2
    room = max(box[1] - box[0]) + max(abs(reference)) / 2**40
    polytope = ClippedPolytope(np.array([box[0] - reference - room, box[1] - reference + room]))
    planes = list(planes)
    for label, plane in enumerate(planes):
        polytope.cut(_row_about(reference, plane), label)
    for owner, body in enumerate(bodies):
        if body.facts.planes is None:
            continue
        normals = body.facts.planes.normals @ body.axes.T
        offsets = body.facts.planes.offsets + normals @ body.position
        rows = np.array([_row_about(reference, OwnedPlane(n, d, owner)) for n, d in zip(normals, offsets)], object)
        for missing in np.flatnonzero(polytope.reaches_past(rows)):
            planes.append(supporting(bodies, normals[missing], owner))
            polytope.cut(_row_about(reference, planes[-1]), len(planes) - 1)
    if not polytope.rings:
        raise CertificateError("no point is strictly inside of all bodies: they only touch")
    if BORDER in polytope.labels:
        raise CertificateError("the common part must be bounded by the bodies")
    used = polytope.used()
    number = {point: i for i, point in enumerate(used)}
    corners = np.array([[Fraction(x, point[3]) for x in point[:3]] for point in map(polytope.points.__getitem__, used)])
    planes = [planes[label] for label in polytope.labels]
    rings = [np.array([number[point] for point in ring], np.int32) for ring in polytope.rings]
    if not _are_flat(bodies):
        return _about_middles(planes, rings, corners + reference)
    numbers, scale, first = _on_fine_grid(corners)
    middle = reference + first + numbers.sum(axis=0) * Fraction(1, scale * len(numbers))
    return Star(planes, rings, np.arange(len(rings), dtype=np.int32), corners + reference, middle)


def _row_about(reference: Exact, plane: OwnedPlane) -> tuple[int, ...]:
    return primitive([*plane.normal, plane.normal @ reference - plane.offset])


def _rounded(points: Exact, exponent: int) -> Exact:
    """The points rounded down to multiples of 2^exponent."""
    up, down, unit = max(-exponent, 0), max(exponent, 0), Fraction(2) ** exponent
    rounded: Exact = np.frompyfunc(lambda x: (x.numerator << up) // (x.denominator << down) * unit, 1, 1)(points)
    return rounded


def _corners(overlap: Overlap, planes: Sequence[OwnedPlane]) -> Exact:
    """For each vertex, the point where the planes around it meet, up to rounding; the vertex itself if none."""
    around = defaultdict(list)
    for facet, ring in enumerate(overlap.facets):
        for vertex in ring:
            around[int(vertex)].append(facet)
    middle = overlap.vertices.mean(axis=0)
    reference = exact(middle)
    units = np.array([plane.normal.astype(float) / math.sqrt(plane.normal @ plane.normal) for plane in planes])
    chosen = np.array([_spread(units, around[vertex]) for vertex in range(len(overlap.vertices))])
    rows = np.array([integers([*p.normal, p.offset - p.normal @ reference])[0] for p in planes], object)[chosen]
    (u, v, w), (a, b, c) = np.moveaxis(rows[:, :, :3], 1, 0), rows[:, :, 3].T[:, :, None]
    volume = triple(u, v, w)
    met = volume != 0
    meeting = (a * cross(v, w) + b * cross(w, u) + c * cross(u, v))[met] * np.sign(volume[met])[:, None]
    exponent = math.frexp(float(abs(overlap.vertices - middle).max()))[1] - BITS[-1]
    numbers = (meeting << max(-exponent, 0)) // (abs(volume[met])[:, None] << max(exponent, 0))
    corners: Exact = exact(overlap.vertices)
    corners[met] = reference + numbers * Fraction(2) ** exponent
    return corners


def _spread(units: Floats, facets: list[int]) -> tuple[int, int, int]:
    """Three of the facets whose planes meet at wide angles."""
    if len(facets) == 3:
        return facets[0], facets[1], facets[2]
    first = facets[0]
    across = np.cross(units[first], units[facets])
    second = facets[int((across * across).sum(axis=1).argmax())]
    third = facets[int(abs(units[facets] @ np.cross(units[first], units[second])).argmax())]
    return first, second, third


def _margin(bodies: Sequence[RationalBody], point: Exact, thickness: float) -> Fraction:
    """The radius of a ball about the point that lies in all bodies, found from above and close to the largest."""
    margin = Fraction(thickness)
    for _ in range(64):
        if all(body.contains(point[None], margin)[0] for body in bodies):
            return margin
        margin *= Fraction(7, 8)
    raise CertificateError("no point was found strictly inside of all bodies: they may only touch")


def _pull(body: RationalBody, point: Exact, vertices: Exact, fine: int) -> Exact:
    """For each vertex, the greatest share of the way from a point inside to the vertex that stays in the body."""
    pull = np.full(len(vertices), 1 << fine, object)
    outside = ~body.contains(vertices)
    if outside.any():
        pull[outside] = body.exits(point, vertices[outside] - point, fine)
    return pull
