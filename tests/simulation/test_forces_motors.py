"""Motors of pybullet beside contacts: the solver knows what their forces do within the same step."""

import math

import numpy as np
import pybullet as p
import pybullet_data
import pytest
from contact_experiments import World
from simulated import jointed

from overlapper.simulation import Bodies, VolumetricContact
from overlapper.simulation.bullet.dynamics import BulletDynamics

STEP, HALF, DEPTH, STIFFNESS, TAU = 1 / 240, 0.05, 1e-4, 1e6, 1e-3
ONE, MANY = "setJointMotorControl2", "setJointMotorControlArray"


@pytest.fixture
def world():
    with World() as made:
        yield made


def leg(world):
    """A cube of 2 kg on a vertical rail, 0.1 mm deep in the floor, without gravity."""
    world.pull(0, 0, 0)
    shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=[HALF] * 3, physicsClientId=world.client)
    place = (0, -1, [0, 0, HALF - DEPTH])
    id = jointed(world.client, p.JOINT_PRISMATIC, shape, [[0, 0, 1]], [[0, 0, 0]], mass=2, base=place)
    world.undamped(id, 1)
    p.setJointMotorControl2(id, 0, p.VELOCITY_CONTROL, force=0, physicsClientId=world.client)
    return id


@pytest.mark.parametrize(
    ("call", "arguments"),
    [
        (ONE, {"controlMode": p.VELOCITY_CONTROL, "targetVelocity": -0.02}),
        (ONE, {"controlMode": p.VELOCITY_CONTROL, "targetVelocity": -0.02, "velocityGain": 0.3}),
        (ONE, {"controlMode": p.VELOCITY_CONTROL, "targetVelocity": -0.02, "force": 3}),
        (ONE, {"controlMode": p.POSITION_CONTROL, "targetPosition": -1e-3}),
        (ONE, {"controlMode": p.POSITION_CONTROL, "targetPosition": -0.1, "maxVelocity": 0.03}),
        (ONE, {"controlMode": p.POSITION_CONTROL, "targetPosition": -1e-3, "positionGain": 0.3, "velocityGain": 0.5}),
        (MANY, {"controlMode": p.VELOCITY_CONTROL, "targetVelocities": [-0.02], "forces": [500]}),
        (MANY, {"controlMode": p.POSITION_CONTROL, "targetPositions": [-1e-3], "positionGains": [0.2]}),
    ],
)
def test_the_pressure_is_that_of_the_velocity_to_which_a_motor_brings_a_leg(world, call, arguments):
    """In the first step: f = k V + k A (θ h (u' - u) + τ u'), where u' is Bullet's velocity after the step."""
    id = leg(world)
    with VolumetricContact(Bodies(world.client), stiffness=STIFFNESS, dissipation=TAU, substeps=1) as contact:
        joint = [0] if call == MANY else 0
        getattr(p, call)(id, joint, physicsClientId=world.client, **arguments)
        contact.step()
        speed = p.getJointState(id, 0, world.client)[1]
    assert speed < 0
    expected = STIFFNESS * 4 * HALF**2 * (DEPTH - (STEP / 4 + TAU) * speed)
    assert abs(contact.force[0, 2]) == pytest.approx(expected, rel=1e-9)


def four_legs(world):
    """An A1 that stands, and its joints."""
    p.setAdditionalSearchPath(pybullet_data.getDataPath(), world.client)
    robot = p.loadURDF("a1/a1.urdf", [0, 0, 0.32], physicsClientId=world.client)
    count = p.getNumJoints(robot, physicsClientId=world.client)
    joints = [k for k in range(count) if p.getJointInfo(robot, k, world.client)[2] == p.JOINT_REVOLUTE]
    return robot, joints


def test_a_robot_that_its_motors_hold_stands_still_in_one_substep(world):
    robot, joints = four_legs(world)
    pose = (0, 0.9, -1.8) * 4
    for joint, angle in zip(joints, pose):
        p.resetJointState(robot, joint, angle, physicsClientId=world.client)
    with VolumetricContact(Bodies(world.client)) as contact:
        for _ in range(240):
            for joint, angle in zip(joints, pose):
                p.setJointMotorControl2(robot, joint, p.POSITION_CONTROL, angle, force=33, physicsClientId=world.client)
            contact.step()
        before = np.array(world.position(robot))
        weight = contact.on(robot)[0][2]
        for _ in range(48):
            contact.step()
            assert contact.substeps == 1
    mass = sum(p.getDynamicsInfo(robot, k, world.client)[0] for k in range(-1, p.getNumJoints(robot, world.client)))
    assert weight == pytest.approx(9.81 * mass, rel=1e-3)
    assert math.dist(before, world.position(robot)) < 1e-4


def test_a_motor_that_is_not_known_pushes_as_in_the_step_before(world):
    """The motor was commanded before the block."""
    id = leg(world)
    p.setJointMotorControl2(id, 0, p.VELOCITY_CONTROL, targetVelocity=-1, force=3, physicsClientId=world.client)
    with VolumetricContact(Bodies(world.client), substeps=1) as contact:
        for _ in range(240):
            contact.step()
    assert abs(contact.force[0, 2]) == pytest.approx(3, rel=1e-3)


@pytest.mark.parametrize("substeps", [1, 4])
def test_the_gains_of_motors_are_those_of_their_part_of_a_step_in_each_substep(world, monkeypatch, substeps):
    """Within a step, pybullet reports the length of a substep as its time step."""
    shares, motors = [], BulletDynamics.motors
    monkeypatch.setattr(BulletDynamics, "motors", lambda self, *args: shares.append(args) or motors(self, *args))
    leg(world)
    with VolumetricContact(Bodies(world.client), substeps=substeps, dissipation=TAU) as contact:
        contact.step()
    assert shares == [(pytest.approx(STEP / substeps), pytest.approx(1 / substeps))] * substeps
