"""The collision shapes of a running pybullet simulation, and their overlaps.

Shapes are read once, poses at every step. Surfaces are the nominal ones: Bullet itself lays a margin of 1 mm around
convex hulls (mesh shapes, and the `<cylinder>` of a URDF, which Bullet makes a 32-gon hull), so that pybullet reports
hulls 1 mm nearer than they are here, and MJCF capsules thinner than 4 cm wrongly. Which bodies the simulator
lets collide (groups, masks, pair filters) is not asked: these are overlaps of geometry.
"""

from __future__ import annotations

import uuid
import warnings
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from overlapper import Batch, Overlaps, Placed, Shape, overlaps
from overlapper.contacts import Contact, Contacts
from overlapper.decomposition import check_threshold
from overlapper.quaternion import composed, rotated

try:
    import pybullet

    from overlapper.extraction import (
        BASE,
        Array,
        Body,
        Color,
        Concave,
        Decomposed,
        Skipped,
        body_ids,
        hides_pose,
        read_body,
        save,
        saved_bodies,
    )
except ImportError as error:
    raise ImportError("overlapper.simulation needs pybullet: pip install 'overlapper[sim]'") from error

__all__ = ["Bodies", "Concave", "Contact", "Contacts", "Decomposed", "Report", "Skipped", "SkippedShapeWarning"]


class SkippedShapeWarning(UserWarning):
    """A shape of the simulation is not modelled: its overlaps are not found."""


@dataclass(frozen=True, slots=True)
class Report:
    """How little of a scene had to be modelled.

    `shapes` counts those of the scene, `shapes_read` those modelled, `pairs_possible` the pairs of modelled shapes of
    different bodies that are not both static. The rest is of the last `overlaps()`: pairs whose boxes meet, pairs that
    overlap, those of them that were measured again in wider arithmetic (see `Overlap.widened`), facets that took part.
    """

    bodies: int
    shapes: int
    shapes_read: int
    pairs_possible: int
    pairs_examined: int
    pairs_overlapping: int
    pairs_widened: int
    facets_touched: int

    def __str__(self) -> str:
        widened = f"{self.pairs_widened:,} of them" if self.pairs_widened else "none of them"
        return (
            f"{self.bodies:,} bodies, {self.shapes_read:,} of {self.shapes:,} shapes read\n"
            f"{self.pairs_examined:,} of {self.pairs_possible:,} pairs examined, {self.facets_touched:,} facets touched\n"
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
    (height fields, soft bodies, flat hulls) is listed in `skipped`, with one SkippedShapeWarning each.

    Concave meshes are decomposed into convex parts, which count as so many shapes of their link and are listed in
    `decomposed`; `concave_threshold`, from 0.01 to 1, is the concavity that may be left (see overlapper.decomposition).
    It takes up to minutes the first time, and needs the extra `concave`. A mesh whose surface is open bounds no volume
    and is skipped; with concave="enclose" CoACD lays walls around it. With concave="skip" all concave meshes are.

    Bodies that come, go or take over the id of another are noticed by `update()`, which marks every body with a user
    data entry. New bodies are read from a temporary .bullet file; if two stand at the same point, the
    friction of all is set and restored to tell them apart. Bodies that another process adds to a shared simulation are
    noticed after `pybullet.syncBodyInfo()`.

    ValueError if `physicsClientId` is not connected or the simulation has diverged; RuntimeError if the physics server
    writes where this process cannot read.
    """

    def __init__(
        self, physicsClientId: int = 0, *, concave: Concave = "decompose", concave_threshold: float = 0.05
    ) -> None:
        if concave not in get_args(Concave):
            raise ValueError(f"concave must be one of {', '.join(map(repr, get_args(Concave)))}, not {concave!r}")
        check_threshold(concave_threshold)
        self.physicsClientId = physicsClientId
        self._concave: Concave = concave
        self._threshold = concave_threshold
        self._mark = f"overlapper {uuid.uuid4()}"
        self._bodies: dict[int, Body] = {}
        self._unidentified = 0
        self._rows: dict[int, int] = {}  # in a .bullet file, of the bodies whose poses have no other source
        self._arrange()
        self._refresh()
        self._examined = overlaps([], np.empty((0, 3)), np.empty((0, 4)))

    def update(self) -> None:
        """Read the shapes of bodies that are new, then the poses of all. Call it once per step."""
        self._refresh()

    def overlaps(
        self, tolerance: float = 1e-3, method: Literal["auto", "paper"] = "auto", threads: int | None = 1
    ) -> Contacts:
        """Pairs of shapes that overlap or touch, sorted by (bodyA, linkA, shapeA, bodyB, linkB, shapeB).

        Pairs within a body are left out, and pairs of static shapes: bases of mass 0, with the links that only fixed
        joints tie to them. `tolerance`, `method` and `threads` are those of `overlapper.overlaps`. What is found is
        kept for the next call: pairs of which neither shape has moved by a bit cost nothing.
        """
        found = self._batch.overlaps(
            self._positions, self._orientations, self._candidate_pairs(), tolerance, threads, method
        )
        self._examined = found
        return Contacts(self._key_rows, found[found.status != Overlaps.SEPARATED])

    def report(self) -> Report:
        """How much of the scene was read, and how much of it the last `overlaps()` looked at."""
        owners, static, examined = self._owners, self._static[self._owners] & self._fixed, self._examined
        return Report(
            bodies=len(self._bodies),
            shapes=sum(body.shape_count for body in self._bodies.values()) + self._unidentified,
            shapes_read=len(self._keys),
            pairs_possible=_pairs_between(owners) - _pairs_between(owners[static]),
            pairs_examined=len(examined),
            pairs_overlapping=int((examined.status == Overlaps.OVERLAPPING).sum()),
            pairs_widened=int(examined.widened.sum()),
            facets_touched=int(examined.facets_touched.sum()),
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
        # After a syncBodyInfo, pybullet would show the user data of a removed body on the one that inherits its id.
        pybullet.syncUserData(physicsClientId=client)
        ids = body_ids(client)
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
        ids = sorted(body_ids(client))
        known = {id: self._bodies[id] for id in ids if id in self._bodies and self._is_marked(id)}
        fresh = [id for id in ids if id not in known]
        hidden = [id for id in ids if hides_pose(client, id)]
        unidentified, self._rows = (self._unidentified if ids else 0), {}
        if fresh or hidden:
            file, rows = saved_bodies(client, ids)
            unidentified = len(file.bodies) - len(rows)
            self._rows = {id: rows[id] for id in hidden if id in rows}
        for id in fresh:
            body = file.bodies[rows[id]] if id in rows else None
            known[id] = read_body(client, id, file, body, self._concave, self._threshold)
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
        self._key_rows = np.array(self._keys, dtype=np.int64).reshape(-1, 3)
        self._shapes = [part.shape for part in parts]
        self._batch = Batch(self._shapes)
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
        file = save(client) if self._rows.keys() & self._links.keys() else None
        for id, links in self._links.items():
            if file and id in self._rows:
                colliders = file.bodies[self._rows[id]].colliders
                rows += [(*colliders[link].position, *colliders[link].orientation) for link in (BASE, *links)]
                continue
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
        self._positions: Array = poses[:, :3] + rotated(orientations, self._local_positions)
        self._orientations: Array = composed(orientations, self._local_orientations)
        self._positions.flags.writeable = self._orientations.flags.writeable = False
        finite = np.isfinite(poses).all(axis=1)
        if not finite.all():
            body = self._keys[int(np.argmin(finite))][0]
            raise ValueError(f"body {body} ({self._bodies[body].name}) has no finite pose: the simulation has diverged")

    def _candidate_pairs(self) -> NDArray[np.int32]:
        pairs: NDArray[np.int32] = self._batch.candidate_pairs(self._positions, self._orientations)
        first, second = pairs.T
        static = self._static[self._owners] & self._fixed
        apart = self._owners[first] != self._owners[second]
        return np.asarray(pairs[apart & ~(static[first] & static[second])])


def _distinct(names: Mapping[int, str]) -> dict[int, str]:
    number = Counter(names.values())
    return {id: name if number[name] == 1 else f"{name}#{id}" for id, name in names.items()}


def _pairs_between(owners: NDArray[Any]) -> int:
    """Number of pairs of shapes with different owners."""
    return int(len(owners) ** 2 - (np.bincount(owners) ** 2).sum()) // 2
