"""Polytopes from and to mesh files, by trimesh: OBJ, STL, PLY and, to be read, whatever else it knows."""

from __future__ import annotations

import json
import struct
import warnings
import zipfile
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

# What a file may have for its size: a little that is packed may be very much, and counts are only numbers.
PACKED = (".bz2", ".gz", ".tgz", ".zip")
ZIPPED = (".3dxml", ".3mf", ".zae")  # formats that are packed files, mostly of text
MOST_UNPACKED = 100  # bytes for each of the file; text of numbers has 3 to 20
MOST_SHOWN = 30_000_000  # corners and indices of a glTF scene, in which a mesh may stand many times: some seconds

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
        _must_fit(Path(path))
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # of numpy and trimesh about figures that Hull refuses
            mesh: Any = trimesh.load_mesh(str(path))
            hull = Hull(mesh.vertices[np.unique(mesh.faces)])
            mesh.merge_vertices(merge_tex=True, merge_norm=True)  # a seam of colours is no hole
            closed = mesh.is_volume
            share = mesh.volume / hull.volume if closed else 0.0
    except Exception as error:  # of many kinds, as every format has a parser of its own
        raise ValueError(f"{path} is not a mesh with a hull: {first_line(error)}") from error
    if not closed:
        warnings.warn(f"{path} is not closed: its convex hull stands for it", NotConvexWarning, stacklevel=2)
    elif share < 1 - DENT:
        what = f"fills {share:.1%} of its convex hull, which stands for it"
        warnings.warn(f"{path} is not convex: it {what}", NotConvexWarning, stacklevel=2)
    return hull


def _must_fit(path: Path) -> None:
    """ValueError for what would take more time and memory than the size of the file tells."""
    size, ending = path.stat().st_size, path.suffix.lower()
    if ending in PACKED:
        raise ValueError("it is packed, and must be unpacked first")
    if ending in ZIPPED:
        with zipfile.ZipFile(path) as packed:
            if sum(each.file_size for each in packed.infolist()) > MOST_UNPACKED * size:
                raise ValueError(f"it unpacks to more than {MOST_UNPACKED} times its size")
    if ending == ".stl":
        with path.open("rb") as file:
            head = file.read(1000)
        if len(head) >= 84 and b"facet" not in head:  # or it is text
            (count,) = struct.unpack_from("<I", head, 80)
            if 84 + 50 * count != size:
                raise ValueError(f"it counts {count:,} triangles, and has room for {(size - 84) // 50:,}")
    if ending in (".glb", ".gltf"):
        _must_be_there(path, _gltf(path), size)


def _gltf(path: Path) -> Any:
    """The JSON of a glTF scene, which in .glb is the first chunk."""
    data = path.read_bytes()
    if path.suffix.lower() == ".glb":
        (length,) = struct.unpack_from("<I", data, 12)
        data = data[20 : 20 + length]
    return json.loads(data)


def _must_be_there(path: Path, scene: Any, size: int) -> None:
    """ValueError if a list of numbers is longer than all bytes there are, or too much is shown of it."""
    names = (str(buffer.get("uri", "")) for buffer in scene.get("buffers", ()))
    beside = [path.parent / name for name in names if not name.startswith("data:")]
    size += sum(file.stat().st_size for file in beside if file.is_file())
    counts = [int(each["count"]) for each in scene.get("accessors", ())]
    if max(counts, default=0) > size:
        raise ValueError(f"it counts {max(counts):,} numbers in {size:,} bytes")
    meshes = []
    for mesh in scene.get("meshes", ()):
        used = [[*each["attributes"].values(), each.get("indices")] for each in mesh["primitives"]]
        meshes.append(sum(counts[i] for row in used for i in row if i is not None))
    shown = sum(meshes[node["mesh"]] for node in scene.get("nodes", ()) if "mesh" in node)
    if shown > MOST_SHOWN:
        raise ValueError(f"it shows {shown:,} corners and indices, which is more than {MOST_SHOWN:,}")


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
