"""Scenes as in pybullet's examples: objects that drop, grasps, robots that stand, wheels, piles.

Models are those of pybullet_data, boxes and balls. Four robots are those of the package example-robot-data.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import pybullet as p
import pybullet_data
from pybullet_utils.bullet_client import BulletClient
from robots import ROBOTS

PANDA_HOME = (0, 0.3, 0, -2.0, 0, 2.3, 0.78, 0.04, 0.04)
STANDING = (0, 0.9, -1.8) * 4  # hip, thigh and calf of each leg of an A1


class Script(NamedTuple):
    """What happens in a scene: the commands at each time (s), and the body that they lift or drive."""

    command: Callable[[float], None] | None = None
    lifted: int | None = None
    driven: int | None = None


class Scene(NamedTuple):
    build: Callable[[BulletClient], Script]
    seconds: float


SCENES: dict[str, Scene] = {}


def lasting(seconds: float) -> Callable[[Callable[[BulletClient], Script]], Callable[[BulletClient], Script]]:
    """A scene that lasts so many seconds, by the name of its function."""

    def listed(build: Callable[[BulletClient], Script]) -> Callable[[BulletClient], Script]:
        SCENES[build.__name__] = Scene(build, seconds)
        return build

    return listed


def new_world() -> BulletClient:
    """An empty world with gravity."""
    world = BulletClient(p.DIRECT)
    world.setAdditionalSearchPath(pybullet_data.getDataPath())
    world.setGravity(0, 0, -9.81)
    return world


def floor(world: BulletClient) -> None:
    world.loadURDF("plane.urdf")


def joints_of(world: BulletClient, robot: int, *kinds: int) -> list[int]:
    return [joint for joint in range(world.getNumJoints(robot)) if world.getJointInfo(robot, joint)[2] in kinds]


def hold(world: BulletClient, robot: int, joints: Sequence[int], angles: Sequence[float], force: float) -> None:
    for joint, angle in zip(joints, angles):
        world.setJointMotorControl2(robot, joint, p.POSITION_CONTROL, angle, force=force)


def turned(world: BulletClient, chance: random.Random) -> Any:
    return world.getQuaternionFromEuler([chance.uniform(-3, 3) for _ in range(3)])


@lasting(2)
def cube_drop(world: BulletClient) -> Script:
    floor(world)
    world.loadURDF("cube_small.urdf", [0, 0, 0.5], world.getQuaternionFromEuler([0.3, 0.2, 0.1]))
    return Script()


@lasting(2)
def quickstart_r2d2(world: BulletClient) -> Script:
    floor(world)
    world.loadURDF("r2d2.urdf", [0, 0, 1])
    return Script()


@lasting(2)
def kuka_touch_table(world: BulletClient) -> Script:
    floor(world)
    world.loadURDF("table/table.urdf", [0.5, 0, -0.63])
    arm = world.loadURDF("kuka_iiwa/model.urdf", useFixedBase=True)
    world.loadURDF("cube_small.urdf", [0.6, 0, 0.05])

    def command(time: float) -> None:
        part = min(time, 1)
        hold(world, arm, range(7), [0, 0.9 * part, 0, -1.2 * part, 0, 0.8, 0], 200)

    return Script(command)


def panda_grasp(world: BulletClient, model: str, height: float, grip: float = 0.02) -> Script:
    """A Franka hand reaches down to an object, grips it at this height above the floor, and lifts it by 0.2 m."""
    floor(world)
    arm = world.loadURDF("franka_panda/panda.urdf", useFixedBase=True)
    thing = world.loadURDF(model, [0.5, 0, height])
    joints = joints_of(world, arm, p.JOINT_REVOLUTE, p.JOINT_PRISMATIC)
    for joint, value in zip(joints, PANDA_HOME):
        world.resetJointState(arm, joint, value)
    down = world.getQuaternionFromEuler([math.pi, 0, 0])

    def command(time: float) -> None:
        lowered, lifted = (min(1, max(0, part)) for part in ((time - 0.5) / 0.5, time - 1.6))
        target = [0.5, 0, 0.25 - (0.25 - grip) * lowered + 0.2 * lifted]
        angles = world.calculateInverseKinematics(arm, 11, target, down, maxNumIterations=200, residualThreshold=1e-6)
        hold(world, arm, joints[:7], angles[:7], 87)
        hold(world, arm, joints[7:], [0.04 if time < 1.1 else 0] * 2, 20)

    return Script(command, lifted=thing)


GRASPED: dict[str, dict[str, Any]] = {
    "panda_cube": {"model": "cube_small.urdf", "height": 0.026},
    "panda_sphere": {"model": "sphere_small.urdf", "height": 0.03, "grip": 0.03},
    "panda_lego": {"model": "lego/lego.urdf", "height": 0.03},
    "panda_random5": {"model": "random_urdfs/005/005.urdf", "height": 0.03, "grip": 0.03},
    "panda_random20": {"model": "random_urdfs/020/020.urdf", "height": 0.03, "grip": 0.03},
}
SCENES |= {name: Scene(partial(panda_grasp, **thing), 7.6) for name, thing in GRASPED.items()}


def standing(world: BulletClient, robot: int, angles: Sequence[float], force: float) -> Script:
    joints = joints_of(world, robot, p.JOINT_REVOLUTE)
    return Script(lambda time: hold(world, robot, joints, angles, force))


@lasting(3)
def laikago_stand(world: BulletClient) -> Script:
    floor(world)
    robot = world.loadURDF("laikago/laikago_toes.urdf", [0, 0, 0.48], [0, 0.5, 0.5, 0], flags=p.URDF_USE_SELF_COLLISION)
    return standing(world, robot, [0] * 12, 20)


def a1(world: BulletClient) -> tuple[int, list[int]]:
    floor(world)
    robot = world.loadURDF("a1/a1.urdf", [0, 0, 0.32])
    joints = joints_of(world, robot, p.JOINT_REVOLUTE)
    for joint, angle in zip(joints, STANDING):
        world.resetJointState(robot, joint, angle)
    return robot, joints


@lasting(3)
def a1_stand(world: BulletClient) -> Script:
    robot, _ = a1(world)
    return standing(world, robot, STANDING, 33)


@lasting(3)
def a1_trot(world: BulletClient) -> Script:
    robot, joints = a1(world)

    def command(time: float) -> None:
        for leg in range(4):
            phase = 4 * math.pi * time + (0 if leg in (0, 3) else math.pi)
            angles = [0, 0.9 + 0.2 * math.cos(phase), -1.8 - 0.35 * max(0, math.sin(phase))]
            hold(world, robot, joints[3 * leg : 3 * leg + 3], angles, 33)

    return Script(command)


@lasting(2)
def minitaur_stand(world: BulletClient) -> Script:
    floor(world)
    robot = world.loadURDF("quadruped/minitaur.urdf", [0, 0, 0.2])
    names = {world.getJointInfo(robot, joint)[1].decode(): joint for joint in range(world.getNumJoints(robot))}
    for joint in names.values():
        world.setJointMotorControl2(robot, joint, p.VELOCITY_CONTROL, force=0)
    for leg in ("front_left", "front_right", "back_left", "back_right"):
        knees = [names.get(f"knee_{leg}{side}_link", names.get(f"knee_{leg}{side}_joint")) for side in "LR"]
        for side, knee in zip("LR", knees):
            world.resetJointState(robot, names[f"motor_{leg}{side}_joint"], 1.57)
            world.resetJointState(robot, knee, -2.1834)
        pin = world.createConstraint(
            robot, knees[0], robot, knees[1], p.JOINT_POINT2POINT, [0, 0, 0], [0, 0.005, 0.2], [0, 0.01, 0.2]
        )
        world.changeConstraint(pin, maxForce=1000)
    motors = [joint for name, joint in names.items() if name.startswith("motor")]

    def command(time: float) -> None:
        for motor in motors:
            world.setJointMotorControl2(
                robot, motor, p.POSITION_CONTROL, 1.57, positionGain=1, velocityGain=0.1, force=3.5
            )

    return Script(command)


@lasting(3)
def humanoid_ragdoll(world: BulletClient) -> Script:
    floor(world)
    robot = world.loadURDF("humanoid/humanoid.urdf", [0, 0, 1.2], globalScaling=0.25)
    for joint in joints_of(world, robot, p.JOINT_SPHERICAL):
        world.setJointMotorControlMultiDof(
            robot, joint, p.POSITION_CONTROL, [0, 0, 0, 1], positionGain=0, velocityGain=1, force=[1, 1, 1]
        )
    for joint in joints_of(world, robot, p.JOINT_REVOLUTE):
        world.setJointMotorControl2(robot, joint, p.VELOCITY_CONTROL, force=1)
    return Script()


@lasting(3)
def mjcf_humanoid(world: BulletClient) -> Script:
    world.loadMJCF("mjcf/humanoid_symmetric.xml")
    if world.getNumBodies() < 2:
        floor(world)
    return Script()


@lasting(3)
def husky_drive(world: BulletClient) -> Script:
    floor(world)
    robot = world.loadURDF("husky/husky.urdf", [0, 0, 0.15])

    def command(time: float) -> None:
        for wheel in range(2, 6):
            world.setJointMotorControl2(robot, wheel, p.VELOCITY_CONTROL, targetVelocity=8, force=20)

    return Script(command, driven=robot)


@lasting(3)
def racecar_drive(world: BulletClient) -> Script:
    floor(world)
    robot = world.loadURDF("racecar/racecar.urdf", [0, 0, 0.1])

    def command(time: float) -> None:
        for wheel in (2, 3, 5, 7):
            world.setJointMotorControl2(robot, wheel, p.VELOCITY_CONTROL, targetVelocity=20, force=10)
        for hinge in (4, 6):
            world.setJointMotorControl2(robot, hinge, p.POSITION_CONTROL, targetPosition=0.3)

    return Script(command, driven=robot)


@lasting(3)
def objects_on_table(world: BulletClient) -> Script:
    floor(world)
    world.loadURDF("table/table.urdf")
    models = {
        "objects/mug.urdf": 1, "lego/lego.urdf": 1.5, "duck_vhacd.urdf": 1, "teddy_vhacd.urdf": 2,
        "cube_small.urdf": 1, "sphere_small.urdf": 1, "jenga/jenga.urdf": 1, "domino/domino.urdf": 1,
    }  # fmt: skip
    for i, (model, scale) in enumerate(models.items()):
        world.loadURDF(model, [0.15 * (i % 4) - 0.25, 0.2 * (i // 4) - 0.1, 0.8], globalScaling=scale)
    return Script()


@lasting(3)
def random_urdfs_tray(world: BulletClient) -> Script:
    floor(world)
    world.loadURDF("tray/traybox.urdf")
    chance = random.Random(1)
    for i in range(20):
        at = [chance.uniform(-0.12, 0.12), chance.uniform(-0.12, 0.12), 0.1 + 0.06 * i]
        world.loadURDF(f"random_urdfs/{i:03d}/{i:03d}.urdf", at, turned(world, chance))
    return Script()


@lasting(3)
def jenga_tower(world: BulletClient) -> Script:
    floor(world)
    for layer in range(10):
        for i in (-1, 0, 1):
            at, angle = ([0, 0.0505 * i], 0.0) if layer % 2 == 0 else ([0.0505 * i, 0], math.pi / 2)
            world.loadURDF("jenga/jenga.urdf", [*at, 0.015 + 0.03 * layer], world.getQuaternionFromEuler([0, 0, angle]))
    return Script()


@lasting(4)
def domino_row(world: BulletClient) -> Script:
    floor(world)
    shape = world.createCollisionShape(p.GEOM_BOX, halfExtents=[0.004, 0.012, 0.024])
    bodies = [world.createMultiBody(0.01, shape, basePosition=[0.02 * i, 0, 0.024]) for i in range(20)]
    world.resetBaseVelocity(bodies[0], [0.15, 0, 0], [0, 6, 0])
    return Script()


@lasting(2)
def box_pile_100(world: BulletClient) -> Script:
    floor(world)
    chance = random.Random(2)
    shape = world.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05] * 3)
    for i in range(100):
        at = [chance.uniform(-0.15, 0.15), chance.uniform(-0.15, 0.15), 0.1 + 0.05 * i]
        world.createMultiBody(1, shape, basePosition=at, baseOrientation=turned(world, chance))
    return Script()


@lasting(3)
def balls_in_tray(world: BulletClient) -> Script:
    floor(world)
    world.loadURDF("tray/traybox.urdf")
    chance = random.Random(3)
    for i in range(40):
        world.loadURDF("sphere_small.urdf", [chance.uniform(-0.15, 0.15), chance.uniform(-0.15, 0.15), 0.2 + 0.03 * i])
    return Script()


@lasting(2)
def heightfield(world: BulletClient) -> Script:
    chance, rows = random.Random(0), 64
    shape = world.createCollisionShape(
        p.GEOM_HEIGHTFIELD,
        meshScale=[0.1, 0.1, 1],
        heightfieldData=[0.1 * chance.random() for _ in range(rows * rows)],
        numHeightfieldRows=rows,
        numHeightfieldColumns=rows,
    )
    world.createMultiBody(0, shape)
    world.loadURDF("cube_small.urdf", [0, 0, 0.3])
    world.loadURDF("sphere2.urdf", [0.8, 0, 1.2])
    return Script()


@lasting(3)
def conveyor(world: BulletClient) -> Script:
    floor(world)
    shape = world.createCollisionShape(p.GEOM_BOX, halfExtents=[1, 0.2, 0.05])
    belt = world.createMultiBody(0, shape, basePosition=[0, 0, 0.05])
    cube = world.loadURDF("cube_small.urdf", [-0.5, 0, 0.13])
    return Script(lambda time: world.resetBaseVelocity(belt, [0.3, 0, 0]), driven=cube)


@lasting(3)
def ant_random(world: BulletClient) -> Script:
    floor(world)
    robot = next(body for body in world.loadMJCF("mjcf/ant.xml") if world.getNumJoints(body) > 4)
    joints = joints_of(world, robot, p.JOINT_REVOLUTE)

    def command(time: float) -> None:
        for joint in joints:
            torque = 10 * math.sin(9 * time + joint)
            world.setJointMotorControl2(robot, joint, p.TORQUE_CONTROL, force=torque)

    return Script(command)


@lasting(3)
def mini_cheetah_stand(world: BulletClient) -> Script:
    floor(world)
    robot = world.loadURDF("mini_cheetah/mini_cheetah.urdf", [0, 0, 0.45])
    return standing(world, robot, [0, -0.7, 1.4] * 4, 20)


@lasting(3)
def bicycle(world: BulletClient) -> Script:
    floor(world)
    world.loadURDF("bicycle/bike.urdf", [0, 0, 1])
    return Script()


@lasting(3)
def samurai_cubes(world: BulletClient) -> Script:
    world.loadURDF("samurai.urdf")
    for i in range(5):
        world.loadURDF("cube_small.urdf", [0.1 * i, 0, 1], globalScaling=2)
    return Script()


@lasting(3)
def kinematic_pusher(world: BulletClient) -> Script:
    floor(world)
    shape = world.createCollisionShape(p.GEOM_BOX, halfExtents=[0.02, 0.1, 0.05])
    pusher = world.createMultiBody(0, shape, basePosition=[-0.2, 0, 0.051])
    cube = world.loadURDF("cube_small.urdf", [0, 0, 0.026])

    def command(time: float) -> None:
        world.resetBasePositionAndOrientation(pusher, [-0.2 + 0.15 * time, 0, 0.051], [0, 0, 0, 1])

    return Script(command, driven=cube)


@lasting(3)
def constraint_pressed(world: BulletClient) -> Script:
    floor(world)
    held = world.loadURDF("cube_small.urdf", [0, 0, 0.3])
    pin = world.createConstraint(held, -1, -1, -1, p.JOINT_FIXED, [0, 0, 0], [0, 0, 0], [0, 0, 0.3])
    world.loadURDF("cube_small.urdf", [0, 0, 0.03])
    return Script(lambda time: world.changeConstraint(pin, [0, 0, 0.3 - 0.225 * min(time, 1)], maxForce=50))


@lasting(2)
def soft_cloth(world: BulletClient) -> Script:
    world.resetSimulation(p.RESET_USE_DEFORMABLE_WORLD)
    world.setGravity(0, 0, -9.81)
    floor(world)
    world.loadURDF("cube_small.urdf", [0, 0, 0.1])
    world.loadSoftBody(
        "cloth_z_up.obj",
        basePosition=[0, 0, 0.4],
        scale=0.5,
        mass=0.2,
        useNeoHookean=0,
        useBendingSprings=1,
        useMassSpring=1,
        springElasticStiffness=40,
        springDampingStiffness=0.1,
        collisionMargin=0.02,
        useSelfCollision=0,
        frictionCoeff=0.5,
        useFaceContact=1,
    )
    return Script()


@lasting(3)
def gripper_wsg(world: BulletClient) -> Script:
    floor(world)
    gripper = world.loadSDF("gripper/wsg50_one_motor_gripper_new_free_base.sdf")[0]
    world.resetBasePositionAndOrientation(gripper, [0, 0, 0.4], world.getQuaternionFromEuler([math.pi, 0, 0]))
    world.loadURDF("cube_small.urdf", [0, 0, 0.03])
    return Script()


def walker(world: BulletClient, model: str, height: float, angles: dict[str, float], force: float) -> Script:
    """A robot with legs that holds a pose. `angles` gives joints by the ends of their names; the others are 0."""
    floor(world)
    path = ROBOTS / model
    with TemporaryDirectory() as folder:
        here = Path(folder) / path.name
        text = path.read_text(encoding="utf-8")
        here.write_text(text.replace("package://example-robot-data/robots", str(ROBOTS)), encoding="utf-8")
        robot = world.loadURDF(str(here), [0, 0, height])
    joints = joints_of(world, robot, p.JOINT_REVOLUTE)
    names = [world.getJointInfo(robot, joint)[1].decode() for joint in joints]
    pose = [next((angle for end, angle in angles.items() if name.endswith(end)), 0.0) for name in names]
    for joint, angle in zip(joints, pose):
        world.resetJointState(robot, joint, angle)
    return standing(world, robot, pose, force)


@lasting(2)
def anymal_stand(world: BulletClient) -> Script:
    front, hind = {"F_HFE": 0.4, "F_KFE": -0.8}, {"H_HFE": -0.4, "H_KFE": 0.8}
    return walker(world, "anymal_c_simple_description/urdf/anymal.urdf", 0.62, front | hind, 80)


@lasting(2)
def solo12_stand(world: BulletClient) -> Script:
    angles = {f"{leg}_{joint}": sign * angle for sign, legs in ((1, ("FL", "FR")), (-1, ("HL", "HR"))) for leg in legs
              for joint, angle in (("HFE", 0.8), ("KFE", -1.6))}  # fmt: skip
    return walker(world, "solo_description/robots/solo12.urdf", 0.3, angles, 2.5)


@lasting(2)
def go1_stand(world: BulletClient) -> Script:
    return walker(world, "go1_description/urdf/go1.urdf", 0.36, {"thigh_joint": 0.8, "calf_joint": -1.5}, 24)


@lasting(2)
def bolt_stand(world: BulletClient) -> Script:
    return walker(world, "bolt_description/robots/bolt.urdf", 0.45, {}, 2.5)
