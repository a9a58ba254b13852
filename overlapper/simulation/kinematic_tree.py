"""The links of a robot's file with their shapes, and the joints that move them.

A `Joint` is enough to place its link without a simulator.
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

    The joint's frame, at zero, is at `position` (3,) in m and `orientation` (4,) xyzw of the inertial frame of the
    parent. A revolute joint turns it by an angle in rad about `axis` (3,), which is unit. A prismatic one moves it by
    so many times `axis`. A spherical one turns it by a quaternion. A planar one, which pybullet never moves, and what
    is "held" stay as they are. `offset` (3,) leads from there to the inertial frame of the link, which has the same
    axes.

    `lower` and `upper` are the limits in rad or m; there are none if lower > upper, and of spherical joints.
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
    """A joint that stands at multiplier * q + offset where q, in rad or m, is that of the joint called `leader`."""

    leader: str
    multiplier: float
    offset: float


@dataclass(frozen=True, slots=True)
class TreeLink:
    """A link of the body of that number, named as in the file; `parent` is its place among the links, -1 of a base.

    `skipped` says what of its shapes is not modelled and why, "" if all are. `concave` is the number of convex parts of
    its concave meshes. `excess` is the fraction by which parts have more volume than their mesh, of the mesh that gains
    most; None if no closed mesh is concave.
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
    """A modelled shape of the link in that place, at `position` (3,) and `orientation` (4,) of its inertial frame."""

    link: int
    shape: Shape
    position: Array
    orientation: Array


@dataclass(frozen=True, slots=True)
class KinematicTree:
    """All links of the bodies of a file, parents before their children, and what is modelled of them, link by link.

    `bodies` are the names of the bodies.
    """

    bodies: tuple[str, ...]
    links: tuple[TreeLink, ...]
    shapes: tuple[LinkShape, ...]
