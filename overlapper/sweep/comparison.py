"""A sweep held against a recorded one: which tasks came to something else, and by how many times their budgets."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overlapper.printable import first_line
from overlapper.scenes.parameters import Parameter, described
from overlapper.sweep.measures import LEFT_OUT
from overlapper.sweep.part import FAILURES, OF, TASK, TASKS, arrow
from overlapper.sweep.store import Store, names_of, rows_in
from overlapper.sweep.sweep import Sweep
from overlapper.tables.table_file import read_metadata
from overlapper.verdicts.comparison import off_by
from overlapper.verdicts.expected import FORCES, ROUNDING, Budget, budgets_in

Row = Mapping[str, Any]
Key = tuple[Parameter, ...]

# The measures compared, each with the quantity whose budget holds for it.
BUDGETED = {"largest_volume_m3": "volume", "mean_volume_m3": "volume", "largest_depth_m": "depth"}
BUDGETED |= {"largest_force_n": "force"}  # of volumetric contact alone
FORCE, CONTACT, TASK_ITSELF = "mean_force_m2", "contact_time_s", "task"
COUNTED = ("skipped", "diverged")  # any difference is one; earlier versions did not count
COMPARED = (TASK_ITSELF, *COUNTED, *BUDGETED, FORCE, CONTACT)


@dataclass(frozen=True, slots=True)
class Change:
    """A measure of a task that is too far from what was recorded: by `part` times what is allowed.

    A task itself, done or failed, is a measure without such a number, which is then infinite.
    """

    parameters: Mapping[str, Parameter]
    measure: str
    recorded: str
    found: str
    part: float = math.inf

    def __str__(self) -> str:
        times = f": {self.part:.3g} times its budget" if math.isfinite(self.part) else ""
        task = described(self.parameters) or "the scene"
        return f"{task}: {self.measure} is {self.found}, recorded as {self.recorded}{times}"


@dataclass(frozen=True, slots=True)
class Compared:
    """A task of both sweeps: its row as recorded and as found, that of its failure if it failed, and its changes."""

    recorded: Row
    found: Row
    changes: list[Change]

    @property
    def worst(self) -> Change:
        """The change that takes most of its budget; there must be one."""
        return max(self.changes, key=lambda change: change.part)

    def difference(self, measure: str) -> float:
        """How much more of a measure it is than recorded; not a number where the task failed."""
        was, now = (row.get(measure, math.nan) for row in (self.recorded, self.found))
        return float(now - was)


@dataclass(frozen=True, slots=True)
class Comparison:
    """The tasks that both sweeps have; `added` and `gone` are numbers of tasks that only this or the other has."""

    folder: Path
    tasks: list[Compared] = field(default_factory=list)
    added: int = 0
    gone: int = 0

    @property
    def moved(self) -> list[Compared]:
        """The tasks that have moved, the worst first."""
        return sorted((task for task in self.tasks if task.changes), key=lambda task: -task.worst.part)

    @property
    def failures(self) -> set[str]:
        """The tasks that have failed as they had when they were recorded, by name."""
        return {task.found[TASK] for task in self.tasks if "what" in task.found and not task.changes}

    def counted(self) -> dict[str, int]:
        """In how many tasks each measure has moved, if it has in any."""
        counts = Counter(change.measure for task in self.tasks for change in task.changes)
        return {name: counts[name] for name in COMPARED if name in counts}

    def lines(self, limit: int) -> list[str]:
        """How many tasks have moved, and the `limit` worst ones, each with its worst measure."""
        moved = self.moved
        by_measure = ", ".join(f"{name} in {count:,}" for name, count in self.counted().items())
        said = f"{len(moved):,} of {len(self.tasks):,} tasks have moved since {self.folder}: {by_measure}."
        lines = [said if moved else f"{len(self.tasks):,} of {len(self.tasks):,} tasks are as in {self.folder}."]
        lines += [f"    {task.worst}" for task in moved[:limit]]
        if len(moved) > limit:
            lines.append(f"    and {len(moved) - limit:,} more")
        if self.added or self.gone:
            lines.append(f"Not compared: {self.added:,} that were not recorded, {self.gone:,} that are no more.")
        return lines


class Recorded:
    """The tasks in the folder of another sweep, whatever its scene file, settings and versions were.

    Two tasks are the same if the parameters that both sweeps have are, to 12 digits. Budgets are those of the expected
    file at `expected`, or, of what it does not name or where there is none, those of rounding. ValueError if either
    cannot be read, or if no task of `sweep` is in the folder.
    """

    def __init__(self, folder: Path, expected: Path, sweep: Sweep) -> None:
        self._folder, self._sweep = folder, sweep
        self._budgets = (
            ROUNDING | FORCES | (budgets_in(read_metadata(expected), expected) if expected.is_file() else {})
        )
        rows = _rows(folder)
        if not rows:
            raise ValueError(f"--check {folder}: there is no sweep in it")
        points = sweep.points
        self._names = [name for name in points[0] if all(name in row for row in rows)]
        self._rows = self._by_point(rows, "the sweep in it")
        if not self._rows.keys() & self._by_point(points, "this sweep").keys():
            raise ValueError(f"--check {folder}: it has none of the tasks of this sweep")

    def _by_point(self, rows: Collection[Row], whose: str) -> dict[Key, Row]:
        found = {self._key(row): row for row in rows}
        if len(found) < len(rows):
            same = f"the same {', '.join(self._names)}" if self._names else "nothing to tell them apart"
            raise ValueError(f"--check {self._folder}: by the parameters of both, tasks of {whose} have {same}")
        return found

    def _key(self, row: Row) -> Key:
        values = (row[name] for name in self._names)
        # Another version of NumPy may have another last digit in a grid of equal factors.
        return tuple(float(f"{value:.12g}") if isinstance(value, float) else value for value in values)

    def compare(self, store: Store) -> Comparison:
        """The comparison of the tasks that both sweeps have, as far as the sweep has come in its store."""
        rows = []
        for part in chain(store.rows(TASKS), store.rows(FAILURES)):
            ours = self._sweep.numbers(names_of(part.column(TASK))) >= 0
            rows += part.filter(arrow().array(ours)).to_pylist()
        found = self._by_point(rows, "this sweep")
        both = [key for key in found if key in self._rows]
        tasks = [Compared(self._rows[key], found[key], self._changes(self._rows[key], found[key])) for key in both]
        return Comparison(self._folder, tasks, len(found) - len(both), len(self._rows) - len(both))

    def _changes(self, was: Row, now: Row) -> list[Change]:
        parameters = {name: now[name] for name in self._sweep.points[0]}
        before, after = (row.get("what", "done") for row in (was, now))
        if before != after:
            return [Change(parameters, TASK_ITSELF, before, after)]
        measured = () if before != "done" else _measured(was, now, self._budgets)
        return [
            Change(parameters, measure, f"{a:.9g}", f"{b:.9g}", part) for measure, a, b, part in measured if part > 1
        ]


def _measured(was: Row, now: Row, budgets: Mapping[str, Budget]) -> Iterator[tuple[str, float, float, float]]:
    """Each measure with what it was and is, and the part of its budget that the difference takes."""
    for count in COUNTED:
        if count in was:
            yield count, was[count], now[count], _part(Budget(0.0, 0.0), off_by(was[count], now[count]), was[count])
    for measure, quantity in BUDGETED.items():
        if measure not in was or measure not in now:
            continue
        a, b = float(was[measure]), float(now[measure])
        yield measure, a, b, _part(budgets[quantity], off_by(a, b), a)
    # Forces that cancel leave the rounding of all the surface that they are of, which is not less than this.
    surface = float(was["largest_volume_m3"]) ** (2 / 3)
    forces = mean_force(was), mean_force(now)
    a, b = (float(np.linalg.norm(force)) for force in forces)
    yield FORCE, a, b, _part(budgets["area"], float(np.linalg.norm(forces[1] - forces[0])), max(a, surface))
    # It is a number of steps, and times are sums: half of one is none.
    a, b = float(was[CONTACT]), float(now[CONTACT])
    yield CONTACT, a, b, _part(Budget(0.0, was["time_s"] / was["steps"] / 2), off_by(a, b), a)


def _part(budget: Budget, difference: float, recorded: float) -> float:
    """The part of a budget that a difference takes; infinite if it is not a number."""
    part = budget.spent(difference, recorded)
    return math.inf if math.isnan(part) else part


def mean_force(row: Row) -> NDArray[np.float64]:
    """(3,) m², of a task that is done; zeros of one in which nothing overlapped."""
    return np.array([row[f"mean_force_{axis}_m2"] or 0.0 for axis in "xyz"])


def _rows(folder: Path) -> list[Row]:
    """Those of all tasks that are done or have failed; of one that is both, that it is done."""
    rows: dict[str, Row] = {}
    for table in (FAILURES, TASKS):
        try:
            found = rows_in(folder, table)
        except (OSError, ValueError, KeyError) as error:
            lacking = f"it has no column {error}" if isinstance(error, KeyError) else first_line(error)
            raise ValueError(f"--check {folder}: {table}.parquet cannot be read: {lacking}") from error
        if found and (missing := OF[table].keys() - LEFT_OUT.keys() - found[0].keys()):
            raise ValueError(f"--check {folder}: {table}.parquet has no column {min(missing)!r}")
        rows |= {row[TASK]: row for row in found}
    return [*rows.values()]
