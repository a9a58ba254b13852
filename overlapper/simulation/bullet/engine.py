"""The engine of pybullet. Each scene runs in its own client, and steps are noticed by calls of stepSimulation."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any

import numpy as np

from overlapper.simulation import Bodies, Recorder
from overlapper.simulation.bullet import calls
from overlapper.simulation.bullet.stepping import time_step
from overlapper.simulation.engine import Happening, Listener
from overlapper.simulation.source import Unreadable

import pybullet  # isort: skip  # after the simulation, which says what to install

HAPPENINGS: dict[str, Happening] = {calls.BEGINS: "step begins", "stepSimulation": "stepped", "disconnect": "ended"}


class Client:
    """See `Simulation`."""

    def __init__(self, client: int, recorder: Recorder | None = None) -> None:
        if not isinstance(client, (int, np.integer)):
            raise TypeError(f"physicsClientId must be what pybullet.connect() returned, not {client!r}")
        if not pybullet.isConnected(client):
            raise ValueError(f"physicsClientId {client} is not connected to a physics server")
        self._client = client
        self._own = None if recorder else Recorder(client)
        # A partial is no frame of its own: warnings name the line that calls it.
        self.bodies = partial(Bodies, client, recorder=recorder or self._own)

    @property
    def time_step(self) -> float:
        return time_step(self._client)

    @property
    def running(self) -> bool:
        return bool(pybullet.isConnected(self._client))

    def build(self, build: Callable[..., Any], parameters: Mapping[str, Any]) -> Any:
        return build(self._client, **parameters)

    def step(self) -> None:
        try:
            pybullet.stepSimulation(self._client)
        except pybullet.error as error:
            raise Unreadable("its client is disconnected") from error

    @contextmanager
    def held(self) -> Iterator[bool]:
        if not calls.busy.acquire(timeout=0.01):
            yield False
            return
        try:
            _set_real_time(self._client, False)
            try:
                yield True
            finally:
                _set_real_time(self._client, True)
        finally:
            calls.busy.release()

    def leave(self) -> None:
        if self._own:
            self._own.close()

    def end(self) -> None:
        self.leave()
        with suppress(pybullet.error):  # the client is already disconnected
            pybullet.disconnect(self._client)


def _set_real_time(client: int, real_time: bool) -> None:
    calls.unheard("setRealTimeSimulation")(real_time, physicsClientId=client)


def begin() -> Client:
    return Client(pybullet.connect(pybullet.DIRECT))


def running(which: int, recorder: Recorder | None = None) -> Client:
    return Client(which, recorder)


def listen(listener: Listener) -> Callable[[], None]:
    def hear(name: str, arguments: calls.Arguments, result: Any) -> None:
        if name == "connect" and result >= 0:
            listener("began", result)
        elif name in HAPPENINGS:
            listener(HAPPENINGS[name], arguments.get("physicsClientId", 0))
        elif name == "setRealTimeSimulation":
            client = arguments.get("physicsClientId", 0)
            if not arguments["enableRealTimeSimulation"]:
                listener("real time ends", client)
                _set_real_time(client, False)  # a listener may have held it when the call came, and released it since
            elif pybullet.getConnectionInfo(client)["connectionMethod"] == pybullet.DIRECT:
                listener("has no real time", client)
            else:
                listener("real time begins", client)

    calls.listen(hear)
    return lambda: calls.unlisten(hear)
