"""Listeners to the calls of mujoco that end a step."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any
from weakref import WeakSet

import mujoco

from overlapper.simulation.engine import Happening, Listener

__stands_in__ = "mujoco"  # so that tracebacks of scripts end before the frames of this module

STEPS = ("mj_step", "mj_step2")
"""The functions that end a step."""

_originals: dict[str, Callable[..., Any]] = {}
_listeners: list[Listener] = []
_begun: WeakSet[mujoco.MjData] = WeakSet()
_steps_of_call = 1  # steps made by the call that is being reported to listeners


def steps_of_call() -> int:
    """The number of steps made by the call that is being reported to listeners."""
    return _steps_of_call


def unheard(name: str) -> Callable[..., Any]:
    """The function of mujoco with this name, whose calls no listener notices."""
    return _originals[name] if _listeners and name in _originals else getattr(mujoco, name)


def listen(listener: Listener) -> Callable[[], None]:
    """Notice calls of `mujoco.mj_step` and `mujoco.mj_step2`, but not of names imported from mujoco earlier.

    Listeners get the MjData of the simulation. A simulation begins with its first step that is noticed.
    """
    if not _listeners:
        for name in STEPS:
            _originals[name] = getattr(mujoco, name)
            setattr(mujoco, name, _heard(_originals[name]))
    _listeners.append(listener)

    def unlisten() -> None:
        if listener in _listeners:
            _listeners.remove(listener)
            if not _listeners:
                _begun.clear()
                for name, original in _originals.items():
                    setattr(mujoco, name, original)

    return unlisten


def begins(data: mujoco.MjData) -> None:
    """Report to all listeners that a step of a simulation begins, unless it is the first step that is noticed."""
    if data in _begun:
        _tell("step begins", data)


def stepped(data: mujoco.MjData) -> None:
    """Report a step to all listeners."""
    if _listeners and data not in _begun:
        _begun.add(data)
        _tell("began", data)
    _tell("stepped", data)


def _heard(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function, with each call reported to listeners."""

    @functools.wraps(function)
    def step(m: mujoco.MjModel, d: mujoco.MjData, *args: Any, **kwargs: Any) -> None:
        global _steps_of_call
        begins(d)
        function(m, d, *args, **kwargs)
        _steps_of_call = int(args[0] if args else kwargs.get("nstep", 1))
        try:
            stepped(d)
        finally:
            _steps_of_call = 1

    return step


def _tell(happening: Happening, data: mujoco.MjData) -> None:
    for listener in tuple(_listeners):
        listener(happening, data)
