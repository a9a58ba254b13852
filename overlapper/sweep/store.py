"""The folder of a sweep. Its files are parts of many tasks each. Every task in the folder is complete and there once.

`tasks.parquet`, `steps.parquet` and `failures.parquet` are folders, and readers take each folder for one table. A part
is named by the digest of its bytes. It is put in place as a whole when all of its tasks are done or have failed. Until
then its tasks are in pieces, in the same three tables of the folder `.unfinished`. `sweep.json` identifies the sweep.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from overlapper.install import hint
from overlapper.printable import first_line
from overlapper.sweep.part import FAILURES, OF_TASKS, STEPS, STEPS_PART, TASK, TASKS, arrow, digest, parts
from overlapper.tables.table_file import read_parquet
from overlapper.whole_file import beside

Names = NDArray[np.bytes_]  # of tasks, 16 bytes each

# Written to sweep.json: parts are named by their digests. Earlier versions named each part by its only task.
LAYOUT = {"parts": "named by digest"}


class Known(Protocol):
    """The tasks of a sweep, by their numbers."""

    names: Names

    def numbers(self, names: Names) -> NDArray[np.intp]:
        """The number of each task by its name; -1 for those of other sweeps."""
        ...


def names_of(column: Any) -> Names:
    """The names of tasks in an Arrow column. ValueError if the column does not hold names."""
    return np.frombuffer(bytes.fromhex("".join(column.to_pylist())), "S16")


def text_of(name: bytes) -> str:
    """The name of a task as it is in a table, 32 hexadecimal digits."""
    return bytes(name).ljust(16, b"\0").hex()  # NumPy drops zeros at the end


def among(names: Names, known: Names) -> NDArray[np.bool_]:
    """Which names are in `known`, which is sorted."""
    if not len(known):
        return np.zeros(len(names), bool)
    return np.equal(known[np.minimum(np.searchsorted(known, names), len(known) - 1)], names)


class Broken(ValueError):
    """A part differs from what was written. The text is a sentence with the path of the part."""

    def __init__(self, path: Path, what: str = "has changed since it was written") -> None:
        super().__init__(f"{path} {what}")
        self.path = path


def content(path: Path, columns: Sequence[str] | None = None) -> Any:
    """The Arrow table of a part, or the given columns of it. Broken if the part differs from what was written."""
    pyarrow = arrow()
    data = _must_be_whole(path)
    try:
        file = pyarrow.parquet.ParquetFile(pyarrow.BufferReader(data), page_checksum_verification=True)
        return read_parquet(file, columns)
    except (pyarrow.ArrowException, OSError) as error:
        raise Broken(path, f"cannot be read: {first_line(error)}") from error


def _must_be_whole(path: Path) -> bytes:
    """The bytes of a part. Broken if the part is missing or differs from what was written."""
    try:
        data = path.read_bytes()
    except FileNotFoundError as error:
        raise Broken(path, "is not there") from error
    if digest(data) != path.stem:
        raise Broken(path)
    return data


class Shelf:
    """The three tables in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, table: str) -> Path:
        """The folder of a table. It exists if the table has any rows."""
        return self.folder / f"{table}.parquet"

    def files(self, table: str) -> list[Path]:
        """The parts of a table."""
        return sorted(self.path(table).glob("*.parquet"))

    def put(self, tables: Mapping[str, bytes], begun: str) -> list[Path]:
        """Put parts in their places: the steps before their tasks. Each part is written to the file `begun` first."""
        places = []
        for table in (STEPS, TASKS, FAILURES):
            if table in tables:
                self.path(table).mkdir(parents=True, exist_ok=True)
                places.append(self.path(table) / f"{digest(tables[table])}.parquet")
                _put(tables[table], begun, places[-1])
        return places

    def steps_of(self, part: Path, schema: Any = None) -> Path | None:
        """The part with the steps of a part of tasks. `schema` is the schema of `part`, if it has been read."""
        name = ((schema or arrow().parquet.read_schema(part)).metadata or {}).get(STEPS_PART)
        return self.path(STEPS) / f"{name.decode()}.parquet" if name else None

    def checked(self, broken: list[Path]) -> dict[Path, Names]:
        """The names of the tasks in each part of tasks and failures.

        Parts that differ from what was written are deleted. Tasks without their steps and steps without their tasks,
        which a kill may leave, are deleted, too.
        """
        found: dict[Path, Names] = {}
        steps: set[Path] = set()
        for path in (path for table in (TASKS, FAILURES) for path in self.files(table)):
            try:
                rows = content(path, [TASK])
                names = names_of(rows.column(TASK))
                if with_steps := self.steps_of(path, rows.schema):
                    _must_be_whole(with_steps)
                    steps.add(with_steps)
                found[path] = names
            except Broken as error:
                broken.append(error.path)
                path.unlink()
        for path in self.files(STEPS):
            if path not in steps:
                path.unlink()
        return found

    def remove(self, part: Path) -> None:
        """Delete a part and its steps."""
        steps = self.steps_of(part)
        part.unlink()
        if steps:
            steps.unlink()


def _put(data: bytes, begun: str, place: Path) -> None:
    """Write a part without waiting for the disk, because waiting takes longer than many tasks.

    A kill leaves no part half written. A power cut may damage parts that are seconds old; their tasks are done again.
    """
    # A file object would need four more system calls.
    file = os.open(begun, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
    try:
        unwritten = memoryview(data)
        while unwritten:
            unwritten = unwritten[os.write(file, unwritten) :]
    finally:
        os.close(file)
    os.replace(begun, place)


class Store(Shelf):
    """The parts in a folder, for one sweep at a time.

    `identity` must equal the identity of a sweep that is already in the folder. `broken` lists the parts that differed
    from what was written; they are deleted. OSError if the folder cannot be made. ValueError if the folder belongs to
    another sweep, or if another process is at work in it.
    """

    def __init__(self, folder: Path, identity: Mapping[str, str]) -> None:
        super().__init__(folder)
        folder.mkdir(parents=True, exist_ok=True)
        # Beside the tables: readers take every file in a table's folder for a part.
        self._begun = f"{folder}/.begun.parquet"
        self._pieces = Shelf(folder / ".unfinished")
        self.broken: list[Path] = []
        self._lock = _locked(folder)
        try:
            self._belong({**identity, **LAYOUT})
            self.settle()
            self.pieces = self._pieces.checked(self.broken)
        except BaseException:
            self._lock.release()
            raise

    def _belong(self, identity: Mapping[str, str]) -> None:
        there = self.folder / "sweep.json"
        try:
            known = dict(json.loads(there.read_text(encoding="utf-8")))
        except FileNotFoundError:
            with beside(there) as begun:
                begun.write_text(json.dumps(dict(identity), indent=1), encoding="utf-8")
            return
        except (ValueError, TypeError) as error:
            raise ValueError(
                f"{there} is damaged, so the sweep in {self.folder} is not known: give another --out"
            ) from error
        if known == dict(identity):
            return
        name = next((each for each in identity if known.get(each) != identity[each]), "scene")
        if name == "scene file":
            raise ValueError(f"the scene file has changed since the sweep in {self.folder} began: give another --out")
        was, now = known.get(name), identity.get(name)
        raise ValueError(f"the sweep in {self.folder} has {name} {was}, not {now}: give another --out")

    def settle(self) -> None:
        """Read which tasks are done and which have failed.

        Rows of failures are removed if the task has been done since or has another row.
        """
        self._settle(self.checked(self.broken))

    def _settle(self, found: Mapping[Path, Names]) -> None:
        self.done = _joined(names for path, names in found.items() if path.parent == self.path(TASKS))
        failures = {path: names for path, names in found.items() if path.parent == self.path(FAILURES)}
        names = np.concatenate([np.empty(0, "S16"), *failures.values()])
        stay = np.zeros(len(names), bool)
        stay[np.unique(names, return_index=True)[1]] = True
        stay &= ~among(names, self.done)
        for path, stays in zip(failures, np.split(stay, np.cumsum([len(each) for each in failures.values()]))):
            if not stays.all():
                rows = content(path).filter(arrow().array(stays))
                if len(rows):
                    self.keep(parts({FAILURES: rows}))
                path.unlink()
        with suppress(OSError):  # the folder is not empty, or does not exist
            self.path(FAILURES).rmdir()
        self.failed = _joined([names[stay]])

    def keep(self, tables: Mapping[str, bytes]) -> None:
        """Put a whole part in its place."""
        self.put(tables, self._begun)

    def keep_piece(self, tables: Mapping[str, bytes]) -> list[Path]:
        """Put a piece of a part in its place, and return the paths for `assemble`."""
        return [path for path in self._pieces.put(tables, self._begun) if path.parent != self._pieces.path(STEPS)]

    def is_done(self, piece: Path) -> bool:
        """Whether the tasks of a piece are done, as opposed to failed."""
        return piece.parent == self._pieces.path(TASKS)

    def assemble(self, sweep: Known, pieces: Sequence[Path]) -> None:
        """Make a part of pieces. Tasks that are in a part already are left out: a kill may leave their pieces."""
        rows: dict[str, Any] = {}
        for table, there in ((TASKS, [self.done]), (FAILURES, [self.done, self.failed])):
            found = [content(path) for path in pieces if path.parent == self._pieces.path(table)]
            if TASKS in rows:  # a task that had failed may have been done again
                there = [*there, np.sort(names_of(rows[TASKS].column(TASK)))]
            if found:
                names = names_of((whole := _sorted(sweep, found)).column(TASK))
                stay = ~np.logical_or.reduce([among(names, each) for each in there])
                if stay.any():
                    rows[table] = whole.filter(arrow().array(stay))
        steps = [*filter(None, (self._pieces.steps_of(path) for path in pieces))]
        if TASKS in rows and steps:
            whole = _sorted(sweep, [content(path) for path in steps])
            done = np.sort(names_of(rows[TASKS].column(TASK)))
            rows[STEPS] = whole.filter(arrow().array(among(names_of(whole.column(TASK)), done)))
        if rows:
            self.keep(parts(rows))
        for path in pieces:
            self._pieces.remove(path)

    def rows(self, table: str, columns: Sequence[str] | None = None) -> Iterator[Any]:
        """The Arrow table of each part of a table. Broken if a part differs from what was written."""
        return (content(path, columns) for path in self.files(table))

    def columns(self, table: str, sweep: Known, wanted: Sequence[str]) -> tuple[NDArray[np.intp], dict[str, Any]]:
        """The numbers of the tasks of a sweep that are in a table, in order, and their columns; nulls become 0."""
        numbers = [np.empty(0, np.intp)]
        chunks: dict[str, list[Any]] = {name: [] for name in wanted}
        known: dict[str, str] = {}
        for part in self.rows(table, [TASK, *wanted]):
            of = sweep.numbers(names_of(part.column(TASK)))
            numbers.append(of[of >= 0])
            for name, found in chunks.items():
                found.append(_array(part.column(name), known)[of >= 0])
        whole = np.concatenate(numbers)
        order = np.argsort(whole)
        return whole[order], {name: np.concatenate(found)[order] for name, found in chunks.items() if found}

    def rows_of(self, table: str, sweep: Known, numbers: Sequence[int], but: str = "") -> list[dict[str, Any]]:
        """The rows of some tasks of a sweep, in the order of `numbers`, without the column `but`."""
        wanted = np.sort(sweep.names[numbers])
        parts = (part.filter(arrow().array(among(names_of(part.column(TASK)), wanted))) for part in self.rows(table))
        parts = (part.drop_columns([but] if but else []) for part in parts)
        found = {row[TASK]: row for part in parts for row in part.to_pylist()}
        wanted_names = [text_of(sweep.names[number]) for number in numbers]
        return [found[name] for name in wanted_names if name in found]

    def close(self) -> None:
        """Release the folder for other sweeps."""
        with suppress(FileNotFoundError):
            os.unlink(self._begun)
        for folder in (*map(self._pieces.path, (TASKS, STEPS, FAILURES)), self._pieces.folder):
            with suppress(OSError):  # the folder is not empty, or does not exist
                folder.rmdir()
        self._lock.release()

    def __enter__(self) -> Store:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _array(column: Any, known: dict[str, str]) -> NDArray[Any]:
    """The values of an Arrow column. Equal texts share one object."""
    if arrow().types.is_string(column.type):
        return np.array([known.setdefault(text, text) for text in column.to_pylist()], object)
    return np.asarray(column.fill_null(0).to_numpy())


def _joined(names: Iterable[Names]) -> Names:
    return np.sort(np.concatenate([np.empty(0, "S16"), *names]))


def _sorted(sweep: Known, pieces: Sequence[Any]) -> Any:
    """The rows of some pieces in the order of the tasks. The rows of one task keep their order."""
    links = STEPS_PART, OF_TASKS
    heading = {name: value for name, value in pieces[0].schema.metadata.items() if name not in links}
    rows = arrow().concat_tables([piece.replace_schema_metadata(heading) for piece in pieces])
    return rows.take(np.argsort(sweep.numbers(names_of(rows.column(TASK))), kind="stable"))


def _locked(folder: Path) -> Any:
    """The acquired lock of the folder. It ends with this process at the latest. ValueError if another sweep has it."""
    try:
        from filelock import FileLock, Timeout
    except ImportError as error:
        raise ImportError(f"a sweep needs {hint('filelock')}") from error
    lock = FileLock(folder / ".lock", timeout=0, mode=0o666, thread_local=False)
    try:
        lock.acquire()
    except Timeout as error:
        raise ValueError(f"another sweep is running in {folder}") from error
    return lock
