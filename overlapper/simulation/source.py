"""The questions of `AnyBodies` to a simulator: which bodies, what is new, where they are, and who may collide."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from overlapper.simulation.collision_rules import Mask, Rules
from overlapper.simulation.contacts import Contact, Contacts
from overlapper.simulation.layout import Layout, Poses
from overlapper.simulation.mechanics import Mechanics
from overlapper.simulation.model import ModelledBody, Skipped


class Unreadable(RuntimeError):
    """A simulator cannot hand over its shapes; the text is one sentence."""


class Source(Protocol):
    """A simulator's answers. A class that inherits from `Source` has the plain answers, where there are any."""

    engine: str = ""
    """The name in ENGINES of the engine that simulates; empty if it is none of these."""

    contact: type[Contact] = Contact
    """The class of two shapes that overlap or touch."""

    bodies: dict[int, ModelledBody]
    """The bodies by number, sorted. `AnyBodies` replaces those of height fields as it models more of the ground."""

    @property
    def time_step(self) -> float:
        """s that a step takes."""

    def refresh(self) -> Sequence[Skipped] | None:
        """Read what is new. None if no body has come or gone, otherwise what is newly skipped.

        ValueError if the simulation has ended.
        """

    def poses(self, links: Mapping[int, Sequence[int]]) -> Poses:
        """The reader of the frames of these bodies' bases, and of their `links`."""

    def rules(self, layout: Layout) -> Rules:
        """The rules in force; the same object as long as they and the layout are the same."""

    @property
    def settings(self) -> Mapping[str, str | float]:
        """How the bodies were read, for the headings of tables."""
        return {}

    @property
    def unidentified(self) -> int:
        """How many shapes belong to none of `bodies`."""
        return 0

    @property
    def skipped(self) -> Sequence[Skipped]:
        """The shapes that are left out and belong to none of `bodies`."""
        return ()

    def cautions(self, layout: Layout) -> Iterable[Warning]:
        """Warnings before the pairs are measured that the simulator lets collide."""
        return ()

    def within_margins(self, found: Contacts, layout: Layout, chosen: Callable[[NDArray[np.int32]], Mask]) -> int:
        """How many pairs of links the simulator takes for touching, among those `chosen`, that are not in `found`."""
        return 0

    def mechanics(self) -> Mechanics:
        """The simulation as forces are applied to it. ValueError if the simulator takes no forces."""
        raise ValueError("this simulator takes no forces, so there is no volumetric contact in it")

    def close(self) -> None:
        """Nothing more will be asked."""
        return
