"""A motor is as fast in substeps as in a step: its gains are parts of an error that a whole step takes away."""

import numpy as np
import pybullet as p
import pytest
from simulated import body, box

from overlapper.simulation import Bodies, VolumetricContact

MANY = {"targetVelocity": "targetVelocities", "targetPosition": "targetPositions", "force": "forces"}
MANY |= {"positionGain": "positionGains", "velocityGain": "velocityGains"}

ASKED = {
    "default gains": {"controlMode": p.POSITION_CONTROL, "targetPosition": 0.3},
    "a gain of speed": {"controlMode": p.POSITION_CONTROL, "targetPosition": 0.3, "velocityGain": 0.2},
    "two gains": {
        "controlMode": p.POSITION_CONTROL,
        "targetPosition": 0.3,
        "positionGain": 0.3,
        "velocityGain": 0.5,
    },
    "no gain of speed": {
        "controlMode": p.POSITION_CONTROL,
        "targetPosition": 0.3,
        "positionGain": 0.002,
        "velocityGain": 0.0,
    },
    "a speed": {"controlMode": p.VELOCITY_CONTROL, "targetVelocity": 0.5, "velocityGain": 0.1},
}


def way(client, arguments, by, substeps):
    """Where a motor of 300 N m takes the joints of an arm in a tenth of a second."""
    arm = p.loadURDF("kuka_iiwa/model.urdf", useFixedBase=True, physicsClientId=client)
    joints = range(6)  # the seventh is so light that Bullet alone makes it tremble

    def tell():
        if by == "Array":
            many = {MANY[name]: [value] * 6 for name, value in arguments.items() if name in MANY}
            p.setJointMotorControlArray(
                arm, joints, arguments["controlMode"], forces=[300] * 6, physicsClientId=client, **many
            )
            return
        for joint in joints:
            p.setJointMotorControl2(arm, joint, force=300, physicsClientId=client, **arguments)

    where = []
    with VolumetricContact(Bodies(client), substeps=substeps or 1) as contact:
        for _ in range(24):
            tell()
            contact.step() if substeps else p.stepSimulation(client)
            where.append([state[0] for state in p.getJointStates(arm, joints, client)])
    p.resetSimulation(physicsClientId=client)
    return np.array(where)


@pytest.mark.parametrize("by", ["2", "Array"])
@pytest.mark.parametrize("asked", ASKED)
def test_a_motor_takes_a_joint_as_far_in_sixteen_substeps_as_in_a_step(client, asked, by):
    whole, one, sixteen = (way(client, ASKED[asked], by, substeps) for substeps in (0, 1, 16))
    assert np.array_equal(whole, one)
    # The same but for the step by which it is later.
    fastest = np.abs(np.diff(whole, axis=0)).max()
    assert fastest > 1e-3 and np.abs(sixteen - whole).max() < 2 * fastest


@pytest.mark.parametrize("substeps", [1, 2, 16])
@pytest.mark.parametrize("told", ["before", "within"])
def test_a_constraint_presses_as_hard_in_substeps_whenever_it_was_created(client, told, substeps):
    body(client, p.GEOM_BOX, halfExtents=[1, 1, 0.5], mass=0, position=[0, 0, -0.5])
    cube = box(client, 0.05, position=[0, 0, 0.05])
    constraint = p.createConstraint(
        cube, -1, -1, -1, p.JOINT_FIXED, [0, 0, 0], [0, 0, 0], [0, 0, 0.05], physicsClientId=client
    )

    def pull():
        p.changeConstraint(constraint, [0, 0, -0.1], maxForce=200, physicsClientId=client)

    if told == "before":
        pull()
    with VolumetricContact(Bodies(client), substeps=substeps) as contact:
        if told == "within":
            pull()
        for _ in range(480):
            contact.step()
        pressing = -contact.mean().on(0)[0][2]
    p.resetSimulation(physicsClientId=client)
    assert pressing == pytest.approx(200, rel=1e-3)
