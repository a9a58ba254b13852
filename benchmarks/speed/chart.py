"""Speed against accuracy: peers and this package asked the same in one interleaved run, and the charts of it.

    python benchmarks chart                       all again, then the page and its pictures
    python benchmarks chart --page                only the page and its pictures, from the results there are
    python benchmarks chart --family "box deep"   one family alone

Writes speed.csv (a line for each family, method and setting) and groups.csv (a line for each number of bodies and
method) to benchmarks/results/MACHINE, and the page speed.md with its pictures to docs. Every answer is compared with
the exact truth: a peer that is wrong is shown as wrong; if this package is, the run ends there.
"""

from __future__ import annotations

import os
import sys
import time
from argparse import ArgumentParser, Namespace
from dataclasses import astuple, fields
from pathlib import Path

from harness import results
from harness.peers import FEW, TIMED
from harness.timing import on_one_processor
from speed import groups
from speed.turns import Row, rows_of
from speed.workloads import FAMILIES, MORE, pairs_of

RESULTS = results.of_machine("speed.csv")
PAGE = "speed.page"


def options(parser: ArgumentParser) -> None:
    names = [*FAMILIES, *MORE]
    parser.add_argument("--family", action="append", choices=names, help="measure this one; may be repeated")
    parser.add_argument("--method", action="append", choices=TIMED, help="ask this one; may be repeated")
    parser.add_argument("--seconds", type=float, default=4.0, help="about so long the methods take turns on a family")


def measure(chosen: Namespace, path: Path) -> None:
    """All there is to measure, or the families chosen and nothing else."""
    note = f"{results.machine()}; {time.strftime('%Y-%m-%d')}; load {os.getloadavg()[0]:.0f}; {results.packages()}"
    missing = set()
    with results.writing(path, [field.name for field in fields(Row)], note) as write:
        for name in chosen.family or [*FAMILIES, *MORE]:
            begin = time.perf_counter()
            asked = [method for method in chosen.method or TIMED if name in FAMILIES or method in FEW]
            rows = rows_of(name, pairs_of(name), asked, chosen.seconds)
            # Each family at once, so that a run that ends has lost nothing.
            write(map(astuple, rows))
            print(f"{name}: {time.perf_counter() - begin:.0f} s", file=sys.stderr)
            missing |= {f"{row.method} ({row.note})" for row in rows if row.note.startswith("missing")}
    print(*(f"Missing: {line}" for line in sorted(missing)), sep="\n", end="\n" * bool(missing))
    if chosen.family or chosen.method:
        return
    on_one_processor()
    with results.writing(path.with_name("groups.csv"), groups.Row._fields, note) as write:
        for group in groups.measured(chosen.seconds / 8):
            write([group])
