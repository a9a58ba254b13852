"""Mesh files parsed by trimesh, in the process of the caller. `mesh_file` calls these functions in a confined process.

Only geometry is read. Materials and pictures are ignored, because a tiny mesh may name a picture of gigabytes.
"""

from __future__ import annotations

import json
import re
import struct
import warnings
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from graphlib import CycleError, TopologicalSorter
from io import BytesIO
from itertools import count
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from overlapper._core import Hull

Array = NDArray[np.float64]

# Limits by the size of a file: a few packed bytes may unpack to very many, and a file may state any count.
PACKED = (".bz2", ".gz", ".tgz", ".zip")
ZIPPED = (".3dxml", ".3mf", ".zae")  # formats that are packed files, mostly of text
MOST_UNPACKED = 100  # unpacked bytes for each byte of the file; text of numbers has 3 to 20
MOST_SHOWN = 30_000_000  # corners and indices of a glTF scene, with repeated meshes: they take some seconds

# The most materials of an OBJ file that are read. trimesh makes a mesh of each, which takes 2 ms. If a file has more
# materials, all its triangles form one mesh.
MOST_MATERIALS = 100

# Assemblies: formats with many bodies in a file, each with a name and a pose.
ASSEMBLIES = (".3mf", ".glb", ".gltf", ".step", ".stp")


@dataclass(frozen=True, slots=True)
class MeshPart:
    """A body of a mesh file, or one instance of it in an assembly.

    `name` is the name of its node in the scene, "" if the file is one body. `triangles` (t, 3, 3) are its corners in
    the frame and unit of the mesh. `transform` (4, 4) maps them to the world, in m.
    """

    name: str
    triangles: Array
    transform: Array

    def placed(self, points: Array) -> Array:
        """Points (n, 3) of the mesh, mapped to the world, in m."""
        return np.asarray(points @ self.transform[:3, :3].T + self.transform[:3, 3])


def parts(path: Path, units: str) -> list[MeshPart]:
    """The bodies of a mesh file. `units` is for files that do not state their unit. See `mesh_file.read_parts`."""
    import trimesh

    ending = path.suffix.lower()
    # Surfaces with several materials belong to one body.
    options: dict[str, Any] = {"merge_primitives": True} if ending in (".glb", ".gltf") else {}
    with _scene(path, **options) as scene:
        to_metres = np.diag([trimesh.units.unit_conversion(scene.units or units, "m")] * 3 + [1.0])
        if ending in ASSEMBLIES:
            nodes = [(str(node), *scene.graph[node]) for node in sorted(scene.graph.nodes_geometry)]
            meshes = [(name, scene.geometry[geometry], matrix) for name, matrix, geometry in nodes]
        else:
            meshes = [("", scene.to_mesh(), np.eye(4))]
        found = [
            MeshPart(name, np.asarray(mesh.triangles, dtype=float), to_metres @ matrix)
            for name, mesh, matrix in meshes
            if len(getattr(mesh, "faces", ()))  # not only lines or points
        ]
    if not found:
        raise ValueError("it has no triangles")
    if not all(np.isfinite(part.triangles).all() and np.isfinite(part.transform).all() for part in found):
        raise ValueError("it has coordinates that are not finite")
    return found


def triangles(path: Path) -> Array:
    """All triangles (t, 3, 3) of a mesh file."""
    with _scene(path) as scene:
        mesh = scene.to_mesh()
    if not len(mesh.faces):
        raise ValueError("it has no triangles")
    return np.asarray(mesh.triangles, dtype=float)


def objects(path: Path) -> list[tuple[Array, NDArray[np.int64]]]:
    """Vertices (n, 3) and triangles (t, 3) of a mesh, in m if the file states its unit; of each object of an OBJ file.

    Vertices need not belong to a triangle.
    """
    import trimesh

    obj = path.suffix.lower() == ".obj"
    with _scene(path, **{"split_objects": True} if obj else {}) as scene:
        to_metres = trimesh.units.unit_conversion(scene.units or "m", "m")
        # Objects have numbers as names, except for one before the first name.
        numbered = sorted((int(name) if name.isdigit() else -1, name) for name in scene.geometry) if obj else []
        meshes = [scene.geometry[name] for _, name in numbered] if obj else [scene.to_mesh()]
        found = [(to_metres * np.asarray(mesh.vertices), np.asarray(mesh.faces)) for mesh in meshes if len(mesh.faces)]
    if not found:
        raise ValueError("it has no triangles")
    return found


def hull(path: Path) -> tuple[Hull, bool, float]:
    """The hull of everything in a mesh file, whether the mesh is closed, and the share of the hull that it fills."""
    with _scene(path) as scene:
        mesh = scene.to_mesh()
        hull = Hull(mesh.vertices[np.unique(mesh.faces)])
        mesh.merge_vertices(merge_tex=True, merge_norm=True)  # a seam between colours is not a hole
        closed = bool(mesh.is_volume)
        return hull, closed, float(mesh.volume) / hull.volume if closed else 0.0


@contextmanager
def _scene(path: Path, **options: Any) -> Iterator[Any]:
    """The file as trimesh reads it. Warnings about numbers that `Hull` refuses are suppressed meanwhile."""
    import trimesh

    _must_fit(path)
    options |= {"skip_materials": True, "resolver": _resolver()(str(path))}
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        if path.suffix.lower() == ".obj":
            text = (_numbered if "split_objects" in options else _of_few_materials)(path.read_bytes())
            yield trimesh.load_scene(BytesIO(text), file_type="obj", **options)
        else:
            yield trimesh.load_scene(str(path), **options)


@cache
def _resolver() -> type[Any]:
    """The class that opens files named by a mesh: files beside it, but no pipe or device, which might never end."""
    from trimesh.resolvers import FilePathResolver

    class Beside(FilePathResolver):
        def get(self, name: str) -> bytes:
            folder, name = Path(self.parent).resolve(), name.strip()
            for each in (name, name.lstrip("/"), Path(name).name):
                file = (folder / each).resolve()
                if file.is_file() and file.is_relative_to(folder):
                    return file.read_bytes()
            raise ValueError(f"it needs the file {name!r} in the same folder, which does not exist")

    return Beside


def _of_few_materials(text: bytes) -> bytes:
    """The text of an OBJ file, without its materials if there are too many."""
    if text.count(b"usemtl") <= MOST_MATERIALS:
        return text
    return re.sub(rb"^usemtl[^\r\n]*", b"", text, flags=re.MULTILINE)


def _numbered(text: bytes) -> bytes:
    """The text of an OBJ file without its materials. Each object and group has its own number as its name."""
    numbers = count()
    named = re.sub(rb"^[og](?=[ \t\r\n])[^\r\n]*", lambda _: b"o %d" % next(numbers), text, flags=re.MULTILINE)
    return re.sub(rb"^usemtl[^\r\n]*", b"", named, flags=re.MULTILINE)


def _must_fit(path: Path) -> None:
    """ValueError for a file that would take much more time and memory than its size suggests."""
    size, ending = path.stat().st_size, path.suffix.lower()
    if ending in PACKED:
        raise ValueError("it is compressed: decompress it first")
    if ending in ZIPPED:
        with zipfile.ZipFile(path) as packed:
            if sum(each.file_size for each in packed.infolist()) > MOST_UNPACKED * size:
                raise ValueError(f"it decompresses to more than {MOST_UNPACKED} times its size")
            if ending == ".3mf":
                _must_show_few(_shown_by_3mf(packed))
    if ending == ".stl":
        with path.open("rb") as file:
            head = file.read(1000)
        if len(head) >= 84 and b"facet" not in head:  # otherwise the file is text
            (count,) = struct.unpack_from("<I", head, 80)
            if 84 + 50 * count != size:
                raise ValueError(f"it states {count:,} triangles, but has room for {(size - 84) // 50:,}")
    if ending in (".glb", ".gltf"):
        _must_be_there(path, _gltf(path), size)


def _gltf(path: Path) -> Any:
    """The JSON of a glTF scene; in .glb, it is the first chunk. ValueError if a chunk is longer than the file."""
    data = path.read_bytes()
    if path.suffix.lower() != ".glb":
        return json.loads(data)
    (first, end), *_ = list(_chunks(data))
    return json.loads(data[first:end])


def _chunks(data: bytes) -> Iterator[tuple[int, int]]:
    """Begin and end of each chunk of a .glb file, up to the end of the file, whatever length the file states."""
    end = 12
    while end + 8 <= len(data):
        (length,) = struct.unpack_from("<I", data, end)
        begin, end = end + 8, end + 8 + length
        if end > len(data):
            raise ValueError(f"it has a chunk of {length:,} bytes, but room for {len(data) - begin:,}")
        yield begin, end


def _must_be_there(path: Path, scene: Any, size: int) -> None:
    """ValueError if a list of numbers is longer than all bytes in the file, or the scene shows too many numbers."""
    names = (str(buffer.get("uri", "")) for buffer in scene.get("buffers", ()))
    beside = [path.parent / name for name in names if not name.startswith("data:")]
    size += sum(file.stat().st_size for file in beside if file.is_file())
    counts = [int(each["count"]) for each in scene.get("accessors", ())]
    if max(counts, default=0) > size:
        raise ValueError(f"it states {max(counts):,} numbers, but has {size:,} bytes")
    meshes = []
    for mesh in scene.get("meshes", ()):
        used = [[*each["attributes"].values(), each.get("indices")] for each in mesh["primitives"]]
        meshes.append(sum(counts[i] for row in used for i in row if i is not None))
    _must_show_few(sum(meshes[node["mesh"]] for node in scene.get("nodes", ()) if "mesh" in node))


def _shown_by_3mf(packed: zipfile.ZipFile) -> int:
    """The number of corners, indices and instances that a 3MF scene shows. Objects may contain others many times.

    An object in another file of the package counts as the most that this file could hold.
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
        raise ValueError("an object in it contains itself") from error
    for id in order:
        shown[id] = own.get(id, 1) + sum(shown[each] for each in made_of.get(id, ()))
    return sum(shown.get(id, 1) for id in items)


def _must_show_few(shown: int) -> None:
    if shown > MOST_SHOWN:
        raise ValueError(f"it has {shown:,} vertices and indices, more than {MOST_SHOWN:,}")
