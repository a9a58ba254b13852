"""Runs of scenes: a scene is built in a new simulation and stepped, frame by frame."""

from __future__ import annotations

from collections.abc import Container, Generator, Sequence
from contextlib import ExitStack
from dataclasses import replace

from overlapper.printable import first_line
from overlapper.scenes.scene import ContactModel, Scene, SceneError, Step, broken
from overlapper.simulation.bodies import AnyBodies
from overlapper.simulation.engine import Simulation, engine
from overlapper.simulation.forces.contact import VolumetricContact
from overlapper.simulation.naming import named
from overlapper.simulation.settings import Asking, Modelling, settings_of
from overlapper.simulation.source import Unreadable
from overlapper.tables.frame import Frame
from overlapper.tables.still import Still


def run(
    scene: Scene,
    steps: int | None = None,
    asking: Asking = Asking(),  # noqa: B008
    modelling: Modelling = Modelling(),  # noqa: B008
    contact: ContactModel | None = None,
    only: Container[int] | None = None,
    between: bool = False,
) -> Generator[Frame[AnyBodies], None, None]:
    """Build the scene in a new simulation and step it, `scene.steps` times by default.

    Every step is a frame, and the first frame has number 1. With `only`, only the steps in it are frames. With
    `between`, which takes no `only`, frames have the first overlaps since the step before. `contact`
    chooses the contact forces: the name of the scene's engine, or "volumetric" for a `VolumetricContact` of the pairs
    that the simulator lets collide. By default the scene chooses `contact`, and also the pairs that are measured.
    SceneError if the scene fails or cannot be measured, ValueError if `contact` is invalid.
    """
    model = scene.contact if contact is None else contact
    if model not in (scene.engine, "volumetric"):
        raise ValueError(f"contact must be {scene.engine!r} or 'volumetric', not {model!r}")
    simulation = engine(scene.engine).begin()
    asked = settings_of(asking if asking.pairs is not None else replace(asking, pairs=scene.pairs))
    stack = ExitStack()
    try:
        step = _built(scene, simulation)
        bodies = simulation.bodies(**settings_of(modelling), names=scene.names)
        seconds = simulation.time_step
        volumetric = stack.enter_context(_volumetric(scene, bodies)) if model == "volumetric" else None
        for i in range(steps or scene.steps):
            _controlled(scene, step, i)
            if between:
                bodies.step_begins()
            if volumetric is not None:
                volumetric.step()
            else:
                simulation.step()
            if only is None or i + 1 in only:
                bodies.update()
                contacts = bodies.overlaps(**asked)
                forces = None if volumetric is None else volumetric.mean()
                first = bodies.first_overlaps(asked["pairs"]) if between else None
                yield Frame(i + 1, (i + 1) * seconds, bodies, contacts, forces, first)
    except Unreadable as error:
        raise SceneError(f"the scene {scene.path} cannot be read: {error}") from error
    except ValueError as error:
        raise SceneError(f"the scene {scene.path} cannot be measured: {first_line(error)}") from error
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
        raise SceneError(f"{scene.path} has invalid NAMES: {error}") from error
    if step is not None and not callable(step):
        raise SceneError(f"build(client) of {scene.path} must return None or a function step(i), not {step!r}")
    return step


def _volumetric(scene: Scene, bodies: AnyBodies) -> VolumetricContact:
    try:
        return VolumetricContact(bodies, **scene.volumetric)
    except ValueError as error:
        raise SceneError(f"{scene.path} has an invalid CONTACT: {error}") from error


def _controlled(scene: Scene, step: Step | None, i: int) -> None:
    if step is None:
        return
    try:
        step(i)
    except Exception as error:
        raise broken(scene.path, f"fails before step {i + 1}", error) from error


def stills(scene: Scene, steps: Sequence[int]) -> dict[int, Still]:
    """Some steps of the present scene, with the shapes as they are read back from a file."""
    last = min(max(steps), scene.steps)
    return {frame.step: Still.of(frame.bodies, frame.forces).as_written() for frame in run(scene, last, only=steps)}
