"""A scene run: built in a simulation of its own and stepped, frame by frame."""

from __future__ import annotations

from collections.abc import Container, Generator, Sequence
from contextlib import ExitStack
from typing import Literal, get_args

from overlapper.scenes.scene import ContactModel, Scene, SceneError, Step, broken
from overlapper.simulation.asked_pairs import Among
from overlapper.simulation.bodies import AnyBodies
from overlapper.simulation.engine import Simulation, engine
from overlapper.simulation.forces.contact import VolumetricContact
from overlapper.simulation.model import Concave, Surface
from overlapper.simulation.naming import named
from overlapper.simulation.source import Unreadable
from overlapper.tables.frame import Frame
from overlapper.tables.still import Still


def run(
    scene: Scene,
    steps: int | None = None,
    tolerance: float = 1e-3,
    method: Literal["auto", "paper"] = "auto",
    only: Container[int] | None = None,
    concave: Concave = "decompose",
    concave_threshold: float = 0.05,
    surface: Surface = "nominal",
    pairs: Among | None = None,
    contact: ContactModel | None = None,
) -> Generator[Frame[AnyBodies], None, None]:
    """Build the scene in a simulation of its own and step it, `scene.steps` times by default.

    Every step is a frame, the first has number 1; or only those in `only`, if given. `tolerance` and `method` are those
    of `overlapper.overlap`, `concave`, `concave_threshold` and `surface` of `Bodies`, `pairs` of `Bodies.overlaps`, by
    default as the scene says; a recorder hears all that it tells pybullet. `contact` is what pushes bodies apart, by
    default as the scene says: "bullet", contact points, or "volumetric", a `VolumetricContact` of what the simulator
    lets collide. SceneError if the scene itself fails, ValueError for an invalid argument.
    """
    model = scene.contact if contact is None else contact
    if model not in get_args(ContactModel):
        raise ValueError(f"contact must be 'bullet' or 'volumetric', not {model!r}")
    simulation = engine(scene.engine).begin()
    among = scene.pairs if pairs is None else pairs
    stack = ExitStack()
    try:
        step = _built(scene, simulation)
        bodies = simulation.bodies(
            concave=concave,
            concave_threshold=concave_threshold,
            surface=surface,
            names=scene.names,
        )
        seconds = simulation.time_step
        volumetric = stack.enter_context(_volumetric(scene, bodies)) if model == "volumetric" else None
        for i in range(steps or scene.steps):
            _controlled(scene, step, i)
            if volumetric is not None:
                volumetric.step()
            else:
                simulation.step()
            if only is None or i + 1 in only:
                bodies.update()
                contacts = bodies.overlaps(tolerance, method, pairs=among)
                forces = None if volumetric is None else volumetric.mean()
                yield Frame(i + 1, (i + 1) * seconds, bodies, contacts, forces)
    except Unreadable as error:
        raise SceneError(f"the scene {scene.path} cannot be read: {error}") from error
    finally:
        stack.close()
        simulation.end()


def _built(scene: Scene, simulation: Simulation) -> Step | None:
    scene.names.clear()
    try:
        step: Step | None = simulation.build(scene.build, scene.parameters)
    except Exception as error:
        raise broken(scene.path, "cannot be built", error) from error
    try:
        named(scene.names)
    except ValueError as error:
        raise SceneError(f"{scene.path} has NAMES that are none: {error}") from error
    if step is not None and not callable(step):
        raise SceneError(f"build(client) of {scene.path} must return None or a function step(i), not {step!r}")
    return step


def _volumetric(scene: Scene, bodies: AnyBodies) -> VolumetricContact:
    try:
        return VolumetricContact(bodies, **scene.volumetric)
    except ValueError as error:
        raise SceneError(f"{scene.path} has a CONTACT that is none: {error}") from error


def _controlled(scene: Scene, step: Step | None, i: int) -> None:
    if step is None:
        return
    try:
        step(i)
    except Exception as error:
        raise broken(scene.path, f"fails before step {i + 1}", error) from error


def stills(scene: Scene, steps: Sequence[int]) -> dict[int, Still]:
    """Today's scene in some of its steps, with its shapes as they will be read from a file."""
    last = min(max(steps), scene.steps)
    return {frame.step: Still.of(frame.bodies, frame.forces).as_written() for frame in run(scene, last, only=steps)}
