"""A film of one's own scene: three balls and a capsule fall into a tray; one HTML file with a time slider."""

import pybullet as p
import pybullet_data

from overlapper.simulation import Bodies
from overlapper.viewer import Recording

p.connect(p.DIRECT)
p.setGravity(0, 0, -9.81)
p.loadURDF(f"{pybullet_data.getDataPath()}/tray/traybox.urdf")
ball = p.createCollisionShape(p.GEOM_SPHERE, radius=0.05)
capsule = p.createCollisionShape(p.GEOM_CAPSULE, radius=0.03, height=0.1)
for i, shape in enumerate([ball, capsule, ball, ball]):
    body = p.createMultiBody(0.2, shape, -1, [0.03 * i - 0.05, 0.02 * i, 0.15 + 0.12 * i], [0.1, 0.6, 0.1, 0.8])
    p.changeDynamics(body, -1, contactStiffness=1e3, contactDamping=5)  # soft, so that there is something to see

bodies, recording, deepest = Bodies(), Recording(), 0.0
for step in range(240):
    p.stepSimulation()
    if step % 8 == 0:
        bodies.update()
        contacts = bodies.overlaps(tolerance=0.02)  # fine enough to look at
        recording.add(bodies, contacts, step / 240)
        deepest = max([deepest, *(contact.overlap.depth for contact in contacts)])

print(f"deepest overlap {1e3 * deepest:.1f} mm; open {recording.save('falling_balls.html').resolve()}")
