"""Tables come back as they were written, also in pandas and polars, and a killed run leaves what it had finished."""

import math
import re
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pandas
import polars
import pyarrow.parquet
import pytest

from overlapper import Box, Placed, overlap
from overlapper.simulation.contacts import Contact
from overlapper.tables.table import COLUMNS, rows
from overlapper.tables.table_file import NEEDED, TABLES, CsvTable, ParquetTable, read_metadata, read_table
from overlapper.whole_file import must_be_writable

ENDINGS = sorted(TABLES)
BLANK = "," * (len(NEEDED) - 1)
METADATA = {"overlapper": "1.2.3", "tolerance": "0.001"}

# The readers that the README shows, a line each.
READERS = {
    ".csv": [
        lambda path: pandas.read_csv(path, comment="#"),
        lambda path: polars.read_csv(path, comment_prefix="#"),
    ],
    ".parquet": [pandas.read_parquet, polars.read_parquet],
    ".sqlite": [
        lambda path: pandas.read_sql("SELECT * FROM overlaps", sqlite3.connect(path)),
        lambda path: polars.read_database("SELECT * FROM overlaps", sqlite3.connect(path)),
    ],
}


class Cubes:
    """A cube and three more cubes: two overlap it and the last only touches it."""

    def __init__(self):
        self.keys = [(body, -1, 0) for body in range(4)]
        self.positions = np.array([[0, 0, 0], [0.5, 0, 0], [0, 0.75, 0], [0, 0, 1]], dtype=float)
        self.orientations = np.array([[0.0, 0, 0, 1]] * 4)
        self.names = {(body, -1): f'cube#{body}/the "base", so to speak' for body in range(4)}

    def rows(self, step):
        cubes = [Placed(Box([0.5] * 3), position) for position in self.positions]
        contacts = [Contact(0, -1, 0, other, -1, 0, overlap(cubes[0], cubes[other])) for other in (1, 2, 3)]
        return rows(step, step / 240, self, contacts)


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_table_reads_back_as_it_was_written(tmp_path, ending):
    path = tmp_path / f"run{ending}"
    table = TABLES[ending](path, METADATA)
    for step in (1, 2, 3):
        table.write(Cubes().rows(step))
    table.close()
    assert read_table(path) == [row for step in (1, 2, 3) for row in Cubes().rows(step)]
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("ending", ENDINGS)
def test_one_line_reads_a_table_into_pandas_and_polars(tmp_path, ending):
    path = tmp_path / f"run{ending}"
    table = TABLES[ending](path, METADATA)
    table.write(Cubes().rows(1))
    table.close()
    for read in READERS[ending]:
        frame = read(path)
        assert list(frame.columns) == list(COLUMNS)
        assert list(frame["volume_m3"]) == pytest.approx([0.5, 0.25, 0.0])
        assert list(frame["nameB"]) == [f'cube#{body}/the "base", so to speak' for body in (1, 2, 3)]
        assert list(frame["bodyB"]) == [1, 2, 3]


def test_metadata_travels_with_every_kind_of_table(tmp_path):
    for ending in ENDINGS:
        TABLES[ending](tmp_path / f"run{ending}", METADATA).close()
    text = (tmp_path / "run.csv").read_text()
    assert re.match(r"# overlapper: 1\.2\.3\n# tolerance: 0\.001\n# rows: +0, sha256 [0-9a-f]{64}\nstep,", text)
    sealed = METADATA | {"rows": re.search(r"rows: +(0, sha256 [0-9a-f]{64})", text)[1]}
    assert pyarrow.parquet.read_schema(tmp_path / "run.parquet").metadata == {
        name.encode(): value.encode() for name, value in sealed.items()
    }
    with sqlite3.connect(tmp_path / "run.sqlite") as connection:
        assert dict(connection.execute("SELECT * FROM metadata")) == sealed
    for ending in ENDINGS:
        assert METADATA.items() <= read_metadata(tmp_path / f"run{ending}").items()


def unfinished_of(path):
    """Where the table is until it is closed: that of a Parquet file is CSV."""
    return path.with_name(f"run.unfinished{path.suffix.replace('parquet', 'csv')}")


ENDLESS = """
import sys
from itertools import count
from contextlib import closing
from pathlib import Path
from overlapper.tables.table_file import TABLES

path = Path(sys.argv[1])
table = TABLES[path.suffix](path, {})
for step in count(1):
    table.write([{"step": step, "bodyB": body} for body in range(3)])
    print(step, flush=True)
"""


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_killed_run_leaves_every_step_it_had_finished(tmp_path, ending):
    path = tmp_path / f"run{ending}"
    with subprocess.Popen([sys.executable, "-c", ENDLESS, path], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for _ in range(30):
            process.stdout.readline()
        process.kill()
        finished = 30 + len(process.stdout.read().split())
    left = unfinished_of(path)
    assert not path.exists()
    for read in [read_table, *READERS[left.suffix]]:
        table = read(left)
        steps = [row["step"] for row in table] if read is read_table else list(table["step"])
        # It may have had time for one more than it could tell of.
        assert steps[: 3 * finished] == [step for step in range(1, finished + 1) for _ in range(3)]
        assert len(steps) <= 3 * (finished + 1)


def test_a_line_that_a_kill_has_cut_is_not_read(tmp_path):
    table = CsvTable(tmp_path / "run.csv")
    table.write(Cubes().rows(1))
    left = table.leave()
    left.write_text(left.read_text()[:-7])
    assert read_table(left) == Cubes().rows(1)[:2]


def test_a_line_that_a_signal_has_cut_is_not_in_the_table(tmp_path):
    table = CsvTable(tmp_path / "run.csv")
    table.write(Cubes().rows(1))
    table._file.write(b"2,0.00833")
    table.close()
    assert read_table(tmp_path / "run.csv") == Cubes().rows(1)


@pytest.mark.parametrize("ending", ENDINGS)
def test_two_runs_at_once_and_one_that_was_killed_disturb_nothing(tmp_path, ending):
    path = tmp_path / f"run{ending}"
    path.write_text("what was there before")
    killed, first, second = (TABLES[ending](path, METADATA) for _ in range(3))
    for step, table in enumerate((killed, first, second)):
        table.write(Cubes().rows(step))
    assert path.read_text() == "what was there before"
    second.close()
    assert {row["step"] for row in read_table(path)} == {2}
    first.close()
    assert {row["step"] for row in read_table(path)} == {1}
    left = killed.leave()
    assert left == unfinished_of(path)
    assert {row["step"] for row in read_table(left)} == {0}
    assert {path.name for path in tmp_path.iterdir()} == {path.name, left.name}


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_table_without_rows_leaves_no_file(tmp_path, ending):
    assert TABLES[ending](tmp_path / f"run{ending}", METADATA).leave() is None
    assert list(tmp_path.iterdir()) == []


def test_the_log_of_an_earlier_database_is_not_taken_for_one_of_the_new(tmp_path):
    path = tmp_path / "run.sqlite"
    with sqlite3.connect(path) as earlier:
        earlier.execute("PRAGMA journal_mode = WAL")
        earlier.execute("CREATE TABLE overlaps (step)")
    assert (tmp_path / "run.sqlite-wal").exists()
    table = TABLES[".sqlite"](path, METADATA)
    table.write(Cubes().rows(1))
    table.close()
    assert read_table(path) == Cubes().rows(1)
    earlier.close()


def test_a_symbolic_link_to_a_table_stays_a_link(tmp_path):
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "run.csv").write_text("earlier")
    (tmp_path / "kept" / "run.csv").chmod(0o640)
    (tmp_path / "run.csv").symlink_to(tmp_path / "kept" / "run.csv")
    CsvTable(tmp_path / "run.csv").close()
    assert (tmp_path / "run.csv").is_symlink()
    assert read_table(tmp_path / "kept" / "run.csv") == []
    assert (tmp_path / "kept" / "run.csv").stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize(("place", "reason"), [("/dev/null", "Invalid argument"), (".", "Is a directory")])
def test_folders_and_devices_are_not_replaced_by_a_table(place, reason):
    with pytest.raises(OSError, match=reason):
        must_be_writable(Path(place))
    with pytest.raises(FileNotFoundError):
        must_be_writable(Path("no/folder/run.csv"))


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_table_that_was_cut_is_noticed(tmp_path, ending):
    path = tmp_path / f"run{ending}"
    table = TABLES[ending](path, METADATA)
    for step in range(40):
        table.write(Cubes().rows(step))
    table.close()
    whole = path.read_bytes()
    for part in (0.3, 0.6, 0.9, 0.999):
        path.write_bytes(whole[: int(part * len(whole))])
        with pytest.raises(ValueError, match=re.escape(str(path))):
            read_table(path)


def changed_table(path, change):
    """A table of one step, changed by an SQL statement after it was closed."""
    table = TABLES[".sqlite"](path, METADATA)
    table.write(Cubes().rows(1))
    table.close()
    database(path, change)
    return path


def test_rows_missing_from_a_database_are_noticed(tmp_path):
    path = changed_table(tmp_path / "run.sqlite", "DELETE FROM overlaps WHERE bodyB = 2")
    with pytest.raises(ValueError, match=r"has changed since it was written: it has 2 of its 3 rows$"):
        read_table(path)


def test_a_long_parquet_table_has_few_and_large_row_groups(tmp_path):
    table = ParquetTable(tmp_path / "run.parquet")
    for step in range(1, 12):
        table.write([{"step": step}] * 2_500)
    assert len((tmp_path / "run.unfinished.csv").read_text().splitlines()) == 27_500 + 2
    table.close()
    file = pyarrow.parquet.ParquetFile(tmp_path / "run.parquet")
    groups = [file.metadata.row_group(i).num_rows for i in range(file.num_row_groups)]
    assert sum(groups) == 27_500 and len(groups) == 2


def test_every_value_comes_back_from_every_kind_of_table(tmp_path):
    """CSV, Parquet and SQLite give back what they were given; SQLite has no NaN and no negative zero."""
    odd = [5e-324, -1.7976931348623157e308, 0.1, 1 / 3, math.inf, -math.inf, -0.0, math.nan, None]
    names = ["NA", "null", "nan", "true", "1", " a ", 'a "b", c', "#", "ä€𝄞", "a\\nb", "inf", "N/A", None]
    made = [
        Cubes().rows(1)[0] | {"volume_m3": odd[k % len(odd)], "nameA": names[k % len(names)], "bodyA": 2**31 - 1 - k}
        for k in range(len(odd) * len(names))
    ]
    for ending in ENDINGS:
        table = TABLES[ending](tmp_path / f"run{ending}", METADATA)
        for row in made:
            table.write([row])
        table.close()
        found = read_table(tmp_path / f"run{ending}")
        if ending == ".sqlite":
            expected = [
                row | {"volume_m3": None if row["volume_m3"] != row["volume_m3"] else row["volume_m3"]} for row in made
            ]
            assert found == expected
        else:
            assert [[repr(row[name]) for name in row] for row in found] == [
                [repr(row.get(name)) for name in COLUMNS] for row in made
            ]


@pytest.mark.parametrize("ending", [".parquet", ".sqlite"])
def test_a_value_that_has_changed_is_noticed_whatever_holds_its_bits(tmp_path, ending):
    """Also if all checksums of the format itself fit."""
    path = tmp_path / f"run{ending}"
    for change in (False, True):
        table = TABLES[ending](path, METADATA)
        table.write([row | {"depth_m": row["depth_m"] + change * 1e-12} for row in Cubes().rows(1)])
        table.close()
        if not change:
            seal = read_metadata(path)["rows"]
    if ending == ".parquet":
        content = pyarrow.parquet.read_table(path)
        content = content.replace_schema_metadata({**content.schema.metadata, b"rows": seal.encode()})
        pyarrow.parquet.write_table(content, path)
    else:
        database(path, f"UPDATE metadata SET value = '{seal}' WHERE name = 'rows'")
    with pytest.raises(ValueError, match=r"has changed since it was written: a line has changed$"):
        read_table(path)


def test_a_table_of_an_earlier_version_has_the_number_of_its_rows_alone(tmp_path):
    path = changed_table(tmp_path / "run.sqlite", "UPDATE metadata SET value = '3' WHERE name = 'rows'")
    assert read_table(path) == Cubes().rows(1)


GROWN = """
import re, sys
from pathlib import Path
from overlapper.tables.table_file import TABLES

def peak():
    return int(re.search(r"VmHWM:\\s*(\\d+)", Path("/proc/self/status").read_text())[1]) / 1024

path = Path(sys.argv[1])
table = TABLES[path.suffix](path, {})
row = {"step": 1, "time_s": 0.1, "bodyA": 0, "bodyB": 1, "nameA": "a" * 200, "volume_m3": 0.1}
table.write([row] * 1000)
before = peak()
for step in range(2, 62):
    table.write([row] * 1000)
grown = peak()
table.close()
print(grown - before, peak() - grown)
"""


@pytest.mark.parametrize("ending", [".csv", ".sqlite"])
def test_a_table_is_written_and_closed_without_being_held_in_memory(tmp_path, ending):
    """Sixty thousand rows, 17 MB as CSV."""
    done = subprocess.run([sys.executable, "-c", GROWN, tmp_path / f"run{ending}"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    growing, closing_it = map(float, done.stdout.split())
    assert growing < 5 and closing_it < 5


@pytest.mark.parametrize("ending", ENDINGS)
def test_steps_of_few_rows_cost_the_same_in_each_kind_of_table(tmp_path, ending):
    """A Parquet file for each step would take ten times as long."""
    made = Cubes().rows(1) * 3
    cost = {}
    for kind in (".csv", ending):
        table = TABLES[kind](tmp_path / f"run{kind}", METADATA)
        table.write(made)
        start = time.process_time()
        for _ in range(100):
            table.write(made)
        cost[kind] = time.process_time() - start
        table.close()
    assert cost[ending] < 5 * cost[".csv"]


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", "step,bodyA\n1,two\n", "step\n1,2\n"])
def test_a_name_that_is_no_table_is_refused(tmp_path, text):
    path: Path = tmp_path / "other.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"other\.csv"):
        read_table(path)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("a,step\n1,2\n", r"is not a table of overlaps: it has a column 'a'$"),
        ("# only a heading\n", r"is not a table of overlaps: it has no columns$"),
        (f"{','.join(NEEDED)}\n1{BLANK}\ntwo{BLANK}\n", r"cannot be read at line 3 below its heading: invalid literal"),
        (
            f"{','.join(NEEDED)}\n1{BLANK},7\n",
            r"cannot be read at line 2 below its heading: it has 23 cells, not 22",
        ),
        (f"{','.join(NEEDED)}\n{BLANK}\n", r"line 2 below its heading: a row has no step"),
        (f"{','.join(NEEDED)}\n{'9' * 30}{BLANK}\n", r"line 2 below its heading: step does not fit into 64 bits"),
        (f"{','.join(NEEDED)}\n{'9' * 200_000}{BLANK}\n", r"line 2 below its heading: field larger than field limit"),
        (f"{','.join(NEEDED)},step\n", r"is not a table of overlaps: it has one twice"),
        ("step,volume_m3\n1,0.5\n", r"is not a table of overlaps: it has no column 'status'"),
    ],
)
def test_a_file_that_is_no_table_is_refused_in_a_sentence(tmp_path, text, sentence):
    path = tmp_path / "t.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=sentence):
        read_table(path)


def database(path, *statements):
    with closing(sqlite3.connect(path)) as connection, connection:
        for statement in statements:
            connection.execute(statement)


COLUMN_LIST = ", ".join(NEEDED)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda path: path.write_bytes(b"\xff" * 40), r"it is not text \("),
        (lambda path: path.with_suffix(".sqlite").write_bytes(b"\xff" * 4000), r"file is not a database$"),
        (lambda path: database(path.with_suffix(".sqlite"), "CREATE TABLE a (b)"), r"it has no table 'overlaps'$"),
        (
            # Rows without end, made by whoever asks for them.
            lambda path: database(
                path.with_suffix(".sqlite"),
                "CREATE TABLE metadata (name, value)",
                "CREATE VIEW overlaps AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i FROM n) SELECT i FROM n",
            ),
            r"it has no table 'overlaps'$",
        ),
        (
            lambda path: database(
                path.with_suffix(".sqlite"),
                f"CREATE TABLE overlaps ({COLUMN_LIST})",
                "CREATE TABLE metadata (name, value)",
                f"INSERT INTO overlaps VALUES ('one'{', NULL' * (len(NEEDED) - 1)})",
            ),
            r"step is 'one', which is not an int$",
        ),
        (
            lambda path: path.with_suffix(".parquet").write_bytes(b"PAR1" * 10),
            r"t\.parquet is not a table of overlaps: ",
        ),
        (
            lambda path: pyarrow.parquet.write_table(
                pyarrow.table({"step": pyarrow.nulls(10_000_000, pyarrow.int32())}), path.with_suffix(".parquet")
            ),
            r"it states 10,000,000 rows, but has [\d,]+ bytes$",
        ),
    ],
)
def test_bytes_that_are_no_table_are_refused_in_a_sentence(tmp_path, make, sentence):
    make(tmp_path / "t.csv")
    (path,) = tmp_path.iterdir()
    with pytest.raises(ValueError, match=sentence) as refusal:
        read_table(path)
    assert str(refusal.value).startswith(f"{path} is not a table of overlaps: ")
    assert str(refusal.value).count("\n") == 0


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_missing_table_is_reported_as_no_file(tmp_path, ending):
    for read in (read_table, read_metadata):
        with pytest.raises(FileNotFoundError):
            read(tmp_path / f"none{ending}")


def test_a_database_gets_its_tables_and_metadata_at_once(tmp_path):
    """A run may be killed between any two statements."""
    seen = []

    class Watched(dict):
        def items(self):
            with closing(sqlite3.connect(tmp_path / "run.unfinished.sqlite")) as other:
                seen.extend(other.execute("SELECT name FROM sqlite_master"))
            return super().items()

    table = TABLES[".sqlite"](tmp_path / "run.sqlite", Watched(METADATA))
    assert seen == []
    table.close()
    assert read_metadata(tmp_path / "run.sqlite").items() > METADATA.items()
