"""The state of a process that an item of a job may change, and that is restored for the next item."""

from __future__ import annotations

import contextlib
import faulthandler
import os
import signal
import sys

REAL_TIME = 32  # the first real-time signal


class Surroundings:
    """The folder, the environment and the signals of this process, as they were when this object was made."""

    def __init__(self) -> None:
        self._folder, self._environment = os.getcwd(), dict(os.environ)
        self._recursion = sys.getrecursionlimit()
        self._handlers = {number: signal.getsignal(number) for number in signal.valid_signals() if number < REAL_TIME}
        self._limits = _limits()

    def restore(self) -> bool:
        """Restore what has changed, and stop timers. False if that is not possible; then the process should end."""
        with contextlib.suppress(OSError):  # the folder is gone
            os.chdir(self._folder)
        if os.environ != self._environment:
            os.environ.clear()
            os.environ.update(self._environment)
        sys.setrecursionlimit(self._recursion)
        if sys.platform != "win32":
            for timer in (signal.ITIMER_REAL, signal.ITIMER_VIRTUAL, signal.ITIMER_PROF):
                signal.setitimer(timer, 0)
            signal.pthread_sigmask(signal.SIG_SETMASK, ())
        self._restore_handlers()
        return _limits() == self._limits

    def _restore_handlers(self) -> None:
        others = {
            number: handler
            for number, handler in self._handlers.items()
            if handler is not None and signal.getsignal(number) != handler
        }
        for number, handler in others.items():
            signal.signal(number, handler)
        if others:  # a handler of faulthandler may be among them, which Python does not know
            faulthandler.disable()
        faulthandler.enable()


def _limits() -> list[tuple[int, int]]:
    """The limits of memory, files and time of this process. Once lowered, they cannot be raised again."""
    if sys.platform == "win32":
        return []
    import resource

    kinds = resource.RLIMIT_AS, resource.RLIMIT_DATA, resource.RLIMIT_NOFILE, resource.RLIMIT_FSIZE, resource.RLIMIT_CPU
    return [resource.getrlimit(kind) for kind in kinds]
