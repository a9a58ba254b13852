"""One world of rigid bodies in Bullet, with and without volumetric contact, in MuJoCo and in Drake."""

from __future__ import annotations

import logging
import math
import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
import pybullet as p
from contact_experiments import STEP, World
from numpy.typing import ArrayLike

from overlapper.simulation import Bodies, VolumetricContact

UPRIGHT = (0.0, 0.0, 0.0, 1.0)


class Body(NamedTuple):
    """A uniform body. A mass of 0 fixes it. A box with a hinge only turns about the vertical axis."""

    kind: str  # "box", "ball" or "hull"
    size: Any  # m: half sizes of a box, radius of a ball, vertices (n, 3) of a hull about its centroid
    position: Sequence[float]  # m
    orientation: Sequence[float] = UPRIGHT  # quaternion (x, y, z, w)
    mass: float = 1.0  # kg
    velocity: Sequence[float] = (0.0, 0.0, 0.0)  # m/s
    spin: Sequence[float] = (0.0, 0.0, 0.0)  # rad/s, in axes of the world
    hinge: bool = False

    @property
    def thickness(self) -> float:
        """The smallest half size, m."""
        if self.kind == "hull":
            return float(np.ptp(np.asarray(self.size), axis=0).min()) / 2
        return float(np.min(self.size))


class Material(NamedTuple):
    """The same in all engines as far as they have it."""

    friction: float = 0.5  # of each pair
    elastic: bool = False  # bodies bounce without loss, and nothing is damped
    spinning: bool = False  # friction resists spins
    stiffness: float = 1e8  # Pa/m, of volumetric contact and of Drake
    dissipation: float = 1e-3  # s, of volumetric contact and of Drake; 0 if elastic
    default: bool = False  # volumetric contact chooses both by itself


class Engine(ABC):
    """A world with a plane at z = 0, at rest where nothing else is said. Bodies are numbered as they are given."""

    def __init__(self, bodies: Sequence[Body], material: Material, substeps: int, gravity: ArrayLike) -> None:
        self.bodies, self.material, self.substeps = bodies, material, substeps
        self.gravity = np.asarray(gravity, float)
        self.seconds = self.cost = 0.0  # simulated, and of the processor
        self.build()

    def __enter__(self) -> Engine:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def run(self, seconds: float) -> None:
        """Steps of 1/240 s, each divided into substeps. Only this time counts."""
        steps = round(seconds / STEP)
        begin = time.process_time()
        for _ in range(steps):
            self.step()
        self.cost += time.process_time() - begin
        self.seconds += steps * STEP

    @property
    def lag(self) -> np.ndarray:
        """What all these engines add to a velocity in free flight by half a substep: they move by the new velocity."""
        return self.gravity * STEP / self.substeps / 2

    @abstractmethod
    def build(self) -> None: ...

    @abstractmethod
    def step(self) -> None: ...

    @abstractmethod
    def position(self, body: int) -> np.ndarray: ...

    @abstractmethod
    def velocity(self, body: int) -> tuple[np.ndarray, np.ndarray]:
        """Linear and angular, in axes of the world."""

    def positions(self) -> np.ndarray:
        return np.array([self.position(k) for k, each in enumerate(self.bodies) if each.mass])


class Bullet(Engine):
    def build(self) -> None:
        self.world = World(gravity=self.gravity)
        self.ids: list[int] = []
        for each in self.bodies:
            self.add(each)
        for id in self.world.plane, *self.ids:  # the friction of a pair is the product of both
            self.world.undamped(id, math.sqrt(self.material.friction), restitution=float(self.material.elastic))
        self.contact = self.law()
        self.contact.__enter__()

    def law(self) -> Any:
        return self.world.contact("bullet", self.substeps)

    def __exit__(self, *_: object) -> None:
        self.contact.__exit__(None, None, None)
        self.world.__exit__()

    def add(self, body: Body) -> None:
        kind, figures = {
            "box": (p.GEOM_BOX, {"halfExtents": body.size}),
            "ball": (p.GEOM_SPHERE, {"radius": body.size}),
            "hull": (p.GEOM_MESH, {"vertices": np.asarray(body.size).tolist()}),
        }[body.kind]
        if body.hinge:
            id = self.world.turntable(body.size, body.position, body.mass)
            p.setJointMotorControl2(id, 0, p.VELOCITY_CONTROL, force=0, physicsClientId=self.world.client)
            p.resetJointState(id, 0, 0, body.spin[2], physicsClientId=self.world.client)
        else:
            id = self.world.body(body.mass, kind, body.position, body.orientation, **figures)
            if body.mass:
                self.world.push(id, body.velocity, body.spin)
        self.ids.append(id)

    def step(self) -> None:
        self.contact.step()

    def position(self, body: int) -> np.ndarray:
        return self.world.position(self.ids[body])

    def velocity(self, body: int) -> tuple[np.ndarray, np.ndarray]:
        return self.world.velocity(self.ids[body])


class Volumetric(Bullet):
    def law(self) -> VolumetricContact:
        found = self.material
        chosen = {"stiffness": found.stiffness, "dissipation": 0.0 if found.elastic else found.dissipation}
        return VolumetricContact(Bodies(self.world.client), substeps=self.substeps, **({} if found.default else chosen))


class Mujoco(Engine):
    """With its default contacts and elliptic cones. Elastic contacts are stiff springs without damping."""

    def build(self) -> None:
        found = self.material
        spring = 'solref="-1e5 0" solimp=".9999 .9999 .001 .5 2"' if found.elastic else ""
        dimensions = 1 if not found.friction else 4 if found.spinning else 3
        assets, worldbody = "", '<geom type="plane" size="0 0 1"/>'
        for k, body in enumerate(self.bodies):
            if body.kind == "hull":
                assets += f'<mesh name="hull{k}" vertex="{words(np.ravel(body.size))}"/>'
                shape = f'type="mesh" mesh="hull{k}"'
            else:
                shape = f'type="{"box" if body.kind == "box" else "sphere"}" size="{words(body.size)}"'
            joint = '<joint axis="0 0 1"/>' if body.hinge else "<freejoint/>" if body.mass else ""
            weight = f'mass="{body.mass}"' if body.mass else ""
            pose = f'pos="{words(body.position)}" quat="{words(np.roll(body.orientation, 1))}"'
            worldbody += f"<body {pose}>{joint}<geom {shape} {weight}/></body>"
        self.model = mujoco.MjModel.from_xml_string(
            f"""<mujoco>
              <option timestep="{STEP / self.substeps!r}" gravity="{words(self.gravity)}" cone="elliptic"/>
              <default><geom friction="{found.friction} .005 0" condim="{dimensions}" {spring}/></default>
              <asset>{assets}</asset><worldbody>{worldbody}</worldbody></mujoco>"""
        )
        self.data = mujoco.MjData(self.model)
        for k, body in enumerate(self.bodies):
            at = self.model.body_dofadr[k + 1]
            if body.hinge:
                self.data.qvel[at] = body.spin[2]
            elif body.mass:
                turn = self.turn(k)
                self.data.qvel[at : at + 6] = [*body.velocity, *(turn.T @ body.spin)]
        mujoco.mj_forward(self.model, self.data)

    def turn(self, body: int) -> np.ndarray:
        at, found = self.model.jnt_qposadr[self.model.body_jntadr[body + 1]], np.zeros(9)
        mujoco.mju_quat2Mat(found, self.data.qpos[at + 3 : at + 7])
        return found.reshape(3, 3)

    def step(self) -> None:
        for _ in range(self.substeps):
            mujoco.mj_step(self.model, self.data)

    def position(self, body: int) -> np.ndarray:
        if self.bodies[body].hinge:
            return self.data.xpos[body + 1].copy()
        at = self.model.jnt_qposadr[self.model.body_jntadr[body + 1]]
        return self.data.qpos[at : at + 3].copy()

    def velocity(self, body: int) -> tuple[np.ndarray, np.ndarray]:
        at = self.model.body_dofadr[body + 1]
        if self.bodies[body].hinge:
            return np.zeros(3), np.array([0, 0, self.data.qvel[at]])
        return self.data.qvel[at : at + 3].copy(), self.turn(body) @ self.data.qvel[at + 3 : at + 6]


class Drake(Engine):
    """Hydroelastic contact with the SAP solver. Bodies are compliant, and the plane is rigid."""

    def build(self) -> None:
        from pydrake import all as drake

        self.added: dict[int, Any] = {}
        self.steps = 0
        logging.getLogger("drake").setLevel(logging.ERROR)  # it warns that half-spaces do not touch deformable bodies
        builder = drake.DiagramBuilder()
        settings = drake.MultibodyPlantConfig(
            time_step=STEP / self.substeps,
            discrete_contact_approximation="sap",
            contact_model="hydroelastic_with_fallback",
        )
        self.plant = plant = drake.AddMultibodyPlant(settings, builder)[0]
        plant.mutable_gravity_field().set_gravity_vector(self.gravity)
        world, upright = plant.world_body(), drake.RigidTransform()
        plant.RegisterCollisionGeometry(world, upright, drake.HalfSpace(), "plane", self.properties(drake, None))
        joints = {}
        for k, body in enumerate(self.bodies):
            shape, properties = self.shape(drake, body, f"hull{k}"), self.properties(drake, body)
            pose = drake.RigidTransform(drake.Quaternion(np.roll(unit(body.orientation), 1)), body.position)
            if not body.mass:
                plant.RegisterCollisionGeometry(world, pose, shape, f"shape{k}", properties)
                continue
            unit_inertia = drake.CalcSpatialInertia(shape, 1).get_unit_inertia()
            inertia = drake.SpatialInertia(body.mass, np.zeros(3), unit_inertia)
            self.added[k] = plant.AddRigidBody(f"body{k}", plant.AddModelInstance(f"instance{k}"), inertia)
            plant.RegisterCollisionGeometry(self.added[k], upright, shape, f"shape{k}", properties)
            if body.hinge:
                base = plant.AddFrame(drake.FixedOffsetFrame(f"base{k}", world, pose))
                frame = self.added[k].body_frame()
                joints[k] = plant.AddJoint(drake.RevoluteJoint(f"hinge{k}", base, frame, (0, 0, 1)))
            else:
                plant.SetDefaultFloatingBaseBodyPose(self.added[k], pose)
        plant.Finalize()
        self.simulator = drake.Simulator(builder.Build())
        self.context = plant.GetMyMutableContextFromRoot(self.simulator.get_mutable_context())
        for k, added in self.added.items():
            body = self.bodies[k]
            if k in joints:
                joints[k].set_angular_rate(self.context, body.spin[2])
            else:
                velocity = drake.SpatialVelocity(body.spin, body.velocity)
                plant.SetFreeBodySpatialVelocity(self.context, added, velocity)
        self.simulator.Initialize()

    @staticmethod
    def shape(drake: Any, body: Body, name: str) -> Any:
        if body.kind == "box":
            return drake.Box(*(2 * np.asarray(body.size)))
        if body.kind == "ball":
            return drake.Sphere(body.size)
        return drake.Convex(np.asarray(body.size, float).T, name)

    def properties(self, drake: Any, body: Body | None) -> Any:
        """Of a compliant body, or of the rigid plane."""
        found, properties = self.material, drake.ProximityProperties()
        friction = drake.CoulombFriction(found.friction, found.friction)
        drake.AddContactMaterial(dissipation=0.0, friction=friction, properties=properties)
        properties.AddProperty("material", "relaxation_time", 0.0 if found.elastic else float(found.dissipation))
        if body is None:
            drake.AddRigidHydroelasticProperties(resolution_hint=0.02, properties=properties)
        else:
            # Two compliant bodies are springs in series. A body on the rigid plane is one spring.
            springs = 1 if len(self.bodies) == 1 else 2
            drake.AddCompliantHydroelasticProperties(
                resolution_hint=min(0.02, body.thickness),
                hydroelastic_modulus=springs * found.stiffness * body.thickness,
                properties=properties,
            )
        return properties

    def step(self) -> None:
        self.steps += 1
        self.simulator.AdvanceTo(self.steps * STEP)

    def position(self, body: int) -> np.ndarray:
        return np.array(self.plant.EvalBodyPoseInWorld(self.context, self.added[body]).translation())

    def velocity(self, body: int) -> tuple[np.ndarray, np.ndarray]:
        found = self.plant.EvalBodySpatialVelocityInWorld(self.context, self.added[body])
        return np.array(found.translational()), np.array(found.rotational())


ENGINES: dict[str, type[Engine]] = {"volumetric": Volumetric, "Bullet": Bullet, "MuJoCo": Mujoco, "Drake": Drake}


def words(numbers: Any) -> str:
    return " ".join(repr(float(each)) for each in np.atleast_1d(numbers))


def unit(quaternion: Sequence[float]) -> np.ndarray:
    return np.asarray(quaternion) / np.linalg.norm(quaternion)
