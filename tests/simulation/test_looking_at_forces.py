"""Forces as read by a user: means over a step, with the bodies at their poses at its end."""

import numpy as np
import pybullet
import pytest
from simulated import box, ground

from overlapper.simulation import Bodies, VolumetricContact

G = 9.81
STEP = 1 / 240


@pytest.fixture
def plane(client):
    pybullet.setGravity(0, 0, -G, physicsClientId=client)
    return ground(client)


def cube_at(client, *position):
    cube = box(client, 0.05, position=position)
    pybullet.changeDynamics(cube, -1, linearDamping=0, physicsClientId=client)
    return cube


@pytest.mark.usefixtures("plane")
@pytest.mark.parametrize("substeps", ["auto", 7])
def test_the_mean_force_is_what_changes_the_momentum_in_a_step(client, substeps):
    cube = cube_at(client, 0, 0, 0.06)
    with VolumetricContact(Bodies(client), stiffness=1e8, substeps=substeps) as contact:
        pressed = 0
        for _ in range(240):
            before = pybullet.getBaseVelocity(cube, physicsClientId=client)[0][2]
            contact.step()
            change = pybullet.getBaseVelocity(cube, physicsClientId=client)[0][2] - before
            if len(mean := contact.mean()):
                pressed += 1
                assert mean.on(cube)[0][2] == pytest.approx(change / STEP + G, rel=1e-9, abs=1e-9)
    assert pressed > 50


@pytest.mark.usefixtures("plane")
def test_forces_are_read_at_the_current_poses(client):
    cubes = [cube_at(client, 0.01 * k, 0, 0.051 + 0.101 * k) for k in range(3)]
    with VolumetricContact(Bodies(client), stiffness=1e8) as contact:
        for _ in range(1000):
            contact.step()
        seen = contact.mean()
    assert seen.force[:, 2] == pytest.approx([-3 * G, -2 * G, -G], rel=1e-4)
    depth = 0.05 - pybullet.getBasePositionAndOrientation(cubes[0], physicsClientId=client)[0][2]
    assert seen.contacts[0].overlap.volume == pytest.approx(depth * 0.01, rel=1e-3)


@pytest.mark.usefixtures("plane")
def test_a_contact_new_in_the_last_substep_has_a_normal_and_no_force(client):
    cube = cube_at(client, 0, 0, 0.05 + 1e-4)
    pybullet.resetBaseVelocity(cube, [0, 0, -0.1], physicsClientId=client)
    with VolumetricContact(Bodies(client), substeps=1) as contact:
        contact.step()
        seen = contact.mean()
    assert len(seen) == 1 and not seen.force.any() and seen.energy[0] > 0
    assert seen.normal == pytest.approx(np.array([[0, 0, -1]])) and seen.directed.all()


@pytest.mark.usefixtures("plane")
def test_a_mean_force_without_direction_is_along_the_last_normal(client):
    rod = cube_at(client, 0, 0, 0.04)
    outer = box(client, 1, mass=0, position=[0, 0, 0.5])
    with VolumetricContact(Bodies(client), pairs=[(outer, rod)]) as contact:
        with pytest.warns(UserWarning, match="without a direction of force"):
            contact.step()
        seen = contact.mean()
    assert not seen.directed.any() and seen.normal == pytest.approx(contact.last.normal) and seen.force.any()


@pytest.mark.usefixtures("plane")
@pytest.mark.parametrize("substeps", ["auto", 4])
def test_reading_forces_changes_no_bit_of_later_steps(client, substeps):
    ends = []
    cube = cube_at(client, 0, 0, 0)
    for look in (False, True):
        pybullet.resetBasePositionAndOrientation(cube, [0, 0, 0.06], [0.1, 0, 0, 1], physicsClientId=client)
        pybullet.resetBaseVelocity(cube, [0, 0, 0], [0, 0, 0], physicsClientId=client)
        with VolumetricContact(Bodies(client), substeps=substeps) as contact:
            for _ in range(60):
                contact.step()
                if look:
                    contact.mean()
        ends.append(pybullet.getBasePositionAndOrientation(cube, physicsClientId=client))
    assert ends[0] == ends[1]


@pytest.mark.usefixtures("plane")
def test_a_body_that_loses_its_place_is_left_out_and_the_others_go_on(client):
    stays, goes = cube_at(client, 0, 0, 0.0499), cube_at(client, 1, 0, 0.0499)
    with VolumetricContact(Bodies(client), substeps=3) as contact:
        contact.step()
        pybullet.applyExternalForce(goes, -1, [float("nan"), 0, 0], [1, 0, 0], pybullet.WORLD_FRAME, client)
        with pytest.warns(UserWarning, match="has no finite pose"):
            contact.step()
        for _ in range(480):
            contact.step()
    assert contact.pairs[:, 3].tolist() == [stays]
    assert contact.on(stays)[0][2] == pytest.approx(G)


def test_a_contact_without_pressure_is_listed(client):
    contact = VolumetricContact(Bodies(client))
    assert contact and len(contact) == 0
