"""`Bodies` models the shapes that pybullet collides with, at their places. It names the shapes that it skips."""

import ctypes
from pathlib import Path

import numpy as np
import pybullet as p
import pytest
from numpy.testing import assert_allclose
from simulated import (
    CUBE,
    GEOMETRIES,
    INERTIAL,
    ORIENTATION,
    POSITION,
    assert_modelled_as_collided,
    body,
    box,
    bullet_distance,
    random_robot,
    two_cubes,
)

from overlapper import Box, Capsule, Cylinder, HalfSpace, Hull, Sphere, distance
from overlapper.simulation import Bodies, Recorder, SkippedShapeWarning
from overlapper.simulation.bullet.bullet_file import Leaf
from overlapper.simulation.modelling import modelled
from overlapper.simulation.settings import Modelling

# --- shapes


@pytest.mark.parametrize("flags", [0, p.URDF_USE_IMPLICIT_CYLINDER])
@pytest.mark.parametrize("seed", [1, 2])
def test_every_shape_of_a_robot_is_where_bullet_collides_with_it(client, tmp_path, seed, flags):
    robot = random_robot(client, seed, tmp_path, flags)
    bodies = Bodies(client)
    cylinder = Cylinder if flags else Hull
    assert [type(shape) for shape in bodies.shapes] == [Box, Box, Sphere, cylinder, Capsule, Hull, Hull]
    for link in range(-1, 5):
        assert_modelled_as_collided(client, bodies, robot, link, np.random.default_rng(seed))


@pytest.mark.parametrize("frame", [{}, {"collisionFramePosition": POSITION, "collisionFrameOrientation": ORIENTATION}])
def test_primitives_have_their_figures_to_the_last_digits(client, frame):
    body(client, p.GEOM_BOX, halfExtents=[0.1, 0.2, 0.3], **frame)
    body(client, p.GEOM_SPHERE, radius=0.123, **frame)
    body(client, p.GEOM_CAPSULE, radius=0.123, height=0.7, **frame)
    body(client, p.GEOM_CYLINDER, radius=0.123, height=0.7, **frame)
    body(client, p.GEOM_PLANE, planeNormal=[0, 3, 4], mass=0, **frame)
    bodies = Bodies(client)
    a, b, c, d, e = bodies.shapes
    assert_allclose(a.half_extents, [0.1, 0.2, 0.3], rtol=1e-15)
    assert b.radius == c.radius == d.radius == 0.123
    assert c.length == d.length == 0.7
    assert_allclose(e.normal, [0, 0.6, 0.8], rtol=1e-15)
    assert e.offset == 0
    expected = (POSITION, ORIENTATION) if frame else ([0, 0, 0], [0, 0, 0, 1])
    assert_allclose(bodies.positions, [expected[0]] * 5, atol=1e-15)
    assert_allclose(np.abs(bodies.orientations @ expected[1]), 1, atol=1e-14)


def test_the_solid_of_a_plane_is_below_it(client):
    body(client, p.GEOM_PLANE, planeNormal=[0, 0, 1], mass=0, collisionFramePosition=[0, 0, 0.5])
    body(client, p.GEOM_SPHERE, radius=0.1, position=[3, 4, 2])
    bodies = Bodies(client)
    assert isinstance(bodies.shapes[0], HalfSpace)
    assert distance(*bodies.placed) == pytest.approx(1.4, abs=1e-12)


def test_hulls_have_the_vertices_of_bullet_in_the_world(client, tmp_path):
    robot = random_robot(client, 3, tmp_path)
    bodies = Bodies(client)
    position, orientation = p.getLinkState(robot, 4, computeForwardKinematics=1, physicsClientId=client)[:2]
    reported = p.getMeshData(robot, 4, physicsClientId=client)[1]
    expected = np.array([p.multiplyTransforms(position, orientation, v, [0, 0, 0, 1])[0] for v in reported])
    ours = [
        np.array([p.multiplyTransforms(x, q, v, [0, 0, 0, 1])[0] for v in shape.vertices])
        for key, shape, x, q in zip(bodies.keys, bodies.shapes, bodies.positions, bodies.orientations)
        if key[:2] == (robot, 4)
    ]
    assert [len(part) for part in ours] == [8, 8]
    # multiplyTransforms returns single precision.
    assert_allclose(sorted(np.concatenate(ours).tolist()), sorted(expected.tolist()), atol=1e-6)


def test_links_that_mix_hulls_and_primitives_print_nothing(client, capfd):
    p.loadURDF("quadruped/microtaur/microtaur.urdf", physicsClientId=client)
    bodies = Bodies(client)
    # Output of pybullet may still be in a buffer of the C library.
    ctypes.CDLL(None).fflush(None)
    assert sum(isinstance(shape, Box) for shape in bodies.shapes) == 34
    assert sum(isinstance(shape, Hull) for shape in bodies.shapes) == 4
    assert "?" not in capfd.readouterr().out


def test_compounds_are_modelled_part_by_part(client):
    shape = p.createCollisionShapeArray(
        shapeTypes=[p.GEOM_SPHERE, p.GEOM_BOX, p.GEOM_CAPSULE],
        radii=[0.1, 0.1, 0.2],
        halfExtents=[[1, 1, 1], [0.1, 0.2, 0.3], [1, 1, 1]],
        lengths=[1, 1, 0.6],
        collisionFramePositions=[[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        physicsClientId=client,
    )
    id = p.createMultiBody(1, shape, basePosition=[5, 5, 5], physicsClientId=client)
    bodies = Bodies(client)
    assert bodies.keys == [(id, -1, 0), (id, -1, 1), (id, -1, 2)]
    assert [type(shape) for shape in bodies.shapes] == [Sphere, Box, Capsule]
    assert_allclose(bodies.positions, np.eye(3) + 5, atol=1e-12)


def test_nested_compounds_are_where_bullet_collides_with_them(client, tmp_path):
    geom = '<geom type="cylinder" fromto="0 .1 0 .6 .2 .3" size=".05"/><geom type="sphere" pos="0 0 9" size=".1"/>'
    (tmp_path / "nested.xml").write_text(f"<mujoco><worldbody><body>{geom}</body></worldbody></mujoco>")
    (id,) = p.loadMJCF(str(tmp_path / "nested.xml"), physicsClientId=client)
    bodies = Bodies(client)
    cylinder, sphere = bodies.shapes
    assert isinstance(cylinder, Cylinder) and isinstance(sphere, Sphere)
    # Above the middle of the faces, where the rounded edges of Bullet's cylinder do not matter.
    for above in ([0, 0, cylinder.length / 2 + 1], [cylinder.radius + 1, 0, 0], [0, -cylinder.radius - 1, 0]):
        point = p.multiplyTransforms(bodies.positions[0], bodies.orientations[0], above, [0, 0, 0, 1])[0]
        assert bullet_distance(client, id, -1, point) == pytest.approx(1, abs=2e-6)


def test_inertial_frames_of_created_links_are_accounted_for(client):
    shape = p.createCollisionShape(
        p.GEOM_BOX, halfExtents=[0.1, 0.2, 0.3], collisionFramePosition=POSITION, physicsClientId=client
    )
    id = p.createMultiBody(
        baseMass=1,
        baseCollisionShapeIndex=shape,
        basePosition=[1, 2, 3],
        baseInertialFramePosition=[0.5, 0, 0],
        baseInertialFrameOrientation=ORIENTATION,
        linkMasses=[1],
        linkCollisionShapeIndices=[shape],
        linkVisualShapeIndices=[-1],
        linkPositions=[[0, 0, 2]],
        linkOrientations=[ORIENTATION],
        linkInertialFramePositions=[[0, 0.5, 0]],
        linkInertialFrameOrientations=[ORIENTATION],
        linkParentIndices=[0],
        linkJointTypes=[p.JOINT_REVOLUTE],
        linkJointAxis=[[0, 1, 0]],
        physicsClientId=client,
    )
    p.resetJointState(id, 0, 0.4, physicsClientId=client)
    bodies = Bodies(client)
    assert_allclose(bodies.positions[0], np.add([1, 2, 3], POSITION), atol=1e-7)
    for link in (-1, 0):
        assert_modelled_as_collided(client, bodies, id, link, np.random.default_rng(1))


@pytest.mark.parametrize("scale", [[-1, 1, 1], [0.5, -2, 0.3], [-1, -1, -1]])
@pytest.mark.parametrize("file", [True, False])
def test_meshes_are_scaled_and_mirrored_as_bullet_has_them(client, tmp_path, scale, file):
    corners = np.random.default_rng(2).normal(size=(9, 3)).round(6) + [1, 0, 0]
    (tmp_path / "part.obj").write_text(
        "".join("v {} {} {}\n".format(*corner) for corner in corners) + "f 1 2 3\nf 4 5 6\nf 7 8 9\nf 1 5 9\n"
    )
    source = {"fileName": str(tmp_path / "part.obj")} if file else {"vertices": corners.tolist()}
    id = body(client, p.GEOM_MESH, meshScale=scale, position=POSITION, orientation=ORIENTATION, **source)
    bodies = Bodies(client)
    assert_allclose(bodies.shapes[0].volume, Hull(corners * scale).volume, rtol=1e-3)  # Bullet moves corners a little
    assert_modelled_as_collided(client, bodies, id, -1, np.random.default_rng(1))


def test_merged_links_are_where_bullet_collides_with_them(client, tmp_path):
    def spread(axis):
        return " ".join(str(0.3 * (other == axis)) for other in "xyz")

    text = "".join(
        f'<link name="{name}">{INERTIAL.format(spread(axis), "0.3 0.2 0.1")}<collision><origin xyz="{spread(axis)}"/>'
        f"<geometry>{geometry}</geometry></collision></link>"
        for name, axis, geometry in zip("abc", "xyz", GEOMETRIES[:1] * 3)
    )
    for parent, child, kind in (("a", "b", "fixed"), ("b", "c", "fixed")):
        text += (
            f'<joint name="{child}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            '<origin xyz=".5 .4 .3" rpy=".3 .2 .1"/></joint>'
        )
    (tmp_path / "merged.urdf").write_text(f'<robot name="merged">{text}</robot>')
    pose = {"basePosition": POSITION, "baseOrientation": ORIENTATION}
    id = p.loadURDF(str(tmp_path / "merged.urdf"), flags=p.URDF_MERGE_FIXED_LINKS, physicsClientId=client, **pose)
    bodies = Bodies(client)
    assert bodies.keys == [(id, -1, 0), (id, -1, 1), (id, -1, 2)]
    assert_modelled_as_collided(client, bodies, id, -1, np.random.default_rng(1))


def test_equal_shapes_are_one_object(client):
    for x in range(3):
        p.loadURDF("duck_vhacd.urdf", [x, 0, 0], physicsClientId=client)
    bodies = Bodies(client)
    assert len(bodies.shapes) == 15
    assert len({id(shape) for shape in bodies.shapes}) == 5


@pytest.mark.parametrize(
    ("model", "shapes"),
    [
        ("r2d2.urdf", {Box: 5, Hull: 10, Sphere: 1}),
        ("laikago/laikago.urdf", {Hull: 92}),
        ("laikago/laikago_toes.urdf", {Hull: 92, Sphere: 4}),
        ("franka_panda/panda.urdf", {Hull: 11}),
        ("kuka_iiwa/model.urdf", {Hull: 8}),
        ("kuka_iiwa/kuka_with_gripper2.sdf", {Box: 3, Hull: 12}),
        ("humanoid/humanoid.urdf", {Box: 2, Capsule: 8, Sphere: 5}),
        ("jenga/jenga.urdf", {Box: 1}),
        ("plane_implicit.urdf", {HalfSpace: 1}),
        ("kiva_shelf/model.sdf", {Box: 21}),
        ("sphere8cube.urdf", {Sphere: 8}),
        ("mjcf/ant.xml", {Capsule: 12, Sphere: 1}),
        ("mjcf/humanoid.xml", {Capsule: 16, HalfSpace: 1, Sphere: 3}),
        ("mjcf/half_cheetah.xml", {Capsule: 8}),
        ("mjcf/cylinder_fromtoX.xml", {Cylinder: 1, HalfSpace: 1}),
        ("mjcf/thrower.xml", {Box: 5, Capsule: 34, HalfSpace: 1, Sphere: 5}),
    ],
)
def test_models_have_all_their_shapes(client, model, shapes):
    load = {".urdf": p.loadURDF, ".sdf": p.loadSDF, ".xml": p.loadMJCF}[Path(model).suffix]
    load(model, physicsClientId=client)
    bodies = Bodies(client)
    assert {kind: sum(isinstance(shape, kind) for shape in bodies.shapes) for kind in shapes} == shapes
    assert len(bodies.shapes) == sum(shapes.values())
    assert bodies.skipped == []


def test_capsules_that_kill_get_collision_shape_data_are_read_and_placed(client):
    """The multi-spheres of ant.xml: pybullet crashes on a call that it answers for other shapes."""
    (ant,) = p.loadMJCF("mjcf/ant.xml", physicsClientId=client)
    bodies = Bodies(client)
    links = [link for _, link, _ in bodies.keys]
    assert len(links) == len(set(links)) == 13
    for link in links:
        assert_modelled_as_collided(client, bodies, ant, link, np.random.default_rng(link + 1), points=2)


def test_a_vertical_capsule_between_two_points_needs_no_turn(client, tmp_path):
    geom = '<geom type="capsule" fromto="0 0 {} 0 0 {}" size=".07"/>'
    for name, ends in (("up", (0.2, 0.8)), ("down", (0.8, 0.2))):
        text = f"<mujoco><worldbody><body>{geom.format(*ends)}</body></worldbody></mujoco>"
        (tmp_path / f"{name}.xml").write_text(text)
        p.loadMJCF(str(tmp_path / f"{name}.xml"), physicsClientId=client)
    bodies = Bodies(client)
    assert [shape.length for shape in bodies.shapes] == pytest.approx([0.6, 0.6], abs=1e-6)
    assert_allclose(np.abs(bodies.orientations[:, 3]), 1, atol=1e-12)


def test_bodies_in_maximal_coordinates_are_modelled(client):
    options = {"halfExtents": [0.1, 0.2, 0.3], "position": [1, 2, 3], "orientation": ORIENTATION, "maximal": True}
    id = body(client, p.GEOM_BOX, **options)
    bodies = Bodies(client)
    assert_allclose(bodies.shapes[0].half_extents, [0.1, 0.2, 0.3], atol=1e-7)
    assert_modelled_as_collided(client, bodies, id, -1, np.random.default_rng(1))


# --- what is not modelled


def concave_mesh(client):
    return body(client, p.GEOM_MESH, vertices=CUBE.tolist(), indices=[0, 1, 2, 1, 2, 3, 4, 5, 6])


def height_field(client):
    figures = {"heightfieldData": [0.0] * 63 + [1.0], "numHeightfieldRows": 8, "numHeightfieldColumns": 8}
    return body(client, p.GEOM_HEIGHTFIELD, mass=0, meshScale=[1, 1, 1], **figures)


def soft_body(client):
    return p.loadSoftBody("cloth_z_up.obj", mass=1, useMassSpring=1, physicsClientId=client)


def flat_hull(client):
    return body(client, p.GEOM_MESH, vertices=[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])


@pytest.mark.parametrize(
    ("build", "reason"),
    [
        (concave_mesh, "concave mesh"),
        (height_field, "height field"),
        (soft_body, "soft body"),
        (flat_hull, "flat|vertices"),
    ],
)
def test_concave_shapes_are_skipped_by_name_with_one_warning(client, build, reason):
    id = build(client)
    ball = body(client, p.GEOM_SPHERE, radius=1, position=[5, 5, 5])
    with pytest.warns(SkippedShapeWarning, match=reason) as caught:
        bodies = Bodies(client)
    assert len(caught) == 1
    assert caught[0].filename == __file__
    for _ in range(2):
        p.stepSimulation(client)
        bodies.update()  # a second warning would be an error
    (skipped,) = bodies.skipped
    assert (skipped.body, skipped.link) == (id, -1)
    assert skipped.name
    assert bodies.keys == [(ball, -1, 0)]
    assert bodies.report().shapes == 2 and bodies.report().shapes_read == 1


def test_the_rest_of_a_link_with_a_flat_hull_is_modelled(client, tmp_path):
    corners = "v 5 0 0\nv 6 0 0\nv 5 1 0\nv 6 1 0\n"
    text = Path(two_cubes(tmp_path / "three.obj")).read_text()
    (tmp_path / "three.obj").write_text(f"{text}o flat\n{corners}f 17 18 19\nf 18 19 20\n")
    id = body(client, p.GEOM_MESH, fileName=str(tmp_path / "three.obj"))
    with pytest.warns(SkippedShapeWarning, match="1 of 3 shapes: ") as caught:
        bodies = Bodies(client)
    assert len(caught) == 1
    assert bodies.keys == [(id, -1, 0), (id, -1, 1)]


def test_the_hull_of_unequal_spheres_is_not_taken_for_a_capsule():
    spheres = np.array([[0, 0, 0, 0.1], [0, 0, 1, 0.2]])
    leaf = Leaf("multisphere", np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), spheres)
    found = modelled(0, (leaf,), Modelling("skip"))
    assert found == ([], ["the hull of unequal spheres is not modelled"], [])


def test_links_without_an_id_are_counted_as_skipped(client):
    """A robot in maximal coordinates: pybullet knows the pose of its base alone."""
    p.loadURDF("r2d2.urdf", useMaximalCoordinates=True, physicsClientId=client)
    with pytest.warns(SkippedShapeWarning, match="15 bodies.*maximal coordinates") as caught:
        bodies = Bodies(client)
    assert len(caught) == 1
    assert [key[1] for key in bodies.keys] == [-1]
    assert [each.body for each in bodies.skipped] == [-1]
    bodies.update()
    p.resetSimulation(physicsClientId=client)
    bodies.update()
    assert bodies.keys == bodies.skipped == []


def test_bodies_from_load_bullet_are_counted_as_skipped(client, tmp_path):
    """pybullet gives it no ids, so that nothing can be asked of it."""
    p.loadURDF("cube.urdf", physicsClientId=client)
    path = str(tmp_path / "cube.bullet")
    p.saveBullet(path, physicsClientId=client)
    p.resetSimulation(physicsClientId=client)
    with Recorder(client) as recorder:
        watched = Bodies(client, recorder=recorder)
        p.loadBullet(path, physicsClientId=client)
        with pytest.warns(SkippedShapeWarning, match="1 body .*pybullet gives no id to bodies from loadBullet"):
            watched.update()
        with pytest.warns(SkippedShapeWarning, match="1 body "):
            bodies = Bodies(client)
        cube = box(client, position=[0, 0, 0])
        p.loadBullet(path, physicsClientId=client)
        with pytest.warns(SkippedShapeWarning, match="2 bodies "):
            bodies.update()  # without a recorder, it is noticed with the next body
        assert bodies.keys == [(cube, -1, 0)] and [each.name for each in bodies.skipped] == ["2 bodies"]
        with pytest.warns(SkippedShapeWarning, match="2 bodies "):
            watched.update()
        p.resetSimulation(physicsClientId=client)
        watched.update()
        assert watched.keys == watched.skipped == []
