"""The folder of a sweep: parts of many tasks each, so that what is there is done, and nothing is there twice.

`tasks.parquet`, `steps.parquet` and `failures.parquet` are folders, which readers take for one table each. A part is
named by the digest of its bytes and takes its place whole, when all of its tasks have come to something. Until then
they are in pieces, in the same three tables of the folder `.unfinished`. `sweep.json` says what all of them are of.
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
from overlapper.whole_file import beside

Names = NDArray[np.bytes_]  # of tasks, 16 bytes each

# Says in sweep.json that parts are named by their digests; earlier versions named them by their only task.
LAYOUT = {"parts": "named by digest"}


class Known(Protocol):
    """The tasks of a sweep, by their numbers."""

    names: Names

    def numbers(self, names: Names) -> NDArray[np.intp]:
        """The number of each task by its name; -1 for those of other sweeps."""
        ...


def names_of(column: Any) -> Names:
    """The names of tasks in an Arrow column. ValueError if they are none."""
    return np.frombuffer(bytes.fromhex("".join(column.to_pylist())), "S16")


def text_of(name: bytes) -> str:
    """The name of a task as it is in a table, 32 hexadecimal digits."""
    return bytes(name).ljust(16, b"\0").hex()  # NumPy leaves out zeros at the end


def among(names: Names, known: Names) -> NDArray[np.bool_]:
    """Which names are among known ones, which are sorted."""
    if not len(known):
        return np.zeros(len(names), bool)
    return np.equal(known[np.minimum(np.searchsorted(known, names), len(known) - 1)], names)


class Broken(ValueError):
    """A part is not as it was written; the text is a sentence with its path."""

    def __init__(self, path: Path, what: str = "is not as it was written") -> None:
        super().__init__(f"{path} {what}")
        self.path = path


def content(path: Path, columns: Sequence[str] | None = None) -> Any:
    """The Arrow table of a part, or those columns of it. Broken if it is not as it was written."""
    pyarrow = arrow()
    data = _must_be_whole(path)
    try:
        file = pyarrow.parquet.ParquetFile(pyarrow.BufferReader(data), page_checksum_verification=True)
        # Without threads: one that Arrow has just started may abort a process that ends.
        return file.read(columns=columns, use_threads=False)
    except (pyarrow.ArrowException, OSError) as error:
        raise Broken(path, f"cannot be read: {first_line(error)}") from error


def _must_be_whole(path: Path) -> bytes:
    """The bytes of a part."""
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
        """Where a table is, if it has any rows."""
        return self.folder / f"{table}.parquet"

    def files(self, table: str) -> list[Path]:
        """The parts of a table."""
        return sorted(self.path(table).glob("*.parquet"))

    def put(self, tables: Mapping[str, bytes], begun: str) -> list[Path]:
        """Put parts in their places, that of the tasks after that of their steps. They are written to `begun` first."""
        places = []
        for table in (STEPS, TASKS, FAILURES):
            if table in tables:
                self.path(table).mkdir(parents=True, exist_ok=True)
                places.append(self.path(table) / f"{digest(tables[table])}.parquet")
                _put(tables[table], begun, places[-1])
        return places

    def steps_of(self, part: Path, schema: Any = None) -> Path | None:
        """The part that has the steps of a part of tasks; `schema` is that of the part, if it has been read."""
        name = ((schema or arrow().parquet.read_schema(part)).metadata or {}).get(STEPS_PART)
        return self.path(STEPS) / f"{name.decode()}.parquet" if name else None

    def checked(self, broken: list[Path]) -> dict[Path, Names]:
        """The names of the tasks in each part of tasks and failures; parts that are not as they were written go away.

        So do tasks without their steps, and steps without their tasks, as a kill may leave them.
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
        """Take a part away, with its steps."""
        steps = self.steps_of(part)
        part.unlink()
        if steps:
            steps.unlink()


def _put(data: bytes, begun: str, place: Path) -> None:
    """It does not wait for the disk, which takes longer than many a task. A power cut, unlike a kill, may leave half of
    what is seconds old, and then it is done again.
    """
    # A file object would add four system calls.
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

    `identity` is what a sweep must have in common with one that is there already. `broken` names the parts that were
    not as they were written, and are gone. OSError if there can be no such folder, ValueError if it is that of another
    sweep, or if one is at work in it.
    """

    def __init__(self, folder: Path, identity: Mapping[str, str]) -> None:
        super().__init__(folder)
        folder.mkdir(parents=True, exist_ok=True)
        # Beside the tables, whose every file readers take for a part.
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
            raise ValueError(f"{there} does not say what is in {self.folder}: give another --out") from error
        if known == dict(identity):
            return
        name = next((each for each in identity if known.get(each) != identity[each]), "scene")
        if name == "scene file":
            raise ValueError(f"the scene file is not that of the sweep in {self.folder} any more: give another --out")
        was, now = known.get(name), identity.get(name)
        raise ValueError(f"the sweep in {self.folder} is of {name} {was}, not {now}: give another --out")

    def settle(self) -> None:
        """Read which tasks are done and which have failed. Rows of failures that were done since, or are there twice,
        are taken out of their parts."""
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
        with suppress(OSError):  # it is not empty, or not there
            self.path(FAILURES).rmdir()
        self.failed = _joined([names[stay]])

    def keep(self, tables: Mapping[str, bytes]) -> None:
        """Put a whole part in its place."""
        self.put(tables, self._begun)

    def keep_piece(self, tables: Mapping[str, bytes]) -> list[Path]:
        """Put a piece of a part in its place; returns the paths that `assemble` takes."""
        return [path for path in self._pieces.put(tables, self._begun) if path.parent != self._pieces.path(STEPS)]

    def is_done(self, piece: Path) -> bool:
        """Whether the tasks of a piece are done, and have not failed."""
        return piece.parent == self._pieces.path(TASKS)

    def assemble(self, sweep: Known, pieces: Sequence[Path]) -> None:
        """Make a part of pieces; of what is in a part already, as a kill came before its pieces were gone, nothing."""
        rows: dict[str, Any] = {}
        for table, there in ((TASKS, [self.done]), (FAILURES, [self.done, self.failed])):
            found = [content(path) for path in pieces if path.parent == self._pieces.path(table)]
            if TASKS in rows:  # what had failed may have been done again
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
        """The Arrow table of each part of a table. Broken if one is not as it was written."""
        return (content(path, columns) for path in self.files(table))

    def columns(self, table: str, sweep: Known, wanted: Sequence[str]) -> tuple[NDArray[np.intp], dict[str, Any]]:
        """The numbers of the tasks of a sweep that are in a table, in order, and columns of them; nulls are 0."""
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
        """The rows of some tasks of a sweep, in that order, without a column."""
        wanted = np.sort(sweep.names[numbers])
        parts = (part.filter(arrow().array(among(names_of(part.column(TASK)), wanted))) for part in self.rows(table))
        parts = (part.drop_columns([but] if but else []) for part in parts)
        found = {row[TASK]: row for part in parts for row in part.to_pylist()}
        wanted_names = [text_of(sweep.names[number]) for number in numbers]
        return [found[name] for name in wanted_names if name in found]

    def close(self) -> None:
        """Let another sweep at it."""
        with suppress(FileNotFoundError):
            os.unlink(self._begun)
        for folder in (*map(self._pieces.path, (TASKS, STEPS, FAILURES)), self._pieces.folder):
            with suppress(OSError):  # it is not empty, or not there
                folder.rmdir()
        self._lock.release()

    def __enter__(self) -> Store:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _array(column: Any, known: dict[str, str]) -> NDArray[Any]:
    """The values of an Arrow column; of equal texts there is one."""
    if arrow().types.is_string(column.type):
        return np.array([known.setdefault(text, text) for text in column.to_pylist()], object)
    return np.asarray(column.fill_null(0).to_numpy())


def _joined(names: Iterable[Names]) -> Names:
    return np.sort(np.concatenate([np.empty(0, "S16"), *names]))


def _sorted(sweep: Known, pieces: Sequence[Any]) -> Any:
    """The rows of some pieces in the order of the tasks, those of a task as they are."""
    links = STEPS_PART, OF_TASKS
    heading = {name: value for name, value in pieces[0].schema.metadata.items() if name not in links}
    rows = arrow().concat_tables([piece.replace_schema_metadata(heading) for piece in pieces])
    return rows.take(np.argsort(sweep.numbers(names_of(rows.column(TASK))), kind="stable"))


def _locked(folder: Path) -> Any:
    """The lock of the folder, acquired. It ends with this process at the latest. ValueError if another sweep has it."""
    try:
        from filelock import FileLock, Timeout
    except ImportError as error:
        raise ImportError(f"a sweep needs {hint('filelock')}") from error
    lock = FileLock(folder / ".lock", timeout=0, mode=0o666, thread_local=False)
    try:
        lock.acquire()
    except Timeout as error:
        raise ValueError(f"another sweep is at work in {folder}") from error
    return lock
