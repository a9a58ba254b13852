"""Which pairs of shapes are asked for: those that a pybullet simulation lets collide, or those of a list."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import pybullet
from numpy.typing import NDArray

from overlapper.simulation.recorder import Link, Recorder

Key = tuple[int, int, int]  # body, link, shape
Who = int | tuple[int, int] | Key  # a body, a link or a shape
Indices = NDArray[np.intp]
Codes = NDArray[np.int64]
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
        self._filters = {
            (rows[a], rows[b]): enabled
            for (a, b), enabled in (recorder.pair_filters if recorder else {}).items()
            if a in rows and b in rows
        }
        self._within = {
            pair
            for body, flags in (recorder.self_collision if recorder else {}).items()
            for pair in self._self(body, flags)
        }

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
        for (a, b), enabled in self._filters.items():
            allowed[(first == a) & (second == b)] = enabled
        within = c.body[first] == c.body[second]
        if self._within:
            for i in np.flatnonzero(within & allowed):
                allowed[i] = (first[i], second[i]) in self._within
            return allowed
        return np.asarray(allowed & ~within)

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
        for a, b in self._within | {pair for pair in self._filters if c.body[pair[0]] != c.body[pair[1]]}:
            one = np.array([a]), np.array([b])
            plainly = c.body[a] != c.body[b] and bool(self._masks_admit(c.group[a], c.mask[a], c.group[b], c.mask[b]))
            pairs += int(weights[a] * weights[b]) * (int(self.allow(*one)[0]) - plainly)
        return int(pairs)


def _ancestors(link: int, parents: Mapping[int, int]) -> set[int | None]:
    found: set[int | None] = set()
    while link in parents:
        link = parents[link]
        found.add(link)
    return found


def pair_codes(asked: Sequence[tuple[Who, Who]], keys: Sequence[Key], links: Mapping[int, Collection[int]]) -> Codes:
    """The pairs of shapes that a list stands for, each as one number: i * len(keys) + j for keys[i] and keys[j], i < j.

    A body stands for all of its shapes, and so does a link; two shapes of one link are a pair only if both are named as
    shapes. `links` are those of each body. ValueError if a body or link is not there.
    """
    places: dict[Who, Codes] = {}
    for who in {each for pair in asked for each in pair}:
        named = (who,) if isinstance(who, int) else tuple(who)
        if named[0] not in links:
            raise ValueError(f"pairs names body {named[0]}, which is not in the simulation")
        if len(named) > 1 and named[1] not in links[named[0]]:
            raise ValueError(f"pairs names link {named[1]} of body {named[0]}, which it does not have")
        places[who] = np.array([i for i, key in enumerate(keys) if key[: len(named)] == named], dtype=np.int64)
    found = [np.empty(0, dtype=np.int64)]
    collider = np.unique(np.array(keys).reshape(-1, 3)[:, :2], axis=0, return_inverse=True)[1].reshape(-1)
    for a, b in asked:
        first, second = (each.reshape(-1) for each in np.meshgrid(places[a], places[b]))
        both_shapes = isinstance(a, tuple) and isinstance(b, tuple) and len(a) == len(b) == 3
        apart = first != second if both_shapes else collider[first] != collider[second]
        found.append((np.minimum(first, second) * len(keys) + np.maximum(first, second))[apart])
    return np.unique(np.concatenate(found))
