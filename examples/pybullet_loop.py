"""The overlaps of a running pybullet simulation, every tenth of a second: a stack of boxes drops on the ground."""

import pybullet as p

from overlapper.simulation import Bodies

p.connect(p.DIRECT)
p.setGravity(0, 0, -9.81)
p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE))
shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.1, 0.1, 0.05])
for level in range(5):
    p.createMultiBody(1.0, shape, basePosition=[0.02 * level, 0.0, 0.06 + 0.12 * level])

bodies = Bodies()
for step in range(241):
    if step % 24 == 0:
        bodies.update()
        contacts = bodies.overlaps()
        total = sum(contact.overlap.volume for contact in contacts)
        print(f"{step / 240:.1f} s: {len(contacts)} pairs overlap or touch, {1e9 * total:.1f} mm³ in all")
    p.stepSimulation()

for contact in contacts:
    common = contact.overlap
    print(
        f"bodies {contact.bodyA} and {contact.bodyB}: {1e3 * common.depth:.4f} mm deep, {1e9 * common.volume:.2f} mm³, "
        f"normal on {contact.bodyB} {common.normal.round(3) + 0.0}"
    )
print(bodies.report())
