"""The modelled bodies of a simulator: convex shapes in the frames of their links, and the shapes left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from overlapper import Shape
from overlapper.simulation.height_field import HeightField

Array = NDArray[np.float64]
Color = tuple[float, float, float, float]

LinkKey = tuple[int, int]
"""Body and link as numbers, -1 for the base."""

BASE = -1


@dataclass(frozen=True, slots=True)
class Skipped:
    """Shapes of one link that are not modelled, and why.

    Parameters
    ----------
    body : int
        Number of the body, -1 for a body to which pybullet gives no id.
    link : int
        Number of the link, -1 for the base.
    name : str
        Name of the link.
    reason : str
        One sentence.
    diverged : bool, default False
        True if the body has no finite pose.
    """

    body: int
    link: int
    name: str
    reason: str
    diverged: bool = False


@dataclass(frozen=True, slots=True)
class Decomposed:
    """A concave mesh of one link, modelled as the union of convex parts.

    Parameters
    ----------
    body : int
        Number of the body.
    link : int
        Number of the link, -1 for the base.
    name : str
        Name of the link.
    shapes : range
        Indices of the parts among the shapes of the link.
    volume : float
        Volume of all parts, m³.
    mesh_volume : float or None
        Volume that the mesh bounds, m³. None if its surface is open or turns both ways.
    path : Path or None
        File of the parts. None if the mesh consisted of convex parts already and they are exact.
    """

    body: int
    link: int
    name: str
    shapes: range
    volume: float
    mesh_volume: float | None
    path: Path | None


@dataclass(frozen=True, slots=True, eq=False)
class Leaf:
    """One shape of a collider in a simulator, with compounds resolved. Lengths are in metres.

    `position` (3,) and `orientation` (4,) xyzw place it in the collider's frame, the inertial frame of its link.
    The content of `figures` depends on `kind`:
        box          (3,) half extents
        sphere       (1,) radius
        capsule      (2,) radius, length between the cap centres along local z
        cylinder     (2,) radius, length along local z
        plane        (4,) unit normal n and constant c of the solid n·x <= c
        hull         (n, 3) points
        concave mesh (t, 3, 3) corners of the triangles
        multisphere  (n, 4) centres and radii of the spheres whose convex hull it is
    `figures` is empty for every other kind ("height field", "capsule along x", ...). `margin` is the collision margin
    that the simulator lays around a hull.
    """

    kind: str
    position: Array
    orientation: Array
    figures: Array
    margin: float = 0.0


@dataclass(frozen=True, slots=True)
class ModelledShape:
    """A modelled shape, placed in the frame of its collider: the inertial frame of the base or link.

    `top` (3,) is the unit normal of the only face that others can press, in the frame of the shape, and 0 if all faces
    are free.
    """

    link: int
    index: int
    shape: Shape
    position: Array
    orientation: Array
    top: Sequence[float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Ground:
    """A height field of a link, placed in the frame of its collider."""

    link: int
    field: HeightField
    position: Array
    orientation: Array

    def prism(self, number: int) -> ModelledShape:
        shape, top = self.field.prism(number), self.field.top(number)
        return ModelledShape(self.link, number, shape, self.position, self.orientation, top)


@dataclass(frozen=True, slots=True)
class ModelledBody:
    """A body: `link_names`, `colors` and `parents` by link. `shape_count` is its number of shapes, modelled or not.

    `look` has colour and size in words, for a body that is named after its kind of shape. `grounds` are its height
    fields. The shapes of their links are the prisms of the ground that are modelled so far.
    """

    name: str
    link_names: Mapping[int, str]
    colors: Mapping[int, Color]
    parents: Mapping[int, int]
    shape_count: int
    shapes: tuple[ModelledShape, ...]
    skipped: tuple[Skipped, ...] = ()
    decomposed: tuple[Decomposed, ...] = ()
    grounds: tuple[Ground, ...] = ()
    look: tuple[str, str] = ("", "")
