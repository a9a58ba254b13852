"""Three crates are set down on each other, each a little askew, and come to rest."""

import pybullet as p

STEPS = 180


def build(client: int) -> None:
    p.setGravity(0, 0, -9.81, physicsClientId=client)
    ground = p.createCollisionShape(p.GEOM_PLANE, physicsClientId=client)
    p.createMultiBody(0, ground, physicsClientId=client)
    crate = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.2, 0.15, 0.1], physicsClientId=client)
    for k in range(3):
        askew = p.getQuaternionFromEuler([0, 0, 0.2 * k])
        p.createMultiBody(8, crate, -1, [0.02 * k, 0, 0.11 + 0.21 * k], askew, physicsClientId=client)
