"""Polytopes from and to mesh files, by trimesh: OBJ, STL, PLY and, to be read, whatever else it knows."""

from __future__ import annotations

import warnings
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from overlapper._core import Hull, Overlap
from overlapper.install import hint
from overlapper.printable import first_line
from overlapper.whole_file import beside

try:
    import trimesh
except ImportError as error:
    raise ImportError(f"overlapper.polytopes.mesh_file needs {hint('trimesh')}") from error

__all__ = ["NotConvexWarning", "check_ending", "read_hull", "write_mesh"]

# What can be written, and how: OBJ with sixteen digits after the point; STL and PLY are single precision, the one by
# its nature, the other by trimesh's choice.
MESHES: dict[str, dict[str, Any]] = {".obj": {"digits": 16}, ".stl": {}, ".ply": {}}
DENT = 1e-4  # of the hull's volume: above the rounding of files in single precision, below what an eye sees


class NotConvexWarning(UserWarning):
    """A mesh is not the surface of its convex hull, and the hull is more than the mesh encloses."""


def read_hull(path: str | Path) -> Hull:
    """The convex hull of all that a mesh file shows, in the file's own frame and unit, which is taken for m.

    Warns of a mesh with holes or dents (NotConvexWarning), as its hull is not the solid itself. Raises OSError if there
    is no such file, ValueError if it is no mesh or its points span no polytope.
    """
    Path(path).open("rb").close()  # trimesh would say that the path is no file, whatever the cause
    try:
        mesh: Any = trimesh.load_mesh(str(path))
        hull = Hull(mesh.vertices[np.unique(mesh.faces)])
    except Exception as error:  # of many kinds, as every format has a parser of its own
        raise ValueError(f"{path} is not a mesh with a hull: {first_line(error)}") from error
    mesh.merge_vertices(merge_tex=True, merge_norm=True)  # a seam of colours is no hole
    if not mesh.is_volume:
        warnings.warn(f"{path} is not closed: its convex hull stands for it", NotConvexWarning, stacklevel=2)
    elif mesh.volume < (1 - DENT) * hull.volume:
        share = mesh.volume / hull.volume
        what = f"fills {share:.1%} of its convex hull, which stands for it"
        warnings.warn(f"{path} is not convex: it {what}", NotConvexWarning, stacklevel=2)
    return hull


def check_ending(path: str | Path) -> None:
    """Raises ValueError for a name of which `write_mesh` would not know what to write."""
    if Path(path).suffix not in MESHES:
        raise ValueError(f"a mesh must end in {', '.join(MESHES)}, not {Path(path).name!r}")


def write_mesh(path: str | Path, polytope: Hull | Overlap) -> None:
    """Writes a hull or what bodies share as a closed triangle mesh in m: .obj, .stl or .ply, as the name says.

    OBJ keeps coordinates to 16 decimal places, STL and PLY in single precision, to one part in ten million.
    Raises ValueError for another ending, and where there is nothing to write as the bodies share nothing.
    """
    check_ending(path)
    if len(polytope.facets) == 0:
        raise ValueError("polytope is empty: the bodies share nothing that could be written")
    triangles = [(ring[0], b, c) for ring in polytope.facets for b, c in pairwise(ring[1:])]
    ending = Path(path).suffix
    mesh: Any = trimesh.Trimesh(polytope.vertices, triangles, process=False)
    text = mesh.export(file_type=ending[1:], **MESHES[ending])
    with beside(path) as file:
        file.write_bytes(text.encode() if isinstance(text, str) else text)
