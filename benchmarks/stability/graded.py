"""Graded contacts of every pair of kinds of shapes, by the rules of tests/support/graded.py.

    python benchmarks graded --count 20000                    the classes in turn, from seed 0 on
    python benchmarks graded --first 500 --pairs "box, ball"  other seeds, one class
    python benchmarks graded --proved 10                      every tenth volume is proved, which takes up to seconds
    python benchmarks graded --volumes                        no depths and no other measures: a tenth of the time
    python benchmarks graded --resume                         goes on where a run ended that was stopped

Contacts are judged in processes that are watched, so that a crash or a hang of the core is a result. A contact or a
proof that takes longer than allowed is a result, too. Rows are written as they come; a contact again:
`graded.made(KINDS, SEED)`. The table at the end has the worst of every class, and --record keeps it in
benchmarks/results. The command fails if a rule is broken.
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

from harness import results
from harness.command import ROOT
from harness.page import table
from stability.stress import TIME_LIMIT, Job, Row, run

ROWS, TABLE = ROOT / "out" / "graded.csv", results.of_machine("graded.csv")

# Numbers of a row, and how the table calls the largest.
WORST = {
    "off": "error of a volume",
    "share": "of the stated error",
    "halves off": "difference of halves",
    "stated": "stated error",
    "depth off": "error of a depth, in sizes",
    "ms": "ms",
    "proof s": "s of a proof",
    "proof width": "width of a proof",
}
COLUMNS = ("family", "seed", "detail", "depth", "status", "way", *WORST, "proof", "broken")
ENDED = "took too long"  # instead of a proof


def jobs(first: int, classes: list[str]) -> Iterator[Job]:
    """Without end: the classes in turn, seed by seed."""
    seed = first
    while True:
        for kinds in classes:
            yield kinds, seed
        seed += 1


def judged(kinds: str, seed: int, proved: int, proof_limit: float, only_volume: bool) -> Row:
    """A row of the results."""
    contact = graded.made(kinds, seed)
    result = graded.judge(contact, proved > 0 and seed % proved == 0, proof_limit, only_volume)
    found = result.found
    numbers = {
        "off": result.off,
        "share": result.share,
        "halves off": result.halves_off,
        "stated": found.volume_error / found.volume if found else None,
        "depth off": result.depth_off,
        "ms": 1e3 * result.seconds,
        "proof s": result.proof_seconds,
        "proof width": result.proof_width,
    }
    row: Row = {"detail": contact.detail, "depth": f"{contact.depth:.2g}", "status": found.status, "way": found.way}
    row |= {name: f"{number:.2g}" for name, number in numbers.items() if number is not None}
    row["proof"] = ENDED if result.proof_ended else ""
    row["broken"] = "; ".join(result.complaints)
    return row


def earlier(path: Path) -> list[Row]:
    """The rows of a run that was stopped, without their empty cells; a last row that is cut is left out."""
    if not path.exists():
        return []
    _, rows = results.read(path)
    whole = [row for row in rows if None not in row.values()]
    return [
        {name: int(cell) if name == "seed" else cell for name, cell in row.items() if cell or name == "broken"}
        for row in whole
    ]


def out_of_time(row: Row) -> bool:
    """Whether the contact was not waited for."""
    return row["broken"].startswith(("not waited for", "hang"))


def summary(kinds: str, group: list[Row]) -> Row:
    late = sum(map(out_of_time, group))
    line: Row = {"pairs": kinds, "cases": len(group), "ran": len(group) - late, "out of time": late}
    line["overlapping"] = sum(row.get("status") == "overlapping" for row in group)
    line["proved"] = sum("off" in row for row in group)
    line["proofs out of time"] = sum(row.get("proof") == ENDED for row in group)
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
    parser.add_argument("--volumes", action="store_true", help="only the rules for volumes")
    parser.add_argument("--limit", type=float, default=TIME_LIMIT, help="s of the processor for a contact")
    parser.add_argument("--proof-limit", type=float, default=TIME_LIMIT / 2, help="s of the processor for a proof")
    parser.add_argument("--workers", type=int, default=2, help="processes at a time")
    parser.add_argument("--out", type=Path, default=ROWS, help="file of the rows")
    parser.add_argument("--resume", action="store_true", help="keep the rows of that file, and run the others")
    parser.add_argument("--record", action="store_true", help=f"keep the table as {TABLE.relative_to(ROOT)}")


def main(chosen: Namespace) -> bool:
    """True if a rule is broken."""
    np.seterr(all="ignore")
    classes = chosen.pairs or graded.CLASSES
    before = earlier(chosen.out) if chosen.resume else []
    known = {(row["family"], row["seed"]) for row in before}
    wanted = (job for job in islice(jobs(chosen.first, classes), chosen.count) if job not in known)
    judge = partial(judged, proved=chosen.proved, proof_limit=chosen.proof_limit, only_volume=chosen.volumes)
    done = run(wanted, chosen.workers, chosen.out, judge, ("box, box", 0), COLUMNS, chosen.limit, before)
    groups: dict[str, list[Row]] = {kinds: [] for kinds in classes}
    for row in done:
        groups[row["family"]].append(row)
    lines = [summary(kinds, group) for kinds, group in groups.items() if group] + [summary("all", done)]
    print(table(list(lines[0]), (map(str, line.values()) for line in lines)))
    if chosen.record:
        asked = "the rules for volumes" if chosen.volumes else "all rules"
        notes = f"seeds from {chosen.first} on, {asked}, proofs of every {chosen.proved}. seed", results.today()
        with results.writing(TABLE, list(lines[0]), *notes) as write:
            write(line.values() for line in lines)
    return any(row["broken"] for row in done)
