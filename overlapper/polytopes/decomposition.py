"""Closed triangle meshes as convex parts. A convex mesh is its own part. CoACD cuts others, in a separate process.

CoACD (X. Wei, M. Liu, Z. Ling, H. Su, "Approximate convex decomposition for 3D meshes with collision-aware concavity
and tree search", SIGGRAPH 2022) takes seconds to minutes, ends the process on some meshes and never ends on others.
Its parts are kept on disk, in one file per mesh, threshold and version of CoACD.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.metadata
import importlib.util
import io
import math
import os
import signal
import sys
import tempfile
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from overlapper._core import Hull, Placed
from overlapper.install import hint
from overlapper.jobs.worker import Ended, Worker
from overlapper.union import union_volume

Vertices = NDArray[np.float64]
Faces = NDArray[np.int64]

# The error of the corners of a mesh, as a share of the largest coordinate: half a unit of the sixth digit, because text
# formats have six digits, plus half a unit of single precision, because meshes are read in single precision.
ROUNDING = 5e-6 + 2.0**-24

DIGEST = 32  # bytes of SHA-256


class NotDecomposed(ValueError):
    """A mesh has no convex parts; the message is the reason, without a full stop."""


@dataclass(frozen=True, slots=True)
class Decomposition:
    """A mesh as the union of convex `parts`, which may overlap each other.

    `mesh_volume` is the volume (m³) that the mesh itself bounds; None if its surface is open or its triangles are not
    consistently oriented. `path` is the file of the parts; None if the mesh consists of convex bodies and is exact.
    """

    parts: tuple[Hull, ...]
    mesh_volume: float | None
    path: Path | None

    @property
    def volume(self) -> float:
        """The volume of the union of the parts, m³."""
        return union_volume([Placed(part) for part in self.parts])[0]


@dataclass(frozen=True, slots=True)
class WeldedMesh:
    """The triangles of a mesh, each once, as `faces` (t, 3) over `vertices` (n, 3); equal corners are one vertex.

    `open_edges` counts the edges with an odd number of triangles. `volume` (m³) is the volume that the triangles bound;
    None if the surface is open or not consistently oriented. If the volume is known, triangles are counter-clockwise
    from outside the solid (from within a hole), and triangles run along every edge once in each direction.
    """

    vertices: Vertices
    faces: Faces
    open_edges: int
    volume: float | None

    @classmethod
    def of(cls, triangles: ArrayLike) -> WeldedMesh:
        """The mesh of (t, 3, 3) triangles. Bit-identical corners become one vertex. NotDecomposed without an area."""
        corners = np.asarray(triangles, dtype=float)
        if corners.ndim != 3 or corners.shape[1:] != (3, 3):
            raise ValueError(f"triangles must have the shape (t, 3, 3), not {corners.shape}")
        if not np.isfinite(corners).all():
            raise NotDecomposed("the mesh has vertices that are not finite")
        vertices, faces = _welded(corners)
        if not len(faces):
            raise NotDecomposed("the mesh has no triangle with an area")
        volume = None
        if _turns_one_way(faces):
            volume = _volume(vertices, faces)
            if volume < 0:
                faces, volume = np.ascontiguousarray(faces[:, ::-1]), -volume
            if _a_shell_is_inside_out(vertices, faces):
                volume = None
        return cls(vertices, faces, _open_edges(faces), volume)

    @property
    def triangles(self) -> Vertices:
        """(t, 3, 3)"""
        return self.vertices[self.faces]

    def convex_bodies(self) -> list[Hull] | None:
        """The connected bodies of the surface as hulls, if all are convex up to rounding and none is a hole."""
        return None if self.volume is None else _convex_bodies(self.vertices, self.faces)


def cache_folder() -> Path:
    """The folder of decompositions: overlapper/convex_parts in $XDG_CACHE_HOME, by default in ~/.cache."""
    home = Path(os.environ.get("XDG_CACHE_HOME", ""))
    # The XDG base directory specification says that a relative path must be ignored.
    return (home if home.is_absolute() else Path.home() / ".cache") / "overlapper" / "convex_parts"


def check_threshold(threshold: float) -> None:
    """ValueError unless CoACD takes this threshold."""
    if not (isinstance(threshold, Real) and 0.01 <= threshold <= 1):
        raise ValueError(f"the concavity threshold must lie between 0.01 and 1, not {threshold!r}")


def decompose(
    triangles: ArrayLike, threshold: float = 0.05, enclose: bool = False, time_limit: float = 600.0
) -> Decomposition:
    """The convex parts of the solid that (t, 3, 3) triangles bound. Bit-identical corners become one vertex.

    `threshold`, from 0.01 (many parts) to 1 (the convex hull), is the concavity that CoACD leaves, as a part of the
    mesh's size. A surface with open edges bounds nothing. With `enclose`, CoACD closes such a surface first, and also
    surfaces that cross themselves. Its walls stick out by about 1/180 of the longest side. A line on stderr says when
    CoACD is started, and in which file its parts will be kept.

    NotDecomposed if the surface is open, or CoACD is not installed, fails, or takes longer than `time_limit` seconds.
    """
    check_threshold(threshold)
    surface = WeldedMesh.of(triangles)
    if surface.open_edges and not enclose:
        raise NotDecomposed(f"the concave mesh bounds no volume: its surface has {surface.open_edges:,} open edges")
    if convex := surface.convex_bodies():
        return Decomposition(tuple(convex), surface.volume, None)
    vertices, faces, volume = surface.vertices, surface.faces, surface.volume
    path, parts = _kept_or_made(vertices, faces, threshold, time_limit)
    hulls: list[Hull] = []
    for part in parts:
        with contextlib.suppress(ValueError):  # the part is flat and has no volume
            hulls.append(Hull(part))
    if not hulls:
        raise NotDecomposed("CoACD finds no solid part in the concave mesh")
    return Decomposition(tuple(hulls), volume, path)


def hull_of_mesh(mesh: Any, name: str) -> Hull:
    """The hull of a convex mesh of trimesh. ValueError that names the argument for any other mesh."""
    try:
        surface = WeldedMesh.of(mesh.triangles)
    except NotDecomposed as reason:
        raise ValueError(f"{name} must be a closed convex mesh: {reason}") from None
    if surface.open_edges:
        edges = f"its surface has {surface.open_edges:,} open edges"
        raise ValueError(f"{name} must be a closed mesh: {edges}; Hull(mesh.vertices) is its convex hull")
    if surface.volume is None:
        raise ValueError(f"{name} must be a mesh with all triangles facing outwards: mesh.fix_normals() turns them")
    hulls = surface.convex_bodies() or []
    if len(hulls) != 1:
        call = f"{__name__}.decompose(mesh.triangles).parts"
        raise ValueError(f"{name} must be a convex mesh: {call} are convex parts for overlapper.union.union_overlap")
    return hulls[0]


def _welded(corners: Vertices) -> tuple[Vertices, Faces]:
    """Vertices and faces, each once. Triangles without three distinct corners are dropped."""
    vertices, index = np.unique(corners.reshape(-1, 3) + 0.0, axis=0, return_inverse=True)  # + 0.0 makes -0.0 equal 0.0
    faces = index.reshape(-1, 3).astype(np.int64)
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    # A mesh that is drawn from both sides has every triangle twice.
    first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1]
    return vertices, faces[np.sort(first)]


def _edges(faces: Faces) -> Faces:
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])


def _open_edges(faces: Faces) -> int:
    """The number of edges with an odd number of triangles. It is 0 if the surface separates inside from outside."""
    _, count = np.unique(np.sort(_edges(faces), axis=1), axis=0, return_counts=True)
    return int((count % 2).sum())


def _turns_one_way(faces: Faces) -> bool:
    """Whether triangles run along every edge once in each direction: a closed manifold with one orientation."""
    edges, count = np.unique(_edges(faces), axis=0, return_counts=True)
    backwards = edges[:, ::-1]
    return bool((count == 1).all() and np.array_equal(edges, backwards[np.lexsort(backwards.T[::-1])]))


def _volume(vertices: Vertices, faces: Faces) -> float:
    a, b, c = (vertices[faces] - vertices.mean(axis=0)).transpose(1, 0, 2)
    return float((a * np.cross(b, c)).sum() / 6)


def _convex_bodies(vertices: Vertices, faces: Faces) -> list[Hull] | None:
    """The connected parts of a closed surface as hulls, if all are convex up to rounding and none is a hole.

    Faces are connected by common edges, so bodies that touch at a corner are separate parts.
    """
    hulls: list[Hull] = []
    for shell in _shells(faces):
        corners = vertices[np.unique(shell)]
        try:
            hull = Hull(corners)
        except ValueError:
            return None
        rows, count = np.unique(np.vstack([corners, hull.vertices]), axis=0, return_counts=True)
        inner = rows[count == 1]  # a vertex of the hull has no depth
        # Corners that moved by √3 roundings moved the mesh's surface inwards, or the hull's outwards, by this distance.
        layer = 2 * math.sqrt(3) * ROUNDING * float(np.abs(corners).max())
        missing = hull.volume - _volume(vertices, shell)
        if not missing <= layer * _area(hull.corners, hull.triangles) or _deepest(hull, inner) > layer:
            return None
        hulls.append(hull)
    return hulls


def _shells(faces: Faces) -> list[Faces]:
    """The connected parts of a closed surface."""
    ends, edges = np.unique(np.sort(_edges(faces), axis=1), axis=0, return_inverse=True)
    labels = _components(edges.reshape(3, -1).T, len(ends))[edges.reshape(3, -1)[0]]
    order = np.argsort(labels, kind="stable")
    return np.split(faces[order], np.flatnonzero(np.diff(labels[order])) + 1)


def _a_shell_is_inside_out(vertices: Vertices, faces: Faces) -> bool:
    """Whether a connected part of a closed surface is clockwise from outside although no other part's box holds it."""
    shells = _shells(faces)
    if len(shells) == 1:
        return False
    boxes = np.array([(vertices[shell].min(axis=(0, 1)), vertices[shell].max(axis=(0, 1))) for shell in shells])
    holes = np.array([_volume(vertices, shell) for shell in shells]) < 0
    solid = boxes[~holes]
    return any(not ((solid[:, 0] <= lower) & (upper <= solid[:, 1])).all(axis=1).any() for lower, upper in boxes[holes])


def _deepest(hull: Hull, points: Vertices) -> float:
    """The depth (m) of the deepest of some points below the surface of a hull."""
    planes, deepest = hull.halfspaces, 0.0
    for some in np.array_split(points, len(points) * len(planes) // 10**7 + 1):  # 80 MB at a time
        deepest = max(deepest, float(-(some @ planes[:, :3].T + planes[:, 3]).max(axis=1).min(initial=0.0)))
    return deepest


def _area(vertices: Vertices, faces: NDArray[np.integer]) -> float:
    a, b, c = vertices[faces].transpose(1, 0, 2)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def _components(groups: Faces, count: int) -> Faces:
    """For each of `count` numbers, the least number that it is connected to. A row of `groups` connects its numbers."""
    labels = np.arange(count)
    while True:
        least = labels.copy()
        for column in groups.T:
            np.minimum.at(least, column, labels[groups].min(axis=1))
        least = least[least]
        if np.array_equal(least, labels):
            return labels
        labels = least


def _kept_or_made(vertices: Vertices, faces: Faces, threshold: float, time_limit: float) -> tuple[Path, list[Vertices]]:
    """The file where CoACD's parts are kept, and the parts: from the file if it is valid, else newly made."""
    if importlib.util.find_spec("coacd") is None:
        raise NotDecomposed(f"a concave mesh needs {hint('coacd')}")
    version = importlib.metadata.version("coacd")
    settings = repr((version, float(threshold), vertices.shape, faces.shape)).encode()
    key = hashlib.sha256(settings + vertices.tobytes() + faces.tobytes()).hexdigest()
    path = cache_folder() / f"{key}.parts"
    with contextlib.suppress(OSError):
        if (parts := unpacked(key, path.read_bytes())) is not None:
            return path, parts
    words = f"overlapper: CoACD decomposes a mesh of {len(faces):,} triangles, once; the parts are kept in {path}"
    print(words, file=sys.stderr, flush=True)
    made = _coacd(vertices, faces, threshold, time_limit)
    try:
        _write(path, packed(key, made))
    except OSError as error:
        warnings.warn(f"the parts of a mesh cannot be kept in {path}: {error.strerror}", stacklevel=2)
    return path, made


def _write(path: Path, data: bytes) -> None:
    """Write a file atomically, even if another process writes it at the same time."""
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor, name = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=".parts")
    try:
        with open(descriptor, "wb") as file:
            file.write(data)
        os.replace(name, path)
    except BaseException:
        os.unlink(name)
        raise


def packed(key: str, parts: list[Vertices]) -> bytes:
    """Parts as bytes: a digest of the key and the rest, then two arrays: all corners, and the number in each part."""
    buffer = io.BytesIO()
    np.save(buffer, np.concatenate([np.empty((0, 3)), *parts]))
    np.save(buffer, np.array([len(part) for part in parts], dtype=np.int64))
    content = buffer.getvalue()
    return hashlib.sha256(key.encode() + content).digest() + content


def unpacked(key: str, data: bytes) -> list[Vertices] | None:
    """The parts that `packed` wrote with this key; None if a bit has changed."""
    if hashlib.sha256(key.encode() + data[DIGEST:]).digest() != data[:DIGEST]:
        return None
    buffer = io.BytesIO(data[DIGEST:])
    corners: Vertices = np.load(buffer)
    counts: Faces = np.load(buffer)
    return np.split(corners, np.cumsum(counts)[:-1]) if len(counts) else []


def _coacd(vertices: Vertices, faces: Faces, threshold: float, time_limit: float) -> list[Vertices]:
    """CoACD's parts, made in a separate process. NotDecomposed says how this process ended without a result."""
    try:
        with Worker(_answers) as worker:
            worker.send((vertices, faces, float(threshold), math.ceil(time_limit) + 1))
            parts: list[Vertices] = worker.receive(time_limit)
            return parts
    except Ended as ended:
        if ended.limit is not None:
            raise NotDecomposed(f"CoACD did not decompose the concave mesh within {ended.limit:g} s") from None
        if ended.code == 0:
            raise NotDecomposed("CoACD's process ended before its answer was complete") from None
        raise NotDecomposed(f"CoACD failed on the concave mesh: its process {ended}") from None


def _answers(request: tuple[Vertices, Faces, float, int]) -> Iterator[list[Vertices]]:
    """Runs in the process of CoACD: yields the parts of a mesh."""
    vertices, faces, threshold, seconds = request
    if sys.platform != "win32":
        signal.alarm(seconds)  # in case nobody waits any more
    import coacd

    coacd.set_log_level("error")
    parts = coacd.run_coacd(coacd.Mesh(vertices, faces.astype(np.int32)), threshold=threshold)
    yield [np.asarray(part, dtype=float) for part, _ in parts]
