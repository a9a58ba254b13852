"""A worker process, in which a library may abort, crash, hang or print, and how it ended is an answer.

It is not of `multiprocessing`, which imports the user's main module once more in the new process.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import re
import signal
import subprocess
import sys
import tempfile
import threading
import weakref
from collections.abc import Callable, Iterable, Iterator
from importlib import import_module
from typing import IO, Any

from overlapper.printable import first_line

START_LIMIT = 60.0  # s, for a new Python to import a module on a machine that is busy

# The messages of C++ and Python for an uncaught exception.
UNCAUGHT = r"what\(\): *(.*)|^(\w*(?:Error|Exception): .*)"

END = object()


class Ended(Exception):
    """The process says no more; the text tells why, as the end of a sentence.

    `code` is its exit code, minus the signal that ended it, or None if it was killed for taking longer than `limit`
    seconds. `words` is all that it wrote to stderr.
    """

    def __init__(self, why: str, code: int | None, words: str = "", limit: float | None = None) -> None:
        super().__init__(why)
        self.code, self.words, self.limit = code, words, limit


class NotStarted(RuntimeError):
    """A process that something depends on cannot be had; the text is one sentence."""


class Worker:
    """A process that serves requests by `answers`, a generator function of a module: a request, then its replies.

    `cause` is a pattern of what the process may write to stderr, whose groups are the cause of its end. Ended if there
    can be no such process, or the module cannot be imported there. A thread reads the replies: waiting with a limit
    works so on every system.
    """

    def __init__(self, answers: Callable[[Any], Iterator[Any]], cause: str = UNCAUGHT) -> None:
        where = f"{answers.__module__!r}, {answers.__name__!r}"
        program = f"import sys; sys.path[:] = {sys.path!r}; from overlapper.jobs.worker import serve; serve({where})"
        self._cause = cause
        self._arrived: queue.SimpleQueue[Any] = queue.SimpleQueue()
        with contextlib.ExitStack() as started:
            try:
                self._words = started.enter_context(tempfile.TemporaryFile())
                self.process = subprocess.Popen(
                    [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._words
                )
                started.enter_context(self.process)
                started.callback(self.process.kill)
                assert self.process.stdin and self.process.stdout
                self._requests, replies = self.process.stdin, self.process.stdout
                reader = threading.Thread(target=_forward, args=(replies, self._arrived), daemon=True)
                reader.start()
            except (OSError, RuntimeError) as error:  # RuntimeError: no thread can be had
                raise Ended(f"could not be started ({first_line(error)})", None) from error
            started.pop_all()
        # Also when the worker is forgotten and when Python exits, so that nothing is left behind.
        self.close = weakref.finalize(self, _end, self.process, reader, (self._requests, replies, self._words))
        try:
            self.receive(START_LIMIT)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def alive(self) -> bool:
        return self.process.poll() is None

    def send(self, request: Any) -> None:
        with contextlib.suppress(BrokenPipeError):  # the missing reply will tell
            pickle.dump(request, self._requests)
            self._requests.flush()

    def receive(self, time_limit: float | None = None) -> Any:
        """The next reply. Ended if the process ends before it, or does not give it within `time_limit` seconds."""
        try:
            reply = self._arrived.get(timeout=time_limit)
        except queue.Empty:
            self.process.kill()
            self.process.wait()
            raise Ended(f"gave no answer within {time_limit:g} s", None, limit=time_limit) from None
        if reply is END:
            raise self._ended()
        return reply

    def _ended(self) -> Ended:
        code = self.process.wait()
        how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
        self._words.seek(0)
        words = self._words.read().decode(errors="replace")
        said = ["".join(groups).strip().rstrip(".") for groups in re.findall(self._cause, words, re.MULTILINE)]
        return Ended(f"ended with {how}" + (f" ({said[-1]})" if said else ""), code, words)


def _forward(replies: IO[bytes], arrived: queue.SimpleQueue[Any]) -> None:
    with contextlib.suppress(EOFError, pickle.UnpicklingError):
        while True:
            arrived.put(pickle.load(replies))
    arrived.put(END)


def _end(process: subprocess.Popen[bytes], reader: threading.Thread, files: Iterable[IO[bytes]]) -> None:
    process.kill()
    process.wait()
    reader.join()
    for file in files:
        with contextlib.suppress(BrokenPipeError):  # of a request that was still in the buffer
            file.close()


def serve(module: str, name: str) -> None:
    """The process: requests on standard input; on standard output a greeting, then the replies to each request."""
    # Ctrl-C is for whoever asks, who may want another answer before the end.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    replies = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever else gets printed must not mix with the replies
    with contextlib.suppress(ImportError):
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # an abort is an answer here, not a reason to fill the disk

    def say(reply: Any) -> None:
        pickle.dump(reply, replies)
        replies.flush()

    answers = getattr(import_module(module), name)
    say("ready")
    with contextlib.suppress(EOFError):
        while True:
            for reply in answers(pickle.load(sys.stdin.buffer)):
                say(reply)
