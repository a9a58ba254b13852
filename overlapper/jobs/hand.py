"""A process that does items one after another. If it raises, hangs or dies on an item, other items are not affected.

The work is a `Job`. Nothing here depends on scenes.
"""

from __future__ import annotations

import contextlib
import faulthandler
import os
import re
import signal
import sys
import time
import traceback
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, Literal

from overlapper.jobs.descendants import signalled_at_the_end_of_the_parent
from overlapper.jobs.surroundings import Surroundings
from overlapper.jobs.worker import START_LIMIT, Ended, NotStarted, Worker, forget_words
from overlapper.printable import encodable, first_line, shortened

# s beyond the limit in which a process ends itself with a traceback, before it is killed.
GRACE = 10.0

# An item fails if its process has died this often. The first death may have another cause than the item.
TRIES = 2

TRACEBACK = 20_000  # characters

TIMED_OUT = re.compile(r"^Timeout \(\d", re.MULTILINE)  # the message of faulthandler


@dataclass(frozen=True, slots=True)
class Job:
    """The function to call with every item. `prepare`, named by module and name, makes it from `setup` in each process.

    The function must return the same bits for an item in any process and after any other items. Paths are relative to
    `folder`, if it exists there. `gather`, of the same module, makes one result of `setup` and some items with their
    outcomes. It is called in the process that did the items, before the result is sent. `megabytes` is the memory that
    a process may take beyond the memory of a new process, on Linux.
    """

    module: str
    prepare: str
    setup: Any
    gather: str | None = None
    folder: str = field(default_factory=os.getcwd)
    megabytes: int | None = None

    def gathered(self, found: Sequence[tuple[Any, Outcome]]) -> Any:
        """The result of some items; their outcomes if the job has no `gather`."""
        if self.gather is None:
            return [outcome for _, outcome in found]
        return getattr(import_module(self.module), self.gather)(self.setup, found)


@dataclass(frozen=True, slots=True)
class Done:
    """The result of an item, and the seconds that it took."""

    value: Any
    seconds: float


What = Literal["raised", "hung", "died"]


@dataclass(frozen=True, slots=True)
class Failed:
    """An item without a result: a sentence, and all that is known about the place of the failure."""

    what: What
    sentence: str
    traceback: str


Outcome = Done | Failed


@dataclass(frozen=True, slots=True)
class _Work:
    items: tuple[Any, ...]
    limit: float | None


_call: Callable[[Any], Any] | None = None
_surroundings: Surroundings | None = None


def answers(request: Job | _Work) -> Iterator[Outcome | str]:
    """Runs in the process. Yields what is wrong with a job, or nothing; for work, an outcome for each item."""
    global _call
    if isinstance(request, Job):
        yield _begun(request)
    else:
        assert _call
        for item in request.items:
            yield _outcome(_call, item, request.limit)
            if _surroundings and not _surroundings.restore():
                sys.exit()  # the next item is done by a new process


def _begun(job: Job) -> str:
    global _call, _surroundings
    # The parent may be killed while this process hangs in an item. The thread that started this process also reads its
    # replies, so the thread lives as long as the process is needed.
    signalled_at_the_end_of_the_parent(signal.SIGKILL)
    faulthandler.enable()
    warnings.simplefilter("ignore")
    with contextlib.suppress(OSError):
        os.chdir(job.folder)
    try:
        _call = getattr(import_module(job.module), job.prepare)(job.setup)
    except Exception as error:
        return first_line(error)
    _surroundings = Surroundings()
    return ""


def _outcome(call: Callable[[Any], Any], item: Any, limit: float | None) -> Outcome:
    forget_words()
    start = time.monotonic()
    if limit:
        faulthandler.dump_traceback_later(limit, exit=True)  # also while C code does not return to Python
    try:
        with warnings.catch_warnings():
            return Done(call(item), time.monotonic() - start)
    except BaseException as error:  # an exit or an interruption is a failure of the item, too
        return _failed("raised", f"{type(error).__name__}: {first_line(error)}", _trace())
    finally:
        faulthandler.cancel_dump_traceback_later()


def _trace() -> str:
    try:
        return traceback.format_exc()
    except BaseException as error:  # raised by the exception's own __str__
        return f"the traceback cannot be written: {type(error).__name__}"


def _failed(what: What, sentence: str, words: str) -> Failed:
    """A failure whose texts are printable and short enough for any table."""
    return Failed(what, encodable(sentence), shortened(encodable(words), TRACEBACK))


class Hand:
    """Does items in a worker process, which is started again when it has ended.

    `limit` is the number of seconds that an item may take. NotStarted if there can be no process for the job.
    """

    def __init__(self, job: Job, limit: float | None = None) -> None:
        self._job, self._limit = job, limit
        self._worker: Worker | None = None
        self._closed = False

    def work(self, items: Sequence[Any]) -> Iterator[Outcome]:
        """The outcome of each item, in order. If the hand is closed meanwhile, the outcomes of the first items only."""
        left = deque(items)
        tries = 0
        while left and not self._closed:
            try:
                worker = self._worker = self._worker or self._started()
                if self._closed:
                    worker.kill()
                worker.send(_Work(tuple(left), self._limit))
                while left:
                    outcome = worker.receive(self._limit and self._limit + GRACE)
                    left.popleft()
                    tries = 0
                    yield outcome
            except Ended as ended:
                self._forget()
                tries += 1
                failed = _told(ended, self._limit)
                if not self._closed and (failed.what == "hung" or tries == TRIES):
                    left.popleft()
                    tries = 0
                    yield failed

    def _started(self) -> Worker:
        try:
            worker = Worker(answers, megabytes=self._job.megabytes)
            worker.send(self._job)
            complaint = worker.receive(START_LIMIT)
        except Ended as ended:
            raise NotStarted(f"a worker process {ended}") from ended
        if complaint:
            worker.close()
            raise NotStarted(f"a worker process could not be prepared: {complaint}")
        return worker

    def _forget(self) -> None:
        if self._worker:
            self._worker.close()
            self._worker = None

    @property
    def closed(self) -> bool:
        """Whether the hand is closed."""
        return self._closed

    def stop(self) -> None:
        """End the process, called from another thread than the thread in `work`, which then ends, too."""
        self._closed = True
        if worker := self._worker:
            worker.kill()

    def close(self) -> None:
        """End the process."""
        self._closed = True
        self._forget()


def _told(ended: Ended, limit: float | None) -> Failed:
    words = ended.words.strip()
    if ended.limit or (limit and TIMED_OUT.search(words)):
        return _failed("hung", f"it took longer than {limit:g} s", words)
    return _failed("died", f"its process {ended}", words)
