"""The reader of .bullet files finds the shapes that pybullet was given."""

import re
import struct

import numpy as np
import pybullet as p
import pybullet_data
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from simulated import CUBE, ORIENTATION, POSITION, body

from overlapper.simulation.bullet import bullet_file
from overlapper.simulation.bullet.bullet_file import BulletFile

SINGLE = 1e-6  # of what the file keeps in single precision


@pytest.fixture
def saved(client, tmp_path):
    def save():
        p.saveBullet(str(tmp_path / "scene.bullet"), physicsClientId=client)
        return BulletFile(tmp_path / "scene.bullet")

    return save


def base_leaves(file, index=0):
    return file.leaves(file.bodies[index].colliders[-1].shape)


@pytest.mark.parametrize(
    ("geometry", "figures", "kind", "expected"),
    [
        (p.GEOM_BOX, {"halfExtents": [0.1, 0.2, 0.3]}, "box", [0.1, 0.2, 0.3]),
        (p.GEOM_SPHERE, {"radius": 0.25}, "sphere", [0.25]),
        (p.GEOM_CAPSULE, {"radius": 0.25, "height": 0.7}, "capsule", [0.25, 0.7]),
        (p.GEOM_CYLINDER, {"radius": 0.25, "height": 0.7}, "cylinder", [0.25, 0.7]),
        (p.GEOM_PLANE, {"planeNormal": [0, 3, 4]}, "plane", [0, 0.6, 0.8, 0]),
    ],
)
def test_primitives_keep_their_figures_and_frame(client, saved, geometry, figures, kind, expected):
    frame = {"collisionFramePosition": POSITION, "collisionFrameOrientation": ORIENTATION}
    body(client, geometry, **figures)
    body(client, geometry, **figures, **frame)
    plain, offset = (base_leaves(saved(), index)[0] for index in (0, 1))
    assert plain.kind == offset.kind == kind
    for leaf in (plain, offset):
        assert_allclose(leaf.figures, expected, atol=SINGLE)
    assert_array_equal(plain.position, 0)
    assert abs(plain.orientation[3]) == 1
    assert_allclose(offset.position, POSITION, atol=SINGLE)
    assert abs(offset.orientation @ ORIENTATION) == pytest.approx(1, abs=SINGLE)


def test_every_half_turn_of_a_frame_is_found(client, saved):
    """A half turn has w = 0, where formulas that divide by w break down."""
    turns = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0.6, 0, 0.8, 0]]
    for turn in turns:
        body(client, p.GEOM_SPHERE, radius=1, collisionFrameOrientation=turn)
    file = saved()
    found = [base_leaves(file, index)[0].orientation for index in range(len(turns))]
    assert_allclose(np.abs(np.sum(np.array(found) * turns, axis=1)), 1, atol=SINGLE)


def test_hull_points_are_those_of_get_mesh_data_to_the_bit(client, saved):
    points = np.random.default_rng(1).normal(size=(50, 3))
    id = body(client, p.GEOM_MESH, vertices=points.tolist(), meshScale=[1, 2, 3])
    (leaf,) = base_leaves(saved())
    assert leaf.kind == "hull"
    assert_array_equal(leaf.figures, p.getMeshData(id, -1, physicsClientId=client)[1])


def test_every_object_of_an_obj_file_is_a_leaf(client, saved, tmp_path):
    corners = "".join(f"v {x} {y} {z}\n" for x, y, z in CUBE)
    away = "".join(f"v {x + 2} {y} {z}\n" for x, y, z in CUBE)
    faces = "".join(
        f"f {a} {b} {c}\n" for a, b, c in [(1, 2, 3), (2, 3, 4), (5, 6, 7), (6, 7, 8), (1, 2, 5), (3, 4, 8)]
    )
    far_faces = "".join(f"f {a} {b} {c}\n" for a, b, c in [(9, 10, 11), (10, 11, 12), (13, 14, 15), (14, 15, 16)])
    (tmp_path / "two.obj").write_text(f"o near\n{corners}{faces}o far\n{away}{far_faces}")
    body(client, p.GEOM_MESH, fileName=str(tmp_path / "two.obj"))
    near, far = base_leaves(saved())
    assert_allclose(far.figures.mean(axis=0) - near.figures.mean(axis=0), [2, 0, 0], atol=1e-3)


def test_a_height_field_has_a_kind_and_no_figures(client, saved):
    figures = {"heightfieldData": [0.0] * 63 + [1.0], "numHeightfieldRows": 8, "numHeightfieldColumns": 8}
    body(client, p.GEOM_HEIGHTFIELD, meshScale=[1, 1, 1], **figures)
    (leaf,) = base_leaves(saved())
    assert leaf.kind == "height field" and leaf.figures.size == 0


@pytest.mark.parametrize("scale", [[1, 2, 3], [-1, 0.1, 100]])
def test_a_concave_mesh_keeps_its_triangles_to_the_bit(client, saved, scale):
    indices = [0, 1, 2, 1, 2, 3, 4, 5, 6]
    corners = CUBE + np.random.default_rng(1).normal(size=CUBE.shape)
    frame = {"collisionFramePosition": POSITION, "collisionFrameOrientation": ORIENTATION}
    body(client, p.GEOM_MESH, vertices=corners.tolist(), indices=indices, meshScale=scale, **frame)
    (leaf,) = base_leaves(saved())
    assert leaf.kind == "concave mesh"
    assert_array_equal(leaf.figures, (corners * scale)[indices].reshape(-1, 3, 3))
    assert_allclose(leaf.position, POSITION, atol=SINGLE)


def test_a_mesh_file_may_be_forced_to_stay_concave(client, saved, tmp_path):
    corners = "".join(f"v {x} {y} {z}\n" for x, y, z in CUBE)
    (tmp_path / "bent.obj").write_text(f"{corners}f 1 2 3\nf 2 3 4\nf 5 6 7\n")
    body(client, p.GEOM_MESH, fileName=str(tmp_path / "bent.obj"), flags=p.GEOM_FORCE_CONCAVE_TRIMESH)
    (leaf,) = base_leaves(saved())
    assert leaf.kind == "concave mesh"
    assert {*map(tuple, leaf.figures.reshape(-1, 3))} == {*map(tuple, CUBE[:7])}


def test_a_capsule_between_two_points_is_a_multisphere(client, saved, tmp_path):
    geom = '<geom type="capsule" fromto=".1 .2 .3 .4 -.2 .5" size=".07"/>'
    (tmp_path / "capsule.xml").write_text(f"<mujoco><worldbody><body>{geom}</body></worldbody></mujoco>")
    p.loadMJCF(str(tmp_path / "capsule.xml"), physicsClientId=client)
    (leaf,) = base_leaves(saved())
    assert leaf.kind == "multisphere"
    assert_allclose(leaf.figures[:, 3], 0.07, atol=SINGLE)
    ends = [p.multiplyTransforms(leaf.position, leaf.orientation, end, [0, 0, 0, 1])[0] for end in leaf.figures[:, :3]]
    # The frame of the collider lies at the centre of mass, halfway.
    assert_allclose(np.array(ends), [[-0.15, 0.2, -0.1], [0.15, -0.2, 0.1]], atol=SINGLE)


def test_a_capsule_along_another_axis_is_not_taken_for_one_along_z(client, saved, tmp_path):
    body(client, p.GEOM_CAPSULE, radius=0.25, height=0.7)
    saved()
    data = bytearray((tmp_path / "scene.bullet").read_bytes())
    # The axis follows the dimensions, the margin and four bytes of padding.
    axis = data.index(np.array([0.25, 0.25, 0.35, 0], dtype="<f4").tobytes()) + 24
    assert data[axis] == 2
    data[axis] = 0
    (tmp_path / "turned.bullet").write_bytes(data)
    (leaf,) = base_leaves(BulletFile(tmp_path / "turned.bullet"))
    assert leaf.kind == "capsule along x" and leaf.figures.size == 0


def test_frames_of_nested_compounds_add_up(client, saved, tmp_path):
    geom = '<geom type="cylinder" fromto="0 0 0 .6 0 0" size=".05"/><geom type="box" pos="0 0 1" size=".1 .2 .3"/>'
    (tmp_path / "nested.xml").write_text(f"<mujoco><worldbody><body>{geom}</body></worldbody></mujoco>")
    (id,) = p.loadMJCF(str(tmp_path / "nested.xml"), physicsClientId=client)
    reported = p.getCollisionShapeData(id, -1, client)
    leaves = base_leaves(saved())
    assert [leaf.kind for leaf in leaves] == ["cylinder", "box"]
    for leaf, entry in zip(leaves, reported):
        assert_allclose(leaf.position, entry[5], atol=SINGLE)
        assert abs(leaf.orientation @ entry[6]) == pytest.approx(1, abs=SINGLE)


def test_bodies_have_exact_positions_their_links_and_friction(client, saved):
    p.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=client)
    robot = p.loadURDF("kuka_iiwa/model.urdf", [1 / 3, 2 / 3, 1 / 7], physicsClientId=client)
    p.changeDynamics(robot, -1, lateralFriction=0.123, physicsClientId=client)
    body(client, p.GEOM_SPHERE, radius=1, position=[0.1, 0.2, 0.3], maximal=True)
    arm, ball = saved().bodies
    assert arm.links == 7 and set(arm.colliders) == set(range(-1, 7))
    assert arm.position.tolist() == list(p.getBasePositionAndOrientation(robot, client)[0])
    assert arm.friction == 0.123
    assert ball.links == 0 and ball.position.tolist() == [0.1, 0.2, 0.3]


def test_a_link_without_a_shape_has_no_leaves(client, saved):
    p.createMultiBody(1, -1, physicsClientId=client)
    assert base_leaves(saved()) == ()


def test_bodies_made_of_one_shape_share_its_leaves(client, saved):
    shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=[1, 2, 3], physicsClientId=client)
    for x in range(3):
        p.createMultiBody(1, shape, basePosition=[x, 0, 0], physicsClientId=client)
    file = saved()
    assert base_leaves(file, 0) is base_leaves(file, 1) is base_leaves(file, 2)


def test_another_kind_of_file_is_refused(tmp_path):
    (tmp_path / "scene.urdf").write_text("<robot/>")
    with pytest.raises(ValueError, match=r"path .*scene\.urdf.* \.bullet file"):
        BulletFile(tmp_path / "scene.urdf")


def test_a_file_cut_short_is_refused(client, saved, tmp_path):
    body(client, p.GEOM_SPHERE, radius=1)
    saved()
    whole = (tmp_path / "scene.bullet").read_bytes()
    (tmp_path / "cut.bullet").write_bytes(whole[:1000])
    with pytest.raises(ValueError, match="cut short"):
        BulletFile(tmp_path / "cut.bullet")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The bytes of a file with all kinds of shapes."""
    client = p.connect(p.DIRECT)
    try:
        for shape, figures in (
            (p.GEOM_BOX, {"halfExtents": [0.1, 0.2, 0.3]}),
            (p.GEOM_CAPSULE, {"radius": 0.25, "height": 0.7}),
            (p.GEOM_PLANE, {"planeNormal": [0, 3, 4]}),
            (p.GEOM_MESH, {"vertices": CUBE.tolist()}),
            (p.GEOM_MESH, {"vertices": CUBE.tolist(), "indices": [0, 1, 2, 1, 2, 3]}),
        ):
            body(client, shape, **figures)
        compound = p.createCollisionShapeArray(
            [p.GEOM_BOX, p.GEOM_SPHERE], halfExtents=[[1, 2, 3]] * 2, radii=[1, 1], physicsClientId=client
        )
        p.createMultiBody(1, compound, physicsClientId=client)
        body(client, p.GEOM_SPHERE, radius=1, maximal=True)
        path = tmp_path_factory.mktemp("whole") / "scene.bullet"
        p.saveBullet(str(path), physicsClientId=client)
    finally:
        p.disconnect(client)
    return path.read_bytes()


def read_all(path):
    """A list of leaves for every collider in a file."""
    file = BulletFile(path)
    return [file.leaves(each.shape) for saved in file.bodies for each in saved.colliders.values()]


def blocks_of(data):
    """Where the blocks of a file begin."""
    start = 12
    while data[start : start + 4] != b"DNA1":
        yield start
        start += 24 + struct.unpack_from("<i", data, start + 4)[0]
    yield start


@given(st.data())
@settings(max_examples=300)
def test_a_mutated_file_is_read_or_refused_in_one_sentence(whole, tmp_path_factory, data):
    changed = bytearray(whole)
    starts = list(blocks_of(whole))
    for _ in range(data.draw(st.integers(1, 4))):
        # Most bytes are numbers of no importance: headings and what describes the structs are worth more.
        at = data.draw(
            st.one_of(
                st.integers(0, len(whole) - 9),
                st.builds(lambda start, off: start + off, st.sampled_from(starts), st.integers(0, 40)),
                st.integers(starts[-1], len(whole) - 9),
            )
        )
        new = data.draw(
            st.one_of(
                st.binary(min_size=1, max_size=8),
                st.sampled_from([struct.pack("<i", number) for number in (-1, 0, -24, 2**31 - 1, -(2**31))]),
                st.builds(lambda k: whole[starts[k] + 8 : starts[k] + 16], st.integers(0, len(starts) - 1)),
            )
        )
        changed[at : at + len(new)] = new
    changed = changed[: data.draw(st.one_of(st.just(len(changed)), st.integers(0, len(changed))))]
    path = tmp_path_factory.getbasetemp() / "mutated.bullet"
    path.write_bytes(changed)
    words = "path is as it should be"
    try:
        read_all(path)
    except ValueError as error:
        words = str(error)
    assert re.fullmatch(r"path [^\n]*", words)


def test_a_block_of_negative_size_is_refused(whole, tmp_path):
    for offset in (4, 16, 20):
        data = bytearray(whole)
        struct.pack_into("<i", data, 12 + offset, -24)
        (tmp_path / "x.bullet").write_bytes(data)
        with pytest.raises(
            ValueError, match=r"^path is a damaged \.bullet file: one of its blocks has a negative size$"
        ):
            read_all(tmp_path / "x.bullet")


def test_a_block_smaller_than_its_struct_is_refused(whole, tmp_path):
    at = next(start for start in blocks_of(whole) if whole[start : start + 4] == b"MBDY")
    size = struct.unpack_from("<i", whole, at + 4)[0]
    data = bytearray(whole[: at + 24] + whole[at + 24 + size - 8 :])
    struct.pack_into("<i", data, at + 4, 8)
    (tmp_path / "x.bullet").write_bytes(data)
    with pytest.raises(ValueError, match=r"^path is a damaged .*: a block MBDY is smaller than its struct$"):
        read_all(tmp_path / "x.bullet")


def test_a_compound_that_contains_itself_is_refused(whole, tmp_path):
    file = tmp_path / "x.bullet"
    file.write_bytes(whole)
    read = BulletFile(file)
    (address,) = {
        each.shape for saved in read.bodies for each in saved.colliders.values() if len(read.leaves(each.shape)) == 2
    }
    child = read._records(read._by_address[int(read._at(address)[0]["m_childShapePtr"])])[0]["m_childShape"]
    old = struct.pack("<Q", int(child))
    at = whole.index(old, whole.index(b"ARAY"))
    for start in range(len(whole) - 8):  # the child's own block keeps its address
        if whole[start : start + 8] == old and start not in [block + 8 for block in blocks_of(whole)]:
            at = start
    file.write_bytes(whole[:at] + struct.pack("<Q", address) + whole[at + 8 :])
    with pytest.raises(ValueError, match=r"^path is a damaged \.bullet file"):
        read_all(file)


def test_a_file_for_which_there_is_no_memory_is_refused_as_one_that_is_damaged_or_too_large(saved, client, monkeypatch):
    body(client, p.GEOM_SPHERE, radius=1)

    def fail(*_):
        raise MemoryError

    monkeypatch.setattr(bullet_file, "_blocks", fail)
    with pytest.raises(ValueError, match=r"^path is a damaged \.bullet file, or needs more m"):
        saved()


def test_shapes_made_of_each_other_without_end_are_refused(whole, tmp_path, monkeypatch):
    monkeypatch.setattr(bullet_file, "MOST_READ", 0)
    (tmp_path / "x.bullet").write_bytes(whole)
    with pytest.raises(ValueError, match=r"^path is a damaged .*: a shape contains itself$"):
        read_all(tmp_path / "x.bullet")


def test_a_struct_with_holes_is_refused(whole, tmp_path):
    at = whole.index(b"m_floats[4]", list(blocks_of(whole))[-1])
    (tmp_path / "x.bullet").write_bytes(whole[:at] + b"m_floats[3]" + whole[at + 11 :])
    with pytest.raises(ValueError, match=r"^path is a damaged \.bullet file: \w+ has holes$"):
        read_all(tmp_path / "x.bullet")
