"""Tables come back as they were written, also in pandas and polars, and a killed run leaves what it had finished."""

import shutil
import sqlite3
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas
import polars
import pyarrow.parquet
import pytest

from overlapper import Box, Placed, overlap
from overlapper.scenes.table import COLUMNS, rows
from overlapper.scenes.table_file import TABLES, CsvTable, ParquetTable, read_csv, read_table
from overlapper.simulation.contacts import Contact

ENDINGS = sorted(TABLES)
METADATA = {"overlapper": "1.2.3", "tolerance": "0.001"}

# What the README says, a line each.
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
    """A cube and three more that reach into it, of which the last only touches."""

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
    assert (tmp_path / "run.csv").read_text().startswith("# overlapper: 1.2.3\n# tolerance: 0.001\nstep,")
    assert pyarrow.parquet.read_schema(tmp_path / "run.parquet").metadata == {
        name.encode(): value.encode() for name, value in METADATA.items()
    }
    with sqlite3.connect(tmp_path / "run.sqlite") as connection:
        assert dict(connection.execute("SELECT * FROM metadata")) == METADATA


ENDLESS = """
import sys
from itertools import count
from pathlib import Path
from overlapper.scenes.table_file import TABLES

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
    left = path.with_name("run.parquet.parts") if ending == ".parquet" else path
    for read in [read_table, *READERS[ending]]:
        table = read(left)
        steps = [row["step"] for row in table] if read is read_table else list(table["step"])
        # It may have had time for one more than it could tell of.
        assert steps[: 3 * finished] == [step for step in range(1, finished + 1) for _ in range(3)]
        assert len(steps) <= 3 * (finished + 1)


def test_a_line_that_a_kill_has_cut_is_not_read(tmp_path):
    table = CsvTable(tmp_path / "run.csv")
    table.write(Cubes().rows(1))
    table.close()
    text = (tmp_path / "run.csv").read_text()
    (tmp_path / "run.csv").write_text(text[:-7])
    assert read_csv(tmp_path / "run.csv") == Cubes().rows(1)[:2]


@pytest.mark.parametrize("ending", ENDINGS)
def test_nothing_of_an_earlier_run_is_left(tmp_path, ending):
    (tmp_path / "running").mkdir()
    running = TABLES[ending](tmp_path / "running" / f"run{ending}", METADATA)
    running.write(Cubes().rows(1))
    shutil.copytree(tmp_path / "running", tmp_path / "killed")
    running.close()
    path = tmp_path / "killed" / f"run{ending}"
    table = TABLES[ending](path, METADATA)
    table.write(Cubes().rows(2))
    table.close()
    assert {row["step"] for row in read_table(path)} == {2}
    assert list(path.parent.iterdir()) == [path]


def test_a_long_parquet_table_has_few_and_large_row_groups(tmp_path):
    table = ParquetTable(tmp_path / "run.parquet")
    for step in range(1, 12):
        table.write([{"step": step}] * 2_500)
    parts = sorted((tmp_path / "run.parquet.parts").iterdir())
    assert [len(read_table(part.parent)) for part in parts[:1]] == [27_500]
    assert len(parts) == 6
    table.close()
    file = pyarrow.parquet.ParquetFile(tmp_path / "run.parquet")
    assert [file.metadata.row_group(i).num_rows for i in range(file.num_row_groups)] == [20_000, 7_500]


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", "step,bodyA\n1,two\n", "step\n1,2\n"])
def test_what_is_no_table_is_refused_by_name(tmp_path, text):
    path: Path = tmp_path / "other.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"other\.csv"):
        read_csv(path)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("a,step\n1,2\n", r"is not a table of overlaps: it has a column 'a'$"),
        ("# only a heading\n", r"is not a table of overlaps: it has no columns$"),
        ("step,volume_m3\n1,0.5\ntwo,0.5\n", r"cannot be read at line 3 below its heading: invalid literal"),
        ("step,volume_m3\n1,0.5,7\n", r"cannot be read at line 2 below its heading"),
    ],
)
def test_a_file_that_is_no_table_is_refused_in_a_sentence(tmp_path, text, sentence):
    path = tmp_path / "t.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=sentence):
        read_csv(path)
