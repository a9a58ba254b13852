"""The links of a robot's file with their shapes, and the joints that move them.

A `Joint` suffices to place its link without a simulator.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from overlapper import Shape
from overlapper.simulation.model import Array

Kind = Literal["revolute", "prismatic", "spherical", "planar", "held"]


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint moves a link in its parent, or ties a base to the world without moving it.

    At zero, the frame of the joint is at `position` (3,) in m and `orientation` (4,) xyzw in the inertial frame of the
    parent. The `kind` says how it moves. A revolute joint turns it by an angle in rad about the unit `axis` (3,). A
    prismatic joint moves it by a multiple of `axis`. A spherical joint turns it by a quaternion. A "planar" joint,
    which pybullet never moves, and a "held" joint leave it in place. `offset` (3,) leads from the joint's frame to the
    inertial frame of the link, which has the same axes.

    `lower` and `upper` are the limits in rad or m. There are no limits if lower > upper, or for spherical joints.
    """

    name: str
    kind: Kind
    position: Array
    orientation: Array
    axis: Array
    offset: Array
    lower: float
    upper: float


@dataclass(frozen=True, slots=True)
class Mimic:
    """A joint at multiplier * q + offset, where q, in rad or m, is the position of the joint named `leader`."""

    leader: str
    multiplier: float
    offset: float


@dataclass(frozen=True, slots=True)
class TreeLink:
    """A link of the body with number `body`, named as in the file. `parent` is the index of its parent, -1 for a base.

    `skipped` says which of its shapes are not modelled and why; it is "" if all are modelled. `concave` is the number
    of convex parts of its concave meshes. `excess` is the largest relative increase of volume from a mesh to its parts;
    None if no closed mesh is concave.
    """

    body: int
    name: str
    parent: int
    joint: Joint
    skipped: str
    concave: int
    excess: float | None


@dataclass(frozen=True, slots=True)
class LinkShape:
    """A modelled shape of the link with that index, at `position` (3,) and `orientation` (4,) in its inertial frame."""

    link: int
    shape: Shape
    position: Array
    orientation: Array


@dataclass(frozen=True, slots=True)
class KinematicTree:
    """All links of the bodies of a file, parents before their children, and their modelled shapes, link by link.

    `bodies` are the names of the bodies.
    """

    bodies: tuple[str, ...]
    links: tuple[TreeLink, ...]
    shapes: tuple[LinkShape, ...]
