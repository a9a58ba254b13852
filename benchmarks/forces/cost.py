"""Where the time of volumetric contact goes: by parts of a substep, and of piles and robots beside Bullet's own step.

    python benchmarks forces          all scenes, a minute or two, then the page
    python benchmarks forces --page   only the page, from the results there are

The scenes with ten contacts take turns, and so do a pile or a robot and its twin, which Bullet steps; times are those
of the processor, medians over steps. Writes forces_cost.csv, a line per scene and part, to benchmarks/results/MACHINE,
and the page docs/forces.md.
"""

from __future__ import annotations

import math
import random
from argparse import Namespace
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import pybullet as p

from forces import common_scenes
from harness import results
from harness.timing import Stopwatch, on_one_processor, timed
from overlapper import _core
from overlapper.simulation import Bodies, VolumetricContact
from overlapper.simulation.bullet.dynamics import BulletDynamics

RESULTS = results.of_machine("forces_cost.csv")
PAGE = "forces.page"
G = 9.81
RATE = 240  # Hz
COLUMNS = ("scene", "part", "us")
PILE = "pile of 200 boxes"
SMALL_PILE = "pile of 60 boxes"
# Common scenes of robots, stepped for all of their time.
ROBOTS = ("panda_cube", "laikago_stand", "a1_stand", "mini_cheetah_stand", "minitaur_stand")
STEPS = 120

# The calls of a substep, and the part that the time of each counts for. A call within a call counts for its own part.
CALLS: dict[tuple[Any, str], str] = {
    (Bodies, "update"): "poses",
    (Bodies, "follow"): "poses",
    (BulletDynamics, "frames"): "poses",
    (VolumetricContact, "_coming"): "coming pairs",
    (Bodies, "overlaps"): "overlaps",
    (_core.ContactSolver, "place"): "patches",
    (BulletDynamics, "velocity"): "velocities",
    (_core.ContactSolver, "solve"): "solve",
    (BulletDynamics, "apply"): "apply",
    (p, "stepSimulation"): "stepSimulation",
}
PARTS = tuple(dict.fromkeys(CALLS.values()))


@contextmanager
def parts_timed() -> Iterator[Stopwatch]:
    """The time of each part, while all that is called in a substep goes through the watch."""
    watch, originals = Stopwatch(), {(owner, name): getattr(owner, name) for owner, name in CALLS}

    def through_watch(call: Callable[..., Any], part: str) -> Callable[..., Any]:
        return lambda *args, **kwargs: watch(part, call, *args, **kwargs)

    try:
        for (owner, name), call in originals.items():
            setattr(owner, name, through_watch(call, CALLS[owner, name]))
        yield watch
    finally:
        for (owner, name), call in originals.items():
            setattr(owner, name, call)


def ground(client: int) -> None:
    p.setGravity(0, 0, -G, physicsClientId=client)
    plane = p.createCollisionShape(p.GEOM_PLANE, physicsClientId=client)
    p.createMultiBody(0, plane, physicsClientId=client)


def ten(kind: int, place: Callable[[int], list[float]], **figures: Any) -> Callable[[int], None]:
    def build(client: int) -> None:
        ground(client)
        shape = p.createCollisionShape(kind, physicsClientId=client, **figures)
        for k in range(10):
            p.createMultiBody(1, shape, -1, place(k), physicsClientId=client)

    return build


def pile(client: int, boxes: int = 200) -> None:
    """Boxes at random in a well, on a heap that Bullet has let come to rest."""
    ground(client)
    chance = random.Random(0)
    box = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05] * 3, physicsClientId=client)
    wall = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.02, 0.5, 0.5], physicsClientId=client)
    for k in range(4):
        at = [0.42 * math.cos(k * math.pi / 2), 0.42 * math.sin(k * math.pi / 2), 0.5]
        turned = p.getQuaternionFromEuler([0, 0, k * math.pi / 2])
        p.createMultiBody(0, wall, -1, at, turned, physicsClientId=client)
    for k in range(boxes):
        at = [chance.uniform(-0.3, 0.3), chance.uniform(-0.3, 0.3), 0.1 + 0.02 * k]
        turned = p.getQuaternionFromEuler([chance.uniform(-3, 3) for _ in range(3)])
        p.createMultiBody(1, box, -1, at, turned, physicsClientId=client)
    for _ in range(480):
        p.stepSimulation(client)


BOX = {"halfExtents": [0.05] * 3}
SCENES: dict[str, Callable[[int], None]] = {
    "ten cubes on a plane": ten(p.GEOM_BOX, lambda k: [0.3 * k, 0, 0.0499], **BOX),
    "a tower of ten cubes": ten(p.GEOM_BOX, lambda k: [0.001 * (k % 2), 0, 0.0499 + 0.0999 * k], **BOX),
    "ten cylinders on a plane": ten(p.GEOM_CYLINDER, lambda k: [0.3 * k, 0, 0.0499], radius=0.05, height=0.1),
    "ten balls on a plane": ten(p.GEOM_SPHERE, lambda k: [0.3 * k, 0, 0.049], radius=0.05),
}


class Scene:
    """A scene that is stepped with volumetric contact, and how long each part of a substep took."""

    def __init__(self, build: Callable[[int], None], stack: ExitStack, **given: float) -> None:
        self.client = p.connect(p.DIRECT)
        stack.callback(p.disconnect, self.client)
        build(self.client)
        self.contact = stack.enter_context(VolumetricContact(Bodies(self.client), **given))
        self.taken: dict[str, list[float]] = {}

    def step(self, watch: Stopwatch) -> None:
        watch.take()
        watch("rest", self.contact.step)
        us, substeps = watch.take(), self.contact.substeps
        step = sum(us.values())
        figures = {part: us.get(part, 0.0) / substeps for part in (*PARTS, "rest")}
        figures |= {"substep": step / substeps, "step": step}
        figures |= {"substeps": substeps, "contacts": len(self.contact), "sweeps": self.contact.sweeps}
        for part, value in figures.items():
            self.taken.setdefault(part, []).append(value)

    def rows(self, name: str) -> Iterator[tuple[str, str, float]]:
        for part, values in self.taken.items():
            yield name, part, median(values)


def measured() -> Iterator[tuple[str, str, float]]:
    with parts_timed() as watch, ExitStack() as stack:
        scenes = {name: Scene(build, stack, dissipation=1e-3) for name, build in SCENES.items()}
        for step in range(STEPS + 20):
            for scene in scenes.values():
                scene.step(watch)
                if step < 20:
                    scene.taken.clear()
        for name, scene in scenes.items():
            yield from scene.rows(name)
    for name, build in ((PILE, pile), (SMALL_PILE, partial(pile, boxes=60))):
        with parts_timed() as watch, ExitStack() as stack:
            twin = p.connect(p.DIRECT)
            stack.callback(p.disconnect, twin)
            build(twin)
            ours, bullet = Scene(build, stack), []
            for step in range(STEPS + 60):
                ours.step(watch)
                bullet.append(1e6 * timed(partial(p.stepSimulation, twin)))
                if step < 60:
                    ours.taken.clear()
                    bullet.clear()
            yield from ours.rows(name)
            yield name, "bullet", median(bullet)
            # Only at the end: depths that are asked for in each step are part of the step.
            yield name, "deepest", float(ours.contact.contacts.overlaps.depth.max(initial=0))
    for name in ROBOTS:
        yield from of_robot(name)


def of_robot(name: str) -> Iterator[tuple[str, str, float]]:
    """A common scene of a robot and its twin, without the time of the scene's own commands."""
    scene = common_scenes.SCENES[name]
    with ExitStack() as stack:
        worlds = [common_scenes.new_world() for _ in range(2)]  # they disconnect when they are deleted
        scripts = [scene.build(world) for world in worlds]
        contact = stack.enter_context(VolumetricContact(Bodies(worlds[0]._client)))
        taken: dict[str, list[float]] = {"step": [], "bullet": [], "substeps": []}
        for index in range(round(scene.seconds * RATE)):
            for script in scripts:
                if script.command:
                    script.command(index / RATE)
            taken["step"].append(1e6 * timed(contact.step))
            taken["bullet"].append(1e6 * timed(worlds[1].stepSimulation))
            taken["substeps"].append(contact.substeps)
    for part, values in taken.items():
        yield name.replace("_", " "), part, median(values)


def measure(_: Namespace, path: Path) -> None:
    on_one_processor()
    rows = [(scene, part, f"{us:.4g}") for scene, part, us in measured()]
    with results.writing(path, COLUMNS, results.today()) as write:
        write(rows)
