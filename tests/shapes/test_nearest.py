"""The nearest points of triangles: within a triangle, on an edge, and at a corner."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from overlapper.shapes.nearest import nearest_weights

TRIANGLE = np.array([[-1, -1, 0], [2, -1, 0], [-1, 2, 0]])


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0), (2, 1, 0)])
@pytest.mark.parametrize(
    ("point", "nearest"),
    [
        ((0.3, 0.2, 5), (0.3, 0.2, 0)),
        ((0.5, -4, 1), (0.5, -1, 0)),
        ((3, 3, -1), (0.5, 0.5, 0)),
        ((-3, -2, 1), (-1, -1, 0)),
        ((9, -1, 0), (2, -1, 0)),
    ],
)
def test_weights_are_those_of_the_nearest_point(point, nearest, order):
    corners = TRIANGLE[list(order)]
    (weights,) = nearest_weights(corners[None] - np.array(point))
    assert weights.min() >= 0 and weights.sum() == pytest.approx(1)
    assert_allclose(weights @ corners, nearest, atol=1e-15)
