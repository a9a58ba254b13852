"""Painted triangles: at every pixel, the nearest face is in front, also where bodies go through each other."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from overlapper import Box, Placed
from overlapper.quaternion import rotated
from overlapper.viewer.raster import painted
from overlapper.viewer.tessellation import tessellation

SLOPE, WIDTH, HEIGHT = 0.5, 120, 90
RED, GREEN, BLUE = np.eye(3)
# Three bars that go through each other before the camera, and one that begins behind the camera.
BARS = [
    (Placed(Box([1, 0.2, 0.2]), (0, 0, -2.5), (0, 0.2, 0.1, 0.9)), RED),
    (Placed(Box([0.2, 1, 0.2]), (0.1, 0, -2.5), (0.3, 0, 0.1, 0.9)), GREEN),
    (Placed(Box([0.3, 0.3, 4]), (0.8, -0.7, -1)), BLUE),
]


def front(placed, color, opacity):
    """The triangles of a body that are turned to the camera, and their colours."""
    drawn = tessellation(placed.shape)
    corners = (rotated(placed.orientation, drawn.vertices) + placed.position)[drawn.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    seen = corners[(normals * corners[:, 0]).sum(axis=1) < 0]
    return seen, np.tile([*color, opacity], (len(seen), 1))


def entries(placed):
    """How far along the ray of each pixel the body is entered, (HEIGHT, WIDTH); inf where the ray misses it."""
    x = (np.arange(WIDTH) + 0.5 - WIDTH / 2) * 2 * SLOPE / HEIGHT
    y = (HEIGHT / 2 - np.arange(HEIGHT) - 0.5) * 2 * SLOPE / HEIGHT
    rays = np.stack([*np.meshgrid(x, y), -np.ones((HEIGHT, WIDTH))], axis=-1)
    back = placed.orientation * [-1, -1, -1, 1]
    eye, rays = rotated(back, -placed.position), rotated(back, rays)
    half = placed.shape.half_extents
    with np.errstate(divide="ignore"):
        ends = np.sort([(-half - eye) / rays, (half - eye) / rays], axis=0)
    enters, leaves = ends[0].max(axis=-1), ends[1].min(axis=-1)
    return np.where((enters < leaves) & (enters > 0), enters, np.inf)


def test_the_nearest_body_is_seen_at_every_pixel():
    parts = [front(placed, color, 1.0) for placed, color in BARS]
    image = painted(*map(np.concatenate, zip(*parts)), SLOPE, WIDTH, HEIGHT)
    depths = np.array([entries(placed) for placed, _ in BARS])
    expected = np.where(np.isfinite(depths).any(axis=0), depths.argmin(axis=0), -1)
    found = np.where(image[..., 3] > 0.5, image[..., :3].argmax(axis=-1), -1)
    both = np.isfinite(depths[:2]).all(axis=0)
    assert all((depths[k] < depths[1 - k])[both].sum() > 50 for k in (0, 1))  # each is in front of the other somewhere
    assert all((expected == each).sum() > 100 for each in (-1, 0, 1, 2))
    even = (image == image.round()).all(axis=-1)  # not on an edge
    assert even.mean() > 0.9
    assert (found == expected)[even].all()


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 0, 1], [1, 2, 0]])
def test_translucent_faces_are_painted_from_far_to_near_in_whatever_order_they_are_given(order):
    corners = np.array([[-9, -9, 0], [9, -9, 0], [0, 18, 0]])
    triangles = np.array([corners - [0, 0, depth] for depth in (4.0, 3.0, 2.0)])[order]
    colors = np.column_stack([np.eye(3), [0.5, 0.25, 0.5]])[order]
    image = painted(triangles, colors, SLOPE, 4, 3)
    opacity = 1 - 0.5 * 0.75 * 0.5
    assert_allclose(image[1, 2], [0.1875 / opacity, 0.125 / opacity, 0.5 / opacity, opacity], rtol=1e-6)


def test_triangles_that_share_an_edge_leave_no_gap_and_do_not_overlap():
    rng = np.random.default_rng(4)
    grid = np.stack([*np.meshgrid(np.linspace(-3, 3, 12), np.linspace(-3, 3, 12)), np.full((12, 12), -4)], axis=-1)
    grid[..., :2] += rng.uniform(-0.15, 0.15, (12, 12, 2))
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    triangles = np.stack([a, b, c, a, c, d], axis=2).reshape(-1, 3, 3)
    image = painted(triangles, np.full((len(triangles), 4), 0.5), SLOPE, WIDTH, HEIGHT)
    assert_allclose(image, 0.5, rtol=1e-6)


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_the_later_of_two_coplanar_faces_is_in_front(order):
    triangles = np.array(
        [[[-9, -9, -2], [9, -9, -2], [0, 9, -2]], [[-8, -9, -2], [9, -8, -2], [0, 8, -2]]], dtype=float
    )
    colors = np.array([[1, 0, 0, 1], [0, 1, 0, 1]], dtype=float)
    image = painted(triangles[order], colors[order], SLOPE, WIDTH, HEIGHT)
    assert_allclose(image, np.broadcast_to(colors[order[1]], image.shape))


def test_faces_seen_edge_on_or_not_at_all_leave_the_image_empty():
    edge_on = [[[0, 0, -1], [0, 1, -2], [0, -1, -2]]]
    behind = [[[-9, -9, 2], [9, -9, 2], [0, 9, 2]]]
    clear = [[[-9, -9, -2], [9, -9, -2], [0, 9, -2]]]
    colors = np.array([[1, 1, 1, 1], [1, 1, 1, 1], [1, 1, 1, 0]], dtype=float)
    image = painted(np.array(edge_on + behind + clear, dtype=float), colors, SLOPE, WIDTH, HEIGHT)
    assert not image.any()
