"""The bodies of a pybullet client: their shapes, read once, and their poses, read at every step."""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import pybullet
from numpy.typing import NDArray

from overlapper import Batch, Overlaps, Placed, Shape, _core, overlaps
from overlapper.simulation.body_marks import Marks
from overlapper.simulation.bullet_file import BulletFile
from overlapper.simulation.collider_poses import ColliderPoses
from overlapper.simulation.collision_rules import Colliders, CollisionRules, Who, pair_codes
from overlapper.simulation.contacts import Contacts
from overlapper.simulation.extraction import (
    BASE,
    Array,
    Body,
    Color,
    Concave,
    Decomposed,
    Settings,
    Skipped,
    Surface,
    body_ids,
    hides_pose,
    read_body,
    saved_bodies,
)
from overlapper.simulation.height_field import GroundBelow
from overlapper.simulation.recorder import Recorder

Among = Literal["simulated", "all"] | Iterable[tuple[Who, Who]]


class SkippedShapeWarning(UserWarning):
    """A shape of the simulation is not modelled: its overlaps are not found."""


@dataclass(frozen=True, slots=True)
class Report:
    """How little of a scene had to be modelled.

    `shapes` counts those of the scene, `shapes_read` those modelled. The rest is of the last `overlaps()`:
    `pairs_possible` are the pairs of modelled shapes it was asked about, by default those that the simulator lets
    collide, then follow pairs whose boxes meet, pairs that overlap, those of them that were measured again in wider
    arithmetic (see `Overlap.widened`), facets that took part, and planes asked for (see `Overlaps.planes_asked`).
    """

    bodies: int
    shapes: int
    shapes_read: int
    pairs_possible: int
    pairs_examined: int
    pairs_overlapping: int
    pairs_widened: int
    facets_touched: int
    planes_asked: int

    def __str__(self) -> str:
        widened = f"{self.pairs_widened:,} of them" if self.pairs_widened else "none of them"
        return (
            f"{self.bodies:,} bodies, {self.shapes_read:,} of {self.shapes:,} shapes read\n"
            f"{self.pairs_examined:,} of {self.pairs_possible:,} pairs examined, "
            f"{self.planes_asked:,} planes asked, {self.facets_touched:,} facets touched\n"
            f"{self.pairs_overlapping:,} overlap, {widened} measured again in wider arithmetic"
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
    (soft bodies, flat hulls, height fields without a recorder) is in `skipped`, with one SkippedShapeWarning each.

    Concave meshes are decomposed into convex parts, which count as so many shapes of their link and are listed in
    `decomposed`; `concave_threshold`, from 0.01 to 1, is the concavity that may be left (see
    overlapper.polytopes.decomposition). It takes up to minutes the first time, and needs the extra `concave`. A mesh
    whose surface is open bounds no volume and is skipped; with concave="enclose" CoACD lays walls around it. With
    concave="skip" all concave meshes are.

    With surface="margin" convex meshes have the margin that Bullet lays around them, 1 mm by default, so that depths
    are those of pybullet's contact distances. Boxes and cylinders are the same either way: their margin lies inside,
    though Bullet rounds their edges by it in most pairs, which takes up to 0.73 mm off a corner. Convex parts of
    concave meshes have none. A margin that changes is noticed by `update()` where `getDynamicsInfo` of the base tells.

    Pairs are those that pybullet lets collide, by static bases, groups and masks; a `recorder`, set up before the scene
    is built, adds what pybullet cannot be asked for: pair filters, the filter mode and self-collision. `pairs` and
    `overlaps` take other choices. Groups and masks are read again with new bodies, when a base becomes static or
    ceases to be, and when a recorder hears of a change.

    Height fields that a recorder has noted are modelled as the prisms below their triangles, near what may meet them,
    more and more of them as bodies move. `report()` counts all triangles, and as read those modelled.

    Bodies that come, go or take over the id of another are noticed by `update()`, which marks every body with a user
    data entry. New bodies are read from a temporary .bullet file; if two stand at the same point, the
    friction of all is set and restored to tell them apart. Bodies that another process adds to a shared simulation are
    noticed after `pybullet.syncBodyInfo()`.

    ValueError if `physicsClientId` is not connected, the recorder is of another client or the simulation has diverged;
    RuntimeError if the physics server writes where this process cannot read.
    """

    def __init__(
        self,
        physicsClientId: int = 0,
        *,
        concave: Concave = "decompose",
        concave_threshold: float = 0.05,
        surface: Surface = "nominal",
        recorder: Recorder | None = None,
    ) -> None:
        if recorder and recorder.physicsClientId != physicsClientId:
            raise ValueError(f"recorder is of client {recorder.physicsClientId}, not of {physicsClientId}")
        self.physicsClientId = physicsClientId
        self._settings = Settings(concave, concave_threshold, surface)
        self._recorder = recorder
        self._marks = Marks(physicsClientId)
        self._bodies: dict[int, Body] = {}
        self._unidentified = 0
        self._rows: dict[int, int] = {}  # in a .bullet file, of the bodies whose poses have no other source
        self._filters: dict[tuple[int, int], tuple[int, int]] = {}  # group and mask by body and link
        self._noted = (0, 0)  # of the recorder, changes and masks set
        self._static: list[bool] = []
        self._asked: str | int = "simulated"  # of the last overlaps(); how many, if it was a list
        self._arrange()
        self._rules = self._current_rules()
        self._refresh()
        self._found = overlaps([], np.empty((0, 3)), np.empty((0, 4)))

    def update(self) -> None:
        """Read the shapes of new bodies and changed filters, then all poses. Call it once per step.

        Whether a base has become static, its mass 0, is asked when it has not moved since the last update.
        """
        self._refresh()

    def overlaps(
        self,
        tolerance: float = 1e-3,
        method: Literal["auto", "paper"] = "auto",
        threads: int | None = 1,
        pairs: Among = "simulated",
    ) -> Contacts:
        """Pairs of shapes that overlap or touch, sorted by (bodyA, linkA, shapeA, bodyB, linkB, shapeB).

        `tolerance`, `method` and `threads` are those of `overlapper.overlaps`, `pairs` is what `Bodies.pairs` is asked
        for. What is found is kept for the next call: pairs of which neither shape has moved by a bit cost nothing.
        """
        among: Among = pairs if isinstance(pairs, str) else list(pairs)
        candidates = self.pairs(among)
        self._asked = among if isinstance(among, str) else len(self._codes(among))
        self._found = self._batch.overlaps(
            self._positions, self._orientations, candidates, tolerance, threads, method, separated=False
        )
        return Contacts(self._key_rows, self._found)

    def pairs(self, among: Among = "simulated") -> NDArray[np.int32]:
        """(n, 2) pairs of shapes whose boxes meet, as places in `keys`: each once, the lesser first, sorted.

        "simulated" are those that the simulator lets collide, "all" those of different bodies, whatever it does. Any
        other choice is a list of pairs of bodies, links (body, link) or shapes (body, link, shape), as
        [(robot, table), ((robot, 8), (robot, 3))]; it may name two links of one body, and no filter is asked.
        A body paired with itself stands for all pairs of its links. ValueError if there is no such body or link.
        """
        pairs: NDArray[np.int32] = self._batch.candidate_pairs(self._positions, self._orientations)
        return np.asarray(pairs[self._chosen(pairs, among)])

    def partners(self) -> dict[tuple[int, int], list[tuple[int, int]]]:
        """The links that the simulator lets each link collide with, by (body, link), of those that have shapes."""
        return self._rules.partners(np.unique(self._colliders))

    def report(self) -> Report:
        """How much of the scene was read, and how much of it the last `overlaps()` looked at."""
        found = self._found
        return Report(
            bodies=len(self._bodies),
            shapes=sum(body.shape_count for body in self._bodies.values()) + self._unidentified,
            shapes_read=len(self._keys),
            pairs_possible=self._pairs_possible(),
            pairs_examined=found.examined,
            pairs_overlapping=int((found.status == Overlaps.OVERLAPPING).sum()),
            pairs_widened=int(found.widened.sum()),
            facets_touched=int(found.facets_touched.sum()),
            planes_asked=found.planes_asked,
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
    def decomposed(self) -> list[Decomposed]:
        """The concave meshes that are modelled as unions of convex parts."""
        return [each for body in self._bodies.values() for each in body.decomposed]

    @property
    def skipped(self) -> list[Skipped]:
        """What is not modelled, one entry per body and link."""
        return [each for body in self._bodies.values() for each in body.skipped] + self._skipped_unidentified()

    def _refresh(self) -> None:
        client = self.physicsClientId
        if not pybullet.isConnected(client):
            raise ValueError(f"physicsClientId {client} is not connected to a physics server")
        skipped, fresh = [], False
        if self._margins_changed() or self._ground_changed() or not self._marks.are_as_remembered():
            # After a syncBodyInfo, pybullet would show the user data of a removed body on the one that inherits its id.
            pybullet.syncUserData(physicsClientId=client)
            ids = body_ids(client)
            fresh = ids != self._bodies.keys() or not all(map(self._marks.is_on, ids))
            if fresh:
                skipped = self._read()
                self._arrange()
            self._marks.remember(self._bodies)
        self._pose()
        self._follow_filters(fresh)
        if self._grounds and self._reach_ground():
            self._arrange()
            self._pose()
        for each in skipped:
            message = f"{each.name} (body {each.body}, link {each.link}) is left out: {each.reason}"
            # The caller of update() or of Bodies() is three calls up.
            warnings.warn(message, SkippedShapeWarning, stacklevel=3)

    def _margins_changed(self) -> bool:
        """Whether a base has another margin than before, where that counts; its body is then new."""
        if self._settings.surface == "nominal":
            return False
        client = self.physicsClientId
        watched = body_ids(client).intersection(self._poses.bodies)
        margins = {id: pybullet.getDynamicsInfo(id, BASE, client)[11] for id in watched}
        changed = [id for id, margin in margins.items() if margin != self._bodies[id].margin]
        for id in changed:
            del self._bodies[id]
        return bool(changed)

    def _ground_changed(self) -> bool:
        """Whether a height field has been given other heights; its body is then new."""
        grounds = {id: body.ground for id, body in self._bodies.items() if body.ground}
        for id, ground in grounds.items():
            if self._recorder and self._recorder.height_field(id) is not ground.field:
                del self._bodies[id]
        return len(grounds) > sum(1 for id in grounds if id in self._bodies)

    def _reach_ground(self) -> bool:
        """Model the ground of height fields below what the simulator lets meet it; whether that is more than before."""
        grown = False
        for id, below in self._grounds.items():
            own = np.full(len(self._colliders), self._collider_rows[id, BASE])
            first, second = np.minimum(own, self._colliders), np.maximum(own, self._colliders)
            meets = (self._owners != id) & self._rules.allow(first, second)
            position, orientation = map(np.array, pybullet.getBasePositionAndOrientation(id, self.physicsClientId))
            numbers = below.reached(position, orientation, self._positions, self._reach, meets)
            body = self._bodies[id]
            new = numbers - {part.index for part in body.parts}
            if new and body.ground:
                parts = sorted((*body.parts, *map(body.ground.part, new)), key=lambda part: part.index)
                self._bodies[id] = replace(body, parts=tuple(parts))
                grown = True
        return grown

    def _read(self) -> list[Skipped]:
        """Read the bodies that are not marked yet, forget those that are gone; what is newly skipped."""
        client = self.physicsClientId
        # Of the bodies that createMultiBody makes from batchPositions, only the last is known before a sync.
        pybullet.syncBodyInfo(client)
        pybullet.syncUserData(physicsClientId=client)
        ids = sorted(body_ids(client))
        known = {id: self._bodies[id] for id in ids if id in self._bodies and self._marks.is_on(id)}
        fresh = [id for id in ids if id not in known]
        hidden = [id for id in ids if hides_pose(client, id)]
        unidentified, self._rows = (self._unidentified if ids else 0), {}
        if fresh or hidden:
            file, rows = saved_bodies(client, ids)
            self._take_filters(file, rows)
            unidentified = len(file.bodies) - len(rows)
            self._rows = {id: rows[id] for id in hidden if id in rows}
        for id in fresh:
            body = file.bodies[rows[id]] if id in rows else None
            field = self._recorder.height_field(id) if self._recorder else None
            known[id] = read_body(client, id, file, body, self._settings, field)
            self._marks.put(id)
        self._bodies = dict(sorted(known.items()))
        grown, self._unidentified = unidentified > self._unidentified, unidentified
        skipped = [each for id in fresh for each in self._bodies[id].skipped]
        return skipped + (self._skipped_unidentified() if grown else [])

    def _take_filters(self, file: BulletFile, rows: Mapping[int, int]) -> None:
        self._filters = {
            (id, link): (collider.group, collider.mask)
            for id, row in rows.items()
            for link, collider in file.bodies[row].colliders.items()
        }

    def _follow_filters(self, fresh: bool) -> None:
        """Read groups and masks again if they may have changed since, and take over what the recorder has noted."""
        client = self.physicsClientId
        # changeDynamics gives a base the group of static or of moving bodies as it becomes one.
        static = self._poses.static.copy()
        noted = (self._recorder.changes, self._recorder.masks_set) if self._recorder else (0, 0)
        changed = static != self._static or noted[1] != self._noted[1]
        if changed and not fresh:
            self._take_filters(*saved_bodies(client, sorted(self._bodies)))
        if changed or fresh or noted != self._noted:
            self._rules = self._current_rules()
        self._static, self._noted = static, noted

    def _current_rules(self) -> CollisionRules:
        filters = [self._filters.get(each, (1, -1)) for each in self._collider_rows]
        group, mask = np.array(filters, dtype=int).reshape(-1, 2).T
        owners = np.array([id for id, _ in self._collider_rows], dtype=int)
        parents = {id: body.parents for id, body in self._bodies.items()}
        return CollisionRules(Colliders(self._collider_rows, owners, group, mask, parents), self._recorder)

    def _skipped_unidentified(self) -> list[Skipped]:
        if not self._unidentified:
            return []
        reason = "pybullet does not identify the links of robots in maximal coordinates"
        return [Skipped(-1, BASE, f"{self._unidentified} rigid bodies", reason)]

    def _arrange(self) -> None:
        """Lay the shapes of all bodies side by side, for one pass of arithmetic per step."""
        shaped = {id: body.parts for id, body in self._bodies.items() if body.parts or body.ground}
        parts = [part for each in shaped.values() for part in each]
        self._keys = [(id, part.link, part.index) for id, each in shaped.items() for part in each]
        self._key_rows = np.array(self._keys, dtype=np.int64).reshape(-1, 3)
        self._shapes = [part.shape for part in parts]
        # How far each reaches from its own origin; planes reach everywhere, but meet no ground.
        reach = [np.abs(shape.bounds).max(axis=0) for shape in self._shapes] if self._has_ground() else []
        self._reach = np.linalg.norm(np.array(reach).reshape(-1, 3), axis=1)
        self._batch = Batch(self._shapes)
        self._local_positions = np.array([part.position for part in parts]).reshape(-1, 3)
        self._local_orientations = np.array([part.orientation for part in parts]).reshape(-1, 4)
        links = {id: sorted({part.link for part in each} - {BASE}) for id, each in shaped.items()}
        self._poses = ColliderPoses(self.physicsClientId, links, self._rows)
        self._collider_rows = {each: row for row, each in enumerate(sorted(self._poses.colliders))}
        self._colliders = np.array([self._collider_rows[id, link] for id, link, _ in self._keys], dtype=int)
        frames = {each: row for row, each in enumerate(self._poses.colliders)}
        self._frames = np.array([frames[id, link] for id, link, _ in self._keys], dtype=np.int64)
        self._owners = np.array([id for id, _, _ in self._keys], dtype=int)
        self._listed: tuple[list[tuple[Who, Who]], NDArray[np.int64]] | None = None
        self._grounds = {id: GroundBelow(body.ground) for id, body in self._bodies.items() if body.ground}

    def _has_ground(self) -> bool:
        return any(body.ground for body in self._bodies.values())

    def _pose(self) -> None:
        """Place the shapes where their colliders are now."""
        self._poses.read()
        self._positions, self._orientations = _core.world_poses(
            self._poses.frames, self._frames, self._local_positions, self._local_orientations
        )
        if not math.isfinite(self._positions.sum() + self._orientations.sum()):
            self._look_for_divergence()

    def _look_for_divergence(self) -> None:
        finite = np.isfinite(self._positions).all(axis=1) & np.isfinite(self._orientations).all(axis=1)
        if not finite.all():
            body = self._keys[int(np.argmin(finite))][0]
            raise ValueError(f"body {body} ({self._bodies[body].name}) has no finite pose: the simulation has diverged")

    def _chosen(self, pairs: NDArray[np.int32], among: Among) -> NDArray[np.bool_]:
        """Which of these pairs of shapes are asked for."""
        first, second = pairs.T
        if among == "all":
            return np.asarray(self._owners[first] != self._owners[second])
        if among != "simulated":
            return np.isin(first * np.int64(len(self._keys)) + second, self._codes(among))
        a, b = self._colliders[first], self._colliders[second]
        return np.asarray((a != b) & self._rules.allow(a, b))

    def _codes(self, among: Iterable[tuple[Who, Who]]) -> NDArray[np.int64]:
        """The pairs of a list, as `pair_codes` has them; kept for the next step."""
        if isinstance(among, str):
            raise ValueError(f"pairs must be 'simulated', 'all' or a list of pairs, not {among!r}")
        asked = list(among)
        if not self._listed or self._listed[0] != asked:
            links = {id: body.link_names for id, body in self._bodies.items()}
            self._listed = asked, pair_codes(asked, self._keys, links)
        return self._listed[1]

    def _pairs_possible(self) -> int:
        """How many pairs of shapes the last `overlaps()` was asked for, wherever they are."""
        if isinstance(self._asked, int):
            return self._asked
        if self._asked == "simulated":
            return self._rules.count(np.bincount(self._colliders, minlength=len(self._collider_rows)))
        of_each = np.unique(self._owners, return_counts=True)[1]
        return int(len(self._owners) ** 2 - (of_each**2).sum()) // 2


def _distinct(names: Mapping[int, str]) -> dict[int, str]:
    number = Counter(names.values())
    return {id: name if number[name] == 1 else f"{name}#{id}" for id, name in names.items()}
