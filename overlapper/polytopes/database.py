"""Polytopes in databases, through SQLAlchemy: SQLite files, PostgreSQL, and other databases that it has drivers for.

Two tables hold them. `polytopes` has the column `id`, an integer, and any further columns that others keep there.
`vertices` has `polytope_id`, `corner` (0, 1, 2, ...) and `x`, `y`, `z` in m, one row per corner. Facets are not kept,
as the corners determine them.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import groupby, islice
from operator import index
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from overlapper._core import Hull, Overlap
from overlapper.install import hint

try:
    import sqlalchemy as sql
except ImportError as error:
    raise ImportError(f"overlapper.polytopes.database needs {hint('sqlalchemy')}") from error

__all__ = ["read_polytopes", "write_polytopes"]

SCHEMA = sql.MetaData()
POLYTOPES = sql.Table("polytopes", SCHEMA, sql.Column("id", sql.BigInteger, primary_key=True, autoincrement=False))
VERTICES = sql.Table(
    "vertices",
    SCHEMA,
    sql.Column("polytope_id", sql.ForeignKey("polytopes.id"), primary_key=True),
    sql.Column("corner", sql.Integer, primary_key=True, autoincrement=False),
    *(sql.Column(axis, sql.Double, nullable=False) for axis in "xyz"),
)
# A polytope without corners has no row in `vertices`. The outer join finds it, so that it is not silently ignored.
ALL = """
    SELECT polytopes.id, x, y, z FROM polytopes LEFT JOIN vertices ON polytope_id = polytopes.id
    ORDER BY polytopes.id, corner
"""
# The actions that a query may do in SQLite. VACUUM INTO, ATTACH and most pragmas can write, so they are not allowed.
READING = {sqlite3.SQLITE_SELECT, sqlite3.SQLITE_READ, sqlite3.SQLITE_FUNCTION, sqlite3.SQLITE_RECURSIVE}
# The statement that keeps a session from writing, by the package of the driver.
POSTGRESQL = "SET SESSION CHARACTERISTICS AS TRANSACTION READ ONLY"
READ_ONLY = dict.fromkeys(("psycopg", "psycopg2", "pg8000"), POSTGRESQL)
READ_ONLY |= dict.fromkeys(("MySQLdb", "pymysql", "mariadb", "mysql"), "SET SESSION TRANSACTION READ ONLY")
ROWS = 10_000  # fetched at a time: some megabytes
BATCH = 1_000  # polytopes sent at a time


def read_polytopes(
    url: str, query: str | None = None, *, on_bad: Callable[[Any, str], object] | None = None
) -> Iterator[tuple[Any, Hull]]:
    """The polytopes of a database one after another, each with its id. Only a few are in memory at a time.

    `url` is SQLAlchemy's, such as "sqlite:///parts.db" or "postgresql+psycopg://user@host/parts". `query` returns four
    columns: the id (of any type) and x, y, z of a point in m. The points of a polytope must come one after another, as
    by ORDER BY id. Without a query, the tables that `write_polytopes` makes are read. Points inside a polytope are
    allowed. SQLite and PostgreSQL refuse a query that writes. Sessions of MySQL and MariaDB are told to refuse it,
    which is not tested. In other databases, writes are rolled back.

    An invalid polytope (a coordinate missing, fewer than four points, all in one plane) raises ValueError with its id.
    If `on_bad` is given, `on_bad(id, reason)` is called instead, and reading goes on. Raises FileNotFoundError if there
    is no such SQLite file, ValueError if the query has other columns or another order, and
    sqlalchemy.exc.SQLAlchemyError if the database refuses the query.
    """
    _must_exist(sql.make_url(url))
    with ExitStack() as stack:
        engine = stack.enter_context(_engine(url))
        sql.event.listen(engine, "connect", _read_only)
        connection = stack.enter_context(engine.connect())
        # The result is closed first, because a server keeps a cursor for it.
        rows = stack.enter_context(connection.execution_options(yield_per=ROWS).execute(sql.text(query or ALL)))
        if len(rows.keys()) != 4:
            raise ValueError(f"the query must return id, x, y and z, not {', '.join(rows.keys())}")
        met = set()
        for id, points in groupby(rows, key=lambda row: row[0]):
            if id in met:
                raise ValueError(f"the query must return the points of polytope {id} together: ORDER BY its id")
            met.add(id)
            try:
                hull = Hull([_point(corner, row) for corner, row in enumerate(points)])
            except ValueError as error:
                if on_bad is None:
                    raise ValueError(f"polytope {id}: {error}") from error
                on_bad(id, str(error))
            else:
                yield id, hull


def write_polytopes(url: str, polytopes: Iterable[tuple[int, Hull | Overlap | ArrayLike]]) -> int:
    """Adds polytopes to a database, each with its id, and returns their number.

    Each polytope is a Hull, an Overlap or (n, 3) points in m. The corners of its convex hull are written. Missing
    tables are made. Everything is one transaction: if it raises, nothing is written. Raises ValueError with the id for
    points that span no polytope, and sqlalchemy.exc.IntegrityError for an id that exists already.
    """
    count = 0
    remaining = iter(polytopes)
    with _engine(url) as engine, engine.begin() as connection:
        SCHEMA.create_all(connection)
        while batch := list(islice(remaining, BATCH)):
            corners = [row for id, polytope in batch for row in _corners(index(id), polytope)]
            connection.execute(POLYTOPES.insert(), [{"id": index(id)} for id, _ in batch])
            connection.execute(VERTICES.insert(), corners)
            count += len(batch)
    return count


@contextmanager
def _engine(url: str) -> Iterator[sql.Engine]:
    engine = sql.create_engine(url)
    try:
        yield engine
    finally:
        engine.dispose()


def _read_only(connection: Any, record: Any) -> None:
    """Makes a connection read-only, if its database can. SQLAlchemy rolls back anything else that was not committed."""
    if isinstance(connection, sqlite3.Connection):
        connection.set_authorizer(lambda action, *_: sqlite3.SQLITE_OK if action in READING else sqlite3.SQLITE_DENY)
        return
    words = READ_ONLY.get(type(connection).__module__.partition(".")[0])
    if words:
        cursor = connection.cursor()
        cursor.execute(words)
        cursor.close()
        connection.commit()  # otherwise the statement would apply only to this transaction


def _must_exist(url: sql.URL) -> None:
    """FileNotFoundError for a missing SQLite file, because SQLite would make an empty file."""
    path = url.database
    if url.get_backend_name() != "sqlite" or not path or path.startswith((":memory:", "file:")):
        return
    if not Path(path).is_file():
        raise FileNotFoundError(f"there is no database {path}")


def _point(corner: int, row: sql.Row[Any]) -> tuple[float, float, float]:
    try:
        x, y, z = map(float, row[1:])
    except (TypeError, ValueError):
        raise ValueError(f"point {corner} is {tuple(row[1:])}, which is not three numbers") from None
    return x, y, z


def _corners(id: int, polytope: Hull | Overlap | ArrayLike) -> list[dict[str, float]]:
    points = polytope.vertices if isinstance(polytope, Hull | Overlap) else np.asarray(polytope, dtype=float)
    try:
        corners = Hull(points).vertices
    except (TypeError, ValueError) as error:
        raise ValueError(f"polytope {id}: {error}") from error
    return [
        {"polytope_id": id, "corner": corner, "x": x, "y": y, "z": z}
        for corner, (x, y, z) in enumerate(corners.tolist())
    ]
