"""The forces between bodies that share volumes, as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from overlapper.columns import FORCE_COLUMNS, FORCE_MEASURES, Columns, Tabular
from overlapper.simulation.contacts import Contacts
from overlapper.simulation.forces.energy import energies
from overlapper.simulation.model import Array


@dataclass(frozen=True, eq=False)
class Forces(Tabular):
    """Forces between overlapping pairs of shapes, a row for each pair, in SI units and the world frame.

    `contacts` are their overlaps. `force` (p, 3) in N acts on the first of each pair at `centre`, and `torque` (p, 3)
    in N m about it: of pressures that change, and of friction that resists a spin; the opposite acts on the second.
    `slip` (p, 3) in m/s is the velocity of the first over the second at `centre`, along the patch, at the end of the
    step. `normal` (p, 3) is the direction of the pressures, unit, from the second to the first; where `directed` (p,)
    is False, what is shared has none, and it is the last known. `stiffness` (p,) is in Pa/m.

    As a table, by `to_pandas()` and its like, they have the columns of `contacts` and those that volumetric contact
    adds to `overlapper run`.
    """

    contacts: Contacts
    force: Array
    torque: Array
    slip: Array
    normal: Array
    directed: NDArray[np.bool_]
    stiffness: Array

    @property
    def pairs(self) -> NDArray[np.int64]:
        """(p, 6) integers bodyA, linkA, shapeA, bodyB, linkB, shapeB of each row."""
        return self.contacts.keys

    @property
    def centre(self) -> Array:
        """(p, 3) m, the centroid of what is shared: what the force goes through; not a number of pairs that touch."""
        centroid: Array = self.contacts.overlaps.centroid
        return centroid

    @cached_property
    def energy(self) -> Array:
        """(p,) J, stored in the pressures: half of stiffness times the square of the depth, over the patch.

        It is found when it is first asked for: with a half-space by the depth of the centroid, otherwise as the work
        of drawing the two apart along the normal, by 16 volumes for each pair.
        """
        return energies(self.contacts.overlaps, self.normal, self.stiffness)

    def on(self, body: int, link: int | None = None) -> tuple[Array, Array]:
        """Force (3,) in N and torque (3,) in N m about the world's origin, by all pairs, on a body or a link of it.

        Forces between links of a body cancel, unless one link is asked for.
        """
        force, moment = np.zeros(3), np.zeros(3)
        keys, centre = self.pairs, np.nan_to_num(self.centre)
        for first, sign in ((0, 1.0), (3, -1.0)):
            rows = keys[:, first] == body
            if link is not None:
                rows &= keys[:, first + 1] == link
            force += sign * self.force[rows].sum(axis=0)
            moment += sign * (self.torque[rows] + np.cross(centre[rows], self.force[rows])).sum(axis=0)
        return force, moment

    def between_links(self) -> dict[tuple[int, int, int, int], Array]:
        """The force (3,) in N on the first of two links, by (bodyA, linkA, bodyB, linkB)."""
        found: dict[tuple[int, int, int, int], Array] = {}
        for (a, la, _, b, lb, _), force in zip(self.pairs.tolist(), self.force):
            found[a, la, b, lb] = found.get((a, la, b, lb), 0.0) + force
        return found

    @cached_property
    def measures(self) -> Array:
        """(p, 10) force, torque, energy and slip, by the columns of `overlapper run`."""
        return np.column_stack([getattr(self, name) for name in FORCE_MEASURES])

    def columns(self) -> Columns:
        """The columns of the table by name, each an array or a list with a value for each row."""
        return {**self.contacts.columns(), **dict(zip(FORCE_COLUMNS, self.measures.T))}

    def __len__(self) -> int:
        return len(self.force)

    def __repr__(self) -> str:
        return f"Forces({len(self)} pairs, {np.linalg.norm(self.force, axis=1).max(initial=0.0):.3g} N at most)"
