"""The overlaps of a simulation per pair of links: what the unions of their shapes share. No volume is counted twice."""

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
    """Two links whose shapes overlap or touch. Its truth value is True only if they overlap.

    If only one pair of shapes overlaps, its depth and normal (from B to A) are those of the links. Otherwise the depth
    is a lower bound of the distance that separates the links, and the normal is a first guess of the direction.

    Parameters
    ----------
    bodyA, linkA : int
        Number of the body and of its link. Link -1 is the base.
    bodyB, linkB : int
        Those of the second link.
    contacts : tuple of Contact
        The pairs of their shapes. `deepest` is the pair with the largest depth.
    overlap : UnionOverlap
        The intersection of the unions of their shapes.
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
        """The status: "overlapping" if any pair of their shapes overlaps, otherwise "touching"."""
        return "overlapping" if self else "touching"

    @property
    def volume(self) -> float:
        """The volume of the intersection of the two unions of shapes, m³; 0 unless overlapping."""
        return self.overlap.volume

    @property
    def volume_error(self) -> float:
        """The true volume is within volume ± volume_error, m³."""
        return self.overlap.volume_error

    @property
    def centroid(self) -> NDArray[np.float64] | None:
        """(3,) centroid of the common volume in the world, m; None unless overlapping."""
        return self.overlap.centroid

    @property
    def gradient(self) -> NDArray[np.float64]:
        """(2, 6) d volume / d (translation, rotation vector) of A's link and of B's, m² and m³: about the point
        `overlap.about`, in world axes; zeros unless overlapping."""
        return self.overlap.gradient

    @property
    def patch_area(self) -> NDArray[np.float64]:
        """(3,) area vector of B's surface within A, for the unions of their shapes, m², from B to A: equal to
        gradient[1, :3]; zeros unless overlapping."""
        return self.gradient[1, :3]

    @property
    def deepest(self) -> Contact:
        """The pair of shapes with the largest depth."""
        return max(self.contacts, key=lambda contact: contact.overlap.depth or 0.0)

    @property
    def depth(self) -> float:
        """The depth of the deepest pair of shapes, m."""
        return self.deepest.overlap.depth or 0.0

    @property
    def normal(self) -> NDArray[np.float64]:
        """(3,) unit normal of the deepest pair of shapes, from B to A."""
        normal = self.deepest.overlap.normal
        assert normal is not None
        return normal


class LinkContacts(Tabular, list[LinkContact]):
    """A list of `LinkContact`.

    `to_pandas()`, `to_arrow()` and `to_polars()` make tables with the columns of `overlapper run --per link`, without
    steps. The area is missing.

    Parameters
    ----------
    pairs : iterable of LinkContact
        The pairs of links.
    names : dict of (body, link) to str, optional
        Names of the links.
    """

    __slots__ = ("names",)

    def __init__(self, pairs: Iterable[LinkContact] = (), names: Mapping[tuple[int, int], str] | None = None) -> None:
        super().__init__(pairs)
        self.names = names or {}

    def columns(self) -> Columns:
        """The columns of the table by name.

        Returns
        -------
        dict of str to ndarray or list
            A value for each row.
        """
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
    """The contacts of `Bodies.overlaps`, for each pair of links.

    Parameters
    ----------
    contacts : iterable of Contact
        What `Bodies.overlaps` returns.

    Returns
    -------
    LinkContacts
        Sorted by (bodyA, linkA, bodyB, linkB).

    Raises
    ------
    TypeError
        If `contacts` is something else.
    """
    if not isinstance(contacts, Iterable):
        raise TypeError(f"contacts must be what Bodies.overlaps() returns, not {contacts!r}")
    contacts = contacts if isinstance(contacts, Contacts) else [*contacts]
    if strange := [each for each in contacts if not isinstance(each, Contact)]:
        raise TypeError(f"contacts must be what Bodies.overlaps() returns, not {strange[0]!r} among them")
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
