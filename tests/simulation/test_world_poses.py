"""What is fixed to moving frames: their poses in the world, many at once."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from overlapper import Placed, Sphere, _core
from overlapper.quaternion import composed, rotated

AT_REST = ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])


def test_poses_are_those_of_the_frame_then_of_what_is_fixed_to_it():
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
        ([AT_REST], [0, 0], ValueError, r"positions must have the shape \(k, 3\)"),
    ],
)
def test_what_is_no_frame_is_named(frames, which, error, message):
    with pytest.raises(error, match=message):
        _core.world_poses(frames, np.array(which), [AT_REST[0]], [AT_REST[1]])
