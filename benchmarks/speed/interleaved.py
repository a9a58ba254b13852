"""A family of pairs put to all methods in turn, in a process of its own that is bound to one processor.

Times are of the processor, so that what else the machine does counts for nobody. Methods that have threads of their own
are asked again, by the clock, in a process that has all processors. Every answer is compared with the
exact truth. A method that ends the process or takes too long is named, and the family begun again without it.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from multiprocessing.connection import Connection
from statistics import mean, median, quantiles
from typing import Any

import numpy as np
import workloads
from timed_peers import METHODS, Asked, Setting, Unfit

from overlapper import overlap, overlaps

# Relative: what this package keeps for polyhedra.
OURS = Fraction(1, 10**12)

# s of the processor: a setting is not asked if the one before took longer for a pair; none may take longer than the
# second, all pairs together.
DEAR, TIME_LIMIT = 0.25, 20

# s, after which a process is taken to hang, however busy the machine is.
PATIENCE = 600.0

TRUTHS = ("volume", "volume_within", "volume_of_points", "depth", "depth_of_points")

SAMPLE = 2e-3  # s, the least that is timed at once
SLOW = 0.2  # s: pairs that take longer together are as many as there need be, and are timed once


@dataclass
class Row:
    """A line of the results: the time of one pair and the largest error, relative, over the pairs of a family."""

    family: str
    pairs: int
    method: str
    setting: str
    quantity: str
    us: str = ""  # median of the samples; empty if there are none
    us_low: str = ""  # quartiles
    us_high: str = ""
    samples: int = 0
    error: str = ""
    facets: str = ""  # of what is common to a pair, the mean; empty for round shapes
    note: str = ""


class Wrong(Exception):
    """This package's answer is not what it claims."""


@dataclass(eq=False)
class Entry:
    """One method at one setting, prepared for some pairs of the family."""

    row: Row
    calls: list[Asked]
    answers: int  # pairs answered by all calls together
    seconds: float  # for all of them, the last time
    samples: list[float]  # s for a pair
    spent: float = 0.0  # s, by all samples

    def sample(self) -> None:
        """Times all calls, repeated until it is long enough to be timed."""
        repeats, clock = max(1, int(SAMPLE / max(self.seconds, 1e-9))), clock_of(self.row.method)
        begin = clock()
        for _ in range(repeats):
            for call in self.calls:
                call()
        took = clock() - begin
        self.spent += took
        self.seconds = took / repeats
        self.samples.append(self.seconds / self.answers)


def clock_of(method: str) -> Callable[[], float]:
    return time.perf_counter if METHODS[method].by_clock else time.process_time


# In the process


def measure(pipe: Connection, family: str, truths: list[dict], methods: list[str], ended: dict, seconds: float) -> None:
    """Sends what is about to be asked, and in the end the rows, or in which way this package is wrong."""
    quiet(any(METHODS[method].by_clock for method in methods))
    pairs = workloads.pairs_of(family)
    for pair, known in zip(pairs, truths):
        pair.__dict__.update(known)
    try:
        facets = check_ours(family, pairs)
        entries, rows = first_answers(pipe, family, pairs, methods, ended)
        pipe.send(("asking", ("", None)))
        take_turns(entries, seconds)
        for entry in entries:
            finish(entry)
        for row in rows:
            row.facets = facets
        pipe.send(("rows", rows))
    except Wrong as wrong:
        pipe.send(("wrong", str(wrong)))


def quiet(on_all_processors: bool = False) -> None:
    """Without a word, and on one processor."""
    if not on_all_processors:
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for descriptor in (1, 2):
        os.dup2(nowhere, descriptor)
    warnings.simplefilter("ignore")


def check_ours(family: str, pairs: list[workloads.Pair]) -> str:
    """Every volume within its own bound, polyhedra right to 1e-12, and the same bits from the batch. Returns how many
    facets what is common has, on average."""
    facets = []
    for i, pair in enumerate(pairs):
        for tolerance in (1e-1, 1e-3):
            alone = overlap(*pair.bodies, tolerance=tolerance)
            off = abs(Fraction(alone.volume) - pair.volume)
            round_ = any(map(workloads.is_round, pair.bodies))
            if off > Fraction(alone.volume_error) + pair.volume_within or (off > OURS * pair.volume and not round_):
                raise Wrong(f"{family} {i}: {alone.volume!r} ± {alone.volume_error:.1g}, truly {float(pair.volume)!r}")
            a, b = pair.bodies
            poses = [a.position, b.position], [a.orientation, b.orientation]
            many = overlaps([a.shape, b.shape], *poses, [[0, 1]], tolerance)
            if many.volume[0] != alone.volume:
                raise Wrong(f"{family} {i}: {many.volume[0]!r} in a batch, {alone.volume!r} alone")
        if not round_:
            facets.append(len(alone.facets))
    return f"{mean(facets):.4g}" if facets else ""


def first_answers(
    pipe: Connection, family: str, pairs: list[workloads.Pair], methods: list[str], ended: dict
) -> tuple[list[Entry], list[Row]]:
    entries, rows = [], []
    for name in methods:
        dear = ""
        for setting in settings(name, pairs):
            row = Row(family, len(pairs), name, shown(setting), METHODS[name].quantity)
            rows.append(row)
            row.note = ended.get((name, setting), "") or dear
            if row.note:
                continue
            pipe.send(("asking", (name, setting)))
            try:
                entry = prepared(row, pairs, setting)
            except ModuleNotFoundError as error:
                row.note = f"missing: {error.name}"
            except Unfit as why:
                row.note = f"not asked: {why}"
            except Exception as error:
                row.note = f"raises {type(error).__name__}"
            else:
                entries.append(entry)
                if entry.seconds > DEAR * entry.answers:
                    dear = f"not asked: {row.setting} takes {entry.seconds / entry.answers:.1f} s"
    return entries, rows


def settings(name: str, pairs: list[workloads.Pair]) -> tuple[Setting, ...]:
    return METHODS[name].settings_for(pairs[0])


def shown(setting: Setting) -> str:
    return "" if setting is None else f"{setting:g}" if isinstance(setting, float) else str(setting)


def prepared(row: Row, pairs: list[workloads.Pair], setting: Setting) -> Entry:
    """The method asked once about each pair; about the first alone if it is slow. Raises what it raises."""
    method = METHODS[row.method]
    truths = [truth_for(row, pair) for pair in pairs]
    if truths[0] is None:
        raise Unfit("no exact depth")
    if method.together:
        call = method.prepare(pairs, setting)
        begin = time.process_time()
        answers = call()
        took = time.process_time() - begin
        row.error = worst(answers[: len(pairs)], truths)
        return Entry(row, [call], len(answers), took, [])
    calls, found, took, clock = [], [], 0.0, clock_of(row.method)
    for pair in pairs:
        calls.append(method.prepare(pair, setting))
        begin = clock()
        found.append(calls[-1]())
        took += clock() - begin
        if took > SLOW and len(pairs) > 1:
            row.note, row.pairs = "first pairs only" if len(calls) > 1 else "first pair only", len(calls)
            break
    row.error = worst(found, truths)
    return Entry(row, calls, len(calls), took, [])


def truth_for(row: Row, pair: workloads.Pair) -> Fraction | None:
    posed = METHODS[row.method].posed
    if row.quantity == "depth":
        return pair.depth if posed else pair.depth_of_points
    return pair.volume if posed else pair.volume_of_points


def worst(answers: Any, truths: list[Fraction]) -> str:
    """The largest error of the answers, relative to the truth."""
    return f"{max(error_of(float(answer), truth) for answer, truth in zip(answers, truths)):.2e}"


def error_of(answer: float, truth: Fraction) -> float:
    if not np.isfinite(answer) or truth == 0:
        return 0.0 if answer == truth else np.inf
    return float(abs(Fraction(answer) - truth) / truth)


def take_turns(entries: list[Entry], seconds: float) -> None:
    """Rounds in which every entry is timed once, until its share of the time is spent, and three times at least. For
    slow ones, the first answer has to do."""
    waiting = [entry for entry in entries if entry.seconds <= SLOW]
    for entry in entries:
        if entry not in waiting:
            entry.samples.append(entry.seconds / entry.answers)
    share = seconds / max(1, len(waiting))
    while waiting:
        for entry in waiting:
            entry.sample()
        waiting = [entry for entry in waiting if entry.spent < share or len(entry.samples) < 3]


def finish(entry: Entry) -> None:
    entry.row.us = f"{1e6 * median(entry.samples):.4g}"
    if len(entry.samples) > 1:
        low, _, high = quantiles(entry.samples, n=4, method="inclusive")
        entry.row.us_low, entry.row.us_high = f"{1e6 * low:.4g}", f"{1e6 * high:.4g}"
    entry.row.samples = len(entry.samples)


# All that is done about one family


def rows_of(family: str, pairs: list[workloads.Pair], methods: Iterable[str], seconds: float) -> list[Row]:
    """A row for each method and setting. `seconds` is about what the rounds take. Raises Wrong."""
    # Here, so that no process that is begun again has to find them once more.
    truths = [{name: getattr(pair, name) for name in TRUTHS} for pair in pairs]
    rows = []
    for by_clock in (False, True):
        asked = [method for method in methods if METHODS[method].by_clock == by_clock]
        if asked:
            rows += rows_in_a_process(family, pairs, truths, asked, seconds / 4 if by_clock else seconds)
    return rows


def rows_in_a_process(
    family: str, pairs: list[workloads.Pair], truths: list[dict], methods: list[str], seconds: float
) -> list[Row]:
    """Begun again if it ends, without the method that ended it."""
    ended: dict[tuple[str, Setting], str] = {}
    while True:
        outcome = measured(family, truths, methods, ended, seconds)
        if isinstance(outcome, list):
            return outcome
        asked, how = outcome
        if asked in ended or asked not in {(name, setting) for name in methods for setting in settings(name, pairs)}:
            raise RuntimeError(f"{family}: the process ended ({how}) while the methods took turns")
        ended[asked] = how


def used_by(pid: int) -> float:
    """s of the processor; a limit set by setrlimit would do without this, but makes the clock coarse."""
    return time.clock_gettime((~pid << 3) | 2)  # the clock of another process, as clock_getcpuclockid has it


def measured(
    family: str, truths: list[dict], methods: list[str], ended: dict, seconds: float
) -> list[Row] | tuple[tuple[str, Setting], str]:
    """The rows; or what was asked last when the process ended, and how it did."""
    context = multiprocessing.get_context("spawn")
    pipe, other = context.Pipe()
    process = context.Process(target=measure, args=(other, family, truths, methods, ended, seconds), daemon=True)
    process.start()
    other.close()
    asked: tuple[str, Setting] = ("", None)
    used = 0.0  # of the processor, when that was asked
    try:
        while True:
            deadline = time.monotonic() + PATIENCE
            while not pipe.poll(1.0):
                if time.monotonic() > deadline:
                    return asked, "hangs"
                if asked[0] and used_by(process.pid) > used + TIME_LIMIT:
                    return asked, f"not waited for beyond {TIME_LIMIT} s"
            kind, content = pipe.recv()
            if kind == "rows":
                return content
            if kind == "wrong":
                raise Wrong(content)
            asked, used = content, used_by(process.pid)
    except (EOFError, ConnectionResetError):
        process.join()
        code = process.exitcode or 0
        return asked, f"crash {signal.Signals(-code).name if code < 0 else code}"
    finally:
        process.kill()
        process.join()
