"""A simulator's bodies as they are modelled: convex shapes in the frames of their links, and what is left out."""

from __future__ import annotations

from collections.abc import Mapping
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

    `body` and `link` are pybullet's indices: link -1 is the base, body -1 one to which pybullet gives no id. `name` is
    what the link is called, `reason` one sentence. `diverged` is True of a body that has no finite pose.
    """

    body: int
    link: int
    name: str
    reason: str
    diverged: bool = False


@dataclass(frozen=True, slots=True)
class Decomposed:
    """A concave mesh of one link, modelled as the union of convex parts: the shapes `shapes` of it.

    `body` and `link` are pybullet's indices, link -1 is the base; `name` is what the link is called.
    `volume` (m³) is that of the parts together, `mesh_volume` what the mesh bounds; None where its surface is open or
    turns both ways. `path` is where the parts are kept on disk, None if the mesh had them already and they are exact.
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
    """One shape of a collider as a simulator has it, compounds resolved; lengths in metres.

    `position` (3,) and `orientation` (4,) xyzw place it in the collider's frame, the inertial frame of its link.
    What `figures` holds depends on `kind`:
        box          (3,) half extents
        sphere       (1,) radius
        capsule      (2,) radius, length between the cap centres along local z
        cylinder     (2,) radius, length along local z
        plane        (4,) unit normal n and constant c of the solid n·x <= c
        hull         (n, 3) points
        concave mesh (t, 3, 3) corners of the triangles
        multisphere  (n, 4) centres and radii of the spheres whose convex hull it is
    and is empty for every other kind ("height field", "capsule along x", ...). `margin` is the collision margin that
    the simulator lays around a hull.
    """

    kind: str
    position: Array
    orientation: Array
    figures: Array
    margin: float = 0.0


@dataclass(frozen=True, slots=True)
class ModelledShape:
    """A modelled shape, placed in the frame of its collider: the inertial frame of the base or link."""

    link: int
    index: int
    shape: Shape
    position: Array
    orientation: Array


@dataclass(frozen=True, slots=True)
class Ground:
    """A height field, placed in the frame of its collider."""

    field: HeightField
    position: Array
    orientation: Array

    def prism(self, number: int) -> ModelledShape:
        return ModelledShape(BASE, number, self.field.prism(number), self.position, self.orientation)


@dataclass(frozen=True, slots=True)
class ModelledBody:
    """A body: `link_names`, `colors` and `parents` by link, and how many shapes it has, modelled or not.

    If it is a height field, its `ground`, `shapes` are the prisms of it that are modelled so far.
    """

    name: str
    link_names: Mapping[int, str]
    colors: Mapping[int, Color]
    parents: Mapping[int, int]
    shape_count: int
    shapes: tuple[ModelledShape, ...]
    skipped: tuple[Skipped, ...] = ()
    decomposed: tuple[Decomposed, ...] = ()
    ground: Ground | None = None
