"""Sampled configurations: rest, corners, and random ones between the limits, the same in any order of asking."""

import numpy as np
import pytest
from robots import DATA, joint, limit, link, urdf

from overlapper.audit.robot import read_robot
from overlapper.audit.sampling import ALL_CORNERS, BLOCK, SOME_CORNERS, Sampling


def chain(folder, joints):
    """A robot of so many joints between -1 and 2."""
    links = [link(f"l{k}", ("1 1 1", "0 0 0")) for k in range(joints + 1)]
    ties = [joint(f"j{k}", "revolute", f"l{k}", f"l{k + 1}", limit(-1, 2)) for k in range(joints)]
    return read_robot(urdf(folder / "chain.urdf", *links, *ties))


def test_first_comes_rest_and_then_all_corners(tmp_path):
    sampling = Sampling(chain(tmp_path, 3), 1000, seed=0)
    assert sampling.first_random == 1 + 8
    assert sampling.configuration(0).tolist() == [0, 0, 0]
    assert len(np.unique(sampling.block(0)[1:], axis=0)) == 8
    assert set(np.unique(sampling.block(0)[1:])) == {-1, 2}


def test_with_many_joints_each_joint_visits_its_limits_alone_before_some_corners(tmp_path):
    sampling = Sampling(chain(tmp_path, ALL_CORNERS + 1), 1000, seed=0)
    alone, corners = sampling.block(0)[1 : 1 + 2 * 9], sampling.block(0)[1 + 2 * 9 :]
    assert ((alone != 0).sum(axis=1) == 1).all() and sorted(set(alone[alone != 0])) == [-1, 2]
    assert corners.shape == (SOME_CORNERS, 9) and set(np.unique(corners)) == {-1, 2}


def test_with_few_configurations_the_first_ones_are_sampled(tmp_path):
    sampling = Sampling(chain(tmp_path, 3), 4, seed=0)
    assert [len(block) for block in sampling.blocks] == [4] and sampling.block(0).shape == (4, 3)


def test_the_same_seed_is_the_same_configurations_whatever_their_number(tmp_path):
    robot = chain(tmp_path, 2)
    few, many, others = (Sampling(robot, *each) for each in ((BLOCK + 100, 1), (3 * BLOCK, 1), (3 * BLOCK, 2)))
    for number in (0, 3, 5, 100, BLOCK + 50):
        assert (few.configuration(number) == many.configuration(number)).all()
    assert (many.configuration(2 * BLOCK) != others.configuration(2 * BLOCK)).all()
    drawn = np.concatenate([many.block(number) for number in range(1, len(many.blocks))])
    assert len(drawn) == 3 * BLOCK - many.first_random == len(np.unique(drawn, axis=0))
    # Ten standard deviations of the mean of uniform numbers.
    assert drawn.min() > -1 and drawn.max() < 2 and abs(drawn.mean() - 0.5) < 10 * np.sqrt(3 / 4 / drawn.size)


def test_a_joint_whose_limits_exclude_0_rests_halfway():
    robot = read_robot(DATA / "mjcf" / "ant.xml")
    rest = dict(zip(robot.columns, Sampling(robot, 1, seed=0).configuration(0)))
    limits = {degree.name: (degree.lower, degree.upper) for degree in robot.degrees}
    assert limits["ankle_1"] == pytest.approx(np.radians((30, 100)))
    assert rest["ankle_1"] == pytest.approx(np.radians(65)) and rest["hip_1"] == 0


def test_spherical_joints_reach_every_orientation():
    robot = read_robot(DATA / "humanoid" / "humanoid.urdf")
    spherical = [degree for degree in robot.degrees if degree.range == "spherical"]
    assert len(spherical) == 8
    sampling = Sampling(robot, 2 * BLOCK, seed=0)
    for degree in spherical:
        turns = sampling.block(1)[:, degree.column : degree.column + 4]
        assert np.abs(np.linalg.norm(turns, axis=1) - 1).max() < 1e-12
        # A uniform turn takes a vector to everywhere on the sphere: its second moments are a third each.
        vector = np.array([turns[:, 0] * turns[:, 2], turns[:, 1] * turns[:, 2], turns[:, 3] * turns[:, 2]])
        assert np.abs((turns**2).mean(axis=0) - 1 / 4).max() < 0.02 and np.abs(vector.mean(axis=1)).max() < 0.02


@pytest.mark.parametrize(
    ("count", "seed", "sentence"),
    [(0, 0, "configurations must be 1 or more, not 0"), (1, -1, "seed must be 0 or more, not -1")],
)
def test_invalid_sample_arguments_are_refused(count, seed, sentence, tmp_path):
    with pytest.raises(ValueError, match=sentence):
        Sampling(chain(tmp_path, 1), count, seed)
