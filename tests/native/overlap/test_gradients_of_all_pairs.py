"""The first derivatives of the volume of every two kinds of shapes, by pose and by shape, against differences."""

import numpy as np
import pytest
from pairs_of_kinds import PAIRS, PairOfKinds


@pytest.mark.parametrize("kinds", PAIRS, ids=" and ".join)
def test_derivatives_by_pose_and_by_shape_against_differences_of_volumes(kinds):
    pair = PairOfKinds(kinds)
    assert pair.overlap(pair.numbers)
    step = 1e-5
    for body, found in enumerate(pair.gradient()):
        assert np.isfinite(found).all()
        for k in range(len(found)):
            volumes = []
            for side in (-1, 1):
                numbers = [each.copy() for each in pair.numbers]
                numbers[body][k] += side * step
                volumes.append(pair.overlap(numbers).volume)
            assert found[k] == pytest.approx((volumes[1] - volumes[0]) / (2 * step), abs=1e-8), k


@pytest.mark.parametrize("kinds", PAIRS, ids=" and ".join)
def test_a_motion_of_both_bodies_leaves_the_volume(kinds):
    # Together, the bodies have no force, and no moment about the origin.
    pair = PairOfKinds(kinds, seed=1)
    found = pair.overlap(pair.numbers)
    gradient = found.gradient
    moments = gradient[:, 3:] + np.cross([position for position, _ in pair.poses], gradient[:, :3])
    assert np.abs(gradient[:, :3].sum(0)).max() <= 1e-12 * found.area
    assert np.abs(moments.sum(0)).max() <= 1e-11 * found.area
