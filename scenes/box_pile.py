"""Two hundred boxes of five kinds are poured into a tray and come to rest.

Hard: hundreds of pairs at once, boxes from 6 mm to 15 cm, edges across edges, faces on faces, and impacts that
press thin dominoes deep into their neighbours.
"""

import random

import pybullet as p
import pybullet_data

STEPS = 200
KINDS = ("jenga/jenga.urdf", "block.urdf", "domino/domino.urdf", "cube_small.urdf", "lego/lego.urdf")


def build(client: int, *, seed: int = 200) -> None:
    chance = random.Random(seed)
    p.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=client)
    p.setGravity(0, 0, -9.81, physicsClientId=client)
    p.setPhysicsEngineParameter(deterministicOverlappingPairs=1, physicsClientId=client)
    p.loadURDF("tray/traybox.urdf", physicsClientId=client)
    for k in range(200):
        layer, row, column = k // 25, k // 5 % 5 - 2, k % 5 - 2
        p.loadURDF(
            chance.choice(KINDS),
            [0.085 * row, 0.085 * column, 0.1 + 0.07 * layer],
            p.getQuaternionFromEuler([chance.uniform(-3, 3) for _ in range(3)]),
            physicsClientId=client,
        )
