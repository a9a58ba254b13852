"""The executor of one machine: a hand for each core, and a thread for each hand."""

from __future__ import annotations

import os
import queue
import threading
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from overlapper.jobs.executor import Found
from overlapper.jobs.hand import Done, Hand, Job, Outcome
from overlapper.jobs.shares import Shares
from overlapper.jobs.worker import NotStarted

SHARE = 0.2  # s of work that are sent at once

# Outcomes that may wait for whoever writes them down, so that memory is not what a slow disk fills.
WAITING = 64

Report = tuple[int, Outcome] | NotStarted


def cores() -> int:
    """Those that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Processes:
    """Does items in so many processes of this machine, by default one for each core."""

    def __init__(self, workers: int | None = None) -> None:
        self._workers = workers or cores()

    @property
    def workers(self) -> int:
        """How many at a time."""
        return self._workers

    def outcomes(self, job: Job, items: Sequence[Any], limit: float | None = None) -> Found:
        """See Executor."""
        hands = [Hand(job, limit) for _ in range(min(self.workers, len(items)))]
        reports: queue.Queue[Report] = queue.Queue(WAITING)
        shares = Shares(len(items), len(hands), SHARE)
        threads = [threading.Thread(target=_serve, args=(hand, items, shares, reports), daemon=True) for hand in hands]
        try:
            for thread in threads:
                thread.start()
            for _ in items:
                report = reports.get()
                if isinstance(report, NotStarted):
                    raise report
                yield report
        finally:
            for hand in hands:
                hand.stop()
            while any(thread.is_alive() for thread in threads):
                with suppress(queue.Empty):  # whoever waits to report goes on
                    reports.get(timeout=0.01)


def _serve(hand: Hand, items: Sequence[Any], shares: Shares, reports: queue.Queue[Report]) -> None:
    try:
        while share := shares.take():
            outcomes = hand.work([items[number] for number in share])
            for number, outcome in zip(share, outcomes):
                if isinstance(outcome, Done):
                    shares.learn(1, outcome.seconds)
                reports.put((number, outcome))
            if hand.closed:
                return
    except NotStarted as error:
        reports.put(error)
    finally:
        hand.close()
