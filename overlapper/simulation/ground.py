"""The ground of height fields, modelled only below shapes that may meet it, and updated as the shapes move."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from overlapper import Shape, _core
from overlapper.quaternion import rotated
from overlapper.simulation.collision_rules import Mask, Rules
from overlapper.simulation.height_field import Numbers
from overlapper.simulation.layout import Layout, Pose
from overlapper.simulation.model import Array, Ground, LinkKey, ModelledBody

FIRST = np.zeros(1, dtype=np.int64)


class GroundBelow:
    """The triangles of a height field near shapes. For shapes that have hardly moved, they are not searched again."""

    def __init__(self, ground: Ground, reach: Array) -> None:
        """`reach` (n,) in m is how far the shapes extend from their centres."""
        self.ground = ground
        self._reach = reach
        # The ground is modelled this far around a shape, and searched again when the shape has moved this far.
        self._slack = np.maximum(min(ground.field.spacing) / 2, reach / 4)  # infinite for planes
        self._asked = np.full((len(reach), 3), np.inf)
        self._frame: Pose = ()
        self._bounded = np.isfinite(reach)
        self._near: list[Numbers] = [np.empty(0, dtype=np.int64)] * len(reach)

    def moved(self, frame: Pose, centres: Array, meets: Mask) -> bool:
        """Search the ground below the shapes in `meets` that have moved too far. True if there were any.

        The field's collider is at `frame`. The shapes are at `centres` (n, 3) in the world.
        """
        if frame != self._frame:
            ground, self._frame = self.ground, frame
            origin, turn = _core.world_poses([frame], FIRST, ground.position[None], ground.orientation[None])
            self._origin, self._axes = origin[0], rotated(turn, np.eye(3))
        if not _core.any_moved(centres, self._origin, self._axes, self._asked, self._slack, meets):
            return False
        local = (centres - self._origin) @ self._axes.T
        moved = meets & self._bounded & ~(np.abs(local - self._asked).max(axis=1) <= self._slack)
        moved &= np.isfinite(local).all(axis=1)
        self._asked[moved] = local[moved]
        for k in np.flatnonzero(moved):
            reach = self._reach[k] + self._slack[k]
            self._near[k] = self.ground.field.under(local[k] - reach, local[k] + reach)
        return bool(moved.any())

    def numbers(self) -> set[int]:
        """The numbers of the triangles near any of the shapes."""
        return set(np.unique(np.concatenate([np.empty(0, dtype=np.int64), *self._near])).tolist())


class Grounds:
    """The height fields of the bodies by (body, link), and the shapes that may meet them: all but height fields."""

    def __init__(self) -> None:
        self._below: dict[LinkKey, GroundBelow] = {}
        self._rows = np.empty(0, dtype=np.intp)
        self._keys = np.empty((0, 3), dtype=np.int64)
        self._shapes: list[Shape] = []
        self._meets: dict[LinkKey, Mask] = {}
        self._rules: Rules | None = None  # those by which `_meets` was found

    @property
    def links(self) -> Iterable[LinkKey]:
        """(body, link) of each height field."""
        return self._below.keys()

    def follow(self, layout: Layout, bodies: Mapping[int, ModelledBody]) -> None:
        """Follow a new layout, after bodies have come or gone."""
        grounds = {(id, ground.link): ground for id, body in bodies.items() for ground in body.grounds}
        own = [layout.collider_rows[each] for each in grounds]
        self._rows = np.flatnonzero(~np.isin(layout.colliders, own))
        shapes = [layout.shapes[row] for row in self._rows] if grounds else []
        keys = layout.key_rows[self._rows]
        if shapes != self._shapes or not np.array_equal(keys, self._keys):
            self._below = {}
        self._shapes, self._keys = shapes, keys
        same = {key: below for key, below in self._below.items() if below.ground is grounds.get(key)}
        reach = layout.reach(self._rows) if len(same) < len(grounds) else np.empty(0)
        self._below = {key: same.get(key) or GroundBelow(ground, reach) for key, ground in grounds.items()}
        self._rules = None

    def changed(self, layout: Layout, rules: Rules, bodies: Mapping[int, ModelledBody]) -> dict[int, ModelledBody]:
        """The height fields that need more prisms, or fewer than half of their prisms, with the new prisms.

        The new prisms are those that shapes may meet by the simulator's rules, and some around them.
        """
        found: dict[int, ModelledBody] = {}
        if self._below and not (self._rules is rules and rules.lasting):
            self._rules, colliders = rules, layout.colliders[self._rows]
            for key in self._below:
                own = np.full(len(colliders), layout.collider_rows[key])
                self._meets[key] = rules.allow(np.minimum(own, colliders), np.maximum(own, colliders))
        for (id, link), below in self._below.items():
            if not below.moved(layout.frame((id, link)), layout.positions[self._rows], self._meets[id, link]):
                continue
            body, needed = found.get(id, bodies[id]), below.numbers()
            modelled = {each.index: each for each in body.shapes if each.link == link}
            if needed - modelled.keys() or 2 * len(needed) < len(modelled):
                prisms = [modelled.get(number) or below.ground.prism(number) for number in needed]
                others = [each for each in body.shapes if each.link != link]
                shapes = sorted([*others, *prisms], key=lambda each: (each.link, each.index))
                found[id] = replace(body, shapes=tuple(shapes))
        return found
