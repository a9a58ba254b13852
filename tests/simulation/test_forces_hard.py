"""Hard cases of volumetric contact: light, fast or stiff bodies, and scripts that change a simulation between steps."""

import warnings

import numpy as np
import pybullet
import pybullet_data
import pytest
from simulated import body, box, ground, jointed

from overlapper.simulation import Bodies, Recorder, VolumetricContact

G = 9.81


def _box(client, position, mass=1.0, half=0.05, velocity=(0, 0, 0)):
    id = box(client, half, mass=mass, position=position)
    pybullet.changeDynamics(id, -1, linearDamping=0, angularDamping=0, physicsClientId=client)
    pybullet.resetBaseVelocity(id, velocity, physicsClientId=client)
    return id


def _speed(client, body):
    return np.array(pybullet.getBaseVelocity(body, physicsClientId=client)[0])


@pytest.mark.parametrize("phase", [0, 0.35, 0.65, 0.95])
@pytest.mark.parametrize(("mass", "half", "stiffness"), [(0.1, 0.05, 1e7), (0.01, 0.05, 1e7), (1, 0.05, 1e9)])
def test_light_or_stiff_bodies_bounce_no_faster_than_they_fell(client, mass, half, stiffness, phase):
    ground(client)
    box = _box(client, [0, 0, half + (1 + phase) / 240], mass, half, velocity=[0, 0, -1])
    with VolumetricContact(Bodies(client), stiffness=stiffness) as contact:
        for _ in range(30):
            contact.step()
    assert 0 <= _speed(client, box)[2] < 0.6


@pytest.mark.parametrize("phase", [0, 0.25, 0.5, 0.75])
@pytest.mark.parametrize("speed", [3, 5, 20])
def test_fast_small_bodies_bounce_no_faster_than_they_fell(client, speed, phase):
    ground(client)
    box = _box(client, [0, 0, 0.005 + (1 + phase) * speed / 240], 1e-3, 0.005, velocity=[0, 0, -speed])
    with VolumetricContact(Bodies(client), stiffness=1e8) as contact:
        for _ in range(30):
            contact.step()
    assert 0 <= _speed(client, box)[2] < 0.6 * speed


@pytest.mark.parametrize("tilt", [0.03, 0.1, 0.2])
def test_an_edge_that_comes_down_to_a_face_gains_no_energy(client, tilt):
    pybullet.setGravity(0, 0, -G, physicsClientId=client)
    ground(client)
    box = _box(client, [0, 0, 0.06], mass=0.01)
    turned = pybullet.getQuaternionFromEuler([tilt, 0, 0])
    pybullet.resetBasePositionAndOrientation(box, [0, 0, 0.06], turned, physicsClientId=client)
    inertia, highest = 0.01 * 0.1**2 / 6, 0.0
    with VolumetricContact(Bodies(client), friction=0, dissipation=0) as contact:
        for _ in range(120):
            contact.step()
            velocity, spin = np.array(pybullet.getBaseVelocity(box, physicsClientId=client))
            height = pybullet.getBasePositionAndOrientation(box, physicsClientId=client)[0][2]
            highest = max(highest, 0.01 * (velocity @ velocity / 2 + G * height) + inertia * spin @ spin / 2)
    assert highest < 1.02 * 0.01 * G * 0.06


def test_a_body_placed_in_contact_stays_there(client):
    pybullet.setGravity(0, 0, -G, physicsClientId=client)
    ground(client)
    box = _box(client, [0, 0, 0.05], mass=0.01)
    highest = 0.0
    with VolumetricContact(Bodies(client)) as contact:
        for _ in range(240):
            contact.step()
            highest = max(highest, pybullet.getBasePositionAndOrientation(box, physicsClientId=client)[0][2])
    assert highest <= 0.05 and np.abs(_speed(client, box)).max() < 1e-9


def test_a_swinging_pole_is_detected_before_it_hits(client):
    """The end of the link is fast. Its speed follows from the velocity of the joint."""
    ground(client)
    shape = pybullet.createCollisionShape(
        *(pybullet.GEOM_BOX, 0, [0.5, 0.02, 0.02]), collisionFramePosition=[0.5, 0, 0], physicsClientId=client
    )
    turning = pybullet.JOINT_REVOLUTE
    pole = jointed(
        *(client, turning, shape, [[0, 1, 0]], [[0, 0, 0]]), mass=0.05, base=(0, -1, [0, 0, 0.025]), centre=[0.5, 0, 0]
    )
    pybullet.changeDynamics(pole, 0, linearDamping=0, angularDamping=0, jointDamping=0, physicsClientId=client)
    pybullet.setJointMotorControl2(pole, 0, pybullet.VELOCITY_CONTROL, force=0, physicsClientId=client)
    pybullet.resetJointState(pole, 0, -0.1, 3.0, physicsClientId=client)
    fastest = 0.0
    with VolumetricContact(Bodies(client)) as contact:
        for _ in range(40):
            contact.step()
            fastest = min(fastest, pybullet.getJointState(pole, 0, physicsClientId=client)[1])
    assert -2.5 < fastest < 0


def test_bodies_without_mass_slip_without_a_response(client):
    """Neither body has a mass. One moves at a given velocity, and friction cannot end its slip."""
    plane, box = ground(client), _box(client, [0, 0, 0.049], mass=0, velocity=[0.1, 0, 0])
    with VolumetricContact(Bodies(client), pairs=[(plane, box)], stiffness=1e7) as contact:
        contact.step()
    pressing = 1e7 * 0.01 * 1e-3
    assert contact.force[0] == pytest.approx([0.25 * pressing, 0, -pressing], rel=1e-9)
    assert contact.slip[0] == pytest.approx([-0.1, 0, 0], abs=1e-12) and np.isfinite(contact.torque).all()


@pytest.mark.filterwarnings("ignore::overlapper.simulation.cautions.SubstepsWarning")
@pytest.mark.parametrize("seed", range(8))
def test_fast_turning_bodies_are_pushed_wherever_pressure_is_positive(client, seed):
    """Torques that the patch cannot give take no force away. Without a force, velocities stay as they are."""
    stiffness, tau, pushed = 1e8, 1e-3, 0
    random = np.random.default_rng(seed)
    ground(client)
    boxes = [_box(client, [0.5 * k, 0, 0.0497], mass=0.25) for k in range(20)]
    for each in boxes:
        tilt = [*(0.01 * random.normal(size=3)), 1]
        at = pybullet.getBasePositionAndOrientation(each, physicsClientId=client)[0]
        pybullet.resetBasePositionAndOrientation(each, at, tilt, physicsClientId=client)
        spin = 10 * random.normal(size=3)
        pybullet.resetBaseVelocity(each, [0, 0, random.uniform(-0.1, 0.1)], spin, physicsClientId=client)
    before = {each: np.ravel(pybullet.getBaseVelocity(each, physicsClientId=client)) for each in boxes}
    with VolumetricContact(Bodies(client), stiffness=stiffness, dissipation=tau, substeps=1) as contact:
        contact.step()
    for row, (_, _, _, pressed, _, _) in enumerate(contact.pairs.tolist()):
        shared = contact.contacts.overlaps
        growing = shared.gradient[row, 1] @ before[pressed]
        pressures = stiffness * (shared.volume[row] + (1 / 240 + tau) * growing)
        assert (contact.force[row, 2] < 0) == (pressures > 0)
        pushed += pressures > 0
    assert 0 < pushed < len(boxes)


def _rests(client, box, contact):
    """Whether volumes alone carry it."""
    for _ in range(240):
        contact.step()
    height = pybullet.getBasePositionAndOrientation(box, physicsClientId=client)[0][2]
    return height == pytest.approx(0.05 - G / 1e5, abs=1e-9) and not pybullet.getContactPoints(physicsClientId=client)


def test_bullet_does_not_respond_either_once_a_body_gets_a_mass(client):
    pybullet.setGravity(0, 0, -G, physicsClientId=client)
    ground(client)
    box = _box(client, [0, 0, 0.05], mass=0)
    with VolumetricContact(Bodies(client), stiffness=1e7) as contact:
        contact.step()
        pybullet.changeDynamics(box, -1, mass=1, physicsClientId=client)
        assert _rests(client, box, contact)


def test_bullet_does_not_respond_either_to_pairs_that_a_script_lets_collide(client):
    pybullet.setGravity(0, 0, -G, physicsClientId=client)
    with Recorder(client) as recorder:
        plane, box = ground(client), _box(client, [0, 0, 0.05])
        pybullet.setCollisionFilterGroupMask(plane, -1, 1, 1, physicsClientId=client)
        pybullet.setCollisionFilterGroupMask(box, -1, 2, 2, physicsClientId=client)
        with VolumetricContact(Bodies(client, recorder=recorder), stiffness=1e7) as contact:
            pybullet.setCollisionFilterGroupMask(box, -1, 1, 1, physicsClientId=client)
            assert _rests(client, box, contact)
            pybullet.setCollisionFilterPair(plane, box, -1, -1, 0, physicsClientId=client)
            contact.step()
            pybullet.setCollisionFilterPair(plane, box, -1, -1, 1, physicsClientId=client)
            assert _rests(client, box, contact)


def test_a_client_is_within_one_contact_at_a_time(client):
    ground(client)
    bodies = Bodies(client)
    told = f"^physicsClientId {client} already has an active VolumetricContact: leave its `with` block first$"
    with VolumetricContact(bodies), pytest.raises(RuntimeError, match=told), VolumetricContact(bodies):
        pass
    with VolumetricContact(bodies) as contact:
        contact.step()


def test_a_restored_state_forgets_everything_that_came_after_it(client):
    pybullet.setGravity(0, 0, -G, physicsClientId=client)
    ground(client)
    box, ways = _box(client, [0, 0, 0.05 - G / 1e5]), []
    with VolumetricContact(Bodies(client), stiffness=1e7) as contact:
        for _ in range(20):
            contact.step()
        state = pybullet.saveState(client)
        for push in (0, 3000):
            pybullet.restoreState(state, physicsClientId=client)
            pybullet.applyExternalForce(
                box, -1, [push, 0, push], [0, 0, 0], pybullet.LINK_FRAME, physicsClientId=client
            )
            contact.step()
            pybullet.restoreState(state, physicsClientId=client)
            for _ in range(5):
                contact.step()
            ways.append(pybullet.getBasePositionAndOrientation(box, physicsClientId=client))
    assert ways[0] == ways[1]
    assert np.abs(_speed(client, box)).max() < 1e-9


def test_forces_are_settled_from_a_first_guess_that_is_far_too_large(client):
    """Stiffness times volume would throw the tip of the arm at 9e5 m/s. The residual is over slips of the solution."""
    ground(client)
    path = f"{pybullet_data.getDataPath()}/kuka_iiwa/model.urdf"
    arm = pybullet.loadURDF(path, useFixedBase=True, physicsClientId=client)
    for joint, angle in enumerate([0.1, 1.9, 0.05, -0.1, 0.02, 0.3, 0]):
        pybullet.resetJointState(arm, joint, angle, 0.1, physicsClientId=client)
    contact = VolumetricContact(Bodies(client), substeps=1)
    first, second = contact.forces(), contact.forces()
    assert first.residual <= 1e-8 and np.abs(first.force).max() > 100
    np.testing.assert_allclose(first.force, second.force, atol=1e-5 * np.abs(second.force).max())


def test_forces_are_settled_after_a_first_sweep_that_throws_a_body(client):
    """The first forces on the lower box still know an upper box that is pressed too hard."""
    pybullet.setGravity(0, 0, -G, physicsClientId=client)
    ground(client)
    _box(client, [0, 0, 0.0999], half=0.1)
    _box(client, [0.02, 0, 0.2495], mass=0.3)
    contact = VolumetricContact(Bodies(client), substeps=1)
    forces = [contact.forces() for _ in range(2)]
    for found in forces:
        assert found.residual <= 1e-8
    np.testing.assert_allclose(forces[0].force, forces[1].force, atol=1e-5 * np.abs(forces[1].force).max())


@pytest.mark.parametrize("stiffness", [1e7, 1e9])
def test_bodies_squeezed_at_rest_without_gravity_are_settled_to_rounding(client, stiffness):
    """No slip is left, so that slips are rounding of what the forces do alone."""
    for x in (-0.0999, 0.5999):
        box(client, 0.05, mass=0, position=[x, 0, 0])
    for k in range(6):
        _box(client, [0.0999 * k, 0, 0])
    with VolumetricContact(Bodies(client), stiffness=stiffness) as contact:
        for _ in range(240):
            contact.step()
            assert contact.residual <= 1e-8 and contact.sweeps < 100


@pytest.mark.parametrize("substeps", ["auto", 4, 16])
@pytest.mark.parametrize("depth", [0.0, 0.05, 0.09])
def test_a_swallowed_body_leaves_no_faster_than_by_its_size_in_the_time_of_recovery(client, substeps, depth):
    """A ball within a box. As it comes out, its overlap is deep and the area of its patch is small."""
    box(client, 0.1, mass=0, position=[0, 0, 0])
    ball = body(client, pybullet.GEOM_SPHERE, radius=0.05, mass=0.2, position=[0.02, 0.01, depth])
    size = (4 / 3 * np.pi) ** (1 / 3) * 0.05
    with warnings.catch_warnings(), VolumetricContact(Bodies(client), substeps=substeps) as contact:
        warnings.simplefilter("ignore")
        for _ in range(60):
            contact.step()
            assert np.linalg.norm(_speed(client, ball)) < 1.01 * size / 0.02
    assert not len(contact)


def _tumbling(client):
    pybullet.setGravity(0, 0, -G, physicsClientId=client)
    ground(client)
    boxes = [_box(client, [0.02 * k, 0.01 * k, 0.07 + 0.11 * k]) for k in range(3)]
    for k, id in enumerate(boxes):
        pybullet.resetBaseVelocity(id, [0.3, 0.1 * k, 0], [k, 2, 1], physicsClientId=client)
    return boxes


def _way(client, boxes, contact, steps=12):
    for _ in range(steps):
        contact.step()
    return [(pybullet.getBasePositionAndOrientation(id, client), pybullet.getBaseVelocity(id, client)) for id in boxes]


def test_a_restored_state_goes_on_by_the_path_that_it_left_to_the_last_bit(client):
    boxes = _tumbling(client)
    with VolumetricContact(Bodies(client)) as contact:
        _way(client, boxes, contact)
        first = pybullet.saveState(physicsClientId=client)
        left = _way(client, boxes, contact)
        second = pybullet.saveState(client)
        later = _way(client, boxes, contact)
        assert len(contact)
        for state, expected in ((first, left), (second, later), (first, left)):
            pybullet.restoreState(state, physicsClientId=client)
            assert _way(client, boxes, contact) == expected
        # A state that is saved right after another one was restored knows what that one knew.
        pybullet.restoreState(second, physicsClientId=client)
        third = pybullet.saveState(client)
        _way(client, boxes, contact, steps=3)
        pybullet.restoreState(third, physicsClientId=client)
        assert _way(client, boxes, contact) == later


def test_forces_begin_anew_where_a_restored_state_has_other_masses_or_was_removed_or_comes_from_a_file(
    client, tmp_path
):
    boxes, file = _tumbling(client), str(tmp_path / "state.bullet")
    with VolumetricContact(Bodies(client)) as contact:
        _way(client, boxes, contact, steps=24)
        state = pybullet.saveState(client)
        pybullet.saveBullet(file, client)
        left = _way(client, boxes, contact)
        for _ in range(2):
            pybullet.restoreState(fileName=file, physicsClientId=client)
            anew = _way(client, boxes, contact)
            assert anew != left
            np.testing.assert_allclose(anew[0][0][0], left[0][0][0], atol=1e-3)
        pybullet.changeDynamics(boxes[0], -1, mass=3, physicsClientId=client)
        pybullet.restoreState(state, physicsClientId=client)
        heavy = _way(client, boxes, contact)
        pybullet.restoreState(state, physicsClientId=client)
        assert _way(client, boxes, contact) == heavy
        pybullet.removeState(state, client)
        assert _way(client, boxes, contact) != heavy
