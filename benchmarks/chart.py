"""Speed against accuracy: peers and this package asked the same in one interleaved run, and the charts of it.

    python benchmarks/chart.py                       all again, then the page and its pictures
    python benchmarks/chart.py --page                only the page and its pictures, from the results there are
    python benchmarks/chart.py --family "box deep"   one family alone

Writes DIR/speed.csv (a line for each family, method and setting), DIR/claims.csv (what the article claims) and what
benchmarks/speed/speed_page.py makes of them. Every answer is compared with the exact truth: a peer that is wrong is
shown as wrong; if this package is, the run ends there.
"""

from __future__ import annotations

import argparse
import csv
import multiprocessing
import os
import platform
import re
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, fields
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path[:0] = [str(HERE), str(HERE / "speed"), str(HERE / "paper"), str(ROOT / "tests" / "support")]

try:
    from interleaved import Row, Wrong, quiet, rows_of
    from paper_claims import CLAIMS, Claim
    from stability import packages
    from timed_peers import FEW, METHODS
    from workloads import FAMILIES, MORE, pairs_of
except ImportError as error:
    print(f"overlapper: the chart needs {error.name}: pip install '.[bench]'", file=sys.stderr)
    sys.exit(2)


def measure_pairs(names: list[str], methods: list[str], seconds: float, path: Path) -> None:
    """Writes each family as soon as it is measured, so that a run that ends has lost nothing."""
    missing = set()
    with results_file(path, Row) as write:
        for name in names:
            begin = time.perf_counter()
            asked = [method for method in methods if name in FAMILIES or method in FEW]
            rows = rows_of(name, pairs_of(name), asked, seconds)
            write(rows)
            print(f"{name}: {time.perf_counter() - begin:.0f} s", file=sys.stderr)
            missing |= {f"{row.method} ({row.note})" for row in rows if row.note.startswith("missing")}
    print(f"Written: {path}", *(f"Missing: {line}" for line in sorted(missing)), sep="\n")


def measure_claims(seconds: float, path: Path) -> None:
    """In a process of its own, as quiet as those of the families."""
    spawn = multiprocessing.get_context("spawn")
    with results_file(path, Claim) as write, ProcessPoolExecutor(1, spawn, quiet) as process:
        for claim in CLAIMS:
            write(process.submit(claim, seconds).result())
    print(f"Written: {path}")


@contextmanager
def results_file(path: Path, line: type) -> Iterator[Callable[[list], None]]:
    """A table with a comment on machine and packages; what it yields appends lines."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        file.write(f"# {machine()}; {time.strftime('%Y-%m-%d')}; load {os.getloadavg()[0]:.0f}; {packages()}\n")
        writer = csv.DictWriter(file, [field.name for field in fields(line)], lineterminator="\n")
        writer.writeheader()

        def write(rows: list) -> None:
            writer.writerows(map(asdict, rows))
            file.flush()

        yield write


def machine() -> str:
    """The processor by its name, and how many there are."""
    name = platform.processor() or platform.machine()
    try:
        listed = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text(encoding="utf-8"))
        name = listed[1].strip() if listed else name
    except OSError:
        pass
    return f"{name}, {os.cpu_count()} cores"


def folder_of(name: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")


def read(path: Path, line: type) -> tuple[list[str], list]:
    """The comments and the lines of a results file."""
    with path.open(newline="", encoding="utf-8") as file:
        text = file.readlines()
    notes = [line[2:].strip() for line in text if line.startswith("# ")]
    whole = [field.name for field in fields(line) if field.type == "int"]
    table = csv.DictReader(line for line in text if not line.startswith("# "))
    return notes, [line(**{**row, **{name: int(row[name]) for name in whole}}) for row in table]


def main() -> None:
    parser = argparse.ArgumentParser(description="Speed against accuracy: peers and this package, asked in turn.")
    parser.add_argument(
        "--family", action="append", choices=[*FAMILIES, *MORE], help="measure this one; may be repeated"
    )
    parser.add_argument("--method", action="append", choices=METHODS, help="ask this one; may be repeated")
    parser.add_argument("--seconds", type=float, default=4.0, help="about so long the methods take turns on a family")
    parser.add_argument("--out", type=Path, help="folder for results and page, by default those of the checkout")
    parser.add_argument("--page", action="store_true", help="only draw the page, from the results there are")
    chosen = parser.parse_args()
    folder = chosen.out or HERE / "results" / folder_of(machine())
    if not chosen.page:
        try:
            measure(chosen, folder)
        except Wrong as wrong:
            print(f"overlapper: wrong: {wrong}", file=sys.stderr)
            sys.exit(1)
    try:
        from speed_page import Results, write_page
    except ImportError as error:
        print(f"overlapper: the pictures need {error.name}: pip install '.[bench]'", file=sys.stderr)
        sys.exit(2)
    named = str(folder.relative_to(ROOT)) if folder.is_relative_to(ROOT) else str(folder)
    print(f"Written: {write_page(Results(named, *results_in(folder)), chosen.out or ROOT / 'docs')}")


def results_in(folder: Path) -> tuple[list[str], list[Row], list[Claim], bool, bool]:
    """Comments and rows, claims if they were measured, and whether steps of a simulation and round bodies were."""
    claims = folder / "claims.csv"
    return (
        *read(folder / "speed.csv", Row),
        read(claims, Claim)[1] if claims.exists() else [],
        (folder / "steps.csv").exists(),
        (folder / "round.csv").exists(),
    )


def measure(chosen: argparse.Namespace, folder: Path) -> None:
    """All there is to measure, or the families chosen and nothing else."""
    families = chosen.family or [*FAMILIES, *MORE]
    measure_pairs(families, chosen.method or list(METHODS), chosen.seconds, folder / "speed.csv")
    if not (chosen.family or chosen.method):
        measure_claims(chosen.seconds / 8, folder / "claims.csv")


if __name__ == "__main__":
    main()
