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
    """Read the polytopes of a database one after another. Only a few are in memory at a time.

    SQLite and PostgreSQL refuse a query that writes. Sessions of MySQL and MariaDB are told to refuse it, which is not
    tested. In other databases, writes are rolled back.

    Parameters
    ----------
    url : str
        URL of SQLAlchemy, such as "sqlite:///parts.db" or "postgresql+psycopg://user@host/parts".
    query : str, optional
        SQL that returns four columns: the id (of any type) and x, y, z of a point in m. The points of a polytope must
        come one after another, as by ORDER BY id. Default: the tables that `write_polytopes` makes.
    on_bad : callable, optional
        Called as on_bad(id, reason) for an invalid polytope, instead of the ValueError. Reading then continues.

    Yields
    ------
    tuple of (id, Hull)
        The convex hull of the points of each polytope, with its id.

    Raises
    ------
    FileNotFoundError
        If there is no such SQLite file.
    ValueError
        If the query has other columns or another order. Also, without `on_bad`, for an invalid polytope: a coordinate
        is missing, there are fewer than four points, or all points lie in one plane.
    sqlalchemy.exc.SQLAlchemyError
        If the database refuses the query.
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
                raise ValueError(f"the query must return the points of polytope {id} together: add ORDER BY id")
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
    """Add polytopes to a database, each with its id.

    Missing tables are made. Everything is one transaction: if it raises, nothing is written.

    Parameters
    ----------
    url : str
        URL of SQLAlchemy, such as "sqlite:///parts.db".
    polytopes : iterable of (id, polytope)
        Each polytope is a Hull, an Overlap or (n, 3) points in m. The vertices of its convex hull are written.

    Returns
    -------
    int
        The number of polytopes written.

    Raises
    ------
    ValueError
        If the points of an id span no polytope.
    sqlalchemy.exc.IntegrityError
        If an id exists already.
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
