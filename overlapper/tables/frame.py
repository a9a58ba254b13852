"""A step of a simulation, as tables, pages and summaries take it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

from overlapper.simulation.contacts import Contacts
from overlapper.tables.still import Still

if TYPE_CHECKING:
    from overlapper.simulation import Forces
    from overlapper.simulation.bodies import AnyBodies
    from overlapper.simulation.first_overlaps import FirstOverlaps

Shown = TypeVar("Shown", bound="AnyBodies | Still", covariant=True)


@dataclass(frozen=True, slots=True)
class Frame(Generic[Shown]):
    """The bodies and their overlaps after `step` steps, `time` seconds into the simulation.

    In a run, `bodies` is the same `Bodies` in every frame. In a frame that was kept or read from a file, it is a
    `Still`. With volumetric contact, `forces` are the mean forces over the step. They are those between the pairs that
    volumetric contact pushes apart. Their `contacts` do not include pairs that are only measured. `first` are the first
    overlaps since the step before, if they were asked for.
    """

    step: int
    time: float
    bodies: Shown
    contacts: Contacts
    forces: Forces | None = None
    first: FirstOverlaps | None = None

    def kept(self) -> Frame[Still]:
        """Return a copy that later steps of the simulation do not change."""
        return Frame(self.step, self.time, self.still(), self.contacts, self.forces, self.first)

    def still(self) -> Still:
        """Return the bodies as they are now, without the simulation."""
        return self.bodies if isinstance(self.bodies, Still) else Still.of(self.bodies, self.forces)
