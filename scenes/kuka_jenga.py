"""A KUKA arm pushes a jenga tower over.

Hard: forty-five boxes of one size are in perfect alignment. Faces coincide, many pairs share an edge, and every overlap
is a sheet, microns thick at first. Then the tower breaks, and nothing is aligned any more.
"""

import math

import pybullet as p
import pybullet_data

STEPS = 300
LAYERS = 15
BLOCK = (0.15, 0.05, 0.03)  # metres, as in jenga.urdf
HAND = 6
READY = [-0.75, 0.75, 0.0, -1.55, 0.0, 0.8, 0.0]


def build(client: int):
    p.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=client)
    p.setGravity(0, 0, -9.81, physicsClientId=client)
    p.loadURDF("plane_implicit.urdf", physicsClientId=client)
    for layer in range(LAYERS):
        turned = layer % 2 * math.pi / 2
        for k in (-1, 0, 1):
            across = k * BLOCK[1]
            p.loadURDF(
                "jenga/jenga.urdf",
                [0.6 - across * math.sin(turned), across * math.cos(turned), (layer + 0.5) * BLOCK[2]],
                p.getQuaternionFromEuler([0, 0, turned]),
                physicsClientId=client,
            )
    arm = p.loadURDF("kuka_iiwa/model.urdf", useFixedBase=True, physicsClientId=client)
    for joint, angle in enumerate(READY):
        p.resetJointState(arm, joint, angle, physicsClientId=client)

    def step(i: int) -> None:
        target = [0.6, -0.25 + 0.4 * i / STEPS, 0.3]
        angles = p.calculateInverseKinematics(
            arm,
            HAND,
            target,
            p.getQuaternionFromEuler([-math.pi / 2, 0, 0]),
            maxNumIterations=50,
            physicsClientId=client,
        )
        p.setJointMotorControlArray(arm, range(7), p.POSITION_CONTROL, angles, forces=[300] * 7, physicsClientId=client)

    return step
