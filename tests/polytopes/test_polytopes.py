"""Random polytopes, and polytopes of a database."""

import sqlite3
import subprocess
import sys
from itertools import islice
from types import SimpleNamespace

import numpy as np
import pytest
import sqlalchemy
from numpy.testing import assert_array_equal

from overlapper import Box, Hull, overlap, random_polytope, read_polytopes, write_polytopes
from overlapper.polytopes import database

TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
FLAT = TETRAHEDRON * [1, 1, 0]


# Random


@pytest.mark.parametrize("source", ["cube", "ball", "sphere", "halfspaces"])
@pytest.mark.parametrize("n", [4, 5, 40])
def test_a_seed_makes_one_polytope_and_another_seed_another(source, n):
    first = random_polytope(n, source, rng=7)
    assert_array_equal(random_polytope(n, source, rng=np.random.default_rng(7)).vertices, first.vertices)
    assert random_polytope(n, source, rng=8).volume != first.volume


def test_a_cloud_stays_in_its_cube_or_ball_and_fills_it_as_it_grows():
    cube, ball = random_polytope(20_000, rng=1), random_polytope(20_000, "ball", rng=1)
    assert np.abs(cube.vertices).max() <= 1.0 and cube.volume == pytest.approx(8.0, rel=0.02)
    assert np.linalg.norm(ball.vertices, axis=1).max() <= 1.0
    assert ball.volume == pytest.approx(4 / 3 * np.pi, rel=0.04)


def test_the_points_of_a_ball_are_uniform_in_volume():
    # The mean volume of the hull of four points is known: Kingman, Random secants of a convex body, 1969.
    rng = np.random.default_rng(3)
    volumes = [random_polytope(4, "ball", rng=rng).volume for _ in range(4000)]
    expected = 9 / 715 * 4 / 3 * np.pi
    assert np.mean(volumes) == pytest.approx(expected, abs=4 * np.std(volumes) / len(volumes) ** 0.5)


@pytest.mark.parametrize("seed", range(10))
def test_every_point_on_the_sphere_is_a_corner_and_every_plane_that_touches_it_a_facet(seed):
    sphere = random_polytope(60, "sphere", rng=seed)
    assert np.linalg.norm(sphere.vertices, axis=1) == pytest.approx(np.ones(60), abs=1e-15)
    cell = random_polytope(60, "halfspaces", rng=seed)
    assert cell.halfspaces.shape == (60, 4)
    assert -cell.halfspaces[:, 3] == pytest.approx(np.ones(60), abs=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_few_planes_enclose_a_cell_of_bounded_reach(seed):
    cell = random_polytope(4, "halfspaces", rng=seed)
    assert len(cell.vertices) == 4 and np.linalg.norm(cell.vertices, axis=1).max() <= 10.0


def test_polytopes_that_cannot_be_drawn_at_random_are_refused():
    with pytest.raises(ValueError, match=r"n must be at least 4, .* not 3"):
        random_polytope(3)
    with pytest.raises(TypeError, match="n must be a whole number, not '8'"):
        random_polytope("8")
    with pytest.raises(ValueError, match="source must be one of cube, ball, sphere, halfspaces, not 'torus'"):
        random_polytope(10, "torus")


# Databases


@pytest.fixture
def file(tmp_path):
    return tmp_path / "parts.db"


@pytest.fixture
def url(file):
    return f"sqlite:///{file}"


def points_table(file, rows):
    """A table of a user's own, with text for ids."""
    with sqlite3.connect(file) as connection:
        connection.execute("CREATE TABLE points (part, x, y, z)")
        connection.executemany("INSERT INTO points VALUES (?, ?, ?, ?)", rows)
    connection.close()


def test_polytopes_are_read_back_bit_for_bit(url):
    hulls = {id: random_polytope(12, "ball", rng=id) for id in reversed(range(100))}
    assert write_polytopes(url, hulls.items()) == 100
    found = list(read_polytopes(url))
    assert [id for id, _ in found] == list(range(100))
    for id, hull in found:
        assert sorted(hull.vertices.tolist()) == sorted(hulls[id].vertices.tolist())


def test_points_and_overlaps_are_written_as_their_corners(url):
    cube = np.array(np.meshgrid([0, 1], [0, 1], [0, 1.0])).reshape(3, 8).T
    common = overlap(cube, cube + 0.5)
    write_polytopes(url, [(1, np.vstack([cube, [[0.5, 0.5, 0.5]]]).tolist()), (np.int64(2), common)])
    (_, whole), (_, part) = read_polytopes(url)
    assert (len(whole.vertices), whole.volume, part.volume) == (8, 1.0, 0.125)


def test_polytopes_are_added_to_those_that_are_there(url):
    write_polytopes(url, [(1, TETRAHEDRON)])
    write_polytopes(url, [(2, 2 * TETRAHEDRON)])
    assert [hull.volume for _, hull in read_polytopes(url)] == pytest.approx([1 / 6, 8 / 6])


@pytest.mark.parametrize(
    ("second", "error", "words"),
    [
        ((2, FLAT), ValueError, "polytope 2: "),
        ((2, overlap(Box([1, 1, 1]), TETRAHEDRON + 5)), ValueError, "polytope 2: "),
        ((1, TETRAHEDRON), sqlalchemy.exc.IntegrityError, "UNIQUE"),
    ],
)
def test_either_all_polytopes_are_written_or_none(url, second, error, words):
    write_polytopes(url, [(0, TETRAHEDRON)])
    with pytest.raises(error, match=words):
        write_polytopes(url, [(1, TETRAHEDRON), *[(i, TETRAHEDRON) for i in range(10, 3000)], second])
    assert [id for id, _ in read_polytopes(url)] == [0]


def test_a_query_brings_the_points_of_any_table(file, url):
    rows = [("foot", *p) for p in TETRAHEDRON.tolist()] + [("hand", *p) for p in (3 * TETRAHEDRON).tolist()]
    points_table(file, rows)
    found = dict(read_polytopes(url, "SELECT part, x / 2, y / 2, z / 2 FROM points ORDER BY part"))
    assert {part: hull.volume for part, hull in found.items()} == pytest.approx({"foot": 1 / 48, "hand": 27 / 48})


BAD = {
    "short": (TETRAHEDRON[:3].tolist(), "four points"),
    "flat": (FLAT.tolist(), "plane"),
    "gap": ([[0, 0, 0], [1, None, 0], [0, 1, 0], [0, 0, 1]], "point 1 is (1, None, 0), which is not three numbers"),
    "word": ([[0, 0, "nought"], *TETRAHEDRON.tolist()], "point 0 is (0, 0, 'nought'), which is not three numbers"),
    "far": ([[0, 0, float("inf")], *TETRAHEDRON.tolist()], "finite"),
}


def test_bad_rows_are_named_by_id_and_the_good_ones_come_through(file, url):
    points_table(file, [(name, *p) for name, (points, _) in BAD.items() for p in points])
    with sqlite3.connect(file) as connection:
        connection.executemany("INSERT INTO points VALUES ('good', ?, ?, ?)", TETRAHEDRON.tolist())
    connection.close()
    query = "SELECT part, x, y, z FROM points ORDER BY part = 'good', part"
    reasons = {}
    assert [id for id, _ in read_polytopes(url, query, on_bad=reasons.__setitem__)] == ["good"]
    assert reasons.keys() == BAD.keys()
    for name, (_, words) in BAD.items():
        assert words in reasons[name]
    with pytest.raises(ValueError, match="polytope far: "):
        next(read_polytopes(url, query))


def test_a_polytope_without_corners_is_bad_not_absent(file, url):
    write_polytopes(url, [(1, TETRAHEDRON)])
    with sqlite3.connect(file) as connection:
        connection.execute("INSERT INTO polytopes VALUES (2)")
    connection.close()
    bad = []
    assert [id for id, _ in read_polytopes(url, on_bad=lambda id, why: bad.append(id))] == [1]
    assert bad == [2]


def test_a_query_of_another_shape_or_order_is_refused(file, url):
    points_table(file, [(part, *p) for part in ("a", "b", "a") for p in TETRAHEDRON.tolist()])
    with pytest.raises(ValueError, match="must return id, x, y and z, not x, y"):
        list(read_polytopes(url, "SELECT x, y FROM points"))
    with pytest.raises(ValueError, match="must return the points of polytope a together: add ORDER BY id"):
        list(read_polytopes(url, "SELECT * FROM points"))
    with pytest.raises(sqlalchemy.exc.OperationalError, match="no such table: polytopes"):
        list(read_polytopes(url))


def test_reading_makes_no_file_where_there_is_none(file, url):
    with pytest.raises(FileNotFoundError, match=r"there is no database .*parts\.db"):
        list(read_polytopes(url))
    assert not file.exists()


def test_polytopes_are_streamed(file, url):
    points_table(file, [])
    endless = """
        WITH RECURSIVE corner(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM corner)
        SELECT i / 4, i % 4 = 1, i % 4 = 2, i % 4 = 3 FROM corner
    """
    first = list(islice(read_polytopes(url, endless), 10_000))
    assert [id for id, _ in first] == list(range(10_000))
    assert {hull.volume for _, hull in first} == {Hull(TETRAHEDRON).volume}


@pytest.mark.parametrize(
    ("driver", "words"),
    [
        ("pymysql.connections", "SET SESSION TRANSACTION READ ONLY"),
        ("mariadb.connections", "SET SESSION TRANSACTION READ ONLY"),
        ("psycopg", "SET SESSION CHARACTERISTICS AS TRANSACTION READ ONLY"),
        ("cx_Oracle", None),
    ],
)
def test_a_session_is_told_to_read_only_as_its_database_has_it(driver, words):
    told = []
    cursor = SimpleNamespace(execute=told.append, close=lambda: told.append("close"))
    connection = type("Connection", (), {"__module__": driver, "cursor": lambda self: cursor})()
    connection.commit = lambda: told.append("commit")
    database._read_only(connection, None)
    assert told == ([words, "close", "commit"] if words else [])


def test_the_package_needs_sqlalchemy_only_for_databases():
    code = "import sys, overlapper; from overlapper import *; print('sqlalchemy' in sys.modules); overlapper.no_such"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "False\n"
    assert "module 'overlapper' has no attribute 'no_such'" in done.stderr
