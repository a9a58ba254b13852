"""The executor of one machine: a hand for each core, and a thread for each hand."""

from __future__ import annotations

import os
import queue
import threading
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import suppress
from typing import Any

from overlapper.jobs.executor import Shared
from overlapper.jobs.hand import Done, Hand, Job, Outcome
from overlapper.jobs.patience import Late, Patience
from overlapper.jobs.shares import Shares

SHARE = 0.2  # s of work that are sent at once
LOOK = 1.0  # s: items that are under way are checked at least this often

# The most outcomes that wait to be written, so that a slow disk does not fill the memory.
WAITING = 64

Report = Shared | Exception


def cores() -> int:
    """The number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Processes:
    """Does items in several processes of this machine, by default one for each core."""

    def __init__(self, workers: int | None = None) -> None:
        self._workers = workers or cores()

    @property
    def workers(self) -> int:
        """The number of items at a time."""
        return self._workers

    def shares(
        self, job: Job, items: Sequence[Any], limit: float | None = None, late: Late | None = None
    ) -> Generator[Shared, None, None]:
        """See Executor."""
        hands = [Hand(job, limit) for _ in range(min(self.workers, len(items)))]
        reports: queue.Queue[Report] = queue.Queue(WAITING)
        shares = Shares(len(items), len(hands), SHARE)
        patience = Patience(late)
        rest = job, items, shares, reports, patience
        threads = [threading.Thread(target=_serve, args=(hand, *rest), daemon=True) for hand in hands]
        try:
            for thread in threads:
                thread.start()
            left = len(items)
            while left:
                patience.look()
                try:
                    report = reports.get(timeout=LOOK)
                except queue.Empty:
                    continue
                if isinstance(report, Exception):
                    raise report
                left -= len(report[0])
                yield report
        finally:
            for hand in hands:
                hand.stop()
            while any(thread.is_alive() for thread in threads):
                with suppress(queue.Empty):  # lets threads go on that wait to report
                    reports.get(timeout=0.01)


def _serve(
    hand: Hand, job: Job, items: Sequence[Any], shares: Shares, reports: queue.Queue[Report], patience: Patience
) -> None:
    try:
        while share := shares.take():
            for found in _batches(hand, [(number, items[number]) for number in share], shares, patience):
                reports.put(([number for number, _, _ in found], job.gathered([each[1:] for each in found])))
            if hand.closed:
                return
    except Exception as error:  # the thread that waits for reports must get the error
        reports.put(error)
    finally:
        patience.end(hand)
        hand.close()


def _batches(
    hand: Hand, share: Sequence[tuple[int, Any]], shares: Shares, patience: Patience
) -> Iterator[list[tuple[int, Any, Outcome]]]:
    """Do a share. Yields numbers and items with their outcomes, in batches that took about SHARE seconds each."""
    batch: list[tuple[int, Any, Outcome]] = []
    due = time.monotonic() + SHARE
    following = [*(number for number, _ in share[1:]), None]
    patience.begin(hand, [share[0][0]])
    for (number, item), outcome, after in zip(share, hand.work([item for _, item in share]), following):
        if after is None:
            patience.end(hand)
        else:
            patience.begin(hand, [after])
        if isinstance(outcome, Done):
            shares.learn(1, outcome.seconds)
        batch.append((number, item, outcome))
        if time.monotonic() >= due:
            yield batch
            batch, due = [], time.monotonic() + SHARE
    if batch:
        yield batch
