"""Polytopes of a real PostgreSQL, started for these tests on a socket of its own."""

import os
import shutil
import subprocess
import tempfile
from itertools import islice
from pathlib import Path

import pytest
import sqlalchemy

from overlapper import Hull, random_polytope, read_polytopes, write_polytopes

TETRAHEDRON = Hull([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])


@pytest.fixture(scope="module")
def server():
    """The folder of a server's socket. PostgreSQL refuses to run as root, who becomes nobody for it."""
    programs = max(Path("/usr/lib/postgresql").glob("*/bin"), key=lambda path: int(path.parent.name))
    as_nobody = ["runuser", "-u", "nobody", "--"] if os.getuid() == 0 else []
    environment = {
        name: value for name, value in os.environ.items() if name != "LD_PRELOAD"
    }  # a sanitizer is not for it
    folder = Path(tempfile.mkdtemp(prefix="overlapper-"))  # a short name, as that of a socket has 107 letters at most
    if as_nobody:
        shutil.chown(folder, "nobody")

    def call(program, *arguments):
        command = [*as_nobody, programs / program, "-D", folder / "data", *arguments]
        subprocess.run(command, check=True, cwd=folder, env=environment, stdout=subprocess.DEVNULL)

    try:
        call("initdb", "-U", "overlapper", "--auth=trust", "--no-sync", "--encoding=UTF8", "--locale=C")
        options = f"-k {folder} -c listen_addresses='' -F"
        call("pg_ctl", "start", "--wait", "--silent", "-l", folder / "log", "-o", options)
        try:
            yield folder
        finally:
            call("pg_ctl", "stop", "--mode=immediate", "--silent")
    finally:
        shutil.rmtree(folder)


@pytest.fixture
def url(server):
    """A database with nothing in it."""
    name = "parts"
    admin = sqlalchemy.create_engine(f"postgresql+psycopg://overlapper@/postgres?host={server}")
    with admin.execution_options(isolation_level="AUTOCOMMIT").connect() as connection:
        connection.execute(sqlalchemy.text(f"DROP DATABASE IF EXISTS {name}"))
        connection.execute(sqlalchemy.text(f"CREATE DATABASE {name}"))
    admin.dispose()
    return f"postgresql+psycopg://overlapper@/{name}?host={server}"


def execute(url, *statements):
    engine = sqlalchemy.create_engine(url)
    with engine.begin() as connection:
        for statement in statements:
            connection.execute(sqlalchemy.text(statement))
    engine.dispose()


def test_polytopes_are_read_back_bit_for_bit(url):
    hulls = {id: random_polytope(12, "sphere", rng=id) for id in range(1500)}
    assert write_polytopes(url, hulls.items()) == 1500
    found = dict(read_polytopes(url))
    assert list(found) == list(hulls)
    for id in hulls:
        assert sorted(found[id].vertices.tolist()) == sorted(hulls[id].vertices.tolist())


def test_an_id_that_is_taken_leaves_nothing_written(url):
    write_polytopes(url, [(1, TETRAHEDRON)])
    with pytest.raises(sqlalchemy.exc.IntegrityError, match=r"Key \(id\)=\(1\) already exists"):
        write_polytopes(url, [(2, TETRAHEDRON), (1, TETRAHEDRON)])
    assert [id for id, _ in read_polytopes(url)] == [1]


def test_bad_rows_of_a_table_of_decimals_are_named_by_id(url):
    corners = [f"('{part}', {i % 4 // 3}, {i % 4 % 3 // 2}, {i % 4 % 3 % 2})" for part in "abc" for i in range(4)]
    execute(
        url,
        "CREATE TABLE points (part text, x numeric, y numeric, z numeric)",
        f"INSERT INTO points VALUES {', '.join(corners)}, ('a', NULL, 0, 0), ('c', 'NaN', 0, 0)",
    )
    reasons = {}
    query = "SELECT part, x, y::float8, z FROM points ORDER BY part, x"
    ((id, hull),) = read_polytopes(url, query, on_bad=reasons.__setitem__)
    assert (id, hull.volume) == ("b", TETRAHEDRON.volume)
    assert "(None, 0.0, Decimal('0')), which is not three numbers" in reasons["a"]
    assert "finite" in reasons["c"]


def test_polytopes_are_streamed(url):
    endless = """
        WITH RECURSIVE corner(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM corner)
        SELECT i / 4, (i % 4 = 1)::int, (i % 4 = 2)::int, (i % 4 = 3)::int FROM corner
    """
    assert [id for id, _ in islice(read_polytopes(url, endless), 10_000)] == list(range(10_000))


def test_a_refusal_of_the_database_is_an_error_of_sqlalchemy(url):
    with pytest.raises(sqlalchemy.exc.ProgrammingError, match='relation "polytopes" does not exist'):
        next(read_polytopes(url))


@pytest.mark.parametrize(
    "query",
    ["DROP TABLE vertices", "SELECT 1, 0, 0, 0; DROP TABLE vertices", "SELECT 1, 0, 0, 0; COMMIT; DROP TABLE vertices"],
)
def test_a_query_only_reads(url, query):
    write_polytopes(url, [(1, TETRAHEDRON)])
    with pytest.raises(sqlalchemy.exc.SQLAlchemyError):
        list(read_polytopes(url, query))
    assert [id for id, _ in read_polytopes(url)] == [1]
