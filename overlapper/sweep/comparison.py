"""Compares a sweep with a recorded one: which tasks have other results, and by how many times their budgets.

Both sweeps are read part by part. Only a few numbers of each task stay in memory.
"""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overlapper.printable import first_line
from overlapper.scenes.parameters import Parameter, described
from overlapper.sweep.measures import LEFT_OUT
from overlapper.sweep.part import FAILURES, OF, TASK, TASKS, arrow
from overlapper.sweep.store import Names, Store, content, names_of
from overlapper.sweep.sweep import Numbers, Sweep
from overlapper.tables.table_file import read_metadata, read_parquet
from overlapper.verdicts.expected import FORCES, ROUNDING, Budget, budgets_in

Values = NDArray[np.float64]
Block = Mapping[str, NDArray[Any]]

# The compared measures, each with the quantity whose budget applies.
BUDGETED = {"largest_volume_m3": "volume", "mean_volume_m3": "volume", "largest_depth_m": "depth"}
BUDGETED |= {"largest_force_n": "force"}  # only with volumetric contact
FORCE, CONTACT, TASK_ITSELF = "mean_force_m2", "contact_time_s", "task"
COUNTED = ("skipped", "diverged")  # any difference counts as a move; earlier versions did not write these columns
COMPARED = (TASK_ITSELF, *COUNTED, *BUDGETED, FORCE, CONTACT)

DRAWN = ("largest_volume_m3", "largest_depth_m")  # the measures whose differences are kept for each task
PUSHED = tuple(f"mean_force_{axis}_m2" for axis in "xyz")  # empty in a task in which nothing overlapped
NEEDED = ("largest_volume_m3", "mean_volume_m3", "largest_depth_m", *PUSHED, CONTACT, "time_s", "steps")
OPTIONAL = (*COUNTED, "largest_force_n")

WHAT, DONE = "what", "done"

WORST = 10  # tasks whose worst change is kept
BLOCK = 50_000  # tasks that are compared at a time


@dataclass(frozen=True, slots=True)
class Change:
    """A measure of a task that is too far from its recorded value: by `part` times the allowed difference.

    Whether the task is done or failed is also a measure. It has no number, and its `part` is infinite.
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
class Comparison:
    """The tasks that both sweeps have.

    `numbers` are the numbers of these tasks in this sweep. `parts` says for each task how many times its budget the
    worst measure has moved; above 1, the task has moved. `differences` are the values of some measures minus the
    recorded values; NaN where the task failed. `counts` says in how many tasks each measure has moved. `worst` has the
    worst change of each of the worst tasks. `same_failures` counts the tasks that failed in the same way as recorded.
    `added` counts the tasks that only this sweep has, `gone` the tasks that only the recorded sweep has.
    """

    folder: Path
    numbers: Numbers
    parts: Values
    differences: Mapping[str, Values]
    counts: Mapping[str, int]
    worst: Sequence[Change]
    same_failures: int
    added: int
    gone: int

    @property
    def moved(self) -> Numbers:
        """The numbers of the tasks that have moved, the worst task first."""
        order = np.argsort(-self.parts, kind="stable")
        return self.numbers[order][: int((self.parts > 1).sum())]

    def lines(self, limit: int) -> list[str]:
        """Sentences: how many tasks have moved, and the `limit` worst tasks, each with its worst measure."""
        moved, compared = int((self.parts > 1).sum()), len(self.numbers)
        by_measure = ", ".join(f"{name} in {count:,}" for name, count in self.counts.items())
        said = f"{moved:,} of {compared:,} tasks have moved since {self.folder}: {by_measure}."
        lines = [said if moved else f"All {compared:,} tasks are as in {self.folder}."]
        lines += [f"    {change}" for change in self.worst[:limit]]
        if moved > limit:
            lines.append(f"    and {moved - limit:,} more")
        if self.added or self.gone:
            lines.append(
                f"Not compared: {self.added:,} new tasks, {self.gone:,} tasks that only the recorded sweep has."
            )
        return lines


@dataclass(frozen=True, slots=True)
class _Side:
    """The tasks of one of the two sweeps, by their numbers in the sweep that is compared.

    `read` returns some columns of a file. `numbers` takes the columns `told` and returns the task number of each row,
    -1 for tasks that the sweep does not have. `place` (n,) says in which of `files` each task is, -1 for none.
    """

    files: Sequence[Path]
    read: Callable[[Path, Sequence[str]], Any]
    told: Sequence[str]
    numbers: Callable[[Any], Numbers]
    place: NDArray[np.int32]

    def block(self, wanted: Numbers) -> Block:
        """The columns of some tasks, whose numbers are in order. `what` is "done" or how the task failed.

        All other columns are numbers; they are NaN for a task that failed. Optional columns may be missing.
        """
        found: dict[str, NDArray[Any]] = {name: np.full(len(wanted), np.nan) for name in (*NEEDED, *OPTIONAL)}
        found[WHAT] = np.full(len(wanted), DONE, object)
        lacking = {*OPTIONAL}
        for place in np.unique(self.place[wanted]).tolist():
            rows = self.read(self.files[place], [*self.told, *found])
            numbers = self.numbers(rows)
            at = np.minimum(np.searchsorted(wanted, numbers), len(wanted) - 1)
            ours = (wanted[at] == numbers) & (self.place[numbers] == place)
            for name in found.keys() & set(rows.column_names):
                column = rows.column(name)
                values = column.to_pylist() if name == WHAT else column.fill_null(0).to_numpy()
                found[name][at[ours]] = np.asarray(values, found[name].dtype)[ours]
            lacking -= {*rows.column_names}
        return {name: values for name, values in found.items() if name not in lacking}


def _places(count: int, numbers: Iterable[Numbers]) -> NDArray[np.int32]:
    """For each of `count` tasks, the part that holds it, from the numbers in each part; the last one if several do."""
    place = np.full(count, -1, np.int32)
    for part, found in enumerate(numbers):
        place[found[found >= 0]] = part
    return place


class Recorded:
    """The tasks in the folder of another sweep, whatever its scene file, settings and versions were.

    Two tasks are the same if the parameters that both sweeps have are equal to 12 digits. Budgets come from the
    expected file at `expected`. Without this file, and for quantities that it does not name, they are the budgets of
    rounding. ValueError if the folder or the file cannot be read, or if no task of `sweep` is in the folder.
    """

    def __init__(self, folder: Path, expected: Path, sweep: Sweep) -> None:
        self._folder, self._sweep = folder, sweep
        budgets = budgets_in(read_metadata(expected), expected) if expected.is_file() else {}
        self._budgets: Mapping[str, Budget] = ROUNDING | FORCES | budgets
        # Failures first: a task that is recorded both as failed and as done counts as done.
        tables = [folder / f"{table}.parquet" for table in (FAILURES, TASKS)]
        files = [path for table in tables for path in sorted(table.glob("*.parquet"))]
        if not files:
            raise ValueError(f"--check {folder}: the folder has no sweep")
        columns = [self._columns(path) for path in files]
        self._names = [name for name in sweep.points[0] if all(name in each for each in columns)]
        keys = np.fromiter((_key(point[name] for name in self._names) for point in sweep.points), "S16", len(sweep))
        self._order = np.argsort(keys)
        self._keys = keys[self._order]
        self._must_differ(self._keys, "this sweep")
        told = [TASK, *self._names]
        place = _places(len(sweep), (self._numbers(rows) for rows in self._counted(files, told)))
        if not (place >= 0).any():
            raise ValueError(f"--check {folder}: the folder has no task of this sweep")
        self._recorded = _Side(files, self._read, told, self._numbers, place)

    def _counted(self, files: Iterable[Path], told: Sequence[str]) -> Iterator[Any]:
        """The rows of each part. At the end, the number of tasks is known. ValueError if two tasks are the same."""
        tasks, keys = [], []
        for path in files:
            yield (rows := self._read(path, told))
            tasks.append(np.array(names_of(rows.column(TASK))))
            keys.append(self._keys_of(rows))
        names, first = np.unique(np.concatenate(tasks), return_index=True)
        self._count = len(names)
        self._must_differ(np.sort(np.concatenate(keys)[first]), "the recorded sweep")

    def _must_differ(self, keys: Names, whose: str) -> None:
        """ValueError if two of the sorted keys are equal."""
        if (keys[1:] == keys[:-1]).any():
            alike = "cannot be told apart, because the sweeps have no common parameter"
            same = f"have the same {', '.join(self._names)}" if self._names else alike
            raise ValueError(f"--check {self._folder}: two tasks of {whose} {same}")

    def _columns(self, path: Path) -> set[str]:
        """The columns of a part. ValueError if a column that is compared is missing."""
        columns = {*self._opened(path).schema_arrow.names}
        if missing := {TASK, *OF[path.parent.stem]} - LEFT_OUT.keys() - columns:
            raise ValueError(f"--check {self._folder}: {path.parent.name} has no column {min(missing)!r}")
        return columns

    def _opened(self, path: Path) -> Any:
        pyarrow = arrow()
        try:
            return pyarrow.parquet.ParquetFile(path, page_checksum_verification=True)
        except (pyarrow.ArrowException, OSError) as error:
            raise self._unreadable(path, error) from error

    def _read(self, path: Path, columns: Sequence[str]) -> Any:
        """The given columns of a part, without those that it does not have."""
        with self._opened(path) as file:
            try:
                return read_parquet(file, columns)
            except (arrow().ArrowException, OSError) as error:
                raise self._unreadable(path, error) from error

    def _unreadable(self, path: Path, error: Exception) -> ValueError:
        return ValueError(f"--check {self._folder}: {path.parent.name} cannot be read: {first_line(error)}")

    def _keys_of(self, rows: Any) -> Names:
        points = zip(*(rows.column(name).to_pylist() for name in self._names)) if self._names else [()] * len(rows)
        return np.fromiter((_key(point) for point in points), "S16", len(rows))

    def _numbers(self, rows: Any) -> Numbers:
        """The number in this sweep of each row of a part; -1 for tasks that this sweep does not have."""
        keys = self._keys_of(rows)
        at = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        return np.where(self._keys[at] == keys, self._order[at], -1)

    def compare(self, store: Store) -> Comparison:
        """The comparison of the tasks that both sweeps have. Only tasks that are already in the store are compared."""
        sweep, recorded = self._sweep, self._recorded

        def numbers(rows: Any) -> Numbers:
            return sweep.numbers(names_of(rows.column(TASK)))

        files = [path for table in (FAILURES, TASKS) for path in store.files(table)]
        place = _places(len(sweep), (numbers(content(path, [TASK])) for path in files))
        found = _Side(files, content, [TASK], numbers, place)
        both = np.flatnonzero((place >= 0) & (recorded.place >= 0))
        tally = _Tally(sweep.points)
        for start in range(0, len(both), BLOCK):
            wanted = both[start : start + BLOCK]
            tally.add(wanted, recorded.block(wanted), found.block(wanted), self._budgets)
        added = int((place >= 0).sum()) - len(both)
        return tally.comparison(self._folder, both, added, self._count - len(both))


class _Tally:
    """The changes of some blocks of tasks."""

    def __init__(self, points: Sequence[Mapping[str, Parameter]]) -> None:
        self._points = points
        self._parts, self._differences = [np.empty(0)], {name: [np.empty(0)] for name in DRAWN}
        self._counts: Counter[str] = Counter()
        self._worst: list[tuple[float, int, Change]] = []
        self._same_failures = 0

    def add(self, numbers: Numbers, was: Block, now: Block, budgets: Mapping[str, Budget]) -> None:
        """Add a block of tasks, as they were recorded and as they are now."""
        changed = was[WHAT] != now[WHAT]
        done = ~changed & (now[WHAT] == DONE)
        self._same_failures += int((~changed & (now[WHAT] != DONE)).sum())
        measured: dict[str, tuple[NDArray[Any], NDArray[Any], Values]]
        measured = {TASK_ITSELF: (was[WHAT], now[WHAT], np.where(changed, np.inf, 0.0))}
        with np.errstate(all="ignore"):
            for measure, before, after, part in _measured(was, now, budgets):
                measured[measure] = before, after, np.where(done, part, 0.0)
        parts = np.array([part for _, _, part in measured.values()])
        self._counts.update({name: int((part > 1).sum()) for name, (_, _, part) in measured.items()})
        of_task = parts.max(axis=0)
        self._parts.append(of_task)
        for name, each in self._differences.items():
            each.append(np.where(done, now[name] - was[name], np.nan))
        for at in np.argsort(-of_task, kind="stable")[:WORST]:
            if of_task[at] > 1:
                measure = [*measured][int(parts[:, at].argmax())]
                recorded, found = (_text(values[at]) for values in measured[measure][:2])
                number = int(numbers[at])
                change = Change(self._points[number], measure, recorded, found, float(of_task[at]))
                self._worst.append((-change.part, number, change))
        self._worst = sorted(self._worst, key=itemgetter(0, 1))[:WORST]

    def comparison(self, folder: Path, numbers: Numbers, added: int, gone: int) -> Comparison:
        """The comparison of all tasks that were added; `numbers` are their numbers."""
        return Comparison(
            folder,
            numbers,
            np.concatenate(self._parts),
            {name: np.concatenate(each) for name, each in self._differences.items()},
            {name: self._counts[name] for name in COMPARED if self._counts[name]},
            [change for *_, change in self._worst],
            self._same_failures,
            added,
            gone,
        )


def _measured(was: Block, now: Block, budgets: Mapping[str, Budget]) -> Iterator[tuple[str, Values, Values, Values]]:
    """Each measure with its recorded and its present values, and the part of its budget that the difference uses."""
    for measure in (*COUNTED, *BUDGETED):
        if measure in was and measure in now:
            budget = budgets[BUDGETED[measure]] if measure in BUDGETED else Budget(0.0, 0.0)
            a, b = was[measure], now[measure]
            yield measure, a, b, _part(_off_by(a, b), budget.absolute + budget.relative * abs(a))
    # Forces that cancel leave the rounding error of the whole surface they act on. The surface is not less than this.
    surface, area = was["largest_volume_m3"] ** (2 / 3), budgets["area"]
    forces = [np.stack([block[name] for name in PUSHED]) for block in (was, now)]
    a, b, change = (np.linalg.norm(each, axis=0) for each in (*forces, forces[1] - forces[0]))
    yield FORCE, a, b, _part(change, area.absolute + area.relative * np.maximum(a, surface))
    # Contact time is a whole number of steps, summed with rounding. A difference below half a step is none.
    a, b = was[CONTACT], now[CONTACT]
    yield CONTACT, a, b, _part(_off_by(a, b), was["time_s"] / was["steps"] / 2)


def _off_by(was: NDArray[Any], now: NDArray[Any]) -> NDArray[Any]:
    """The change of a measure. NaN differs from every number, but not from NaN."""
    return np.where((was == now) | (np.isnan(was) & np.isnan(now)), 0.0, abs(now - was))


def _part(difference: NDArray[Any], allowed: NDArray[Any]) -> Values:
    """The difference divided by the allowed difference; infinite if the difference is NaN."""
    part = np.where(difference == 0, 0.0, difference / allowed)
    return np.where(np.isnan(part), np.inf, part)


def _key(values: Iterable[Parameter]) -> bytes:
    """A digest of parameters, 16 bytes, that identifies a task."""
    return hashlib.sha256("\0".join(map(_to_12_digits, values)).encode()).digest()[:16]


@lru_cache(maxsize=4096)
def _to_12_digits(value: Parameter) -> str:
    """A text of a parameter, the same for equal parameters.

    Another version of NumPy may give another last digit in a grid with equal factors, so only 12 digits count.
    """
    if isinstance(value, str):
        return repr(value)
    rounded = float(f"{value:.12g}") if isinstance(value, float) else value
    return repr(rounded) if isinstance(rounded, float) and not rounded.is_integer() else str(int(rounded))


def _text(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:.9g}"
