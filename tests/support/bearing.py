"""A bearing block of thirty parts as mesh files in mm: bolted plates, a shaft, a sleeve that stands a little off."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import trimesh
from manifold3d import Manifold

ROUND = 32  # sides of what is round
BOLTS = [(40 * np.cos(turn), 40 * np.sin(turn)) for turn in np.arange(8) * np.pi / 4]
CLASH = ("bolt_4.stl", "sleeve.ply")


def write(folder: Path, off: float = 0.65) -> list[Path]:
    """The thirty files. A sleeve that stands `off` its place (mm) by more than 0.5 bites into the head of a bolt."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, solid in solids(off):
        mesh = solid.to_mesh64()
        written.append(folder / name)
        trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts, process=False).export(written[-1])
    return written


def solids(off: float) -> Iterator[tuple[str, Manifold]]:
    """Name and solid of each part, where it stands, mm."""
    plate = Manifold.cube([110, 110, 10], True)
    for x, y in BOLTS:
        plate -= rod(3.3, -6, 6).translate([x, y, 0])
    plate -= rod(20, -6, 6)
    yield "plate_lower.stl", plate.translate([0, 0, -5])
    yield "plate_upper.stl", plate.translate([0, 0, 5])
    for k, (x, y) in enumerate(BOLTS):
        yield f"bolt_{k}.stl", (rod(3, -16, 11) + rod(5.5, 11, 15)).translate([x, y, 0])
        yield f"washer_{k}.obj", (rod(6, 10, 11) - rod(3.2, 9, 12)).translate([x, y, 0])
        yield f"nut_{k}.stl", (rod(5.5, -14, -10, 6) - rod(3.1, -15, -9)).translate([x, y, 0])
    away = np.array([*BOLTS[4], 0]) / 40
    yield "shaft.stl", rod(12, -40, 60)
    yield "bush.ply", rod(19.5, -10, 10) - rod(12.2, -11, 11)
    yield "sleeve.ply", (rod(34, 12, 30) - rod(30, 11, 31)).translate(list(off * away))
    yield "collar.obj", rod(18, 32, 40) - rod(12.2, 31, 41)


def rod(radius: float, bottom: float, top: float, sides: int = ROUND) -> Manifold:
    return Manifold.cylinder(top - bottom, radius, circular_segments=sides).translate([0, 0, bottom])
