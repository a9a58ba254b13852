"""The text of a scene of three cubes, for commands that run it in a process of their own."""

SCENE = '''
"""Two cubes on a third."""
import pybullet as p
STEPS = 20


def build(client):
    p.setGravity(0, 0, -9.8, physicsClientId=client)
    cube = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05] * 3, physicsClientId=client)
    for x, z in ((0, 0), (0.02, 0.099), (0.1, 0.098)):
        p.createMultiBody(z and 1, cube, basePosition=[x, 0, z], physicsClientId=client)
'''
