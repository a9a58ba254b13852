"""Results files: tables with a comment on the machine and the packages, and where they lie."""

from __future__ import annotations

import csv
import os
import platform
import re
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[1] / "results"

PACKAGES = ("overlapper", "numpy", "scipy", "manifold3d", "trimesh", "python-fcl", "coal", "pybullet")


def machine() -> str:
    """The name of the processor, and how many there are."""
    name = platform.processor() or platform.machine()
    if os.path.exists("/proc/cpuinfo"):
        listed = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text(encoding="utf-8"))
        name = listed[1].strip() if listed else name
    return f"{name}, {os.cpu_count()} cores"


def of_machine(name: str) -> Path:
    """Where this machine keeps a results file of times."""
    return FOLDER / re.sub(r"[^a-z0-9]+", "-", machine().lower()).strip("-") / name


def packages(*more: str) -> str:
    """Installed versions."""

    def found(name: str) -> str:
        try:
            return version(name)
        except PackageNotFoundError:
            return "missing"

    return ", ".join(f"{name} {found(name)}" for name in (*PACKAGES, *more))


def today() -> str:
    """The comment of results that depend on the machine."""
    return f"{machine()}; {time.strftime('%Y-%m-%d')}; Python {platform.python_version()}"


@contextmanager
def writing(path: Path, columns: Sequence[str], *notes: str) -> Iterator[Callable[[Iterable[Sequence]], None]]:
    """A table with comments above. Gives a function that appends rows, which are on disk when it returns."""
    with path.open("w", newline="", encoding="utf-8") as file:
        file.writelines(f"# {note}\n" for note in notes)
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)

        def write(rows: Iterable[Sequence]) -> None:
            writer.writerows(rows)
            file.flush()

        yield write


def read(path: Path) -> tuple[list[str], list[dict[str, str]]]:
    """The comments and the rows of a results file."""
    with path.open(newline="", encoding="utf-8") as file:
        lines = file.readlines()
    notes = [line[2:].strip() for line in lines if line.startswith("# ")]
    return notes, list(csv.DictReader(line for line in lines if not line.startswith("# ")))
