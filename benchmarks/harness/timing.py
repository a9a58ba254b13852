"""Clocks: calls that take turns, and the parts of a step."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from statistics import median, quantiles
from typing import Any

Call = Callable[[], Any]
Clock = Callable[[], float]


def on_one_processor() -> None:
    """Binds this process to one processor, so that threads gain nothing."""
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def in_turn(
    calls: Sequence[Call], rounds: int = 3, share: float = 0.0, least: float = 0.0, clock: Clock = time.process_time
) -> list[list[float]]:
    """Seconds of each call, sample by sample. In a round every call is sampled once.

    A call takes part in so many rounds, and in more until its samples have taken its `share` of seconds. It is repeated
    within a sample until the sample takes about `least` seconds. The clock is that of the processor, so that
    other processes do not count, unless another clock is given.
    """
    samples: list[list[float]] = [[] for _ in calls]
    repeats, spent = [1] * len(calls), [0.0] * len(calls)
    if least:
        for k, call in enumerate(calls):
            repeats[k] = max(1, int(least / max(timed(call, clock), 1e-7)))
    waiting = list(range(len(calls)))
    while waiting:
        for k in waiting:
            took = timed(calls[k], clock, repeats[k])
            samples[k].append(took / repeats[k])
            spent[k] += took
        waiting = [k for k in waiting if len(samples[k]) < rounds or spent[k] < share]
    return samples


def timed(call: Call, clock: Clock = time.process_time, repeats: int = 1) -> float:
    """Seconds of one call, or of so many together."""
    if repeats == 1:  # for calls of a microsecond, a loop would count
        begin = clock()
        call()
        return clock() - begin
    begin = clock()
    for _ in range(repeats):
        call()
    return clock() - begin


def quartiles(values: Sequence[float]) -> tuple[float, float, float]:
    """The median, the lower and the upper quartile."""
    low, _, high = quantiles(values, n=4, method="inclusive")
    return median(values), low, high


class Stopwatch:
    """Time by part, in µs, of the processor unless another clock of ns is given. The time of a part is without that of
    the parts that it calls."""

    def __init__(self, clock: Callable[[], int] = time.process_time_ns) -> None:
        self.clock = clock
        self.us: dict[str, float] = {}
        self._within = 0

    def __call__(self, part: str, call: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
        """The answer of the call, whose time counts for the part."""
        outside, self._within = self._within, 0
        begin = self.clock()
        try:
            return call(*args, **kwargs)
        finally:
            took = self.clock() - begin
            self.us[part] = self.us.get(part, 0.0) + (took - self._within) / 1e3
            self._within = outside + took

    def take(self) -> dict[str, float]:
        """The times since the last take."""
        taken, self.us = self.us, {}
        return taken
