"""The protocol of executors. An executor does the items of a job by processes of this machine or on a cluster."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from contextlib import closing
from typing import Any, Protocol

from overlapper.jobs.hand import Job, Outcome
from overlapper.jobs.patience import Late

# The numbers of some items, and the result that the job gathers from them.
Shared = tuple[list[int], Any]


class Executor(Protocol):
    """Does items, several at a time."""

    @property
    def workers(self) -> int:
        """The number of items at a time."""
        ...

    def shares(
        self, job: Job, items: Sequence[Any], limit: float | None = None, late: Late | None = None
    ) -> Generator[Shared, None, None]:
        """Yields the numbers of some items with the result that the job gathers from them. Each item comes once.

        The order of items is not defined. `limit` is the number of seconds that an item may take. `late` is called for
        items that take very long. Closing the generator abandons items that are under way and leaves no process.
        NotStarted if the job cannot be done at all.
        """
        ...


def outcomes(
    engine: Executor, job: Job, items: Sequence[Any], limit: float | None = None
) -> Generator[tuple[int, Outcome], None, None]:
    """The number and the outcome of each item of a job that gathers nothing. See Executor.shares."""
    with closing(engine.shares(job, items, limit)) as shares:
        for numbers, found in shares:
            yield from zip(numbers, found)
