"""A robot: its kinematic tree, the joints that can be moved independently, and their ranges."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Generator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from overlapper.install import hint, simulator_hint
from overlapper.jobs.confined import MEGABYTES, SECONDS, Confined, Unanswered
from overlapper.printable import first_line
from overlapper.simulation.bullet.joints import ENDINGS, TooManyLinks, kinematic_tree
from overlapper.simulation.bullet.model_file import NotRead, read_apart
from overlapper.simulation.bullet.model_text import root_of
from overlapper.simulation.kinematic_tree import KinematicTree, Mimic
from overlapper.simulation.naming import body_name
from overlapper.simulation.settings import Modelling

TURN = ("x", "y", "z", "w")  # the quaternion of a spherical joint


@dataclass(frozen=True, slots=True)
class Degree:
    """A joint that is moved independently: the joint of link number `link`. Column `column` has its value.

    The value goes from `lower` to `upper`, in rad or m. An "endless" joint turns once around. A "spherical" joint has
    four columns, a unit quaternion xyzw.
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
    """Links, shapes and joints as they were read. `mimics` has the joints that follow others, by name.

    `name` is the robot's name in the file, or else the name of its first body. `notes` are sentences on the parts of
    the file that are not read.
    """

    name: str
    tree: KinematicTree
    mimics: Mapping[str, Mimic]
    notes: tuple[str, ...] = ()

    @cached_property
    def link_names(self) -> tuple[str, ...]:
        """Distinct names of the links: with the body's name if there are several, with the index if names are equal."""
        links = self.tree.links
        names = [
            f"{self.tree.bodies[link.body]}/{link.name}" * (len(self.tree.bodies) > 1) or link.name for link in links
        ]
        return tuple(name if names.count(name) == 1 else f"{name}#{place}" for place, name in enumerate(names))

    @cached_property
    def degrees(self) -> tuple[Degree, ...]:
        """The joints that are moved independently. Prismatic joints without limits are not moved."""
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
        """The names of the numbers of a configuration: joints, or components of their quaternions."""
        return tuple(column for degree in self.degrees for column in degree.columns)

    @property
    def unmoved(self) -> list[tuple[str, str]]:
        """The kind and the name of each joint that could move but is not moved."""
        moved = {degree.name for degree in self.degrees} | self.mimics.keys()
        joints = [link.joint for link in self.tree.links if link.joint.name not in moved]
        return [(joint.kind, joint.name) for joint in joints if joint.kind != "held"]

    def drivers(self, place: int) -> frozenset[int]:
        """The links from the base to link number `place`, this link included, whose joints move."""
        moved = {degree.link for degree in self.degrees}
        found = set()
        while place >= 0:
            link = self.tree.links[place]
            if place in moved or link.joint.name in self.mimics:
                found.add(place)
            place = link.parent
        return frozenset(found)


def shape_keys(robot: Robot) -> NDArray[np.int64]:
    """(k, 3): for each shape its body, the index of its link among all links, and its index within the link."""
    seen: Counter[int] = Counter()
    keys = []
    for shape in robot.tree.shapes:
        keys.append((robot.tree.links[shape.link].body, shape.link, seen[shape.link]))
        seen[shape.link] += 1
    return np.array(keys, dtype=np.int64).reshape(-1, 3)


def not_modelled(robot: Robot) -> dict[str, str]:
    """For each link with shapes that are not modelled, by its name: which shapes, and why."""
    return {name: link.skipped for name, link in zip(robot.link_names, robot.tree.links) if link.skipped}


def read_robot(path: Path, modelling: Modelling = Modelling()) -> Robot:  # noqa: B008
    """The robot of a URDF, SDF or MJCF file.

    MuJoCo's compiler reads MJCF if it is installed, else pybullet does. yourdfpy reads URDF if pybullet is not
    installed, or if the robot has more links than pybullet places. pybullet ignores mimic joints, so those of a URDF
    are read from its text.

    NotRead if the reader refuses the file, or if pybullet reads something else than the file says. NotRead also if a
    joint mimics a joint that does not exist, or mimics itself through others. ImportError if no library is installed
    that reads the file.
    """
    if path.suffix.lower() == ".xml" and find_spec("mujoco"):
        return _compiled(path, modelling)
    if path.suffix.lower() == ".urdf" and not find_spec("pybullet"):
        return _by_yourdfpy(path, modelling)
    found: Robot | TooManyLinks = read_apart(path, _answers, (path, modelling), ENDINGS)
    if isinstance(found, TooManyLinks):
        if not find_spec("yourdfpy"):
            raise NotRead(f"{path} cannot be read: {found}. More links need {hint('yourdfpy')}")
        robot = _by_yourdfpy(path, modelling)
        return replace(robot, notes=(*robot.notes, f"yourdfpy has read the file: {found}."))
    return found


def _compiled(path: Path, modelling: Modelling) -> Robot:
    """The robot of an MJCF file by MuJoCo's compiler, in a process of its own."""
    from overlapper.simulation.mujoco.tree import read_mechanism

    if not path.is_file():
        raise NotRead(f"there is no file {path}")
    if modelling.surface != "nominal":
        raise NotRead(f"{path} is read by MuJoCo, which has only the surface 'nominal'")
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


def _by_yourdfpy(path: Path, modelling: Modelling) -> Robot:
    """The robot of a URDF file by yourdfpy, in a process of its own. Shapes are modelled in this process."""
    if not find_spec("yourdfpy"):
        raise ImportError(f"a URDF file needs {hint('yourdfpy')}, or {simulator_hint()}")
    from overlapper.simulation.urdf import kinematic_tree, read_links

    if not path.is_file():
        raise NotRead(f"there is no file {path}")
    try:
        root, links = _reading(read_links, path.absolute())
        tree = kinematic_tree(body_name(root.get("name", ""), str(path), True, (), None), links, modelling)
        return _of_urdf(root, tree)
    except Unanswered as error:
        raise NotRead(f"{path} cannot be read: yourdfpy {error}") from None
    except (NotRead, ValueError) as error:
        raise NotRead(f"{path} cannot be read: {first_line(error)}") from None


_reading = Confined(SECONDS, MEGABYTES)


def _answers(request: tuple[Path, Modelling]) -> Generator[Robot | TooManyLinks | str, None, None]:
    """Runs in the process in which pybullet reads the file: yields the robot, or why the file cannot be read."""
    path, modelling = request
    try:
        root = root_of(path)
        tree = yield from kinematic_tree(path, root, modelling)
        if path.suffix.lower() == ".urdf":
            yield _of_urdf(root, tree)
        else:
            tied = root.find("equality/*") is not None
            notes = ("The <equality> of the file is not read: the joints that it couples move freely.",) if tied else ()
            yield Robot(tree.bodies[0], tree, {}, notes)
    except TooManyLinks as error:
        yield error
    except (NotRead, ValueError) as error:
        yield str(error)


def _of_urdf(root: ElementTree.Element, tree: KinematicTree) -> Robot:
    """The robot of a URDF whose text has this root."""
    limits = root.find("joint/safety_controller") is not None
    notes = ("The soft limits of <safety_controller> are not read: joints move between their <limit>s.",) * limits
    return Robot(root.get("name") or tree.bodies[0], tree, _mimics(root, tree), notes)


def _mimics(root: ElementTree.Element, tree: KinematicTree) -> dict[str, Mimic]:
    kinds = {link.joint.name: link.joint.kind for link in tree.links}
    told = {str(joint.get("name")): joint.find("mimic") for joint in root.findall("joint")}
    found: dict[str, Mimic] = {}
    for name, mimic in told.items():
        if mimic is None or kinds.get(name) not in ("revolute", "prismatic"):
            continue
        leader = str(mimic.get("joint"))
        if kinds.get(leader) not in ("revolute", "prismatic"):
            raise NotRead(f"the joint {name!r} mimics {leader!r}, which is not a revolute or prismatic joint")
        multiplier, offset = (float(mimic.get(key, default)) for key, default in (("multiplier", 1), ("offset", 0)))
        found[name] = Mimic(leader, multiplier, offset)
    return {name: _followed(name, found) for name in found}


def _followed(name: str, mimics: Mapping[str, Mimic]) -> Mimic:
    """The equivalent mimic whose leader does not mimic another joint."""
    mimic, passed = mimics[name], {name}
    while mimic.leader in mimics:
        if mimic.leader in passed:
            raise NotRead(f"the joint {name!r} mimics itself")
        passed.add(mimic.leader)
        next_ = mimics[mimic.leader]
        mimic = Mimic(next_.leader, mimic.multiplier * next_.multiplier, mimic.multiplier * next_.offset + mimic.offset)
    return mimic
