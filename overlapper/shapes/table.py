"""The table of kinds of shapes, with the class of `Facts` for each."""

from __future__ import annotations

from overlapper._core import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, RoundedHull, Sphere
from overlapper.shapes import Shape
from overlapper.shapes.box import BoxFacts
from overlapper.shapes.capsule import CapsuleFacts
from overlapper.shapes.cylinder import CylinderFacts
from overlapper.shapes.ellipsoid import EllipsoidFacts
from overlapper.shapes.facts import Facts
from overlapper.shapes.half_space import HalfSpaceFacts
from overlapper.shapes.hull import HullFacts
from overlapper.shapes.rounded_hull import RoundedHullFacts
from overlapper.shapes.sphere import SphereFacts

KINDS: dict[type, type[Facts]] = {
    Box: BoxFacts,
    Sphere: SphereFacts,
    Capsule: CapsuleFacts,
    Cylinder: CylinderFacts,
    Ellipsoid: EllipsoidFacts,
    Hull: HullFacts,
    RoundedHull: RoundedHullFacts,
    HalfSpace: HalfSpaceFacts,
}


def facts(shape: Shape) -> Facts:
    """The facts about a shape."""
    return KINDS[type(shape)](shape)
