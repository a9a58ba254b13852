"""Checks a folder of models and meshes: which load, are closed, have parts left out, or overlap within themselves."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from overlapper import Batch, Hull
from overlapper.audit.audit import audit
from overlapper.audit.robot import read_robot
from overlapper.polytopes.decomposition import ROUNDING, NotDecomposed, WeldedMesh, decompose
from overlapper.printable import first_line
from overlapper.simulation.bullet.joints import ENDINGS
from overlapper.simulation.bullet.model_file import NotRead
from overlapper.simulation.contacts import Contacts
from overlapper.simulation.links import link_contacts
from overlapper.simulation.settings import Modelling
from overlapper.tables.table import Row
from overlapper.tables.table_file import TABLES, origin

# The columns of a table of assets, in order, with their types. `closed` is 1 or 0; it is empty for a model. `overlaps`
# is JSON: names, volume in m³ and depth in m.
COLUMNS: dict[str, type] = {
    "asset": str,
    "status": str,
    "failure": str,
    "bodies": int,
    "shapes": int,
    "closed": int,
    "excess": float,
    "overlaps": str,
    "not_modelled": str,
}

MESHES = (".obj", ".off", ".ply", ".stl", ".3mf", ".glb", ".gltf", ".step", ".stp")


@dataclass(frozen=True, slots=True)
class Shared:
    """Two parts of an asset that overlap at rest: their common `volume` in m³, and the largest `depth` of a pair in m.

    The depth is the largest over all pairs of shapes of the two parts.
    """

    names: tuple[str, str]
    volume: float
    depth: float


@dataclass(frozen=True, slots=True)
class Asset:
    """A file. `name` is its path relative to the folder.

    `failure` says why the file cannot be read; it is "" if the file can be read. `bodies` counts the bodies of a mesh
    file, or the links with shapes of a model. `shapes` counts the convex shapes. `closed` says whether all meshes bound
    a volume; it is None for a model. `skipped` are sentences on what is left out. `excess` is the fraction by which the
    convex parts have more volume than their mesh, the largest over all meshes; None if no mesh is concave.
    """

    name: str
    failure: str
    bodies: int
    shapes: int
    closed: bool | None
    skipped: tuple[str, ...]
    excess: float | None
    overlaps: tuple[Shared, ...]

    @property
    def sound(self) -> bool:
        """Whether the file can be read, no mesh is open, nothing is left out, and nothing overlaps."""
        return not (self.failure or self.skipped or self.overlaps) and self.closed is not False

    @property
    def status(self) -> str:
        """The status of the file in words: sound, not read or not sound."""
        return "sound" if self.sound else "not read" if self.failure else "not sound"


def asset_files(folder: Path) -> list[Path]:
    """The models and meshes in a folder and its subfolders, sorted. ValueError if there is none."""
    found = sorted(
        path
        for path in folder.rglob("*")
        if path.suffix.lower() in (*ENDINGS, *MESHES)
        and path.is_file()
        and not path.name.startswith(".")
        and (path.suffix.lower() != ".xml" or _is_mjcf(path))
    )
    if not found:
        raise ValueError(
            f"the folder {folder} has no model and no mesh with one of the endings {', '.join((*ENDINGS, *MESHES))}"
        )
    return found


def _is_mjcf(path: Path) -> bool:
    """Whether the beginning of a file is MJCF. A file that cannot be opened counts as MJCF and is reported later."""
    try:
        with path.open("rb") as file:
            return b"<mujoco" in file.read(4000)
    except OSError:
        return True


def read_asset(folder: Path, path: Path, units: str, least_depth: float, modelling: Modelling) -> Asset:
    """Read one of the files. `units` is the unit of meshes whose file does not state one.

    Overlaps with a depth of `least_depth` (m) or less do not count. Overlaps that the rounding of corners to six digits
    explains do not count either. If a file cannot be read or needs a missing library, its `failure` says so.
    """
    name = path.relative_to(folder).as_posix()
    of_kind: Callable[..., Asset] = _model if path.suffix.lower() in ENDINGS else _mesh
    try:
        return of_kind(name, path, units, least_depth, modelling)
    except OSError as error:
        return _unread(name, f"{error.strerror}")
    except (ImportError, NotRead, RuntimeError, ValueError) as error:
        return _unread(name, first_line(error).removeprefix(f"{path} ").removeprefix(f"{path}: "))
    except Exception as error:  # a bug of this package must not stop the report on the other files
        return _unread(name, f"{type(error).__name__}: {first_line(error)}")


def _unread(name: str, failure: str) -> Asset:
    return Asset(name, failure, 0, 0, None, (), None, ())


def write_table(assets: Sequence[Asset], path: Path, settings: Mapping[str, Any]) -> None:
    """Write a row for each asset. OSError if the file cannot be written."""
    texts = {name: str(value) for name, value in settings.items()}
    table = TABLES[path.suffix](path, origin() | texts, COLUMNS)
    try:
        table.write(map(_row, assets))
    except BaseException:
        table.leave()
        raise
    table.close()


def _row(asset: Asset) -> Row:
    overlaps = [asdict(each) for each in asset.overlaps]
    read = not asset.failure
    return {
        "asset": asset.name,
        "status": asset.status,
        "failure": asset.failure or None,
        "bodies": asset.bodies if read else None,
        "shapes": asset.shapes if read else None,
        "closed": None if asset.closed is None else int(asset.closed),
        "excess": asset.excess,
        "overlaps": json.dumps(overlaps) if overlaps else None,
        "not_modelled": "; ".join(asset.skipped) or None,
    }


def _model(name: str, path: Path, units: str, least_depth: float, modelling: Modelling) -> Asset:
    robot = read_robot(path, modelling)
    links = robot.tree.links
    skipped = [f"{label}: {link.skipped}" for label, link in zip(robot.link_names, links) if link.skipped]
    met = [each for each in audit(robot, 1, least_depth=least_depth).pairs if not each.pair.adjacent]
    overlaps = [
        Shared(each.names, each.largest.contact.volume, each.largest.contact.depth) for each in met if each.largest
    ]
    excess = max((link.excess for link in links if link.excess is not None), default=None)
    bodies = len({shape.link for shape in robot.tree.shapes})
    return Asset(name, "", bodies, len(robot.tree.shapes), None, tuple(skipped), excess, tuple(overlaps))


def _mesh(name: str, path: Path, units: str, least_depth: float, modelling: Modelling) -> Asset:
    from overlapper.polytopes.mesh_file import read_parts

    parts = read_parts(path, units)
    closed, excess = True, None
    skipped: list[str] = []
    keys: list[tuple[int, int, int]] = []
    hulls: list[Hull] = []
    names = [part.name or name for part in parts]
    for number, part in enumerate(parts):
        try:
            surface = WeldedMesh.of(part.triangles)
        except NotDecomposed as error:
            closed = False
            skipped.append(f"{names[number]}: {error}")
            continue
        closed = closed and surface.volume is not None and not surface.open_edges
        try:
            if modelling.concave == "skip" and not surface.convex_bodies():
                raise NotDecomposed("the mesh is concave, and --concave skip leaves out concave meshes")
            made = decompose(part.triangles, modelling.concave_threshold, modelling.concave == "enclose")
            placed = [Hull(part.placed(each.vertices)) for each in made.parts]
        except ValueError as error:
            skipped.append(f"{names[number]}: {first_line(error)}")
            continue
        if made.path and made.mesh_volume:
            excess = max(made.volume / made.mesh_volume - 1, excess or 0.0)
        keys += [(number, -1, shape) for shape in range(len(placed))]
        hulls += placed
    overlaps = _shared(keys, hulls, names, least_depth)
    return Asset(name, "", len(parts), len(hulls), closed, tuple(skipped), excess, tuple(overlaps))


def _shared(
    keys: Sequence[tuple[int, int, int]], hulls: Sequence[Hull], names: Sequence[str], least_depth: float
) -> list[Shared]:
    rows = np.array(keys, dtype=np.int64).reshape(-1, 3)
    poses = np.zeros((len(hulls), 3)), np.tile([0.0, 0.0, 0.0, 1.0], (len(hulls), 1))
    batch = Batch(hulls)
    pairs = batch.candidate_pairs(*poses)
    pairs = pairs[rows[pairs[:, 0], 0] != rows[pairs[:, 1], 0]]
    reach = max((float(np.abs(hull.bounds).max()) for hull in hulls), default=0.0)
    least = max(least_depth, 2 * math.sqrt(3) * ROUNDING * reach)
    contacts = link_contacts(Contacts(rows, batch.overlaps(*poses, pairs, separated=False)))
    return [
        Shared((names[each.bodyA], names[each.bodyB]), each.volume, each.depth)
        for each in contacts
        if each.depth > least
    ]
