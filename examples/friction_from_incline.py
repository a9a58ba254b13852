"""A coefficient of friction as it is measured on a table: what lies on it is tilted, slowly, until it slips."""

import math

import pybullet as p

from overlapper.simulation import Bodies, VolumetricContact

FRICTION = 0.5
FASTER = 0.002  # degrees in each step

p.connect(p.DIRECT)
table = p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE))
box = p.createMultiBody(1.0, p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05, 0.05, 0.01]), -1, [0, 0, 0.01])
p.changeDynamics(table, -1, lateralFriction=1.0)
p.changeDynamics(box, -1, lateralFriction=FRICTION)  # pybullet multiplies the two

degrees = 20.0
with VolumetricContact(Bodies()) as contact:
    while p.getBaseVelocity(box)[0][0] < 1e-4 or degrees < 21:
        degrees += FASTER
        # Gravity is turned instead of the table.
        angle = math.radians(degrees)
        p.setGravity(9.81 * math.sin(angle), 0, -9.81 * math.cos(angle))
        contact.step()

print(f"it slips at {degrees:.2f}°: friction {math.tan(angle):.4f}, and it was told {FRICTION}")
