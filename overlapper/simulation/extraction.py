"""The collision shapes of a pybullet client, read once: convex shapes in the frames of their links.

A temporary .bullet file has all of them; pybullet's own report adds the digits that single precision cuts off.
"""

from __future__ import annotations

import colorsys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import count
from pathlib import Path
from typing import Literal, get_args

import numpy as np
import pybullet
from numpy.typing import NDArray

from overlapper import Box, Capsule, Cylinder, HalfSpace, Hull, RoundedHull, Shape, Sphere
from overlapper.polytopes.decomposition import Decomposition, NotDecomposed, check_threshold, decompose
from overlapper.quaternion import composed, rotated
from overlapper.simulation.bullet_file import BulletFile, Leaf, SavedBody
from overlapper.simulation.height_field import HeightField

Array = NDArray[np.float64]
Color = tuple[float, float, float, float]
Concave = Literal["decompose", "enclose", "skip"]
Surface = Literal["nominal", "margin"]

BASE = -1
MULTIBODY, SOFT_BODY = 2, 3  # of getDynamicsInfo; 1 is a rigid body in maximal coordinates
REPORTED = {  # by getCollisionShapeData
    pybullet.GEOM_MESH: "hull",
    pybullet.GEOM_BOX: "box",
    pybullet.GEOM_SPHERE: "sphere",
    pybullet.GEOM_CAPSULE: "capsule",
    pybullet.GEOM_CYLINDER: "cylinder",
    pybullet.GEOM_PLANE: "plane",
}
MESHES = ("hull", "concave mesh")  # both reported as GEOM_MESH


@dataclass(frozen=True, slots=True)
class Skipped:
    """Shapes of one link (-1 is the base) that are not modelled; `body` is -1 if pybullet gives them no id."""

    body: int
    link: int
    name: str
    reason: str


@dataclass(frozen=True, slots=True)
class Decomposed:
    """A concave mesh of one link (-1 is the base), modelled as the union of convex parts: the shapes `shapes` of it.

    `volume` (m³) is that of the parts together, `mesh_volume` what the mesh bounds; None where its surface is open or
    turns both ways. `path` is where the parts are kept on disk, None if the mesh had them already and they are exact.
    """

    body: int
    link: int
    name: str
    shapes: range
    volume: float
    mesh_volume: float | None
    path: Path | None


@dataclass(frozen=True, slots=True)
class Part:
    """A modelled shape, placed in the frame of its collider: the inertial frame of the base or link."""

    link: int
    index: int
    shape: Shape
    position: Array
    orientation: Array


@dataclass(frozen=True, slots=True)
class Ground:
    """A height field, placed in the frame of its collider."""

    field: HeightField
    position: Array
    orientation: Array

    def part(self, number: int) -> Part:
        return Part(BASE, number, self.field.prism(number), self.position, self.orientation)


@dataclass(frozen=True, slots=True)
class Settings:
    """How shapes are modelled: see `simulation.Bodies`. ValueError if there is no such way."""

    concave: Concave
    threshold: float
    surface: Surface

    def __post_init__(self) -> None:
        for name, choices in (("concave", get_args(Concave)), ("surface", get_args(Surface))):
            if (chosen := getattr(self, name)) not in choices:
                raise ValueError(f"{name} must be one of {', '.join(map(repr, choices))}, not {chosen!r}")
        check_threshold(self.threshold)


@dataclass(frozen=True, slots=True)
class Body:
    name: str
    link_names: dict[int, str]
    colors: dict[int, Color]
    parents: dict[int, int]  # of each link
    margin: float  # of the base's outermost shape
    shape_count: int
    parts: tuple[Part, ...]
    skipped: tuple[Skipped, ...]
    decomposed: tuple[Decomposed, ...]
    ground: Ground | None = None  # of which `parts` are the prisms modelled so far


def body_ids(client: int) -> set[int]:
    return {pybullet.getBodyUniqueId(i, client) for i in range(pybullet.getNumBodies(client))}


def _body_type(client: int, id: int) -> int:
    return int(pybullet.getDynamicsInfo(id, BASE, client)[10])


def saved_bodies(client: int, ids: Sequence[int]) -> tuple[BulletFile, dict[int, int]]:
    """The scene as a .bullet file, and the place in the file of each of `ids` but the soft ones.

    The file has no ids. Position and number of links identify a body unless another shares them or pybullet hides
    its position; then each has a friction of its own while the file is written.
    """
    ids = [id for id in ids if _body_type(client, id) != SOFT_BODY]
    file = save(client)
    saved = {(body.links, *body.position.tolist()): row for row, body in enumerate(file.bodies)}
    wanted = {id: (pybullet.getNumJoints(id, client), *_base_position(client, id)) for id in ids}
    if len(saved) == len(file.bodies) and len(set(wanted.values())) == len(ids) and saved.keys() >= {*wanted.values()}:
        return file, {id: saved[key] for id, key in wanted.items()}

    taken = {body.friction for body in file.bodies}
    frictions = dict(zip(ids, (float(value) for value in count(1) if value not in taken)))
    with _frictions(client, frictions):
        file = save(client)
    by_friction = {body.friction: row for row, body in enumerate(file.bodies)}
    return file, {id: by_friction[friction] for id, friction in frictions.items() if friction in by_friction}


def hides_pose(client: int, id: int) -> bool:
    """Whether pybullet tells no poses of this body, as of one with more than 128 links; the .bullet file has them."""
    return not _base_position(client, id)


def _base_position(client: int, id: int) -> tuple[float, ...]:
    try:
        return tuple(pybullet.getBasePositionAndOrientation(id, client)[0])
    except pybullet.error:
        return ()


def save(client: int) -> BulletFile:
    with tempfile.TemporaryDirectory(prefix="overlapper-") as folder:
        path = Path(folder) / "scene.bullet"
        try:
            pybullet.saveBullet(str(path), physicsClientId=client)
            return BulletFile(path)
        except (pybullet.error, OSError) as error:
            raise RuntimeError(
                f"the physics server of physicsClientId {client} could not hand over its shapes in {path}: "
                "it must run on this machine and be allowed to write there"
            ) from error


@contextmanager
def _frictions(client: int, frictions: Mapping[int, float]) -> Iterator[None]:
    before = {id: pybullet.getDynamicsInfo(id, BASE, client)[1] for id in frictions}
    try:
        for id, friction in frictions.items():
            pybullet.changeDynamics(id, BASE, lateralFriction=friction, physicsClientId=client)
        yield
    finally:
        for id, friction in before.items():
            pybullet.changeDynamics(id, BASE, lateralFriction=friction, physicsClientId=client)


def read_body(
    client: int,
    id: int,
    file: BulletFile,
    saved: SavedBody | None,
    settings: Settings,
    field: HeightField | None = None,
) -> Body:
    """A body as it is in a .bullet file, and in pybullet; `field` is the height field that it is known to be."""
    base, name = (text.decode(errors="replace") for text in pybullet.getBodyInfo(id, client))
    name = name or f"body {id}"
    joints = [pybullet.getJointInfo(id, joint, client) for joint in range(pybullet.getNumJoints(id, client))]
    link_names = {BASE: base or "base"} | {joint[0]: joint[12].decode(errors="replace") for joint in joints}
    parents = {joint[0]: joint[16] for joint in joints}
    leaves = _leaves(client, id, file, saved) if saved else {}
    parts: list[Part] = []
    skipped: list[Skipped] = []
    decomposed: list[Decomposed] = []
    shape_count = 0 if saved else 1
    ground = None
    if field and [leaf.kind for leaf in leaves.get(BASE, ())] == ["height field"]:
        (leaf,) = leaves.pop(BASE)
        ground = Ground(field, leaf.position, leaf.orientation)
        shape_count += field.count
    for link, each in leaves.items():
        shapes, reasons, meshes = modelled(link, each, settings)
        parts += shapes
        count = len(shapes) + len(reasons)
        shape_count += count
        label = f"{name}/{link_names[link]}"
        if reasons:
            skipped.append(Skipped(id, link, label, summary(reasons, count)))
        decomposed += [
            Decomposed(id, link, label, numbers, mesh.volume, mesh.mesh_volume, mesh.path) for numbers, mesh in meshes
        ]
    if not saved:
        soft = _body_type(client, id) == SOFT_BODY
        skipped.append(Skipped(id, BASE, name, "a soft body is not modelled" if soft else "saveBullet leaves it out"))
    colors = _colors(client, id, link_names)
    margin = pybullet.getDynamicsInfo(id, BASE, client)[11]
    return Body(
        name,
        link_names,
        colors,
        parents,
        margin,
        shape_count,
        tuple(parts),
        tuple(skipped),
        tuple(decomposed),
        ground,
    )


def _colors(client: int, id: int, links: Mapping[int, str]) -> dict[int, Color]:
    seen: dict[int, Color] = {}
    for visual in pybullet.getVisualShapeData(id, physicsClientId=client):
        seen.setdefault(visual[1], visual[7])
    # Hues a golden ratio apart stay distinct however many bodies there are.
    own = (*colorsys.hsv_to_rgb(id * 0.618034 % 1, 0.5, 0.9), 1.0)
    fallback = next(iter(seen.values()), own)
    return {link: seen.get(link, fallback) for link in links}


def _leaves(client: int, id: int, file: BulletFile, saved: SavedBody) -> dict[int, tuple[Leaf, ...]]:
    leaves = {link: file.leaves(collider.shape) for link, collider in sorted(saved.colliders.items())}
    kinds = {leaf.kind for each in leaves.values() for leaf in each}
    # getCollisionShapeData refuses maximal coordinates, and kills the process on a multi-sphere.
    if _body_type(client, id) != MULTIBODY or "multisphere" in kinds:
        return leaves
    return {link: _in_double_precision(client, id, link, each) for link, each in leaves.items()}


def _in_double_precision(client: int, id: int, link: int, leaves: tuple[Leaf, ...]) -> tuple[Leaf, ...]:
    """The leaves of a link with the frames and dimensions that pybullet reports in full precision.

    As they came if pybullet does not report all of them, or would print complaints.
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
    """What getCollisionShapeData lists, in the order of the file; hulls without their points."""
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
    """Whether two leaves are the same but for single precision."""
    if saved.kind != reported.kind or saved.figures.shape != reported.figures.shape:
        return False
    shift, turn = _gaps(saved, reported)
    size = max(np.abs(reported.figures).max(), np.abs(reported.position).max())
    change = np.abs(saved.figures - reported.figures).max()
    # Single precision is 6e-8; a few nested frames add up.
    return bool(max(shift, change) <= 1e-5 * size and turn <= 1e-5)


def _gaps(a: Leaf, b: Leaf) -> tuple[float, float]:
    """How far apart the frames of two leaves are, in metres and as quaternions."""
    shift = np.abs(a.position - b.position).max()
    turn = min(np.abs(a.orientation - b.orientation).max(), np.abs(a.orientation + b.orientation).max())
    return float(shift), float(turn)


def modelled(
    link: int, leaves: tuple[Leaf, ...], settings: Settings
) -> tuple[list[Part], list[str], list[tuple[range, Decomposition]]]:
    """The leaves of a link as shapes, a reason for each that has none, and which shapes are parts of a concave mesh."""
    parts: list[Part] = []
    reasons: list[str] = []
    meshes: list[tuple[range, Decomposition]] = []
    for saved in leaves:
        leaf = _capsule(saved) if saved.kind == "multisphere" else saved
        first = len(parts) + len(reasons)
        try:
            shapes: Sequence[Shape]
            if leaf.kind == "concave mesh":
                mesh = _solid(leaf.figures.tobytes(), settings)
                shapes = mesh.parts
                meshes.append((range(first, first + len(shapes)), mesh))
            else:
                margin = leaf.margin if settings.surface == "margin" else 0.0
                shapes = [_shape(leaf.kind, leaf.figures.tobytes(), margin)]
        except ValueError as error:
            reasons.append(str(error))
        else:
            parts += [
                Part(link, index, shape, leaf.position, leaf.orientation) for index, shape in enumerate(shapes, first)
            ]
    return parts, reasons, meshes


def _solid(data: bytes, settings: Settings) -> Decomposition:
    """A concave mesh as convex parts. NotDecomposed says why there are none."""
    if settings.concave == "skip":
        raise NotDecomposed("a concave mesh is left out, as concave='skip' asks")
    found = _decomposition(data, settings.concave == "enclose", settings.threshold)
    if isinstance(found, NotDecomposed):
        raise NotDecomposed(str(found))
    return found


@lru_cache(maxsize=64)
def _decomposition(data: bytes, enclose: bool, threshold: float) -> Decomposition | NotDecomposed:
    """Of a mesh that many bodies may have; also the failure is kept, as it may have taken minutes."""
    try:
        return decompose(np.frombuffer(data).reshape(-1, 3, 3), threshold, enclose)
    except NotDecomposed as error:
        return error


def _capsule(leaf: Leaf) -> Leaf:
    """The capsule that a multi-sphere of two equal spheres is; any other multi-sphere as it came."""
    centres, radii = leaf.figures[:, :3], leaf.figures[:, 3]
    if len(radii) != 2 or radii[0] != radii[1]:
        return leaf
    axis = centres[1] - centres[0]
    length = float(np.linalg.norm(axis))
    if axis[2] < 0:
        axis = -axis
    # The shortest turn of z into the axis is (z × axis, length + z·axis).
    turn = np.array([-axis[1], axis[0], 0.0, length + axis[2]]) if length else np.array([0.0, 0.0, 0.0, 1.0])
    position = leaf.position + rotated(leaf.orientation, centres.mean(axis=0))
    orientation = composed(leaf.orientation, turn / np.linalg.norm(turn))
    return Leaf("capsule", position, orientation, np.array([radii[0], length]))


@lru_cache(maxsize=1024)
def _shape(kind: str, data: bytes, margin: float) -> Shape:
    """The shape with these figures of a leaf; equal ones are one object. ValueError says why there is none."""
    figures = np.frombuffer(data)
    match kind:
        case "box":
            return Box(figures)
        case "sphere":
            return Sphere(*figures)
        case "capsule":
            return Capsule(*figures)
        case "cylinder":
            return Cylinder(*figures)
        case "plane":
            return HalfSpace(figures[:3], figures[3])
        case "hull":
            points = figures.reshape(-1, 3)
            return RoundedHull(points, margin) if margin else Hull(points)
        case "multisphere":
            raise ValueError("the hull of unequal spheres is not modelled")
        case "height field":
            raise ValueError("a height field is modelled only if a Recorder has noted its heightfieldData")
        case _:
            raise ValueError(f"a {kind} is not modelled")


def summary(reasons: Sequence[str], shapes: int) -> str:
    if shapes == 1:
        return reasons[0]
    return "; ".join(f"{number} of {shapes} shapes: {reason}" for reason, number in Counter(reasons).items())
