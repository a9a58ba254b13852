"""A peg is pressed, a degree askew, into a hole two tenths of a millimetre too narrow for it.

Hard: one cylinder meets the eight walls of an octagonal hole at once. Each overlap is forty millimetres long and a
fraction of a millimetre thick, curved on one side, and wedge-shaped because the peg leans.
"""

import math

import pybullet as p

STEPS = 200
PEG_RADIUS, PEG_LENGTH = 0.02, 0.08
HOLE_RADIUS, HOLE_DEPTH, WALL = 0.0198, 0.05, 0.01


def build(client: int):
    p.setGravity(0, 0, -9.81, physicsClientId=client)
    _hole(client)
    shape = p.createCollisionShape(p.GEOM_CYLINDER, radius=PEG_RADIUS, height=PEG_LENGTH, physicsClientId=client)
    lean = p.getQuaternionFromEuler([math.radians(1), 0, 0])
    start = [0, 0, HOLE_DEPTH + PEG_LENGTH / 2 + 0.005]
    peg = p.createMultiBody(0.5, shape, basePosition=start, baseOrientation=lean, physicsClientId=client)
    p.changeDynamics(peg, -1, lateralFriction=0.1, contactStiffness=20000, contactDamping=100, physicsClientId=client)
    gripper = p.createConstraint(
        peg, -1, -1, -1, p.JOINT_FIXED, [0, 0, 0], [0, 0, 0], start, [0, 0, 0, 1], lean, physicsClientId=client
    )

    def step(i: int) -> None:
        depth = 0.045 * min(1.0, i / 150)
        p.changeConstraint(gripper, [0, 0, start[2] - depth], lean, maxForce=500, physicsClientId=client)

    return step


def _hole(client: int) -> None:
    half_width = (HOLE_RADIUS + WALL) * math.tan(math.pi / 8)
    angles = [k * math.pi / 4 for k in range(8)]
    distance = HOLE_RADIUS + WALL / 2
    walls = p.createCollisionShapeArray(
        shapeTypes=[p.GEOM_BOX] * 8,
        halfExtents=[[WALL / 2, half_width, HOLE_DEPTH / 2]] * 8,
        collisionFramePositions=[[distance * math.cos(a), distance * math.sin(a), HOLE_DEPTH / 2] for a in angles],
        collisionFrameOrientations=[p.getQuaternionFromEuler([0, 0, a]) for a in angles],
        physicsClientId=client,
    )
    p.createMultiBody(0, walls, physicsClientId=client)
