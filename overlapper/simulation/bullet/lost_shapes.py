"""Collision shapes that a model names and pybullet has not built, because it ignores meshes that it cannot read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element

import pybullet

from overlapper.printable import printable
from overlapper.simulation.bullet.bullet_file import BulletFile
from overlapper.simulation.bullet.mjcf import misread
from overlapper.simulation.bullet.model_file import NotRead
from overlapper.simulation.bullet.model_text import named_shapes, root_of
from overlapper.simulation.bullet.recorder import Loaded
from overlapper.simulation.bullet.saved_scene import MULTIBODY, body_type
from overlapper.simulation.model import BASE, LinkKey

NOT_BUILT = "pybullet has not built its shapes"

# With these flags, pybullet makes other links than the file names, or none of its shapes.
OTHERWISE = pybullet.URDF_MERGE_FIXED_LINKS | pybullet.URDF_IGNORE_COLLISION_SHAPES


def lost_of(
    loaded: Loaded, client: int, file: BulletFile, rows: Mapping[int, int]
) -> tuple[dict[LinkKey, str], list[str]]:
    """The lost shapes of bodies that were loaded together, in the form of `lost_shapes`.

    The result is empty if the file was moved, is not XML, or if pybullet makes other links of it.
    """
    path, there = loaded.place, {id: rows[id] for id in loaded.bodies if id in rows}
    if path is None or loaded.flags & OTHERWISE or len(there) < len(loaded.bodies):
        return {}, []
    if any(body_type(client, id) != MULTIBODY for id in there):
        return {}, []
    try:
        root = root_of(path)
    except (NotRead, OSError):
        return {}, []
    if path.suffix.lower() == ".xml" and misread(root):
        return {}, []
    return lost_shapes(path, root, client, file, there)


def lost_shapes(
    path: Path, root: Element, client: int, file: BulletFile, rows: Mapping[int, int]
) -> tuple[dict[LinkKey, str], list[str]]:
    """Why links have fewer shapes than the model names, by body and link; and the names of missing links.

    `root` is the root of the model. `rows` are the places in `file` of the bodies that pybullet has made of the model.
    """
    named = named_shapes(path, root)
    lost: dict[LinkKey, str] = {}
    others = 0  # shapes of links that have no name in the file
    for id, row in sorted(rows.items()):
        colliders = file.bodies[row].colliders
        for link, name in _link_names(client, id).items():
            pieces = file.pieces(colliders[link].shape) if link in colliders else []
            if not named.get(name):
                others += sum(map(bool, pieces))
                continue
            expected = named[name].pop(0)
            files = _files(client, id, link) if path.suffix.lower() != ".xml" else None
            if reason := _reason(expected, pieces, files):
                lost[id, link] = reason
    unnamed = sum(map(len, named.pop("", [])))  # of MJCF, whose bodies pybullet numbers
    absent = [name for name, links in named.items() for shapes in links if shapes]
    return lost, absent + ["a body without a name"] * (others < unnamed)


def _link_names(client: int, id: int) -> dict[int, str]:
    joints = [pybullet.getJointInfo(id, joint, client) for joint in range(pybullet.getNumJoints(id, client))]
    names = {BASE: pybullet.getBodyInfo(id, client)[0]} | {joint[0]: joint[12] for joint in joints}
    return {link: name.decode(errors="replace") for link, name in names.items()}


def _files(client: int, id: int, link: int) -> list[str]:
    """The file of each shape that pybullet reports, "" for a shape without one."""
    told = pybullet.getCollisionShapeData(id, link, client)
    return [each[4].decode(errors="replace") for each in told]


def _reason(expected: Sequence[str], pieces: Sequence[int], files: Sequence[str] | None) -> str:
    """Why a link has fewer shapes than `expected`, "" if it has as many.

    `pieces` are the numbers of convex shapes of each of its shapes. A single shape may be saved as its convex shapes.
    `files` are those that pybullet reports, None if it cannot be asked.
    """
    there = min(1, sum(pieces)) if len(expected) == 1 else sum(map(bool, pieces))
    if files is not None and len(expected) > 1:
        there = min(there, len(files))
    if there >= len(expected):
        return ""
    lost = [shape for shape, count in zip(expected, pieces) if not count] if len(pieces) == len(expected) else []
    lost = lost or [shape for shape in expected if files is not None and not _is_among(shape, files)] or [*expected]
    names = ", ".join(dict.fromkeys(map(printable, lost)))
    return f"pybullet built {there} of the {len(expected)} shapes in the file, without {names}"


def _is_among(shape: str, files: Sequence[str]) -> bool:
    """Whether a shape is reported. Primitives have no file, and a cylinder of a URDF has an unknown file."""
    if "." in shape:
        return any(file.endswith(Path(shape).name) for file in files)
    return not {"", "unknown_file"}.isdisjoint(files)
