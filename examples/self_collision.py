"""Which poses of an arm are free of self-collision, of links that are no neighbours, and what pybullet says of it."""

from itertools import combinations

import numpy as np
import pybullet as p
import pybullet_data

from overlapper.simulation import Bodies

p.connect(p.DIRECT)
arm = p.loadURDF(f"{pybullet_data.getDataPath()}/kuka_iiwa/model.urdf", useFixedBase=True)
pairs = [((arm, a), (arm, b)) for a, b in combinations(range(-1, 7), 2) if b > a + 1]
bodies = Bodies(surface="margin")  # as Bullet collides with them; "nominal" leaves its margins of 1 mm out
random, limits = np.random.default_rng(1), [p.getJointInfo(arm, joint)[8:10] for joint in range(7)]
free, same, deepest = 0, 0, (0.0, "", "")
for _ in range(100):
    for joint, (low, high) in enumerate(limits):
        p.resetJointState(arm, joint, random.uniform(low, high))
    bodies.update()
    found = [contact for contact in bodies.overlaps(pairs=pairs) if contact.overlap]
    for contact in found:
        links = bodies.names[arm, contact.linkA], bodies.names[arm, contact.linkB]
        deepest = max(deepest, (contact.overlap.depth, *links))
    met = {(contact.linkA, contact.linkB) for contact in found}
    same += met == {(a, b) for (_, a), (_, b) in pairs if p.getClosestPoints(arm, arm, 0.0, a, b)}
    free += not found
print(f"{free} of 100 poses are free, and pybullet says the same of {same}")
print(f"deepest: {deepest[1]} and {deepest[2]}, {1e3 * deepest[0]:.1f} mm")
