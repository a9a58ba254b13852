"""Boxes."""

from __future__ import annotations

from fractions import Fraction
from functools import cached_property
from itertools import product as combinations

import numpy as np

from overlapper._core import Box
from overlapper.rational import Exact, exact
from overlapper.shapes.choices import Flat
from overlapper.shapes.drawing import Facets, Tessellation, polyhedron, side_of_polyhedron
from overlapper.shapes.facts import Block, FclModel, Floats
from overlapper.shapes.planes import AXES, Planes
from overlapper.shapes.words import times

CORNERS = np.array([*combinations((-1, 1), repeat=3)])
RINGS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
FACETS = [*np.array(RINGS)]


class BoxFacts(Flat):
    name = "a box"
    bounded = True
    bullet_margin = False

    def __init__(self, shape: Box) -> None:
        self.shape = shape

    def parameters(self) -> list[float | Floats]:
        return [self.shape.half_extents]

    def words(self) -> tuple[str, str, int]:
        return "box", times(2 * self.shape.half_extents), 0

    def _surface(self) -> tuple[Floats, Facets]:
        return CORNERS * self.shape.half_extents, FACETS

    def tessellation(self) -> Tessellation:
        return polyhedron(*self._surface())

    def side(self, towards: Floats) -> tuple[Floats, float, Floats]:
        return side_of_polyhedron(*self._surface(), towards)

    def ball(self) -> tuple[Floats, float]:
        return np.zeros(3), float(np.linalg.norm(self.shape.half_extents))

    def fcl(self) -> FclModel:
        return "Box", tuple(2.0 * self.shape.half_extents)

    def core_tip(self, direction: Floats) -> Floats:
        return np.asarray(np.copysign(self.shape.half_extents, direction))

    @cached_property
    def planes(self) -> Planes:
        return Planes.of(np.vstack([AXES, -AXES]), exact(np.tile(self.shape.half_extents, 2)))

    def support(self, direction: Exact, scale: int) -> tuple[Fraction, Fraction]:
        return exact(self.shape.half_extents) @ abs(direction) / scale, Fraction(0)

    def blocks(self) -> list[Block]:
        half = exact(self.shape.half_extents)
        planes = [(side * AXES[k], half[k]) for k in range(3) for side in (-1, 1)]
        return [Block(planes, CORNERS.astype(object) * half)]
