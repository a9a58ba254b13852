"""With volumetric contact, a Franka arm lifts a rubber duck by friction alone and holds it.

Hard: nothing creeps only if the friction of two fingers sticks to the last digit while seven motors, a gear between the
fingers and gravity pull at what they hold. The duck is five hulls that overlap each other, and the fingers are wedges.
"""

import math

import pybullet as p
import pybullet_data

STEPS = 300
CONTACT = {"dissipation": 1e-3}  # s: the expected states are those of this damping
DOWN = p.getQuaternionFromEuler([math.pi, 0, 0])
FINGERS, GRASP_POINT = (9, 10), 11
READY = [0.0, 0.35, 0.0, -2.2, 0.0, 2.55, math.pi / 4]


def build(client: int, *, grip: float = 20.0):
    p.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=client)
    p.setGravity(0, 0, -9.81, physicsClientId=client)
    p.loadURDF("tray/traybox.urdf", [0.55, 0, 0], physicsClientId=client)
    p.loadURDF(
        "duck_vhacd.urdf", [0.55, 0, 0.03], p.getQuaternionFromEuler([math.pi / 2, 0, 0]), physicsClientId=client
    )
    arm = p.loadURDF("franka_panda/panda.urdf", useFixedBase=True, physicsClientId=client)
    for joint, angle in enumerate(READY):
        p.resetJointState(arm, joint, angle, physicsClientId=client)
    for finger in FINGERS:
        p.resetJointState(arm, finger, 0.04, physicsClientId=client)
    # One motor closes both fingers of this hand.
    gear = p.createConstraint(
        arm, FINGERS[0], arm, FINGERS[1], p.JOINT_GEAR, [1, 0, 0], [0, 0, 0], [0, 0, 0], physicsClientId=client
    )
    p.changeConstraint(gear, gearRatio=-1, erp=0.1, maxForce=50, physicsClientId=client)

    def step(i: int) -> None:
        height = 0.055 + 0.1 * max(0.0, 1 - i / 100) + 0.15 * min(max(0.0, (i - 200) / 100), 1.0)
        angles = p.calculateInverseKinematics(
            arm, GRASP_POINT, [0.55, 0, height], DOWN, maxNumIterations=50, physicsClientId=client
        )
        p.setJointMotorControlArray(
            arm, range(7), p.POSITION_CONTROL, angles[:7], forces=[200] * 7, physicsClientId=client
        )
        opening = 0.04 if i < 110 else 0.0
        p.setJointMotorControlArray(
            arm, FINGERS, p.POSITION_CONTROL, [opening] * 2, forces=[grip] * 2, physicsClientId=client
        )

    return step
