"""A cube is dropped by a millimetre, a thousandth of a radian askew, and comes to rest.

Hard: contact points come and go at the corners of a face that is all but level. A solver of points rattles, or creeps
for as long as one looks. The overlap is a wedge that becomes a sheet of a tenth of a millimetre.
"""

import pybullet as p

STEPS = 300
CONTACT = {"stiffness": 1e7}
SIDE, TILT, DROP = 0.1, 1e-3, 1e-3


def build(client: int):
    p.setGravity(0, 0, -9.81, physicsClientId=client)
    p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE, physicsClientId=client), physicsClientId=client)
    cube = p.createCollisionShape(p.GEOM_BOX, halfExtents=[SIDE / 2] * 3, physicsClientId=client)
    askew = p.getQuaternionFromEuler([TILT, 0, 0])
    p.createMultiBody(1.0, cube, -1, [0, 0, SIDE / 2 + DROP], askew, physicsClientId=client)
