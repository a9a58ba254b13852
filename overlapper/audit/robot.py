"""A robot: its kinematic tree, and which of its joints can be moved at will and how far."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Generator, Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from overlapper.jobs.confined import MEGABYTES, SECONDS, Confined, Unanswered
from overlapper.printable import first_line
from overlapper.simulation.bullet.joints import ENDINGS, kinematic_tree
from overlapper.simulation.bullet.model_file import NotRead, read_apart
from overlapper.simulation.bullet.model_text import root_of
from overlapper.simulation.kinematic_tree import KinematicTree, Mimic
from overlapper.simulation.settings import Modelling

TURN = ("x", "y", "z", "w")  # of a spherical joint


@dataclass(frozen=True, slots=True)
class Degree:
    """A joint that is moved at will: that of the link in that place, by the number in column `column`.

    It goes from `lower` to `upper`, in rad or m, or, if it is "endless", once around. A "spherical" one has four
    columns, a unit quaternion xyzw.
    """

    link: int
    name: str
    column: int
    range: Literal["limited", "endless", "spherical"]
    lower: float
    upper: float

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of its columns."""
        return tuple(f"{self.name}.{each}" for each in TURN) if self.range == "spherical" else (self.name,)


@dataclass(frozen=True)
class Robot:
    """Links, shapes and joints as pybullet has read them; `mimics` has, by name, the joints that follow others.

    `name` is that of the robot in the file, or else of its first body. `notes` are sentences on what of the file is not
    read.
    """

    name: str
    tree: KinematicTree
    mimics: Mapping[str, Mimic]
    notes: tuple[str, ...] = ()

    @cached_property
    def link_names(self) -> tuple[str, ...]:
        """A distinct name for each link: after its body if there are several, and with its place if two are equal."""
        links = self.tree.links
        names = [
            f"{self.tree.bodies[link.body]}/{link.name}" * (len(self.tree.bodies) > 1) or link.name for link in links
        ]
        return tuple(name if names.count(name) == 1 else f"{name}#{place}" for place, name in enumerate(names))

    @cached_property
    def degrees(self) -> tuple[Degree, ...]:
        """The joints that are moved at will. Those that nothing bounds, prismatic ones without limits, are not."""
        found: list[Degree] = []
        column = 0
        for place, link in enumerate(self.tree.links):
            joint = link.joint
            limited = joint.lower <= joint.upper and math.isfinite(joint.upper - joint.lower)
            if (
                joint.kind in ("planar", "held")
                or joint.name in self.mimics
                or (joint.kind == "prismatic" and not limited)
            ):
                continue
            if joint.kind == "spherical":
                degree = Degree(place, joint.name, column, "spherical", -1.0, 1.0)
            elif limited:
                degree = Degree(place, joint.name, column, "limited", joint.lower, joint.upper)
            else:
                degree = Degree(place, joint.name, column, "endless", -math.pi, math.pi)
            found.append(degree)
            column += len(degree.columns)
        return tuple(found)

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """The names of the numbers of a configuration: joints, or parts of their quaternions."""
        return tuple(column for degree in self.degrees for column in degree.columns)

    @property
    def unmoved(self) -> list[tuple[str, str]]:
        """Joints that could move and do not: what kind of joint, and its name."""
        moved = {degree.name for degree in self.degrees} | self.mimics.keys()
        joints = [link.joint for link in self.tree.links if link.joint.name not in moved]
        return [(joint.kind, joint.name) for joint in joints if joint.kind != "held"]

    def drivers(self, place: int) -> frozenset[int]:
        """The links between the base and the link in that place, itself among them, whose joints move."""
        moved = {degree.link for degree in self.degrees}
        found = set()
        while place >= 0:
            link = self.tree.links[place]
            if place in moved or link.joint.name in self.mimics:
                found.add(place)
            place = link.parent
        return frozenset(found)


def shape_keys(robot: Robot) -> NDArray[np.int64]:
    """(k, 3) body, place of the link among all links, and place within it of each shape."""
    seen: Counter[int] = Counter()
    keys = []
    for shape in robot.tree.shapes:
        keys.append((robot.tree.links[shape.link].body, shape.link, seen[shape.link]))
        seen[shape.link] += 1
    return np.array(keys, dtype=np.int64).reshape(-1, 3)


def not_modelled(robot: Robot) -> dict[str, str]:
    """By the name of a link, which of its shapes are not modelled and why."""
    return {name: link.skipped for name, link in zip(robot.link_names, robot.tree.links) if link.skipped}


def read_robot(path: Path, modelling: Modelling = Modelling()) -> Robot:  # noqa: B008
    """The robot of a URDF, SDF or MJCF file.

    MuJoCo's own compiler reads MJCF if it is installed, else pybullet. pybullet passes over mimic joints: those of a
    URDF are read from its text. NotRead if the reader refuses the file, or pybullet takes it for something else than it
    says, or if a joint mimics one that is not there or, in the end, itself.
    """
    if path.suffix.lower() == ".xml" and find_spec("mujoco"):
        return _compiled(path, modelling)
    found: Robot = read_apart(path, _answers, (path, modelling), ENDINGS)
    return found


def _compiled(path: Path, modelling: Modelling) -> Robot:
    """The robot of an MJCF file by MuJoCo's compiler, in a process of its own."""
    from overlapper.simulation.mujoco.tree import read_mechanism

    if not path.is_file():
        raise NotRead(f"there is no file {path}")
    if modelling.surface != "nominal":
        raise NotRead(f"{path} is read by MuJoCo, which has no surface but 'nominal'")
    try:
        found = _reading(read_mechanism, path)
    except Unanswered as error:
        raise NotRead(f"{path} cannot be read: MuJoCo {error}") from None
    except ValueError as error:
        raise NotRead(f"{path} cannot be read: MuJoCo says {first_line(error)!r}") from None
    if not found.tree.shapes and len(found.tree.links) == 1:
        raise NotRead(f"{path} cannot be read: it has no body")
    mimics = {name: _followed(name, found.mimics) for name in found.mimics}
    return Robot(found.name, found.tree, mimics, found.notes)


_reading = Confined(SECONDS, MEGABYTES)


def _answers(request: tuple[Path, Modelling]) -> Generator[Robot | str, None, None]:
    """In the process in which pybullet reads the file: the robot in it, or the reason why it cannot be read."""
    path, modelling = request
    try:
        root = root_of(path)
        tree = yield from kinematic_tree(path, root, modelling)
        if path.suffix.lower() == ".urdf":
            yield Robot(root.get("name") or tree.bodies[0], tree, _mimics(root, tree))
        else:
            tied = root.find("equality/*") is not None
            notes = ("The <equality> of the file is not read: what it ties moves freely.",) if tied else ()
            yield Robot(tree.bodies[0], tree, {}, notes)
    except (NotRead, ValueError) as error:
        yield str(error)


def _mimics(root: ElementTree.Element, tree: KinematicTree) -> dict[str, Mimic]:
    kinds = {link.joint.name: link.joint.kind for link in tree.links}
    told = {str(joint.get("name")): joint.find("mimic") for joint in root.findall("joint")}
    found: dict[str, Mimic] = {}
    for name, mimic in told.items():
        if mimic is None or kinds.get(name) not in ("revolute", "prismatic"):
            continue
        leader = str(mimic.get("joint"))
        if kinds.get(leader) not in ("revolute", "prismatic"):
            raise NotRead(f"the joint {name!r} mimics {leader!r}, which is no joint that one number moves")
        multiplier, offset = (float(mimic.get(key, default)) for key, default in (("multiplier", 1), ("offset", 0)))
        found[name] = Mimic(leader, multiplier, offset)
    return {name: _followed(name, found) for name in found}


def _followed(name: str, mimics: Mapping[str, Mimic]) -> Mimic:
    """The same with a leader that follows none."""
    mimic, passed = mimics[name], {name}
    while mimic.leader in mimics:
        if mimic.leader in passed:
            raise NotRead(f"the joint {name!r} mimics itself")
        passed.add(mimic.leader)
        next_ = mimics[mimic.leader]
        mimic = Mimic(next_.leader, mimic.multiplier * next_.multiplier, mimic.multiplier * next_.offset + mimic.offset)
    return mimic
