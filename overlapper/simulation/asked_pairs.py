"""The chosen pairs of shapes: those that the simulator lets collide, all pairs, or the pairs of a list."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from overlapper import _core
from overlapper.simulation.collision_rules import Mask, Rules
from overlapper.simulation.layout import Layout

Key = tuple[int, int, int]  # body, link, shape
Who = int | tuple[int, int] | Key  # a body, a link or a shape
Codes = NDArray[np.int64]

Among = Literal["simulated", "all"] | Iterable[tuple[Who | str, Who | str]]
Numbered = Literal["simulated", "all"] | Iterable[tuple[Who, Who]]  # without names


def listed(pairs: Any) -> list[tuple[Any, Any]]:
    """`pairs` as a list of pairs. Two bodies or names are one pair. ValueError if `pairs` is not a list of pairs."""
    asked = list(pairs) if isinstance(pairs, Iterable) else None
    if asked and len(asked) == 2 and all(isinstance(each, (int, str)) for each in asked):
        asked = [tuple(asked)]
    if asked is None or not all(isinstance(each, (tuple, list)) and len(each) == 2 for each in asked):
        raise ValueError(f"pairs must be 'simulated', 'all' or a list of pairs, not {pairs!r}")
    return [(a, b) for a, b in asked]


TABLED = 256  # the most links whose pairs are decided in advance


class AskedPairs:
    """The chosen pairs of a layout, whose bodies have these `links`. The codes of a list are kept for the next step."""

    def __init__(self, layout: Layout, links: Mapping[int, Collection[int]]) -> None:
        self.layout, self._links = layout, links
        self._listed: tuple[list[tuple[Who, Who]], Codes] | None = None
        self._masked: tuple[Rules, _core.PairMask | None] | None = None

    def chosen(self, pairs: NDArray[np.int32], among: Numbered, rules: Rules) -> Mask:
        """Which of these pairs of shapes are chosen."""
        first, second = pairs.T
        if among == "all":
            return np.asarray(self.layout.owners[first] != self.layout.owners[second])
        if among != "simulated":
            return np.isin(first * np.int64(len(self.layout.keys)) + second, self._codes(among))
        a, b = self.layout.colliders[first], self.layout.colliders[second]
        return np.asarray((a != b) & rules.allow(a, b))

    def mask(self, rules: Rules) -> _core.PairMask | None:
        """The pairs that the simulator lets collide, for the core. None if the core cannot decide, or not yet.

        A table of all pairs of links is made at the second call with the same rules, if the core does not know rules of
        this kind. Rules that change in every step get no table.
        """
        if not rules.lasting:
            return None
        if self._masked is None or self._masked[0] is not rules:
            self._masked = rules, rules.mask(self.layout.colliders)
        elif self._masked[1] is None and len(self.layout.collider_rows) <= TABLED:
            count = len(self.layout.collider_rows)
            table = np.zeros((count, count), dtype=bool)
            first, second = np.triu_indices(count, 1)
            table[first, second] = table[second, first] = rules.allow(first, second)
            self._masked = rules, _core.PairMask(self.layout.colliders, table)
        return self._masked[1]

    def possible(self, among: Numbered, rules: Rules) -> int:
        """The number of chosen pairs of shapes, at any poses."""
        if among == "simulated":
            layout = self.layout
            return rules.count(np.bincount(layout.colliders, minlength=len(layout.collider_rows)))
        if among != "all":
            return len(self._codes(among))
        of_each = np.unique(self.layout.owners, return_counts=True)[1]
        return int(len(self.layout.owners) ** 2 - (of_each**2).sum()) // 2

    def colliders(self, among: Numbered, rules: Rules) -> NDArray[np.intp]:
        """(n, 2) the chosen pairs of links, at any poses, as values of `layout.collider_rows`."""
        layout = self.layout
        if among != "simulated" and among != "all":
            pairs = layout.colliders[np.array(np.divmod(self._codes(among), len(layout.keys)))].T
            return np.unique(np.sort(pairs, axis=1), axis=0)
        first, second = np.triu_indices(len(layout.collider_rows), 1)
        body = np.array([id for id, _ in layout.collider_rows])
        chosen = body[first] != body[second] if among == "all" else rules.allow(first, second)
        return np.stack([first[chosen], second[chosen]], axis=1)

    def _codes(self, among: Iterable[tuple[Who, Who]]) -> Codes:
        """The `pair_codes` of a list."""
        if isinstance(among, str):
            raise ValueError(f"pairs must be 'simulated', 'all' or a list of pairs, not {among!r}")
        asked = list(among)
        if not self._listed or self._listed[0] != asked:
            self._listed = asked, pair_codes(asked, self.layout.keys, self._links)
        return self._listed[1]


def pair_codes(asked: Sequence[tuple[Who, Who]], keys: Sequence[Key], links: Mapping[int, Collection[int]]) -> Codes:
    """The pairs of shapes that a list means. Each pair is one number: i * len(keys) + j for keys[i] and keys[j], i < j.

    A body or a link means all of its shapes. Two shapes of one link are a pair only if both are named as shapes.
    `links` are those of each body. ValueError if a body or link is missing.
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
