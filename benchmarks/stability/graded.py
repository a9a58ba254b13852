"""Graded contacts of every pair of kinds of shapes, by the rules of tests/support/graded.py.

    python benchmarks graded --count 20000                    the classes in turn, from seed 0 on
    python benchmarks graded --first 500 --pairs "box, ball"  other seeds, one class
    python benchmarks graded --proved 10                      every tenth volume is proved, which takes up to seconds

Contacts are judged in processes that are watched, so that a crash or a hang of the core is a result. Rows are written
as they come; a contact again: `graded.made(KINDS, SEED)`. The table at the end has the worst of every class. The
command fails if a rule is broken.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from functools import partial
from itertools import islice
from pathlib import Path
from statistics import median

import graded
import numpy as np

from harness.command import ROOT
from harness.page import table
from stability.stress import Job, Row, run

ROWS = ROOT / "out" / "graded.csv"

# Numbers of a row, and how the table calls the largest.
WORST = {
    "off": "error of a volume",
    "share": "of the stated error",
    "stated": "stated error",
    "depth off": "error of a depth, in sizes",
    "ms": "ms",
    "proof s": "s of a proof",
    "proof width": "width of a proof",
}
COLUMNS = ("family", "seed", "detail", "depth", "status", "way", *WORST, "broken")


def jobs(first: int, classes: list[str]) -> Iterator[Job]:
    """Without end: the classes in turn, seed by seed."""
    seed = first
    while True:
        for kinds in classes:
            yield kinds, seed
        seed += 1


def judged(kinds: str, seed: int, proved: int) -> Row:
    """A row of the results."""
    contact = graded.made(kinds, seed)
    result = graded.judge(contact, proved > 0 and seed % proved == 0)
    found = result.found
    numbers = {
        "off": result.off,
        "share": result.share,
        "stated": found.volume_error / found.volume if found else None,
        "depth off": result.depth_off,
        "ms": 1e3 * result.seconds,
        "proof s": result.proof_seconds,
        "proof width": result.proof_width,
    }
    row: Row = {"detail": contact.detail, "depth": f"{contact.depth:.2g}", "status": found.status, "way": found.way}
    row |= {name: f"{number:.2g}" for name, number in numbers.items() if number is not None}
    row["broken"] = "; ".join(result.complaints)
    return row


def summary(kinds: str, group: list[Row]) -> Row:
    line: Row = {"pairs": kinds, "cases": len(group)}
    line["overlapping"] = sum(row.get("status") == "overlapping" for row in group)
    line["proved"] = sum("off" in row for row in group)
    for name, title in WORST.items():
        numbers = [float(row[name]) for row in group if name in row]
        line[title] = f"{max(numbers):.2g}" if numbers else ""
    times = [float(row["ms"]) for row in group if "ms" in row]
    line["median ms"] = f"{median(times):.2g}" if times else ""
    line["failures"] = sum(bool(row["broken"]) for row in group)
    return line


def options(parser: ArgumentParser) -> None:
    parser.add_argument("--first", type=int, default=0, help="the seed to begin with")
    parser.add_argument("--count", type=int, default=1000, help="so many contacts")
    parser.add_argument("--pairs", action="append", choices=graded.CLASSES, help="only this class; repeatable")
    parser.add_argument("--proved", type=int, default=1, help="prove the volumes of every so many seeds; 0 for none")
    parser.add_argument("--workers", type=int, default=2, help="processes at a time")
    parser.add_argument("--out", type=Path, default=ROWS, help="file of the rows")


def main(chosen: Namespace) -> bool:
    """True if a rule is broken."""
    np.seterr(all="ignore")
    classes = chosen.pairs or graded.CLASSES
    wanted = islice(jobs(chosen.first, classes), chosen.count)
    judge = partial(judged, proved=chosen.proved)
    done = run(wanted, chosen.workers, chosen.out, judge, ("box, box", 0), COLUMNS)
    groups: dict[str, list[Row]] = {kinds: [] for kinds in classes}
    for row in done:
        groups[row["family"]].append(row)
    lines = [summary(kinds, group) for kinds, group in groups.items() if group] + [summary("all", done)]
    print(table(list(lines[0]), (map(str, line.values()) for line in lines)))
    return any(row["broken"] for row in done)
