"""The exact polytope that planes leave of a box, with its facets, edges and corners."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from flint import fmpq

from overlapper.proof.clipping import BORDER, ClippedPolytope
from overlapper.proof.pieces import Floats, Plane
from overlapper.proof.vectors import Vector, cross, dot, minus
from overlapper.rational import exact

# The number of planes that cut before the remaining planes are tested again for whether they remove anything.
AT_ONCE = 16


@dataclass(frozen=True)
class Facet:
    plane: Plane
    ring: tuple[int, ...]  # counter-clockwise from outside


@dataclass(frozen=True)
class Polytope:
    corners: list[Vector]
    facets: list[Facet]

    def edges(self) -> list[tuple[int, int, int, int]]:
        """(start, end, the facet on the left seen from outside, the facet on the right) of every edge."""
        left = {(f.ring[i - 1], f.ring[i]): k for k, f in enumerate(self.facets) for i in range(len(f.ring))}
        return [(p, q, facet, left[q, p]) for (p, q), facet in left.items() if p < q]

    def volume(self) -> fmpq:
        """The volume, as a sum of cones over the facets with the apex at the first corner."""
        apex, six = self.corners[0], fmpq(0)
        for facet in self.facets:
            a, *others = (minus(self.corners[p], apex) for p in facet.ring)
            for b, c in pairwise(others):
                six += dot(a, cross(b, c))
        return six / 6


def below(planes: Iterable[Plane], box: Floats) -> Polytope | None:
    """The part of a box (2, 3) below the planes; None if it has no inside."""
    known = list(planes)
    rows = np.array([_row(plane) for plane in known], object).reshape(-1, 4)
    polytope = ClippedPolytope(exact(box))
    left = np.arange(len(known))
    while len(left):
        left = left[polytope.reaches_past(rows[left])]
        for k in left[:AT_ONCE]:
            polytope.cut(tuple(rows[k]), int(k))
            if not polytope.rings:
                return None
        left = left[AT_ONCE:]
    used = polytope.used()
    number = {point: k for k, point in enumerate(used)}
    corners = []
    for x, y, z, w in (polytope.points[point] for point in used):
        corners.append((fmpq(x, w), fmpq(y, w), fmpq(z, w)))
    facets = []
    for ring, label in zip(polytope.rings, polytope.labels):
        corner = tuple(number[point] for point in ring)
        facets.append(Facet(_through([corners[p] for p in corner]) if label == BORDER else known[label], corner))
    return Polytope(corners, facets)


def _through(ring: list[Vector]) -> Plane:
    """The plane of a side of the box, through three corners of a ring on it."""
    for a, b, c in zip(ring, ring[1:], ring[2:]):
        normal = cross(minus(b, a), minus(c, a))
        if any(normal):
            return Plane(normal, dot(normal, a))
    raise AssertionError("a facet has an area")


def _row(plane: Plane) -> tuple[int, ...]:
    numbers = (*plane.normal, -plane.offset)
    scale = math.lcm(*(int(x.q) for x in numbers))
    row = [int(x.p) * (scale // int(x.q)) for x in numbers]
    divisor = math.gcd(*row)
    return tuple(x // divisor for x in row)
