"""Which links a simulator lets collide, by groups, masks and exceptions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from overlapper._core import PairMask
from overlapper.simulation.model import LinkKey

Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Colliders:
    """The links of a scene as arrays.

    `rows` is the row of each link by (body, link), and `body` (n,) is its body. `group` and `mask` (n,) are those of
    its collision filter.
    """

    rows: Mapping[LinkKey, int]
    body: Indices
    group: Indices
    mask: Indices

    @classmethod
    def of(cls, rows: Mapping[LinkKey, int], filters: Mapping[LinkKey, tuple[int, int]]) -> Colliders:
        """From group and mask by link. A link without a filter has group 1 and a mask that admits all groups."""
        group, mask = np.array([filters.get(each, (1, -1)) for each in rows], dtype=int).reshape(-1, 2).T
        return cls(rows, np.array([body for body, _ in rows], dtype=int), group, mask)


class Rules(Protocol):
    """Which colliders may collide. A collider is given by its row in `Layout.collider_rows`."""

    lasting: bool = True
    """False if the rules may give another answer for the same pair at another time."""

    def allow(self, first: Indices, second: Indices) -> Mask:
        """Whether the colliders in these rows may collide, pair by pair; first < second."""

    def count(self, weights: NDArray[np.int64]) -> int:
        """How many pairs of shapes may collide, if `weights` (n,) says how many each collider has."""

    def mask(self, colliders: Indices) -> PairMask | None:
        """The rules for the core, if it knows rules of this kind; `colliders` (k,) is the row of each shape's link."""
        return None


class MaskRules(Rules):
    """The rules of groups, masks and exceptions.

    Pair filters override masks. Two links of one body may collide only if the pair is listed, too.
    """

    def __init__(
        self,
        colliders: Colliders,
        both: bool = False,
        filters: Mapping[tuple[LinkKey, LinkKey], bool] | None = None,
        within: Iterable[tuple[LinkKey, LinkKey]] = (),
    ) -> None:
        """With `both`, both masks must admit the other's group; otherwise one is enough. `filters` override masks.

        `within` are the pairs of links of one body that may collide. In each pair the lesser link comes first.
        """
        self._colliders = colliders
        self._both = both
        rows = colliders.rows
        said = [(rows[a], rows[b], may) for (a, b), may in (filters or {}).items() if a in rows and b in rows]
        self._filtered, self._enabled = self._sorted(said)
        self._within = self._sorted([(rows[a], rows[b], True) for a, b in within])[0]

    def _code(self, first: Indices, second: Indices) -> Indices:
        """Each pair of colliders as one number."""
        return np.asarray(first * len(self._colliders.body) + second)

    def _sorted(self, pairs: list[tuple[int, int, bool]]) -> tuple[Indices, Mask]:
        """The codes of these pairs, sorted, with their truth values."""
        first, second, said = np.array(pairs, dtype=np.intp).reshape(-1, 3).T
        codes = self._code(first, second)
        order = np.argsort(codes)
        return codes[order], said[order].astype(bool)

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
        # Pairs with a filter, and pairs within a body, are counted one by one.
        codes = np.union1d(self._filtered, self._within)
        first, second = np.divmod(codes, max(len(c.body), 1))
        by_masks = self._masks_admit(c.group[first], c.mask[first], c.group[second], c.mask[second])
        plainly = by_masks & (c.body[first] != c.body[second])
        change = self.allow(first, second).astype(np.int64) - plainly
        return pairs + int((weights[first] * weights[second] * change).sum())


def _places(codes: Indices, wanted: Indices) -> tuple[Indices, Mask]:
    """The insertion place of each of `wanted` in sorted codes, and whether it is among them."""
    place = np.searchsorted(codes, wanted)
    found = place < len(codes)
    found[found] = codes[place[found]] == wanted[found]
    return place, found


def partners(rules: Rules, links: Sequence[LinkKey], rows: Indices) -> dict[LinkKey, list[LinkKey]]:
    """The partners with which each collider in these sorted rows may collide. `links` are those of all rows."""
    found: dict[LinkKey, list[LinkKey]] = {links[row]: [] for row in rows}
    first, second = (rows[each] for each in np.triu_indices(len(rows), 1))
    allowed = rules.allow(first, second)
    for a, b in zip(first[allowed], second[allowed]):
        found[links[a]].append(links[b])
        found[links[b]].append(links[a])
    return found
