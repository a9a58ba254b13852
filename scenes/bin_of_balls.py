"""Spheres and capsules are dropped into a bin.

Hard: every overlap is smooth on at least one side. There are lenses between spheres, caps on the walls, and the long
shallow lenses of two capsules that lie side by side. No overlap is a polytope, so the error bound is put to the test.
"""

import random

import pybullet as p
import pybullet_data

STEPS = 120


def build(client: int, *, seed: int = 7) -> None:
    chance = random.Random(seed)
    p.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=client)
    p.setGravity(0, 0, -9.81, physicsClientId=client)
    p.setPhysicsEngineParameter(deterministicOverlappingPairs=1, physicsClientId=client)
    p.loadURDF("tray/traybox.urdf", globalScaling=0.5, physicsClientId=client)
    capsule = p.createCollisionShape(p.GEOM_CAPSULE, radius=0.02, height=0.08, physicsClientId=client)
    for k in range(20):
        layer, row, column = k // 9, k // 3 % 3 - 1, k % 3 - 1
        place = [0.09 * row, 0.09 * column, 0.08 + 0.09 * layer]
        turn = p.getQuaternionFromEuler([chance.uniform(-3, 3) for _ in range(3)])
        if k % 2:
            ball = p.loadURDF("sphere_small.urdf", place, turn, physicsClientId=client)
        else:
            ball = p.createMultiBody(0.15, capsule, basePosition=place, baseOrientation=turn, physicsClientId=client)
        p.changeDynamics(ball, -1, contactStiffness=2000, contactDamping=10, physicsClientId=client)  # rubber
