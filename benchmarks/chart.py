"""Speed against accuracy: peers and this package asked the same in one interleaved run, and the charts of it.

    python benchmarks/chart.py                       all again, then the page and its pictures
    python benchmarks/chart.py --page                only the page and its pictures, from the results there are
    python benchmarks/chart.py --family "box deep"   one family alone

Writes DIR/speed.csv (a line for each family, method and setting) and what benchmarks/speed_page.py makes of it. Every
answer is compared with the exact truth: a peer that is wrong is shown as wrong; if this package is, the run ends there.
"""

from __future__ import annotations

import argparse
import csv
import os
import platform
import re
import sys
import time
from dataclasses import asdict, fields
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path[:0] = [str(HERE), str(ROOT / "tests")]

try:
    from interleaved import Row, Wrong, rows_of
    from stability import packages
    from timed_peers import FEW, METHODS
    from workloads import FAMILIES, MORE, pairs_of
except ImportError as error:
    print(f"overlapper: the chart needs {error.name}: pip install 'overlapper[bench]'", file=sys.stderr)
    sys.exit(2)


def run(names: list[str], methods: list[str], seconds: float, path: Path) -> None:
    """Writes each family as soon as it is measured, so that a run that ends has lost nothing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        file.write(f"# {machine()}; {time.strftime('%Y-%m-%d')}; {packages()}\n")
        writer = csv.DictWriter(file, [field.name for field in fields(Row)], lineterminator="\n")
        writer.writeheader()
        missing = set()
        for name in names:
            begin = time.perf_counter()
            asked = [method for method in methods if name in FAMILIES or method in FEW]
            rows = rows_of(name, pairs_of(name), asked, seconds)
            writer.writerows(map(asdict, rows))
            file.flush()
            print(f"{name}: {time.perf_counter() - begin:.0f} s", file=sys.stderr)
            missing |= {f"{row.method} ({row.note})" for row in rows if row.note.startswith("missing")}
    print(f"Written: {path}", *(f"Missing: {line}" for line in sorted(missing)), sep="\n")


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


def read(path: Path) -> tuple[list[str], list[Row]]:
    """The comments and the rows of a results file."""
    with path.open(newline="", encoding="utf-8") as file:
        lines = file.readlines()
    notes = [line[2:].strip() for line in lines if line.startswith("# ")]
    table = csv.DictReader(line for line in lines if not line.startswith("# "))
    return notes, [Row(**{**row, "pairs": int(row["pairs"]), "samples": int(row["samples"])}) for row in table]


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
    results = (chosen.out or HERE / "results" / folder_of(machine())) / "speed.csv"
    if not chosen.page:
        try:
            run(chosen.family or [*FAMILIES, *MORE], chosen.method or list(METHODS), chosen.seconds, results)
        except Wrong as wrong:
            print(f"overlapper: wrong: {wrong}", file=sys.stderr)
            sys.exit(1)
    try:
        from speed_page import write_page
    except ImportError as error:
        print(f"overlapper: the pictures need {error.name}: pip install 'overlapper[bench]'", file=sys.stderr)
        sys.exit(2)
    notes, rows = read(results)
    print(f"Written: {write_page(results, chosen.out or ROOT / 'docs', rows, notes)}")


if __name__ == "__main__":
    main()
