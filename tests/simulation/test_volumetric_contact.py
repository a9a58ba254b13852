"""Volumetric contact: forces from overlaps, in place of Bullet's contact points."""

import warnings

import numpy as np
import pybullet
import pytest
from simulated import body, box, ground

from overlapper.simulation import Bodies, VolumetricContact

G = 9.81


@pytest.mark.parametrize("stiffness", [1e7, 1e8, 1e9])
def test_a_tilted_cube_comes_to_rest_as_deep_as_its_weight_asks(client, stiffness):
    pybullet.setGravity(0, 0, -G, physicsClientId=client)
    ground(client)
    cube = box(client, 0.05, position=[0, 0, 0.051], orientation=pybullet.getQuaternionFromEuler([1e-3, 0, 0]))
    with VolumetricContact(Bodies(client), stiffness=stiffness) as contact:
        for _ in range(3 * 240):
            contact.step()
    height = pybullet.getBasePositionAndOrientation(cube, physicsClientId=client)[0][2]
    assert (0.05 - height) / (G / (stiffness * 0.01)) == pytest.approx(1, abs=1e-6)
    assert np.abs(pybullet.getBaseVelocity(cube, physicsClientId=client)).max() < 1e-9
    assert contact.on(cube)[0] == pytest.approx([0, 0, G], abs=1e-7)


def test_a_cube_that_rocks_on_its_face_comes_to_rest_in_whole_steps(client):
    """The centroid of its volume goes to and fro faster than the cube. It must not pass for a rolling contact."""
    pybullet.setGravity(0, 0, -G, physicsClientId=client)
    ground(client)
    cube = box(client, 0.05, position=[0, 0, 0.051], orientation=pybullet.getQuaternionFromEuler([1e-3, 0, 0]))
    with VolumetricContact(Bodies(client), stiffness=1e8, substeps=1) as contact:
        for _ in range(240):
            contact.step()
    assert np.abs(pybullet.getBaseVelocity(cube, physicsClientId=client)).max() < 1e-7


@pytest.mark.parametrize("stiffness", [1e7, 1e8, 1e9])
@pytest.mark.parametrize("drop", [0.01, 0.1, 0.5])
def test_a_falling_body_bounces_back_to_about_the_same_height(client, stiffness, drop):
    """Steps are short before what comes is there: in a long one it would come in deeper than its speed can take it."""
    pybullet.setGravity(0, 0, -G, physicsClientId=client)
    ground(client)
    cube = box(client, 0.05)
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


@pytest.mark.parametrize("speed", [np.nan, 1e200])
@pytest.mark.parametrize("substeps", ["auto", 3])
def test_a_body_without_a_finite_velocity_has_no_contacts_and_the_others_go_on(client, speed, substeps):
    """There are two stacks of a cube on a slab. The cube of the second is lost, and the first goes on."""
    heights = []
    for lost in (False, True):
        pybullet.resetSimulation(physicsClientId=client)
        pybullet.setGravity(0, 0, -G, physicsClientId=client)
        for x in (0, 1):
            body(client, pybullet.GEOM_BOX, halfExtents=[0.1, 0.1, 0.05], mass=0, position=[x, 0, 0])
            box(client, 0.05, position=[x, 0, 0.0999])
        contact = VolumetricContact(Bodies(client), substeps=substeps)
        with contact, warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            for step in range(6):
                if lost and step == 2:
                    pybullet.resetBaseVelocity(3, [speed] * 3, physicsClientId=client)
                contact.step()
        heights.append(pybullet.getBasePositionAndOrientation(1, physicsClientId=client)[0])
        pairs = contact.pairs[:, [0, 3]].tolist()
        if lost:
            words = [str(each.message) for each in told]
            assert len(words) == 2 and words[0].startswith(
                "box 0.1 m#3 (body 3, link -1) has no contacts, because its velocity is not finite"
            )
            assert words[1].startswith("box 0.1 m#3 (body 3, link -1) is left out")
            assert pairs == [[0, 1]] and contact.on(3)[0].tolist() == [0, 0, 0]
            assert [each.body for each in contact.bodies.skipped if each.diverged] == [3]
        else:
            assert pairs == [[0, 1], [2, 3]] and not told
    assert heights[0] == pytest.approx(heights[1], abs=1e-6)


def test_the_force_on_what_is_not_there_is_refused(client):
    for x in (0, 0.5):
        box(client, 0.05, position=[x, 0, 0])
    contact = VolumetricContact(Bodies(client))
    with contact:
        contact.step()
    assert contact.on(1)[0].tolist() == contact.on(1, -1)[1].tolist() == [0, 0, 0]
    for asked, sentence in (
        ((99,), "there is no body 99 in the simulation"),
        ((-5,), "there is no body -5 in the simulation"),
        ((0, 7), "body 0 has no link 7"),
    ):
        with pytest.raises(ValueError, match=f"^{sentence}$"):
            contact.on(*asked)
