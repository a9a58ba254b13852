"""A run as a table: one row per step and pair that overlaps or touches, written while the run goes on."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from overlapper.reference import Comparison
    from overlapper.simulation import Contact

Value = int | float | str | None
Row = dict[str, Value]

POSE = [f"position{{}}_{axis}_m" for axis in "xyz"] + [f"orientation{{}}_{part}" for part in "xyzw"]
MEASURES = [
    "volume_m3",
    "volume_error_m3",
    *[f"centroid_{axis}_m" for axis in "xyz"],
    "area_m2",
    "depth_m",
    *[f"normal_{axis}" for axis in "xyz"],
]

# Every column of a run, in order, with its type; the unit is in the name. `link` is -1 for the base, `shape` counts the
# shapes of that link, the poses are those of the two shapes in the world, `normal` points from B to A. The columns of
# the centroid are empty for a pair that only touches.
COLUMNS: dict[str, type] = {
    "step": int,
    "time_s": float,
    **{
        f"{word}{side}": kind
        for side in "AB"
        for word, kind in (("body", int), ("link", int), ("shape", int), ("name", str))
    },
    **{part.format(side): float for side in "AB" for part in POSE},
    "status": str,
    **dict.fromkeys(MEASURES, float),
    "fcl": str,
    "fcl_explanation": str,
}


class Bodies(Protocol):
    """What a table asks of them: the shapes by (body, link, shape), their poses in that order, the links' names."""

    @property
    def keys(self) -> list[tuple[int, int, int]]: ...
    @property
    def positions(self) -> NDArray[np.float64]: ...
    @property
    def orientations(self) -> NDArray[np.float64]: ...
    @property
    def names(self) -> dict[tuple[int, int], str]: ...


def key(row: Row) -> tuple[Value, ...]:
    """(bodyA, linkA, shapeA, bodyB, linkB, shapeB); None for a missing B."""
    return tuple(row.get(f"{word}{side}") for side in "AB" for word in ("body", "link", "shape"))


def placements(bodies: Bodies, side: str) -> dict[tuple[int, int, int], Row]:
    """Which shape, and where: the columns of side "A" or "B" for every shape, by (body, link, shape)."""
    names = bodies.names
    poses = np.hstack([bodies.positions, bodies.orientations]).tolist()
    return {
        (body, link, shape): {
            f"body{side}": body,
            f"link{side}": link,
            f"shape{side}": shape,
            f"name{side}": names[body, link],
            **{part.format(side): value for part, value in zip(POSE, pose)},
        }
        for (body, link, shape), pose in zip(bodies.keys, poses)
    }


def rows(
    step: int, time: float, bodies: Bodies, contacts: Sequence[Contact], opinions: Sequence[Comparison] = ()
) -> list[Row]:
    """The rows of one step; `opinions` are FCL's of the same contacts, if it was asked."""
    a, b = placements(bodies, "A"), placements(bodies, "B")
    table: list[Row] = []
    for k, contact in enumerate(contacts):
        overlap = contact.overlap
        assert overlap.depth is not None and overlap.normal is not None
        centroid = [None] * 3 if overlap.centroid is None else overlap.centroid.tolist()
        normal = overlap.normal.tolist()
        measures = [overlap.volume, overlap.volume_error, *centroid, overlap.area, overlap.depth, *normal]
        table.append(
            {
                "step": step,
                "time_s": time,
                **a[contact.bodyA, contact.linkA, contact.shapeA],
                **b[contact.bodyB, contact.linkB, contact.shapeB],
                "status": overlap.status,
                **dict(zip(MEASURES, measures)),
                "fcl": opinions[k].verdict if opinions else None,
                "fcl_explanation": opinions[k].explanation if opinions else None,
            }
        )
    return table


class Table(Protocol):
    """A file that grows by the rows of a step at a time and can be read after `close`, however the run ended."""

    def write(self, rows: Iterable[Row]) -> None: ...
    def close(self) -> None: ...


class CsvTable:
    """Comma-separated values; what a step wrote is on disk before the next begins."""

    def __init__(self, path: Path, columns: Sequence[str] = tuple(COLUMNS), heading: str = "") -> None:
        self._file = path.open("w", newline="", encoding="utf-8")
        self._file.write(heading)
        self._writer = csv.DictWriter(self._file, columns, extrasaction="ignore", lineterminator="\n")
        self._writer.writeheader()
        self._file.flush()

    def write(self, rows: Iterable[Row]) -> None:
        self._writer.writerows(rows)
        self._file.flush()

    def close(self) -> None:
        self._file.close()


class ParquetTable:
    """Parquet by pyarrow; the footer that makes it readable is written by `close`."""

    GROUP = 20_000  # rows; a row group of a few megabytes, as Parquet's readers expect

    def __init__(self, path: Path) -> None:
        try:
            import pyarrow
            import pyarrow.parquet
        except ImportError as error:
            raise ImportError("a .parquet table needs pyarrow: pip install 'overlapper[cli]'") from error
        kinds = {int: pyarrow.int32(), float: pyarrow.float64(), str: pyarrow.string()}
        self._schema = pyarrow.schema([(name, kinds[kind]) for name, kind in COLUMNS.items()])
        self._table: Any = pyarrow.Table
        self._writer = pyarrow.parquet.ParquetWriter(path, self._schema)
        self._waiting: list[Row] = []

    def write(self, rows: Iterable[Row]) -> None:
        self._waiting += rows
        if len(self._waiting) >= self.GROUP:
            self._flush()

    def _flush(self) -> None:
        self._writer.write_table(self._table.from_pylist(self._waiting, schema=self._schema))
        self._waiting = []

    def close(self) -> None:
        self._flush()
        self._writer.close()


# The kinds of table, by the ending of the file's name.
TABLES: dict[str, Callable[[Path], Table]] = {".csv": CsvTable, ".parquet": ParquetTable}


def read_csv(path: Path) -> list[Row]:
    """The rows of a CSV table; lines that begin with # are skipped, empty cells are None."""
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(line for line in file if not line.startswith("#"))
        return [{name: COLUMNS[name](cell) if cell else None for name, cell in row.items()} for row in reader]
