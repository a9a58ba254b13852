"""Experiments with contact, by volumetric contact and by Bullet's own. Textbooks predict their outcome.

Tests compare what comes out with the formula; `python benchmarks physics` does the same for docs/forces.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pybullet as p

from overlapper.simulation import Bodies, VolumetricContact

G = 9.81
STEP = 1 / 240
HALF = 0.05  # m, of cubes, which weigh 1 kg
FRICTION = 0.5
SQUARE = (math.sqrt(2) + math.log(1 + math.sqrt(2))) / 6  # mean distance from the centre of a square of side 1
DISC = 2 / 3  # the same of a disc of radius 1

POSES = {
    "face": (0, 0, 0, 1),
    "edge": p.getQuaternionFromEuler([math.pi / 4, 0, 0]),
    "corner": p.getQuaternionFromAxisAngle([1 / math.sqrt(2), -1 / math.sqrt(2), 0], math.acos(1 / math.sqrt(3))),
    "skew": p.getQuaternionFromEuler([0.3, 0.2, 0]),
}


class World:
    """A client of its own, where nothing is damped, with a plane at z = 0. `friction` is that of all pairs with it."""

    def __init__(self, gravity=(0.0, 0.0, -G), step=STEP) -> None:
        self.client = p.connect(p.DIRECT)
        self.step = step
        p.setTimeStep(step, self.client)
        self.pull(*gravity)
        self.plane = self.body(0, p.GEOM_PLANE, friction=1)

    def __enter__(self) -> World:
        return self

    def __exit__(self, *_: object) -> None:
        p.disconnect(self.client)

    def pull(self, x: float, y: float, z: float) -> None:
        p.setGravity(x, y, z, physicsClientId=self.client)

    def body(self, mass, kind, position=(0, 0, 0), orientation=(0, 0, 0, 1), friction=FRICTION, **figures) -> int:
        shape = p.createCollisionShape(kind, physicsClientId=self.client, **figures)
        id = p.createMultiBody(mass, shape, -1, position, orientation, physicsClientId=self.client)
        self.undamped(id, friction)
        return id

    def box(self, *half: float, mass=1.0, **where: Any) -> int:
        return self.body(mass, p.GEOM_BOX, halfExtents=half, **where)

    def turntable(self, half, position, mass: float) -> int:
        """A box that turns about the vertical axis alone: link 0, after a base without a shape."""
        return p.createMultiBody(
            0,
            basePosition=position,
            linkMasses=[mass],
            linkCollisionShapeIndices=[
                p.createCollisionShape(p.GEOM_BOX, halfExtents=half, physicsClientId=self.client)
            ],
            linkVisualShapeIndices=[-1],
            linkPositions=[[0, 0, 0]],
            linkOrientations=[[0, 0, 0, 1]],
            linkInertialFramePositions=[[0, 0, 0]],
            linkInertialFrameOrientations=[[0, 0, 0, 1]],
            linkParentIndices=[0],
            linkJointTypes=[p.JOINT_REVOLUTE],
            linkJointAxis=[[0, 0, 1]],
            physicsClientId=self.client,
        )

    def undamped(self, id: int, friction: float, **more: float) -> None:
        for link in range(-1, p.getNumJoints(id, self.client)):
            p.changeDynamics(
                id,
                link,
                lateralFriction=friction,
                linearDamping=0,
                angularDamping=0,
                jointDamping=0,
                physicsClientId=self.client,
                **more,
            )

    def contact(self, law="volumetric", substeps: Any = "auto", **parameters: Any) -> Any:
        """Bullet's takes so many substeps, too, of "auto" one. Dissipation is 1 ms if it is not given."""
        if law == "bullet":
            return BulletContact(self, 1 if substeps == "auto" else substeps)
        return VolumetricContact(Bodies(self.client), substeps=substeps, **{"dissipation": 1e-3} | parameters)

    def position(self, id: int) -> np.ndarray:
        return np.array(p.getBasePositionAndOrientation(id, self.client)[0])

    def turn(self, id: int) -> np.ndarray:
        """Its rotation (3, 3)."""
        quaternion = p.getBasePositionAndOrientation(id, self.client)[1]
        return np.array(p.getMatrixFromQuaternion(quaternion)).reshape(3, 3)

    def velocity(self, id: int) -> tuple[np.ndarray, np.ndarray]:
        linear, angular = p.getBaseVelocity(id, self.client)
        return np.array(linear), np.array(angular)

    def push(self, id: int, linear=(0, 0, 0), angular=(0, 0, 0)) -> None:
        p.resetBaseVelocity(id, linear, angular, self.client)

    def inertia(self, id: int) -> np.ndarray:
        return np.array(p.getDynamicsInfo(id, -1, self.client)[2])


class BulletContact:
    """Bullet's own contact, used as a VolumetricContact is."""

    def __init__(self, world: World, substeps: int) -> None:
        self.world, self.substeps = world, substeps

    def __enter__(self) -> BulletContact:
        return self

    def __exit__(self, *_: object) -> None: ...

    def step(self) -> None:
        client = self.world.client
        p.setTimeStep(self.world.step / self.substeps, client)
        for _ in range(self.substeps):
            p.stepSimulation(client)
        p.setTimeStep(self.world.step, client)


def run(contact: Any, seconds: float, step: float = STEP) -> None:
    for _ in range(round(seconds / step)):
        contact.step()


def rattle(law="volumetric", seconds=3.0, stiffness=1e7, tilt=1e-3, **parameters) -> dict[str, np.ndarray]:
    """A cube set down 1 mm high and tilted (drake#22213): after each step its depth (m), tilt (rad) and speeds."""
    with World() as world:
        cube = world.box(*[HALF] * 3, position=[0, 0, HALF + 1e-3], orientation=p.getQuaternionFromEuler([tilt, 0, 0]))
        rows = []
        with world.contact(law, stiffness=stiffness, **parameters) as contact:
            for _ in range(round(seconds / STEP)):
                contact.step()
                linear, angular = world.velocity(cube)
                leaning = math.hypot(*world.turn(cube)[2, :2])
                depth = HALF - world.position(cube)[2]
                rows.append((depth, leaning, np.linalg.norm(linear), np.linalg.norm(angular)))
    return dict(zip(("depth", "tilt", "speed", "spin"), np.array(rows).T))


def bounce(pose: str, substeps: int, law="volumetric", phases=5, drop=0.05, stiffness=1e7) -> float:
    """The energy that a cube gains or loses by a bounce, over that of its drop: the worst of several heights.

    Velocities of Bullet are those half a step before: energy is that of v + a h / 2, with a of the flight.
    """
    worst = 0.0
    for phase in range(phases):
        with World() as world:
            where = np.array(p.getMatrixFromQuaternion(POSES[pose])).reshape(3, 3)
            start = drop + HALF * np.abs(where[2]).sum() + phase * 1e-4
            cube = world.box(*[HALF] * 3, position=[0, 0, start], orientation=POSES[pose], friction=0)
            if law == "bullet":
                for id in (cube, world.plane):
                    p.changeDynamics(id, -1, restitution=1, physicsClientId=world.client)
            inertia, lag = world.inertia(cube), G * STEP / substeps / 2

            def energy(world=world, cube=cube, inertia=inertia, lag=lag) -> float:
                (x, y, z), angular = world.velocity(cube)
                own = world.turn(cube).T @ angular
                speed2 = x**2 + y**2 + (z - lag) ** 2
                return G * world.position(cube)[2] + speed2 / 2 + own @ (inertia * own) / 2

            before = energy()
            with world.contact(law, substeps, stiffness=stiffness, dissipation=0) as contact:
                for _ in range(240):
                    contact.step()
                    lowest = world.position(cube)[2] - HALF * np.abs(world.turn(cube)[2]).sum()
                    if world.velocity(cube)[0][2] > 0 and lowest > 1e-3:
                        break
            worst = max(worst, abs(energy() - before) / (G * drop))
    return worst


def restitution(dissipation: float | None, drop=0.5, substeps=32, stiffness=1e7) -> float:
    """The speed of a cube after a bounce on its face, over that before: both where it is 1 mm high."""
    with World() as world:
        cube = world.box(*[HALF] * 3, position=[0, 0, HALF + drop])
        lag = G * STEP / substeps / 2

        def speed() -> float:
            height = world.position(cube)[2] - HALF - 1e-3
            return math.sqrt((world.velocity(cube)[0][2] - lag) ** 2 + 2 * G * height)

        before = math.sqrt(2 * G * (drop - 1e-3) + lag**2)
        with world.contact(substeps=substeps, stiffness=stiffness, dissipation=dissipation) as contact:
            while world.velocity(cube)[0][2] <= 0 or world.position(cube)[2] < HALF + 1e-3:
                contact.step()
        return speed() / before


def rebound(dissipation: float, stiffness=1e7) -> float:
    """The same by Schwager and Pöschel (2007): a spring and a damper that do not draw, without weight."""
    damping = math.sqrt(stiffness * (2 * HALF) ** 2) * dissipation / 2
    ratio = damping / math.sqrt(1 - damping**2)
    return math.exp(-ratio * (math.pi - math.atan2(2 * damping * math.sqrt(1 - damping**2), 1 - 2 * damping**2)))


def slide(substeps: int, law="volumetric", speed=1.0) -> float:
    """How far a flat box slides, over v²/2µg; as Bullet moves by the velocity that it has after a step, v h/2 more."""
    with World() as world:
        box = world.box(HALF, HALF, 0.01, position=[0, 0, 0.01 - G / 1e6])
        with world.contact(law, substeps, stiffness=1e8) as contact:
            run(contact, 1)
            start = world.position(box)[0]
            world.push(box, [speed, 0, 0])
            run(contact, 1)
        way = world.position(box)[0] - start + speed * STEP / substeps / 2
    return way / (speed**2 / (2 * FRICTION * G))


def shove(substeps: Any = "auto", force=2.0) -> tuple[float, float]:
    """How far a flat box comes that is pushed by less than friction holds, from one step on, and its speed then."""
    with World() as world:
        box = world.box(HALF, HALF, 0.01, position=[0, 0, 0.01 - G / 1e5])
        with world.contact(substeps=substeps) as contact:
            run(contact, 1)
            start = world.position(box)[0]
            for _ in range(240):
                at = world.position(box).tolist()
                p.applyExternalForce(box, -1, [force, 0, 0], at, p.WORLD_FRAME, world.client)
                contact.step()
        return world.position(box)[0] - start, float(np.abs(world.velocity(box)).max())


def incline(slope: float, law="volumetric", substeps: Any = "auto") -> tuple[float, float]:
    """A flat box on a plane that is slowly turned to `slope` times its angle of friction: its acceleration and way.

    m/s² and m, in a second that begins a second after the plane has come to rest. A cube would sway on, a tall spring.
    """
    with World() as world:
        cube = world.box(HALF, HALF, 0.01, position=[0, 0, 0.01 - G / 1e5])

        def tip(part: float) -> None:
            angle = math.atan(part * FRICTION)
            world.pull(G * math.sin(angle), 0, -G * math.cos(angle))

        with world.contact(law, substeps) as contact:
            for part in np.linspace(0, slope, 480):
                tip(part)
                contact.step()
            run(contact, 1)
            start, before = world.position(cube)[0], world.velocity(cube)[0][0]
            run(contact, 1)
            return world.velocity(cube)[0][0] - before, world.position(cube)[0] - start


def spin(shape: str, substeps: int, law="volumetric", friction=None) -> tuple[float, float]:
    """How long a box or disc spins, and how long by I w / (µ m g rho), rho being the mean distance from the axis."""
    with World(step=STEP / substeps) as world:
        if shape == "box":
            body, distance, area = world.box(HALF, HALF, 0.01, position=[0, 0, 0.01]), 2 * HALF * SQUARE, 4 * HALF**2
        else:
            body = world.body(1, p.GEOM_CYLINDER, position=[0, 0, 0.01], radius=HALF, height=0.02)
            distance, area = HALF * DISC, math.pi * HALF**2
        p.resetBasePositionAndOrientation(body, [0, 0, 0.01 - G / (1e8 * area)], [0, 0, 0, 1], world.client)
        with world.contact(law, 1, stiffness=1e8, friction=friction) as contact:
            run(contact, 0.25, world.step)
            world.push(body, angular=[0, 0, 20])
            foretold = world.inertia(body)[2] * 20 / (FRICTION * G * distance)
            steps = 0
            while abs(world.velocity(body)[1][2]) > 1e-3 and steps * world.step < 2 * foretold:
                contact.step()
                steps += 1
    return steps * world.step, foretold


@dataclass
class Motion:
    way: float
    angle: float
    time: float


def slide_and_spin(shape: str, law="volumetric", friction=None, substeps=20, speed=1.0, spin=20.0) -> Motion:
    """A box or a disc that is sent off with both: how far it comes, how far it turns, and when it stands still."""
    with World(step=STEP / substeps) as world:
        if shape == "box":
            body, area = world.box(HALF, HALF, 0.01, position=[0, 0, 0.01]), 4 * HALF**2
        else:
            body, area = world.body(1, p.GEOM_CYLINDER, radius=HALF, height=0.02), math.pi * HALF**2
        p.resetBasePositionAndOrientation(body, [0, 0, 0.01 - G / (1e8 * area)], [0, 0, 0, 1], world.client)
        with world.contact(law, 1, stiffness=1e8, friction=friction) as contact:
            run(contact, 0.1, world.step)
            start = world.position(body)
            world.push(body, [speed, 0, 0], [0, 0, spin])
            angle, steps = 0.0, 0
            while steps * world.step < 1:
                contact.step()
                linear, angular = world.velocity(body)
                if np.abs(linear).max() + HALF * abs(angular[2]) < 1e-4:
                    break
                angle += angular[2] * world.step
                steps += 1
        return Motion(float(np.linalg.norm(world.position(body) - start)), angle, steps * world.step)


def rigid_slide_and_spin(shape: str, speed=1.0, spin=20.0, nodes=40, steps=4000) -> Motion:
    """The same of a rigid body whose pressure is everywhere the same: Coulomb's law, integrated over its base."""
    at, weight = np.polynomial.legendre.leggauss(nodes)
    if shape == "box":
        x, y = np.meshgrid(HALF * at, HALF * at)
        share = np.outer(weight, weight) / 4
        inertia = (2 * (2 * HALF) ** 2) / 12
    else:
        r, turn = np.meshgrid(HALF * (at + 1) / 2, np.linspace(0, 2 * math.pi, nodes, endpoint=False))
        x, y = r * np.cos(turn), r * np.sin(turn)
        share = (weight * r / HALF) / nodes
        inertia = HALF**2 / 2

    def change(state: np.ndarray) -> np.ndarray:
        _, _, angle, vx, vy, w = state
        rx, ry = x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle)
        ux, uy = vx - w * ry, vy + w * rx
        size = np.hypot(ux, uy) + 1e-300
        fx, fy = -FRICTION * G * share * ux / size, -FRICTION * G * share * uy / size
        return np.array([vx, vy, w, fx.sum(), fy.sum(), (rx * fy - ry * fx).sum() / inertia])

    state, h, time = np.array([0, 0, 0, speed, 0, spin], dtype=float), 0.5 / steps, 0.0
    # To the last step before friction would turn the motion round.
    while math.hypot(state[3], state[4]) + HALF * abs(state[5]) > 2 * FRICTION * G * h:
        a = change(state)
        b = change(state + h / 2 * a)
        c = change(state + h / 2 * b)
        state = state + h / 6 * (a + 2 * b + 2 * c + change(state + h * c))
        time += h
    return Motion(float(np.hypot(*state[:2])), float(state[2]), time)


def roll(
    shape: str,
    law="volumetric",
    stiffness=1e7,
    substeps: Any = 4,
    dissipation: float | None = 0.0,
    seconds=1.0,
    radius=HALF,
):
    """A cylinder or a ball that has begun to roll at 1 m/s: speeds (m/s) and kinetic energies (J), now and then."""
    with World() as world:
        turned = p.getQuaternionFromEuler([math.pi / 2, 0, 0])
        at = [0, 0, radius]
        if shape == "cylinder":
            body = world.body(1, p.GEOM_CYLINDER, at, turned, radius=radius, height=0.1)
        else:
            body = world.body(1, p.GEOM_SPHERE, at, radius=radius)
        moment = world.inertia(body)[2]
        with world.contact(law, stiffness=stiffness, dissipation=2e-3) as contact:
            run(contact, 2)  # comes to rest
        found = []
        with world.contact(law, substeps, stiffness=stiffness, dissipation=dissipation) as contact:
            world.push(body, [1, 0, 0], [0, 1 / radius, 0])
            for span in (0.25, seconds):
                run(contact, span)
                linear, angular = world.velocity(body)
                found.append((linear[0], linear[0] ** 2 / 2 + moment * angular[1] ** 2 / 2))
    (v0, e0), (v1, e1) = found
    return v0, v1, e0, e1


def simbenchmark(angle: float, law="volumetric", seconds=0.5) -> tuple[np.ndarray, np.ndarray]:
    """Gains of velocity (x, y) of box and balls in SimBenchmark's test of rolling, divided by the predicted gains.

    A box of 10 kg is pushed by 150 N over the ground, in any direction; 25 balls of 1 kg lie on it, and roll. They are
    so stiff that they sink in by less than a hundredth of their radius.
    """
    with World(step=1e-3) as world:
        p.changeDynamics(world.plane, -1, lateralFriction=0.5, physicsClientId=world.client)
        box = world.box(0.5, 0.5, 0.05, mass=10.0, position=[0, 0, 0.05 - 1e-6], friction=0.8)
        spots = [(0.18 * i, 0.18 * j) for i in range(-2, 3) for j in range(-2, 3)]
        balls = [world.body(1, p.GEOM_SPHERE, [x, y, 0.15 - 2.5e-4], radius=HALF, friction=1.0) for x, y in spots]
        force = 150 * np.array([math.cos(angle), math.sin(angle)])

        def of_ground(a: Any, b: Any) -> bool:
            return world.plane in (a[0], b[0])

        laws = {
            "stiffness": lambda a, b: 1e7 if of_ground(a, b) else 1e9,
            "dissipation": lambda a, b: 1e-3 if of_ground(a, b) else 0.0,
        }

        def velocities() -> tuple[np.ndarray, np.ndarray]:
            rolled = np.mean([world.velocity(ball)[0][:2] for ball in balls], axis=0)
            return world.velocity(box)[0][:2], rolled

        with world.contact(law, 1, **laws) as contact:
            run(contact, 0.1, world.step)
            for step in range(round((0.05 + seconds) / world.step)):
                if step == round(0.05 / world.step):
                    before = velocities()
                at = world.position(box)
                p.applyExternalForce(box, -1, [*force, 0], at, p.WORLD_FRAME, world.client)
                contact.step()
        after = velocities()
        friction = 0.4 * (10 + 25) * G
        # A ball is taken along by two sevenths: f = m a, and the torque r f turns it.
        foretold = (150 - friction) / (10 + 25 * 2 / 7) * seconds
        return (after[0] - before[0]) / foretold, (after[1] - before[1]) / (foretold * 2 / 7)


@dataclass
class Held:
    pressing: np.ndarray  # N, of the fingers
    fallen: float  # m, in half a second
    speed: float  # m/s, at its end
    acceleration: float  # m/s²


def grip(part: float, law="volumetric", substeps: Any = "auto", pushing=10.0, mass=0.2) -> Held:
    """A box between two fingers on rails, with a coefficient of friction of `part` of what its weight asks for."""
    friction = part * mass * G / (2 * pushing)
    with World(gravity=(0, 0, 0)) as world:
        client = world.client
        finger = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.01, 0.02, 0.02], physicsClientId=client)
        hand = p.createMultiBody(
            0,
            basePosition=[0, 0, 0.5],
            linkMasses=[0.2, 0.2],
            linkCollisionShapeIndices=[finger, finger],
            linkVisualShapeIndices=[-1, -1],
            linkPositions=[[-0.042, 0, 0], [0.042, 0, 0]],
            linkOrientations=[[0, 0, 0, 1]] * 2,
            linkInertialFramePositions=[[0, 0, 0]] * 2,
            linkInertialFrameOrientations=[[0, 0, 0, 1]] * 2,
            linkParentIndices=[0, 0],
            linkJointTypes=[p.JOINT_PRISMATIC] * 2,
            linkJointAxis=[[1, 0, 0], [-1, 0, 0]],
            physicsClientId=client,
        )
        world.undamped(hand, 1)
        box = world.box(0.03, 0.03, 0.06, mass=mass, position=[0, 0, 0.5], friction=friction)
        with world.contact(law, substeps) as contact:
            for joint in (0, 1):
                p.setJointMotorControl2(
                    hand, joint, p.VELOCITY_CONTROL, targetVelocity=1, force=pushing, physicsClientId=client
                )
            run(contact, 1)
            for weight in np.linspace(0, G, 240):
                world.pull(0, 0, -weight)
                contact.step()
            height, before = world.position(box)[2], world.velocity(box)[0][2]
            run(contact, 0.5)
            speed = world.velocity(box)[0][2]
            pressing = np.abs(contact.force[:, 0]) if law == "volumetric" else np.empty(0)
        return Held(pressing, world.position(box)[2] - height, speed, (speed - before) / 0.5)


def turntable(turn: float, law="volumetric", substeps: Any = 1, radius=0.3, seconds=4) -> tuple[float, float]:
    """The drift outwards in m/s of a cube on a disc that turns, in the last second, and its slip (0 for Bullet)."""
    with World() as world:
        client = world.client
        table = world.turntable([0.6, 0.6, 0.05], position=[0, 0, 1], mass=50)
        world.undamped(table, 1)
        cube = world.box(0.03, 0.03, 0.03, position=[radius, 0, 1.08 - G / (1e7 * 0.06**2)], friction=1)
        p.resetJointState(table, 0, 0, turn, physicsClientId=client)
        p.resetBaseVelocity(cube, [0, turn * radius, 0], [0, 0, turn], physicsClientId=client)
        with world.contact(law, substeps) as contact:
            p.setJointMotorControl2(
                table, 0, p.VELOCITY_CONTROL, targetVelocity=turn, force=1e4, physicsClientId=client
            )
            run(contact, seconds - 1)
            before = float(np.linalg.norm(world.position(cube)[:2]))
            run(contact, 1)
            slip = float(np.abs(contact.slip).max()) if law == "volumetric" else 0.0
            return float(np.linalg.norm(world.position(cube)[:2])) - before, slip


def stack(law="volumetric", stiffness=1e8, seconds=10.0, count=5, **parameters) -> tuple[float, float]:
    """A tower of cubes, each some millimetres aside: the way (m) of the worst in the second half, and its speed."""
    with World() as world:
        cubes = [
            world.box(*[HALF] * 3, position=[0.002 * (k % 2), 0.002 * (k // 2 % 2), HALF * (1 + 2 * k)])
            for k in range(count)
        ]
        with world.contact(law, stiffness=stiffness, **parameters) as contact:
            run(contact, seconds / 2)
            before = np.array([world.position(cube) for cube in cubes])
            run(contact, seconds / 2)
            after = np.array([world.position(cube) for cube in cubes])
            speed = max(np.abs(world.velocity(cube)).max() for cube in cubes)
    return float(np.abs(after - before).max()), float(speed)


def collide(kind: str, substeps: int, seed: int, stiffness=1e6, seconds=0.25) -> float:
    """Eight bodies that collide in space without friction and dissipation: their energy afterwards, over that before.

    `kind` is "cubes" or "balls". No two of them touch any more at the end.
    """
    random = np.random.default_rng(seed)
    with World(gravity=(0, 0, 0)) as world:
        p.removeBody(world.plane, world.client)
        bodies = []
        for corner in np.ndindex(2, 2, 2):
            side = np.array(corner) - 0.5
            turn = random.normal(size=4)
            at = {"position": 0.19 * side, "orientation": turn / np.linalg.norm(turn), "friction": 0}
            if kind == "cubes":
                bodies.append(world.box(*[HALF] * 3, **at))
            else:
                bodies.append(world.body(1, p.GEOM_SPHERE, radius=0.06, **at))
            world.push(bodies[-1], -1.5 * side + random.normal(size=3) * 0.3, random.normal(size=3) * 2)
        before = sum(kinetic(world, body) for body in bodies)
        with world.contact(stiffness=stiffness, dissipation=0, substeps=substeps) as contact:
            run(contact, seconds)
            assert len(contact) == 0, "bodies still touch"
        return float(sum(kinetic(world, body) for body in bodies) / before)


def kinetic(world: World, body: int) -> float:
    """The kinetic energy of a body, J."""
    mass = p.getDynamicsInfo(body, -1, world.client)[0]
    (linear, angular), turn = world.velocity(body), world.turn(body)
    return float(mass * linear @ linear + world.inertia(body) @ (turn.T @ angular) ** 2) / 2
