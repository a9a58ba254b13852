"""An engine without a simulator: bodies that only move by script.

world = World()
ball = world.add("ball", Sphere(0.1), (0, 0, 1))
world.move(ball, (0, 0, 0.5))
world.step()
"""

from functools import lru_cache, partial
from types import SimpleNamespace

import numpy as np

from overlapper.simulation.bodies import AnyBodies
from overlapper.simulation.collision_rules import Colliders, MaskRules
from overlapper.simulation.model import BASE, ModelledBody, ModelledShape
from overlapper.simulation.source import Source

UNTURNED = (0.0, 0.0, 0.0, 1.0)
_listeners = []


class World(Source):
    """Bodies of one shape each, by number, which all may collide."""

    engine, time_step = "scripted", 0.01

    def __init__(self):
        self.bodies, self.frames, self._count = {}, {}, None

    def add(self, name, shape, position):
        number = len(self.bodies)
        modelled = ModelledShape(BASE, 0, shape, np.zeros(3), np.array(UNTURNED))
        self.bodies[number] = ModelledBody(name, {BASE: "base"}, {BASE: (0.6, 0.6, 0.6, 1.0)}, {}, 1, (modelled,))
        self.move(number, position)
        return number

    def move(self, number, position):
        self.frames[number] = tuple(position), UNTURNED

    def step(self):
        for listener in tuple(_listeners):
            listener("stepped", self)

    def refresh(self):
        before, self._count = self._count, len(self.bodies)
        return None if before == self._count else []

    def poses(self, links):
        colliders = [(number, BASE) for number in links]
        return SimpleNamespace(colliders=colliders, read=lambda: [self.frames[number] for number in links])

    @lru_cache(maxsize=1)  # noqa: B019  # a world lives as long as a test
    def rules(self, layout):
        return MaskRules(Colliders.of(layout.collider_rows, {}))


class Scripted:
    """A world as `Simulation` has it."""

    def __init__(self, world):
        self.world, self.step, self.time_step = world, world.step, world.time_step
        self.bodies = partial(_bodies, world)

    def build(self, build, parameters):
        return build(self.world, **parameters)

    def leave(self):
        pass

    end = leave


def _bodies(world, **_):
    return AnyBodies(world)


def begin():
    return Scripted(World())


def running(which, recorder=None):
    return Scripted(which)


def listen(listener):
    _listeners.append(listener)
    return lambda: _listeners.remove(listener)
