"""The shapes of a body, read from a temporary .bullet file and refined by pybullet's own report.

The file has all shapes in single precision. The report has double precision, but not all shapes.
"""

from __future__ import annotations

import colorsys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pybullet

from overlapper.printable import printable
from overlapper.simulation.bullet.bullet_file import BulletFile, SavedBody
from overlapper.simulation.bullet.recorder import Loaded
from overlapper.simulation.bullet.saved_scene import MULTIBODY, SOFT_BODY, body_type
from overlapper.simulation.height_field import HeightField
from overlapper.simulation.model import (
    BASE,
    Color,
    Decomposed,
    Ground,
    Leaf,
    ModelledBody,
    ModelledShape,
    Skipped,
)
from overlapper.simulation.modelling import in_one_sentence, modelled
from overlapper.simulation.naming import body_name, link_name, look
from overlapper.simulation.settings import Modelling

REPORTED = {  # by getCollisionShapeData
    pybullet.GEOM_MESH: "hull",
    pybullet.GEOM_BOX: "box",
    pybullet.GEOM_SPHERE: "sphere",
    pybullet.GEOM_CAPSULE: "capsule",
    pybullet.GEOM_CYLINDER: "cylinder",
    pybullet.GEOM_PLANE: "plane",
}
Visual = tuple[Any, ...]  # of getVisualShapeData
MESHES = ("hull", "concave mesh")  # both reported as GEOM_MESH


def read_body(
    client: int,
    id: int,
    file: BulletFile,
    saved: SavedBody | None,
    modelling: Modelling,
    field: HeightField | None = None,
    loaded: Loaded | None = None,
    given: str | None = None,
) -> ModelledBody:
    """A body, read from a .bullet file and from pybullet. `field` is its height field, if it is known to be one.

    `loaded` tells the file that the body comes from. `given` is the name that the body was given.
    """
    base, own = (printable(text.decode(errors="replace")) for text in pybullet.getBodyInfo(id, client))
    joints = [pybullet.getJointInfo(id, joint, client) for joint in range(pybullet.getNumJoints(id, client))]
    link_names = {BASE: base or "base"} | {joint[0]: printable(joint[12].decode(errors="replace")) for joint in joints}
    parents = {joint[0]: joint[16] for joint in joints}
    leaves = _leaves(client, id, file, saved) if saved else {}
    visuals: Sequence[Visual] = pybullet.getVisualShapeData(id, physicsClientId=client)
    own_name, kind = _name(own, loaded, visuals, () if joints else leaves.get(BASE, ()))
    name = given or own_name or f"body {id}"
    shapes: list[ModelledShape] = []
    skipped: list[Skipped] = []
    decomposed: list[Decomposed] = []
    shape_count = 0 if saved else 1
    grounds: tuple[Ground, ...] = ()
    if field and [leaf.kind for leaf in leaves.get(BASE, ())] == ["height field"]:
        (leaf,) = leaves.pop(BASE)
        grounds = (Ground(BASE, field, leaf.position, leaf.orientation),)
        shape_count += field.count
    for link, each in leaves.items():
        made, reasons, meshes = modelled(link, each, modelling)
        shapes += made
        count = len(made) + len(reasons)
        shape_count += count
        label = link_name(name, link_names, link_names[link])
        if reasons:
            skipped.append(Skipped(id, link, label, in_one_sentence(reasons, count)))
        decomposed += [
            Decomposed(id, link, label, numbers, mesh.volume, mesh.mesh_volume, mesh.path) for numbers, mesh in meshes
        ]
    if not saved:
        soft = body_type(client, id) == SOFT_BODY
        skipped.append(Skipped(id, BASE, name, "a soft body is not modelled" if soft else "saveBullet leaves it out"))
    seen: dict[int, Color] = {}  # of the first visual shape of each link
    for visual in visuals:
        seen.setdefault(visual[1], visual[7])
    colors = _colors(id, seen, link_names)
    return ModelledBody(
        name,
        link_names,
        colors,
        parents,
        shape_count,
        tuple(shapes),
        tuple(skipped),
        tuple(decomposed),
        grounds,
        look(seen.get(BASE), shapes) if name == kind and not given else ("", ""),
    )


def _name(own: str, loaded: Loaded | None, visuals: Sequence[Visual], only: Sequence[Leaf]) -> tuple[str, str | None]:
    """The name of a body without a given name, and the kind of its only shape. The name is empty if it says nothing.

    `only` are the shapes of a body of one link.
    """
    meshes = [each[4].decode(errors="replace") for each in visuals if only and each[4] != b"unknown_file"]
    kind = only[0].kind.removeprefix("concave ") if len(only) == 1 else None
    return body_name(own, loaded.file if loaded else None, loaded is None or loaded.alone, meshes, kind), kind


def _colors(id: int, seen: Mapping[int, Color], links: Mapping[int, str]) -> dict[int, Color]:
    # Hues a golden ratio apart stay distinct however many bodies there are.
    own = (*colorsys.hsv_to_rgb(id * 0.618034 % 1, 0.5, 0.9), 1.0)
    fallback = next(iter(seen.values()), own)
    return {link: seen.get(link, fallback) for link in links}


def _leaves(client: int, id: int, file: BulletFile, saved: SavedBody) -> dict[int, tuple[Leaf, ...]]:
    leaves = {link: file.leaves(collider.shape) for link, collider in sorted(saved.colliders.items())}
    kinds = {leaf.kind for each in leaves.values() for leaf in each}
    # getCollisionShapeData refuses maximal coordinates, and kills the process on a multi-sphere.
    if body_type(client, id) != MULTIBODY or "multisphere" in kinds:
        return leaves
    return {link: _in_double_precision(client, id, link, each) for link, each in leaves.items()}


def _in_double_precision(client: int, id: int, link: int, leaves: tuple[Leaf, ...]) -> tuple[Leaf, ...]:
    """The leaves of a link with the frames and dimensions that pybullet reports in full precision.

    Leaves are unchanged if pybullet does not report all of them, or would print complaints.
    """
    if not leaves or any(leaf.kind not in (*REPORTED.values(), *MESHES) for leaf in leaves):
        return leaves
    reported = _reported(client, id, link)
    frames = [leaf for leaf in reported if leaf.kind == "hull"]
    primitives = (leaf for leaf in reported if leaf.kind != "hull")
    exact: list[Leaf] = []
    for leaf in leaves:
        if leaf.kind in MESHES:
            # A mesh file of many hulls is reported once.
            frame = min(frames, key=lambda other: sum(_gaps(leaf, other)), default=leaf)
            other = replace(frame, kind=leaf.kind, figures=leaf.figures, margin=leaf.margin)
        else:
            other = next(primitives, leaf)
        exact.append(other if _alike(leaf, other) else leaf)
    return tuple(exact)


def _reported(client: int, id: int, link: int) -> list[Leaf]:
    """The shapes that getCollisionShapeData lists, in the order of the file; hulls without their points."""
    leaves = []
    for _, _, number, size, _, position, orientation in pybullet.getCollisionShapeData(id, link, client):
        kind, dimensions = REPORTED[number], np.array(size)
        figures = {
            "box": dimensions / 2,
            "sphere": dimensions[:1],
            "capsule": dimensions[1::-1],
            "cylinder": dimensions[1::-1],
            "plane": np.append(dimensions, 0.0),
            "hull": np.empty(0),
        }
        leaves.append(Leaf(kind, np.array(position), np.array(orientation), figures[kind]))
    return leaves


def _alike(saved: Leaf, reported: Leaf) -> bool:
    """Whether two leaves are equal up to single precision."""
    if saved.kind != reported.kind or saved.figures.shape != reported.figures.shape:
        return False
    shift, turn = _gaps(saved, reported)
    size = max(np.abs(reported.figures).max(), np.abs(reported.position).max())
    change = np.abs(saved.figures - reported.figures).max()
    # Single precision is 6e-8. The errors of a few nested frames add up.
    return bool(max(shift, change) <= 1e-5 * size and turn <= 1e-5)


def _gaps(a: Leaf, b: Leaf) -> tuple[float, float]:
    """How far apart the frames of two leaves are, in metres and as quaternions."""
    shift = np.abs(a.position - b.position).max()
    turn = min(np.abs(a.orientation - b.orientation).max(), np.abs(a.orientation + b.orientation).max())
    return float(shift), float(turn)
