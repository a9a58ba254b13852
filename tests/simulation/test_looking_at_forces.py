"""The forces of bodies as they are now, seen without any change to what comes."""

import pybullet
import pytest

from overlapper.simulation import Bodies, VolumetricContact


def dropped(client, steps, look, **arguments):
    """Three boxes that fall on each other: where they are in the end, and the last forces seen."""
    pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
    plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    pybullet.createMultiBody(0, plane, physicsClientId=client)
    box = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[0.05] * 3, physicsClientId=client)
    for k in range(3):
        pybullet.createMultiBody(1, box, -1, [0.01 * k, 0, 0.051 + 0.101 * k], physicsClientId=client)
    seen = None
    with VolumetricContact(Bodies(client), **arguments) as contact:
        for _ in range(steps):
            contact.step()
            before = contact.last
            if look:
                seen = contact.look()
                assert contact.last is before
        where = [pybullet.getBasePositionAndOrientation(body, physicsClientId=client) for body in (1, 2, 3)]
    pybullet.resetSimulation(physicsClientId=client)
    return where, seen


@pytest.mark.parametrize("substeps", ["auto", 4])
def test_steps_go_on_to_the_last_bit_as_if_nobody_had_looked(client, substeps):
    assert dropped(client, 60, True, substeps=substeps)[0] == dropped(client, 60, False, substeps=substeps)[0]


def test_what_is_seen_is_of_the_bodies_where_they_are(client):
    where, seen = dropped(client, 1000, True, stiffness=1e8)
    assert seen.force[:, 2] == pytest.approx([-3 * 9.81, -2 * 9.81, -9.81], rel=1e-4)
    depth = 0.05 - where[0][0][2]
    assert seen.contacts[0].overlap.volume == pytest.approx(depth * 0.01, rel=1e-3)


def test_a_contact_in_which_nothing_presses_is_there_all_the_same(client):
    contact = VolumetricContact(Bodies(client))
    assert contact and len(contact) == 0
