"""A worker process, in which a library may abort, crash, hang or print. How the process ended is reported.

The process leads its own process group. When it ends, all its descendants end, too. `multiprocessing` is not used,
because it would import the user's main module once more.
"""

from __future__ import annotations

import contextlib
import io
import os
import pickle
import queue
import re
import select
import signal
import subprocess
import sys
import tempfile
import threading
import time
import weakref
from collections.abc import Callable, Iterable, Iterator
from importlib import import_module
from pathlib import Path
from typing import IO, Any

from overlapper.jobs.descendants import MARK, guard, kill_group, kill_marked, new_mark
from overlapper.printable import first_line

START_LIMIT = 60.0  # s, for a new Python to import a module on a busy machine

GLANCE = 0.2  # s after which a silent process is checked: its children may hold its pipe open
LEAVE = 5.0  # s within which a process must end after it has closed its pipe
WORDS = 1 << 16  # the last bytes that a process writes to stderr; this many are kept

# The messages of C++ and Python for an uncaught exception.
UNCAUGHT = r"what\(\): *(.*)|^(\w*(?:Error|Exception): .*)"

END = object()

_words = 2  # in the process: a duplicate descriptor of its stderr, which no other code closes


class Ended(Exception):
    """The process sends no more replies. The text says why, as the end of a sentence.

    `code` is the exit code, or minus the number of the signal that ended the process. It is None if the process was
    killed because it took longer than `limit` seconds or closed its pipe. `words` is the end of its stderr.
    """

    def __init__(self, why: str, code: int | None, words: str = "", limit: float | None = None) -> None:
        super().__init__(why)
        self.code, self.words, self.limit = code, words, limit


class NotStarted(RuntimeError):
    """A process that is needed cannot be started. The text is one sentence."""


class Worker:
    """A process that serves requests by `answers`, a generator function of a module: a request, then its replies.

    `cause` is a pattern for the stderr of the process; its groups are the cause of the end. `megabytes` is the memory
    that the process may take after it has imported the module; only Linux enforces it. Ended if the process cannot be
    started or cannot import the module. A thread reads the replies, so that waiting with a limit works on every system.
    """

    def __init__(
        self, answers: Callable[[Any], Iterator[Any]], cause: str = UNCAUGHT, megabytes: int | None = None
    ) -> None:
        mark = new_mark()
        where = f"{answers.__module__!r}, {answers.__name__!r}, {megabytes}"
        program = f"import sys; sys.path[:] = {sys.path!r}; from overlapper.jobs.worker import serve; serve({where})"
        self._cause, self._mark = cause, mark
        self._arrived: queue.SimpleQueue[Any] = queue.SimpleQueue()
        with contextlib.ExitStack() as started:
            try:
                self._words = started.enter_context(tempfile.TemporaryFile())
                self.process = subprocess.Popen(
                    [sys.executable, "-c", program],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=self._words,
                    start_new_session=True,
                    env={**os.environ, MARK: mark},
                )
                started.enter_context(self.process)
                started.callback(self.kill)
                assert self.process.stdin and self.process.stdout
                self._requests, replies = self.process.stdin, self.process.stdout
                reader = threading.Thread(target=_forward, args=(self.process, self._arrived), daemon=True)
                reader.start()
            except (OSError, RuntimeError) as error:  # RuntimeError: no thread can be started
                raise Ended(f"could not be started ({first_line(error)})", None) from error
            started.pop_all()
        # Also runs when the worker is garbage-collected and when Python exits, so that no process is left.
        files = self._requests, replies, self._words
        self.close = weakref.finalize(self, _end, os.getpid(), self.process, mark, reader, files)
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
        return not _is_over(self.process)

    def kill(self) -> None:
        """End the process and all its descendants, from any thread."""
        _kill(self.process, self._mark)

    def send(self, request: Any) -> None:
        with contextlib.suppress(BrokenPipeError):  # the missing reply is noticed later
            pickle.dump(request, self._requests)
            self._requests.flush()

    def receive(self, time_limit: float | None = None) -> Any:
        """The next reply. Ended if the process ends before it replies, or takes longer than `time_limit` seconds."""
        try:
            reply = self._arrived.get(timeout=time_limit)
        except queue.Empty:
            self.kill()
            self.process.wait()
            raise Ended(f"gave no answer within {time_limit:g} s", None, limit=time_limit) from None
        if reply is END:
            raise self._ended()
        return reply

    def _ended(self) -> Ended:
        patience = time.monotonic() + LEAVE
        while not _is_over(self.process) and time.monotonic() < patience:
            time.sleep(0.01)
        closed = not _is_over(self.process)
        self.kill()
        code = self.process.wait()
        self._words.seek(max(self._words.seek(0, os.SEEK_END) - WORDS, 0))
        words = self._words.read().decode(errors="replace")
        if closed:
            return Ended("closed the pipe for its answers, but did not end", None, words)
        how = f"signal {signal_name(-code)}" if code < 0 else f"exit code {code}"
        said = [first_line("".join(groups)) for groups in re.findall(self._cause, words, re.MULTILINE)]
        return Ended(f"ended with {how}" + (f" ({said[-1]})" if said else ""), code, words)


def _is_over(process: subprocess.Popen[bytes]) -> bool:
    """Whether a process has ended. Its process number stays reserved for its group until the group is killed."""
    if process.returncode is not None:
        return True
    if hasattr(os, "waitid"):
        try:
            return os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None
        except ChildProcessError:  # another thread has just waited for it
            return True
    over = process.poll() is not None
    if over:
        kill_group(process.pid)
    return over


def signal_name(number: int) -> str:
    """The name of a signal, such as "SIGKILL"; real-time signals have only numbers."""
    return signal.Signals(number).name if number in signal.Signals.__members__.values() else str(number)


def _kill(process: subprocess.Popen[bytes], mark: str) -> None:
    if process.returncode is None:
        kill_group(process.pid)
        process.kill()
        kill_marked(mark)


class _Replies(io.RawIOBase):
    """The output of a process, up to its end, even if another process holds the pipe open."""

    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdout
        self._process, self._descriptor = process, process.stdout.fileno()
        if sys.platform != "win32":
            self._ready = select.poll()
            self._ready.register(self._descriptor, select.POLLIN)

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        if sys.platform != "win32":
            while not self._ready.poll(1000 * GLANCE):
                # Only the process itself writes here, so all that it wrote before its end has been read.
                if _is_over(self._process) and not self._ready.poll(0):
                    return 0
        data = os.read(self._descriptor, len(buffer))
        buffer[: len(data)] = data
        return len(data)


def _forward(process: subprocess.Popen[bytes], arrived: queue.SimpleQueue[Any]) -> None:
    # A reply that is cut off or cannot be unpickled counts as missing.
    with contextlib.suppress(Exception):
        replies = io.BufferedReader(_Replies(process), 1 << 16)
        while True:
            arrived.put(pickle.load(replies))
    arrived.put(END)


def _end(
    owner: int, process: subprocess.Popen[bytes], mark: str, reader: threading.Thread, files: Iterable[IO[bytes]]
) -> None:
    if os.getpid() != owner:  # in a fork, which must leave the process to its parent
        return
    _kill(process, mark)
    process.wait()
    reader.join()
    for file in files:
        with contextlib.suppress(BrokenPipeError):  # a request was still in the buffer
            file.close()


def serve(module: str, name: str, megabytes: int | None) -> None:
    """The process: reads requests from standard input, and writes a greeting and its replies to standard output."""
    # Ctrl-C is for the parent, which may want another answer before the end.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    guard()
    global _words
    requests, replies, _words = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb"), os.dup(2)
    pipe = os.fstat(replies.fileno())
    with open(os.devnull) as nothing:
        os.dup2(nothing.fileno(), 0)  # code that reads standard input must not read the requests
    os.dup2(2, 1)  # other printed text must not mix with the replies

    def say(reply: Any) -> None:
        if not os.path.samestat(os.fstat(replies.fileno()), pipe):  # other code has closed it and reused its number
            os._exit(1)
        pickle.dump(reply, replies)
        replies.flush()

    answers = getattr(import_module(module), name)
    _limit(megabytes)
    say("ready")
    with contextlib.suppress(EOFError):
        while True:
            for reply in answers(pickle.load(requests)):
                say(reply)


def _limit(megabytes: int | None) -> None:
    """Forbid core dumps, and limit memory to `megabytes` beyond what the process has now."""
    if sys.platform == "win32":
        return
    import resource

    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # an abort is an expected answer here, and must not fill the disk
    if megabytes is not None and sys.platform == "linux":
        # The limit is on data, not on addresses: threads and libraries reserve addresses that they never use.
        held = re.search(r"^VmData:\s*(\d+) kB", Path("/proc/self/status").read_text(), re.MULTILINE)
        most = (megabytes << 20) + (int(held[1]) << 10 if held else 0)
        hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
        most = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(resource.RLIMIT_DATA, (most, most))


def forget_words() -> None:
    """Runs in the process: drops what it has written to stderr, which would be mistaken for text on the next request.

    Standard streams that were closed or replaced meanwhile are restored.
    """
    for name, number in (("stdout", 1), ("stderr", 2)):
        with contextlib.suppress(Exception):  # the stream may be any object that user code has put there
            getattr(sys, name).flush()
        os.dup2(_words, number)
        stream = getattr(sys, f"__{name}__")
        if stream is None or stream.closed:
            stream = io.TextIOWrapper(
                io.FileIO(number, "w", closefd=False), "utf-8", "backslashreplace", write_through=True
            )
            setattr(sys, f"__{name}__", stream)
        setattr(sys, name, stream)
    os.ftruncate(2, 0)
    os.lseek(2, 0, os.SEEK_SET)
