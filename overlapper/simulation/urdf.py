"""The links and joints of a URDF file, as yourdfpy reads it. The shapes are those that pybullet makes of the file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import yourdfpy
from numpy.typing import NDArray
from trimesh.transformations import quaternion_from_matrix

from overlapper.polytopes import mesh_parser
from overlapper.printable import first_line, printable
from overlapper.simulation.bullet.model_file import NotRead
from overlapper.simulation.bullet.model_text import found, must_have_finite_numbers, must_name_files, root_of
from overlapper.simulation.kinematic_tree import Joint, Kind, KinematicTree, LinkShape, TreeLink
from overlapper.simulation.model import Array, Leaf
from overlapper.simulation.modelling import in_one_sentence, modelled
from overlapper.simulation.settings import Modelling

SIDES = 32  # of the prism that Bullet makes of a <cylinder>
MARGIN = 0.001  # m, Bullet's collision margin of the meshes of a URDF

KINDS: dict[str, Kind] = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "spherical": "spherical",  # pybullet's own type
    "planar": "planar",
    "floating": "held",
    "fixed": "held",
}
SHAPES = ("box", "cylinder", "sphere", "capsule", "mesh")  # <capsule> is pybullet's own element
UNTURNED = np.array([0.0, 0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True)
class ReadLink:
    """A link as read: its shapes as `leaves` in the link's frame, and the reasons for shapes that are not read."""

    name: str
    parent: int
    joint: Joint
    leaves: tuple[Leaf, ...]
    reasons: tuple[str, ...]


def read_links(path: Path) -> tuple[Element, list[ReadLink]]:
    """The root of a URDF file, and its links, parents before their children. NotRead if the file cannot be read."""
    _objects.cache_clear()  # the process may have read an earlier version of a mesh
    root = root_of(path)
    must_name_files(path, root)
    must_have_finite_numbers(root)
    _must_have_ends(root)
    reasons = {str(link.get("name")): _prepare(link) for link in root.findall("link")}
    robot = _parsed(root)
    links = {link.name: link for link in robot.links}
    children: dict[str, list[Any]] = {name: [] for name in links}
    for joint in robot.joints:
        children[joint.parent].append(joint)
    bases = [*links.keys() - {joint.child for joint in robot.joints}]
    if len(bases) != 1 or len(robot.joints) != len(links) - 1:
        raise NotRead(f"its {len(links):,} links and {len(robot.joints):,} joints are not one tree")
    base = Joint("", "held", np.zeros(3), UNTURNED, np.zeros(3), np.zeros(3), 0.0, -1.0)
    made: list[ReadLink] = []
    waiting = [(bases[0], -1, base)]
    while waiting:
        name, parent, joint = waiting.pop()
        leaves, lost = _leaves(path, links[name])
        made.append(ReadLink(printable(name), parent, joint, tuple(leaves), (*reasons[name], *lost)))
        here = len(made) - 1
        waiting += [(each.child, here, _joint(each)) for each in reversed(children[name])]
    if len(made) < len(links):
        raise NotRead("a link of it is a parent of itself, through its joints")
    return root, made


def kinematic_tree(name: str, read: list[ReadLink], modelling: Modelling) -> KinematicTree:
    """The links with their shapes modelled. `name` is the name of the body. Frames are those of the links."""
    links: list[TreeLink] = []
    shapes: list[LinkShape] = []
    for number, each in enumerate(read):
        made, reasons, meshes = modelled(number, each.leaves, modelling)
        reasons = [*each.reasons, *reasons]
        skipped = in_one_sentence(reasons, len(made) + len(reasons)) if reasons else ""
        gains = [mesh.volume / mesh.mesh_volume - 1 for _, mesh in meshes if mesh.mesh_volume]
        concave = sum(len(parts) for parts, _ in meshes)
        links.append(TreeLink(0, each.name, each.parent, each.joint, skipped, concave, max(gains, default=None)))
        shapes += [LinkShape(number, shape.shape, shape.position, shape.orientation) for shape in made]
    return KinematicTree((name,), tuple(links), tuple(shapes))


def _must_have_ends(root: Element) -> None:
    """NotRead if links or joints have no name or one name, or if a joint has no type, no limit or not two links."""
    for tag in ("link", "joint"):
        names = [each.get("name") for each in root.findall(tag)]
        if None in names:
            raise NotRead(f"a {tag} of it has no name")
        if twice := [name for name in names if names.count(name) > 1]:
            raise NotRead(f"it has two {tag}s named {twice[0]!r}")
    links = {link.get("name") for link in root.findall("link")}
    for joint in root.findall("joint"):
        name, kind = joint.get("name"), joint.get("type")
        if kind not in KINDS:
            raise NotRead(f"the joint {name!r} has the type {kind!r}, not one of {', '.join(KINDS)}")
        if kind in ("revolute", "prismatic") and joint.find("limit") is None:
            raise NotRead(f"the {kind} joint {name!r} has no <limit>")
        for end in ("parent", "child"):
            named = joint.find(end)
            link = None if named is None else named.get("link")
            if link not in links:
                raise NotRead(f"the joint {name!r} has the {end} {link!r}, which is not a link of it")


def _prepare(link: Element) -> list[str]:
    """Leave only collision shapes that yourdfpy can read in a link, and say which ones are removed.

    The `name` of a collision becomes the kind of its shape, because yourdfpy reads neither capsules nor `concave`.
    """
    reasons = []
    for each in [*link]:
        if each.tag != "collision":
            link.remove(each)
    for collision in link.findall("collision"):
        shape = collision.find("geometry/*")
        if shape is None or shape.tag not in SHAPES:
            reasons.append(f"a <collision> with {'no shape' if shape is None else f'a <{shape.tag}>'} is not read")
            link.remove(collision)
            continue
        concave = shape.tag == "mesh" and collision.get("concave") is not None
        collision.set("name", "concave mesh" if concave else shape.tag)
        if shape.tag == "capsule":
            shape.tag = "cylinder"
    return reasons


def _parsed(root: Element) -> Any:
    """The robot as yourdfpy reads its links and joints, without meshes."""
    text = Element("robot", name="")
    text.extend([*root.findall("link"), *root.findall("joint")])
    try:
        file = BytesIO(ElementTree.tostring(text))
        return yourdfpy.URDF.load(file, build_scene_graph=False, load_meshes=False).robot
    except Exception as error:  # of any kind: yourdfpy does not check what it converts
        raise NotRead(f"yourdfpy says {type(error).__name__}: {first_line(error)}") from error


def _joint(told: Any) -> Joint:
    position, orientation = _pose(told.origin)
    kind = KINDS[told.type]
    axis = np.asarray(told.axis, dtype=float)
    if kind == "revolute":
        axis = axis / np.linalg.norm(axis)
    lower, upper = (told.limit.lower, told.limit.upper) if told.limit else (None, None)
    lower, upper = 0.0 if lower is None else lower, -1.0 if upper is None else upper  # as pybullet
    return Joint(printable(told.name), kind, position, orientation, axis, np.zeros(3), lower, upper)


def _pose(origin: Array | None) -> tuple[Array, Array]:
    """Position and quaternion xyzw of a matrix (4, 4)."""
    if origin is None:
        return np.zeros(3), UNTURNED
    wxyz = quaternion_from_matrix(origin)  # type: ignore[no-untyped-call]
    return np.array(origin[:3, 3]), np.roll(wxyz, -1)


def _leaves(path: Path, link: Any) -> tuple[list[Leaf], list[str]]:
    """The collision shapes of a link, and why meshes cannot be read."""
    leaves: list[Leaf] = []
    reasons: list[str] = []
    for collision in link.collisions:
        pose, shape = _pose(collision.origin), collision.geometry
        if shape.box:
            leaves.append(Leaf("box", *pose, shape.box.size / 2))
        elif shape.sphere:
            leaves.append(Leaf("sphere", *pose, np.array([shape.sphere.radius])))
        elif shape.cylinder:
            size = np.array([shape.cylinder.radius, shape.cylinder.length])
            capsule = collision.name == "capsule"
            leaves.append(Leaf("capsule", *pose, size) if capsule else Leaf("hull", *pose, _prism(*size), MARGIN))
        else:
            try:
                objects = _objects(path, shape.mesh.filename or "")
                scale = _scale(shape.mesh)
            except ValueError as error:
                reasons.append(str(error))
                continue
            if collision.name == "concave mesh":
                triangles = np.concatenate([vertices[faces] for vertices, faces in objects])
                leaves.append(Leaf("concave mesh", *pose, triangles * scale))
            else:
                points = [vertices[np.unique(faces)] for vertices, faces in objects]
                leaves += [Leaf("hull", *pose, each * scale, MARGIN) for each in points]
    return leaves, reasons


def _scale(mesh: Any) -> Any:
    if mesh.scale is None:
        return 1.0
    if np.size(mesh.scale) not in (1, 3):
        raise ValueError(f"the mesh {mesh.filename!r} has a scale of {np.size(mesh.scale)} numbers, not 1 or 3")
    return mesh.scale


def _prism(radius: float, length: float) -> Array:
    angles = 2 * np.pi * np.arange(SIDES) / SIDES
    ring = radius * np.column_stack([np.sin(angles), np.cos(angles)])
    return np.concatenate([np.column_stack([ring, np.full(SIDES, z)]) for z in (length / 2, -length / 2)])


@cache
def _objects(path: Path, name: str) -> list[tuple[Array, NDArray[np.int64]]]:
    """The objects of a mesh that the model names. ValueError says why it cannot be read."""
    file = found(path, name) if name else None
    if file is None:
        raise ValueError(f"the mesh {name!r} does not exist")
    try:
        return mesh_parser.objects(file)
    except Exception as error:  # of any kind, because every format has its own parser
        raise ValueError(f"the mesh {name!r} cannot be read: {first_line(error)}") from error
