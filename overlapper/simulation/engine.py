"""Engines: how each simulator runs scenes, and how its steps are noticed."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal, Protocol

if TYPE_CHECKING:
    from overlapper.simulation.bodies import AnyBodies

ENGINES = {"bullet": "overlapper.simulation.bullet.engine", "mujoco": "overlapper.simulation.mujoco.engine"}
"""The module of each engine by the name that a scene's ENGINE has."""

LIBRARIES = {"bullet": "pybullet", "mujoco": "mujoco"}
"""The package whose version the headings of tables have, by the name of its engine."""

RETURNED = frozenset({"mujoco"})
"""The engines whose scenes return what is simulated. `build` of the others is called with what it fills."""

FILES = {".xml": "mujoco"}
"""The engine that simulates a file of that ending as it is."""

Happening = Literal["began", "stepped", "ended", "run by the clock"]
Listener = Callable[[Happening, Hashable], None]
"""Told what has happened to a simulation, and which it is."""


class Simulation(Protocol):
    """A simulation that runs."""

    @property
    def bodies(self) -> Callable[..., AnyBodies]:
        """Reads the bodies; takes the keywords `concave`, `concave_threshold`, `surface` and `names` of `Bodies`."""

    @property
    def time_step(self) -> float:
        """s that a step takes."""

    def build(self, build: Callable[..., Any], parameters: Mapping[str, Any]) -> Any:
        """Call the `build` of a scene with what it fills, if anything, and with the scene's parameters.

        Returns the function to be called before each step, if `build` has returned one.
        """

    def step(self) -> None:
        """Go on by a time step."""

    def leave(self) -> None:
        """Let the simulation go on alone."""

    def end(self) -> None:
        """End the simulation."""


class Engine(Protocol):
    """The functions that a module of ENGINES has."""

    def begin(self) -> Simulation:
        """A new, empty simulation."""

    def running(self, which: Any, recorder: Any = None) -> Simulation:
        """The simulation of somebody else, with the `recorder` that it has already. ValueError if it does not run."""

    def listen(self, listener: Listener) -> Callable[[], None]:
        """Tell a listener what happens to all simulations, until the function that is returned is called."""


def engine_that_has(simulation: object) -> str:
    """The name of the engine of a simulation: of MuJoCo for its MjData, of pybullet for the number of a client."""
    home = type(simulation).__module__.partition(".")[0]
    return next((name for name, library in LIBRARIES.items() if library == home), "bullet")


def engine(name: str) -> Engine:
    """The engine of that name. ValueError if there is none, ImportError with what to install for it."""
    if name not in ENGINES:
        raise ValueError(f"the engine must be one of {', '.join(map(repr, ENGINES))}, not {name!r}")
    module: Any = import_module(ENGINES[name])
    return module  # type: ignore[no-any-return]
