"""Volumetric contact: forces from overlaps, in place of Bullet's contact points."""

import numpy as np
import pybullet
import pytest

from overlapper.simulation import Bodies, VolumetricContact

G = 9.81


@pytest.mark.parametrize("stiffness", [1e7, 1e8, 1e9])
def test_a_tilted_cube_comes_to_rest_as_deep_as_its_weight_asks(client, stiffness):
    pybullet.setGravity(0, 0, -G, physicsClientId=client)
    plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    pybullet.createMultiBody(0, plane, physicsClientId=client)
    box = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[0.05] * 3, physicsClientId=client)
    tilted = pybullet.getQuaternionFromEuler([1e-3, 0, 0])
    cube = pybullet.createMultiBody(1, box, -1, [0, 0, 0.051], tilted, physicsClientId=client)
    with VolumetricContact(Bodies(client), stiffness=stiffness) as contact:
        for _ in range(3 * 240):
            contact.step()
    height = pybullet.getBasePositionAndOrientation(cube, physicsClientId=client)[0][2]
    assert (0.05 - height) / (G / (stiffness * 0.01)) == pytest.approx(1, abs=1e-6)
    assert np.abs(pybullet.getBaseVelocity(cube, physicsClientId=client)).max() < 1e-9
    assert contact.on(cube)[0] == pytest.approx([0, 0, G], abs=1e-9)


@pytest.mark.parametrize("stiffness", [1e7, 1e8, 1e9])
@pytest.mark.parametrize("drop", [0.01, 0.1, 0.5])
def test_a_falling_body_bounces_back_to_about_the_same_height(client, stiffness, drop):
    """Steps are short before what comes is there: in a long one it would come in deeper than its speed can take it."""
    pybullet.setGravity(0, 0, -G, physicsClientId=client)
    plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    pybullet.createMultiBody(0, plane, physicsClientId=client)
    box = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[0.05] * 3, physicsClientId=client)
    cube = pybullet.createMultiBody(1, box, physicsClientId=client)
    pybullet.changeDynamics(cube, -1, linearDamping=0, physicsClientId=client)
    contact = VolumetricContact(Bodies(client), stiffness=stiffness, dissipation=0)
    for phase in range(4):
        height = drop * (1 + 0.02 * phase)
        pybullet.resetBasePositionAndOrientation(cube, [0, 0, 0.05 + height], [0, 0, 0, 1], physicsClientId=client)
        pybullet.resetBaseVelocity(cube, [0, 0, 0], [0, 0, 0], physicsClientId=client)
        rising = []
        with contact:
            while not rising or rising[-1][1] > 0:
                contact.step()
                speed = pybullet.getBaseVelocity(cube, physicsClientId=client)[0][2]
                above = pybullet.getBasePositionAndOrientation(cube, physicsClientId=client)[0][2] - 0.05
                if speed > 0 and not len(contact):
                    rising.append((above + speed**2 / (2 * G), speed))
                elif rising:
                    break
        assert 0.75 * height < rising[-1][0] < 1.15 * height
