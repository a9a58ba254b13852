"""World poses of shapes fixed to moving frames, computed for many shapes at once."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from overlapper import Placed, Sphere, _core
from overlapper.quaternion import composed, rotated

AT_REST = ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])


def test_world_poses_apply_the_frame_after_the_fixed_pose():
    rng = np.random.default_rng(4)
    frames = [(tuple(rng.normal(size=3)), tuple(rng.normal(size=4)), "ignored") for _ in range(5)]
    which, local = rng.integers(5, size=9), rng.normal(size=(9, 3))
    turns = rng.normal(size=(9, 4))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    positions, orientations = _core.world_poses(frames, which, local, turns)
    for row, k in enumerate(which):
        frame = Placed(Sphere(1), *frames[k][:2])
        assert_allclose(positions[row], frame.position + rotated(frame.orientation, local[row]), atol=1e-14)
        assert_allclose(orientations[row], composed(frame.orientation, turns[row]), atol=1e-14)
    assert not positions.flags.writeable and not orientations.flags.writeable


@pytest.mark.parametrize(
    ("frames", "which", "error", "message"),
    [
        ([AT_REST], [1], ValueError, "which must index the frames"),
        ([AT_REST], [-1], ValueError, "which must index the frames"),
        ([AT_REST[:1]], [0], ValueError, "frames must have a position and a quaternion each"),
        ([(AT_REST[1], AT_REST[1])], [0], ValueError, "frames must have positions of 3 numbers and quaternions of 4"),
        ([(1.0, 2.0)], [0], TypeError, "frames must be pairs of sequences of numbers"),
        ([(AT_REST[0], [0.0] * 4)], [0], ValueError, "frames must not have the zero quaternion"),
        ([AT_REST], [0, 0], ValueError, r"positions must have the shape \(k, 3\)"),
    ],
)
def test_an_invalid_frame_is_named(frames, which, error, message):
    with pytest.raises(error, match=message):
        _core.world_poses(frames, np.array(which), [AT_REST[0]], [AT_REST[1]])


def test_a_thing_fixed_by_the_zero_quaternion_is_refused():
    with pytest.raises(ValueError, match=r"^orientations must not have the zero quaternion"):
        _core.world_poses([AT_REST], np.array([0]), [AT_REST[0]], [[0.0] * 4])


@pytest.mark.parametrize("length", [1e-320, 1e-200, 0.1, 3.0, 1e200, 1e308])
def test_quaternions_of_any_length_give_the_same_rotation(length):
    """A rounding apart, and more where the length has lost its digits."""
    turn = np.array([0.5, -0.5, 0.5, 0.5])
    position, orientation = _core.world_poses([([1, 2, 3], turn * length)], np.array([0]), [[1, 2, 3]], [turn])
    same = _core.world_poses([([1, 2, 3], turn)], np.array([0]), [[1, 2, 3]], [turn])
    assert_allclose(position, same[0], atol=1e-15 if length > 1e-300 else 1e-3)
    assert_allclose(orientation, same[1], atol=1e-15 if length > 1e-300 else 1e-3)
    as_long = _core.world_poses([AT_REST], np.array([0]), [[0, 0, 0]], [turn * length])[1]
    assert_allclose(as_long, [turn * length], rtol=1e-15)


def test_a_frame_that_is_not_a_number_is_passed_on():
    nowhere = ([0.0, 0.0, 0.0], [np.nan] * 4)
    positions, orientations = _core.world_poses([nowhere, AT_REST], np.array([0, 1]), np.ones((2, 3)), [AT_REST[1]] * 2)
    assert np.isnan(positions[0]).all() and np.isnan(orientations[0]).all()
    assert np.isfinite(positions[1]).all()


def test_rows_of_an_array_are_frames_like_those_of_pybullet():
    rng = np.random.default_rng(7)
    rows, which = rng.normal(size=(4, 7)), rng.integers(4, size=6)
    local = rng.normal(size=(6, 3)), rng.normal(size=(6, 4))
    given = [(row[:3].tolist(), row[3:].tolist()) for row in rows]
    for found, expected in zip(_core.world_poses(rows, which, *local), _core.world_poses(given, which, *local)):
        assert found.tobytes() == expected.tobytes()
    with pytest.raises(ValueError, match=r"frames must be an array of shape \(n, 7\), not of shape \(4, 6\)"):
        _core.world_poses(rows[:, :6], which, *local)


def test_chosen_frames_have_the_scalar_part_last_and_follow_edits():
    positions, quaternions = np.arange(6.0).reshape(2, 3), np.array([[1.0, 2, 3, 4], [5, 6, 7, 8]])
    frames = _core.ChosenFrames(positions, quaternions, [1, 0])
    assert frames.read().tolist() == [
        [3, 4, 5, 6, 7, 8, 5],
        [0, 1, 2, 2, 3, 4, 1],
    ]
    positions[1, 0] = 9
    assert frames.read()[0].tolist() == [9, 4, 5, 6, 7, 8, 5]
    with pytest.raises(ValueError, match="which must index the positions"):
        _core.ChosenFrames(positions, quaternions, [2])
    with pytest.raises(ValueError, match="quaternions must have a row for each of `positions`"):
        _core.ChosenFrames(positions, quaternions[:1], [0])
    with pytest.raises(ValueError, match="positions must be a contiguous array of doubles"):
        _core.ChosenFrames(positions.astype(np.float32), quaternions, [0])


def test_fixed_shapes_tell_whether_their_poses_are_usable():
    shapes = _core.FixedShapes([0], np.zeros((1, 3)), np.array([AT_REST[1]], dtype=float))

    def usable(*position, turn=(0.0, 0.0, 0.0, 1.0)):
        return shapes.world(np.array([[*position, *turn]]), 10)[2]

    assert usable(1, -9, 0)
    assert not usable(1, -10, 0)
    assert not usable(np.nan, 0, 0)
    assert not usable(0, 0, 0, turn=(0, 0, np.inf, 1))


def test_a_point_has_moved_if_a_coordinate_has_changed_by_more_than_its_slack():
    turn = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    points, before = np.array([[1.0, 2, 3], [4, 5, 6]]), np.array([[2.0, -1, 3], [5, -4, 6]])
    both = np.array([True, True])

    def moved(points, slack, meets=both):
        return _core.any_moved(points, np.zeros(3), turn, before, np.array(slack), meets)

    assert not moved(points, [0.1, 0.1])
    further = points + [[0, 0, 0], [0, 0.2, 0]]
    assert moved(further, [0.1, 0.1]) and not moved(further, [0.1, 0.3])
    assert not moved(further, [0.1, 0.1], np.array([True, False]))
    assert moved(points * [[np.nan], [1]], [0.1, 0.1]) and not moved(points - 100, [np.inf, np.inf])
    with pytest.raises(ValueError, match="positions must have a row in each array"):
        moved(points[:1], [0.1, 0.1])


def test_a_snapshot_notices_edits_of_any_type_once():
    arrays = [np.zeros(3), np.zeros((2, 2), dtype=np.int32), np.empty(0), np.array([np.nan])]
    snapshot = _core.Snapshot(arrays)
    assert not snapshot.renew()
    arrays[1][1, 0] = 5
    assert snapshot.renew() and not snapshot.renew()
    with pytest.raises(TypeError, match="arrays must be arrays of numpy"):
        _core.Snapshot([[1.0]])
