"""Meshes of trimesh as shapes: the hull of a convex mesh; any other mesh is refused in one sentence."""

import re
import subprocess
import sys

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_array_equal

from overlapper import Batch, Box, Hull, Placed, Sphere, distance, iou, overlap, penetration_depth
from overlapper.polytopes.decomposition import decompose
from overlapper.union import union_overlap

CUBE = trimesh.creation.box([1, 1, 1])
BALL = Sphere(0.25)


def cube_and(change):
    """The mesh of a cube after a change."""
    mesh = CUBE.copy()
    change(mesh)
    return mesh


@pytest.mark.parametrize(
    "mesh",
    [
        CUBE,
        trimesh.creation.icosphere(3),
        trimesh.creation.cylinder(0.3, 1.0),
        trimesh.primitives.Capsule(radius=0.2, height=0.5),
        cube_and(lambda mesh: mesh.invert()),
        CUBE.subdivide(),
    ],
)
def test_a_convex_mesh_is_its_hull(mesh):
    hull = Hull(mesh.vertices)
    placed = Placed(mesh, (0.1, 0.2, 0.3))
    assert isinstance(placed.shape, Hull) and placed.shape.volume == pytest.approx(hull.volume, rel=1e-12)
    assert overlap(mesh, BALL).volume == pytest.approx(overlap(hull, BALL).volume, rel=1e-12)


def test_every_function_takes_a_mesh_as_a_shape():
    away = Placed(CUBE, trimesh.transformations.translation_matrix([1.25, 0, 0]))
    assert distance(CUBE, away) == 0.25
    assert penetration_depth(CUBE, Placed(CUBE, (0.75, 0, 0))) == 0.25
    assert iou(CUBE, Box([0.5, 0.5, 0.5])) == pytest.approx(1)
    assert Placed(CUBE, np.eye(4)).volume == 1
    found = Batch([CUBE, BALL]).overlaps([[0, 0, 0], [0.5, 0, 0]], [[0, 0, 0, 1]] * 2)
    assert found.volume[0] == pytest.approx(BALL.volume / 2)


TORUS = trimesh.creation.torus(1, 0.25, major_sections=12, minor_sections=8)
CALL = "overlapper.polytopes.decomposition.decompose(mesh.triangles).parts"
CONCAVE = f"a convex mesh: {CALL} are convex parts for overlapper.union.union_overlap"


@pytest.mark.parametrize(
    ("mesh", "reason"),
    [
        (TORUS, CONCAVE),
        (trimesh.util.concatenate([CUBE, CUBE.copy().apply_translation([3, 0, 0])]), CONCAVE),
        (
            cube_and(lambda mesh: mesh.update_faces(np.arange(12) > 0)),
            "a closed mesh: its surface has 3 open edges; Hull(mesh.vertices) is its convex hull",
        ),
        (trimesh.Trimesh(), "a closed convex mesh: the mesh has no triangle with an area"),
        (
            cube_and(lambda mesh: mesh.vertices.__setitem__(0, np.nan)),
            "a closed convex mesh: the mesh has vertices that are not finite",
        ),
        (
            cube_and(lambda mesh: mesh.faces.__setitem__(0, mesh.faces[0, ::-1])),
            "a mesh with all triangles facing outwards: mesh.fix_normals() turns them",
        ),
    ],
)
def test_a_mesh_that_is_no_convex_solid_is_refused_in_one_sentence(mesh, reason):
    for name, make in (
        ("shape", lambda: Placed(mesh)),
        ("shapes[1]", lambda: overlap(BALL, mesh)),
        ("b", lambda: distance(BALL, mesh)),
    ):
        with pytest.raises(ValueError, match=f"^{re.escape(f'{name} must be {reason}')}$"):
            make()


def test_a_point_cloud_is_refused_in_one_sentence():
    words = "shape must be a shape, an (n, 3) array of points or a trimesh.Trimesh, not PointCloud: "
    with pytest.raises(TypeError, match=f"^{re.escape(words)}"):
        Placed(trimesh.PointCloud(np.eye(3)))  # it has items, but no length


def test_triangles_that_faced_both_ways_are_a_shape_after_the_call_that_the_message_names():
    mesh = cube_and(lambda mesh: mesh.faces.__setitem__(0, mesh.faces[0, ::-1]))
    mesh.fix_normals()
    assert Placed(mesh).volume == 1


def test_the_parts_of_a_concave_mesh_are_measured_by_the_call_that_the_message_names():
    two = trimesh.util.concatenate([CUBE, CUBE.copy().apply_translation([2, 0, 0])])
    parts = [Placed(part) for part in decompose(two.triangles).parts]
    assert union_overlap(parts, [Placed(Box([2, 0.5, 0.5]), (1, 0, 0))]).volume == pytest.approx(2)


def test_corners_of_a_convex_mesh_are_kept_to_the_last_bit():
    mesh = trimesh.creation.icosphere(1)
    vertices = np.asarray(mesh.vertices)
    found = Placed(mesh).shape.vertices
    assert_array_equal(found[np.lexsort(found.T)], vertices[np.lexsort(vertices.T)])


@pytest.mark.parametrize(
    "before", ["", "sys.modules['trimesh'] = None", "sys.modules['trimesh'] = types.ModuleType('own')"]
)
def test_the_core_does_not_import_trimesh(before):
    program = f"""
import sys, types
{before}
known = sys.modules.get("trimesh")
from overlapper import Sphere, overlap
try:
    overlap(Sphere(1), object())
except TypeError as error:
    print(error)
assert sys.modules.get("trimesh") is known
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    said = "shapes[1] must be a shape, an (n, 3) array of points or a trimesh.Trimesh, not object"
    assert done.stdout.strip() == said, done.stderr
