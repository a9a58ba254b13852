"""Charts of tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from overlapper.plots import NEEDED, Axes, over_time
from overlapper.tables.table import COLUMNS, FORCES
from overlapper.tables.table_file import read_table


def drawn(path: Path | None, forces: bool, steps: Sequence[int], times: Sequence[float], most: int) -> Axes:
    """The chart over time of the rows of a table, with the `forces` if it has them. Without a path, of no rows."""
    rows = read_table(path) if path else []
    names = [name for name in (COLUMNS | FORCES if forces else COLUMNS) if name in NEEDED]
    return over_time({name: [row.get(name) for row in rows] for name in names}, steps, times, most)
