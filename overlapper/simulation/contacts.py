"""The pairs of shapes of a scene that overlap or touch, one by one or as arrays."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING, Any, SupportsIndex, overload

import numpy as np
from numpy.typing import NDArray

from overlapper import Overlap, Overlaps
from overlapper.columns import MEASURE_COLUMNS, MEASURES, Columns, Tabular

STATUS = np.array(["separated", "touching", "overlapping"])  # by the numbers of Overlaps.status


@dataclass(frozen=True, slots=True)
class Contact:
    """Two shapes that overlap or touch; `overlap.status` tells which.

    Parameters
    ----------
    bodyA, linkA, shapeA : int
        Number of the body, of its link, and of the shape within the link. Link -1 is the base.
    bodyB, linkB, shapeB : int
        Those of the second shape. A is the lesser of the two.
    overlap : Overlap
        The overlap. `overlap.shapes[0]` is the shape of A. `overlap.normal` points from B to A, as pybullet's
        contactNormalOnB does.
    """

    bodyA: int
    linkA: int
    shapeA: int
    bodyB: int
    linkB: int
    shapeB: int
    overlap: Overlap

    @property
    def solids(self) -> tuple[int, int, int, int]:
        """(bodyA, linkA, bodyB, linkB): the rigid solids of the two shapes."""
        return self.bodyA, self.linkA, self.bodyB, self.linkB


def key_columns(keys: NDArray[np.int64], names: Mapping[tuple[int, int], str]) -> Columns:
    """The columns bodyA, linkA, shapeA, nameA, then those of B, from rows of six integers."""
    columns: Columns = {}
    for side, at in (("A", keys[:, :3]), ("B", keys[:, 3:])):
        columns |= {f"{word}{side}": values for word, values in zip(("body", "link", "shape"), at.T)}
        columns[f"name{side}"] = [names.get((body, link)) for body, link in at[:, :2].tolist()]
    return columns


if TYPE_CHECKING:
    # Type checkers know this module, with the defaults of type variables. At run time it may not be installed.
    from typing_extensions import TypeVar

    Kind = TypeVar("Kind", bound=Contact, covariant=True, default=Contact)
else:
    from typing import TypeVar

    Kind = TypeVar("Kind", bound=Contact, covariant=True)


class Contacts(Tabular, Sequence[Kind]):
    """The contacts of a step, sorted by (bodyA, linkA, shapeA, bodyB, linkB, shapeB), one by one or as arrays.

    Each Contact is made at its first use, and kept. A slice, a mask or an array of indices selects contacts, as in
    `contacts[contacts.overlaps.depth > 1e-3]`. `to_pandas()`, `to_arrow()` and `to_polars()` make tables with the
    columns of `overlapper run`, without steps and poses.

    Parameters
    ----------
    keys : (k, 3) ndarray of int64
        Body, link and shape of each shape that the pairs of `overlaps` index.
    overlaps : Overlaps
        Volumes, centroids, normals, depths, gradients and more as arrays, with a row for each contact.
    names : dict of (body, link) to str, optional
        Names of the links.
    kind : type, default Contact
        The class of each contact.
    """

    __slots__ = ("_keys", "_made", "kind", "names", "overlaps")

    def __init__(
        self,
        keys: NDArray[np.int64],
        overlaps: Overlaps,
        names: Mapping[tuple[int, int], str] | None = None,
        kind: type[Kind] = Contact,  # type: ignore[assignment]
    ) -> None:
        """`keys` (k, 3) are body, link and shape of each shape that the pairs of `overlaps` index."""
        self.overlaps = overlaps
        self.names = names or {}
        self.kind = kind
        self._keys = keys
        self._made: list[Kind | None] = [None] * len(overlaps)

    @property
    def keys(self) -> NDArray[np.int64]:
        """(n, 6) integers bodyA, linkA, shapeA, bodyB, linkB, shapeB of each contact."""
        return self._keys[self.overlaps.pairs].reshape(-1, 6)

    def __len__(self) -> int:
        return len(self._made)

    @overload
    def __getitem__(self, which: int) -> Kind: ...
    @overload
    def __getitem__(self, which: slice | Sequence[int] | NDArray[Any]) -> Contacts[Kind]: ...
    def __getitem__(self, which: Any) -> Kind | Contacts[Kind]:
        if not isinstance(which, SupportsIndex) or isinstance(which, np.ndarray):
            return Contacts(self._keys, self.overlaps[which], self.names, self.kind)
        row = range(len(self))[which]
        made = self._made[row]
        if made is None:
            (bodyA, linkA, shapeA), (bodyB, linkB, shapeB) = self._keys[self.overlaps.pairs[row]].tolist()
            made = self.kind(bodyA, linkA, shapeA, bodyB, linkB, shapeB, self.overlaps[row])
            self._made[row] = made
        return made

    def __iter__(self) -> Iterator[Kind]:
        return map(self.__getitem__, range(len(self)))

    def __eq__(self, other: object) -> bool:
        return list(self) == list(other) if isinstance(other, (list, Contacts)) else NotImplemented

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        return Contacts, (self._keys, self.overlaps, dict(self.names), self.kind)

    def columns(self) -> Columns:
        """The columns of the table by name.

        Returns
        -------
        dict of str to ndarray or list
            A value for each row.
        """
        found = self.overlaps
        keys = self.keys
        columns = key_columns(keys, self.names)
        measures = chain.from_iterable(np.atleast_2d(getattr(found, name).T) for name in MEASURES)
        return columns | {"status": STATUS[found.status].tolist()} | dict(zip(MEASURE_COLUMNS, measures))

    def __repr__(self) -> str:
        return f"Contacts({len(self)}, {int((self.overlaps.status == Overlaps.OVERLAPPING).sum())} of them overlapping)"
