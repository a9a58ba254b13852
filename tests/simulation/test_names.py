"""Names of bodies: from their files, robots, meshes and shapes, or given by the user."""

import numpy as np
import pybullet as p
import pytest
from simulated import DATA, box

from overlapper.simulation import Bodies, Recorder, UnknownBodyWarning
from overlapper.simulation.naming import body_name


def bases(client, **how) -> list[str]:
    """The names of all bodies, without those of their links."""
    return [name.partition("/")[0] for (_, link), name in Bodies(client, **how).names.items() if link == -1]


@pytest.mark.parametrize(
    ("own", "file", "name"),
    [
        ("cube.urdf", "duck_vhacd.urdf", "duck"),
        ("physics", "r2d2.urdf", "r2d2"),
        ("plane", "laikago/laikago.urdf", "laikago"),
        ("lbr_iiwa", "kuka_iiwa/model.urdf", "lbr_iiwa"),
        ("lbr_iiwa", "kuka_iiwa/model_free_base.urdf", "lbr_iiwa"),
        ("Amazon Pod", "kiva_shelf/model.sdf", "Amazon Pod"),
        ("a1_description", None, "a1"),
        ("robot", "ur5/robot.urdf", "ur5"),
        ("blob007", "random_urdfs/007/007.urdf", "blob007"),
        ("cube", "cube.urdf", "cube"),
        ("cube", "a/b/robot.urdf", "cube"),
        ("urdf_robot", None, "urdf_robot"),
        ("left_finger.urdf", None, "left_finger"),
        ("", "model.urdf", "model"),
        ("", None, ""),
        ("x\x1b[31m", None, r"x\x1b[31m"),
    ],
)
def test_the_most_specific_name_is_used(own, file, name):
    assert body_name(own, file, True, (), None) == name


def test_bodies_of_one_file_are_called_by_their_own_names():
    assert body_name("shelf", "warehouse.sdf", False, (), None) == "shelf"
    assert body_name("a/b/part0.obj", "warehouse.sdf", False, (), None) == "warehouse"


def test_files_that_a_recorder_hears_are_the_names_of_their_bodies(client):
    with Recorder(client) as recorder:
        p.loadURDF("duck_vhacd.urdf", physicsClientId=client)
        for x in range(2):
            p.loadURDF(
                fileName=str(DATA / "r2d2.urdf") if x else "r2d2.urdf", basePosition=[x, 0, 1], physicsClientId=client
            )
        p.loadSDF("kiva_shelf/model.sdf", physicsClientId=client)
        p.loadMJCF("mjcf/ant.xml", physicsClientId=client)
    assert bases(client, recorder=recorder) == ["duck", "r2d2#1", "r2d2#2", "Amazon Pod", "ant"]


def test_a_body_that_takes_over_a_number_does_not_take_over_the_file(client):
    with Recorder(client) as recorder:
        p.removeBody(p.loadURDF("duck_vhacd.urdf", physicsClientId=client), physicsClientId=client)
        box(client)
    assert bases(client, recorder=recorder) == ["box"]


def test_without_a_recorder_meshes_and_shapes_say_what_a_body_is(client):
    p.loadURDF("duck_vhacd.urdf", physicsClientId=client)
    box(client)
    corners = np.random.default_rng(0).normal(size=(8, 3)).tolist()
    hull = p.createCollisionShape(p.GEOM_MESH, vertices=corners, physicsClientId=client)
    p.createMultiBody(1, hull, physicsClientId=client)
    parts = p.createCollisionShapeArray([p.GEOM_SPHERE] * 2, radii=[1, 2], physicsClientId=client)
    p.createMultiBody(1, parts, physicsClientId=client)
    assert bases(client) == ["duck", "box", "hull", "body 3"]


def test_a_given_name_is_used_everywhere(client):
    crates = [box(client, position=[0.9 * x, 0, 0]) for x in range(3)]
    names = {crates[0]: "crate", np.int64(crates[1]): "crate", 99: "of nobody yet"}
    with pytest.warns(
        UnknownBodyWarning, match=r"^names has bodies that are not in the simulation: 99: 'of nobody yet'$"
    ):
        bodies = Bodies(client, names=names)
    assert set(bodies.names.values()) == {"crate#0/link0", "crate#1/link0", "box/link0"}
    assert [(each.bodyA, each.bodyB) for each in bodies.overlaps(pairs=[("crate#1", "box")])] == [(1, 2)]
    p.resetBasePositionAndOrientation(crates[0], [np.nan] * 3, [0, 0, 0, 1], physicsClientId=client)
    with pytest.warns(UserWarning, match=r"^crate#0 \(body 0"):
        bodies.update()


@pytest.mark.parametrize("names", [{"duck": 3}, {3: ""}, {3: None}, ["duck"], "duck"])
def test_invalid_names_are_refused(client, names):
    with pytest.raises(
        ValueError, match=r"^names must be a dictionary of names by the numbers of bodies, such as \{3: 'duck'\}, not"
    ):
        Bodies(client, names=names)
