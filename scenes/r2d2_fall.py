"""An r2d2 falls over onto the ground and a few bricks.

Hard: boxes, spheres, and cylinders that are hulls of 64 points, against a half-space without bounds. At the impacts the
overlaps are deep and long. At rest they are slivers along a whole cylinder.
"""

import math

import pybullet as p
import pybullet_data

STEPS = 300


def build(client: int) -> None:
    p.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=client)
    p.setGravity(0, 0, -9.81, physicsClientId=client)
    p.loadURDF("plane_implicit.urdf", physicsClientId=client)
    for k in range(4):
        brick = p.loadURDF(
            "cube_small.urdf", [0.5 + 0.12 * k, 0.1 * (-1) ** k, 0.05], globalScaling=2, physicsClientId=client
        )
        p.changeDynamics(brick, -1, mass=2.4, physicsClientId=client)
    r2d2 = p.loadURDF(
        "r2d2.urdf", [0, 0, 0.75], p.getQuaternionFromEuler([0.2, 0.5, math.pi / 2]), physicsClientId=client
    )
    p.resetBaseVelocity(r2d2, [0.8, 0, 0], [0, 2.5, 0], physicsClientId=client)
