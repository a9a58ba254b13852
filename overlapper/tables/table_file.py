"""Tables in files: CSV, Parquet and SQLite, written step by step, and readable however the run ends.

The metadata of every file says what wrote the file and with which settings. The units are in the names of the columns.
A table grows beside its place (`overlapper.whole_file`) and moves to its place when it is closed. The finished steps of
a killed run are in `run.unfinished.csv`, which is a table of its own. For a Parquet file, this is a CSV file, too.
"""

from __future__ import annotations

import csv
import errno
import hashlib
import itertools
import math
import os
import re
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
from overlapper.simulation.engine import LIBRARIES
from overlapper.tables.table import COLUMNS, FORCES, IMPACTS, MUJOCO, POSE, Row, Value
from overlapper.whole_file import beside, claim, settle

KNOWN = COLUMNS | MUJOCO | FORCES | IMPACTS

LEFT_OUT = "left out "  # how the name of metadata begins that says what was not modelled

# The columns without which a table says nothing of pairs.
NEEDED = ["step", "status"]
NEEDED += [f"{word}{side}" for side in "AB" for word in ("body", "link", "shape")]
NEEDED += [part.format(side) for side in "AB" for part in POSE]

# Rows of a Parquet file for each of its bytes, beyond which its count of rows is not believed: a small file must not
# make a reader ask for the memory of millions of rows. Tables of scenes have 0.006 of them, and one of a million rows
# that are all the same and have nothing but a step has 3.8.
DENSEST = 4


def origin(engine: str = "") -> dict[str, str]:
    """Return the versions of this package and, if it is installed, of the library of the engine that simulated."""
    found = {"overlapper": __version__}
    if engine in LIBRARIES:
        with suppress(PackageNotFoundError):
            found[LIBRARIES[engine]] = version(LIBRARIES[engine])
    return found


@dataclass(frozen=True, slots=True)
class Content:
    """The content of a table: its metadata by name, its rows, and the comments of a CSV file.

    A comment is the text of a line after its #, with the number of rows above that line.
    """

    metadata: dict[str, str]
    rows: list[Row] = field(default_factory=list)
    comments: list[tuple[int, str]] = field(default_factory=list)


class Table(Protocol):
    """A file that grows by the rows of one step at a time. Rows of finished steps survive even a SIGKILL.

    `write` adds the rows of a step. `remark` adds metadata that became known only during the run. Call one of `close`
    and `leave` at the end. `close` puts the table in its place. `leave` does not, and returns the path of the rows. If
    there are no rows, `leave` returns None and leaves no file. Until then, the rows are in the file `growing`.
    """

    growing: Path

    def write(self, rows: Iterable[Row]) -> None: ...
    def remark(self, name: str, value: str) -> None: ...
    def close(self) -> None: ...
    def leave(self) -> Path | None: ...


class Seal:
    """The number of rows of a table, and the number of bytes and a digest of its lines as CSV."""

    def __init__(self, text: bytes = b"", rows: int = 0, before: Seal | None = None) -> None:
        self.rows, self.size = rows, len(text)
        self._digest: Any = before._digest.copy() if before else hashlib.sha256()
        self._digest.update(text)
        if before:
            self.rows, self.size = self.rows + before.rows, self.size + before.size

    @classmethod
    def of(cls, columns: Sequence[str], rows: Iterable[Iterable[Value]] = ()) -> Seal:
        """Return the seal of a whole table, of rows in the order of the columns."""
        seal = cls(_text([",".join(columns)]))
        for row in rows:
            seal = seal.further(_text([_line(row)]), 1)
        return seal

    def further(self, text: bytes, rows: int = 0) -> Seal:
        """Return the seal of this and further lines. This seal does not change, as a signal may come at any time."""
        return Seal(text, rows, self)

    def __str__(self) -> str:
        return f"{self.rows:,}, sha256 {self._digest.hexdigest()}"


class CsvTable:
    """Comma-separated values below lines of metadata that begin with #. Each step is given to the system at once.

    When the table is closed, the last line of the heading gets the number of rows and a digest of everything below it.
    """

    def __init__(
        self, path: Path, metadata: Mapping[str, str] | None = None, columns: Iterable[str] = tuple(COLUMNS)
    ) -> None:
        self._columns, self._place = list(columns), path
        self.growing = claim(path, ".csv")
        self._empty = True
        try:
            # Written in one call a step, so that a kill has no half-filled buffer to lose.
            self._file = self.growing.open("r+b", buffering=0)
        except BaseException:
            self.growing.unlink()
            raise
        try:
            heading = _text(f"# {name}: {printable(value)}" for name, value in (metadata or {}).items())
            self._sealed_at = len(heading)
            self._write(heading + _text([_seal_line("unfinished")]), 0)
            self._body = self._file.tell()
            self._seal = Seal.of(self._columns)
            self._write(_text([",".join(self._columns)]), self._body)
        except BaseException:
            self.leave()
            raise

    def write(self, rows: Iterable[Row]) -> None:
        lines = [_line([row.get(column) for column in self._columns]) for row in rows]
        self._grow(_text(lines), len(lines))
        self._empty = self._empty and not lines

    def remark(self, name: str, value: str) -> None:
        self.comment(f"{name}: {printable(value)}")

    def comment(self, text: str) -> None:
        """Add a line that readers of the rows skip."""
        self._grow(_text([f"# {text}"]))

    def _grow(self, text: bytes, rows: int = 0) -> None:
        """Add lines. If a signal interrupts this, the next lines, or the end, overwrite the partial lines."""
        self._write(text, self._body + self._seal.size)
        self._seal = self._seal.further(text, rows)

    def _write(self, text: bytes, place: int) -> None:
        self._file.seek(place)
        unwritten = memoryview(text)
        while unwritten:
            unwritten = unwritten[self._file.write(unwritten) :]

    def _finish(self) -> None:
        self._file.truncate(self._body + self._seal.size)
        self._write(_text([_seal_line(str(self._seal))]), self._sealed_at)
        self._file.close()

    def close(self) -> None:
        try:
            self._finish()
            settle(self.growing, self._place)
        except BaseException:
            self.leave()
            raise

    def leave(self) -> Path | None:
        self._file.close()
        if self._empty:
            self.growing.unlink(missing_ok=True)
        return None if self._empty else self.growing


def _text(lines: Iterable[str]) -> bytes:
    return "".join(f"{line}\n" for line in lines).encode()


def _line(row: Iterable[Value]) -> str:
    return ",".join([_cell(value) for value in row])


def _seal_line(told: str) -> str:
    """Return the line that tells whether all rows are there. Before that is known, it has the same length."""
    return f"# rows: {told:>84}"


def _count(body: bytes) -> int:
    """Return the number of rows below the line with the names of columns. None of their cells has a line break."""
    return max(sum(not line.startswith(b"#") for line in body.splitlines()) - 1, 0)


def _cell(value: Value) -> str:
    """Return a value as the csv module writes it, except that text with a # is quoted, too.

    Some readers take what follows a # for a comment.
    """
    if not isinstance(value, str):
        return "" if value is None else repr(value)
    value = printable(value)
    return '"' + value.replace('"', '""') + '"' if re.search(r'[#,"]', value) else value


def _csv_text(path: Path) -> str:
    """Return the text of a CSV table without a last line that has no end, which a kill may leave.

    ValueError if rows are missing or have changed since they were written. A table without a line `# rows` is not
    checked.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path} is not a table of overlaps: it is not text ({first_line(error)})") from error
    seal = re.search(r"^# rows: +([\d,]+), sha256 ([0-9a-f]{64})$", text, re.MULTILINE)
    if seal is None:
        return text[: text.rfind("\n") + 1]
    body = text[seal.end() + 1 :].encode()
    if hashlib.sha256(body).hexdigest() != seal[2]:
        other = _other(path, seal[1], _count(body))
        raise ValueError(f"{other} (to accept the change, remove its line `# rows`)")
    return text


def _other(path: Path, written: str, there: int) -> ValueError:
    """Return the error for a table that has changed since it was written.

    `written` is the number of rows that was written, as text. `there` is the number of rows now.
    """
    what = f"it has {there:,} of its {written} rows" if f"{there:,}" != written else "a line has changed"
    return ValueError(f"{path} has changed since it was written: {what}")


def _sealed(path: Path, metadata: Mapping[str, str], columns: Sequence[str], rows: list[Row]) -> list[Row]:
    """Return the rows of a table that is not CSV, if its seal fits.

    Earlier versions wrote only the number of rows, or nothing.
    """
    told = metadata.get("rows")
    if told is None or told == str(len(rows)) or told == str(Seal.of(columns, (row.values() for row in rows))):
        return rows
    raise _other(path, told.partition(", sha256")[0][:20], len(rows))


def _csv_content(path: Path) -> Content:
    """Return the content of a CSV table. Empty cells are None."""
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


def _heading(lines: Sequence[str]) -> dict[str, str]:
    """Return the metadata of a CSV table by name.

    It is in the first lines. The entries about what was left out are in comments below.
    """
    heading = itertools.takewhile(lambda line: line.startswith("# "), lines)
    below = (line for line in lines if line.startswith(f"# {LEFT_OUT}"))
    told = (line[2:].partition(": ") for line in itertools.chain(heading, below))
    return {name: value.strip() for name, colon, value in told if colon}


def _row(columns: Sequence[str], cells: Sequence[str]) -> Row:
    if len(cells) != len(columns):
        raise ValueError(f"it has {len(cells)} cells, not {len(columns)}")
    return _checked({name: KNOWN[name](cell) if cell else None for name, cell in zip(columns, cells)})


def _check_columns(path: Path, columns: Sequence[str]) -> None:
    strangers, lacking = set(columns) - KNOWN.keys(), [name for name in NEEDED if name not in columns]
    if not columns:
        raise ValueError(f"{path} is not a table of overlaps: it has no columns")
    if strangers or lacking or len(set(columns)) < len(columns):
        stranger = min(strangers, default="")[:60]
        words = f"a column {stranger!r}" if strangers else f"no column {lacking[0]!r}" if lacking else "one twice"
        raise ValueError(f"{path} is not a table of overlaps: it has {words}")


def _checked(row: Row) -> Row:
    """Return the row, if its values have the types of the columns."""
    for name, value in row.items():
        kind = KNOWN[name]
        if kind is float and type(value) is int:
            row[name] = float(value)
        elif value is not None and type(value) is not kind:
            raise ValueError(f"{name} is {value!r:.40}, which is not {'an' if kind is int else 'a'} {kind.__name__}")
        elif kind is int and value is not None and not -(2**63) <= int(value) < 2**63:
            raise ValueError(f"{name} does not fit into 64 bits")
    if row["step"] is None:
        raise ValueError("a row has no step")
    return row


class ParquetTable(CsvTable):
    """A Parquet table, written with pyarrow.

    A Parquet file cannot be read before its end is written, and a file for each step would take a millisecond. The
    table therefore grows as CSV, in `run.unfinished.csv`, and `close` makes a Parquet file of it.
    """

    GROUP = 20_000  # rows; a row group of a few megabytes, as Parquet's readers expect

    def __init__(
        self, path: Path, metadata: Mapping[str, str] | None = None, columns: Mapping[str, type] = COLUMNS
    ) -> None:
        self._arrow: Any = _arrow()
        self._metadata, self._kinds = metadata or {}, columns
        self._remarks: dict[str, str] = {}  # which have no place among the rows of the CSV
        super().__init__(path, metadata, columns)

    def remark(self, name: str, value: str) -> None:
        self._remarks[name] = value

    def leave(self) -> Path | None:
        with suppress(OSError, ValueError):  # the file is closed, or the disk full
            for name, value in self._remarks.items():
                super().remark(name, value)
        return super().leave()

    def close(self) -> None:
        try:
            self._finish()
            with _named(self._place, self._arrow.lib.ArrowException), beside(self._place) as begun:
                self._convert(begun)
        except BaseException:
            self.leave()
            raise
        with suppress(OSError):  # all of it is in the table
            self.growing.unlink()

    def _convert(self, path: Path) -> None:
        """Write the rows of the CSV file as Parquet."""
        pyarrow, parquet = self._arrow, self._arrow.parquet
        kinds = {int: pyarrow.int32(), float: pyarrow.float64(), str: pyarrow.string()}
        fields = [(name, kinds[kind]) for name, kind in self._kinds.items()]
        schema = pyarrow.schema(fields, {**self._metadata, **self._remarks, "rows": str(self._seal)})
        cells = pyarrow.csv.ConvertOptions(
            column_types=dict(fields), null_values=[""], strings_can_be_null=True, quoted_strings_can_be_null=False
        )
        with self.growing.open("rb") as file, parquet.ParquetWriter(path, schema, write_page_checksum=True) as writer:
            file.seek(self._body)
            waiting: list[Any] = []
            for batch in pyarrow.csv.open_csv(file, convert_options=cells):
                waiting.append(batch)
                if sum(map(len, waiting)) >= self.GROUP:
                    writer.write_table(pyarrow.Table.from_batches(waiting).cast(schema))
                    waiting = []
            writer.write_table(pyarrow.Table.from_batches(waiting, pyarrow.schema(fields)).cast(schema))


@contextmanager
def _named(path: Path, *kinds: type[Exception]) -> Iterator[None]:
    """Turn a library's error about a file that it cannot write into an OSError.

    The OSError has the file's name and a reason.
    """
    try:
        yield
    except OSError as error:
        if error.strerror and error.filename:
            raise
        raise OSError(error.errno or errno.EIO, error.strerror or first_line(error), str(path)) from error
    except kinds as error:
        raise OSError(errno.EIO, first_line(error), str(path)) from error


class SqliteTable:
    """A SQLite table: rows are in the table `overlaps`, metadata in the table `metadata`. Each step is a transaction.

    During the run, and after a kill, the last steps are in `run.unfinished.sqlite-wal`, where every reader looks for
    them.
    """

    def __init__(
        self, path: Path, metadata: Mapping[str, str] | None = None, columns: Mapping[str, type] = COLUMNS
    ) -> None:
        self._columns = list(columns)
        self._place, self._empty = path, True
        self._seal = Seal.of(self._columns)
        self.growing = claim(path)
        # Whoever writes takes care that no two threads do so at once.
        self._connection = sqlite3.connect(self.growing, check_same_thread=False)
        kinds = {int: "INTEGER", float: "REAL", str: "TEXT"}
        declared = ", ".join(f"{name} {kinds[kind]}" for name, kind in columns.items())
        try:
            with _named(path, sqlite3.Error), self._connection:
                self._connection.execute("PRAGMA journal_mode = WAL")
                # With a log, this loses no transaction to a kill and corrupts nothing in a power cut, and waits for no
                # disk.
                self._connection.execute("PRAGMA synchronous = NORMAL")
                # One transaction, so that a killed run leaves both tables or neither. Python begins none for CREATE.
                self._connection.execute("BEGIN")
                self._connection.execute(f"CREATE TABLE overlaps ({declared})")
                self._connection.execute("CREATE TABLE metadata (name TEXT PRIMARY KEY, value TEXT)")
                self._connection.executemany("INSERT INTO metadata VALUES (?, ?)", (metadata or {}).items())
        except BaseException:
            self.leave()
            raise

    def write(self, rows: Iterable[Row]) -> None:
        blanks = ", ".join("?" * len(self._columns))
        cells = [[_in_sqlite(row.get(name)) for name in self._columns] for row in rows]
        with _named(self._place, sqlite3.Error), self._connection:
            self._connection.executemany(f"INSERT INTO overlaps VALUES ({blanks})", cells)
        self._seal = self._seal.further(_text(map(_line, cells)), len(cells))
        self._empty = self._empty and not cells

    def remark(self, name: str, value: str) -> None:
        with _named(self._place, sqlite3.Error), self._connection:
            self._connection.execute("REPLACE INTO metadata VALUES (?, ?)", (name, printable(value)))

    def close(self) -> None:
        try:
            with _named(self._place, sqlite3.Error):
                (count,) = self._connection.execute("SELECT count(*) FROM overlaps").fetchone()
                if count != self._seal.rows:  # a signal has come between a step and its seal
                    rows = self._connection.execute("SELECT * FROM overlaps ORDER BY rowid")
                    self._seal = Seal.of(self._columns, rows)
                with self._connection:
                    self._connection.execute("REPLACE INTO metadata VALUES ('rows', ?)", (str(self._seal),))
                self._connection.execute("PRAGMA journal_mode = DELETE")
                self._connection.close()
            # A log that an earlier database has left would be taken for one of the new.
            for ending in ("-wal", "-shm", "-journal"):
                self._place.with_name(self._place.name + ending).unlink(missing_ok=True)
            settle(self.growing, self._place)
        except BaseException:
            self.leave()
            raise

    def leave(self) -> Path | None:
        with suppress(sqlite3.Error):
            self._connection.close()
        if self._empty:
            for ending in ("", "-wal", "-shm", "-journal"):
                self.growing.with_name(self.growing.name + ending).unlink(missing_ok=True)
        return None if self._empty else self.growing


def _in_sqlite(value: Value) -> Value:
    """Return the value as SQLite gives it back: it has no NaN and no negative zero."""
    if type(value) is float:
        return None if math.isnan(value) else value + 0.0
    return value


# The kinds of table, by the ending of the file's name: of a path, of metadata, and of columns by name with their types.
TABLES: dict[str, Callable[..., Table]] = {
    ".csv": CsvTable,
    ".parquet": ParquetTable,
    ".sqlite": SqliteTable,
}


def must_be_a_table(path: Path) -> None:
    """Check that the name is that of a table.

    ValueError if it is not. ImportError without the library that writes the table.
    """
    if path.suffix not in TABLES:
        raise ValueError(f"the name of a table must end in {', '.join(TABLES)}, not {path.name!r}")
    if path.suffix == ".parquet":
        _arrow()


def _arrow() -> Any:
    try:
        import pyarrow
        import pyarrow.csv
        import pyarrow.parquet
    except ImportError as error:
        raise ImportError(f"a .parquet table needs {hint('pyarrow')}") from error
    return pyarrow


def read_parquet(file: Any, columns: Sequence[str] | None = None) -> Any:
    """Return the Arrow table in an open Parquet file, or those columns of it.

    No thread of Arrow reads it. A thread that has just started may abort a process that ends.
    """
    return file.read(columns=columns if columns is None else [*columns], use_threads=False)


def read_metadata(path: Path) -> dict[str, str]:
    """Return the metadata of a table by name: the versions and the settings that wrote it.

    ValueError if the file is not a table.
    """
    if path.suffix == ".parquet":
        with _opened_parquet(path) as dataset:
            return _texts(dataset.schema.metadata)
    if path.suffix == ".sqlite":
        with _opened_sqlite(path) as connection:
            return _said(connection)
    return _heading(_csv_text(path).splitlines())


def _said(connection: sqlite3.Connection) -> dict[str, str]:
    """Return the metadata of a database."""
    return {str(name): str(value) for name, value in connection.execute("SELECT name, value FROM metadata")}


def _texts(metadata: Mapping[bytes, bytes] | None) -> dict[str, str]:
    """Return the metadata of a Parquet schema."""
    found = (metadata or {}).items()
    return {name.decode(errors="replace"): value.decode(errors="replace") for name, value in found}


def read_table(path: Path) -> list[Row]:
    """Return the rows of a table of any kind, finished or not.

    OSError if there is no file. ValueError if it is not a table.
    """
    if path.suffix == ".parquet":
        with _opened_parquet(path) as dataset:
            _check_columns(path, dataset.schema.names)
            rows = [_checked(row) for row in read_parquet(dataset).to_pylist()]
            return _sealed(path, _texts(dataset.schema.metadata), dataset.schema.names, rows)
    if path.suffix == ".sqlite":
        with _opened_sqlite(path) as connection:
            cursor = connection.execute("SELECT * FROM overlaps ORDER BY rowid")
            columns = [description[0] for description in cursor.description]
            _check_columns(path, columns)
            rows = [_checked(dict(zip(columns, cells))) for cells in cursor]
            return _sealed(path, _said(connection), columns, rows)
    return _csv_content(path).rows


def read_content(path: Path) -> Content:
    """Return a table of any kind, finished or not, with everything in it.

    It raises the same errors as `read_table`.
    """
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
                raise ValueError(f"it states {count:,} rows, but has {size:,} bytes")
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
                if not re.match(r"(?i)create\s+table\b", str(kinds.get(name))):
                    raise ValueError(f"it has no table {name!r}")
            yield connection
    except (sqlite3.Error, ValueError, OverflowError, MemoryError) as error:  # a page may claim any length
        raise _no_table(path, error) from error


def _no_table(path: Path, error: Exception) -> ValueError:
    said = first_line(error)
    return ValueError(said if said.startswith(str(path)) else f"{path} is not a table of overlaps: {said}")
