"""The links and joints of an MJCF file, as MuJoCo's own compiler reads it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from overlapper.printable import printable
from overlapper.quaternion import composed, rotated
from overlapper.simulation.kinematic_tree import Joint, Kind, KinematicTree, LinkShape, Mimic, TreeLink
from overlapper.simulation.model import Array
from overlapper.simulation.modelling import in_one_sentence
from overlapper.simulation.mujoco.geoms import collidable, modelled_bodies

JOINTS = mujoco.mjtJoint
KINDS: dict[int, Kind] = {
    int(JOINTS.mjJNT_HINGE): "revolute",
    int(JOINTS.mjJNT_SLIDE): "prismatic",
    int(JOINTS.mjJNT_BALL): "spherical",
}
FREE = int(JOINTS.mjJNT_FREE)
UNTURNED = np.array([0.0, 0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True)
class Mechanism:
    """A model: its `name`, its `tree` of links, joints that follow others by name, and `notes` on unread parts."""

    name: str
    tree: KinematicTree
    mimics: dict[str, Mimic]
    notes: tuple[str, ...]


def read_mechanism(path: Path) -> Mechanism:
    """The mechanism of an MJCF file. ValueError with MuJoCo's message if the file does not compile."""
    return mechanism(mujoco.MjModel.from_xml_path(str(path)), path.stem)


def mechanism(model: Any, name: str) -> Mechanism:
    """The mechanism of a model.

    Each body is a link. A body with several joints has a link without shapes for each joint but the last. Bodies with
    a free joint are roots at their initial pose. The world is a root if it has geoms.
    """
    made = _Links(model)
    geoms = collidable(model)
    shaped = modelled_bodies(model, geoms, {})
    for body in range(model.nbody):
        told = shaped.get(body)
        reasons = [each.reason for each in told.skipped] if told else []
        reasons += ["height fields are not modelled"] * len(told.grounds) if told else []
        about = in_one_sentence(reasons, len(told.shapes) + len(reasons)) if told and reasons else ""
        link = made.add(body, about)
        for each in told.shapes if told else ():
            geom_pose = model.geom_pos[each.link].copy(), _xyzw(model.geom_quat[each.link])
            made.shapes.append(LinkShape(link, each.shape, *geom_pose))
    mimics, notes = _equalities(model)
    names = tuple(_body_name(model, root) for root in made.roots)
    tree = KinematicTree(names, tuple(made.links), tuple(made.shapes))
    said = printable(model.names[: model.names.index(b"\0")].decode(errors="replace"))
    return Mechanism(said if said not in ("", "MuJoCo Model") else name, tree, mimics, notes)


@dataclass
class _Links:
    model: Any
    links: list[TreeLink] = field(default_factory=list)
    shapes: list[LinkShape] = field(default_factory=list)
    roots: list[int] = field(default_factory=list)  # the bodies from which the trees hang
    _last: dict[int, int] = field(default_factory=dict)  # by body: the index of its link

    def add(self, body: int, skipped: str) -> int:
        """Add the links of a body. Returns the index of the link that has the shapes."""
        model = self.model
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        joints = [j for j in range(first, first + count) if model.jnt_type[j] != FREE]
        free = count > len(joints)
        parent = -1 if body == 0 or free else self._last[int(model.body_parentid[body])]
        if parent < 0:
            self.roots.append(body)
        root = len(self.roots) - 1 if parent < 0 else self.links[parent].body
        position, orientation = model.body_pos[body].copy(), _xyzw(model.body_quat[body])
        name = _body_name(model, body)
        steps: list[Joint] = [_joint(model, j, position, orientation) for j in joints[:1]]
        steps += [_joint(model, j, np.zeros(3), UNTURNED) for j in joints[1:]]
        steps = steps or [Joint(name, "held", position, orientation, np.zeros(3), np.zeros(3), 1.0, -1.0)]
        for joint in steps:
            is_last = joint is steps[-1]
            of_joint = name if is_last else f"{name} before {joint.name}"
            self.links.append(TreeLink(root, of_joint, parent, joint, skipped if is_last else "", 0, None))
            parent = len(self.links) - 1
        self._last[body] = parent
        return parent


def _joint(model: Any, joint: int, position: Array, orientation: Array) -> Joint:
    """A joint of a body. The pose is that of the body in its parent when the joint is at its reference."""
    kind = KINDS[int(model.jnt_type[joint])]
    anchor, axis = model.jnt_pos[joint].copy(), model.jnt_axis[joint].copy()
    reference = float(model.qpos0[model.jnt_qposadr[joint]])
    pivot, turn = position + rotated(orientation, anchor), orientation
    if kind == "revolute":
        back = np.append(-np.sin(reference / 2) * axis, np.cos(reference / 2))
        turn = composed(orientation, back)
    elif kind == "prismatic":
        pivot = pivot - reference * rotated(orientation, axis)
    limits = model.jnt_range[joint].tolist() if model.jnt_limited[joint] and kind != "spherical" else (1.0, -1.0)
    return Joint(_joint_name(model, joint), kind, pivot, turn, axis, -anchor, *limits)


def _equalities(model: Any) -> tuple[dict[str, Mimic], tuple[str, ...]]:
    """The joints that an equality ties to another joint, and sentences on other equalities and on limits."""
    mimics: dict[str, Mimic] = {}
    notes: list[str] = []
    for k in range(model.neq):
        if not model.eq_active0[k]:
            continue
        if told := _mimic(model, k):
            mimics[told[0]] = told[1]
        else:
            kind = str(mujoco.mjtEq(model.eq_type[k])).partition("mjEQ_")[2].lower()
            notes.append(f"An <equality> of kind {kind} is not read: what it couples moves freely.")
    notes += _limits_of_balls(model)
    return mimics, tuple(dict.fromkeys(notes))


def _mimic(model: Any, equality: int) -> tuple[str, Mimic] | None:
    """The joint that an equality ties linearly to another joint; None for any other equality."""
    follower, leader = int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])
    constant, slope, *rest = model.eq_data[equality][:5].tolist()
    if model.eq_type[equality] != mujoco.mjtEq.mjEQ_JOINT or leader < 0 or any(rest):
        return None
    at = [float(model.qpos0[model.jnt_qposadr[joint]]) for joint in (follower, leader)]
    return _joint_name(model, follower), Mimic(_joint_name(model, leader), slope, constant + at[0] - slope * at[1])


def _limits_of_balls(model: Any) -> Iterator[str]:
    for joint in range(model.njnt):
        if model.jnt_type[joint] == JOINTS.mjJNT_BALL and model.jnt_limited[joint]:
            yield f"The limit of the ball joint {_joint_name(model, joint)} is not read: it turns freely."


def _xyzw(quaternion: Array) -> Array:
    return np.asarray(quaternion[[1, 2, 3, 0]])


def _body_name(model: Any, body: int) -> str:
    return printable(model.body(body).name) or f"body {body}"


def _joint_name(model: Any, joint: int) -> str:
    return printable(model.joint(joint).name) or f"joint {joint}"
