"""Buoyancy: a crate dropped askew into water comes to rest with its density's share of its height under water.

The water is a half-space. Its overlap with the crate gives the submerged volume, and where the buoyant force acts.
"""

import pybullet as p

from overlapper import Box, HalfSpace, Placed, overlap

WATER, GRAVITY = 1000.0, 9.81  # kg/m³, m/s²
HALF_EXTENTS, DENSITY = [0.5, 0.4, 0.2], 600.0

water = HalfSpace(normal=(0, 0, 1), offset=0.0)  # all below z = 0
crate = Box(HALF_EXTENTS)
p.connect(p.DIRECT)
p.setGravity(0, 0, -GRAVITY)
shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=HALF_EXTENTS)
body = p.createMultiBody(DENSITY * crate.volume, shape, -1, [0, 0, 0.5], p.getQuaternionFromEuler([0.4, 0.2, 0]))
p.changeDynamics(body, -1, linearDamping=0.9, angularDamping=0.9)

for step in range(240 * 20 + 1):
    under = overlap(Placed(crate, *p.getBasePositionAndOrientation(body)), water)
    if step % 960 == 0:
        print(f"{step / 240:4.1f} s: {under.volume:.4f} m³ under water, {under.volume / crate.volume:.2%} of the crate")
    if under:
        p.applyExternalForce(body, -1, [0, 0, WATER * GRAVITY * under.volume], under.centroid, p.WORLD_FRAME)
    p.stepSimulation()

print(f"draught {under.depth:.4f} m, by Archimedes {DENSITY / WATER * 2 * HALF_EXTENTS[2]:.4f} m")
