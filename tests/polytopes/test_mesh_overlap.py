"""Common volumes of closed meshes, convex or concave, against exact booleans of the same meshes."""

import bearing
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold

from overlapper.polytopes import mesh_overlap as module
from overlapper.polytopes.mesh_overlap import mesh_overlap


def triangles(solid):
    mesh = solid.to_mesh64()
    return mesh.vert_properties[:, :3][mesh.tri_verts.astype(int)]


def carved(rng):
    """A cube with balls and turned boxes added or subtracted."""
    solid = Manifold.cube([1, 1, 1], True)
    for _ in range(rng.integers(4)):
        ball = Manifold.sphere(0.4, 12)
        box = Manifold.cube(rng.uniform(0.2, 0.9, 3), True).rotate(rng.uniform(0, 90, 3))
        tool = (ball if rng.random() < 0.5 else box).translate(0.5 * rng.normal(size=3))
        solid = solid + tool if rng.random() < 0.4 else solid - tool
    return solid


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_carved_bodies_share_what_a_boolean_says(seed):
    rng = np.random.default_rng(seed)
    a, b = carved(rng), carved(rng).translate(0.4 * rng.normal(size=3))
    volume, error = mesh_overlap(triangles(a), triangles(b))
    # The boolean rounds to a grid of its own, 1e-12 of the size.
    assert abs(volume - (a ^ b).volume()) <= error + 1e-10
    assert error < 1e-9


@pytest.mark.parametrize("pair", [("bolt_4.stl", "sleeve.ply"), ("plate_upper.stl", "bolt_1.stl")])
def test_a_bolt_in_its_hole_shares_nothing_and_an_oversized_bolt_shares_a_sliver(pair):
    solids = dict(bearing.solids(0.65))
    a, b = (solids[name] for name in pair)
    volume, error = mesh_overlap(triangles(a), triangles(b))
    assert abs(volume - (a ^ b).volume()) <= error + 1e-9
    assert (volume > error) == (pair == bearing.CLASH)


def test_upright_faces_in_one_plane_and_bodies_apart_share_nothing():
    cube = triangles(Manifold.cube([1, 1, 1]))
    assert mesh_overlap(cube, cube + [1, 0, 0]) == (0, 0)
    assert mesh_overlap(cube, cube + [0, 0, 3]) == (0, 0)
    volume, error = mesh_overlap(cube, cube)
    assert abs(volume - 1) <= error < 1e-12


def test_a_triangle_that_is_hardly_tilted_is_counted_as_error():
    lean = triangles(Manifold.cube([1, 1, 1]))
    lean[lean[..., 0] == 1] += [1e-16, 0, 0]  # nothing, in doubles
    lean[(lean[..., 0] == 1) & (lean[..., 2] == 0)] += [2e-16, 0, 0]
    volume, error = mesh_overlap(lean, triangles(Manifold.cube([0.5, 1, 1]).translate([0.5, 0, 0])))
    assert abs(volume - 0.5) <= error < 1e-12


def test_meshes_with_too_many_pairs_of_triangles_have_no_answer(monkeypatch):
    monkeypatch.setattr(module, "MOST", 3)
    cube = triangles(Manifold.cube([1, 1, 1]))
    assert mesh_overlap(cube, cube) is None
