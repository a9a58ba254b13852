"""The interface of a simulator for volumetric contact: masses and joints, velocities, and steps with forces."""

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
        """The solver, which knows masses and joints."""

    @property
    def links(self) -> Sequence[LinkKey]:
        """(body, link) in the solver's order."""

    @property
    def place(self) -> Mapping[LinkKey, int]:
        """The index of each link in `links`."""

    @property
    def friction(self) -> Array:
        """(n,) the coefficient of friction of each link."""

    def read(self) -> bool:
        """Read masses and friction again. True if masses have changed, so that there is a new solver."""

    @property
    def gravity(self) -> Array:
        """The acceleration of all coordinates that is known before any motion."""

    def frames(self) -> Sequence[Pose]:
        """The inertial frames of `links`, now."""

    def velocity(self) -> Array:
        """The velocities of all coordinates: of bases in m/s and rad/s, in the world, and of joints in rad/s or m/s."""

    def apply(self, wrenches: Array, frames: Sequence[Pose]) -> None:
        """Apply forces and torques (n, 6), about the origins of `frames`, to `links` in the next step."""


class Mechanics(Protocol):
    """A simulation in which forces replace the simulator's own response to some pairs."""

    @property
    def restored(self) -> int:
        """How often a saved state of the bodies was restored."""

    def dynamics(self, bodies: Sequence[int]) -> Dynamics:
        """The masses and joints of these bodies."""

    def enter(self, pairs: Iterable[tuple[LinkKey, LinkKey]]) -> None:
        """Turn the simulator's own response to these pairs off. RuntimeError if the simulation is within another."""

    def turn_off(self, pairs: Iterable[tuple[LinkKey, LinkKey]]) -> None:
        """Turn the response off for these pairs, too."""

    def leave(self) -> None:
        """Restore the simulator to its settings before `enter`."""

    def begin(self, length: float, duration: float, first: bool) -> None:
        """Prepare a substep of `length` (s), the `first` or a later one, of a time step of `duration` (s)."""

    def step(self) -> None:
        """Make the prepared substep, with the forces of `Dynamics.apply`."""

    def stepped(self, duration: float) -> None:
        """End a time step of `duration` (s), complete or given up."""

    def announce(self) -> None:
        """Report a step to all listeners."""
