"""The interface of a simulator for volumetric contact: masses and joints, velocities, and steps with forces."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from overlapper._core import ContactSolver
from overlapper.simulation.layout import Pose
from overlapper.simulation.model import Array, LinkKey


class Links(NamedTuple):
    """The arguments of `ContactSolver`, a row for each link."""

    parents: Sequence[int]
    joints: Sequence[int]
    axes: Array
    pivots: Array
    masses: Array
    inertias: Array


class OtherForces(Protocol):
    """The accelerations of all coordinates by everything except contacts and known motors, such as gravity."""

    def ahead(self, velocity: Array, duration: float) -> Array:
        """Return the velocity after a duration (s), if it keeps changing as it does now."""

    def learnt(self, velocity: Array) -> Array:
        """Return the acceleration by other forces, now that the coordinates have this velocity."""

    def solved(self, velocity: Array, duration: float, ours: Array) -> None:
        """Record that from this velocity on, contacts and known motors accelerate by `ours` for a duration (s)."""

    def left_at(self, velocity: Array) -> None:
        """Record that a step has ended with this velocity."""


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
    def version(self) -> int:
        """A number that changes with friction, resistance and weights, at the earliest in `read`."""

    def tree(self) -> Links | None:
        """The masses and joints of `links`. None if the simulator alone knows them."""

    def friction(self, pairs: NDArray[np.int64]) -> Array:
        """(p,) the simulator's coefficients of friction of `pairs` (p, 2), which are pairs of indices in `links`."""

    def resistance(self, pairs: NDArray[np.int64]) -> dict[str, Array]:
        """(p,) the simulator's `restitution`, and `rolling` and `spinning` friction in m, of such `pairs` (p, 2)."""

    def weights(self) -> Array:
        """(n,) for each of `links`: the weight in N of its whole body with all joints, 0 if forces do not move it."""

    def read(self) -> bool:
        """Read masses and friction again. True if masses have changed, so that there is a new solver."""

    def other_forces(self) -> OtherForces:
        """The forces that do not come from contacts, of which nothing is known yet but gravity."""

    def frames(self) -> Sequence[Pose]:
        """The inertial frames of `links`, now. A simulator that knows its masses gives them to the solver."""

    def velocity(self) -> Array:
        """The velocities of all coordinates, in the order of the solver."""

    def ahead(self, duration: float, velocity: Array) -> Sequence[Pose] | None:
        """For each link: its centre of mass after a duration (s) at this velocity, and its rotation until then.

        None if the solver finds them itself.
        """

    def motors(self, length: float, share: float) -> Array | None:
        """(m, 4) the motors whose forces depend on the contacts, as `ContactSolver.solve` takes them. None: no motors.

        They are those of a step of `length` (s), at the coordinates of the last `velocity`. The length is a `share` of
        the simulation's time step.
        """

    def constraints(self, length: float) -> Array | None:
        """The constraints beside contacts, as `ContactSolver.solve` takes them. None: no constraints.

        They are those of a step of `length` (s).
        """

    def apply(self, wrenches: Array, frames: Sequence[Pose]) -> None:
        """Apply forces and torques (n, 6), about the origins of `frames`, to `links` in the next step."""


class Mechanics(Protocol):
    """A simulation in which forces replace the simulator's own response to some pairs."""

    def dynamics(self, bodies: Sequence[int]) -> Dynamics:
        """The masses and joints of these bodies."""

    def resumed(self, others: OtherForces) -> OtherForces | None:
        """Return `others`, or those of the saved state that the script has restored since the last call.

        The solver of the last `dynamics` then has the forces of that state, too. None if the state is not known.
        """

    def enter(
        self, pairs: Iterable[tuple[LinkKey, LinkKey]], answer: Callable[[], None], step: Callable[[], None]
    ) -> None:
        """Turn the simulator's own response to these pairs off. RuntimeError if the simulation is within another.

        If the script lets the simulator step, a simulator that can ask for forces within its step calls `answer`, which
        calls `Dynamics.apply`. For another simulator, `step` makes the whole step instead.
        """

    def turn_off(self, pairs: Iterable[tuple[LinkKey, LinkKey]]) -> None:
        """Turn the response off for these pairs, too."""

    def leave(self) -> None:
        """Restore the simulator to its settings before `enter`."""

    def pose(self) -> None:
        """Bring the poses up to date with the state of the simulation."""

    def prepare(self) -> None:
        """Bring up to date whatever a substep begins with: poses, masses and other forces."""

    def begin(self, length: float, duration: float, first: bool) -> None:
        """Prepare a substep of `length` (s), the `first` or a later one, of a time step of `duration` (s)."""

    def step(self) -> None:
        """Make the prepared substep, with the forces of `Dynamics.apply`."""

    def stepped(self, duration: float) -> None:
        """End a time step of `duration` (s), complete or given up."""

    def announce_begin(self) -> None:
        """Report to all listeners that a step begins."""

    def announce(self) -> None:
        """Report a step to all listeners."""
