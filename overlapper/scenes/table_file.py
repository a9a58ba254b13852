"""Tables in files: CSV, Parquet and SQLite, written step by step, and readable however the run ends.

Every file says in its metadata what wrote it and with which settings; the units are in the names of the columns.
"""

from __future__ import annotations

import csv
import itertools
import os
import re
import shutil
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Protocol

from overlapper import __version__
from overlapper.scenes.table import COLUMNS, Row, Value

__all__ = ["TABLES", "CsvTable", "ParquetTable", "SqliteTable", "Table", "read_csv", "read_metadata", "read_table"]


def origin() -> dict[str, str]:
    """What wrote a table: the versions of this package and, if it is there, of pybullet."""
    try:
        simulator = {"pybullet": version("pybullet")}
    except PackageNotFoundError:
        simulator = {}
    return {"overlapper": __version__, **simulator}


class Table(Protocol):
    """A file that grows by the rows of a step at a time; those of finished steps outlive even a SIGKILL."""

    def write(self, rows: Iterable[Row]) -> None: ...
    def close(self) -> None: ...


class CsvTable:
    """Comma-separated values below lines of metadata that begin with #; a step is handed to the system at once."""

    def __init__(
        self, path: Path, metadata: Mapping[str, str] | None = None, columns: Sequence[str] = tuple(COLUMNS)
    ) -> None:
        self._columns = columns
        # Written in one call a step, so that a kill has no half-filled buffer to lose.
        self._file = path.open("wb", buffering=0)
        heading = [f"# {name}: {value}" for name, value in (metadata or {}).items()]
        self._write([*heading, ",".join(columns)])

    def write(self, rows: Iterable[Row]) -> None:
        self._write(",".join(_cell(row.get(column)) for column in self._columns) for row in rows)

    def comment(self, text: str) -> None:
        """A line that readers of the rows pass over."""
        self._write([f"# {text}"])

    def _write(self, lines: Iterable[str]) -> None:
        unwritten = memoryview("".join(f"{line}\n" for line in lines).encode())
        while unwritten:
            unwritten = unwritten[self._file.write(unwritten) :]

    def close(self) -> None:
        self._file.close()


def _cell(value: Value) -> str:
    """As the csv module has it, but text with a # is quoted, too: some readers take the rest for a comment."""
    if not isinstance(value, str):
        return "" if value is None else repr(value)
    return '"' + value.replace('"', '""') + '"' if re.search(r'[#,"\r\n]', value) else value


def read_csv(path: Path) -> list[Row]:
    """The rows of a CSV table; empty cells are None. A last line without an end, which a kill may leave, is left out.

    ValueError if the file is no such table.
    """
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(line for line in file if line.endswith("\n") and not line.startswith("#"))
        strangers = set(reader.fieldnames or ()) - COLUMNS.keys()
        if strangers or not reader.fieldnames:
            what = f"a column {min(map(str, strangers))!r}" if strangers else "no columns"
            raise ValueError(f"{path} is not a table of overlaps: it has {what}")
        try:
            return [{name: COLUMNS[name](cell) if cell else None for name, cell in row.items()} for row in reader]
        except (KeyError, ValueError) as error:
            raise ValueError(f"{path} cannot be read at line {reader.line_num} below its heading: {error}") from error


class ParquetTable:
    """Parquet by pyarrow.

    A Parquet file cannot be read before its end is written. So a run writes whole files into the folder
    `<path>.parts`, which readers take for one table, and `close` makes the one file of them. A killed run leaves the
    folder.
    """

    PART = 4_000  # rows, above which the next file is begun: the last one is written anew every step, in milliseconds
    GROUP = 20_000  # rows; a row group of a few megabytes, as Parquet's readers expect

    def __init__(self, path: Path, metadata: Mapping[str, str] | None = None) -> None:
        try:
            import pyarrow
            import pyarrow.parquet
        except ImportError as error:
            raise ImportError("a .parquet table needs pyarrow: pip install 'overlapper[cli]'") from error
        self._arrow: Any = pyarrow
        kinds = {int: pyarrow.int32(), float: pyarrow.float64(), str: pyarrow.string()}
        self._schema = pyarrow.schema([(name, kinds[kind]) for name, kind in COLUMNS.items()], metadata)
        self._path = path
        self._parts = path.with_name(f"{path.name}.parts")
        self._unfinished = path.with_name(f"{path.name}.unfinished")
        # What an earlier run has left must not pass for this one's.
        path.unlink(missing_ok=True)
        shutil.rmtree(self._parts, ignore_errors=True)
        self._parts.mkdir()
        self._count = 0
        self._last = self._schema.empty_table()
        self._replace_last()

    def write(self, rows: Iterable[Row]) -> None:
        step = self._arrow.Table.from_pylist(list(rows), schema=self._schema)
        if not len(step):
            return
        if len(self._last) >= self.PART:
            self._count, self._last = self._count + 1, self._schema.empty_table()
        self._last = self._arrow.concat_tables([self._last, step])
        self._replace_last()

    def _replace_last(self) -> None:
        self._arrow.parquet.write_table(self._last, self._unfinished)
        os.replace(self._unfinished, self._parts / f"{self._count:06}.parquet")

    def close(self) -> None:
        with self._arrow.parquet.ParquetWriter(self._unfinished, self._schema) as writer:
            for group in self._groups():
                writer.write_table(group)
        os.replace(self._unfinished, self._path)
        shutil.rmtree(self._parts)

    def _groups(self) -> Iterator[Any]:
        group = self._schema.empty_table()
        for part in sorted(self._parts.iterdir()):
            group = self._arrow.concat_tables([group, self._arrow.parquet.read_table(part, schema=self._schema)])
            if len(group) >= self.GROUP:
                yield group
                group = self._schema.empty_table()
        yield group


class SqliteTable:
    """SQLite: the rows are in the table `overlaps`, the metadata in `metadata`; a step is a transaction.

    While the run goes on, and after a kill, the last steps are in `<path>-wal`, where every reader looks for them.
    """

    def __init__(self, path: Path, metadata: Mapping[str, str] | None = None) -> None:
        for leftover in (path, *(path.with_name(path.name + ending) for ending in ("-wal", "-shm"))):
            leftover.unlink(missing_ok=True)
        path.touch()  # refused by the system, with a reason, or not at all
        self._connection = sqlite3.connect(path)
        self._connection.execute("PRAGMA journal_mode = WAL")
        # With a log, this loses no transaction to a kill and corrupts nothing in a power cut, and waits for no disk.
        self._connection.execute("PRAGMA synchronous = NORMAL")
        kinds = {int: "INTEGER", float: "REAL", str: "TEXT"}
        columns = ", ".join(f"{name} {kinds[kind]}" for name, kind in COLUMNS.items())
        with self._connection:
            self._connection.execute(f"CREATE TABLE overlaps ({columns})")
            self._connection.execute("CREATE TABLE metadata (name TEXT PRIMARY KEY, value TEXT)")
            self._connection.executemany("INSERT INTO metadata VALUES (?, ?)", (metadata or {}).items())

    def write(self, rows: Iterable[Row]) -> None:
        blanks = ", ".join("?" * len(COLUMNS))
        with self._connection:
            self._connection.executemany(
                f"INSERT INTO overlaps VALUES ({blanks})", ([row.get(name) for name in COLUMNS] for row in rows)
            )

    def close(self) -> None:
        self._connection.close()


# The kinds of table, by the ending of the file's name.
TABLES: dict[str, Callable[[Path, Mapping[str, str] | None], Table]] = {
    ".csv": CsvTable,
    ".parquet": ParquetTable,
    ".sqlite": SqliteTable,
}


def read_metadata(path: Path) -> dict[str, str]:
    """What a table says of itself, by name: what wrote it and with which settings."""
    if path.suffix in (".parquet", ".parts"):
        import pyarrow.parquet

        schema = pyarrow.parquet.ParquetDataset(path).schema
        return {name.decode(): value.decode() for name, value in (schema.metadata or {}).items()}
    if path.suffix == ".sqlite":
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=rw", uri=True)) as connection:
            return dict(connection.execute("SELECT name, value FROM metadata"))
    with path.open(encoding="utf-8") as file:
        heading = itertools.takewhile(lambda line: line.startswith("# "), file)
        return {name: value.strip() for name, colon, value in (line[2:].partition(": ") for line in heading) if colon}


def read_table(path: Path) -> list[Row]:
    """The rows of a table of any kind, finished or not. ValueError if the file is none."""
    if path.suffix in (".parquet", ".parts"):
        import pyarrow.parquet

        rows: list[Row] = pyarrow.parquet.read_table(path).to_pylist()
        return rows
    if path.suffix == ".sqlite":
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=rw", uri=True)) as connection:
            connection.row_factory = sqlite3.Row
            return [dict(row) for row in connection.execute("SELECT * FROM overlaps ORDER BY rowid")]
    return read_csv(path)
