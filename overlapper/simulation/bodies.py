"""The bodies of a pybullet client: their shapes, read once, and their poses, read at every step."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from typing import Literal

import numpy as np
import pybullet
from numpy.typing import NDArray

from overlapper import Overlaps, Placed, Shape, overlaps
from overlapper.simulation.asked_pairs import Among, AskedPairs, Numbered, Who, listed
from overlapper.simulation.bullet.contact_points import links_in_contact_with_each_other, touching_within_margins
from overlapper.simulation.bullet.known_bodies import KnownBodies
from overlapper.simulation.bullet.recorder import Link, Recorder
from overlapper.simulation.collision_rules import CollisionRules, RulesInForce
from overlapper.simulation.contacts import Contacts
from overlapper.simulation.ground import Grounds
from overlapper.simulation.layout import Layout
from overlapper.simulation.model import (
    BASE,
    Array,
    Body,
    Color,
    Concave,
    Decomposed,
    Settings,
    Skipped,
    Surface,
)
from overlapper.simulation.naming import named
from overlapper.simulation.report import Report


class SkippedShapeWarning(UserWarning):
    """A shape of the simulation is not modelled: its overlaps are not found."""


class SelfCollisionWarning(UserWarning):
    """pybullet keeps links of a body apart that are no pair here: their overlaps are not looked for."""


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

    Height fields that a recorder has noted are modelled as the prisms below their triangles, near what may meet them;
    behind what moves away they are released. `report()` counts all triangles, and as read those modelled.

    A body is called by the `names` given, by its number; else by the stem of its file, which a recorder hears, by the
    name of its robot, or by its mesh or kind of shape, whichever says most.

    That a body collides with itself, and no recorder has heard of it, is seen in pybullet's contact points. overlaps()
    says so with one SelfCollisionWarning.

    A body without a finite pose is left out, and in `skipped`, until it has one again.

    Bodies that come, go or take over the id of another are noticed by `update()`, which marks every body with a user
    data entry; `close()`, the end of a `with` or of the last `Bodies` of a client takes the marks off. New bodies are
    read from a temporary .bullet file; if two stand at the same point, the friction of all is set and restored to tell
    them apart. Bodies that another process adds to a shared simulation are noticed after `pybullet.syncBodyInfo()`. To
    those that loadBullet brings pybullet gives no ids; they are counted in `skipped`.

    ValueError if `physicsClientId` is not connected, the recorder is of another client, or a name is none; RuntimeError
    if the physics server writes where this process cannot read.
    """

    def __init__(
        self,
        physicsClientId: int = 0,
        *,
        concave: Concave = "decompose",
        concave_threshold: float = 0.05,
        surface: Surface = "nominal",
        recorder: Recorder | None = None,
        names: Mapping[int, str] | None = None,
    ) -> None:
        if recorder and recorder.physicsClientId != physicsClientId:
            raise ValueError(f"recorder is of client {recorder.physicsClientId}, not of {physicsClientId}")
        self.physicsClientId = physicsClientId
        settings = Settings(concave, concave_threshold, surface)
        self._known = KnownBodies(physicsClientId, settings, recorder, named(names))
        self._settings, self._recorder = settings, recorder
        self._in_force = RulesInForce(recorder)
        self._grounds = Grounds(physicsClientId)
        self._closed = False
        self._nowhere: set[int] = set()  # bodies without a finite pose
        self._told: dict[int, Body] = {}  # that they collide with themselves
        # Of the last overlaps(): what was asked, how many if it was a list, of whom, and what was found.
        self._asked: Literal["simulated", "all"] | int = "simulated"
        self._found = overlaps([], np.empty((0, 3)), np.empty((0, 4)))
        self._last: tuple[Contacts, AskedPairs, Numbered, CollisionRules] | None = None
        self._arrange()
        self._refresh()

    def update(self) -> None:
        """Read the shapes of new bodies and changed filters, then all poses. Call it once per step.

        Whether a base has become static, its mass 0, is asked when it has not moved since the last update.
        """
        self._refresh()

    def follow(self) -> None:
        """Read all poses, as `update()` does, of the bodies that there were then; those that come or go are missed."""
        if self._pose() != self._nowhere:
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
        among: Numbered = pairs if isinstance(pairs, str) else self._asked_for(pairs)
        if among == "simulated":
            self._tell_of_self_collision()
        candidates, layout = self.pairs(among), self._layout
        self._asked = among if isinstance(among, str) else self._pairs.possible(among, self._in_force.rules)
        self._found = layout.batch.overlaps(
            layout.positions, layout.orientations, candidates, tolerance, threads, method, separated=False
        )
        contacts = Contacts(layout.key_rows, self._found, self._names)
        self._last = contacts, self._pairs, among, self._in_force.rules
        return contacts

    def pairs(self, among: Among = "simulated") -> NDArray[np.int32]:
        """(n, 2) pairs of shapes whose boxes meet, as places in `keys`: each once, the lesser first, sorted.

        "simulated" are those that the simulator lets collide, "all" those of different bodies, whatever it does. Any
        other choice is a list of pairs of bodies, links (body, link) or shapes (body, link, shape), as
        [(robot, table), ((robot, 8), (robot, 3))]; it may name two links of one body, and no filter is asked. Names
        stand for bodies and links: [("table", "panda/panda_hand")], as `names` has them. One pair of bodies or names
        needs no list around it. A body paired with itself stands for all pairs of its links. ValueError if there is no
        such body or link.
        """
        return self._pairs_at(self.positions, self.orientations, among)

    def _pairs_at(self, positions: Array, orientations: Array, among: Among) -> NDArray[np.int32]:
        """The same, were the shapes there."""
        asked: Numbered = among if isinstance(among, str) else self._asked_for(among)
        pairs: NDArray[np.int32] = self._layout.batch.candidate_pairs(positions, orientations)
        return np.asarray(pairs[self._pairs.chosen(pairs, asked, self._in_force.rules)])

    def partners(self) -> dict[tuple[int, int], list[tuple[int, int]]]:
        """The links that the simulator lets each link collide with, by (body, link), of those that have shapes."""
        return self._in_force.rules.partners(np.unique(self._layout.colliders))

    def report(self) -> Report:
        """How much of the scene was read, and how much of it the last `overlaps()` looked at.

        Asks for pybullet's contact points, which takes about 3 µs for each.
        """
        found = self._found
        asked = self._asked
        return Report(
            bodies=len(self._known.by_id),
            shapes=self._known.shape_count,
            shapes_read=len(self._layout.keys),
            pairs_possible=asked if isinstance(asked, int) else self._pairs.possible(asked, self._in_force.rules),
            pairs_examined=found.examined,
            pairs_overlapping=int((found.status == Overlaps.OVERLAPPING).sum()),
            pairs_widened=int(found.widened.sum()),
            facets_touched=int(found.facets_touched.sum()),
            planes_asked=found.planes_asked,
            pairs_within_margins=self._within_margins(),
        )

    def link_pairs(self, among: Among = "simulated") -> list[tuple[Link, Link]]:
        """The pairs of links ((body, link), (body, link)) whose shapes `pairs` looks at, wherever they are; sorted."""
        asked: Numbered = among if isinstance(among, str) else self._asked_for(among)
        links = [*self._layout.collider_rows]
        return [(links[a], links[b]) for a, b in self._pairs.colliders(asked, self._in_force.rules).tolist()]

    def close(self) -> None:
        """Take the marks off the bodies, unless another `Bodies` needs them. What was read stays; no update follows."""
        self._closed = True
        self._known.close()

    def __repr__(self) -> str:
        of = f"{len(self._known.by_id)} bodies, {len(self._layout.keys)} shapes"
        return f"Bodies({of}{f', {len(self.skipped)} left out' if self.skipped else ''})"

    def __enter__(self) -> Bodies:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def keys(self) -> list[tuple[int, int, int]]:
        """(body, link, shape) of every modelled shape, sorted; link -1 is the base."""
        return self._layout.keys

    @property
    def shapes(self) -> list[Shape]:
        """The modelled shapes, parallel to `keys`; the same objects from step to step."""
        return self._layout.shapes

    @property
    def positions(self) -> Array:
        """(k, 3) positions in metres of the shapes, not of their links, at the last update; parallel to `keys`."""
        return self._layout.positions

    @property
    def orientations(self) -> Array:
        """(k, 4) unit quaternions xyzw of the shapes, not of their links, at the last update; parallel to `keys`."""
        return self._layout.orientations

    @property
    def placed(self) -> list[Placed]:
        """The shapes where they were at the last update, parallel to `keys`."""
        return [Placed(*each) for each in zip(self.shapes, self.positions, self.orientations)]

    @property
    def colors(self) -> dict[tuple[int, int], Color]:
        """Red, green, blue and alpha in 0..1 by (body, link): of the visual shape, as it was when the body was read.

        A link without a visual shape has its body's colour, a body without any a colour of its own.
        """
        return self._known.colors

    @property
    def names(self) -> dict[tuple[int, int], str]:
        """Names like "panda/panda_hand" by (body, link); those that several would share end in "#" and the id."""
        return dict(self._names)

    @property
    def decomposed(self) -> list[Decomposed]:
        """The concave meshes that are modelled as unions of convex parts."""
        return self._known.decomposed

    @property
    def settings(self) -> dict[str, str | float]:
        """`concave`, `concave_threshold` and `surface`, as they were given."""
        given = self._settings
        return {"concave": given.concave, "concave_threshold": given.threshold, "surface": given.surface}

    @property
    def recorder(self) -> Recorder | None:
        """As it was given."""
        return self._recorder

    @property
    def skipped(self) -> list[Skipped]:
        """What is not modelled, one entry per body and link."""
        return self._known.skipped + [self._lost(id) for id in sorted(self._nowhere)]

    def _refresh(self) -> None:
        client = self.physicsClientId
        if self._closed:
            raise ValueError(f"this Bodies of physicsClientId {client} is closed")
        if not pybullet.isConnected(client):
            raise ValueError(f"physicsClientId {client} is not connected to a physics server")
        skipped = self._known.refresh(self._layout.poses.bodies)
        if arranged := skipped is not None:
            self._arrange()
        before, self._nowhere = self._nowhere, self._pose()
        if self._nowhere != before:
            arranged = True
            self._arrange()
            self._pose()
        self._in_force.follow(self._known, self._layout, skipped is not None, arranged)
        if changed := self._grounds.changed(self._layout, self._in_force.rules, self._known.by_id):
            self._known.by_id |= changed
            self._arrange()
            self._pose()
            self._in_force.follow(self._known, self._layout, fresh=False, arranged=True)
        for each in (*(skipped or ()), *(self._lost(id) for id in sorted(self._nowhere - before))):
            message = f"{each.name} (body {each.body}, link {each.link}) is left out: {each.reason}"
            # The caller of update() or of Bodies() is three calls up.
            warnings.warn(message, SkippedShapeWarning, stacklevel=3)

    def _asked_for(self, pairs: Iterable[tuple[Who | str, Who | str]]) -> list[tuple[Who, Who]]:
        """The pairs of a list, by numbers. What has been here before comes out as it went in."""
        return [(self._who(a), self._who(b)) for a, b in listed(pairs)]

    def _who(self, named: Who | str) -> Who:
        if not isinstance(named, str):
            return named
        known: dict[str, Who] = {label: id for id, label in self._labels.items()}
        known |= {name: link for link, name in self._names.items()}
        if named not in known:
            alike = get_close_matches(named, known, 1)
            hint = f"; {alike[0]!r} is" if alike else ""
            raise ValueError(f"pairs names {named!r}, which is no body or link in the simulation{hint}")
        return known[named]

    def _lost(self, id: int) -> Skipped:
        return Skipped(id, BASE, self._known.by_id[id].name, "it has no finite pose: the simulation has diverged")

    def _arrange(self) -> None:
        known = self._known
        self._nowhere &= known.by_id.keys()
        placed: dict[int, Body] = {}
        left_out: dict[int, Body] = {}
        for id, body in known.by_id.items():
            (left_out if id in self._nowhere else placed)[id] = body
        self._layout = Layout(self.physicsClientId, placed, known.hidden)
        self._left_out = Layout(self.physicsClientId, left_out, known.hidden)
        self._names, self._labels = known.names, known.labels
        self._pairs = AskedPairs(self._layout, known.links)
        self._grounds.follow(self._layout, placed)

    def _pose(self) -> set[int]:
        """Place all bodies; those that have no finite pose."""
        nowhere = self._layout.pose()
        return nowhere | self._left_out.pose() if self._nowhere else nowhere

    def _tell_of_self_collision(self) -> None:
        """Warn, once for each, of bodies whose links pybullet keeps apart, and no recorder knows of it."""
        for id in self._layout.of_several_colliders:
            body = self._known.by_id[id]
            if (self._recorder and id in self._recorder.self_collision) or self._told.get(id) is body:
                continue
            if links := links_in_contact_with_each_other(self.physicsClientId, id):
                self._told[id] = body
                a, b = (body.link_names[link] for link in links)
                message = (
                    f"{body.name} (body {id}) collides with itself, its {a} with its {b}, and pairs within it are not "
                    "looked at: set up a Recorder before the body is loaded and give it to Bodies(), or ask for "
                    f"pairs=[({id}, {id})]"
                )
                # The caller of overlaps() is two calls up.
                warnings.warn(message, SelfCollisionWarning, stacklevel=3)

    def _within_margins(self) -> int:
        if self._settings.surface == "margin" or not self._last:
            return 0
        return touching_within_margins(self.physicsClientId, *self._last)
