"""The protocol of executors, which do the items of a job: processes of this machine, or a cluster."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from contextlib import closing
from typing import Any, Protocol

from overlapper.jobs.hand import Job, Outcome
from overlapper.jobs.patience import Late

# The numbers of some items, and what the job gathers of them.
Shared = tuple[list[int], Any]


class Executor(Protocol):
    """Does items, several at a time."""

    @property
    def workers(self) -> int:
        """How many at a time."""
        ...

    def shares(
        self, job: Job, items: Sequence[Any], limit: float | None = None, late: Late | None = None
    ) -> Generator[Shared, None, None]:
        """The numbers of some items with what the job gathers of them, in whatever order, each item once.

        `limit` is the number of seconds that an item may take. `late` hears of items that take very long. Items that
        are under way when the generator is closed are given up, and no process is left. NotStarted if the job cannot be
        done at all.
        """
        ...


def outcomes(
    engine: Executor, job: Job, items: Sequence[Any], limit: float | None = None
) -> Generator[tuple[int, Outcome], None, None]:
    """The number of each item with what became of it, of a job that gathers nothing. See Executor.shares."""
    with closing(engine.shares(job, items, limit)) as shares:
        for numbers, found in shares:
            yield from zip(numbers, found)
