"""Tables, expected files and shapes with changed bytes are read, or refused in one sentence."""

import base64
import json
import sqlite3
import zlib
from contextlib import closing

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mutation import mutated, said_by

from overlapper import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, RoundedHull, Sphere
from overlapper.polytopes import shape_text
from overlapper.polytopes.shape_text import shape_of, text_of
from overlapper.tables.still import Still
from overlapper.tables.table import COLUMNS, POSE
from overlapper.tables.table_file import TABLES, read_metadata, read_table
from overlapper.verdicts.comparison import compare_measures, compare_poses
from overlapper.verdicts.expected import DRIFT, ROUNDING, Expected, read_expected

CORNERS = np.random.default_rng(0).normal(size=(12, 3))
SHAPES = [Box([1, 2, 3]), Sphere(1), Capsule(1, 2), Cylinder(1, 2), HalfSpace([0, 0, 1], 0), Hull(CORNERS)]
SHAPES += [RoundedHull(CORNERS, 0.1), Ellipsoid([0.1, 0.2, 0.3])]


def rows():
    """Two steps of two pairs and a shape alone."""
    table = []
    for step in (1, 2):
        for other in (1, 2):
            row = dict.fromkeys(COLUMNS) | {"step": step, "time_s": step / 240, "status": "overlapping"}
            row |= {"bodyA": 0, "linkA": -1, "shapeA": 0, "bodyB": other, "linkB": -1, "shapeB": 0}
            row |= dict.fromkeys([part.format(side) for side in "AB" for part in POSE], 0.5)
            table.append(row | {"volume_m3": 0.5, "volume_error_m3": 1e-12, "nameA": 'a "b", c', "nameB": "#"})
    return table


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The bytes of a table of each kind, and of an expected file."""
    folder = tmp_path_factory.mktemp("written")
    for ending, kind in TABLES.items():
        table = kind(folder / f"t{ending}", {"tolerance": "0.001"})
        table.write(rows())
        table.close()
    shapes = dict(zip([(body, -1, 0) for body in range(3)], [SHAPES[0], SHAPES[1], SHAPES[5]]))
    stills = {step: Still.recorded([row for row in rows() if row["step"] == step], shapes) for step in (1, 2)}
    expected = Expected([1, 2], 1e-3, ROUNDING | DRIFT, rows(), stills)
    expected.write(folder / "expected.csv", {})
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("ending", sorted(TABLES))
@given(data=st.data())
@settings(max_examples=200)
def test_a_mutated_table_is_read_or_refused_in_one_sentence(written, tmp_path_factory, ending, data):
    path = tmp_path_factory.getbasetemp() / f"mutated{ending}"
    path.write_bytes(mutated(data, written[f"t{ending}"]))

    def read():
        read_metadata(path)
        table = read_table(path)
        compare_measures(table, rows(), ROUNDING)
        compare_poses(rows(), table, DRIFT)

    said = said_by(read)
    assert said == "" or (said.startswith(str(path)) and "\n" not in said)


@given(data=st.data())
@settings(max_examples=300)
def test_a_mutated_expected_file_is_read_or_refused_in_one_sentence(written, tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "mutated_expected.csv"
    path.write_bytes(mutated(data, written["expected.csv"]))
    said = said_by(lambda: read_expected(path))
    assert said == "" or (said.startswith(str(path)) and "\n" not in said)


@given(data=st.data())
@settings(max_examples=300)
def test_a_mutated_shape_is_read_or_refused_in_one_sentence(data):
    text = mutated(data, text_of(data.draw(st.sampled_from(SHAPES))).encode()).decode(errors="replace")
    said = said_by(lambda: shape_of(text))
    assert said == "" or (" is not a shape: " in said and "\n" not in said)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[" * 100_000, "maximum recursion depth exceeded"),
        (
            json.dumps(["Hull", base64.b64encode(zlib.compress(bytes(60_000_000))).decode()]),
            "its vertices are cut off, or more",
        ),
        (
            json.dumps(["Hull", base64.b64encode(zlib.compress(CORNERS.tobytes())[:-9]).decode()]),
            "its vertices are cut",
        ),
        ('["Sphere", 1, 2, 3]', r"Sphere\(radius\): too many positional arguments"),
        ('[["Sphere"], 1]', "unhashable"),
        ("[]", "not enough values"),
        ('["Sphere", 1e999]', "radius"),
    ],
)
def test_an_invalid_shape_is_refused_in_one_sentence(text, reason):
    with pytest.raises(ValueError, match=reason) as refusal:
        shape_of(text)
    assert "\n" not in str(refusal.value) and len(str(refusal.value)) < 300
    assert shape_text.LARGEST < 60_000_000


def sqlite_of_bytes(data):
    """The database, with the statement that made its table as bytes in place of text."""
    with closing(sqlite3.connect(data)) as connection, connection:
        connection.execute("PRAGMA writable_schema = ON")
        connection.execute("UPDATE sqlite_master SET sql = CAST(sql AS BLOB) WHERE name = 'metadata'")


@pytest.mark.parametrize(
    ("name", "changes", "reason"),
    [
        ("t.csv", (b"volume_m3", b"volume\x1b" + b"m" * 5000), "has a column 'volume"),
        (
            "expected.csv",
            (b"budget volume: relative 1e-09", b"budget volume: relative 1\x1b\0"),
            "two numbers from 0 as budget of volume, not 1",
        ),
        ("expected.csv", (b"budget volume", b"budget " + b"v" * 5000), "which must be one of"),
        ("expected.csv", (b"\n1,0,-1,0,2,", b"\n3,0,-1,0,2,"), "are not all together"),
    ],
)
def test_a_refusal_is_short_and_can_be_printed(written, tmp_path, name, changes, reason):
    """The rows of a step 3 come between those of step 1, and others of step 1 behind them."""
    path = tmp_path / name
    text = written[name].replace(*changes)
    assert text != written[name]
    first = text.index(b"# rows")
    lines = (text[:first] + text[text.index(b"\n", first) + 1 :]).splitlines(keepends=True)
    path.write_bytes(b"".join([*lines, lines[-4]]))
    with pytest.raises(ValueError, match=reason) as refusal:
        read_expected(path) if name == "expected.csv" else read_table(path)
    said = str(refusal.value)
    assert said.startswith(str(path)) and said.isprintable() and len(said) < len(str(path)) + 300


def test_a_database_with_bytes_for_a_statement_is_refused(written, tmp_path):
    path = tmp_path / "t.sqlite"
    path.write_bytes(written["t.sqlite"])
    sqlite_of_bytes(path)
    with pytest.raises(ValueError, match=r"t\.sqlite is not a table of overlaps: "):
        read_table(path)


def test_a_database_with_cyclic_pages_is_refused(written, tmp_path):
    path = tmp_path / "t.sqlite"
    path.write_bytes(written["t.sqlite"])
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.executemany(
            f"INSERT INTO overlaps VALUES ({', '.join('?' * len(COLUMNS))})",
            [list(row.values()) for row in rows()] * 60,
        )
        (page,) = connection.execute("PRAGMA page_size").fetchone()
        (root,) = connection.execute("SELECT rootpage FROM sqlite_master WHERE name = 'overlaps'").fetchone()
    data = bytearray(path.read_bytes())
    start = page * (root - 1)
    assert data[start] == 5  # an inner page, of which the last child becomes the page itself
    data[start + 8 : start + 12] = root.to_bytes(4, "big")
    path.write_bytes(data)
    with pytest.raises(ValueError, match=r"t\.sqlite is not a table of overlaps: .*"):
        read_table(path)
