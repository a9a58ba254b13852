"""What the finger of a gripper feels: a Franka hand holds a tilted bar; a picture of pressure and shear on its pad."""

import numpy as np
import pybullet as p
import pybullet_data
from matplotlib import pyplot

from overlapper.simulation import Bodies, TaxelGrid, VolumetricContact

FINGERS, GRASP_TARGET = (9, 10), 11
ARM = dict(enumerate([0.0, 0.35, 0.0, -2.2, 0.0, 2.55, 0.78]))

p.connect(p.DIRECT)
p.setGravity(0, 0, -9.81)
robot = p.loadURDF(f"{pybullet_data.getDataPath()}/franka_panda/panda.urdf", useFixedBase=True)
for joint, angle in [*ARM.items(), *((finger, 0.022) for finger in FINGERS)]:
    p.resetJointState(robot, joint, angle)
shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.004, 0.0215, 0.03])
place, turn = p.getLinkState(robot, GRASP_TARGET)[:2]
tilted = p.multiplyTransforms([0, 0, 0], turn, [0, 0, 0], p.getQuaternionFromEuler([0, 0.6, 0]))[1]
bar = p.createMultiBody(0.3, shape, -1, place, tilted)

with VolumetricContact(Bodies(), stiffness=1e8, friction=1) as contact:  # Pa/m, as a soft pad
    for joint, angle in [*ARM.items(), *((finger, 0.0) for finger in FINGERS)]:
        p.setJointMotorControl2(robot, joint, p.POSITION_CONTROL, angle, force=20 if joint in FINGERS else 200)
    for _ in range(240):
        contact.step()

# The normal of this finger's pad is -y. The axes x and y of the grid are the axes x and z of the finger.
pad = TaxelGrid((0.024, 0.032), (12, 16), position=(0, -0.01, 0.019), orientation=(np.sqrt(0.5), 0, 0, np.sqrt(0.5)))
felt = contact.pressure((robot, FINGERS[0]), pad)
x, y = 1e3 * pad.points[..., 0], 1e3 * pad.points[..., 2]
figure, axes = pyplot.subplots()
figure.colorbar(axes.pcolormesh(x, y, 1e-3 * felt.pressure), label="kPa")
axes.quiver(x, y, *np.moveaxis(felt.shear, -1, 0), color="white")
axes.set(aspect="equal", xlabel="mm", ylabel="mm")
figure.savefig("tactile_image.png")
print(f"felt {np.linalg.norm(felt.force.sum(axis=(0, 1))):.3f} N, outside {np.linalg.norm(felt.outside):.3f} N")
