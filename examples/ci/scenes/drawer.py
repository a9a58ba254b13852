"""A drawer slides shut, a degree askew, so that its floor rubs against both sides of the cabinet and meets the back."""

import math
from pathlib import Path

import pybullet as p

STEPS = 120
MODELS = Path(__file__).parent.parent / "models"


def build(client: int):
    p.loadURDF(str(MODELS / "cabinet.urdf"), useFixedBase=True, physicsClientId=client)
    drawer = p.loadURDF(str(MODELS / "drawer.urdf"), physicsClientId=client)
    askew = p.getQuaternionFromEuler([0, 0, math.radians(1)])

    def step(i: int) -> None:
        position = [0.4 * (1 - i / STEPS) - 0.003, 0, 0]
        p.resetBasePositionAndOrientation(drawer, position, askew, physicsClientId=client)

    return step
