"""The force of each finger of a grasp: a Franka hand closes on a cube and holds it by friction alone."""

import numpy as np
import pybullet as p
import pybullet_data

from overlapper.simulation import Bodies, VolumetricContact

FINGERS, GRASP_TARGET, GRIP = (9, 10), 11, 20.0

p.connect(p.DIRECT)
p.setGravity(0, 0, -9.81)
arm = p.loadURDF(f"{pybullet_data.getDataPath()}/franka_panda/panda.urdf", useFixedBase=True)
for joint, angle in enumerate([0.0, 0.35, 0.0, -2.2, 0.0, 2.55, 0.78, 0.0, 0.0, 0.022, 0.022]):
    p.resetJointState(arm, joint, angle)
shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.02] * 3)
cube = p.createMultiBody(0.5, shape, -1, *p.getLinkState(arm, GRASP_TARGET)[:2])
# One motor closes both fingers of this hand.
gear = p.createConstraint(arm, FINGERS[0], arm, FINGERS[1], p.JOINT_GEAR, [1, 0, 0], [0, 0, 0], [0, 0, 0])
p.changeConstraint(gear, gearRatio=-1, erp=0.1, maxForce=50)

with VolumetricContact(Bodies()) as contact:
    for joint in range(7):
        angle = p.getJointState(arm, joint)[0]
        p.setJointMotorControl2(arm, joint, p.POSITION_CONTROL, angle, force=200)
    for finger in FINGERS:
        p.setJointMotorControl2(arm, finger, p.POSITION_CONTROL, 0.0, force=GRIP)
    for _ in range(480):
        contact.step()

across = np.array(p.getMatrixFromQuaternion(p.getLinkState(arm, GRASP_TARGET)[1])).reshape(3, 3)[:, 1]
for finger in FINGERS:
    on_cube = -contact.on(arm, finger)[0]
    print(f"finger {finger}: squeezes with {abs(on_cube @ across):.2f} N, carries {on_cube[2]:.3f} N")
print(
    f"together they carry {contact.on(cube)[0][2]:.4f} N of {0.5 * 9.81:.4f} N; slip {abs(contact.slip).max():.1e} m/s"
)
