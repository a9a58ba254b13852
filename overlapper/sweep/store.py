"""The folder of a sweep: a part for each task, so that what is there is done, and nothing is there twice.

`tasks.parquet`, `steps.parquet` and `failures.parquet` are folders, which readers take for one table each. A part is
named by its task and takes its place whole. `sweep.json` says what all of them are of.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from overlapper.install import hint
from overlapper.sweep.part import FAILURES, STEPS, TASKS, arrow
from overlapper.whole_file import beside

TABLES = (TASKS, STEPS, FAILURES)

MAGIC = b"PAR1"  # with which a Parquet file begins and ends


class Store:
    """The parts in a folder, for one sweep at a time.

    `identity` is what a sweep must have in common with one that is there already. OSError if there can be no such
    folder, ValueError if it is that of another sweep, or if one is at work in it.
    """

    def __init__(self, folder: Path, identity: Mapping[str, str]) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        # Beside the tables, whose every file readers take for a part.
        self._begun = f"{folder}/.begun.parquet"
        self._there: set[str] = set()  # tables whose folders were made
        self._lock = _locked(folder)
        try:
            self._belong(identity)
            self.done, self.failed = (self._names(table) for table in (TASKS, FAILURES))
            if self.path(STEPS).is_dir():
                self.done &= self._names(STEPS)
            for task in self.done & self.failed:  # a kill came between the two
                self._recovered(task)
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

    def path(self, table: str) -> Path:
        """Where a table is, if it has any rows."""
        return self.folder / f"{table}.parquet"

    def _names(self, table: str) -> set[str]:
        return {part.stem for part in self.path(table).glob("*.parquet") if _whole(part)}

    def keep(self, task: str, parts: Mapping[str, bytes]) -> None:
        """Put the parts of a task in their places; it is done when the last one is in its own, and failed no more."""
        for table in sorted(parts, key=TABLES.index, reverse=True):
            if table not in self._there:
                self.path(table).mkdir(exist_ok=True)
                self._there.add(table)
            self._put(parts[table], f"{self.folder}/{table}.parquet/{task}.parquet")
        if TASKS in parts:
            self.done.add(task)
            if task in self.failed:
                self._recovered(task)
        else:
            self.failed.add(task)

    def _recovered(self, task: str) -> None:
        (self.path(FAILURES) / f"{task}.parquet").unlink()
        self.failed.discard(task)
        if not self.failed:
            with suppress(OSError):  # if somebody has put something else there
                self.path(FAILURES).rmdir()
            self._there.discard(FAILURES)

    def _put(self, data: bytes, place: str) -> None:
        """It does not wait for the disk, which takes longer than many a task. A power cut, unlike a kill, may leave
        half of what is seconds old, and then it is done again.
        """
        # A file object would add four system calls.
        file = os.open(self._begun, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
        try:
            unwritten = memoryview(data)
            while unwritten:
                unwritten = unwritten[os.write(file, unwritten) :]
        finally:
            os.close(file)
        os.replace(self._begun, place)

    def rows(self, table: str) -> list[dict[str, Any]]:
        """All rows of a table, by the names of their tasks; none if there is no such table."""
        return rows_in(self.folder, table)

    def close(self) -> None:
        """Let another sweep at it."""
        with suppress(FileNotFoundError):
            os.unlink(self._begun)
        self._lock.release()

    def __enter__(self) -> Store:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


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


def rows_in(folder: Path, table: str) -> list[dict[str, Any]]:
    """All rows of a table in the folder of a sweep, by the names of their tasks; none if there is no such table."""
    place = folder / f"{table}.parquet"
    if not place.is_dir():
        return []
    rows = arrow().parquet.read_table(place).to_pylist()
    return sorted(rows, key=lambda row: str(row["task"]))


def _whole(part: Path) -> bool:
    """Whether a part has its end; one that has not is taken away."""
    with part.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(size - len(MAGIC), 0))
        if size > 2 * len(MAGIC) and file.read() == MAGIC:
            return True
    part.unlink()
    return False
