"""Planes in exact numbers: doubles leave a few candidates, and never leave out the right one."""

from fractions import Fraction

import numpy as np
import pytest

from overlapper.shapes.planes import Planes


@pytest.mark.parametrize("reach", [2**20, 2**40])
def test_the_tightest_of_two_planes_that_doubles_cannot_tell_apart_is_found(reach):
    """Both are 1 m below the point but for 2^-40 m, and doubles of that reach lose more."""
    rng = np.random.default_rng(0)
    for tighter in (0, 1) * 20:
        point = np.array([Fraction(int(x), 2**20) for x in rng.integers(-(2**20), 2**20, 3)]) * reach
        normals = np.array([rng.permutation([3, 4, 12]) * rng.choice([-1, 1], 3) for _ in range(2)], object)
        heights = np.array([Fraction(13)] * 2)
        heights[tighter] += Fraction(1, 2**40)
        planes = Planes.of(normals, normals @ point - heights)
        assert (planes.tightest(point) == planes.normals[tighter]).all()


def test_a_ray_leaves_through_a_plane_that_it_starts_on_and_hardly_rises_from():
    """Along the ray, doubles do not tell that it rises."""
    planes = Planes.of(np.array([[1, 1, 0], [0, 1, 0]], object), np.array([0, 2**60], object))
    start, arm = np.array([0, 0, 0], object), np.array([[-(2**60), 2**60 + 1, 0]], object)
    assert planes.exits(start, arm, 1, 30).tolist() == [0]
    assert planes.exits(start, arm + [[-1, 0, 0]], 1, 30).tolist() == [2**30 * 2**60 // (2**60 + 1)]
