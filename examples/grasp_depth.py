"""How deep a grasp penetrates: a Franka hand squeezes a rubber cube; depth, volume and contact area of each finger."""

import numpy as np
import pybullet as p
import pybullet_data

from overlapper.simulation import Bodies

FINGERS, GRASP_TARGET = (9, 10), 11

p.connect(p.DIRECT)
arm = p.loadURDF(f"{pybullet_data.getDataPath()}/franka_panda/panda.urdf", useFixedBase=True)
shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.02] * 3)
cube = p.createMultiBody(0.1, shape, -1, *p.getLinkState(arm, GRASP_TARGET)[:2])
p.changeDynamics(cube, -1, contactStiffness=1e4, contactDamping=50)
for joint in range(7):
    p.setJointMotorControl2(arm, joint, p.POSITION_CONTROL, 0.0, force=200)
for finger in FINGERS:
    p.resetJointState(arm, finger, 0.03)
    p.setJointMotorControl2(arm, finger, p.POSITION_CONTROL, 0.0, force=20)
for _ in range(240):
    p.stepSimulation()

bodies = Bodies()
for contact in bodies.overlaps():
    if contact.overlap and contact.bodyB == cube and contact.linkA in FINGERS:
        common = contact.overlap
        area = np.linalg.norm(common.gradient[0, :3])  # how fast the volume grows as the finger moves in
        print(
            f"{bodies.names[arm, contact.linkA]} at {1e3 * p.getJointState(arm, contact.linkA)[0]:.2f} mm: "
            f"{1e3 * common.depth:.2f} mm deep, {1e9 * common.volume:.0f} mm³, on {1e6 * area:.0f} mm²"
        )
