"""A ball, a cylinder and a capsule roll over a plane and down a slope, and lose nothing to it.

Hard: round bodies share slivers with what they roll on, a quarter of a millimetre deep at most. A contact that wanders
over a body must not push it back, and friction must stick where nothing else turns what rolls.
"""

import math

import pybullet as p

STEPS = 240
STIFFNESS = 1e9
CONTACT = {"stiffness": STIFFNESS, "dissipation": 0.0}
RADIUS, LENGTH, MASS, SPEED, SLOPE, GRAVITY = 0.05, 0.1, 1.0, 1.0, math.radians(10), 9.81


def build(client: int):
    p.setGravity(0, 0, -GRAVITY, physicsClientId=client)
    p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE, physicsClientId=client), physicsClientId=client)
    down = p.getQuaternionFromEuler([0, SLOPE, 0])
    ramp = p.createCollisionShape(p.GEOM_BOX, halfExtents=[1.0, 0.5, 0.1], physicsClientId=client)
    p.createMultiBody(0, ramp, -1, [0, 1.0, 0.5], down, physicsClientId=client)
    lying = p.getQuaternionFromEuler([math.pi / 2, 0, 0])
    for k, (kind, balls, length) in enumerate(
        [(p.GEOM_SPHERE, 1, 0.0), (p.GEOM_CYLINDER, 0, LENGTH), (p.GEOM_CAPSULE, 1, LENGTH)]
    ):
        sizes = {"radius": RADIUS, "height": length} if length else {"radius": RADIUS}
        shape = p.createCollisionShape(kind, **sizes, physicsClientId=client)
        height = RADIUS - _rest(balls, length, MASS * GRAVITY)
        rolls = p.createMultiBody(MASS, shape, -1, [-1, 0.3 * (k - 1) - 0.5, height], lying, physicsClientId=client)
        p.resetBaseVelocity(rolls, [SPEED, 0, 0], [0, SPEED / height, 0], physicsClientId=client)
        height = 0.1 + RADIUS - _rest(balls, length, MASS * GRAVITY * math.cos(SLOPE))
        above, _ = p.multiplyTransforms([0, 1.0, 0.5], down, [-0.9, 0.3 * (k - 1), height], [0, 0, 0, 1])
        falls = p.createMultiBody(MASS, shape, -1, above, lying, physicsClientId=client)
        for body in (rolls, falls):
            p.changeDynamics(body, -1, linearDamping=0, angularDamping=0, lateralFriction=1, physicsClientId=client)


def _rest(balls: int, length: float, weight: float) -> float:
    """The depth in a plane at which the shared volume of a ball, a cylinder or both in one carries the weight."""
    low, high = 0.0, RADIUS
    while (depth := (low + high) / 2) not in (low, high):
        cap = math.pi * depth**2 * (RADIUS - depth / 3)
        segment = RADIUS**2 * math.acos(1 - depth / RADIUS) - (RADIUS - depth) * math.sqrt(
            2 * RADIUS * depth - depth**2
        )
        low, high = (depth, high) if STIFFNESS * (balls * cap + length * segment) < weight else (low, depth)
    return depth
