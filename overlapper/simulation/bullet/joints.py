"""The links and joints of a file that pybullet loads.

A file may kill pybullet, so it is read in a separate process, by `model_file.read_apart`.
"""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from overlapper.printable import printable
from overlapper.quaternion import composed, rotated
from overlapper.simulation.bullet.model_file import LOADED, NotRead, load
from overlapper.simulation.bullet.model_text import must_be_sound
from overlapper.simulation.kinematic_tree import Joint, Kind, KinematicTree, LinkShape, TreeLink
from overlapper.simulation.model import BASE
from overlapper.simulation.naming import labels
from overlapper.simulation.settings import Modelling

ENDINGS = (".urdf", ".sdf", ".xml")

MOST_LINKS = 128

KINDS: dict[int, Kind] = {
    0: "revolute",
    1: "prismatic",
    2: "spherical",
    3: "planar",
}  # by pybullet's numbers of joint types


class TooManyLinks(NotRead):
    """A file has more links than pybullet returns the poses of."""


def kinematic_tree(path: Path, root: Element, modelling: Modelling) -> Generator[str, None, KinematicTree]:
    """The links of a URDF, SDF or MJCF file whose text has this root. Yields LOADED when pybullet has loaded the file.

    NotRead if pybullet refuses the file, or would make another model of it.
    """
    import pybullet

    from overlapper.simulation.bullet.known_bodies import KnownBodies
    from overlapper.simulation.bullet.lost_shapes import NOT_BUILT
    from overlapper.simulation.bullet.recorder import Recorder

    if (count := len(root.findall("link"))) > MOST_LINKS:
        raise TooManyLinks(f"it has {count:,} links, but pybullet returns the poses of at most {MOST_LINKS}")
    must_be_sound(path, root)
    client = pybullet.connect(pybullet.DIRECT)
    with Recorder(client) as recorder:
        # Visual shapes take most of the time of loading a URDF.
        load(path, client, pybullet.URDF_IGNORE_VISUAL_SHAPES if path.suffix.lower() == ".urdf" else 0)
        yield LOADED
        known = KnownBodies(client, modelling, recorder, {})
        known.refresh()
    if not known.by_id:
        raise NotRead("it has no body")
    skipped = [each for body in known.by_id.values() for each in body.skipped]
    if absent := [each.name.partition("/")[2] for each in skipped if each.reason == NOT_BUILT]:
        raise NotRead(f"pybullet has not built the shapes of {', '.join(absent)}")
    names = labels(known.by_id)
    links: list[TreeLink] = []
    shapes: list[LinkShape] = []
    for number, (id, body) in enumerate(known.by_id.items()):
        base = len(links)
        reasons = {each.link: each.reason for each in body.skipped}
        concave = {link: [each for each in body.decomposed if each.link == link] for link in body.link_names}
        joints = _joints(client, id, names[id])
        for link, joint in enumerate(joints, BASE):
            parent = base + 1 + body.parents[link] if link > BASE else -1
            gains = [each.volume / each.mesh_volume - 1 for each in concave[link] if each.mesh_volume]
            parts_of_it = sum(len(each.shapes) for each in concave[link])
            about = reasons.get(link, ""), parts_of_it, max(gains, default=None)
            links.append(TreeLink(number, body.link_names[link], parent, joint, *about))
        for each in sorted(body.shapes, key=lambda each: (each.link, each.index)):
            shapes.append(LinkShape(base + 1 + each.link, each.shape, each.position, each.orientation))
    return KinematicTree(tuple(names.values()), tuple(links), tuple(shapes))


def _joints(client: int, id: int, name: str) -> list[Joint]:
    """The joint that ties the base to the world where it was loaded, and the joints of a body.

    NotRead if pybullet does not report the poses of its links.
    """
    import pybullet

    told = [pybullet.getJointInfo(id, joint, client) for joint in range(pybullet.getNumJoints(id, client))]
    try:
        base = pybullet.getBasePositionAndOrientation(id, client)
        states = pybullet.getLinkStates(id, range(len(told)), computeForwardKinematics=1, physicsClientId=client)
    except pybullet.error as error:
        raise NotRead(f"pybullet returns no poses for the {1 + len(told)} links of {name}") from error
    frames = [tuple(map(np.array, each[:2])) for each in (base, *(states or ()))]
    root = Joint("", "held", frames[0][0], frames[0][1], np.zeros(3), np.zeros(3), 0.0, -1.0)
    return [root, *(joint_between(client, id, each, frames[1 + each[16]], frames[1 + each[0]]) for each in told)]


def joint_between(client: int, id: int, told: Any, parent: Any, link: Any) -> Joint:
    """A joint, from pybullet's joint info `told` and the present inertial frames of its two links."""
    import pybullet

    number, name, type_ = told[:3]
    kind = KINDS.get(type_, "held")
    axis, position = np.array(told[13]), np.array(told[14])
    # Pybullet reports the rotation from the axes of the parent to the axes of the joint.
    orientation = np.array(told[15]) * [-1, -1, -1, 1]
    if kind == "revolute":
        axis = axis / np.linalg.norm(axis)
    state = np.array(pybullet.getJointStateMultiDof(id, number, client)[0] if kind not in ("planar", "held") else [])
    turn, shift = np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3)
    if kind == "revolute":
        turn = np.append(axis * np.sin(state[0] / 2), np.cos(state[0] / 2))
    elif kind == "prismatic":
        shift = axis * state[0]
    elif kind == "spherical":
        turn = state
    # An MJCF joint need not be at the origin of its link. Only the poses tell the offset.
    axes = composed(parent[1], orientation)
    pivot = parent[0] + rotated(parent[1], position) + rotated(axes, shift)
    offset = rotated(composed(axes, turn) * [-1, -1, -1, 1], link[0] - pivot)
    return Joint(printable(name.decode(errors="replace")), kind, position, orientation, axis, offset, *told[8:10])
