"""Arrows and the frames that they are drawn in."""

import itertools

import numpy as np
import pytest
from numpy.testing import assert_allclose

from overlapper.viewer.look import arrow_length
from overlapper.viewer.tessellation import rotation_from_z


@pytest.mark.parametrize(("area", "length"), [(0, 0.3), (0.81, 0.3), (1.44, 0.4), (3.24, 0.6), (1e6, 0.6)])
def test_an_arrow_is_a_third_of_the_patch_wide_within_bounds_of_the_scene(area, length):
    assert arrow_length(area, 10.0) == pytest.approx(length)


def test_a_rotation_from_z_turns_z_to_any_direction():
    for direction in itertools.product((-1.0, -1e-9, 0.0, 1.0), repeat=3):
        if any(direction):
            unit = np.array(direction) / np.linalg.norm(direction)
            turn = rotation_from_z(unit)
            assert_allclose(turn[:, 2], unit)
            assert_allclose(turn.T @ turn, np.eye(3), atol=1e-15)
            assert np.linalg.det(turn) == pytest.approx(1)
