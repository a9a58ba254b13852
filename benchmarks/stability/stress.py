"""The rules of tests/support/rules.py on as many hard cases as wanted.

    python benchmarks stress --count 20000                   the families in turn, from seed 0 on
    python benchmarks stress --first 500 --family slivers    other seeds, one family

Cases are judged in processes that are watched, so that a crash or a hang of the core is a result. Rows are written as
they come; a case again: `families.make(FAMILY, SEED)`. The table is printed at the end, and --record keeps it in
benchmarks/results for the stability page. The command fails if a rule is broken.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from itertools import count as counting
from itertools import islice
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import exact
import families
import numpy as np
import rules

from harness import results
from harness.command import ROOT
from harness.page import table
from harness.watched import Watched

ROWS, TABLE = ROOT / "out" / "stress.csv", results.FOLDER / "stress.csv"

# s, for a case with its exact truth and its proof: of the processor, and by the clock of a busy machine
TIME_LIMIT, PATIENCE = 120.0, 1200.0

# Only every so many seeds of a family whose exact truth or proof takes seconds.
EVERY = {
    "fine_round_hulls": 40,
    "finest_round_hulls": 20,
    "prisms": 8,
    "rounded_meshes": 8,
    "round_hulls": 4,
    "many_bodies": 2,
    "lenses": 4,
}

# Proofs of polytopes clip by all their planes, one by one: thousands take minutes.
UNPROVED = ("finest_round_hulls",)

COLUMNS = ("family", "seed", "detail", "parameter", "common", "status", "widened", "error", "share", "broken")

Job = tuple[str, int]
Row = dict[str, Any]
Judge = Callable[[str, int], Row]


def jobs(first: int, names: Iterable[str] = ()) -> Iterator[Job]:
    """Without end: the families in turn, seed by seed."""
    for seed in counting(first):
        for name in names or families.FAMILIES:
            if seed % EVERY.get(name, 1) == 0:
                yield name, seed


def judged(family: str, seed: int) -> Row:
    """A row of the results."""
    case = families.make(family, seed)
    row: Row = {"detail": case.detail, "parameter": f"{case.parameter:.3g}"}
    found = rules.answer(case.placed)
    if not case.round:
        row["common"] = exact.NAMES[case.truth.dimension]
    row["status"], row["widened"] = found.status, "yes" if found.widened else "no"
    if rules.measured(case, found):
        off = rules.volume_off(case, found)
        row["error"] = f"{float(off / case.truth.volume):.1e}"
        row["share"] = f"{float(off / Fraction(found.volume_error)):.1e}"
    asked = rules.UNPROVED if family in UNPROVED else rules.RULES
    row["broken"] = "; ".join(f"{name}: {complaint}" for name, complaint in rules.complaints(case, found, asked))
    return row


# Cases in watched processes


def rows(
    wanted: Iterable[Job], workers: int, judge: Judge, first: Job, time_limit: float = TIME_LIMIT
) -> Iterator[Row]:
    """In the order in which they are finished. `first` is asked before the time counts."""
    waiting, finished = iter(wanted), SimpleQueue[Row | None]()
    todo: SimpleQueue[Job | None] = SimpleQueue()

    def work() -> None:
        with Watched(judge, time_limit, first, PATIENCE) as watched:
            while (job := todo.get()) is not None:
                answer = watched.ask(*job)
                row = answer if isinstance(answer, dict) else {"broken": answer}
                finished.put({"family": job[0], "seed": job[1]} | row)
        finished.put(None)

    with ThreadPoolExecutor(workers) as pool:
        for _ in range(workers):
            pool.submit(work)
            todo.put(next(waiting, None))
        running = workers
        while running:
            row = finished.get()
            if row is None:
                running -= 1
            else:
                todo.put(next(waiting, None))
                yield row


def run(
    wanted: Iterable[Job],
    workers: int,
    path: Path,
    judge: Judge = judged,
    first: Job = ("general", 0),
    columns: Sequence[str] = COLUMNS,
    time_limit: float = TIME_LIMIT,
    before: Iterable[Row] = (),
) -> list[Row]:
    """Rows of an earlier run, `before`, are written again and come first."""
    done = list(before)
    path.parent.mkdir(parents=True, exist_ok=True)
    with results.writing(path, columns) as write:
        write([row.get(column, "") for column in columns] for row in done)
        for row in rows(wanted, workers, judge, first, time_limit):
            write([[row.get(column, "") for column in columns]])
            done.append(row)
            if row["broken"]:
                print(f"{row['family']} {row['seed']}: {row['broken']}", flush=True)
    return done


# The table of the results


def by_family(done: list[Row]) -> list[Row]:
    """A row for each family, and one for all."""
    groups: dict[str, list[Row]] = {}
    for row in done:
        groups.setdefault(row["family"], []).append(row)
    lines = [summary(name, groups[name]) for name in families.FAMILIES if name in groups]
    return [*lines, summary("all", done)]


def summary(name: str, group: list[Row]) -> Row:
    return {
        "family": name,
        "cases": len(group),
        "overlapping": sum(row.get("status") == "overlapping" for row in group),
        "widened": sum(row.get("widened") == "yes" for row in group),
        "worst error": worst(group, "error"),
        "of the stated": worst(group, "share"),
        "failures": sum(bool(row["broken"]) for row in group),
    }


def worst(group: list[Row], column: str) -> str:
    """The largest relative error of a volume, or its share of the stated error."""
    return f"{max(float(row[column]) for row in group if column in row):.1e}" if any(column in r for r in group) else ""


def options(parser: ArgumentParser) -> None:
    parser.add_argument("--first", type=int, default=0, help="the seed to begin with")
    parser.add_argument("--count", type=int, default=1000, help="so many cases")
    parser.add_argument("--family", action="append", choices=list(families.FAMILIES), help="only this one; repeatable")
    parser.add_argument("--workers", type=int, default=2, help="processes at a time")
    parser.add_argument("--out", type=Path, default=ROWS, help="file of the rows")
    parser.add_argument("--record", action="store_true", help=f"keep the table as {TABLE.relative_to(ROOT)}")


def main(chosen: Namespace) -> bool:
    """True if a rule is broken."""
    np.seterr(all="ignore")
    done = run(islice(jobs(chosen.first, chosen.family or ()), chosen.count), chosen.workers, chosen.out)
    lines = by_family(done)
    print(table(list(lines[0]), (map(str, line.values()) for line in lines)))
    if chosen.record:
        with results.writing(TABLE, list(lines[0]), f"seeds from {chosen.first} on") as write:
            write(line.values() for line in lines)
    return any(row["broken"] for row in done)
