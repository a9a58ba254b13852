"""The executor of many machines: shares of items as tasks of Ray, each done by a hand beside Ray's own process.

What raises, hangs or dies of an item is the hand's business, as on one machine. A node that is lost loses the shares
that were under way there, and these are sent once more.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence
from typing import Any

from overlapper.install import hint
from overlapper.jobs.executor import Found
from overlapper.jobs.hand import Done, Hand, Job, Outcome
from overlapper.jobs.shares import Shares
from overlapper.jobs.worker import NotStarted
from overlapper.printable import first_line

SHARE = 1.0  # s of work that are sent at once: a task of Ray costs some milliseconds

# Shares that may be lost one after the other, for each worker: no more nodes than that die without a cause.
LOSSES = 10


class Cluster:
    """Does items on a Ray cluster, that at `address` ("auto", or host:port), or one of this machine.

    `workers` is how many items at a time, by default as many as the cluster has CPUs, now and later. NotStarted if
    there is no cluster, ImportError without Ray.
    """

    def __init__(self, address: str | None = None, workers: int | None = None) -> None:
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # what it is used for is nobody's business
        try:
            import ray
        except ImportError as error:
            raise ImportError(f"the engine 'ray' needs {hint('ray')}") from error
        self._ray: Any = ray
        self._asked = workers
        try:
            ray.init(address or "local", log_to_driver=False, logging_level=logging.ERROR, include_dashboard=False)
        except (ConnectionError, RuntimeError, ValueError, OSError) as error:
            raise NotStarted(f"there is no Ray cluster at {address}: {first_line(error)}") from error

    @property
    def workers(self) -> int:
        """How many at a time, as the cluster is now."""
        return self._asked or max(int(self._ray.cluster_resources().get("CPU", 1)), 1)

    def outcomes(self, job: Job, items: Sequence[Any], limit: float | None = None) -> Found:
        """See Executor."""
        ray = self._ray
        # Those that are lost are sent anew by us, who know what has arrived.
        remote = ray.remote(num_cpus=1, max_retries=0)(_work)
        shares = Shares(len(items), self.workers, SHARE)
        under_way: dict[Any, list[int]] = {}
        losses = 0
        try:
            while True:
                # One share more than can be done, so that nobody waits for the next.
                while len(under_way) < 2 * self.workers and (share := shares.take()):
                    under_way[remote.remote(job, [items[number] for number in share], limit)] = share
                if not under_way:
                    return
                for ready in ray.wait([*under_way], num_returns=1)[0]:
                    share = under_way.pop(ready)
                    try:
                        outcomes: list[Outcome] = ray.get(ready)
                    except ray.exceptions.RayTaskError as error:
                        raise NotStarted(first_line(error.cause)) from error
                    except ray.exceptions.RayError as error:
                        losses += 1
                        if losses > LOSSES * self.workers:
                            raise NotStarted(f"the cluster loses what it is given: {first_line(error)}") from error
                        shares.give_back(share)
                        continue
                    losses = 0
                    for number, outcome in zip(share, outcomes):
                        if isinstance(outcome, Done):
                            shares.learn(1, outcome.seconds)
                        yield number, outcome
        finally:
            for reference in under_way:
                ray.cancel(reference, force=True)

    def close(self) -> None:
        """Leave the cluster; one that was started here ends."""
        self._ray.shutdown()


_hand: tuple[Job, float | None, Hand] | None = None


def _work(job: Job, items: Sequence[Any], limit: float | None) -> list[Outcome]:
    """A share, in a process of Ray's, which keeps its hand for the next one."""
    global _hand
    if _hand is None or _hand[:2] != (job, limit):
        if _hand:
            _hand[2].close()
        _hand = job, limit, Hand(job, limit)
    return [*_hand[2].work(items)]
