"""Robots as URDF text, and those that come with pybullet and with example-robot-data."""

from importlib.metadata import distribution
from importlib.util import find_spec
from pathlib import Path

import pybullet as p
import pybullet_data

DATA = Path(pybullet_data.getDataPath())
ROBOTS = Path(distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots"))

INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'


def without(library):
    """A `find_spec` as where the library is not installed."""
    return lambda name: None if name == library else find_spec(name)


def link(name, *boxes):
    """A link of boxes, each by its sides and its centre."""
    text = "".join(
        f'<collision><origin xyz="{centre}"/><geometry><box size="{sides}"/></geometry></collision>'
        for sides, centre in boxes
    )
    return f'<link name="{name}">{INERTIAL}{text}</link>'


def joint(name, kind, parent, child, more="", xyz="0 0 0", axis="0 0 1"):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/><axis xyz="{axis}"/>{more}</joint>'
    )


def limit(lower, upper):
    return f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/>'


def mimic(leader, multiplier=1, offset=0):
    return f'<mimic joint="{leader}" multiplier="{multiplier}" offset="{offset}"/>'


def urdf(path, *elements):
    path.write_text(f'<robot name="made">{"".join(elements)}</robot>')
    return path


def turntable(path, lower=-3.0, upper=3.0):
    """A post, and on it a disc that `turn` turns; an arm beside the disc, tied to it by a flange without a shape.

    A wall, fixed to the post, is in the way of the arm at right angles. A plate, fixed to the post, is always in it.
    """
    return urdf(
        path,
        link("post", ("0.1 0.1 0.1", "0 0 0")),
        link("disc", ("0.1 0.1 0.1", "0 0 0.2")),
        link("flange"),
        link("arm", ("0.2 0.2 0.2", "1 0 0.2")),
        link("wall", ("0.2 0.2 0.2", "0 1 0.2")),
        link("plate", ("3 3 0.02", "0 0 0.27")),
        joint("turn", "revolute", "post", "disc", limit(lower, upper)),
        joint("bolts", "fixed", "disc", "flange"),
        joint("screws", "fixed", "flange", "arm"),
        joint("nails", "fixed", "post", "wall"),
        joint("glue", "fixed", "post", "plate"),
    )


def moved(robot, client, configuration):
    """Put the joints of the same robot in pybullet where a configuration says."""
    column = dict(zip(robot.columns, configuration.tolist()))
    turned = {degree.name: degree for degree in robot.degrees}
    bases = [place for place, link in enumerate(robot.tree.links) if link.parent < 0]
    for place, each in enumerate(robot.tree.links):
        name, where = each.joint.name, (each.body, place - bases[each.body] - 1)
        if name in robot.mimics:
            follows = robot.mimics[name]
            value = column[follows.leader] * follows.multiplier + follows.offset
            p.resetJointState(*where, value, physicsClientId=client)
        elif name in turned and turned[name].range == "spherical":
            quaternion = [column[part] for part in turned[name].columns]
            p.resetJointStateMultiDof(*where, quaternion, physicsClientId=client)
        elif name in turned:
            p.resetJointState(*where, column[name], physicsClientId=client)
