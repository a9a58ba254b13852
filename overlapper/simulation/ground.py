"""The ground of height fields, modelled below what may meet it, more and more of it as bodies move."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pybullet

from overlapper.quaternion import composed, rotated
from overlapper.simulation.collision_rules import CollisionRules, Mask
from overlapper.simulation.extraction.model import BASE, Array, Body, Ground
from overlapper.simulation.layout import Layout


class GroundBelow:
    """Which triangles of a height field shapes are near; shapes that have hardly moved are not asked about again."""

    def __init__(self, ground: Ground) -> None:
        self._ground = ground
        self._slack = min(ground.field.spacing) / 2
        self._asked = np.empty((0, 3))

    def reached(self, position: Array, orientation: Array, centres: Array, reach: Array, meets: Mask) -> set[int]:
        """Of the shapes that `meets` picks, which lie within `reach` (n,) of `centres` (n, 3) in the world.

        The field's collider is at `position` and `orientation`, xyzw.
        """
        turn = composed(orientation, self._ground.orientation)
        origin = position + rotated(orientation, self._ground.position)
        local = rotated(turn * [-1.0, -1.0, -1.0, 1.0], centres - origin)
        if self._asked.shape != local.shape:
            self._asked = np.full(local.shape, np.inf)
        moved = meets & np.isfinite(reach) & ~(np.abs(local - self._asked).max(axis=1) <= self._slack)
        self._asked[moved] = local[moved]
        found: set[int] = set()
        for centre, radius in zip(local[moved], reach[moved] + self._slack):
            found.update(self._ground.field.under(centre - radius, centre + radius).tolist())
        return found


class Grounds:
    """The height fields among the bodies of a client."""

    def __init__(self, client: int, bodies: Mapping[int, Body]) -> None:
        self._client = client
        self._below = {id: GroundBelow(body.ground) for id, body in bodies.items() if body.ground}

    def grown(self, layout: Layout, rules: CollisionRules, bodies: Mapping[int, Body]) -> dict[int, Body]:
        """The bodies of which the simulator lets something meet more ground than is modelled, with all of that."""
        found: dict[int, Body] = {}
        for id, below in self._below.items():
            own = np.full(len(layout.colliders), layout.collider_rows[id, BASE])
            first, second = np.minimum(own, layout.colliders), np.maximum(own, layout.colliders)
            meets = (layout.owners != id) & rules.allow(first, second)
            position, orientation = map(np.array, pybullet.getBasePositionAndOrientation(id, self._client))
            numbers = below.reached(position, orientation, layout.positions, layout.reach, meets)
            body = bodies[id]
            new = numbers - {part.index for part in body.parts}
            if new and body.ground:
                parts = sorted((*body.parts, *map(body.ground.part, new)), key=lambda part: part.index)
                found[id] = replace(body, parts=tuple(parts))
        return found
