"""Names of bodies: from their files, robots, meshes and shapes, or given by a wrapper of pybullet or the user."""

from dataclasses import replace

import numpy as np
import pybullet as p
import pytest
from simulated import DATA, box

from overlapper import Box, HalfSpace
from overlapper.simulation import Bodies, Recorder, UnknownBodyWarning
from overlapper.simulation.model import ModelledBody, ModelledShape
from overlapper.simulation.naming import Labels, body_name, look


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
    assert set(bodies.names.values()) == {"crate#0", "crate#1", "box"}
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


RED, BLUE = (0.9, 0.1, 0.1, 1.0), (0.1, 0.1, 0.9, 1.0)


def colored_box(client, color, side=0.1, place=(0, 0, 0)) -> int:
    half = [side / 2] * 3
    shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=half, physicsClientId=client)
    visual = p.createVisualShape(p.GEOM_BOX, halfExtents=half, rgbaColor=color, physicsClientId=client)
    return p.createMultiBody(1, shape, visual, place, physicsClientId=client)


@pytest.mark.parametrize(
    ("boxes", "names"),
    [
        ([(RED, 0.1)], ["box"]),
        ([(RED, 0.1), (BLUE, 0.1)], ["red box", "blue box"]),
        ([(RED, 0.1), (RED, 0.005)], ["box 0.1 m", "box 5 mm"]),
        ([(RED, 0.1), (RED, 0.2), (BLUE, 0.1)], ["red box 0.1 m", "red box 0.2 m", "blue box 0.1 m"]),
        ([(RED, 0.1), (RED, 0.1), (BLUE, 0.1)], ["red box#0", "red box#1", "blue box"]),
        ([(RED, 0.1), (RED, 0.1)], ["box#0", "box#1"]),
    ],
)
def test_bodies_of_one_kind_are_told_apart_by_colour_and_size(client, boxes, names):
    for color, side in boxes:
        colored_box(client, color, side)
    assert list(Bodies(client).labels.values()) == names


def test_a_body_keeps_its_name_when_others_come_and_go(client):
    colored_box(client, RED)
    bodies = Bodies(client)
    assert bodies.labels == {0: "box"}
    for color in (RED, BLUE):
        colored_box(client, color)
    bodies.update()
    assert bodies.labels == {0: "box", 1: "red box", 2: "blue box"}
    colored_box(client, RED)
    p.removeBody(0, physicsClientId=client)
    bodies.update()
    assert bodies.labels == {1: "red box", 2: "blue box", 3: "box#3"}
    assert bodies.names == {(id, -1): label for id, label in bodies.labels.items()}


def test_no_two_bodies_of_a_run_have_one_name():
    cube = ModelledBody("cube", {-1: "base"}, {}, {}, 1, ())
    labels = Labels()
    assert labels.of({1: replace(cube, name="cube#2"), 2: cube, 3: cube}) == {1: "cube#2", 2: "cube#2.2", 3: "cube#3"}
    assert labels.of({2: replace(cube, look=("red", ""))}) == {2: "red cube"}
    assert labels.of({2: cube}) == {2: "cube#2.2"}


@pytest.mark.parametrize(
    ("color", "word"),
    [
        ((1, 0, 0, 1), "red"),
        ((1, 0.5, 0, 1), "orange"),
        ((0.5, 0.25, 0, 1), "brown"),
        ((1, 1, 0, 1), "yellow"),
        ((0.1, 0.6, 0.1, 1), "green"),
        ((0, 1, 1, 1), "cyan"),
        ((0, 0, 1, 1), "blue"),
        ((0.5, 0, 0.8, 1), "purple"),
        ((1, 0, 0.7, 1), "pink"),
        ((1, 0, 0.1, 1), "red"),
        ((0.1, 0, 0, 1), "black"),
        ((0.6, 0.6, 0.6, 1), "grey"),
        ((1, 1, 1, 1), "white"),
        ((1, 0, 0, 0), ""),
        (None, ""),
    ],
)
def test_colours_have_words(color, word):
    assert look(color, []) == (word, "")


def test_the_size_is_the_longest_side_of_all_shapes():
    turn = np.array([0.0, 0.0, 0.0, 1.0])
    boxes = [ModelledShape(-1, k, Box([0.1, 0.2, 0.05]), np.array([k, 0.0, 0.0]), turn) for k in range(2)]
    assert look(None, boxes[:1]) == ("", "0.4 m")
    assert look(None, boxes) == ("", "1.2 m")
    assert look(None, [ModelledShape(-1, 0, HalfSpace([0, 0, 1], 0), np.zeros(3), turn)]) == ("", "")


def test_left_out_shapes_have_the_names_of_tables(client):
    flat = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
    for _ in range(2):
        shape = p.createCollisionShape(p.GEOM_MESH, vertices=flat, physicsClientId=client)
        p.createMultiBody(1, shape, physicsClientId=client)
    with pytest.warns(UserWarning, match=r"^hull#\d \(body"):
        bodies = Bodies(client)
    assert [each.name for each in bodies.skipped] == ["hull#0", "hull#1"]


class Wrapper:
    """Makes bodies as panda-gym does."""

    def __init__(self, client):
        self._client, self._bodies_idx = client, {}

    def box(self, name):
        shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.1] * 3, physicsClientId=self._client)
        self._bodies_idx[name] = p.createMultiBody(1, shape, physicsClientId=self._client)

    def robot(self, name):
        self._bodies_idx[name] = p.loadURDF("r2d2.urdf", physicsClientId=self._client)


def test_names_in_a_wrapper_of_pybullet_are_used_unless_others_are_given(client):
    with Recorder(client) as recorder:
        wrapper = Wrapper(client)
        wrapper.box("target")
        wrapper.box("object\n")
        wrapper.robot("arm")
        wrapper._bodies_idx |= {7: 0, "goal": None}  # no names of bodies
        box(client)
        bodies = Bodies(client, recorder=recorder, names={0: "cup"})
        assert list(bodies.labels.values()) == ["cup", r"object\n", "arm", "box"]
        assert bodies.names[2, -1] == "arm/base_link"
        p.resetSimulation(physicsClientId=client)
        box(client)
        bodies.update()
        assert bodies.labels == {0: "cup"}
        assert recorder.body_names == {}
