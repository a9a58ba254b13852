"""Which bodies of mesh files clash: all pairs of a folder, of files, or of one assembly.

Two bodies are separated if their convex hulls are separated. The common volume of closed meshes that are not convex is
measured on the meshes (`overlapper.polytopes.mesh_overlap`). If it is not zero, the meshes are replaced by convex parts
(`overlapper.polytopes.decomposition`). The depth is the depth of the parts, and a page shows the parts.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from overlapper import Batch, Hull, Overlaps, Placed
from overlapper.audit.allowed import is_allowed, must_name_some
from overlapper.columns import measures_of
from overlapper.polytopes.decomposition import ROUNDING, NotDecomposed, WeldedMesh, decompose
from overlapper.polytopes.mesh_file import BODIES, MeshPart, read_parts
from overlapper.polytopes.mesh_overlap import mesh_overlap, window
from overlapper.polytopes.mesh_parser import ASSEMBLIES
from overlapper.printable import first_line
from overlapper.simulation.links import LinkContact, link_contacts
from overlapper.tables.still import Still
from overlapper.tables.table import Row
from overlapper.tables.table_file import TABLES, origin
from overlapper.union import union_volume

Array = NDArray[np.float64]
Status = Literal["clash", "expected", "shallow", "touching"]
Way = Literal["convex", "decomposed", "hull", "unknown"]

SHARED = "#ff4fa3"  # a colour that is rare among parts
GREY = (0.62, 0.66, 0.72, 1.0)
# The colours of clashing bodies, in turn. They differ from each other and from the colour of the overlap.
COLORS = [(0.35, 0.60, 0.90, 1.0), (0.55, 0.78, 0.40, 1.0), (0.95, 0.72, 0.30, 1.0), (0.45, 0.75, 0.75, 1.0)]
COLORS += [(0.62, 0.55, 0.85, 1.0), (0.80, 0.62, 0.48, 1.0)]


@dataclass(frozen=True, slots=True)
class MeshBody:
    """A body of a mesh file as it was measured, in world coordinates, in m.

    `triangles` (t, 3, 3) are the triangles of a closed mesh, counter-clockwise from outside. They are None if the mesh
    bounds no known volume. `parts` are the convex bodies that replace the mesh. `way` says how they were made:

    - "convex": the mesh consists of these convex bodies.
    - "decomposed": CoACD made them.
    - "hull": the only part is the convex hull.
    - "unknown": the only part is the convex hull, which is not enough to measure the body.

    `parts_volume` is the volume of the union of the parts. `mesh_volume` is the volume of the mesh. Both are in m³.
    """

    name: str
    part: MeshPart
    triangles: Array | None
    parts: tuple[Hull, ...]
    way: Way
    parts_volume: float
    mesh_volume: float | None

    @property
    def excess(self) -> float | None:
        """How much larger the volume of the parts is, as a fraction of the mesh's volume; None if that is unknown."""
        return self.parts_volume / self.mesh_volume - 1 if self.mesh_volume else None


@dataclass(frozen=True, slots=True)
class Clash:
    """Two bodies that touch or overlap, by their indices in the list of bodies.

    `status` says what the overlap means:

    - "clash": the overlap is not expected.
    - "expected": the names of the two bodies are among the expected pairs.
    - "shallow": the depth is less than the least depth of a clash.
    - "touching": the overlap can be explained by rounding, because files write corners with six digits.

    `volume` (m³) is within `volume_error` of the common volume: of the meshes if `of_meshes`, else of their parts.
    `parts` is the overlap of the parts, with depth and normal; None if they share nothing.
    """

    pair: tuple[int, int]
    names: tuple[str, str]
    status: Status
    volume: float
    volume_error: float
    of_meshes: bool
    parts: LinkContact | None

    @property
    def depth(self) -> float | None:
        """The depth (m) of the deepest pair of parts: moving the first by it along `parts.normal` separates the two."""
        return self.parts.depth if self.parts is not None else None


@dataclass(slots=True)
class Clashes:
    """The bodies, and the pairs that touch or overlap, the largest volume first.

    `failures` are sentences about what could not be measured. `remarks` are sentences about what was measured in
    another way than requested.
    """

    bodies: list[MeshBody]
    pairs: list[Clash]
    failures: list[str]
    remarks: list[str]

    def of_status(self, status: Status) -> list[Clash]:
        return [pair for pair in self.pairs if pair.status == status]


def read(paths: Sequence[Path], units: str) -> tuple[list[tuple[str, MeshPart]], list[str]]:
    """The bodies of files and folders with their names, and one sentence for each file that cannot be read.

    The name of a file is its path from the common folder of all files. The name of a body of an assembly is the path of
    its node, after the name of the file if there are several files. ImportError without a library that a format needs.
    """
    files = list(dict.fromkeys(file for path in paths for file in _files(path)))
    folder = Path(os.path.commonpath([file.absolute().parent for file in files]))
    named: list[tuple[str, MeshPart]] = []
    failures: list[str] = []
    for file in files:
        try:
            parts = read_parts(file, units)
        except OSError as error:
            failures.append(f"{file}: {error.strerror}")
            continue
        except ValueError as error:
            failures.append(str(error))
            continue
        name = "" if len(files) == 1 and parts[0].name else file.absolute().relative_to(folder).as_posix()
        named += [("/".join(filter(None, (name, part.name))), part) for part in parts]
    return named, failures


def _files(path: Path) -> list[Path]:
    """A file, or the meshes in a folder. ValueError for a folder without any."""
    if not path.is_dir():
        return [path]
    found = sorted(
        each
        for each in path.iterdir()
        if each.suffix.lower() in (*BODIES, *ASSEMBLIES) and not each.name.startswith(".") and each.is_file()
    )
    if not found:
        raise ValueError(f"the folder {path} has no mesh with one of the endings {', '.join((*BODIES, *ASSEMBLIES))}")
    return found


def clashes(
    parts: Sequence[tuple[str, MeshPart]],
    enclose: bool = False,
    threshold: float = 0.05,
    least_depth: float = 0.0,
    expected: Sequence[tuple[str, str]] = (),
) -> Clashes:
    """The clashes among all pairs of bodies.

    A mesh that is not convex is decomposed if it overlaps another body. `threshold` is CoACD's threshold. With
    `enclose`, CoACD lays walls around open meshes. `least_depth` (m) is the least depth of a clash. `expected` are
    pairs of fnmatch patterns of names that may overlap. ValueError for a pattern that names no body.
    """
    must_name_some(expected, [name for name, _ in parts], "body")
    found = Clashes([], [], [], [])
    hulls: list[Hull] = []
    for name, part in parts:
        try:
            hull = Hull(part.placed(part.triangles.reshape(-1, 3)))
        except ValueError as error:
            found.failures.append(f"{name} is not measured: {first_line(error)}")
        else:
            hulls.append(hull)
            found.bodies.append(_with_surface(MeshBody(name, part, None, (hull,), "hull", hull.volume, None)))
    near = [(i, j) for i, j in _overlaps(hulls).pairs.tolist()]
    shared = {pair: _shared(*(found.bodies[i] for i in pair)) for pair in near}
    solid = {pair for pair, each in shared.items() if each is None or each.volume > each.slight}
    _decompose(found, {i for pair in solid for i in pair}, threshold, enclose)
    contacts = _still(found.bodies).contacts(1e-3)
    wanted = np.array([(a, b) in solid for a, _, _, b, _, _ in contacts.keys.tolist()], dtype=bool)
    links = {(link.bodyA, link.bodyB): link for link in link_contacts(contacts[wanted])}
    for pair in near:
        measured = _clash(found.bodies, pair, shared[pair], links.get(pair), least_depth)
        if measured:
            found.pairs.append(_expected(measured, expected))
    found.pairs.sort(key=lambda pair: -pair.volume)
    return found


def write_table(found: Clashes, path: Path, settings: Mapping[str, Any]) -> None:
    """Write the pairs as a table of `overlapper run` by links. The volumes are the volumes of the pairs."""
    excess = {body.name: body.excess for body in found.bodies if body.way == "decomposed"}
    texts = {name: str(value) for name, value in settings.items()}
    table = TABLES[path.suffix](path, origin() | texts | {"excess": json.dumps(excess)})
    try:
        table.write(_row(pair) for pair in found.pairs)
    except BaseException:
        table.leave()
        raise
    table.close()


def _row(clash: Clash) -> Row:
    row: Row = {"step": 1, "time_s": 0.0, "status": "touching" if clash.status == "touching" else "overlapping"}
    for side, body, name in zip("AB", clash.pair, clash.names):
        row |= {f"body{side}": body, f"link{side}": -1, f"name{side}": name}
    if clash.parts is not None:
        row |= measures_of(clash.parts)
    return row | {"volume_m3": clash.volume, "volume_error_m3": clash.volume_error}


def write_page(found: Clashes, path: Path) -> None:
    """Write a page: the bodies, translucent, and all overlaps that are not "touching". ImportError without meshcat."""
    from overlapper.viewer import Look, Recording

    links = [pair.parts for pair in found.pairs if pair.status != "touching" and pair.parts is not None]
    recording = Recording(overlaps=Look(edges=False, front=SHARED, back=SHARED))
    recording.add(_drawn(found), [contact for link in links for contact in link.contacts], 0.0)
    recording.save(path)


@dataclass(frozen=True, slots=True)
class _DrawnMeshes:
    """The bodies in the form that views take."""

    keys: list[tuple[int, int, int]]
    placed: list[Placed]
    colors: dict[tuple[int, int], tuple[float, float, float, float]]
    names: dict[tuple[int, int], str]
    labels: dict[int, str]


@dataclass(frozen=True, slots=True)
class _Whole:
    """A mesh to be drawn, in place of a `Placed`."""

    shape: Any
    position: Array
    orientation: Array
    bounds: Array


def _drawn(found: Clashes) -> _DrawnMeshes:
    """Bodies that overlap are drawn by their parts, because the overlaps are between parts; others by their meshes."""
    from overlapper.viewer.tessellation import Mesh

    clashing = list(dict.fromkeys(i for pair in found.pairs if pair.status != "touching" for i in pair.pair))
    colors = {(i, -1): COLORS[k % len(COLORS)] for k, i in enumerate(clashing)}
    keys: list[tuple[int, int, int]] = []
    placed: list[Any] = []
    for i, body in enumerate(found.bodies):
        if body.triangles is not None and body.way != "convex" and i not in clashing:
            keys.append((i, -1, 0))
            bounds = np.array([body.triangles.min(axis=(0, 1)), body.triangles.max(axis=(0, 1))])
            placed.append(_Whole(Mesh(body.triangles), np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), bounds))
        else:
            keys += [(i, -1, k) for k in range(len(body.parts))]
            placed += [Placed(part) for part in body.parts]
    labels = {i: body.name for i, body in enumerate(found.bodies)}
    names = {(i, -1): name for i, name in labels.items()}
    return _DrawnMeshes(keys, placed, dict.fromkeys(names, GREY) | colors, names, labels)


@dataclass(frozen=True, slots=True)
class _Shared:
    """The common volume of two closed meshes, its error, and the volume that rounded corners explain, in m³."""

    volume: float
    error: float
    slight: float


def _still(bodies: Sequence[MeshBody]) -> Still:
    """The parts at their places. The parts of a mesh are the shapes of one body."""
    keys = [(i, -1, k) for i, body in enumerate(bodies) for k in range(len(body.parts))]
    labels = {i: body.name for i, body in enumerate(bodies)}
    names = {(i, -1): name for i, name in labels.items()}
    return Still(keys, [part for body in bodies for part in body.parts], *_nowhere(len(keys)), names, labels, {})


def _nowhere(count: int) -> tuple[Array, Array]:
    """Identity poses, for shapes whose points are in world coordinates."""
    return np.zeros((count, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))


def _overlaps(hulls: Sequence[Hull]) -> Overlaps:
    return Batch(hulls).overlaps(*_nowhere(len(hulls)))


def _with_surface(body: MeshBody) -> MeshBody:
    """The body with the triangles of its mesh, if the mesh is closed, and with its convex bodies, if it has them."""
    try:
        surface = WeldedMesh.of(body.part.triangles)
    except NotDecomposed:  # no triangle has an area
        return body
    if surface.volume is None:
        return body
    scale = float(np.linalg.det(body.part.transform[:3, :3]))
    triangles = body.part.placed(surface.triangles.reshape(-1, 3)).reshape(-1, 3, 3)
    body = replace(body, triangles=triangles[:, :: 1 if scale > 0 else -1], mesh_volume=abs(scale) * surface.volume)
    convex = surface.convex_bodies()
    return _of_parts(body, convex, "convex") if convex else body


def _of_parts(body: MeshBody, parts: Sequence[Hull], way: Way) -> MeshBody:
    """The body with these parts, placed. If the transform leaves none of them a volume, the body is returned as is."""
    placed: list[Hull] = []
    for part in parts:
        with suppress(ValueError):  # the transform has made the part flat
            placed.append(Hull(body.part.placed(part.vertices)))
    if not placed:
        return body
    volume = union_volume([Placed(part) for part in placed])[0]
    return replace(body, parts=tuple(placed), way=way, parts_volume=volume)


def _shared(a: MeshBody, b: MeshBody) -> _Shared | None:
    """The overlap of the meshes. None if both are convex or one is not closed; then the parts must be measured."""
    if a.way == b.way == "convex" or a.triangles is None or b.triangles is None:
        return None
    found = mesh_overlap(a.triangles, b.triangles)
    if found is None:
        return None
    lower, upper = window(a.triangles, b.triangles)
    area = sum(_area_within(triangles, lower, upper) for triangles in (a.triangles, b.triangles))
    return _Shared(*found, found[1] + _rounding(a, b) * area)


def _area_within(triangles: Array, lower: Array, upper: Array) -> float:
    """An upper bound of the area of triangles within a box: no triangle exceeds the largest section of the box."""
    within = ((triangles.min(axis=1) <= upper) & (triangles.max(axis=1) >= lower)).all(axis=1)
    a, b, c = triangles[within].transpose(1, 0, 2)
    x, y, z = np.maximum(upper - lower, 0.0)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    return float(np.minimum(areas, np.linalg.norm([x * y, y * z, z * x])).sum())


def _rounding(a: MeshBody, b: MeshBody) -> float:
    """The distance (m) by which rounding of corners may have moved two surfaces towards each other."""
    reach = max(float(np.abs(part.bounds).max()) for body in (a, b) for part in body.parts)
    return 2 * math.sqrt(3) * ROUNDING * reach


def _decompose(found: Clashes, needed: set[int], threshold: float, enclose: bool) -> None:
    """Replace the hulls of bodies that are not convex by convex parts. A body that needs parts but gets none fails."""
    for i, body in enumerate(found.bodies):
        if body.way == "convex" or i not in needed:
            continue
        try:
            # In the frame of the mesh, so that several instances of a mesh are decomposed only once.
            made = decompose(body.part.triangles, threshold, enclose=enclose)
            found.bodies[i] = _of_parts(body, made.parts, "decomposed")
        except NotDecomposed as error:
            if body.triangles is None:
                found.failures.append(f"{body.name} is not measured: {error}")
                found.bodies[i] = replace(body, way="unknown")
            else:
                found.remarks.append(f"The convex hull of {body.name} is used instead: {error}.")


def _clash(
    bodies: Sequence[MeshBody],
    pair: tuple[int, int],
    shared: _Shared | None,
    link: LinkContact | None,
    least_depth: float,
) -> Clash | None:
    """The clash of a pair; None if the two bodies are separated, or one of them could not be measured."""
    a, b = (bodies[i] for i in pair)
    if "unknown" in (a.way, b.way):
        return None
    of_meshes = shared is not None or a.way == b.way == "convex"
    if shared:
        if shared.volume <= shared.error:
            return None
        slight = shared.volume <= shared.slight
        volume, error = shared.volume, shared.error
    elif link is not None:
        slight = link.depth <= _rounding(a, b)
        volume, error = link.volume, link.volume_error
    else:
        return None
    shallow = link is not None and link.depth < least_depth
    status: Status = "touching" if slight else "shallow" if shallow else "clash"
    return Clash(pair, (a.name, b.name), status, volume, error, of_meshes, link)


def _expected(clash: Clash, expected: Sequence[tuple[str, str]]) -> Clash:
    """The clash, with the status "expected" if the two bodies are allowed to overlap."""
    may = clash.status == "clash" and is_allowed(clash.names, expected)
    return replace(clash, status="expected") if may else clash
