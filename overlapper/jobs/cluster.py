"""The executor of many machines: shares of items are tasks of Ray, each done by hands beside Ray's own process.

A hand deals with items that raise, hang or die, as on one machine. If a node is lost, the shares that were under way
there are sent again. On a large cluster a share is for several CPUs of a node and lasts longer, so that the process
that started the job handles only hundreds of shares at a time and hundreds a second.
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
RATE = 100  # the most shares that come back in a second: with more crews, shares last longer

CREWS = 500  # the most shares that are done at a time: with more CPUs, each share is for several

# The most shares that may be lost before the first one is done; if more are lost, the installation is broken. Later, as
# many more may be lost as are sent, because a large part of the cluster may go at once.
LOSSES = 20


class Cluster:
    """Does items on the Ray cluster at `address` ("auto", or host:port), or on a new cluster of this machine.

    `workers` is the number of items at a time. The default is the number of CPUs of the cluster, which may change.
    NotStarted if there is no cluster, ImportError without Ray.
    """

    def __init__(self, address: str | None = None, workers: int | None = None) -> None:
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # for privacy: Ray must not report its use
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
        """The number of items at a time on the present cluster."""
        return self._asked or max(int(self._ray.cluster_resources().get("CPU", 1)), 1)

    def _crew(self) -> int:
        """The CPUs for a share: enough to keep the number of shares small, and not more than most nodes have."""
        cpus = [int(node["Resources"].get("CPU", 0)) for node in self._ray.nodes() if node["Alive"]]
        most = median_low([each for each in cpus if each] or [1])
        return min(math.ceil(self.workers / CREWS), most)

    def shares(
        self, job: Job, items: Sequence[Any], limit: float | None = None, late: Late | None = None
    ) -> Generator[Shared, None, None]:
        """See Executor."""
        ray, crew = self._ray, self._crew()
        crews = max(self.workers // crew, 1)
        # Ray must not retry: this process sends lost shares again, because it knows what has arrived.
        remote = ray.remote(num_cpus=crew, max_retries=0)(_work)
        shares = Shares(len(items), crews, crew * max(SHARE, crews / RATE), crew)
        under_way: dict[Any, list[int]] = {}
        patience = Patience(late)
        losses, done = 0, False
        sent = ray.put(job)
        try:
            while True:
                # Twice the shares that can be done at a time, so that no crew waits for its next share. The cluster
                # may grow.
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
                            raise NotStarted(f"the Ray cluster loses objects: {first_line(error)}") from error
                        shares.give_back(share)
                        continue
                    losses, done = 0, True
                    shares.learn(count, seconds)
                    yield share, gathered
        finally:
            for reference in under_way:
                ray.cancel(reference, force=True)

    def close(self) -> None:
        """Leave the cluster. A cluster that was started here ends."""
        self._ray.shutdown()


class _Crew:
    """The hands of a process of Ray. They are kept for the next share.

    Their threads are kept, too, because a hand ends with the thread that started it.
    """

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
    """Do a share. Returns the gathered result, the number of items that were done, and the seconds that they took."""
    global _crew
    if _crew is None or (_crew.job, _crew.limit, _crew.count) != (job, limit, hands):
        if _crew:
            _crew.close()
        _crew = _Crew(job, limit, hands)
    outcomes = _crew.work(items)
    seconds = [outcome.seconds for outcome in outcomes if isinstance(outcome, Done)]
    return job.gathered([*zip(items, outcomes)]), len(seconds), sum(seconds)
