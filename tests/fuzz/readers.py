"""Fuzzers of readers: a file with any bytes is read, or refused in one sentence that names the file.

    make fuzz FUZZERS="tables expected meshes"

The first letter of an input is the form of the file, the rest is its content. atheris sees which lines of Python an
input reaches. With OVERLAPPER_FUZZ_PRINT set, each answer is printed.
"""

from __future__ import annotations

import io
import logging
import os
import sys
import tempfile
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import atheris  # libFuzzer itself comes by LD_PRELOAD, beside AddressSanitizer

# atheris cannot see into modules from the finder of an editable installation, so the finder is the last to be asked. It
# still finds the core.
sys.meta_path.sort(key=lambda finder: "ScikitBuild" in type(finder).__name__)
sys.path.insert(0, str(Path(__file__).parents[2]))

with atheris.instrument_imports(include=["overlapper", "trimesh"]):
    from overlapper.polytopes import mesh_file
    from overlapper.polytopes.shape_text import text_of
    from overlapper.printable import printable
    from overlapper.tables.table import Row, Value
    from overlapper.tables.table_file import KNOWN, TABLES, read_content
    from overlapper.verdicts.expected import Expected, expected_in

LONGEST = 2000  # characters of a refusal


class Reader(NamedTuple):
    """A reader: the forms of its files by their letters, and what is asked of such a file.

    A form is an ending, and the bytes of a file from those of an input. `ask` raises ValueError for a file that is
    refused, and AssertionError for a wrong answer. It returns what it found, in a word.
    """

    forms: dict[str, tuple[str, Callable[[bytes], bytes]]]
    ask: Callable[[Path], str]


def exact(value: Value) -> str:
    """A value as text that has all its bits. CSV has no other text than what can be printed, and no empty text."""
    return repr((printable(value) or None) if isinstance(value, str) else value)


def exact_rows(rows: list[Row]) -> list[dict[str, str]]:
    return [{name: exact(value) for name, value in row.items()} for row in rows]


def ask_table(path: Path) -> str:
    """The rows, written as a table of each kind and read again, have the same bits."""
    rows = read_content(path).rows
    if not rows:
        return "no rows"
    whole = [value for row in rows for value in row.values() if type(value) is int]
    for ending, kind in TABLES.items():
        if ending == ".parquet" and any(not -(2**31) <= value < 2**31 for value in whole):
            continue
        copy = path.with_name(f"copy{ending}")
        table = kind(copy, {}, {name: KNOWN[name] for name in rows[0]})
        table.write(rows)
        table.close()
        assert exact_rows(read_content(copy).rows) == exact_rows(rows), f"{ending} has other rows"
    return f"{len(rows)} rows"


def described(expected: Expected) -> Any:
    stills = {
        step: (still.keys, [*map(text_of, still.shapes)], still.positions.tobytes(), still.orientations.tobytes())
        for step, still in expected.stills.items()
    }
    return expected.steps, expected.tolerance, expected.budgets, exact_rows(expected.rows), stills


def ask_expected(path: Path) -> str:
    """An expected file, written and read again, is the same."""
    expected = expected_in(read_content(path), path)
    copy = path.with_name("copy.csv")
    expected.write(copy, {})
    assert described(expected_in(read_content(copy), copy)) == described(expected), "the copy is another"
    return f"{len(expected.rows)} rows"


def ask_mesh(path: Path) -> str:
    """Each function either answers or refuses, whatever the others do; the file is refused if all of them refuse it."""
    answers, refusals = [], []
    for read in (mesh_file.read_parts, mesh_file.read_triangles, mesh_file.read_hull):
        try:
            read(path)
            answers.append(read.__name__)
        except ValueError as refusal:
            check_refusal(str(refusal), path)
            refusals.append(refusal)
    if not answers:
        raise refusals[0]
    return " ".join(answers)


def as_text(data: bytes) -> bytes:
    """Text for any bytes: hardly any bytes are UTF-8."""
    return data.decode("latin-1").encode()


def packed(text: bytes) -> bytes:
    """A 3MF package with this model: hardly any changed package can be unpacked."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as package:
        package.writestr("3D/3dmodel.model", text)
    return file.getvalue()


TABLE = {"c": (".csv", bytes), "t": (".csv", as_text), "p": (".parquet", bytes), "s": (".sqlite", bytes)}
# STEP is left out: OpenCASCADE reads it in a process of its own, as it may crash.
MESH = {"o": ".obj", "f": ".off", "p": ".ply", "s": ".stl", "b": ".glb", "g": ".gltf"}
READERS = {
    "tables": Reader(TABLE, ask_table),
    "expected": Reader({"c": (".csv", bytes), "t": (".csv", as_text)}, ask_expected),
    "meshes": Reader({name: (ending, bytes) for name, ending in MESH.items()} | {"m": (".3mf", packed)}, ask_mesh),
}


def check_refusal(said: str, path: Path) -> None:
    assert said.startswith(str(path)) and said.isprintable() and len(said) < LONGEST, f"a bad refusal: {said!r}"


def answer(reader: Reader, data: bytes, folder: Path) -> str | None:
    """The answer to an input, or the sentence of its refusal; None if no form has its letter."""
    ending, made = reader.forms.get(data[:1].decode("latin-1"), ("", bytes))
    if not ending:
        return None
    path = folder / f"input{ending}"
    path.write_bytes(made(data[1:]))
    try:
        return reader.ask(path)
    except ValueError as refusal:
        check_refusal(str(refusal), path)
        return str(refusal)


def main(arguments: list[str]) -> None:
    reader = READERS[arguments[1]]
    shared = Path("/dev/shm")  # files in memory
    folder = tempfile.mkdtemp(dir=shared if shared.is_dir() else None)

    def ask(data: bytes) -> int:
        said = answer(reader, data, Path(folder))
        if "OVERLAPPER_FUZZ_PRINT" in os.environ:
            print(said)
        return -1 if said is None else 0  # such an input joins no corpus

    mesh_file.confined = lambda parse, *arguments: parse(*arguments)  # not in another process, where nobody counts
    warnings.simplefilter("ignore")
    logging.disable()  # of trimesh
    atheris.Setup([arguments[0], *arguments[2:]], ask)
    atheris.Fuzz()


if __name__ == "__main__":
    main(sys.argv)
