"""Tables in files: CSV, Parquet and SQLite, written step by step, and readable however the run ends.

Every file says in its metadata what wrote it and with which settings; the units are in the names of the columns. A
table grows beside its place (`overlapper.whole_file`) and takes it when it is closed. What a killed run has finished is
in `run.unfinished.csv`, and is a table of its own.
"""

from __future__ import annotations

import csv
import errno
import hashlib
import itertools
import os
import re
import shutil
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Protocol

from overlapper import __version__
from overlapper.install import hint
from overlapper.printable import first_line, printable
from overlapper.tables.table import COLUMNS, FORCES, POSE, Row, Value
from overlapper.whole_file import claim, settle

KNOWN = COLUMNS | FORCES

# The columns without which a table says nothing of pairs.
NEEDED = ["step", "status"]
NEEDED += [f"{word}{side}" for side in "AB" for word in ("body", "link", "shape")]
NEEDED += [part.format(side) for side in "AB" for part in POSE]

# Rows of a Parquet file for each of its bytes, beyond which its count of rows is not believed: a small file must not
# make a reader ask for the memory of millions of rows. Tables of scenes have 0.006 of them, and one of a million rows
# that are all the same and have nothing but a step has 3.8.
DENSEST = 4


def origin() -> dict[str, str]:
    """The programs that wrote a table: the versions of this package and, if it is there, of pybullet."""
    try:
        simulator = {"pybullet": version("pybullet")}
    except PackageNotFoundError:
        simulator = {}
    return {"overlapper": __version__, **simulator}


@dataclass(frozen=True, slots=True)
class Content:
    """The content of a table: its metadata by name, its rows, and the comments of a CSV file.

    A comment is the text of a line behind its #, with the number of rows above that line.
    """

    metadata: dict[str, str]
    rows: list[Row] = field(default_factory=list)
    comments: list[tuple[int, str]] = field(default_factory=list)


class Table(Protocol):
    """A file that grows by the rows of a step at a time; those of finished steps outlive even a SIGKILL.

    One of `close` and `leave` ends it. `close` puts it in its place. `leave` does not, and returns where the rows are;
    None if there are none, and then nothing is left of it.
    """

    def write(self, rows: Iterable[Row]) -> None: ...
    def close(self) -> None: ...
    def leave(self) -> Path | None: ...


class CsvTable:
    """Comma-separated values below lines of metadata that begin with #; a step is handed to the system at once.

    The last line of the heading has the number of rows and a digest of all that is below it, once the table is closed.
    """

    def __init__(
        self, path: Path, metadata: Mapping[str, str] | None = None, columns: Iterable[str] = tuple(COLUMNS)
    ) -> None:
        self._columns, self._place = list(columns), path
        self._path = claim(path)
        self._empty = True
        try:
            # Written in one call a step, so that a kill has no half-filled buffer to lose.
            self._file = self._path.open("r+b", buffering=0)
        except BaseException:
            self._path.unlink()
            raise
        try:
            self._write(f"# {name}: {printable(value)}" for name, value in (metadata or {}).items())
            self._seal = self._file.tell()
            self._write([_seal()])
            self._body = self._file.tell()
            self._write([",".join(self._columns)])
        except BaseException:
            self.leave()
            raise

    def write(self, rows: Iterable[Row]) -> None:
        lines = [",".join(_cell(row.get(column)) for column in self._columns) for row in rows]
        self._empty = self._empty and not lines
        self._write(lines)

    def comment(self, text: str) -> None:
        """A line that readers of the rows pass over."""
        self._write([f"# {text}"])

    def _write(self, lines: Iterable[str]) -> None:
        unwritten = memoryview("".join(f"{line}\n" for line in lines).encode())
        while unwritten:
            unwritten = unwritten[self._file.write(unwritten) :]

    def close(self) -> None:
        try:
            self._file.seek(self._body)
            body = self._file.read()
            # The last line has no end if a signal came in the middle of it.
            body = body[: body.rfind(b"\n") + 1]
            self._file.truncate(self._body + len(body))
            self._file.seek(self._seal)
            self._write([_seal(body)])
            self._file.close()
            settle(self._path, self._place)
        except BaseException:
            self.leave()
            raise

    def leave(self) -> Path | None:
        self._file.close()
        if self._empty:
            self._path.unlink(missing_ok=True)
        return None if self._empty else self._path


def _seal(body: bytes | None = None) -> str:
    """The line that tells whether all below it is there; of the same length before that is known."""
    told = "unfinished" if body is None else f"{_count(body):,}, sha256 {hashlib.sha256(body).hexdigest()}"
    return f"# rows: {told:>84}"


def _count(body: bytes) -> int:
    """The rows below the line with the names of columns; none of their cells has a line break."""
    return max(sum(not line.startswith(b"#") for line in body.splitlines()) - 1, 0)


def _cell(value: Value) -> str:
    """As the csv module has it, but text with a # is quoted, too: some readers take the rest for a comment."""
    if not isinstance(value, str):
        return "" if value is None else repr(value)
    value = printable(value)
    return '"' + value.replace('"', '""') + '"' if re.search(r'[#,"]', value) else value


def _csv_text(path: Path) -> str:
    """The text of a CSV table, which is whole: a last line without an end, which a kill may leave, is left out.

    ValueError if rows are missing, or are not as they were written; a table without a line `# rows` is taken as it is.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path} is not a table of overlaps: it is no text ({first_line(error)})") from error
    seal = re.search(r"^# rows: +([\d,]+), sha256 ([0-9a-f]{64})$", text, re.MULTILINE)
    if seal is None:
        return text[: text.rfind("\n") + 1]
    body = text[seal.end() + 1 :].encode()
    if hashlib.sha256(body).hexdigest() != seal[2]:
        rows, there = int(seal[1].replace(",", "")), _count(body)
        what = f"{there:,} of its {rows:,} rows are there" if there != rows else "a line of it is another"
        raise ValueError(
            f"{path} is not as it was written: {what} (if that is as it should be, take out its line `# rows`)"
        )
    return text


def _csv_content(path: Path) -> Content:
    """A CSV table; empty cells are None."""
    lines = _csv_text(path).splitlines(keepends=True)
    content = Content(_heading(lines))

    def uncommented() -> Iterator[str]:
        for line in lines:
            if line.startswith("#"):
                content.comments.append((len(content.rows), line[1:].strip()))
            else:
                yield line

    reader = csv.reader(uncommented())
    try:
        columns = next(reader, [])
        _check_columns(path, columns)
        for cells in filter(None, reader):
            content.rows.append(_row(columns, cells))
    except (ValueError, csv.Error) as error:
        if str(error).startswith(str(path)):
            raise
        where = f"{path} cannot be read at line {reader.line_num} below its heading"
        raise ValueError(f"{where}: {first_line(error)}") from error
    return content


def _heading(lines: Iterable[str]) -> dict[str, str]:
    """The metadata in the first lines of a CSV table, by name."""
    heading = itertools.takewhile(lambda line: line.startswith("# "), lines)
    return {name: value.strip() for name, colon, value in (line[2:].partition(": ") for line in heading) if colon}


def _row(columns: Sequence[str], cells: Sequence[str]) -> Row:
    if len(cells) != len(columns):
        raise ValueError(f"it has {len(cells)} cells and not {len(columns)}")
    return _checked({name: KNOWN[name](cell) if cell else None for name, cell in zip(columns, cells)})


def _check_columns(path: Path, columns: Sequence[str]) -> None:
    strangers, lacking = set(columns) - KNOWN.keys(), [name for name in NEEDED if name not in columns]
    if not columns:
        raise ValueError(f"{path} is not a table of overlaps: it has no columns")
    if strangers or lacking or len(set(columns)) < len(columns):
        words = f"a column {min(strangers)!r}" if strangers else f"no column {lacking[0]!r}" if lacking else "one twice"
        raise ValueError(f"{path} is not a table of overlaps: it has {words}")


def _checked(row: Row) -> Row:
    """The row, if its values are of the columns' types."""
    for name, value in row.items():
        kind = KNOWN[name]
        if kind is float and type(value) is int:
            row[name] = float(value)
        elif value is not None and type(value) is not kind:
            raise ValueError(f"{name} is {value!r:.40}, which is no {kind.__name__}")
        elif kind is int and value is not None and not -(2**63) <= int(value) < 2**63:
            raise ValueError(f"{name} is beyond 64 bits")
    if row["step"] is None:
        raise ValueError("a row is of no step")
    return row


class ParquetTable:
    """Parquet by pyarrow.

    A Parquet file cannot be read before its end is written. So a run writes whole files into the folder
    `run.unfinished.parquet`, which readers take for one table, and `close` makes the one file of them.
    """

    PART = 4_000  # rows, above which the next file is begun: the last one is written anew every step, in milliseconds
    GROUP = 20_000  # rows; a row group of a few megabytes, as Parquet's readers expect

    def __init__(
        self, path: Path, metadata: Mapping[str, str] | None = None, columns: Mapping[str, type] = COLUMNS
    ) -> None:
        self._arrow: Any = _arrow()
        pyarrow = self._arrow
        kinds = {int: pyarrow.int32(), float: pyarrow.float64(), str: pyarrow.string()}
        self._schema = pyarrow.schema([(name, kinds[kind]) for name, kind in columns.items()], metadata)
        self._place, self._empty = path, True
        self._folder = claim(path, folder=True)
        # Beside the folder, whose every file some readers take for a part of the table: a kill may leave half of one.
        self._begun = self._folder.with_name(f".{self._folder.name}")
        self._count = 0
        self._last = self._schema.empty_table()
        try:
            self._replace_last()
        except BaseException:
            self.leave()
            raise

    def write(self, rows: Iterable[Row]) -> None:
        step = self._arrow.Table.from_pylist(list(rows), schema=self._schema)
        if not len(step):
            return
        if len(self._last) >= self.PART:
            self._count, self._last = self._count + 1, self._schema.empty_table()
        self._last = self._arrow.concat_tables([self._last, step])
        self._replace_last()
        self._empty = False

    def _replace_last(self) -> None:
        with _named(self._place, self._arrow.lib.ArrowException):
            self._arrow.parquet.write_table(self._last, self._begun, write_page_checksum=True)
        os.replace(self._begun, self._folder / f"{self._count:06}.parquet")

    def close(self) -> None:
        try:
            with (
                _named(self._place, self._arrow.lib.ArrowException),
                self._arrow.parquet.ParquetWriter(self._begun, self._schema, write_page_checksum=True) as writer,
            ):
                for group in self._groups():
                    writer.write_table(group)
            settle(self._begun, self._place)
        except BaseException:
            self._begun.unlink(missing_ok=True)
            self.leave()
            raise
        shutil.rmtree(self._folder, ignore_errors=True)  # all of it is in the table

    def leave(self) -> Path | None:
        self._begun.unlink(missing_ok=True)
        if self._empty:
            shutil.rmtree(self._folder)
        return None if self._empty else self._folder

    def _groups(self) -> Iterator[Any]:
        group = self._schema.empty_table()
        for part in sorted(self._folder.glob("[0-9]*.parquet")):
            group = self._arrow.concat_tables([group, self._arrow.parquet.read_table(part, schema=self._schema)])
            if len(group) >= self.GROUP:
                yield group
                group = self._schema.empty_table()
        yield group


@contextmanager
def _named(path: Path, *kinds: type[Exception]) -> Iterator[None]:
    """Turn a library's error about a file that it cannot write into an OSError with the file's name and a reason."""
    try:
        yield
    except OSError as error:
        if error.strerror and error.filename:
            raise
        raise OSError(error.errno or errno.EIO, error.strerror or first_line(error), str(path)) from error
    except kinds as error:
        raise OSError(errno.EIO, first_line(error), str(path)) from error


class SqliteTable:
    """SQLite: the rows are in the table `overlaps`, the metadata in `metadata`; a step is a transaction.

    While the run goes on, and after a kill, the last steps are in `run.unfinished.sqlite-wal`, where every reader looks
    for them.
    """

    def __init__(
        self, path: Path, metadata: Mapping[str, str] | None = None, columns: Mapping[str, type] = COLUMNS
    ) -> None:
        self._columns = list(columns)
        self._place, self._empty = path, True
        self._path = claim(path)
        # Whoever writes takes care that no two threads do so at once.
        self._connection = sqlite3.connect(self._path, check_same_thread=False)
        kinds = {int: "INTEGER", float: "REAL", str: "TEXT"}
        declared = ", ".join(f"{name} {kinds[kind]}" for name, kind in columns.items())
        try:
            with _named(path, sqlite3.Error), self._connection:
                self._connection.execute("PRAGMA journal_mode = WAL")
                # With a log, this loses no transaction to a kill and corrupts nothing in a power cut, and waits for no
                # disk.
                self._connection.execute("PRAGMA synchronous = NORMAL")
                self._connection.execute(f"CREATE TABLE overlaps ({declared})")
                self._connection.execute("CREATE TABLE metadata (name TEXT PRIMARY KEY, value TEXT)")
                self._connection.executemany("INSERT INTO metadata VALUES (?, ?)", (metadata or {}).items())
        except BaseException:
            self.leave()
            raise

    def write(self, rows: Iterable[Row]) -> None:
        blanks = ", ".join("?" * len(self._columns))
        cells = [[row.get(name) for name in self._columns] for row in rows]
        with _named(self._place, sqlite3.Error), self._connection:
            self._connection.executemany(f"INSERT INTO overlaps VALUES ({blanks})", cells)
        self._empty = self._empty and not cells

    def close(self) -> None:
        try:
            with _named(self._place, sqlite3.Error):
                with self._connection:
                    self._connection.execute("INSERT INTO metadata SELECT 'rows', count(*) FROM overlaps")
                self._connection.execute("PRAGMA journal_mode = DELETE")
                self._connection.close()
            # A log that an earlier database has left would be taken for one of the new.
            for ending in ("-wal", "-shm", "-journal"):
                self._place.with_name(self._place.name + ending).unlink(missing_ok=True)
            settle(self._path, self._place)
        except BaseException:
            self.leave()
            raise

    def leave(self) -> Path | None:
        with suppress(sqlite3.Error):
            self._connection.close()
        if self._empty:
            for ending in ("", "-wal", "-shm", "-journal"):
                self._path.with_name(self._path.name + ending).unlink(missing_ok=True)
        return None if self._empty else self._path


# The kinds of table, by the ending of the file's name: of a path, of metadata, and of columns by name with their types.
TABLES: dict[str, Callable[..., Table]] = {
    ".csv": CsvTable,
    ".parquet": ParquetTable,
    ".sqlite": SqliteTable,
}


def must_be_a_table(path: Path) -> None:
    """ValueError if the name is not that of a table, ImportError without the library that writes it."""
    if path.suffix not in TABLES:
        raise ValueError(f"the name of a table must end in {', '.join(TABLES)}, not {path.name!r}")
    if path.suffix == ".parquet":
        _arrow()


def _arrow() -> Any:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise ImportError(f"a .parquet table needs {hint('pyarrow')}") from error
    return pyarrow


def read_metadata(path: Path) -> dict[str, str]:
    """The metadata of a table: the versions and the settings that wrote it, by name. ValueError if it is no table."""
    if path.suffix == ".parquet":
        with _opened_parquet(path) as dataset:
            found = (dataset.schema.metadata or {}).items()
            return {name.decode(errors="replace"): value.decode(errors="replace") for name, value in found}
    if path.suffix == ".sqlite":
        with _opened_sqlite(path) as connection:
            return {str(name): str(value) for name, value in connection.execute("SELECT name, value FROM metadata")}
    return _heading(_csv_text(path).splitlines())


def read_table(path: Path) -> list[Row]:
    """The rows of a table of any kind, finished or not. OSError if there is no file, ValueError if it is no table."""
    if path.suffix == ".parquet":
        with _opened_parquet(path) as dataset:
            _check_columns(path, dataset.schema.names)
            return [_checked(row) for row in dataset.read().to_pylist()]
    if path.suffix == ".sqlite":
        with _opened_sqlite(path) as connection:
            cursor = connection.execute("SELECT * FROM overlaps ORDER BY rowid")
            columns = [description[0] for description in cursor.description]
            _check_columns(path, columns)
            rows = [_checked(dict(zip(columns, cells))) for cells in cursor]
            said = dict(connection.execute("SELECT name, value FROM metadata")).get("rows")
            if said is not None and str(said) != str(len(rows)):
                raise ValueError(f"{path} is not as it was written: {len(rows):,} of its {said!s:.20} rows are there")
            return rows
    return _csv_content(path).rows


def read_content(path: Path) -> Content:
    """A table of any kind, finished or not, with all that is in it. Raises as `read_table` does."""
    return _csv_content(path) if path.suffix == ".csv" else Content(read_metadata(path), read_table(path))


@contextmanager
def _opened_parquet(path: Path) -> Iterator[Any]:
    pyarrow = _arrow()
    path.stat()  # OSError, with its name, if it is not there
    try:
        dataset = pyarrow.parquet.ParquetDataset(path, page_checksum_verification=True)
        for file in dataset.files:
            count, size = pyarrow.parquet.read_metadata(file).num_rows, os.path.getsize(file)
            if count > DENSEST * size:
                raise ValueError(f"it claims {count:,} rows in {size:,} bytes")
        yield dataset
    except (pyarrow.lib.ArrowException, OSError, ValueError, KeyError, RuntimeError) as error:
        raise _no_table(path, error) from error


@contextmanager
def _opened_sqlite(path: Path) -> Iterator[sqlite3.Connection]:
    path.open("rb").close()  # SQLite would say that it cannot be opened, whatever the cause
    try:
        # Read and write, as the log of a killed run is worked into it.
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=rw", uri=True)) as connection:
            connection.execute("PRAGMA trusted_schema = OFF")
            # A tree of pages that meet again has rows without end; a view may be of anything.
            (sound,) = connection.execute("PRAGMA quick_check(1)").fetchone()
            (page,) = connection.execute("PRAGMA page_size").fetchone()
            if sound != "ok" or path.stat().st_size % page:
                raise ValueError(sound if sound != "ok" else "the last page of the database was cut")
            kinds = dict(connection.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table'"))
            for name in ("overlaps", "metadata"):
                if not re.match(r"(?i)create\s+table\b", kinds.get(name) or ""):
                    raise ValueError(f"it has no table {name!r}")
            yield connection
    except (sqlite3.Error, ValueError, OverflowError) as error:
        raise _no_table(path, error) from error


def _no_table(path: Path, error: Exception) -> ValueError:
    said = first_line(error)
    return ValueError(said if said.startswith(str(path)) else f"{path} is not a table of overlaps: {said}")
