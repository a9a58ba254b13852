"""Polytopes from and to mesh files, by trimesh: OBJ, STL and PLY are written, and all that trimesh knows are read."""

from __future__ import annotations

import importlib.util
import json
import struct
import warnings
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from overlapper._core import Hull, Overlap
from overlapper.install import hint
from overlapper.jobs.worker import Ended, Worker
from overlapper.printable import first_line
from overlapper.whole_file import beside

try:
    import trimesh
except ImportError as error:
    raise ImportError(f"overlapper.polytopes.mesh_file needs {hint('trimesh')}") from error

__all__ = ["MeshPart", "NotConvexWarning", "check_ending", "read_hull", "read_parts", "read_triangles", "write_mesh"]

Array = NDArray[np.float64]

# The formats that can be written. OBJ has sixteen digits after the point. STL and PLY are in single precision: STL by
# its nature, PLY by the choice of trimesh.
MESHES: dict[str, dict[str, Any]] = {".obj": {"digits": 16}, ".stl": {}, ".ply": {}}

# Limits by the size of a file: a few packed bytes may unpack to very many, and counts are only numbers.
PACKED = (".bz2", ".gz", ".tgz", ".zip")
ZIPPED = (".3dxml", ".3mf", ".zae")  # formats that are packed files, mostly of text
MOST_UNPACKED = 100  # bytes for each of the file; text of numbers has 3 to 20
MOST_SHOWN = 30_000_000  # corners and indices of a glTF scene, in which a mesh may stand many times: some seconds

# Formats that are read. Assemblies have many bodies in a file, each with a name and a place. Some need other libraries.
BODIES = (".obj", ".off", ".ply", ".stl")
ASSEMBLIES = (".3mf", ".glb", ".gltf", ".step", ".stp")
STEP = (".step", ".stp")
NEEDS = dict.fromkeys(STEP, ("cascadio",)) | {".3mf": ("lxml", "networkx")}
SECONDS = 600.0  # for a STEP file, of which surfaces are made by a library that may crash, or never end

DENT = 1e-4  # of the hull's volume: above the rounding of files in single precision, below what an eye sees


class NotConvexWarning(UserWarning):
    """A mesh is not the surface of its convex hull, and the hull is more than the mesh encloses."""


@dataclass(frozen=True, slots=True)
class MeshPart:
    """A body of a mesh file, or one instance of it in an assembly.

    `name` is that of its node in the scene, "" if the file is one body. `triangles` (t, 3, 3) are its corners in the
    frame and unit of the mesh, and `transform` (4, 4) takes these to the world, in m.
    """

    name: str
    triangles: Array
    transform: Array

    def placed(self, points: Array) -> Array:
        """Points (n, 3) of the mesh in the world, m."""
        return np.asarray(points @ self.transform[:3, :3].T + self.transform[:3, 3])


def read_parts(path: str | Path, units: str = "m") -> list[MeshPart]:
    """The bodies of a mesh file: one of OBJ, OFF, PLY and STL, each instance in the scene of glTF, 3MF and STEP.

    `units`, a name that trimesh knows, are those of a file that does not say its own. STEP is read by OpenCASCADE, in a
    process of its own. Raises OSError if there is no such file, ImportError without a library that its format needs,
    ValueError if it is not a mesh.
    """
    path = Path(path)
    path.open("rb").close()
    ending = path.suffix.lower()
    missing = [name for name in NEEDS.get(ending, ()) if importlib.util.find_spec(name) is None]
    if missing:
        raise ImportError(f"{path} needs {hint(*missing)}")
    try:
        _must_fit(path)
        if ending not in STEP:
            return _parts(path, units)
        with Worker(_answers) as worker:
            worker.send((path, units))
            reason, parts = worker.receive(SECONDS)
            if reason:
                raise ValueError(reason)
            return [MeshPart(*each) for each in parts]
    except Ended as ended:
        raise ValueError(f"{path} is not a mesh that can be read: the process that read it {ended}") from None
    except Exception as error:  # of many kinds, as every format has a parser of its own
        raise ValueError(f"{path} is not a mesh that can be read: {first_line(error)}") from error


def read_triangles(path: str | Path) -> Array:
    """All triangles (t, 3, 3) that a mesh file shows, in the file's own frame and unit, which is taken for m.

    Raises OSError if there is no such file, ValueError if it is no mesh.
    """
    path = Path(path)
    path.open("rb").close()
    try:
        _must_fit(path)
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            mesh: Any = trimesh.load_mesh(str(path))
        if not len(mesh.faces):
            raise ValueError("it has no triangles")
        return np.asarray(mesh.triangles, dtype=float)
    except Exception as error:
        raise ValueError(f"{path} is not a mesh that can be read: {first_line(error)}") from error


def _answers(request: tuple[Path, str]) -> Iterator[tuple[str, list[tuple[str, Array, Array]]]]:
    """In the process in which STEP is read: what is wrong with it, and its bodies."""
    try:
        yield "", [(part.name, part.triangles, part.transform) for part in _parts(*request)]
    except FileNotFoundError:  # of what OpenCASCADE would have written
        yield "OpenCASCADE finds no shape in it", []
    except Exception as error:
        yield first_line(error), []


def _parts(path: Path, units: str) -> list[MeshPart]:
    assembly = path.suffix.lower() in ASSEMBLIES
    # The surfaces of several materials are one body's.
    options: dict[str, Any] = {"merge_primitives": True} if path.suffix.lower() in (".glb", ".gltf") else {}
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")  # of numpy and trimesh about figures that Hull refuses
        scene: Any = trimesh.load_scene(str(path), **options)
        to_metres = np.diag([trimesh.units.unit_conversion(scene.units or units, "m")] * 3 + [1.0])
        if assembly:
            nodes = [(str(node), *scene.graph[node]) for node in sorted(scene.graph.nodes_geometry)]
            meshes = [(name, scene.geometry[geometry], matrix) for name, matrix, geometry in nodes]
        else:
            meshes = [("", scene.to_mesh(), np.eye(4))]
        parts = [
            MeshPart(name, np.asarray(mesh.triangles, dtype=float), to_metres @ matrix)
            for name, mesh, matrix in meshes
            if len(getattr(mesh, "faces", ()))  # and not lines or points alone
        ]
    if not parts:
        raise ValueError("it has no triangles")
    if not all(np.isfinite(part.triangles).all() and np.isfinite(part.transform).all() for part in parts):
        raise ValueError("it has coordinates that are not finite")
    return parts


def read_hull(path: str | Path) -> Hull:
    """The convex hull of everything that a mesh file shows, in the file's own frame and unit, which is taken for m.

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
    """ValueError for a file that would take much more time and memory than its size suggests."""
    size, ending = path.stat().st_size, path.suffix.lower()
    if ending in PACKED:
        raise ValueError("it is packed, and must be unpacked first")
    if ending in ZIPPED:
        with zipfile.ZipFile(path) as packed:
            if sum(each.file_size for each in packed.infolist()) > MOST_UNPACKED * size:
                raise ValueError(f"it unpacks to more than {MOST_UNPACKED} times its size")
            if ending == ".3mf":
                _must_show_few(_shown_by_3mf(packed))
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
    _must_show_few(sum(meshes[node["mesh"]] for node in scene.get("nodes", ()) if "mesh" in node))


def _shown_by_3mf(packed: zipfile.ZipFile) -> int:
    """How many corners, indices and instances a 3MF scene shows: objects are put together from others, many times over.

    An object of another file of the package counts as many as that file could have.
    """
    sizes = {each.filename: each.file_size for each in packed.infolist()}
    own: dict[str, int] = {}
    made_of: dict[str, list[str]] = {}
    items: list[str] = []
    with packed.open(next(name for name in sizes if "3d/3dmodel.model" in name.lower())) as model:
        for _, element in ElementTree.iterparse(model):
            kind, named = element.tag.rpartition("}")[2], element.attrib
            if kind == "object":
                components = [each.attrib for each in element.iter() if each.tag.endswith("}component")]
                made_of[named["id"]] = [each["objectid"] for each in components]
                paths = [value for each in components for name, value in each.items() if name.endswith("path")]
                counted = sum(each.tag.endswith(("}vertex", "}triangle")) for each in element.iter())
                own[named["id"]] = 1 + 3 * counted + sum(sizes.get(path.strip("/"), 0) // 8 for path in paths)
                element.clear()
            elif kind == "item":
                items.append(named["objectid"])
    shown: dict[str, int] = {}
    try:
        order = list(TopologicalSorter(made_of).static_order())
    except CycleError as error:
        raise ValueError("an object in it is made of itself") from error
    for id in order:
        shown[id] = own.get(id, 1) + sum(shown[each] for each in made_of.get(id, ()))
    return sum(shown.get(id, 1) for id in items)


def _must_show_few(shown: int) -> None:
    if shown > MOST_SHOWN:
        raise ValueError(f"it shows {shown:,} corners and indices, which is more than {MOST_SHOWN:,}")


def check_ending(path: str | Path) -> None:
    """Raises ValueError for an ending that `write_mesh` cannot write."""
    if Path(path).suffix not in MESHES:
        raise ValueError(f"a mesh must end in {', '.join(MESHES)}, not {Path(path).name!r}")


def write_mesh(path: str | Path, polytope: Hull | Overlap | Sequence[Hull | Overlap]) -> None:
    """Writes hulls or overlaps as a triangle mesh in m, each as a closed surface. The name ends in .obj, .stl or .ply.

    OBJ keeps coordinates to 16 decimal places, STL and PLY in single precision, to one part in ten million.
    Raises ValueError for another ending, and for bodies that share nothing.
    """
    check_ending(path)
    pieces = [each for each in (polytope if isinstance(polytope, Sequence) else [polytope]) if len(each.facets)]
    if not pieces:
        raise ValueError("polytope is empty: the bodies share nothing that could be written")
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
