"""A task as the bytes of Parquet files: a row of what it came to, and the rows of the steps that are kept."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from overlapper.install import hint
from overlapper.sweep.measures import FORCES, MEASURES
from overlapper.tables.table import COLUMNS
from overlapper.tables.table import FORCES as FORCE_COLUMNS

if TYPE_CHECKING:
    from overlapper.scenes.parameters import Parameter
    from overlapper.tables.table import Row

# The name of the task, and of the tables in which tasks are.
TASK = "task"
TASKS, STEPS, FAILURES = "tasks", "steps", "failures"

# The columns of a task that failed: our word and sentence, and its own traceback.
FAILED: dict[str, type] = {"what": str, "sentence": str, "traceback": str}

OF: dict[str, Mapping[str, type]] = {TASKS: MEASURES, STEPS: COLUMNS, FAILURES: FAILED}

# The columns that volumetric contact adds to them.
FORCES_OF: dict[str, Mapping[str, type]] = {TASKS: FORCES, STEPS: FORCE_COLUMNS, FAILURES: {}}


def arrow() -> Any:
    """pyarrow with its Parquet; ImportError without it."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise ImportError(f"a sweep needs {hint('pyarrow')}") from error
    return pyarrow


def must_be_no_columns(defaults: Mapping[str, Parameter]) -> None:
    """ValueError if a parameter has the name of a column of ours."""
    for table, columns in OF.items():
        if taken := defaults.keys() & {TASK, *columns, *FORCES_OF[table]}:
            raise ValueError(f"the parameter {min(taken)!r} has the name of a column of the table of {table}")


def part(
    table: str,
    name: str,
    parameters: Mapping[str, Parameter],
    rows: Iterable[Row],
    heading: Mapping[str, str],
) -> bytes:
    """A Parquet file with the name and the parameters of a task in every row; equal rows are equal bytes.

    `heading` says what the study is of: with volumetric contact, there are columns of forces.
    """
    pyarrow = arrow()
    kinds = {int: pyarrow.int64(), float: pyarrow.float64(), str: pyarrow.string(), bool: pyarrow.bool_()}
    columns = {TASK: str, **{each: type(value) for each, value in parameters.items()}, **OF[table]}
    if heading.get("contact") == "volumetric":
        columns |= FORCES_OF[table]
    schema = pyarrow.schema([(column, kinds[kind]) for column, kind in columns.items()], dict(heading))
    which = {TASK: name, **parameters}
    filled = pyarrow.Table.from_pylist([{**which, **row} for row in rows], schema=schema)
    file = pyarrow.BufferOutputStream()
    many = len(filled) > 1
    pyarrow.parquet.write_table(
        filled,
        file,
        # Compressing a single row makes the file larger, and takes a millisecond.
        compression="zstd" if many else "none",
        use_dictionary=many,
        write_statistics=many,
        write_page_checksum=True,
    )
    return bytes(file.getvalue())
