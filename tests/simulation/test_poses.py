"""Poses of bodies, step by step, and bodies without a finite pose."""

import numpy as np
import pybullet as p
import pytest
from numpy.testing import assert_allclose
from simulated import INERTIAL, ORIENTATION, assert_modelled_as_collided, body, box, random_robot

from overlapper import Hull
from overlapper.simulation import Bodies, SkippedShapeWarning


def test_poses_of_links_are_current_right_after_a_step(client):
    arm = p.loadURDF("kuka_iiwa/model.urdf", useFixedBase=True, physicsClientId=client)
    for joint in range(7):
        p.setJointMotorControl2(arm, joint, p.VELOCITY_CONTROL, targetVelocity=5, force=500, physicsClientId=client)
    bodies = Bodies(client)
    for _ in range(10):
        p.stepSimulation(client)
    stale = p.getLinkState(arm, 6, physicsClientId=client)[0]
    bodies.update()
    assert np.abs(np.subtract(stale, p.getLinkState(arm, 6, physicsClientId=client)[0])).max() > 1e-3
    for link in range(-1, 7):
        assert_modelled_as_collided(client, bodies, arm, link, np.random.default_rng(link + 1), points=2)


def test_poses_of_bases_follow_the_simulation(client):
    p.setGravity(0, 0, -10, physicsClientId=client)
    falling = box(client, position=[0, 0, 5], orientation=ORIENTATION)
    p.resetBaseVelocity(falling, [1, 2, 3], [3, 2, 1], physicsClientId=client)
    bodies = Bodies(client)
    for _ in range(5):
        p.stepSimulation(client)
        bodies.update()
        position, orientation = p.getBasePositionAndOrientation(falling, client)
        assert_allclose(bodies.positions, [position], atol=1e-12)
        assert_allclose(np.abs(bodies.orientations @ orientation), 1, atol=1e-12)


def test_world_poses_are_those_of_matrices(client, tmp_path):
    """The quaternion arithmetic, against pybullet's rotation matrices."""
    random_robot(client, 5, tmp_path)
    bodies = Bodies(client)
    for (id, link, _), shape, position, orientation in zip(
        bodies.keys, bodies.shapes, bodies.positions, bodies.orientations
    ):
        if isinstance(shape, Hull):
            continue
        if link < 0:
            origin, turn = p.getBasePositionAndOrientation(id, client)
        else:
            origin, turn = p.getLinkState(id, link, computeForwardKinematics=1, physicsClientId=client)[:2]
        local = p.getCollisionShapeData(id, link, client)[0]
        rotation, own, ours = (
            np.array(p.getMatrixFromQuaternion(q)).reshape(3, 3) for q in (turn, local[6], orientation)
        )
        assert_allclose(position, rotation @ local[5] + origin, atol=1e-12)
        assert_allclose(ours, rotation @ own, atol=1e-12)


def test_positions_and_orientations_are_read_only_and_stay_as_they_were(client):
    ball = body(client, p.GEOM_SPHERE, radius=0.1)
    bodies = Bodies(client)
    before = bodies.positions
    with pytest.raises(ValueError, match="read-only"):
        before[0] = 1
    p.resetBasePositionAndOrientation(ball, [1, 1, 1], [0, 0, 0, 1], physicsClientId=client)
    bodies.update()
    assert before.tolist() == [[0, 0, 0]]


@pytest.mark.parametrize("pose", [([np.nan] * 3, [0, 0, 0, 1]), ([0, 0, 0], [0, 0, 0, 0])])
def test_a_body_without_a_finite_pose_is_named_once_and_left_out_until_it_has_one(client, pose):
    ids = [box(client, position=[0.9 * x, 0, 0]) for x in range(2)]
    lost = box(client, position=[5, 0, 0])
    bodies = Bodies(client)
    p.resetBasePositionAndOrientation(lost, *pose, physicsClientId=client)
    with pytest.warns(SkippedShapeWarning, match=rf"box#{lost} \(body {lost}, .* no finite pose .* diverged") as told:
        bodies.update()
    assert len(told) == 1 and told[0].filename == __file__
    for _ in range(2):
        bodies.update()  # a second warning would be an error
        assert [(c.bodyA, c.bodyB) for c in bodies.overlaps()] == [(0, 1)]
        assert [key[0] for key in bodies.keys] == ids and [each.body for each in bodies.skipped] == [lost]
        assert bodies.report().shapes == 3 and bodies.report().shapes_read == 2
    p.changeDynamics(ids[0], -1, mass=0, physicsClientId=client)
    p.resetBasePositionAndOrientation(lost, [0, 0, 0.9], [0, 0, 0, 1], physicsClientId=client)
    bodies.update()
    assert len(bodies.overlaps()) == 3 and bodies.skipped == []
    p.resetBasePositionAndOrientation(lost, *pose, physicsClientId=client)
    with pytest.warns(SkippedShapeWarning):
        bodies.update()
    p.removeBody(lost, physicsClientId=client)
    bodies.update()
    assert bodies.skipped == [] and len(bodies.overlaps()) == 1


def test_bodies_are_read_beside_one_that_has_diverged_before(client):
    ids = [box(client, position=[0.9 * x, 0, 0]) for x in range(2)]
    p.resetBasePositionAndOrientation(ids[1], [np.nan] * 3, [0, 0, 0, 1], physicsClientId=client)
    ids.append(box(client, position=[-0.9, 0, 0]))
    with pytest.warns(SkippedShapeWarning, match=rf"box#{ids[1]} \(body {ids[1]}, "):
        bodies = Bodies(client)
    assert [(c.bodyA, c.bodyB) for c in bodies.overlaps()] == [(ids[0], ids[2])]
    assert [key[0] for key in bodies.keys] == [ids[0], ids[2]]


def long_chain(client, folder, position, links=130):
    """A chain that swings, of cubes 0.1 m apart; of more than 128 links pybullet reports no poses."""
    # In lines, as pybullet cuts one that is very long.
    text = ""
    for i in range(links + 1):
        text += f'<link name="l{i}">{INERTIAL.format("0 0 0", "0 0 0")}'
        text += '<collision><geometry><box size=".06 .06 .06"/></geometry></collision></link>\n'
        kind = "continuous" if i % 10 == 1 else "fixed"
        if i:
            text += f'<joint name="j{i}" type="{kind}"><parent link="l{i - 1}"/><child link="l{i}"/>'
            text += '<origin xyz=".1 0 0"/><axis xyz="0 1 0"/></joint>\n'
    (folder / "chain.urdf").write_text(f'<robot name="chain">{text}</robot>')
    return p.loadURDF(str(folder / "chain.urdf"), position, physicsClientId=client)


def test_bodies_whose_poses_pybullet_does_not_tell_are_placed_all_the_same(client, tmp_path):
    p.setGravity(0, 0, -10, physicsClientId=client)
    first = box(client, 0.1, position=[0, -5, 0])
    chains = [long_chain(client, tmp_path, [0, y, 0]) for y in (0, 5)]
    with pytest.raises(p.error):
        p.getBasePositionAndOrientation(chains[0], client)
    bodies = Bodies(client)
    p.removeBody(first, physicsClientId=client)
    assert box(client, 0.2, position=[0, -5, 0]) == first  # and the order of the bodies is another
    for chain in chains:
        p.resetJointState(chain, 0, 0.3 * chain, physicsClientId=client)
    for _ in range(20):
        p.stepSimulation(client)
    bodies.update()
    assert len(bodies.keys) == 1 + 2 * 131
    for chain in chains:
        for link in (-1, 0, 64, 129):
            assert_modelled_as_collided(client, bodies, chain, link, np.random.default_rng(1), points=2)
    p.removeBody(chains[0], physicsClientId=client)
    bodies.update()
    assert_modelled_as_collided(client, bodies, chains[1], 129, np.random.default_rng(1), points=2)


@pytest.mark.parametrize("links", [130, 200])
def test_a_body_of_many_links_costs_one_file_and_one_pass_over_its_frames(client, tmp_path, monkeypatch, links):
    long_chain(client, tmp_path, [0, 0, 0], links)
    bodies, calls = Bodies(client), []
    for module, name in ((p, "saveBullet"), (np.linalg, "eigh"), (p, "getDynamicsInfo")):
        original = getattr(module, name)
        monkeypatch.setattr(
            module, name, lambda *args, call=original, of=name, **named: (calls.append(of), call(*args, **named))[1]
        )
    bodies.update()
    assert sorted(calls) == ["eigh", "getDynamicsInfo", "saveBullet"]
