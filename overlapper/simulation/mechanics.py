"""The questions of volumetric contact to a simulator: masses and joints, velocities, and steps with forces."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol

from overlapper._core import ContactSolver
from overlapper.simulation.layout import Pose
from overlapper.simulation.model import Array, LinkKey


class Dynamics(Protocol):
    """The links of some bodies as masses and joints."""

    @property
    def solver(self) -> ContactSolver:
        """Knows masses and joints."""

    @property
    def links(self) -> Sequence[LinkKey]:
        """(body, link) in the solver's order."""

    @property
    def place(self) -> Mapping[LinkKey, int]:
        """The place of each in `links`."""

    @property
    def friction(self) -> Array:
        """(n,) the coefficient of each."""

    def read(self) -> bool:
        """Read masses and friction again; True if masses have changed, so that there is a new solver."""

    @property
    def gravity(self) -> Array:
        """The acceleration of all coordinates that is known before anything has moved."""

    def frames(self) -> Sequence[Pose]:
        """The inertial frames of `links`, now."""

    def velocity(self) -> Array:
        """The velocities of all coordinates: of bases in m/s and rad/s, in the world, and of joints in rad/s or m/s."""

    def apply(self, wrenches: Array, frames: Sequence[Pose]) -> None:
        """Let forces and torques (n, 6) act on `links` in the next step, about the origins of their `frames`."""


class Mechanics(Protocol):
    """A simulation whose own response to some pairs is off, and that forces are applied to instead."""

    @property
    def restored(self) -> int:
        """How often the bodies were put back to a state that was saved."""

    def dynamics(self, bodies: Sequence[int]) -> Dynamics:
        """The masses and joints of these bodies."""

    def enter(self, pairs: Iterable[tuple[LinkKey, LinkKey]]) -> None:
        """Turn the simulator's own response to these pairs off. RuntimeError if the simulation is within another."""

    def turn_off(self, pairs: Iterable[tuple[LinkKey, LinkKey]]) -> None:
        """Turn it off for these pairs, too."""

    def leave(self) -> None:
        """Leave the simulator as it was before `enter`."""

    def begin(self, length: float, duration: float, first: bool) -> None:
        """Prepare a substep of `length` (s), the `first` or a later one, of a time step of that `duration` (s)."""

    def step(self) -> None:
        """Go on by the length begun, by the forces that `Dynamics.apply` was told."""

    def stepped(self, duration: float) -> None:
        """A time step of that `duration` (s) is over, or was given up."""

    def announce(self) -> None:
        """Let whoever watches know of a step."""
