"""A step of a simulation as tables, pages and summaries take it in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

from overlapper.simulation.contacts import Contacts
from overlapper.tables.still import Still

if TYPE_CHECKING:
    from overlapper.simulation import Forces
    from overlapper.simulation.bodies import AnyBodies

Shown = TypeVar("Shown", bound="AnyBodies | Still", covariant=True)


@dataclass(frozen=True, slots=True)
class Frame(Generic[Shown]):
    """The bodies and what they share after `step` steps, `time` seconds into the simulation.

    In a run, `bodies` is the same `Bodies` in every frame. In a frame that was kept or read from a file, it is a
    `Still`. `forces`, with volumetric contact, are the mean over the step between the pairs that it pushes apart; their
    `contacts` have no pairs that are only measured.
    """

    step: int
    time: float
    bodies: Shown
    contacts: Contacts
    forces: Forces | None = None

    def kept(self) -> Frame[Still]:
        """A copy that later steps of the simulation do not change."""
        return Frame(self.step, self.time, self.still(), self.contacts, self.forces)

    def still(self) -> Still:
        """The bodies as they are now, without the simulation."""
        return self.bodies if isinstance(self.bodies, Still) else Still.of(self.bodies, self.forces)
