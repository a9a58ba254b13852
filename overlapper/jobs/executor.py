"""The protocol of executors, which do the items of a job: processes of this machine, or a cluster."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import Any, Protocol

from overlapper.jobs.hand import Job, Outcome

Found = Generator[tuple[int, Outcome], None, None]


class Executor(Protocol):
    """Does items, several at a time."""

    @property
    def workers(self) -> int:
        """How many at a time."""
        ...

    def outcomes(self, job: Job, items: Sequence[Any], limit: float | None = None) -> Found:
        """The number of each item with what became of it, in whatever order, each once.

        `limit` is the number of seconds that an item may take. What is under way when the generator is closed is given
        up, and no process is left. NotStarted if the job cannot be done at all.
        """
        ...
