"""Engines: how each simulator runs scenes, and how its steps are noticed."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from contextlib import AbstractContextManager
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal, Protocol

if TYPE_CHECKING:
    from overlapper.simulation.bodies import AnyBodies

ENGINES = {"bullet": "overlapper.simulation.bullet.engine", "mujoco": "overlapper.simulation.mujoco.engine"}
"""The module of each engine by its name, as in ENGINE of a scene."""

LIBRARIES = {"bullet": "pybullet", "mujoco": "mujoco"}
"""The package of each engine. Headings of tables have its version."""

RETURNED = frozenset({"mujoco"})
"""The engines whose scenes return the simulation. `build` of the others gets an empty simulation to fill."""

FILES = {".xml": "mujoco"}
"""The engine that simulates a model file directly, by the ending of the file."""

Happening = Literal[
    "began", "step begins", "stepped", "ended", "real time begins", "real time ends", "has no real time"
]
Listener = Callable[[Happening, Hashable], None]
"""Called with an event of a simulation, and with the simulation."""


class Simulation(Protocol):
    """A running simulation."""

    @property
    def bodies(self) -> Callable[..., AnyBodies]:
        """The function that reads the bodies, with keywords `concave`, `concave_threshold`, `surface` and `names`."""

    @property
    def time_step(self) -> float:
        """The time step, s."""

    @property
    def running(self) -> bool:
        """Whether it has not ended."""

    def build(self, build: Callable[..., Any], parameters: Mapping[str, Any]) -> Any:
        """Call the `build` of a scene with the scene's parameters, and with the simulation if `build` fills one.

        Returns the function to be called before each step, if `build` has returned one.
        """

    def step(self) -> None:
        """Make a time step."""

    def held(self) -> AbstractContextManager[bool]:
        """Hold a simulation that runs in real time, during the block. It gives False if another thread is busy with it.

        Then nothing is held.
        """

    def leave(self) -> None:
        """Stop observing the simulation, which may go on."""

    def end(self) -> None:
        """End the simulation."""


class Engine(Protocol):
    """The functions of each module in ENGINES."""

    def begin(self) -> Simulation:
        """A new, empty simulation."""

    def running(self, which: Any, recorder: Any = None) -> Simulation:
        """A simulation that exists already, with its `recorder` if it has one. ValueError if it does not run."""

    def listen(self, listener: Listener) -> Callable[[], None]:
        """Report the events of all simulations to a listener, until the returned function is called."""


def engine_that_has(simulation: object) -> str:
    """The name of the engine of a simulation: "mujoco" for an MjData, "bullet" for the number of a client."""
    home = type(simulation).__module__.partition(".")[0]
    return next((name for name, library in LIBRARIES.items() if library == home), "bullet")


def engine(name: str) -> Engine:
    """The engine with this name. ValueError if there is none. ImportError says what to install."""
    if name not in ENGINES:
        raise ValueError(f"the engine must be one of {', '.join(map(repr, ENGINES))}, not {name!r}")
    module: Any = import_module(ENGINES[name])
    return module  # type: ignore[no-any-return]
