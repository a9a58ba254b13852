"""The executor of many machines: shares of items as tasks of Ray, each done by hands beside Ray's own process.

An item that raises, hangs or dies is the business of a hand, as on one machine. A node that is lost loses the shares
that were under way there, and these are sent once more. On a large cluster a share is for several CPUs of a node, and
lasts longer: whoever started the job has to do with hundreds of shares at a time, and with hundreds a second.
"""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from operator import itemgetter
from statistics import median_low
from typing import Any

from overlapper.install import hint
from overlapper.jobs.executor import Shared
from overlapper.jobs.hand import Done, Hand, Job, Outcome
from overlapper.jobs.patience import Late, Patience
from overlapper.jobs.processes import SHARE as SHARE_OF_A_HAND
from overlapper.jobs.shares import Shares
from overlapper.jobs.worker import NotStarted
from overlapper.printable import first_line

SHARE = 1.0  # s of work that are sent at once: a task of Ray costs some milliseconds
RATE = 100  # shares that come back in a second, at most: on more crews, shares last longer

CREWS = 500  # shares that are done at a time, at most: on more CPUs, each is for several

# Shares that may be lost before the first one is done: beyond, the installation is broken. Later, as many more as are
# sent: a large part of the cluster may go at once.
LOSSES = 20


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

    def _crew(self) -> int:
        """The CPUs for a share: as many as keep the number of shares small, and as most nodes have."""
        cpus = [int(node["Resources"].get("CPU", 0)) for node in self._ray.nodes() if node["Alive"]]
        most = median_low([each for each in cpus if each] or [1])
        return min(math.ceil(self.workers / CREWS), most)

    def shares(
        self, job: Job, items: Sequence[Any], limit: float | None = None, late: Late | None = None
    ) -> Generator[Shared, None, None]:
        """See Executor."""
        ray, crew = self._ray, self._crew()
        crews = max(self.workers // crew, 1)
        # Those that are lost are sent anew by us, who know what has arrived.
        remote = ray.remote(num_cpus=crew, max_retries=0)(_work)
        shares = Shares(len(items), crews, crew * max(SHARE, crews / RATE), crew)
        under_way: dict[Any, list[int]] = {}
        patience = Patience(late)
        losses, done = 0, False
        sent = ray.put(job)
        try:
            while True:
                # Twice the shares that can be done at a time, so that nobody waits for the next. The cluster may grow.
                most = 2 * max(self.workers // crew, 1)
                while len(under_way) < most and (share := shares.take()):
                    reference = remote.remote(sent, [items[number] for number in share], limit, crew)
                    under_way[reference] = share
                    patience.begin(reference, share)
                patience.look()
                if not under_way:
                    return
                for ready in ray.wait([*under_way], num_returns=min(len(under_way), RATE), timeout=0.1)[0]:
                    share = under_way.pop(ready)
                    patience.end(ready)
                    try:
                        gathered, count, seconds = ray.get(ready)
                    except ray.exceptions.RayTaskError as error:
                        raise NotStarted(first_line(error.cause)) from error
                    except ray.exceptions.RayError as error:
                        losses += 1
                        if losses > LOSSES + done * 2 * crews:
                            raise NotStarted(f"the cluster loses what it is given: {first_line(error)}") from error
                        shares.give_back(share)
                        continue
                    losses, done = 0, True
                    shares.learn(count, seconds)
                    yield share, gathered
        finally:
            for reference in under_way:
                ray.cancel(reference, force=True)

    def close(self) -> None:
        """Leave the cluster; one that was started here ends."""
        self._ray.shutdown()


class _Crew:
    """The hands of a process of Ray's, which are kept for the next share. Their threads are, too: a hand ends with the
    thread that has started it."""

    def __init__(self, job: Job, limit: float | None, count: int) -> None:
        self.job, self.limit, self.count = job, limit, count
        self._hands = [Hand(job, limit) for _ in range(count)]
        self._threads = ThreadPoolExecutor(count)

    def work(self, items: Sequence[Any]) -> list[Outcome]:
        """The outcome of each item."""
        shares = Shares(len(items), self.count, SHARE_OF_A_HAND)

        def serve(hand: Hand) -> list[tuple[int, Outcome]]:
            found: list[tuple[int, Outcome]] = []
            while share := shares.take():
                for number, outcome in zip(share, hand.work([items[number] for number in share])):
                    found.append((number, outcome))
                    if isinstance(outcome, Done):
                        shares.learn(1, outcome.seconds)
            return found

        return [outcome for _, outcome in sorted(chain(*self._threads.map(serve, self._hands)), key=itemgetter(0))]

    def close(self) -> None:
        """End the processes."""
        for hand in self._hands:
            hand.close()
        self._threads.shutdown()


_crew: _Crew | None = None


def _work(job: Job, items: Sequence[Any], limit: float | None, hands: int) -> tuple[Any, int, float]:
    """A share: what the job gathers of it, how many items were done, and the seconds that they took."""
    global _crew
    if _crew is None or (_crew.job, _crew.limit, _crew.count) != (job, limit, hands):
        if _crew:
            _crew.close()
        _crew = _Crew(job, limit, hands)
    outcomes = _crew.work(items)
    seconds = [outcome.seconds for outcome in outcomes if isinstance(outcome, Done)]
    return job.gathered([*zip(items, outcomes)]), len(seconds), sum(seconds)
