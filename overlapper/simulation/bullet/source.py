"""The `Source` of a pybullet client."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
import pybullet
from numpy.typing import NDArray

from overlapper.simulation.bullet.collider_poses import ColliderPoses
from overlapper.simulation.bullet.contact_points import links_in_contact_with_each_other, touching_within_margins
from overlapper.simulation.bullet.known_bodies import KnownBodies
from overlapper.simulation.bullet.recorder import Recorder
from overlapper.simulation.bullet.rules_in_force import RulesInForce
from overlapper.simulation.bullet.stepping import Stepping, time_step
from overlapper.simulation.cautions import SelfCollisionWarning
from overlapper.simulation.collision_rules import Mask, Rules
from overlapper.simulation.contacts import Contacts
from overlapper.simulation.layout import Layout
from overlapper.simulation.model import ModelledBody, Skipped
from overlapper.simulation.settings import Modelling, settings_of
from overlapper.simulation.source import Source


class BulletSource(Source):
    """See `Source`; the arguments are those of `Bodies`."""

    engine = "bullet"

    def __init__(
        self, client: int, modelling: Modelling, recorder: Recorder | None, given_names: Mapping[int, str]
    ) -> None:
        self._client, self._modelling, self._recorder = client, modelling, recorder
        self._known = KnownBodies(client, modelling, recorder, given_names)
        self.bodies = self._known.by_id
        self._in_force = RulesInForce(recorder)
        self._fresh = False  # whether filters have been read since the rules were asked for
        self._closed = False
        self._told: dict[int, ModelledBody] = {}  # bodies with a SelfCollisionWarning

    @property
    def time_step(self) -> float:
        return time_step(self._client)

    @property
    def settings(self) -> dict[str, str | float]:
        return settings_of(self._modelling)

    @property
    def unidentified(self) -> int:
        return self._known.unidentified

    @property
    def skipped(self) -> list[Skipped]:
        return self._known.skipped

    def refresh(self) -> list[Skipped] | None:
        if self._closed:
            raise ValueError(f"this Bodies of physicsClientId {self._client} is closed")
        if not pybullet.isConnected(self._client):
            raise ValueError(f"physicsClientId {self._client} is not connected to a physics server")
        skipped = self._known.refresh()
        self.bodies = self._known.by_id
        self._fresh |= skipped is not None
        return skipped

    def poses(self, links: Mapping[int, Sequence[int]]) -> ColliderPoses:
        return ColliderPoses(self._client, links, self._known.hidden)

    def rules(self, layout: Layout) -> Rules:
        self._in_force.follow(self._known, layout, self._fresh)
        self._fresh = False
        return self._in_force.rules

    def cautions(self, layout: Layout) -> Iterator[Warning]:
        """One warning for each body that collides with itself in pybullet, unless a recorder knows of it."""
        for id in layout.of_several_colliders:
            body = self.bodies[id]
            if (self._recorder and id in self._recorder.self_collision) or self._told.get(id) is body:
                continue
            if links := links_in_contact_with_each_other(self._client, id):
                self._told[id] = body
                a, b = (body.link_names[link] for link in links)
                yield SelfCollisionWarning(
                    f"{body.name} (body {id}) collides with itself ({a} with {b}), but its own pairs are not measured: "
                    "set up a Recorder before the body is loaded and give it to Bodies(), or ask for "
                    f"pairs=[({id}, {id})]"
                )

    def within_margins(self, found: Contacts, layout: Layout, chosen: Callable[[NDArray[np.int32]], Mask]) -> int:
        if self._modelling.surface == "margin":
            return 0
        return touching_within_margins(self._client, found, layout, chosen)

    def mechanics(self) -> Stepping:
        return Stepping(self._client, self._recorder)

    def close(self) -> None:
        self._closed = True
        self._known.close()
