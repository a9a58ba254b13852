"""The pairs of shapes that meet between two poses of a simulation, and when."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from overlapper.columns import IMPACT_COLUMNS, Columns, Rows
from overlapper.simulation.collision_rules import Mask
from overlapper.simulation.contacts import key_columns
from overlapper.simulation.layout import Layout, Pose
from overlapper.simulation.model import Array, LinkKey


@dataclass(frozen=True, slots=True)
class FirstOverlap:
    """Two shapes that were separated at an update, and met before the next update.

    Parameters
    ----------
    bodyA, linkA, shapeA : int
        Number of the body, of its link, and of the shape within the link. Link -1 is the base.
    bodyB, linkB, shapeB : int
        Those of the second shape. A is the lesser of the two.
    status : {'impact', 'touching', 'open'}
        As in `TimeOfImpact.status`.
    fraction : float
        Part of the motion before the first common point, from 0 to 1. It is never too large.
    point : (3,) ndarray
        The first common point in the world, m.
    normal : (3,) ndarray
        Unit normal there, from B to A.
    apart : bool
        Whether the shapes are separated again at the end of the motion.
    """

    bodyA: int
    linkA: int
    shapeA: int
    bodyB: int
    linkB: int
    shapeB: int
    status: Literal["impact", "touching", "open"]
    fraction: float
    point: NDArray[np.float64] = field(compare=False)
    normal: NDArray[np.float64] = field(compare=False)
    apart: bool

    @property
    def tunnelled(self) -> bool:
        """Whether they certainly overlapped and are separated again: `overlaps()` of both updates misses this."""
        return self.status == "impact" and self.apart

    @property
    def key(self) -> tuple[int, int, int, int, int, int]:
        """(bodyA, linkA, shapeA, bodyB, linkB, shapeB)."""
        return self.bodyA, self.linkA, self.shapeA, self.bodyB, self.linkB, self.shapeB


class FirstOverlaps(Rows, list[FirstOverlap]):
    """A list of `FirstOverlap`, sorted by (bodyA, linkA, shapeA, bodyB, linkB, shapeB).

    `to_pandas()`, `to_arrow()` and `to_polars()` make tables.

    Parameters
    ----------
    pairs : iterable of FirstOverlap
        The pairs of shapes.
    names : dict of (body, link) to str, optional
        Names of the links.
    """

    __slots__ = ("names",)

    def __init__(self, pairs: Iterable[FirstOverlap] = (), names: Mapping[LinkKey, str] | None = None) -> None:
        super().__init__(pairs)
        self.names = names or {}

    @property
    def tunnelled(self) -> FirstOverlaps:
        """Those that certainly overlapped and are separated again."""
        return FirstOverlaps((pair for pair in self if pair.tunnelled), self.names)

    def columns(self) -> Columns:
        """The columns of the table by name.

        Returns
        -------
        dict of str to ndarray or list
            A value for each row.
        """
        columns = key_columns(np.array([pair.key for pair in self], np.int64).reshape(-1, 6), self.names)
        columns["status"] = [pair.status for pair in self]
        columns["apart"] = np.array([pair.apart for pair in self], bool)
        numbers = np.array([[pair.fraction, *pair.point, *pair.normal] for pair in self], float).reshape(-1, 7)
        return columns | dict(zip([*IMPACT_COLUMNS, *(f"normal_{axis}" for axis in "xyz")], numbers.T))


@dataclass(frozen=True, slots=True)
class Moment:
    """The poses of the shapes of a layout at an update, and the frames of the links with height fields."""

    layout: Layout
    positions: Array
    orientations: Array
    grounds: dict[LinkKey, Pose]

    @classmethod
    def of(cls, layout: Layout, grounds: Iterable[LinkKey]) -> Moment:
        """The present poses."""
        return cls(layout, layout.positions, layout.orientations, {key: layout.frame(key) for key in grounds})

    def same_as(self, other: Moment) -> bool:
        """Whether it has the same shapes at the same poses."""
        pairs = (self.positions, other.positions), (self.orientations, other.orientations)
        return self.layout is other.layout and all(np.array_equal(a, b) for a, b in pairs)

    def begun(self, earlier: Moment) -> tuple[Array, Array, Mask]:
        """The poses of these shapes at an earlier moment, and for each shape whether its pose was known then.

        A prism of a height field that has not moved was where it is, even if it was not modelled.
        """
        if earlier.layout is self.layout:
            return earlier.positions, earlier.orientations, np.ones(len(self.positions), bool)
        rows = {key: row for row, key in enumerate(earlier.layout.keys)}
        shapes = earlier.layout.shapes
        positions, orientations = self.positions.copy(), self.orientations.copy()
        known = np.zeros(len(positions), bool)
        for row, (key, shape) in enumerate(zip(self.layout.keys, self.layout.shapes)):
            before = rows.get(key)
            if before is not None and shapes[before] is shape:
                positions[row], orientations[row] = earlier.positions[before], earlier.orientations[before]
                known[row] = True
            else:
                link = key[:2]
                known[row] = link in self.grounds and self.grounds[link] == earlier.grounds.get(link)
        return positions, orientations, known
