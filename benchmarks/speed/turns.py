"""A family of pairs put to all peers in turn, in a process of its own that is bound to one processor.

Times are of the processor, so that other processes do not count. Peers that have threads of their own are asked again,
by the clock, in a process that has all processors. Every answer is compared with the exact truth. A peer that ends the
process or takes too long is named.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from statistics import mean
from typing import Any

import numpy as np

from harness.bodies import Unfit, is_round
from harness.command import Wrong
from harness.peers import TIMED, Asked, Setting, quantity
from harness.timing import Clock, in_turn, on_one_processor, quartiles, timed
from harness.watched import Watched
from overlapper import overlap, overlaps
from speed.workloads import Pair, pairs_of

# Relative: what this package keeps for polyhedra.
OURS = Fraction(1, 10**12)

# s of the processor: a setting is not asked if the one before took longer for a pair; none may take longer than the
# second, all pairs together.
DEAR, TIME_LIMIT = 0.25, 20

# s, after which a process is taken to hang, however busy the machine is.
PATIENCE = 600.0

SAMPLE = 2e-3  # s, the least that is timed at once
SLOW = 0.2  # s: pairs that take longer together are as many as there need be, and are timed once

TRUTHS = ("volume", "volume_within", "volume_of_points", "depth", "depth_of_points")


@dataclass
class Row:
    """A line of the results: the time of one pair and the largest error, relative, over the pairs of a family."""

    family: str
    pairs: int | str
    method: str
    setting: str
    quantity: str
    us: str = ""  # median of the samples; empty without samples
    us_low: str = ""  # quartiles
    us_high: str = ""
    samples: int | str = 0
    error: str = ""
    facets: str = ""  # of what is common to a pair, the mean; empty for round shapes
    note: str = ""


def rows_of(family: str, pairs: list[Pair], methods: Iterable[str], seconds: float) -> list[Row]:
    """A row for each method and setting. `seconds` is about what the rounds take. Raises Wrong."""
    facets = check_ours(family, pairs)
    # Found once, and not in every process.
    truths = [{name: getattr(pair, name) for name in TRUTHS} for pair in pairs]
    rows = []
    for by_clock in (False, True):
        asked = [name for name in methods if TIMED[name].by_clock == by_clock]
        rows += rows_in_turn(family, pairs, truths, asked, seconds / 4 if by_clock else seconds)
    for row in rows:
        row.facets = facets
    return rows


def check_ours(family: str, pairs: list[Pair]) -> str:
    """Every volume within its own bound, polyhedra right to 1e-12, and the same bits from the batch. Returns how many
    facets the common sets have on average."""
    facets = []
    for i, pair in enumerate(pairs):
        round_ = any(map(is_round, pair.bodies))
        for tolerance in (1e-1, 1e-3):
            alone = overlap(*pair.bodies, tolerance=tolerance)
            off = abs(Fraction(alone.volume) - pair.volume)
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


def rows_in_turn(family: str, pairs: list[Pair], truths: list[dict], names: list[str], seconds: float) -> list[Row]:
    rows: list[Row] = []
    quick: dict[tuple[str, Setting], Row] = {}
    first = (len, family, truths)
    with Watched(of_pairs, TIME_LIMIT, first, PATIENCE) as process:
        for name in names:
            dear = ""
            for setting in TIMED[name].settings_for(pairs[0].bodies):
                row = Row(family, len(pairs), name, shown(setting), quantity(name), note=dear)
                rows.append(row)
                if dear:
                    continue
                took = first_time(process, family, truths, row, setting)
                if took * row.pairs <= SLOW:
                    quick[name, setting] = row
                if took > DEAR:
                    dear = f"not asked: {row.setting} takes {took:.1f} s"
    if quick:
        with Watched(of_pairs, PATIENCE + 2 * seconds, first) as process:
            samples = process.ask(take_turns, family, truths, list(quick), seconds)
        if isinstance(samples, str):
            raise RuntimeError(f"{family}: the process ended ({samples}) while the methods took turns")
        for row, of_row in zip(quick.values(), samples):
            row.us, row.us_low, row.us_high = (f"{1e6 * each:.4g}" for each in quartiles(of_row))
            row.samples = len(of_row)
    return rows


def first_time(process: Watched, family: str, truths: list[dict], row: Row, setting: Setting) -> float:
    """Seconds for a pair when it is asked first. The row gets the time and the error; nan and a note if it failed."""
    try:
        found = process.ask(first_answers, family, truths, row.method, setting)
    except ModuleNotFoundError as error:
        found = f"missing: {error.name}"
    if isinstance(found, str):
        row.note = found
        return np.nan
    took, row.pairs, row.error, row.note = found
    row.us, row.samples = f"{1e6 * took:.4g}", 1
    return took


def shown(setting: Setting) -> str:
    return "" if setting is None else f"{setting:g}" if isinstance(setting, float) else str(setting)


# In the process


def of_pairs(question: Callable[..., Any], family: str, truths: list[dict], *arguments: Any) -> Any:
    pairs = pairs_in_process(family)
    for pair, known in zip(pairs, truths):
        pair.__dict__.update(known)
    return question(pairs, *arguments)


pairs_in_process = lru_cache(1)(pairs_of)


def first_answers(pairs: list[Pair], name: str, setting: Setting) -> tuple[float, int, str, str] | str:
    """Seconds for a pair, how many pairs were asked, the largest error and a note; or why nobody was asked. If pairs
    are slow, the first ones have to do."""
    peer, clock, answers, note, took = TIMED[name], bound(name), [], "", 0.0
    truths = [truth_for(name, pair) for pair in pairs]
    try:
        if truths[0] is None:
            raise Unfit("no exact depth")
        if peer.together:
            call = peer.prepare([pair.bodies for pair in pairs], setting)
            took = timed(lambda: answers.extend(call()), clock)
            return took / len(answers), len(pairs), worst(answers[: len(pairs)], truths), ""
        for pair in pairs:
            call = peer.prepare(pair.bodies, setting)
            took += timed(lambda: answers.append(call()), clock)  # noqa: B023
            if took > SLOW and len(pairs) > 1:
                note = "first pairs only" if len(answers) > 1 else "first pair only"
                break
    except Unfit as why:
        return f"not asked: {why}"
    signed = answers if quantity(name) == "volume" else [-float(answer) for answer in answers]
    return took / len(answers), len(answers), worst(signed, truths), note


def take_turns(pairs: list[Pair], chosen: list[tuple[str, Setting]], seconds: float) -> list[list[float]]:
    """Seconds for a pair, all samples of each method at its setting."""
    prepared = [all_calls(pairs, name, setting) for name, setting in chosen]
    clock = bound(chosen[0][0])
    samples = in_turn([call for call, _ in prepared], 3, seconds / len(prepared), SAMPLE, clock)
    return [[sample / answers for sample in of_call] for of_call, (_, answers) in zip(samples, prepared)]


def all_calls(pairs: list[Pair], name: str, setting: Setting) -> tuple[Asked, int]:
    """A call about all pairs, and how many answers it gives. It has been made once."""
    peer = TIMED[name]
    if peer.together:
        call = peer.prepare([pair.bodies for pair in pairs], setting)
        return call, len(call())
    calls = [peer.prepare(pair.bodies, setting) for pair in pairs]

    def ask_all() -> None:
        for call in calls:
            call()

    ask_all()
    return ask_all, len(calls)


def bound(name: str) -> Clock:
    """The clock of a peer; the process is bound to one processor unless the peer is to have all."""
    if TIMED[name].by_clock:
        return time.perf_counter
    on_one_processor()
    return time.process_time


def truth_for(name: str, pair: Pair) -> Fraction | None:
    if quantity(name) == "depth":
        return pair.depth if TIMED[name].posed else pair.depth_of_points
    return pair.volume if TIMED[name].posed else pair.volume_of_points


def worst(answers: Iterable[float], truths: list[Fraction]) -> str:
    """The largest error of the answers, relative to the truth."""
    return f"{max(error_of(float(answer), truth) for answer, truth in zip(answers, truths)):.2e}"


def error_of(answer: float, truth: Fraction) -> float:
    if not np.isfinite(answer) or truth == 0:
        return 0.0 if answer == truth else np.inf
    return float(abs(Fraction(answer) - truth) / truth)
