"""A pressure map of two feet: a walking machine leans back on its heels; a picture of the soles."""

import numpy as np
import pybullet as p
import pybullet_data
from matplotlib import pyplot

from overlapper.simulation import Bodies, VolumetricContact

FEET, LEAN = (5, 8), 0.02  # links, and radians at the ankles

p.connect(p.DIRECT)
p.setGravity(0, 0, -9.81)
p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE))
walker = p.loadURDF(f"{pybullet_data.getDataPath()}/biped/biped2d_pybullet.urdf", [0, 0, -0.303])

with VolumetricContact(Bodies(), dissipation=0.02) as contact:  # s: soles that do not bounce
    for joint in range(p.getNumJoints(walker)):
        strength = 0 if joint < 2 else 1000  # the first two are the ways in which the whole machine may move
        p.setJointMotorControl2(walker, joint, p.POSITION_CONTROL, LEAN * (joint in FEET), force=strength)
    for _ in range(480):
        contact.step()

figure, axes = pyplot.subplots()
for foot in FEET:
    (row,) = np.flatnonzero(contact.pairs[:, 4] == foot)
    corners = contact.contacts[row].overlap.vertices
    sole = corners[corners[:, 2] < -1e-12]  # the ground is at height 0, but for rounding
    pressure = -contact.last.stiffness[row] * sole[:, 2]
    drawn = axes.tripcolor(*sole[:, :2].T, pressure, shading="gouraud", vmin=0)
    at, force = contact.centre[row], -contact.force[row, 2]
    print(
        f"foot {foot}: {force:.2f} N at y = {1e3 * at[1]:.1f} mm, from {pressure.min():.0f} to {pressure.max():.0f} Pa"
    )
figure.colorbar(drawn, label="Pa")
axes.set(aspect="equal", xlabel="m", ylabel="m")
figure.savefig("foot_pressure.png")
print(f"together {contact.on(walker)[0][2]:.2f} N; open foot_pressure.png")
