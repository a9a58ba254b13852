"""The overlaps of a simulation per pair of links: what the unions of their shapes share, every volume counted once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from overlapper.columns import MEASURE_COLUMNS, Columns, Tabular, measures_of
from overlapper.simulation.contacts import Contact, Contacts
from overlapper.union import UnionOverlap, of_pair, of_pairs

if TYPE_CHECKING:
    from overlapper import Placed


@dataclass(frozen=True, slots=True)
class LinkContact:
    """Two links whose shapes overlap or touch. True only if they overlap.

    `bodyA`, `linkA`, `bodyB` and `linkB` are pybullet's indices, link -1 is the base. `overlap` is what the unions of
    their shapes share, `contacts` are the pairs of their shapes, and `deepest` is the pair with the largest depth.
    Where one pair of shapes overlaps, its depth and normal, from B to A, are those of the links. Otherwise they are a
    lower bound of how far the links must be moved apart, and a first guess of where to.
    """

    bodyA: int
    linkA: int
    bodyB: int
    linkB: int
    contacts: tuple[Contact, ...]
    overlap: UnionOverlap

    def __bool__(self) -> bool:
        return any(contact.overlap for contact in self.contacts)

    @property
    def status(self) -> Literal["touching", "overlapping"]:
        """Overlapping, if any pair of their shapes is."""
        return "overlapping" if self else "touching"

    @property
    def volume(self) -> float:
        """m³ that the union of the shapes of one link shares with that of the other; 0 unless overlapping."""
        return self.overlap.volume

    @property
    def volume_error(self) -> float:
        """m³: the true volume is within volume ± volume_error."""
        return self.overlap.volume_error

    @property
    def centroid(self) -> NDArray[np.float64] | None:
        """(3,) of the common volume in the world, m; None unless overlapping."""
        return self.overlap.centroid

    @property
    def gradient(self) -> NDArray[np.float64]:
        """(2, 6) d volume / d (translation, rotation vector) of A's link and of B's, m² and m³: about the point
        `overlap.about`, world axes; zeros unless overlapping."""
        return self.overlap.gradient

    @property
    def patch_area(self) -> NDArray[np.float64]:
        """(3,) m², the area vector of what the union of A's shapes holds of the surface of B's, from B to A: as
        gradient[1, :3]; zeros unless overlapping."""
        return self.gradient[1, :3]

    @property
    def deepest(self) -> Contact:
        """The pair of shapes with the largest depth."""
        return max(self.contacts, key=lambda contact: contact.overlap.depth or 0.0)

    @property
    def depth(self) -> float:
        """m, of the deepest pair of shapes."""
        return self.deepest.overlap.depth or 0.0

    @property
    def normal(self) -> NDArray[np.float64]:
        """(3,) unit, from B to A, of the deepest pair of shapes."""
        normal = self.deepest.overlap.normal
        assert normal is not None
        return normal


class LinkContacts(Tabular, list[LinkContact]):
    """A list of them; `names` are those of the links, by (body, link). As a table, by `to_pandas()` and its like, they
    have the columns of `overlapper run --links` but for its steps; the area is missing."""

    __slots__ = ("names",)

    def __init__(self, pairs: Iterable[LinkContact] = (), names: Mapping[tuple[int, int], str] | None = None) -> None:
        super().__init__(pairs)
        self.names = names or {}

    def columns(self) -> Columns:
        """The columns of the table by name, each an array or a list with a value for each row."""
        columns: Columns = {}
        for side, links in (
            ("A", [(pair.bodyA, pair.linkA) for pair in self]),
            ("B", [(pair.bodyB, pair.linkB) for pair in self]),
        ):
            at = np.array(links, np.int64).reshape(-1, 2)
            columns |= {f"body{side}": at[:, 0], f"link{side}": at[:, 1]}
            columns[f"name{side}"] = [self.names.get(link) for link in links]
        measures = [measures_of(pair) for pair in self]
        columns["status"] = [pair.status for pair in self]
        return columns | {name: np.array([each[name] for each in measures], float) for name in MEASURE_COLUMNS}


def link_contacts(contacts: Iterable[Contact]) -> LinkContacts:
    """The contacts that `Bodies.overlaps` found, per pair of links, sorted by (bodyA, linkA, bodyB, linkB)."""
    if not isinstance(contacts, Iterable):
        raise TypeError(f"contacts must be what Bodies.overlaps() returns, not {contacts!r}")
    ordered = sorted(contacts, key=lambda each: (_solids(each), _shapes(each)))
    pairs = [LinkContact(*solids, (each := tuple(group)), _union(each)) for solids, group in groupby(ordered, _solids)]
    return LinkContacts(pairs, contacts.names if isinstance(contacts, Contacts) else None)


def _solids(contact: Contact) -> tuple[int, int, int, int]:
    return contact.solids


def _shapes(contact: Contact) -> tuple[tuple[int, int], tuple[int, int]]:
    return (contact.linkA, contact.shapeA), (contact.linkB, contact.shapeB)


def _union(contacts: tuple[Contact, ...]) -> UnionOverlap:
    if len(contacts) == 1:
        return of_pair(contacts[0].overlap)
    sides: tuple[dict[tuple[int, int], Placed], dict[tuple[int, int], Placed]] = ({}, {})
    for contact in contacts:
        for side, shape, placed in zip(sides, _shapes(contact), contact.overlap.shapes):
            side.setdefault(shape, placed)
    rows = [{shape: row for row, shape in enumerate(side)} for side in sides]
    pairs = {(rows[0][a], rows[1][b]): each.overlap for each in contacts for a, b in [_shapes(each)]}
    return of_pairs([*sides[0].values()], [*sides[1].values()], pairs)
