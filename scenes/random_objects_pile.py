"""Thirty of the thousand random objects of pybullet_data fall into a tray.

Hard: non-convex blobs made of many small hulls, which overlap each other within a blob, so that one touch between
two blobs is several overlaps between their parts.
"""

import random

import pybullet as p
import pybullet_data

STEPS = 240


def build(client: int, *, seed: int = 30) -> None:
    chance = random.Random(seed)
    p.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=client)
    p.setGravity(0, 0, -9.81, physicsClientId=client)
    p.setPhysicsEngineParameter(deterministicOverlappingPairs=1, physicsClientId=client)
    p.loadURDF("tray/traybox.urdf", physicsClientId=client)
    for k, name in enumerate(chance.sample(range(1000), 30)):
        layer, row, column = k // 9, k // 3 % 3 - 1, k % 3 - 1
        blob = p.loadURDF(
            f"random_urdfs/{name:03}/{name:03}.urdf",
            [0.12 * row, 0.12 * column, 0.12 + 0.12 * layer],
            p.getQuaternionFromEuler([chance.uniform(-3, 3) for _ in range(3)]),
            physicsClientId=client,
        )
        p.changeDynamics(blob, -1, contactStiffness=500, contactDamping=5, physicsClientId=client)  # foam
