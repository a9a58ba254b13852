"""Bullet's rules of which links may collide, read again when they may have changed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import combinations
from typing import cast

import pybullet

from overlapper.simulation.bullet.collider_poses import ColliderPoses
from overlapper.simulation.bullet.known_bodies import KnownBodies
from overlapper.simulation.bullet.recorder import Recorder
from overlapper.simulation.collision_rules import Colliders, MaskRules, Rules
from overlapper.simulation.layout import Layout
from overlapper.simulation.model import LinkKey


class RulesInForce:
    """The `rules` at this step, from groups, masks and the notes of a recorder.

    Without a recorder there are no pair filters, one mask is enough, and no body collides with itself.
    """

    def __init__(self, recorder: Recorder | None) -> None:
        self._recorder = recorder
        self._layout: Layout | None = None
        self._bodies: list[int] = []
        self._static: list[bool] = []
        self._noted = (0, 0)  # the recorder's counts of changes and of masks set
        self.rules: Rules = MaskRules(Colliders.of({}, {}))

    def follow(self, known: KnownBodies, layout: Layout, fresh: bool) -> None:
        """Update the rules if anything has changed since the last step. `fresh` filters have just been read."""
        # When a base becomes static or stops being static, changeDynamics changes its group.
        poses = cast(ColliderPoses, layout.poses)  # BulletSource makes ColliderPoses
        bodies, static = poses.bodies, poses.static.copy()
        noted = (self._recorder.changes, self._recorder.masks_set) if self._recorder else (0, 0)
        if bodies == self._bodies:
            changed = static != self._static
        else:
            before = dict(zip(self._bodies, self._static))
            changed = any(before.get(id, now) != now for id, now in zip(bodies, static))
        changed |= noted[1] != self._noted[1]
        if changed and not fresh:
            known.read_filters()
        if changed or fresh or layout is not self._layout or noted != self._noted:
            self.rules = self._read(known, layout)
        self._layout, self._bodies, self._static, self._noted = layout, bodies, static, noted

    def _read(self, known: KnownBodies, layout: Layout) -> Rules:
        colliders = Colliders.of(layout.collider_rows, known.filters)
        recorder = self._recorder
        if recorder is None:
            return MaskRules(colliders)
        within = [
            pair
            for id, flags in recorder.self_collision.items()
            if id in known.by_id
            for pair in _within(id, flags, known.by_id[id].parents, layout.collider_rows)
        ]
        return MaskRules(colliders, recorder.both_masks_must_agree, recorder.pair_filters, within)


def _within(
    body: int, flags: int, parents: Mapping[int, int], rows: Iterable[LinkKey]
) -> Iterator[tuple[LinkKey, LinkKey]]:
    """The pairs of links of a body that may collide by its flags, as in btMultiBodyLinkCollider."""
    links = sorted(link for id, link in rows if id == body)
    apart_from: dict[int, set[int | None]]
    if flags & pybullet.URDF_USE_SELF_COLLISION_EXCLUDE_ALL_PARENTS:
        apart_from = {link: _ancestors(link, parents) for link in links}
    elif flags & pybullet.URDF_USE_SELF_COLLISION_INCLUDE_PARENT:
        apart_from = {link: set() for link in links}
    else:
        apart_from = {link: {parents.get(link)} for link in links}
    for a, b in combinations(links, 2):
        if a not in apart_from[b] and b not in apart_from[a]:
            yield (body, a), (body, b)


def _ancestors(link: int, parents: Mapping[int, int]) -> set[int | None]:
    found: set[int | None] = set()
    while link in parents:
        link = parents[link]
        found.add(link)
    return found
