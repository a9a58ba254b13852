"""Bounds the part of an overlap of two meshes that the rounding of their corners explains."""

import numpy as np
import pytest
from in_mm import CUBE, L_SHAPE

from overlapper import Hull, write_mesh
from overlapper.audit.clashes import _area_within, clashes, read
from overlapper.polytopes.decomposition import ROUNDING

CORNER = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]])  # of area 1/2, in the plane z = 0


@pytest.mark.parametrize(
    ("lower", "upper", "area"),
    [
        ([0, 0, 0], [2, 2, 2], 0.5),  # the triangle lies on a face of the box
        ([0, 0, -2], [2, 2, 0], 0.5),
        ([1, 0, -1], [2, 2, 1], 0.5),  # only a corner reaches the box
        ([-2, -2, -1], [0, 0, 1], 0.5),
        ([0, 0, 1e-9], [2, 2, 2], 0.0),
        ([0, 0, -2], [2, 2, -1e-9], 0.0),
        ([1.1, 0, -1], [2, 2, 1], 0.0),
        ([0, -2, -1], [2, -0.1, 1], 0.0),
    ],
)
def test_the_area_within_a_box_is_that_of_the_triangles_whose_boxes_reach_it(lower, upper, area):
    assert _area_within(CORNER, np.array(lower, float), np.array(upper, float)) == pytest.approx(area)


def test_a_triangle_has_no_more_area_within_a_box_than_the_largest_section_of_the_box():
    large = 1000 * CORNER - [100, 100, 0]
    box = np.array([0.0, 0.0, -1.0]), np.array([2.0, 3.0, 0.5])
    assert _area_within(large, *box) == pytest.approx(np.linalg.norm([2 * 3, 3 * 1.5, 1.5 * 2]))


@pytest.mark.parametrize(("times", "status"), [(0.5, "touching"), (20.0, "clash")])
def test_a_slab_as_thin_as_corners_are_rounded_is_no_clash(tmp_path, times, status):
    (tmp_path / "bent.obj").write_text(L_SHAPE)
    rounded = 2 * np.sqrt(3) * ROUNDING * 20  # mm, as the bodies reach 20 mm from the origin
    write_mesh(tmp_path / "cube.obj", Hull(CUBE + [0, 0, 10 - times * rounded]))
    parts, failures = read([tmp_path], "mm")
    (pair,) = clashes(parts).pairs
    assert (failures, pair.status) == ([], status)
    assert pair.of_meshes and pair.volume == pytest.approx(1e-7 * times * rounded, rel=1e-6)
