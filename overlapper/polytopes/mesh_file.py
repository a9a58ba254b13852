"""Polytopes from and to mesh files, by trimesh. It writes OBJ, STL and PLY, and reads all formats that trimesh knows.

A file from outside may make its reader hang, crash or run out of memory. Files are therefore parsed in a separate
process, which is kept for the next file.
"""

from __future__ import annotations

import errno
import importlib.util
import os
import stat
import warnings
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from overlapper._core import Hull, Overlap
from overlapper.install import hint
from overlapper.jobs.confined import MEGABYTES, SECONDS, Confined, Unanswered
from overlapper.polytopes import mesh_parser
from overlapper.polytopes.mesh_parser import MeshPart
from overlapper.printable import first_line
from overlapper.whole_file import beside

if importlib.util.find_spec("trimesh") is None:
    raise ImportError(f"overlapper.polytopes.mesh_file needs {hint('trimesh')}")

__all__ = ["MeshPart", "NotConvexWarning", "check_ending", "read_hull", "read_parts", "read_triangles", "write_mesh"]

Array = NDArray[np.float64]
T = TypeVar("T")

# The formats that can be written. OBJ gets sixteen digits after the point. STL and PLY have single precision: STL by
# definition, PLY because trimesh writes it so.
MESHES: dict[str, dict[str, Any]] = {".obj": {"digits": 16}, ".stl": {}, ".ply": {}}

# Some formats need other libraries.
BODIES = (".obj", ".off", ".ply", ".stl")
STEP = (".step", ".stp")
NEEDS = dict.fromkeys(STEP, ("cascadio",)) | {".3mf": ("lxml", "networkx")}

DENT = 1e-4  # of the hull's volume: above the rounding of files in single precision, below what an eye sees

confined = Confined(SECONDS, MEGABYTES)


class NotConvexWarning(UserWarning):
    """A mesh is not the surface of its convex hull, so the hull is larger than the solid that the mesh encloses."""


def read_parts(path: str | Path, units: str = "m") -> list[MeshPart]:
    """The bodies of a mesh file. OBJ, OFF, PLY and STL have one body; glTF, 3MF and STEP have one for each instance.

    `units` is a unit that trimesh knows, for files that do not state their own. OpenCASCADE reads STEP. Raises OSError
    if there is no such file, ImportError without a library that its format needs, ValueError if it is not a mesh.
    """
    missing = [name for name in NEEDS.get(Path(path).suffix.lower(), ()) if importlib.util.find_spec(name) is None]
    if missing:
        raise ImportError(f"{path} needs {hint(*missing)}")
    return _parsed(path, "is not a mesh that can be read", mesh_parser.parts, units)


def read_triangles(path: str | Path) -> Array:
    """All triangles (t, 3, 3) of a mesh file, in the file's own frame. Its unit is taken for m.

    Raises OSError if there is no such file, ValueError if it is no mesh.
    """
    return _parsed(path, "is not a mesh that can be read", mesh_parser.triangles)


def read_hull(path: str | Path) -> Hull:
    """The convex hull of everything in a mesh file, in the file's own frame.

    A mesh with holes or dents gives a NotConvexWarning, because its hull is not the solid itself.

    Parameters
    ----------
    path : str or Path
        The mesh file. Its unit is read as m.

    Returns
    -------
    Hull
        The convex hull of all points.

    Raises
    ------
    OSError
        If there is no such file.
    ValueError
        If the file is not a mesh, or its points span no polytope.
    """
    hull, closed, share = _parsed(path, "is not a mesh with a hull", mesh_parser.hull)
    if not closed:
        warnings.warn(f"{path} is not closed: its convex hull is used instead", NotConvexWarning, stacklevel=2)
    elif share < 1 - DENT:
        what = f"fills {share:.1%} of its convex hull, which is used instead"
        warnings.warn(f"{path} is not convex: it {what}", NotConvexWarning, stacklevel=2)
    return hull


def _parsed(path: str | Path, wrong: str, parse: Callable[..., T], *arguments: str) -> T:
    """The result of a function of `mesh_parser` for a file. ValueError with the words `wrong` and the reason."""
    _must_be_a_file(Path(path), wrong)
    try:
        return confined(parse, Path(path).absolute(), *arguments)
    except Unanswered as unanswered:
        raise ValueError(f"{path} {wrong}: reading it {unanswered}") from None
    except FileNotFoundError as error:
        raise ValueError(f"{path} {wrong}: {_not_found(path, error)}") from error
    except Exception as error:  # of any kind, because every format has its own parser
        raise ValueError(f"{path} {wrong}: {first_line(error)}") from error


def _not_found(path: str | Path, error: FileNotFoundError) -> str:
    """The reason for a FileNotFoundError: OpenCASCADE writes no file if it finds nothing."""
    return "OpenCASCADE finds no shape in it" if Path(path).suffix.lower() in STEP else first_line(error)


def _must_be_a_file(path: Path, wrong: str) -> None:
    """OSError if there is no such file, or it cannot be read; ValueError for a pipe or a device."""
    kind = path.stat().st_mode
    if stat.S_ISDIR(kind):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(kind):
        raise ValueError(f"{path} {wrong}: it is a pipe or a device, not a file")
    path.open("rb").close()


def check_ending(path: str | Path) -> None:
    """Raises ValueError for an ending that `write_mesh` cannot write."""
    if Path(path).suffix not in MESHES:
        raise ValueError(f"a mesh must end in {', '.join(MESHES)}, not {Path(path).name!r}")


def write_mesh(path: str | Path, polytope: Hull | Overlap | Sequence[Hull | Overlap]) -> None:
    """Write hulls or overlaps as a triangle mesh in m, each as a closed surface.

    Parameters
    ----------
    path : str or Path
        The file, which ends in .obj, .stl or .ply. OBJ keeps coordinates to 16 decimal places. STL and PLY keep single
        precision, one part in ten million.
    polytope : Hull, Overlap or sequence of these
        What to write.

    Raises
    ------
    ValueError
        If the file has another ending, or if the bodies have no common part.
    """
    check_ending(path)
    pieces = [each for each in (polytope if isinstance(polytope, Sequence) else [polytope]) if len(each.facets)]
    if not pieces:
        raise ValueError("polytope is empty: the bodies share nothing that could be written")
    import trimesh

    ending = Path(path).suffix
    mesh: Any = trimesh.util.concatenate(
        [
            trimesh.Trimesh(
                each.vertices, [(ring[0], b, c) for ring in each.facets for b, c in pairwise(ring[1:])], process=False
            )
            for each in pieces
        ]
    )
    text = mesh.export(file_type=ending[1:], **MESHES[ending])
    with beside(path) as file:
        file.write_bytes(text.encode() if isinstance(text, str) else text)
