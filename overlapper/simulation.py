"""The collision shapes of a running pybullet simulation, and their overlaps.

Shapes are read once, poses at every step. Surfaces are the nominal ones: Bullet itself lays a margin of 1 mm around
convex hulls (mesh shapes, and the `<cylinder>` of a URDF, which Bullet makes a 32-gon hull), so that pybullet reports
hulls 1 mm nearer than they are here, and MJCF capsules thinner than 4 cm wrongly. Which bodies the simulator
lets collide (groups, masks, pair filters) is not asked: these are overlaps of geometry.
"""

from __future__ import annotations

import colorsys
import tempfile
import uuid
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import count
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from overlapper import Box, Capsule, Cylinder, HalfSpace, Hull, Overlap, Placed, Shape, Sphere, _core
from overlapper.bullet_file import BulletFile, Leaf, SavedBody

try:
    import pybullet
except ImportError as error:
    raise ImportError("overlapper.simulation needs pybullet: pip install 'overlapper[sim]'") from error

Array = NDArray[np.float64]
Color = tuple[float, float, float, float]

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


class SkippedShapeWarning(UserWarning):
    """A shape of the simulation is not modelled: its overlaps are not found."""


@dataclass(frozen=True, slots=True)
class Contact:
    """Two shapes of different bodies that overlap or touch; `overlap.status` says which.

    Bodies and links are pybullet's indices, link -1 is the base, shapes are counted within their link. bodyA < bodyB;
    `overlap.shapes[0]` is A's, so that `overlap.normal` points from B to A as pybullet's contactNormalOnB does.
    """

    bodyA: int
    linkA: int
    shapeA: int
    bodyB: int
    linkB: int
    shapeB: int
    overlap: Overlap


@dataclass(frozen=True, slots=True)
class Skipped:
    """Shapes of one link (-1 is the base) that are not modelled; `body` is -1 if pybullet gives them no id."""

    body: int
    link: int
    name: str
    reason: str


@dataclass(frozen=True, slots=True)
class Report:
    """How little of a scene had to be modelled.

    `shapes` counts those of the scene, `shapes_read` those modelled, `pairs_possible` the pairs of modelled shapes of
    different bodies that are not both static. The rest is of the last `overlaps()`: pairs whose boxes meet, pairs that
    overlap, facets that took part.
    """

    bodies: int
    shapes: int
    shapes_read: int
    pairs_possible: int
    pairs_examined: int
    pairs_overlapping: int
    facets_touched: int

    def __str__(self) -> str:
        return (
            f"{self.bodies:,} bodies, {self.shapes_read:,} of {self.shapes:,} shapes read\n"
            f"{self.pairs_examined:,} of {self.pairs_possible:,} pairs examined, {self.pairs_overlapping:,} overlap, "
            f"{self.facets_touched:,} facets touched"
        )


class Bodies:
    """The bodies of one pybullet client as convex shapes placed in the world.

        bodies = Bodies(physicsClientId)
        while ...:
            pybullet.stepSimulation(physicsClientId)
            bodies.update()
            for contact in bodies.overlaps():
                ...

    Boxes, spheres, capsules, cylinders, planes and convex meshes are modelled, compounds part by part. What cannot be
    (concave meshes, height fields, soft bodies, flat hulls) is listed in `skipped`, with one SkippedShapeWarning each.

    Bodies that come, go or take over the id of another are noticed by `update()`, which marks every body with a user
    data entry. New bodies are read from a temporary .bullet file; if two stand at the same point, the
    friction of all is set and restored to tell them apart. Bodies that another process adds to a shared simulation are
    noticed after `pybullet.syncBodyInfo()`.

    ValueError if `physicsClientId` is not connected or the simulation has diverged; RuntimeError if the physics server
    writes where this process cannot read.
    """

    def __init__(self, physicsClientId: int = 0) -> None:
        self.physicsClientId = physicsClientId
        self._mark = f"overlapper {uuid.uuid4()}"
        self._bodies: dict[int, _Body] = {}
        self._unidentified = 0
        self._examined: list[Overlap] = []
        self._arrange()
        self._refresh()

    def update(self) -> None:
        """Read the shapes of bodies that are new, then the poses of all. Call it once per step."""
        self._refresh()

    def overlaps(self, tolerance: float = 1e-3, method: Literal["auto", "paper"] = "auto") -> list[Contact]:
        """Pairs of shapes that overlap or touch, sorted by (bodyA, linkA, shapeA, bodyB, linkB, shapeB).

        Pairs within a body are left out, and pairs of static shapes: bases of mass 0, with the links that only fixed
        joints tie to them. `tolerance` and `method` are those of `overlapper.overlap`.
        """
        pairs = self._candidate_pairs()
        overlaps = _core.overlap_pairs(self._shapes, self._positions, self._orientations, pairs, tolerance, method)
        contacts = [
            Contact(*self._keys[int(i)], *self._keys[int(j)], overlap)
            for (i, j), overlap in zip(pairs, overlaps)
            if overlap.status != "separated"
        ]
        self._examined = overlaps
        return contacts

    def report(self) -> Report:
        """How much of the scene was read, and how much of it the last `overlaps()` looked at."""
        owners, static = self._owners, self._static[self._owners] & self._fixed
        return Report(
            bodies=len(self._bodies),
            shapes=sum(body.shape_count for body in self._bodies.values()) + self._unidentified,
            shapes_read=len(self._keys),
            pairs_possible=_pairs_between(owners) - _pairs_between(owners[static]),
            pairs_examined=len(self._examined),
            pairs_overlapping=sum(map(bool, self._examined)),
            facets_touched=sum(overlap.facets_touched for overlap in self._examined),
        )

    @property
    def keys(self) -> list[tuple[int, int, int]]:
        """(body, link, shape) of every modelled shape, sorted; link -1 is the base."""
        return self._keys

    @property
    def shapes(self) -> list[Shape]:
        """The modelled shapes, parallel to `keys`; the same objects from step to step."""
        return self._shapes

    @property
    def positions(self) -> Array:
        """(k, 3) positions in metres of the shapes, not of their links, at the last update; parallel to `keys`."""
        return self._positions

    @property
    def orientations(self) -> Array:
        """(k, 4) unit quaternions xyzw of the shapes, not of their links, at the last update; parallel to `keys`."""
        return self._orientations

    @property
    def placed(self) -> list[Placed]:
        """The shapes where they were at the last update, parallel to `keys`."""
        return [Placed(*each) for each in zip(self._shapes, self._positions, self._orientations)]

    @property
    def colors(self) -> dict[tuple[int, int], Color]:
        """Red, green, blue and alpha in 0..1 by (body, link): of the visual shape, as it was when the body was read.

        A link without a visual shape has its body's colour, a body without any a colour of its own.
        """
        return {(id, link): color for id, body in self._bodies.items() for link, color in body.colors.items()}

    @property
    def names(self) -> dict[tuple[int, int], str]:
        """Names like "panda/panda_hand" by (body, link); those that several would share end in "#" and the id."""
        labels = _distinct({id: body.name for id, body in self._bodies.items()})
        return {
            (id, link): f"{labels[id]}/{name}"
            for id, body in self._bodies.items()
            for link, name in _distinct(body.link_names).items()
        }

    @property
    def skipped(self) -> list[Skipped]:
        """What is not modelled, one entry per body and link."""
        return [each for body in self._bodies.values() for each in body.skipped] + self._skipped_unidentified()

    def _refresh(self) -> None:
        client = self.physicsClientId
        if not pybullet.isConnected(client):
            raise ValueError(f"physicsClientId {client} is not connected to a physics server")
        # After a syncBodyInfo, pybullet would show the user data of a removed body on the one that inherits its id.
        pybullet.syncUserData(physicsClientId=client)
        ids = _ids(client)
        skipped = []
        if ids != self._bodies.keys() or not all(map(self._is_marked, ids)):
            skipped = self._read()
            self._arrange()
        self._pose()
        for each in skipped:
            message = f"{each.name} (body {each.body}, link {each.link}) is left out: {each.reason}"
            # The caller of update() or of Bodies() is three calls up.
            warnings.warn(message, SkippedShapeWarning, stacklevel=3)

    def _is_marked(self, id: int) -> bool:
        return bool(pybullet.getUserDataId(id, self._mark, physicsClientId=self.physicsClientId) >= 0)

    def _read(self) -> list[Skipped]:
        """Read the bodies that are not marked yet, forget those that are gone; what is newly skipped."""
        client = self.physicsClientId
        # Of the bodies that createMultiBody makes from batchPositions, only the last is known before a sync.
        pybullet.syncBodyInfo(client)
        pybullet.syncUserData(physicsClientId=client)
        ids = sorted(_ids(client))
        known = {id: self._bodies[id] for id in ids if id in self._bodies and self._is_marked(id)}
        fresh = [id for id in ids if id not in known]
        unidentified = self._unidentified if ids else 0
        if fresh:
            file, saved = _saved_bodies(client, ids)
            unidentified = len(file.bodies) - len(saved)
        for id in fresh:
            known[id] = _read_body(client, id, file, saved.get(id))
            pybullet.addUserData(id, self._mark, "", physicsClientId=client)
        self._bodies = dict(sorted(known.items()))
        grown, self._unidentified = unidentified > self._unidentified, unidentified
        skipped = [each for id in fresh for each in self._bodies[id].skipped]
        return skipped + (self._skipped_unidentified() if grown else [])

    def _skipped_unidentified(self) -> list[Skipped]:
        if not self._unidentified:
            return []
        reason = "pybullet does not identify the links of robots in maximal coordinates"
        return [Skipped(-1, BASE, f"{self._unidentified} rigid bodies", reason)]

    def _arrange(self) -> None:
        """Lay the shapes of all bodies side by side, for one pass of arithmetic per step."""
        shaped = {id: body.parts for id, body in self._bodies.items() if body.parts}
        parts = [part for each in shaped.values() for part in each]
        self._keys = [(id, part.link, part.index) for id, each in shaped.items() for part in each]
        self._shapes = [part.shape for part in parts]
        self._local_positions = np.array([part.position for part in parts]).reshape(-1, 3)
        self._local_orientations = np.array([part.orientation for part in parts]).reshape(-1, 4)
        self._links = {id: sorted({part.link for part in each} - {BASE}) for id, each in shaped.items()}
        colliders = [(id, link) for id, links in self._links.items() for link in [BASE, *links]]
        rows = {collider: row for row, collider in enumerate(colliders)}
        self._colliders = np.array([rows[id, link] for id, link, _ in self._keys], dtype=int)
        order = {id: row for row, id in enumerate(shaped)}
        self._owners = np.array([order[id] for id, _, _ in self._keys], dtype=int)
        self._fixed = np.array([link in self._bodies[id].fixed_links for id, link, _ in self._keys], dtype=bool)

    def _pose(self) -> None:
        """Place the shapes where their colliders are now, and ask which bases cannot move."""
        client = self.physicsClientId
        rows: list[tuple[float, ...]] = []
        for id, links in self._links.items():
            position, orientation = pybullet.getBasePositionAndOrientation(id, client)
            rows.append(position + orientation)
            if links:
                # Without forward kinematics the poses of links lag one step behind.
                states = pybullet.getLinkStates(id, links, computeForwardKinematics=1, physicsClientId=client)
                rows += [state[0] + state[1] for state in states]
        # changeDynamics may turn a static body into a moving one.
        static = [pybullet.getDynamicsInfo(id, BASE, client)[0] == 0 for id in self._links]
        self._static = np.array(static, dtype=bool)

        poses = np.array(rows).reshape(-1, 7)[self._colliders]
        orientations = poses[:, 3:] / np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
        self._positions: Array = poses[:, :3] + _rotated(orientations, self._local_positions)
        self._orientations: Array = _composed(orientations, self._local_orientations)
        self._positions.flags.writeable = self._orientations.flags.writeable = False
        finite = np.isfinite(poses).all(axis=1)
        if not finite.all():
            body = self._keys[int(np.argmin(finite))][0]
            raise ValueError(f"body {body} ({self._bodies[body].name}) has no finite pose: the simulation has diverged")

    def _candidate_pairs(self) -> NDArray[np.int32]:
        pairs: NDArray[np.int32] = _core.candidate_pairs(self._shapes, self._positions, self._orientations)
        first, second = pairs.T
        static = self._static[self._owners] & self._fixed
        apart = self._owners[first] != self._owners[second]
        return np.asarray(pairs[apart & ~(static[first] & static[second])])


@dataclass(frozen=True, slots=True)
class _Part:
    """A modelled shape, placed in the frame of its collider: the inertial frame of the base or link."""

    link: int
    index: int
    shape: Shape
    position: Array
    orientation: Array


@dataclass(frozen=True, slots=True)
class _Body:
    name: str
    link_names: dict[int, str]
    colors: dict[int, Color]
    fixed_links: frozenset[int]  # the base, and what only fixed joints tie to it
    shape_count: int
    parts: tuple[_Part, ...]
    skipped: tuple[Skipped, ...]


def _ids(client: int) -> set[int]:
    return {pybullet.getBodyUniqueId(i, client) for i in range(pybullet.getNumBodies(client))}


def _body_type(client: int, id: int) -> int:
    return int(pybullet.getDynamicsInfo(id, BASE, client)[10])


def _saved_bodies(client: int, ids: Sequence[int]) -> tuple[BulletFile, dict[int, SavedBody]]:
    """The scene as a .bullet file, and the body of the file for each of `ids` but the soft ones.

    The file has no ids. Position and number of links identify a body unless another shares them; then each
    has a friction of its own while the file is written.
    """
    ids = [id for id in ids if _body_type(client, id) != SOFT_BODY]
    file = _save(client)
    saved = {(body.links, *body.position.tolist()): body for body in file.bodies}
    wanted = {
        id: (pybullet.getNumJoints(id, client), *pybullet.getBasePositionAndOrientation(id, client)[0]) for id in ids
    }
    if len(saved) == len(file.bodies) and len(set(wanted.values())) == len(ids) and saved.keys() >= {*wanted.values()}:
        return file, {id: saved[key] for id, key in wanted.items()}

    taken = {body.friction for body in file.bodies}
    frictions = dict(zip(ids, (float(value) for value in count(1) if value not in taken)))
    with _frictions(client, frictions):
        file = _save(client)
    by_friction = {body.friction: body for body in file.bodies}
    return file, {id: by_friction[friction] for id, friction in frictions.items() if friction in by_friction}


def _save(client: int) -> BulletFile:
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


def _read_body(client: int, id: int, file: BulletFile, saved: SavedBody | None) -> _Body:
    base, name = (text.decode(errors="replace") for text in pybullet.getBodyInfo(id, client))
    name = name or f"body {id}"
    joints = [pybullet.getJointInfo(id, joint, client) for joint in range(pybullet.getNumJoints(id, client))]
    link_names = {BASE: base or "base"} | {joint[0]: joint[12].decode(errors="replace") for joint in joints}
    welds = {joint[0]: joint[16] for joint in joints if joint[2] == pybullet.JOINT_FIXED}
    fixed_links = frozenset(link for link in link_names if _is_tied_to_base(link, welds))
    leaves = _leaves(client, id, file, saved) if saved else {}
    parts: list[_Part] = []
    skipped: list[Skipped] = []
    for link, each in leaves.items():
        modelled, reasons = _modelled(link, each)
        parts += modelled
        if reasons:
            skipped.append(Skipped(id, link, f"{name}/{link_names[link]}", _summary(reasons, len(each))))
    if not saved:
        soft = _body_type(client, id) == SOFT_BODY
        skipped.append(Skipped(id, BASE, name, "a soft body is not modelled" if soft else "saveBullet leaves it out"))
    shape_count = sum(map(len, leaves.values())) if saved else 1
    colors = _colors(client, id, link_names)
    return _Body(name, link_names, colors, fixed_links, shape_count, tuple(parts), tuple(skipped))


def _is_tied_to_base(link: int, welds: Mapping[int, int]) -> bool:
    """Whether only fixed joints, given as child and parent, are between a link and the base."""
    while link in welds:
        link = welds[link]
    return link == BASE


def _colors(client: int, id: int, links: Mapping[int, str]) -> dict[int, Color]:
    seen: dict[int, Color] = {}
    for visual in pybullet.getVisualShapeData(id, physicsClientId=client):
        seen.setdefault(visual[1], visual[7])
    # Hues a golden ratio apart stay distinct however many bodies there are.
    own = (*colorsys.hsv_to_rgb(id * 0.618034 % 1, 0.5, 0.9), 1.0)
    fallback = next(iter(seen.values()), own)
    return {link: seen.get(link, fallback) for link in links}


def _leaves(client: int, id: int, file: BulletFile, saved: SavedBody) -> dict[int, tuple[Leaf, ...]]:
    leaves = {link: file.leaves(address) for link, address in sorted(saved.shapes.items())}
    kinds = {leaf.kind for each in leaves.values() for leaf in each}
    # getCollisionShapeData refuses maximal coordinates, and kills the process on a multi-sphere.
    if _body_type(client, id) != MULTIBODY or "multisphere" in kinds:
        return leaves
    return {link: _in_double_precision(client, id, link, each) for link, each in leaves.items()}


def _in_double_precision(client: int, id: int, link: int, leaves: tuple[Leaf, ...]) -> tuple[Leaf, ...]:
    """The leaves of a link with the frames and dimensions that pybullet reports in full precision.

    As they came if pybullet does not report all of them, or would print complaints.
    """
    if not leaves or any(leaf.kind not in REPORTED.values() for leaf in leaves):
        return leaves
    reported = _reported(client, id, link)
    frames = [leaf for leaf in reported if leaf.kind == "hull"]
    primitives = (leaf for leaf in reported if leaf.kind != "hull")
    exact: list[Leaf] = []
    for leaf in leaves:
        if leaf.kind == "hull":
            # A mesh file of many hulls is reported once.
            frame = min(frames, key=lambda other: sum(_gaps(leaf, other)), default=leaf)
            other = replace(frame, figures=leaf.figures)
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


def _modelled(link: int, leaves: tuple[Leaf, ...]) -> tuple[list[_Part], list[str]]:
    """The leaves of a link as shapes, and a reason for each that has none."""
    parts: list[_Part] = []
    reasons: list[str] = []
    for index, saved in enumerate(leaves):
        leaf = _capsule(saved) if saved.kind == "multisphere" else saved
        try:
            shape = _shape(leaf.kind, leaf.figures.tobytes())
        except ValueError as error:
            reasons.append(str(error))
        else:
            parts.append(_Part(link, index, shape, leaf.position, leaf.orientation))
    return parts, reasons


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
    position = leaf.position + _rotated(leaf.orientation, centres.mean(axis=0))
    orientation = _composed(leaf.orientation, turn / np.linalg.norm(turn))
    return Leaf("capsule", position, orientation, np.array([radii[0], length]))


@lru_cache(maxsize=1024)
def _shape(kind: str, data: bytes) -> Shape:
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
            return Hull(figures.reshape(-1, 3))
        case "multisphere":
            raise ValueError("the hull of unequal spheres is not modelled")
        case _:
            raise ValueError(f"a {kind} is not modelled")


def _summary(reasons: Sequence[str], shapes: int) -> str:
    if shapes == 1:
        return reasons[0]
    return "; ".join(f"{number} of {shapes} shapes: {reason}" for reason, number in Counter(reasons).items())


def _distinct(names: Mapping[int, str]) -> dict[int, str]:
    number = Counter(names.values())
    return {id: name if number[name] == 1 else f"{name}#{id}" for id, name in names.items()}


def _pairs_between(owners: NDArray[Any]) -> int:
    """Number of pairs of shapes with different owners."""
    return int(len(owners) ** 2 - (np.bincount(owners) ** 2).sum()) // 2


def _rotated(quaternions: Array, vectors: Array) -> Array:
    """Vectors (..., 3) turned by unit quaternions (..., 4) xyzw."""
    axis, w = quaternions[..., :3], quaternions[..., 3:]
    twice = 2 * np.cross(axis, vectors)
    return np.asarray(vectors + w * twice + np.cross(axis, twice))


def _composed(first: Array, second: Array) -> Array:
    """The products first * second of quaternions (..., 4) xyzw: turn by the second, then by the first."""
    a, b, v, w = first[..., :3], second[..., :3], first[..., 3:], second[..., 3:]
    vector = v * b + w * a + np.cross(a, b)
    return np.concatenate([vector, v * w - (a * b).sum(axis=-1, keepdims=True)], axis=-1)
