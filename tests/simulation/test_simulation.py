"""What `Bodies` models is what pybullet collides with, where it collides with it."""

import ctypes
import gc
import os
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pybullet as p
import pybullet_data
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from overlapper import Box, Capsule, Cylinder, HalfSpace, Hull, Placed, Sphere, distance
from overlapper.simulation import Bodies, Recorder, SkippedShapeWarning
from overlapper.simulation.extraction.bullet_file import Leaf
from overlapper.simulation.extraction.model import Settings
from overlapper.simulation.extraction.modelling import modelled

DATA = Path(pybullet_data.getDataPath())
CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
CUBE_FACES = [
    (1, 2, 4),
    (1, 4, 3),
    (5, 7, 8),
    (5, 8, 6),
    (1, 5, 6),
    (1, 6, 2),
    (3, 4, 8),
    (3, 8, 7),
    (1, 3, 7),
    (1, 7, 5),
]
POSITION, ORIENTATION = [0.1, -0.2, 0.3], p.getQuaternionFromEuler([0.3, -0.5, 0.7])
INERTIAL = (
    '<inertial><origin xyz="{}" rpy="{}"/><mass value="1"/>'
    '<inertia ixx=".1" iyy=".2" izz=".3" ixy="0" ixz="0" iyz="0"/></inertial>'
)
GEOMETRIES = [
    '<box size=".2 .4 .6"/>',
    '<sphere radius=".15"/>',
    '<cylinder radius=".2" length=".8"/>',
    '<capsule radius=".1" length=".6"/>',
    '<mesh filename="two.obj" scale=".5 .3 .2"/>',
]
HULL_MARGIN = 1e-3
# Bullet rounds the edges of boxes and cylinders by a margin of 1 mm, and so reports up to this much more at a corner.
ROUNDED_CORNER = 1e-3 * (np.sqrt(3) - 1)


@pytest.fixture
def client(client):
    p.setAdditionalSearchPath(str(DATA), physicsClientId=client)
    return client


@pytest.fixture(autouse=True)
def _skipping_is_an_error():
    """A test that expects a shape to be skipped says so with pytest.warns."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", SkippedShapeWarning)
        yield


def body(client, *shape, mass=1, position=(0, 0, 0), orientation=(0, 0, 0, 1), maximal=False, **figures):
    collision = p.createCollisionShape(*shape, physicsClientId=client, **figures)
    return p.createMultiBody(
        mass, collision, -1, position, orientation, useMaximalCoordinates=maximal, physicsClientId=client
    )


def box(client, half=0.5, **options):
    return body(client, p.GEOM_BOX, halfExtents=[half] * 3, **options)


def two_cubes(path, gap=2):
    """An .obj file of two cubes, the second `gap` further along x."""
    text = ""
    for part in (0, 1):
        text += f"o part{part}\n" + "".join(f"v {x + part * gap} {y} {z}\n" for x, y, z in CUBE)
        text += "".join(f"f {a + 8 * part} {b + 8 * part} {c + 8 * part}\n" for a, b, c in CUBE_FACES)
    path.write_text(text)
    return str(path)


def random_robot(client, seed, folder, flags=0):
    """A chain of links of all shapes of a URDF, with random inertial frames, collision frames, joints and base pose."""
    random = np.random.default_rng(seed)

    def triple():
        return " ".join(f"{x:.6f}" for x in random.uniform(-0.6, 0.6, 3))

    two_cubes(folder / "two.obj")
    text = '<robot name="random">'
    for i, geometry in enumerate(['<box size=".3 .3 .3"/>', *GEOMETRIES]):
        inertial = INERTIAL.format(triple(), triple())
        origin = f'<origin xyz="{triple()}" rpy="{triple()}"/>'
        text += f'<link name="l{i}">{inertial}<collision>{origin}<geometry>{geometry}</geometry></collision></link>'
        if i:
            text += (
                f'<joint name="j{i}" type="revolute"><parent link="l{i - 1}"/><child link="l{i}"/>'
                f'<origin xyz="{triple()}" rpy="{triple()}"/><axis xyz="0 1 0"/>'
                '<limit lower="-3" upper="3" effort="9" velocity="9"/></joint>'
            )
    (folder / "robot.urdf").write_text(text + "</robot>")
    orientation = p.getQuaternionFromEuler(random.normal(size=3))
    robot = p.loadURDF(
        str(folder / "robot.urdf"), random.normal(size=3), orientation, flags=flags, physicsClientId=client
    )
    for joint in range(p.getNumJoints(robot, client)):
        p.resetJointState(robot, joint, random.uniform(-1, 1), physicsClientId=client)
    return robot


PROBE = 1e-4


def bullet_distance(client, id, link, point):
    """What Bullet says is the distance of a point from a link, asked with a tiny ball."""
    ball = p.createCollisionShape(p.GEOM_SPHERE, radius=PROBE, physicsClientId=client)
    nearest = p.getClosestPoints(
        id, -1, 100.0, linkIndexA=link, collisionShapeB=ball, collisionShapePositionB=point, physicsClientId=client
    )
    return min(each[8] for each in nearest) + PROBE


def our_distance(bodies, id, link, point):
    near = [placed for key, placed in zip(bodies.keys, bodies.placed) if key[:2] == (id, link)]
    ball = Placed(Sphere(PROBE), point)
    return min(distance(placed, ball) for placed in near) + PROBE


def assert_modelled_as_collided(client, bodies, id, link, random, points=4):
    (kind,) = {type(shape) for key, shape in zip(bodies.keys, bodies.shapes) if key[:2] == (id, link)}
    centre = np.mean([x for key, x in zip(bodies.keys, bodies.positions) if key[:2] == (id, link)], axis=0)
    for _ in range(points):
        direction = random.normal(size=3)
        point = centre + direction / np.linalg.norm(direction) * random.uniform(2, 4)
        excess = bullet_distance(client, id, link, point) - our_distance(bodies, id, link, point)
        if kind is Hull:
            assert excess == pytest.approx(-HULL_MARGIN, abs=2e-6)
        else:
            assert -2e-6 < excess < (ROUNDED_CORNER if kind in (Box, Cylinder) else 2e-6)


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
    # What pybullet prints may wait in a buffer of C's.
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
    """The multi-spheres of ant.xml: pybullet dies of a call that it answers for other shapes."""
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
def test_what_is_not_convex_is_skipped_by_name_with_one_warning(client, build, reason):
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
    found = modelled(0, (leaf,), Settings("skip", 0.05, "nominal"))
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
    p.resetSimulation(client)
    bodies.update()
    assert bodies.keys == bodies.skipped == []


def test_what_load_bullet_brings_is_counted_as_skipped(client, tmp_path):
    """pybullet gives it no ids, so that nothing can be asked of it."""
    p.loadURDF("cube.urdf", physicsClientId=client)
    path = str(tmp_path / "cube.bullet")
    p.saveBullet(path, physicsClientId=client)
    p.resetSimulation(client)
    with Recorder(client) as recorder:
        watched = Bodies(client, recorder=recorder)
        p.loadBullet(path, physicsClientId=client)
        with pytest.warns(SkippedShapeWarning, match="1 body .*pybullet gives no id to what loadBullet brings"):
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
        p.resetSimulation(client)
        watched.update()
        assert watched.keys == watched.skipped == []


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


def test_a_body_that_takes_over_an_id_is_noticed(client):
    box(client)
    old = box(client, position=[3, 0, 0])
    bodies = Bodies(client)
    p.removeBody(old, physicsClientId=client)
    assert body(client, p.GEOM_SPHERE, radius=0.3, position=[3, 0, 0]) == old
    bodies.update()
    assert [type(shape) for shape in bodies.shapes] == [Box, Sphere]


def test_a_body_that_takes_over_an_id_after_a_sync_is_noticed(client):
    """syncBodyInfo makes pybullet forget to drop the user data of bodies that are removed later."""
    old = box(client)
    bodies = Bodies(client)
    p.syncBodyInfo(client)
    p.removeBody(old, physicsClientId=client)
    assert body(client, p.GEOM_SPHERE, radius=0.3) == old
    bodies.update()
    assert [type(shape) for shape in bodies.shapes] == [Sphere]


def test_a_body_that_takes_over_an_id_and_is_given_user_data_is_noticed(client):
    old = box(client)
    bodies = Bodies(client)
    p.syncBodyInfo(client)
    p.removeBody(old, physicsClientId=client)
    assert body(client, p.GEOM_SPHERE, radius=0.3) == old
    p.addUserData(old, "mine", "", physicsClientId=client)
    bodies.update()
    assert [type(shape) for shape in bodies.shapes] == [Sphere]


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


def test_two_readers_of_one_client_both_notice_a_replaced_body(client):
    old = box(client)
    readers = Bodies(client), Bodies(client)
    p.removeBody(old, physicsClientId=client)
    body(client, p.GEOM_SPHERE, radius=0.3)
    for bodies in readers:
        bodies.update()
        assert [type(shape) for shape in bodies.shapes] == [Sphere]


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
    p.resetSimulation(client)
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


# --- poses


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
    with pytest.warns(SkippedShapeWarning, match=f"body {lost} .* no finite pose: the simulation has diverged") as told:
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
    with pytest.warns(SkippedShapeWarning, match=f"body {ids[1]} "):
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


# --- clients


def test_two_clients_are_independent(client):
    other = p.connect(p.DIRECT)
    box(client, position=[1, 0, 0])
    body(other, p.GEOM_SPHERE, radius=0.3, position=[2, 0, 0])
    ours, theirs = Bodies(client), Bodies(other)
    assert [type(shape) for shape in ours.shapes + theirs.shapes] == [Box, Sphere]
    p.resetBasePositionAndOrientation(0, [9, 0, 0], [0, 0, 0, 1], physicsClientId=other)
    ours.update(), theirs.update()
    assert ours.positions.tolist() == [[1, 0, 0]] and theirs.positions.tolist() == [[9, 0, 0]]
    p.disconnect(other)
    ours.update()
    with pytest.raises(ValueError, match=f"physicsClientId {other} is not connected"):
        theirs.update()


def test_a_client_that_was_never_connected_is_named():
    with pytest.raises(ValueError, match="physicsClientId 17 is not connected"):
        Bodies(17)


def test_a_client_that_takes_over_an_id_is_read_afresh(client):
    box(client)
    bodies = Bodies(client)
    p.disconnect(client)
    assert p.connect(p.DIRECT) == client
    body(client, p.GEOM_SPHERE, radius=0.3)
    bodies.update()
    assert [type(shape) for shape in bodies.shapes] == [Sphere]


SERVER = """
import sys
import pybullet as p
server = p.connect(p.SHARED_MEMORY_SERVER, key=int(sys.argv[1]))
for half in (0.1, 0.2):
    p.createMultiBody(1, p.createCollisionShape(p.GEOM_BOX, halfExtents=[half] * 3), basePosition=[1, 2, 3])
print("ready", flush=True)
sys.stdin.read()
"""


def test_a_simulation_in_another_process_is_read():
    key = 20000 + os.getpid() % 10000
    command = [sys.executable, "-c", SERVER, str(key)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as server:
        assert any("ready" in line for line in server.stdout)
        client = p.connect(p.SHARED_MEMORY, key)
        bodies = Bodies(client)
        assert [shape.half_extents[0] for shape in bodies.shapes] == [0.1, 0.2]
        assert bodies.positions.tolist() == [[1, 2, 3]] * 2
        with Recorder(client) as recorder:
            watched = Bodies(client, recorder=recorder)
            assert len(watched.overlaps()) == 1
            p.setCollisionFilterPair(0, 1, -1, -1, 0, physicsClientId=client)
            watched.update()
            assert watched.overlaps() == []
            p.removeBody(1, physicsClientId=client)
            assert body(client, p.GEOM_SPHERE, radius=0.3) == 1
            watched.update()
            assert [type(shape) for shape in watched.shapes] == [Box, Sphere]
        p.disconnect(client)
        server.stdin.close()


def test_a_server_that_writes_elsewhere_is_an_error_of_one_sentence(client, monkeypatch):
    box(client)
    monkeypatch.setattr(p, "saveBullet", lambda *args, **kwargs: None)
    with pytest.raises(RuntimeError, match=f"physicsClientId {client} could not hand over its shapes"):
        Bodies(client)


def test_a_server_that_cannot_write_is_an_error_of_one_sentence(client, monkeypatch):
    box(client)

    def refuse(*args, **kwargs):
        raise p.error("no")

    monkeypatch.setattr(p, "saveBullet", refuse)
    with pytest.raises(RuntimeError, match=f"physicsClientId {client} could not hand over its shapes") as caught:
        Bodies(client)
    assert isinstance(caught.value.__cause__, p.error)


def test_a_file_that_is_cut_as_on_a_full_disk_is_an_error_of_one_sentence(client, monkeypatch):
    box(client)
    save = p.saveBullet

    def cut(name, **options):
        save(name, **options)
        os.truncate(name, os.path.getsize(name) // 2)

    monkeypatch.setattr(p, "saveBullet", cut)
    with pytest.raises(RuntimeError, match=r"and have room for them \(path is a [^\n]*\)$"):
        Bodies(client)


def test_without_a_temporary_folder_the_error_is_one_sentence(client, monkeypatch):
    box(client)
    monkeypatch.setattr("tempfile.tempdir", "/no/such/folder")
    with pytest.raises(RuntimeError, match=r"cannot hand over its shapes, as there can be no temporary file: No such"):
        Bodies(client)


def test_no_file_is_left_behind(client, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    box(client)
    Bodies(client)
    monkeypatch.setattr(p, "saveBullet", lambda *args, **kwargs: None)
    with pytest.raises(RuntimeError, match="hand over"):
        Bodies(client)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_pybullet_is_one_clear_sentence():
    code = "import sys; sys.modules['pybullet'] = None; from overlapper.simulation import Bodies"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    sentence = "ImportError: overlapper.simulation needs pybullet: pip install pybullet"
    assert run.stderr.strip().endswith(sentence)


# --- overlaps


def test_contacts_name_bodies_links_and_shapes_in_order(client, tmp_path):
    ground = box(client, mass=0, position=[0, 0, -0.45])
    robot = p.loadURDF("r2d2.urdf", [0, 0, 0.5], physicsClientId=client)
    cube = box(client, 0.1, position=[0, 0, 0.1])
    bodies = Bodies(client)
    contacts = bodies.overlaps()
    keys = [(c.bodyA, c.linkA, c.shapeA, c.bodyB, c.linkB, c.shapeB) for c in contacts]
    assert keys == sorted(keys) and len(keys) == len(set(keys)) > 2
    assert {(c.bodyA, c.bodyB) for c in contacts} <= {(ground, robot), (ground, cube), (robot, cube)}
    placed = dict(zip(bodies.keys, bodies.placed))
    for key, contact in zip(keys, contacts):
        a, b = contact.overlap.shapes
        assert_array_equal([a.position, b.position], [placed[key[:3]].position, placed[key[3:]].position])


def test_the_overlap_of_two_cubes_is_the_box_they_share(client):
    a = box(client, position=[0, 0, 0.95])
    b = box(client, position=[0.25, 0, 0])
    (contact,) = Bodies(client).overlaps()
    assert (contact.bodyA, contact.linkA, contact.shapeA) == (a, -1, 0)
    assert (contact.bodyB, contact.linkB, contact.shapeB) == (b, -1, 0)
    assert contact.overlap.status == "overlapping"
    assert contact.overlap.volume == pytest.approx(0.75 * 0.05, rel=1e-12)
    assert contact.overlap.depth == pytest.approx(0.05, rel=1e-12)
    assert_allclose(contact.overlap.normal, [0, 0, 1], atol=1e-12)


def test_shapes_that_only_touch_are_contacts_without_volume(client):
    box(client), box(client, position=[1, 0, 0])
    bodies = Bodies(client)
    (contact,) = bodies.overlaps()
    assert contact.overlap.status == "touching" and contact.overlap.volume == 0
    assert_allclose(contact.overlap.normal, [-1, 0, 0], atol=1e-12)
    assert bodies.report().pairs_overlapping == 0


def test_contacts_are_a_sequence_and_arrays_at_once(client):
    for x in range(4):
        box(client, position=[0.9 * x, 0, 0])
    contacts = Bodies(client).overlaps()
    assert len(contacts) == 3 and contacts and contacts != [] and contacts == list(contacts)
    assert contacts[0] is contacts[-3] is next(iter(contacts)) and contacts[2] in contacts
    with pytest.raises(IndexError):
        contacts[3]
    assert_array_equal(contacts.keys, [[k, -1, 0, k + 1, -1, 0] for k in range(3)])
    for row, contact in enumerate(contacts):
        assert contact.overlap.volume == contacts.overlaps.volume[row] == pytest.approx(0.1, rel=1e-12)
        assert_array_equal(contact.overlap.gradient, contacts.overlaps.gradient[row])
    for picked in (contacts[1:], contacts[[1, 2]], contacts[contacts.keys[:, 0] > 0]):
        assert [(c.bodyA, c.bodyB) for c in picked] == [(1, 2), (2, 3)] and len(picked.overlaps) == 2
    assert not contacts[:0] and contacts[:0] == []


def test_contacts_of_a_step_keep_what_they_say_when_the_simulation_goes_on(client):
    ball = body(client, p.GEOM_SPHERE, radius=0.5, position=[0, 0, 0.3])
    box(client, mass=0)
    bodies = Bodies(client)
    looked_at, kept = bodies.overlaps(0.01), bodies.overlaps(0.01)
    volume, corners = looked_at.overlaps.volume[0], looked_at[0].overlap.vertices
    p.resetBasePositionAndOrientation(ball, [0, 0, 0.5], [0, 0, 0, 1], physicsClientId=client)
    bodies.update()
    assert bodies.overlaps(0.01).overlaps.volume[0] < volume
    assert_array_equal(kept[0].overlap.vertices, corners)
    assert kept[0].overlap.volume == kept.overlaps.volume[0] == volume


def test_the_article_s_method_and_threads_are_asked_for_by_step(client):
    for x in range(3):
        box(client, position=[0.9 * x, 0.1 * x, 0])
    bodies = Bodies(client)
    by_article = bodies.overlaps(method="paper", threads=2)
    assert by_article.overlaps.method == by_article[0].overlap.method == "paper"
    assert bodies.overlaps(threads=2)[0].overlap.method == "auto"
    assert_allclose(by_article.overlaps.volume, bodies.overlaps().overlaps.volume, rtol=1e-9)


def test_normal_and_depth_are_those_of_get_contact_points(client):
    a = body(client, p.GEOM_SPHERE, radius=0.5, position=[0.2, 0.1, 0.6])
    b = box(client, position=[0, 0, -0.3], mass=0)
    p.performCollisionDetection(client)
    (point,) = p.getContactPoints(a, b, physicsClientId=client)
    (contact,) = Bodies(client).overlaps()
    assert_allclose(contact.overlap.normal, point[7], atol=1e-6)
    assert contact.overlap.depth == pytest.approx(-point[8], abs=1e-6)


def test_separated_shapes_whose_boxes_meet_make_no_contact(client):
    body(client, p.GEOM_SPHERE, radius=0.5)
    body(client, p.GEOM_SPHERE, radius=0.5, position=[0.8, 0.8, 0])
    bodies = Bodies(client)
    assert bodies.overlaps() == []
    assert bodies.report().pairs_examined == 1 and bodies.report().pairs_overlapping == 0


def test_shapes_of_one_body_are_no_pair(client):
    p.loadURDF("franka_panda/panda.urdf", physicsClientId=client)
    bodies = Bodies(client)
    assert bodies.overlaps() == []
    assert bodies.report().pairs_possible == bodies.report().pairs_examined == 0


def test_static_bodies_are_no_pair_until_one_is_released(client):
    box(client, mass=0), box(client, mass=0, position=[0.9, 0, 0])
    bodies = Bodies(client)
    assert bodies.overlaps() == []
    p.changeDynamics(1, -1, mass=1, physicsClientId=client)
    bodies.update()
    assert len(bodies.overlaps()) == 1


def test_a_body_that_has_become_static_is_noticed_when_it_rests(client):
    box(client, mass=0)
    moved = box(client, position=[0.8, 0, 0])
    bodies = Bodies(client)
    p.changeDynamics(moved, -1, mass=0, physicsClientId=client)
    p.resetBasePositionAndOrientation(moved, [0.9, 0, 0], [0, 0, 0, 1], physicsClientId=client)
    bodies.update()
    assert len(bodies.overlaps()) == 1
    bodies.update()
    assert bodies.overlaps() == []


def test_the_report_counts_what_was_looked_at(client):
    body(client, p.GEOM_PLANE, mass=0)
    for x in range(4):
        box(client, position=[0.95 * x, 0, 0.45])
    bodies = Bodies(client)
    bodies.overlaps()
    report = bodies.report()
    assert (report.bodies, report.shapes, report.shapes_read) == (5, 5, 5)
    assert report.pairs_possible == 10
    assert report.pairs_examined == report.pairs_overlapping == 4 + 3
    assert report.planes_asked >= report.facets_touched > 0
    bodies.overlaps()
    assert bodies.report().planes_asked == 0  # nothing has moved
    read, examined, overlapping = str(report).splitlines()
    assert read == "5 bodies, 5 of 5 shapes read"
    assert examined.startswith("7 of 10 pairs examined, ")
    assert overlapping == "7 overlap, none of them measured again in wider arithmetic"


def test_the_report_counts_overlaps_too_thin_for_doubles(client):
    for x in (0, 0.5, 1.5 - 1e-13):
        box(client, position=[x, 0, 0])
    bodies = Bodies(client)
    _, second = sorted(contact.overlap.volume for contact in bodies.overlaps())
    assert second == pytest.approx(0.5)
    assert bodies.report().pairs_widened == 1
    assert str(bodies.report()).splitlines()[2] == "2 overlap, 1 of them measured again in wider arithmetic"


# --- names and colours


def test_names_are_those_of_the_model_and_unique(client):
    for x in range(2):
        p.loadURDF("franka_panda/panda.urdf", [x, 0, 0], physicsClientId=client)
    p.loadURDF("r2d2.urdf", physicsClientId=client)
    box(client)
    names = Bodies(client).names
    assert names[0, -1] == "panda#0/panda_link0" and names[1, 8] == "panda#1/panda_hand"
    assert names[2, -1] == "physics/base_link"
    assert names[3, -1].startswith("body 3/")
    assert len(set(names.values())) == len(names)


def test_colours_are_those_pybullet_shows(client):
    robot = p.loadURDF("kuka_iiwa/model.urdf", physicsClientId=client)
    red = p.createVisualShape(p.GEOM_SPHERE, radius=1, rgbaColor=[1, 0, 0, 0.5], physicsClientId=client)
    shape = p.createCollisionShape(p.GEOM_SPHERE, radius=1, physicsClientId=client)
    ball = p.createMultiBody(1, shape, red, physicsClientId=client)
    colors = Bodies(client).colors
    for visual in p.getVisualShapeData(robot, physicsClientId=client):
        assert colors[robot, visual[1]] == visual[7]
    assert colors[ball, -1] == (1, 0, 0, 0.5)


def test_bodies_without_a_visual_shape_have_colours_of_their_own(client):
    for _ in range(2):
        p.createMultiBody(1, -1, physicsClientId=client)
        assert p.getVisualShapeData(0, physicsClientId=client) == ()
    first, second = Bodies(client).colors.values()
    assert first != second
    assert all(len(color) == 4 and 0 <= min(color) <= max(color) <= 1 for color in (first, second))


def test_every_shape_has_a_colour_and_a_name(client, tmp_path):
    random_robot(client, 1, tmp_path)
    p.loadMJCF("mjcf/humanoid.xml", physicsClientId=client)
    bodies = Bodies(client)
    links = {key[:2] for key in bodies.keys}
    assert links <= bodies.colors.keys() and links <= bodies.names.keys()
