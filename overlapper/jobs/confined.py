"""Functions called in a separate process, with limits of time and memory. The answer is a result or a sentence.

The process is kept for the next call, because its start takes longer than most calls. The process and all its children
end if a call breaks a limit, and when Python ends. An idle process ends after some seconds. On Windows there is no
limit of memory, and the process stays until Python ends.
"""

from __future__ import annotations

import math
import os
import pickle
import re
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any, ParamSpec, TypeVar, cast

from overlapper.jobs.worker import Ended, Worker, forget_words, signal_name
from overlapper.printable import first_line

P = ParamSpec("P")
T = TypeVar("T")

# The limits for reading files from outside. They are far beyond what real files need, so that only reading that would
# never end reaches them.
SECONDS = 600.0
MEGABYTES = 8192

IDLE = 20  # s after which an idle process ends
GRACE = 2  # s beyond the limit after which a process ends itself, because nobody waits for it any more

OUT_OF_MEMORY = re.compile(r"bad_alloc|MemoryError|[Cc]annot allocate memory|[Oo]ut of memory")


class Unanswered(Exception):
    """A call that broke a limit or ended its process. The text ends a sentence: "took longer than 3 s".

    `signal` is the name of the signal that ended the process, "" if there was none.
    """

    def __init__(self, why: str, signal: str = "") -> None:
        super().__init__(why)
        self.signal = signal


class _OutOfMemory(Exception):
    """The process was refused memory."""


class Confined:
    """Calls functions of modules in one process, each within `seconds`, and with `megabytes` (2**20 bytes) of memory.

    Threads take turns. After a fork, the child uses a new process.
    """

    def __init__(self, seconds: float, megabytes: int) -> None:
        self.seconds, self.megabytes = seconds, megabytes
        self._lock = threading.Lock()
        self._worker: Worker | None = None
        self._owner = os.getpid()

    def __call__(self, function: Callable[P, T], *arguments: P.args, **named: P.kwargs) -> T:
        """Call the function in the process. Unanswered if the call breaks a limit or ends the process."""
        if self._owner != os.getpid():
            self._owner, self._lock, self._worker = os.getpid(), threading.Lock(), None
        with self._lock:
            returned, value = self._ask((function, arguments, named, self.seconds))
        if not returned:
            raise value
        return cast(T, value)

    def close(self) -> None:
        """End the process. Another call starts a new one."""
        if self._worker and self._owner == os.getpid():
            self._worker.close()
        self._worker = None

    def _ask(self, request: tuple[Any, ...]) -> tuple[bool, Any]:
        kept = self._worker is not None and self._worker.alive()
        try:
            if self._worker is None or not kept:
                self.close()
                self._worker = Worker(answers, megabytes=self.megabytes)
            self._worker.send(request)
            returned, value = self._worker.receive(self.seconds)
        except Ended as ended:
            self.close()
            if kept and sys.platform != "win32" and ended.code == -signal.SIGALRM:  # it had been idle for too long
                return self._ask(request)
            raise self._unanswered(ended) from None
        except BaseException:  # Ctrl-C: a late answer would be taken for the answer to the next call
            self.close()
            raise
        if isinstance(value, _OutOfMemory):
            self.close()
            raise Unanswered(f"needed more than {self.megabytes:,} MB")
        return returned, value

    def _unanswered(self, ended: Ended) -> Unanswered:
        if ended.limit is not None:
            return Unanswered(f"took longer than {self.seconds:g} s")
        if out_of_memory(ended):
            return Unanswered(f"needed more than {self.megabytes:,} MB")
        name = signal_name(-ended.code) if ended.code is not None and ended.code < 0 else ""
        if ended.code is None:
            return Unanswered(f"had a process that {ended}")
        return Unanswered(str(ended).replace("ended with", "ended its process with", 1), name)


def out_of_memory(ended: Ended) -> bool:
    """Whether a process ended because it was refused memory, according to its last words."""
    return OUT_OF_MEMORY.search(ended.words) is not None


def answers(request: tuple[Callable[..., Any], tuple[Any, ...], dict[str, Any], float]) -> Iterator[tuple[bool, Any]]:
    """Runs in the process: yields whether a function returned, and what it returned or raised."""
    function, arguments, named, seconds = request
    forget_words()
    _end_after(math.ceil(seconds) + GRACE)
    yield _outcome(function, arguments, named)
    _end_after(IDLE)


def _outcome(function: Callable[..., Any], arguments: tuple[Any, ...], named: dict[str, Any]) -> tuple[bool, Any]:
    try:
        return True, function(*arguments, **named)
    except MemoryError:
        return False, _OutOfMemory()
    except Exception as error:
        return False, _portable(error)


def _portable(error: Exception) -> Exception:
    """The same error if it can be pickled, or else an error with the same text."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {first_line(error)}")
    return error


def _end_after(seconds: int) -> None:
    """End this process after `seconds`, even if it does not return from C code."""
    if sys.platform != "win32":
        signal.alarm(seconds)
