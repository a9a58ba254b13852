"""The planes of one placed body, to search among: flat facets exactly, and tangent planes of round bodies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from overlapper import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, RoundedHull, Shape
from overlapper.proof.claims import AXES, OwnedPlane, support_above
from overlapper.proof.rational import Exact, RationalBody, exact, integers

Floats = NDArray[np.float64]

TINY = np.finfo(float).tiny


def supporting(bodies: Sequence[RationalBody], normal: Exact, owner: int) -> OwnedPlane:
    return OwnedPlane(normal, support_above(bodies[owner], normal), owner)


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

    @cached_property
    def rows(self) -> Exact:
        """Of flat facets: integers (k, 4), normals and offsets."""
        return np.array([integers([*normal, offset])[0] for normal, offset in zip(self.normals, self.offsets)], object)

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
            direction = exact(self._round_normal(local.astype(float)))
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

    def _round_normal(self, point: Floats) -> Floats:
        if not isinstance(self.body.shape, RoundedHull):
            return _round_normal(self.body.shape, point)
        halfspaces = self.body.hull.halfspaces
        above = halfspaces[:, :3] @ point + halfspaces[:, 3]
        if above.max() > 0.0:
            outward: Floats = point - self.body.next_on_core(point).astype(float)
            if outward.any():
                return outward
        return np.asarray(halfspaces[above.argmax(), :3])


def _round_normal(shape: Shape, point: Floats) -> Floats:
    """The outward normal of the plane of a sphere, capsule or cylinder that the point is farthest above; of an
    ellipsoid that of the smaller or larger one through the point."""
    if isinstance(shape, Ellipsoid):
        point = point / shape.half_axes**2
        point = point / max(abs(point).max(), TINY)
    x, y, z = point
    if isinstance(shape, Cylinder) and abs(z) - shape.length / 2 >= math.hypot(x, y) - shape.radius:
        return np.array([0.0, 0.0, math.copysign(1.0, z)])
    if isinstance(shape, Capsule | Cylinder):
        z -= max(-shape.length / 2, min(z, shape.length / 2))
    outward = np.array([x, y, 0.0 if isinstance(shape, Cylinder) else z])
    return outward if outward.any() else np.array([1.0, 0.0, 0.0])
