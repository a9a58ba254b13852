"""A Franka arm closes on a rubber duck in a tray, squeezes it and lifts it.

Hard: the fingers are wedges of many facets, the duck is five hulls that already overlap each other, and the squeeze is
millimetres deep on a few square centimetres. The tray's sloped sides are boxes that share their edges.
"""

import math

import pybullet as p
import pybullet_data

STEPS = 300
DOWN = p.getQuaternionFromEuler([math.pi, 0, 0])
FINGERS, GRASP_POINT = (9, 10), 11
READY = [0.0, 0.35, 0.0, -2.2, 0.0, 2.55, math.pi / 4]


def build(client: int, *, mass: float = 0.1, friction: float = 1.0):
    p.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=client)
    p.setGravity(0, 0, -9.81, physicsClientId=client)
    p.loadURDF("tray/traybox.urdf", [0.55, 0, 0], physicsClientId=client)
    duck = p.loadURDF(
        "duck_vhacd.urdf", [0.55, 0, 0.03], p.getQuaternionFromEuler([math.pi / 2, 0, 0]), physicsClientId=client
    )
    p.changeDynamics(duck, -1, contactStiffness=800, contactDamping=20, physicsClientId=client)  # rubber
    weighed, inertia = (p.getDynamicsInfo(duck, -1, physicsClientId=client)[k] for k in (0, 2))
    p.changeDynamics(
        duck,
        -1,
        mass=mass,
        localInertiaDiagonal=[each * mass / weighed for each in inertia],
        lateralFriction=friction,
        physicsClientId=client,
    )
    arm = p.loadURDF("franka_panda/panda.urdf", useFixedBase=True, physicsClientId=client)
    for joint, angle in enumerate(READY):
        p.resetJointState(arm, joint, angle, physicsClientId=client)
    for finger in FINGERS:
        p.resetJointState(arm, finger, 0.04, physicsClientId=client)

    def step(i: int) -> None:
        height = 0.055 + 0.1 * max(0.0, 1 - i / 100) + 0.15 * max(0.0, (i - 200) / 100)
        angles = p.calculateInverseKinematics(
            arm, GRASP_POINT, [0.55, 0, height], DOWN, maxNumIterations=50, physicsClientId=client
        )
        p.setJointMotorControlArray(
            arm, range(7), p.POSITION_CONTROL, angles[:7], forces=[200] * 7, physicsClientId=client
        )
        opening = 0.04 if i < 110 else 0.0
        p.setJointMotorControlArray(
            arm, FINGERS, p.POSITION_CONTROL, [opening] * 2, forces=[20] * 2, physicsClientId=client
        )

    return step
