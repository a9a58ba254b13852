"""What contact forces depend on besides poses and velocities, by the saved states of a client."""

from __future__ import annotations

from copy import copy
from typing import NamedTuple

from overlapper.simulation.bullet.commands import StateCall
from overlapper.simulation.bullet.dynamics import BulletDynamics, Known
from overlapper.simulation.mechanics import OtherForces


class _Kept(NamedTuple):
    dynamics: BulletDynamics
    known: Known
    others: OtherForces


class Memory:
    """The last forces of the solver and the other forces at each saved state.

    `calls` are the calls of the script about states. New ones are appended.
    """

    def __init__(self, calls: list[StateCall]) -> None:
        self._calls, self._read = calls, len(calls)
        self._kept: dict[int | None, _Kept] = {}

    def follow(self, dynamics: BulletDynamics, others: OtherForces) -> OtherForces | None:
        """Do what new calls did to states, beginning with these dynamics and other forces.

        Returns the other forces now. They are None if the restored state was not saved with the same masses.
        """
        now: OtherForces | None = others
        for event, state in self._calls[self._read :]:
            if event == "saved":
                self._kept.pop(state, None)
                if now is not None:
                    self._kept[state] = _Kept(dynamics, dynamics.known(), copy(now))
            elif event == "removed":
                self._kept.pop(state, None)
            else:
                kept = self._kept.get(state)
                same = kept is not None and kept.dynamics is dynamics and dynamics.resume(kept.known)
                now = copy(kept.others) if kept and same else None
        self._read = len(self._calls)
        return now
