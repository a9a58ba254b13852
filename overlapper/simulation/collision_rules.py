"""Which links a pybullet simulation lets collide."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import pybullet
from numpy.typing import NDArray

from overlapper.simulation.bullet.known_bodies import KnownBodies
from overlapper.simulation.bullet.recorder import Link, Recorder
from overlapper.simulation.layout import Layout

Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Colliders:
    """The links of a scene side by side.

    `rows` is the place of each by body and link, `body` (n,) its body, `group` and `mask` (n,) are
    those of its collision filter, `parents` the parent of each link by body, -1 for the base.
    """

    rows: dict[tuple[int, int], int]
    body: Indices
    group: Indices
    mask: Indices
    parents: Mapping[int, Mapping[int, int]]


class CollisionRules:
    """Bullet's rules: pair filters before masks; within a body its self-collision flags as well as either.

    What only a recorder knows is as by default without one: no pair filters, one mask is enough, and no self-collision.
    """

    def __init__(self, colliders: Colliders, recorder: Recorder | None) -> None:
        self._colliders = colliders
        self._both = recorder.both_masks_must_agree if recorder else False
        rows = colliders.rows
        filters = [
            (rows[a], rows[b], enabled)
            for (a, b), enabled in (recorder.pair_filters if recorder else {}).items()
            if a in rows and b in rows
        ]
        self._filtered, self._enabled = self._sorted(filters)
        within = [
            (*pair, True)
            for body, flags in (recorder.self_collision if recorder else {}).items()
            for pair in self._self(body, flags)
        ]
        self._within = self._sorted(within)[0]

    def _code(self, first: Indices, second: Indices) -> Indices:
        """Pairs of colliders as one number each."""
        return np.asarray(first * len(self._colliders.body) + second)

    def _sorted(self, pairs: list[tuple[int, int, bool]]) -> tuple[Indices, Mask]:
        """The codes of these pairs, sorted, and what is said of each."""
        first, second, said = np.array(pairs, dtype=np.intp).reshape(-1, 3).T
        codes = self._code(first, second)
        order = np.argsort(codes)
        return codes[order], said[order].astype(bool)

    def _self(self, body: int, flags: int) -> list[tuple[int, int]]:
        """The pairs of links of a body that its flags let collide, as btMultiBodyLinkCollider sees them."""
        parents = self._colliders.parents.get(body, {})
        rows = {link: row for (id, link), row in self._colliders.rows.items() if id == body}
        apart_from: dict[int, set[int | None]]
        if flags & pybullet.URDF_USE_SELF_COLLISION_EXCLUDE_ALL_PARENTS:
            apart_from = {link: _ancestors(link, parents) for link in rows}
        elif flags & pybullet.URDF_USE_SELF_COLLISION_INCLUDE_PARENT:
            apart_from = {link: set() for link in rows}
        else:
            apart_from = {link: {parents.get(link)} for link in rows}
        return [
            (rows[a], rows[b])
            for a, b in combinations(sorted(rows), 2)
            if a not in apart_from[b] and b not in apart_from[a]
        ]

    def allow(self, first: Indices, second: Indices) -> Mask:
        """Whether the colliders in these rows may collide, pair by pair; first < second."""
        c = self._colliders
        allowed = self._masks_admit(c.group[first], c.mask[first], c.group[second], c.mask[second])
        within = c.body[first] == c.body[second]
        if not len(self._filtered) and not len(self._within):
            return np.asarray(allowed & ~within)
        codes = self._code(first, second)
        place, found = _places(self._filtered, codes)
        allowed[found] = self._enabled[place[found]]
        return np.asarray(allowed & (~within | _places(self._within, codes)[1]))

    def _masks_admit(self, group: Any, mask: Any, other_group: Any, other_mask: Any) -> Mask:
        admitted, admitting = (group & other_mask) != 0, (other_group & mask) != 0
        return np.asarray(admitted & admitting if self._both else admitted | admitting)

    def partners(self, rows: Indices) -> dict[Link, list[Link]]:
        """Of the colliders in these rows, sorted, with whom each may collide, by body and link."""
        links = list(self._colliders.rows)
        found: dict[Link, list[Link]] = {links[row]: [] for row in rows}
        first, second = (rows[each] for each in np.triu_indices(len(rows), 1))
        allowed = self.allow(first, second)
        for a, b in zip(first[allowed], second[allowed]):
            found[links[a]].append(links[b])
            found[links[b]].append(links[a])
        return found

    def count(self, weights: NDArray[np.int64]) -> int:
        """How many pairs of shapes may collide, if `weights` (n,) says how many each collider has."""
        c = self._colliders
        filters, kind = np.unique(np.c_[c.group, c.mask], axis=0, return_inverse=True)
        bodies, body = np.unique(c.body, return_inverse=True)
        shapes = np.zeros((len(bodies), len(filters)), dtype=np.int64)
        np.add.at(shapes, (body, kind.reshape(-1)), weights)
        admitted = self._masks_admit(filters[:, None, 0], filters[:, None, 1], filters[None, :, 0], filters[None, :, 1])
        total = shapes.sum(axis=0)
        pairs = int((admitted * (np.outer(total, total) - shapes.T @ shapes)).sum()) // 2
        # What the masks alone do not say, pair by pair.
        codes = np.union1d(self._filtered, self._within)
        first, second = np.divmod(codes, max(len(c.body), 1))
        by_masks = self._masks_admit(c.group[first], c.mask[first], c.group[second], c.mask[second])
        plainly = by_masks & (c.body[first] != c.body[second])
        change = self.allow(first, second).astype(np.int64) - plainly
        return pairs + int((weights[first] * weights[second] * change).sum())


def _places(codes: Indices, wanted: Indices) -> tuple[Indices, Mask]:
    """Where each of `wanted` would be among sorted codes, and whether it is there."""
    place = np.searchsorted(codes, wanted)
    found = place < len(codes)
    found[found] = codes[place[found]] == wanted[found]
    return place, found


def _ancestors(link: int, parents: Mapping[int, int]) -> set[int | None]:
    found: set[int | None] = set()
    while link in parents:
        link = parents[link]
        found.add(link)
    return found


class RulesInForce:
    """`rules` as they are at this step: of groups and masks, read again if they may have changed, and a recorder."""

    def __init__(self, recorder: Recorder | None) -> None:
        self._recorder = recorder
        self._bodies: list[int] = []
        self._static: list[bool] = []
        self._noted = (0, 0)  # of the recorder, changes and masks set
        nobody = np.empty(0, dtype=int)
        self.rules = CollisionRules(Colliders({}, nobody, nobody, nobody, {}), recorder)

    def follow(self, known: KnownBodies, layout: Layout, fresh: bool, arranged: bool) -> None:
        """Take over what has changed since the last step.

        Filters that are `fresh` have just been read; shapes that have been `arranged` anew have other places.
        """
        # changeDynamics gives a base the group of static or of moving bodies as it becomes one.
        bodies, static = layout.poses.bodies, layout.poses.static.copy()
        noted = (self._recorder.changes, self._recorder.masks_set) if self._recorder else (0, 0)
        if bodies == self._bodies:
            changed = static != self._static
        else:
            before = dict(zip(self._bodies, self._static))
            changed = any(before.get(id, now) != now for id, now in zip(bodies, static))
        changed |= noted[1] != self._noted[1]
        if changed and not fresh:
            known.read_filters()
        if changed or fresh or arranged or noted != self._noted:
            filters = [known.filters.get(each, (1, -1)) for each in layout.collider_rows]
            group, mask = np.array(filters, dtype=int).reshape(-1, 2).T
            owners = np.array([id for id, _ in layout.collider_rows], dtype=int)
            parents = {id: body.parents for id, body in known.by_id.items()}
            colliders = Colliders(layout.collider_rows, owners, group, mask, parents)
            self.rules = CollisionRules(colliders, self._recorder)
        self._bodies, self._static, self._noted = bodies, static, noted
