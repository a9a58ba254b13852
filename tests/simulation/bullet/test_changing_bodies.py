"""Bodies that are added, removed or reuse an id, and the marks that tell them apart."""

import gc
import os

import pybullet as p
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from simulated import body, box

from overlapper import Box, HalfSpace, Sphere
from overlapper.simulation import Bodies

# --- marks


def entries(client):
    return [p.getNumUserData(id, client) for id in range(p.getNumBodies(client))]


def test_marks_are_one_per_body_and_go_with_the_last_reader(client):
    box(client), box(client, position=[3, 0, 0])
    first, second = Bodies(client), Bodies(client)
    assert entries(client) == [1, 1]
    del first
    gc.collect()
    box(client, position=[6, 0, 0])
    second.update()
    assert entries(client) == [1, 1, 1]
    with Bodies(client):
        assert entries(client) == [1, 1, 1]
    second.close()
    assert entries(client) == [0, 0, 0]
    with pytest.raises(ValueError, match=f"this Bodies of physicsClientId {client} is closed"):
        second.update()
    assert len(second.keys) == 3
    assert len(Bodies(client).keys) == 3


def test_marks_of_a_client_that_is_gone_do_no_harm(client):
    box(client)
    bodies = Bodies(client)
    p.removeBody(0, physicsClientId=client)
    other = p.connect(p.DIRECT)
    box(other)
    theirs = Bodies(other)
    p.disconnect(other)
    del theirs
    bodies.close()
    bodies.close()
    assert entries(client) == []


def test_closing_outlives_the_server(client, monkeypatch):
    box(client)
    bodies = Bodies(client)

    def gone(*args, **kwargs):
        raise p.error("Not connected to physics server.")

    monkeypatch.setattr(p, "removeUserData", gone)
    bodies.close()
    assert entries(client) == [1]


def test_a_process_that_was_forked_off_leaves_the_marks_to_its_parent(client):
    box(client)
    bodies = Bodies(client)
    child = os.fork()
    if not child:
        bodies.close()
        os._exit(entries(client)[0])
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 1
    bodies.close()
    assert entries(client) == [0]


# --- bodies come and go


@pytest.mark.parametrize("synced", [False, True])  # pybullet then forgets to drop the user data of bodies removed later
@pytest.mark.parametrize("given_user_data", [False, True])
@pytest.mark.parametrize("readers", [1, 2])
def test_a_body_that_takes_over_an_id_is_noticed(client, synced, given_user_data, readers):
    box(client)
    old = box(client, position=[3, 0, 0])
    all_bodies = [Bodies(client) for _ in range(readers)]
    if synced:
        p.syncBodyInfo(client)
    p.removeBody(old, physicsClientId=client)
    assert body(client, p.GEOM_SPHERE, radius=0.3, position=[3, 0, 0]) == old
    if given_user_data:
        p.addUserData(old, "mine", "", physicsClientId=client)
    for bodies in all_bodies:
        bodies.update()
        assert [type(shape) for shape in bodies.shapes] == [Box, Sphere]


def test_user_data_of_others_come_and_go(client):
    ids = [box(client, position=[3 * x, 0, 0]) for x in range(3)]
    theirs = [p.addUserData(id, f"before {k}", "", physicsClientId=client) for id in ids for k in range(id)]
    bodies = Bodies(client)
    shapes = bodies.shapes
    for change in (
        lambda: [p.removeUserData(each, client) for each in theirs],
        lambda: [p.addUserData(id, "after", "", physicsClientId=client) for id in ids],
        lambda: p.syncBodyInfo(client),
        lambda: p.syncUserData(physicsClientId=client),
        lambda: Bodies(client),
    ):
        change()
        bodies.update()
        assert bodies.shapes is shapes  # nothing was read again
    p.removeBody(ids[1], physicsClientId=client)
    bodies.update()
    assert [key[0] for key in bodies.keys] == [ids[0], ids[2]]


def test_a_model_that_is_loaded_again_at_another_scale_is_noticed(client):
    old = p.loadURDF("cube.urdf", globalScaling=0.5, physicsClientId=client)
    bodies = Bodies(client)
    p.removeBody(old, physicsClientId=client)
    assert p.loadURDF("cube.urdf", globalScaling=0.7, physicsClientId=client) == old
    bodies.update()
    assert_allclose([shape.half_extents for shape in bodies.shapes], [[0.35] * 3], rtol=1e-7)


def test_shapes_stay_the_same_objects_while_other_bodies_come_and_go(client):
    first = box(client)
    bodies = Bodies(client)
    (shape,) = bodies.shapes
    second = body(client, p.GEOM_SPHERE, radius=0.3, position=[3, 0, 0])
    bodies.update()
    assert bodies.keys == [(first, -1, 0), (second, -1, 0)]
    assert bodies.shapes[0] is shape
    p.removeBody(second, physicsClientId=client)
    bodies.update()
    assert bodies.keys == [(first, -1, 0)]
    assert bodies.shapes[0] is shape


def test_a_body_that_comes_is_the_only_one_that_is_read(client, monkeypatch):
    for x in range(20):
        box(client, position=[3 * x, 0, 0])
    bodies = Bodies(client)
    asked = []

    def spy(name):
        original = getattr(p, name)
        monkeypatch.setattr(
            p, name, lambda *args, **named: (asked.append((name, args[:1])), original(*args, **named))[1]
        )

    for name in ("getCollisionShapeData", "getVisualShapeData", "getBodyInfo", "addUserData", "syncBodyInfo"):
        spy(name)
    spy("getUserDataInfo"), spy("saveBullet")
    new = box(client, position=[0, 3, 0])
    bodies.update()
    assert len(bodies.keys) == 21
    about = [name for name, _ in asked]
    assert about.count("saveBullet") == 1 and "syncBodyInfo" not in about
    read = ("getCollisionShapeData", "getVisualShapeData", "getBodyInfo", "addUserData")
    assert {(name, body) for name, (body,) in asked if name in read} == {(name, new) for name in read}
    assert about.count("getUserDataInfo") <= 20 + 1
    asked.clear()
    p.removeBody(new, physicsClientId=client)
    bodies.update()
    assert len(bodies.keys) == 20 and "saveBullet" not in [name for name, _ in asked]


def test_a_reset_simulation_is_read_afresh(client):
    box(client), box(client, position=[3, 0, 0])
    bodies = Bodies(client)
    p.resetSimulation(physicsClientId=client)
    bodies.update()
    assert bodies.keys == [] and bodies.positions.shape == (0, 3) and bodies.overlaps() == []
    body(client, p.GEOM_SPHERE, radius=0.3)
    bodies.update()
    assert [type(shape) for shape in bodies.shapes] == [Sphere]


def test_all_bodies_of_a_batch_are_seen(client):
    shape = p.createCollisionShape(p.GEOM_SPHERE, radius=0.1, physicsClientId=client)
    bodies = Bodies(client)
    p.createMultiBody(1, shape, batchPositions=[[x, 0, 0] for x in range(5)], physicsClientId=client)
    bodies.update()
    assert_array_equal(bodies.positions, [[x, 0, 0] for x in range(5)])


def test_restoring_a_state_keeps_the_shapes_and_moves_them(client):
    ball = body(client, p.GEOM_SPHERE, radius=0.1, position=[0, 0, 5])
    bodies = Bodies(client)
    (shape,) = bodies.shapes
    state = p.saveState(physicsClientId=client)
    p.resetBasePositionAndOrientation(ball, [1, 1, 1], [0, 0, 0, 1], physicsClientId=client)
    bodies.update()
    assert bodies.positions.tolist() == [[1, 1, 1]]
    p.restoreState(state, physicsClientId=client)
    bodies.update()
    assert bodies.positions.tolist() == [[0, 0, 5]]
    assert bodies.shapes[0] is shape


def test_bodies_at_the_same_point_are_told_apart_and_keep_their_friction(client):
    plane = body(client, p.GEOM_PLANE, mass=0)
    small, large = box(client, 0.1, mass=0), box(client, 0.2, mass=0)
    (capsule, *_) = p.loadMJCF("mjcf/capsule.xml", physicsClientId=client)
    ball = body(client, p.GEOM_SPHERE, radius=0.3, mass=0, maximal=True)
    p.changeDynamics(large, -1, lateralFriction=0.123456789, physicsClientId=client)
    p.removeBody(small, physicsClientId=client)
    cube = box(client, 0.4, mass=0)  # out of order
    ids = [plane, large, cube, capsule, ball]
    before = [p.getDynamicsInfo(id, -1, client) for id in ids]
    bodies = Bodies(client)
    shapes = {key[0]: shape for key, shape in zip(bodies.keys, bodies.shapes)}
    assert isinstance(shapes[plane], HalfSpace)
    assert shapes[large].half_extents[0] == 0.2 and shapes[cube].half_extents[0] == 0.4
    assert isinstance(shapes[ball], Sphere)
    assert [p.getDynamicsInfo(id, -1, client) for id in ids] == before


def test_bodies_at_different_points_are_only_looked_at(client, monkeypatch):
    p.loadURDF("r2d2.urdf", physicsClientId=client)
    p.setGravity(0, 0, -10, physicsClientId=client)
    for x in range(1, 4):
        box(client, position=[x / 3, 0, 0])
    for _ in range(5):
        p.stepSimulation(client)
    monkeypatch.delattr(p, "changeDynamics")
    assert len(Bodies(client).shapes) == 19


def test_watching_a_simulation_does_not_change_it():
    def heights(watched):
        client = p.connect(p.DIRECT)
        p.setGravity(0, 0, -10, physicsClientId=client)
        body(client, p.GEOM_PLANE, mass=0)
        box(client, mass=0)  # shares the plane's position
        cubes = [box(client, 0.1, position=[0.01 * i, 0.02 * i, 0.7 + 0.25 * i]) for i in range(4)]
        bodies = Bodies(client) if watched else None
        for step in range(60):
            if step == 30:
                cubes.append(box(client, 0.1, position=[0, 0, 2]))
            p.stepSimulation(client)
            if bodies:
                bodies.update()
        poses = [p.getBasePositionAndOrientation(cube, client) for cube in cubes]
        p.disconnect(client)
        return poses

    assert heights(watched=True) == heights(watched=False)
