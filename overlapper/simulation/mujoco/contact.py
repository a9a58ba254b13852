"""Two geoms that overlap or touch."""

from __future__ import annotations

from dataclasses import dataclass

from overlapper.simulation.contacts import Contact
from overlapper.simulation.model import BASE


@dataclass(frozen=True, slots=True)
class GeomContact(Contact):
    """Two geoms that overlap or touch; `overlap.status` tells which.

    Bodies and geoms have MuJoCo's numbers. A is the lesser of the two by (body, geom). `overlap.normal` points from B
    to A. MuJoCo's `contact.frame[:3]` points from `contact.geom[0]` to `contact.geom[1]`.

    Parameters
    ----------
    bodyA, linkA, shapeA : int
        Number of the first body and of its geom, and 0. In a height field, `shapeA` is the number of the triangle. In
        tables, a geom has the column of a link. `geomA` is `linkA`.
    bodyB, linkB, shapeB : int
        Those of the second geom.
    overlap : Overlap
        The overlap of the two.
    """

    @property
    def geomA(self) -> int:
        """MuJoCo's number of the first geom."""
        return self.linkA

    @property
    def geomB(self) -> int:
        """MuJoCo's number of the second geom."""
        return self.linkB

    @property
    def solids(self) -> tuple[int, int, int, int]:
        """(bodyA, -1, bodyB, -1): a body is rigid with all of its geoms."""
        return self.bodyA, BASE, self.bodyB, BASE
