"""The shapes of a robot are where pybullet puts them, in configurations by the hundred."""

import numpy as np
import pytest
from robots import DATA, ROBOTS, joint, limit, link, mimic, moved, urdf

from overlapper.audit.kinematics import Kinematics
from overlapper.audit.robot import read_robot
from overlapper.audit.sampling import Sampling
from overlapper.simulation import Bodies
from overlapper.simulation.bullet.model_file import NotRead, load

SEVERAL = [
    DATA / "franka_panda" / "panda.urdf",
    DATA / "kuka_iiwa" / "model.urdf",
    DATA / "laikago" / "laikago.urdf",
    DATA / "humanoid" / "humanoid.urdf",  # spherical joints
    DATA / "mjcf" / "humanoid_symmetric.xml",  # joints beside the origins of their links, axes that are not unit
    DATA / "mjcf" / "pusher.xml",  # several bodies, prismatic joints
    DATA / "kuka_iiwa" / "kuka_with_gripper.sdf",
    ROBOTS / "talos_data" / "robots" / "talos_full_v2.urdf",  # joints that mimic others
    ROBOTS / "tiago_description" / "robots" / "tiago.urdf",
    ROBOTS / "ur_description" / "urdf" / "ur5_gripper.urdf",
]


@pytest.mark.parametrize("path", SEVERAL, ids=lambda path: path.name)
@pytest.mark.usefixtures("by_pybullet")
def test_shapes_are_where_pybullet_puts_them(path, client):
    robot = read_robot(path)
    sampling = Sampling(robot, 2000, seed=1)
    chosen = np.array([sampling.configuration(number) for number in (0, 1, 2, 1998, 1999)])
    positions, orientations = Kinematics(robot).poses(chosen)
    load(path, client)
    bodies = Bodies(client)
    assert positions.shape == (len(chosen), len(bodies.keys), 3)
    for row, configuration in enumerate(chosen):
        moved(robot, client, configuration)
        bodies.update()
        assert np.abs(positions[row] - bodies.positions).max() < 1e-9
        same = np.sign((orientations[row] * bodies.orientations).sum(axis=1))[:, None]
        assert np.abs(orientations[row] * same - bodies.orientations).max() < 1e-9
    assert np.ptp(positions, axis=0).max() > 0.05  # it has moved


def test_joints_that_mimic_others_follow_them(tmp_path):
    path = urdf(
        tmp_path / "gripper.urdf",
        *(link(name, ("1 1 1", "0 0 0")) for name in "abcd"),
        joint("lead", "prismatic", "a", "b", limit(0, 1)),
        joint("second", "prismatic", "a", "c", limit(0, 9) + mimic("lead", -2, 0.5)),
        joint("third", "prismatic", "a", "d", limit(0, 9) + mimic("second", 3, 0.25)),
    )
    robot = read_robot(path)
    assert robot.columns == ("lead",)
    positions, _ = Kinematics(robot).poses(np.array([[0.0], [0.25]]))
    assert positions[..., 2].tolist() == [[0, 0, 0.5, 1.75], [0, 0.25, 0, 0.25]]


def test_links_behind_a_fixed_joint_keep_their_offset(tmp_path):
    free = '<limit lower="1" upper="-1" effort="1" velocity="1"/>'
    path = urdf(
        tmp_path / "robot.urdf",
        *(link(name, ("1 1 1", "0 0 0")) for name in "abc"),
        joint("lead", "prismatic", "a", "b", free),
        joint("follow", "prismatic", "a", "c", limit(0, 9) + mimic("lead", 2, 0.5)),
    )
    robot = read_robot(path)
    assert robot.columns == () and robot.unmoved == [("prismatic", "lead")]
    positions, _ = Kinematics(robot).poses(Sampling(robot, 3, 0).block(1))
    assert positions[..., 2].tolist() == [[0, 0, 0.5]] * 2


def test_continuous_joints_turn_once_and_unbounded_joints_stay(tmp_path):
    free = '<limit lower="1" upper="-1" effort="1" velocity="1"/>'
    path = urdf(
        tmp_path / "robot.urdf",
        *(link(name, ("1 1 1", "0 0 0")) for name in "abcd"),
        joint("wheel", "continuous", "a", "b"),
        joint("slide", "prismatic", "a", "c", free),
        joint("table", "planar", "a", "d"),
    )
    robot = read_robot(path)
    (wheel,) = robot.degrees
    assert (wheel.name, wheel.range, wheel.lower, wheel.upper) == ("wheel", "endless", -np.pi, np.pi)
    assert robot.unmoved == [("prismatic", "slide"), ("planar", "table")]


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        (mimic("nobody"), "the joint 'j' mimics 'nobody', which is not a revolute or prismatic joint"),
        (mimic("j"), "the joint 'j' mimics itself"),
        (mimic("k"), "the joint 'j' mimics itself"),
        (mimic("k", "much"), "the joint 'j' has <mimic multiplier='much'>, which is not a number"),
    ],
)
def test_a_mimic_joint_without_a_master_is_refused_in_one_sentence(more, sentence, tmp_path):
    path = urdf(
        tmp_path / "robot.urdf",
        *(link(name, ("1 1 1", "0 0 0")) for name in "abc"),
        joint("j", "prismatic", "a", "b", limit(0, 1) + more),
        joint("k", "prismatic", "a", "c", limit(0, 1) + mimic("j")),
    )
    with pytest.raises(NotRead, match=sentence):
        read_robot(path)


def test_text_after_the_robot_is_ignored_and_invalid_xml_is_refused(tmp_path):
    path = urdf(tmp_path / "robot.urdf", link("a", ("1 1 1", "0 0 0")))
    whole = path.read_text()
    path.write_text(f"{whole}\n</robot> & so on")
    assert len(read_robot(path).tree.shapes) == 1
    path.write_text(whole.replace("<link", '<material name="&unknown;"/><link'))
    with pytest.raises(NotRead, match=r"robot.urdf cannot be read: it is not XML: undefined entity: line 1"):
        read_robot(path)
