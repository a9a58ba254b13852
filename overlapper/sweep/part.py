"""The tables of some tasks as the bytes of Parquet files: results, kept steps, and failures."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from overlapper.install import hint
from overlapper.sweep.measures import FORCES, MEASURES
from overlapper.tables.table import COLUMNS
from overlapper.tables.table import FORCES as FORCE_COLUMNS

if TYPE_CHECKING:
    from overlapper.scenes.parameters import Parameter
    from overlapper.sweep.study import Task
    from overlapper.tables.table import Row

# The column with the name of the task, and the names of the tables.
TASK = "task"
TASKS, STEPS, FAILURES = "tasks", "steps", "failures"

# The columns of a task that failed: a word and a sentence by this package, and the traceback of the task.
FAILED: dict[str, type] = {"what": str, "sentence": str, "traceback": str}

OF: dict[str, Mapping[str, type]] = {TASKS: MEASURES, STEPS: COLUMNS, FAILURES: FAILED}

# The columns that volumetric contact adds to them.
FORCES_OF: dict[str, Mapping[str, type]] = {TASKS: FORCES, STEPS: FORCE_COLUMNS, FAILURES: {}}

# Metadata keys. A part of tasks holds the name of the part with their steps; a part of steps, a digest of its tasks.
STEPS_PART, OF_TASKS = b"steps part", b"of tasks"


def arrow() -> Any:
    """pyarrow with its Parquet; ImportError without it."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise ImportError(f"a sweep needs {hint('pyarrow')}") from error
    return pyarrow


def must_be_no_columns(defaults: Mapping[str, Parameter]) -> None:
    """ValueError if a parameter has the same name as a column of the tables."""
    for table, columns in OF.items():
        if taken := defaults.keys() & {TASK, *columns, *FORCES_OF[table]}:
            raise ValueError(f"the parameter {min(taken)!r} must not have the name of a column of the table {table}")


def filled(table: str, found: Iterable[tuple[Task, Sequence[Row]]], heading: Mapping[str, str]) -> Any:
    """The Arrow table of one or more tasks. Every row of a task has the name and the parameters of the task.

    `heading` describes the study. With volumetric contact, there are columns of forces.
    """
    pyarrow = arrow()
    found = [*found]
    kinds = {int: pyarrow.int64(), float: pyarrow.float64(), str: pyarrow.string(), bool: pyarrow.bool_()}
    parameters = found[0][0].parameters
    columns = {TASK: str, **{each: type(value) for each, value in parameters.items()}, **OF[table]}
    if heading.get("contact") == "volumetric":
        columns |= FORCES_OF[table]
    schema = pyarrow.schema([(column, kinds[kind]) for column, kind in columns.items()], dict(heading))
    lines = [{TASK: task.name, **task.parameters, **row} for task, rows in found for row in rows]
    return pyarrow.Table.from_pylist(lines, schema=schema)


def parts(tables: Mapping[str, Any]) -> dict[str, bytes]:
    """The tables as Parquet files; equal rows give equal bytes. The part of tasks names the part with their steps."""
    made: dict[str, bytes] = {}
    for table in (STEPS, TASKS, FAILURES):  # the steps first, because the part of tasks holds their digest
        if table in tables:
            content = tables[table].combine_chunks()
            said = dict(content.schema.metadata)
            if table == STEPS:  # with or without rows, it belongs to these tasks only
                said[OF_TASKS] = digest("".join(tables[TASKS].column(TASK).to_pylist()).encode())
            elif table == TASKS and STEPS in made:
                said[STEPS_PART] = digest(made[STEPS])
            made[table] = _bytes(content.replace_schema_metadata(said))
    return made


def digest(data: bytes) -> str:
    """The name of a part, 32 hexadecimal digits. A reader can tell from it whether any bit of the part has changed."""
    return hashlib.sha256(data).hexdigest()[:32]


def _bytes(content: Any) -> bytes:
    pyarrow = arrow()
    file = pyarrow.BufferOutputStream()
    many = len(content) > 1
    pyarrow.parquet.write_table(
        content,
        file,
        # Compressing a single row makes the file larger, and takes a millisecond.
        compression="zstd" if many else "none",
        use_dictionary=many,
        write_statistics=many,
        write_page_checksum=True,
    )
    return bytes(file.getvalue())
