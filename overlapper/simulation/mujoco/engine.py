"""The engine of MuJoCo: scenes return a model and its data, and steps are noticed by calls of mj_step."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from pathlib import Path
from typing import Any

import mujoco

from overlapper.simulation.mujoco.bodies import Bodies
from overlapper.simulation.mujoco.calls import listen, steps_of_call

__all__ = ["Simulated", "begin", "build_of", "listen", "running"]


class Simulated:
    """See `Simulation`: a model and its data, returned by a scene or stepped by other code."""

    def __init__(self, data: mujoco.MjData | None = None) -> None:
        self._data = data

    @property
    def bodies(self) -> Callable[..., Bodies]:
        # A partial is no frame of its own: warnings name the line that calls it.
        return partial(Bodies, self._known.model, self._known)

    @property
    def time_step(self) -> float:
        return float(self._known.model.opt.timestep) * steps_of_call()

    @property
    def running(self) -> bool:
        return True

    def build(self, build: Callable[..., Any], parameters: Mapping[str, Any]) -> Any:
        model, data, *step = _parts(build(**parameters))
        mujoco.mj_forward(model, data)
        self._data = data
        return step[0] if step else None

    def step(self) -> None:
        mujoco.mj_step(self._known.model, self._known)

    def held(self) -> AbstractContextManager[bool]:
        return nullcontext(True)  # only calls make steps

    def leave(self) -> None:
        return

    end = leave

    @property
    def _known(self) -> mujoco.MjData:
        if self._data is None:
            raise ValueError("there is no simulation before a scene is built")
        return self._data


def _parts(built: Any) -> tuple[Any, ...]:
    """The model, the data and perhaps a function that `build` has returned."""
    parts = built if isinstance(built, tuple) else (built,)
    if len(parts) == 1 and isinstance(parts[0], mujoco.MjModel):
        parts = parts[0], mujoco.MjData(parts[0])
    kinds = mujoco.MjModel, mujoco.MjData
    if len(parts) not in (2, 3) or not all(map(isinstance, parts, kinds)):
        raise ValueError(f"build() must return (model, data) or (model, data, step), not {built!r}")
    return parts


def begin() -> Simulated:
    return Simulated()


def running(which: mujoco.MjData, recorder: Any = None) -> Simulated:
    if not isinstance(which, mujoco.MjData):
        raise ValueError(f"a simulation of MuJoCo is a mujoco.MjData, not {which!r}")
    return Simulated(which)


def build_of(path: Path) -> tuple[Callable[[], Any], float]:
    """A `build` that compiles an MJCF file, and the model's time step. ValueError if the file does not compile."""
    model = mujoco.MjModel.from_xml_path(str(path))
    return lambda: mujoco.MjModel.from_xml_path(str(path)), float(model.opt.timestep)
