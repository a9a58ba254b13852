"""A function in a process of its own, so that its crash or hang is an answer."""

from __future__ import annotations

import multiprocessing
import os
import resource
import signal
import time
import warnings
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from harness.command import Wrong

START_LIMIT = 120.0  # s, for the function's packages to be imported and the first question answered on a busy machine


class Ended(Exception):
    """The process says no more; the text tells how it ended."""


class Watched:
    """A context manager: asks one function, in a process that is started again whenever it ends.

    An answer may take `time_limit` seconds; of the processor if `patience` is given, which is then the limit by the
    clock. `first` are the arguments of a question whose answer is not wanted, before the time counts.
    """

    def __init__(
        self, function: Callable[..., Any], time_limit: float, first: tuple[Any, ...], patience: float | None = None
    ) -> None:
        self.function, self.first = function, first
        self.limits = (patience, time_limit) if patience else (time_limit, None)
        self.process: Any = None

    def __enter__(self) -> Watched:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def ask(self, *arguments: Any) -> Any:
        """The answer, or how it failed in a few words. Raises ImportError if a package is missing, and Wrong."""
        try:
            if self.process is None:
                self.start()
            self.pipe.send(arguments)
            reply = self.receive(*self.limits)
        except Ended as ended:
            self.close()
            return str(ended)
        if isinstance(reply, Exception):
            raise reply
        return reply

    def start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, other = context.Pipe()
        self.process = context.Process(target=serve, args=(other, self.function), daemon=True)
        self.process.start()
        other.close()
        self.pipe.send(self.first)
        first = self.receive(START_LIMIT)
        if isinstance(first, Exception):
            raise first

    def receive(self, patience: float, of_processor: float | None = None) -> Any:
        begin, used = time.monotonic(), self.processor_time()
        try:
            while not self.pipe.poll(min(patience, 1.0)):
                if of_processor and self.processor_time() > used + of_processor:
                    raise Ended(f"not waited for beyond {of_processor:g} s")
                if time.monotonic() > begin + patience:
                    raise Ended("hang")
            return self.pipe.recv()
        except (EOFError, ConnectionResetError):
            self.process.join()
            code = self.process.exitcode
            raise Ended(f"crash {signal.Signals(-code).name if code < 0 else code}") from None

    def processor_time(self) -> float:
        """Seconds that the process has used. A limit set by setrlimit would make the clock coarse."""
        try:
            return time.clock_gettime((~self.process.pid << 3) | 2)  # the clock that clock_getcpuclockid would give
        except OSError:  # the process has ended
            return 0.0

    def close(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.join()
            self.pipe.close()
            self.process = None


def serve(pipe: Connection, function: Callable[..., Any]) -> None:
    """The process: arguments in, an answer or the name of an exception out."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.simplefilter("ignore")
    while True:
        try:
            arguments = pipe.recv()
        except EOFError:
            return
        try:
            pipe.send(function(*arguments))
        except (ImportError, Wrong) as error:
            pipe.send(error)
        except Exception as error:
            pipe.send(f"raises {type(error).__name__}")
