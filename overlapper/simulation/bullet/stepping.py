"""Steps of a pybullet client in which other forces replace Bullet's response to contacts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from weakref import WeakValueDictionary

import pybullet

from overlapper.simulation.bullet.calls import BEGINS, listen, replace_steps, tell, unheard, unlisten
from overlapper.simulation.bullet.commands import THRESHOLD, Commands
from overlapper.simulation.bullet.dynamics import BulletDynamics
from overlapper.simulation.bullet.memory import Memory
from overlapper.simulation.bullet.recorder import Recorder
from overlapper.simulation.mechanics import OtherForces
from overlapper.simulation.model import LinkKey


def time_step(client: int) -> float:
    """s that a step of the client takes. ValueError if it is not connected."""
    try:
        return float(pybullet.getPhysicsEngineParameters(client)["fixedTimeStep"])
    except pybullet.error as error:
        raise ValueError(f"physicsClientId {client} is not connected to a physics server") from error


_INSIDE: WeakValueDictionary[int, Stepping] = WeakValueDictionary()
"""The `Stepping` that has entered, by client."""


class Stepping:
    """See `Mechanics`; the recorder is that of the bodies, if they have one."""

    def __init__(self, client: int, recorder: Recorder | None) -> None:
        self._client, self._recorder = client, recorder
        self._commands = recorder.commands if recorder else Commands(client)
        self._memory = Memory(self._commands.states)
        self._response = Response(client)
        self._length = 0.0  # of the simulator's steps, within a step

    def dynamics(self, bodies: Sequence[int]) -> BulletDynamics:
        self._dynamics = BulletDynamics(self._client, bodies, self._commands)
        return self._dynamics

    def resumed(self, others: OtherForces) -> OtherForces | None:
        return self._memory.follow(self._dynamics, others)

    def enter(
        self, pairs: Iterable[tuple[LinkKey, LinkKey]], answer: Callable[[], None], step: Callable[[], None]
    ) -> None:
        if self._client in _INSIDE:
            raise RuntimeError(
                f"physicsClientId {self._client} already has an active VolumetricContact: leave its `with` block first"
            )
        _INSIDE[self._client] = self
        self.turn_off(pairs)
        if not self._recorder:
            self._commands.learn()
            listen(self._commands.hear)
        replace_steps(self._client, step)

    def turn_off(self, pairs: Iterable[tuple[LinkKey, LinkKey]]) -> None:
        self._response.turn_off(pairs)

    def leave(self) -> None:
        _INSIDE.pop(self._client, None)
        replace_steps(self._client, None)
        if not self._recorder:
            unlisten(self._commands.hear)
        if pybullet.isConnected(self._client):
            self._response.turn_on(self._recorder)
            self._commands.prepare(time_step(self._client), first=True)
            self._set_threshold(THRESHOLD)

    def pose(self) -> None:
        return  # poses are always up to date

    prepare = pose

    def begin(self, length: float, duration: float, first: bool) -> None:
        self._set(length, duration if first else self._length)
        self._commands.prepare(length, first, share=length / duration)
        # Otherwise Bullet ends its iterations while constraints of unequal masses still move by some mm/s.
        if first and pybullet.getNumConstraints(self._client):
            self._set_threshold(0.0)

    def step(self) -> None:
        unheard("stepSimulation")(self._client)

    def stepped(self, duration: float) -> None:
        self._set(duration, self._length)
        self._commands.stepped()

    def _set(self, length: float, before: float) -> None:
        """Set the length (s) of the simulator's steps, which was `before`."""
        self._length = length
        if length != before:
            pybullet.setTimeStep(length, self._client)

    def _set_threshold(self, default: float) -> None:
        """Set Bullet's threshold for the end of its iterations, unless the script has set one."""
        heard = self._commands.threshold
        set_parameter = unheard("setPhysicsEngineParameter")
        set_parameter(solverResidualThreshold=default if heard is None else heard, physicsClientId=self._client)

    def announce_begin(self) -> None:
        tell(BEGINS, {"physicsClientId": self._client})

    def announce(self) -> None:
        tell("stepSimulation", {"physicsClientId": self._client})


class Response:
    """The pairs of links of a client to which Bullet's response is turned off.

    A pair filter removes the pair from Bullet's collision detection, so the pair costs nothing there and has no contact
    points. No recorder hears of the filter, so `Bodies` still looks at the pair.
    """

    def __init__(self, client: int) -> None:
        self._client = client
        self._off: set[tuple[LinkKey, LinkKey]] = set()

    def turn_off(self, pairs: Iterable[tuple[LinkKey, LinkKey]]) -> None:
        """Turn the response to these pairs off, too."""
        for pair in pairs:
            self._set(pair, 0)
            self._off.add(pair)

    def turn_on(self, recorder: Recorder | None) -> None:
        """Turn the response on again, except for pairs that a script has filtered, as far as a recorder has heard."""
        filters = recorder.pair_filters if recorder else {}
        for pair in sorted(self._off):
            if filters.get(pair, True):
                self._set(pair, 1)
        self._off.clear()

    def _set(self, pair: tuple[LinkKey, LinkKey], enabled: int) -> None:
        (a, link_a), (b, link_b) = pair
        unheard("setCollisionFilterPair")(a, b, link_a, link_b, enabled, self._client)
