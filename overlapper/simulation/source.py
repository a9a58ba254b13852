"""The interface of a simulator for `AnyBodies`: bodies, changes, poses, and which links may collide."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from overlapper.simulation.collision_rules import Mask, Rules
from overlapper.simulation.contacts import Contact, Contacts
from overlapper.simulation.layout import Layout, Poses
from overlapper.simulation.mechanics import Mechanics
from overlapper.simulation.model import Array, ModelledBody, Skipped


class Unreadable(RuntimeError):
    """A simulator cannot hand over its shapes. The text is one sentence."""


class Source(Protocol):
    """A simulator's answers. Subclasses of `Source` inherit the default answers, where there are any."""

    engine: str = ""
    """The name of the engine in ENGINES; empty if it is not there."""

    contact: type[Contact] = Contact
    """The class of contacts: two shapes that overlap or touch."""

    poses_lag: bool = False
    """Whether the poses that are read after a step are those of its beginning."""

    bodies: dict[int, ModelledBody]
    """The bodies by number, sorted. `AnyBodies` replaces a height field when it models another part of the ground."""

    @property
    def time_step(self) -> float:
        """The time step, s."""

    def refresh(self) -> Sequence[Skipped] | None:
        """Read new bodies. None if no body has come or gone, otherwise the newly skipped shapes.

        ValueError if the simulation has ended.
        """

    def poses(self, links: Mapping[int, Sequence[int]]) -> Poses:
        """The reader of the frames of these bodies' bases, and of their `links`."""

    def step_ended(self) -> None:
        """Called at first and after each step, before anything but the step can have moved a body."""
        return

    def end_of_step(self, layout: Layout) -> tuple[Array, Array] | None:
        """Called before each step, for a simulator whose poses after a step are those of its beginning.

        The positions and orientations of the shapes at the end of the last step, if something but this step has moved a
        body since.
        """
        return None

    def rules(self, layout: Layout) -> Rules:
        """The rules in force. The object stays the same as long as the rules and the layout do."""

    @property
    def settings(self) -> Mapping[str, str | float]:
        """The settings with which the bodies were read, for the headings of tables."""
        return {}

    @property
    def unidentified(self) -> int:
        """The number of shapes that belong to none of `bodies`."""
        return 0

    @property
    def skipped(self) -> Sequence[Skipped]:
        """The shapes that are left out and belong to none of `bodies`."""
        return ()

    def cautions(self, layout: Layout) -> Iterable[Warning]:
        """Warnings to give before measuring the pairs that the simulator lets collide."""
        return ()

    def within_margins(self, found: Contacts, layout: Layout, chosen: Callable[[NDArray[np.int32]], Mask]) -> int:
        """The number of `chosen` pairs of links that touch in the simulator but are not in `found`."""
        return 0

    def mechanics(self) -> Mechanics:
        """The interface that applies forces. ValueError if the simulator takes no forces."""
        raise ValueError("this simulator accepts no forces, so it has no volumetric contact")

    def close(self) -> None:
        """End the reading: no other method is called afterwards."""
        return
