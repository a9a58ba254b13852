"""The processes that must end with a process: its process group and, on Linux, descendants that have left the group."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import sys
from pathlib import Path
from uuid import uuid4

MARK = "OVERLAPPER_WORKER"  # a variable of the environment, which all descendants of a process inherit

DIE_WITH_PARENT = 1  # PR_SET_PDEATHSIG of Linux
MOST_FILES = 4096
KILLINGS = 100  # the most searches for processes: they may start others meanwhile


def new_mark() -> str:
    """The mark of a new process and its descendants. It begins with the mark of this process."""
    return f"{os.environ.get(MARK, '')}/{uuid4().hex}"


def kill_group(leader: int) -> None:
    """Kill a process and all processes in its group. Windows has no such groups."""
    if sys.platform != "win32":
        with contextlib.suppress(ProcessLookupError, PermissionError):  # macOS refuses it for a process that has ended
            os.killpg(leader, signal.SIGKILL)


def kill_marked(mark: str) -> None:
    """Kill all processes with the mark except this one, in whatever group. Only Linux can list them."""
    if sys.platform == "linux":
        for _ in range(KILLINGS):
            if not _found_and_killed(mark.encode()):
                return


def _found_and_killed(mark: bytes) -> bool:
    found = False
    for environment in Path("/proc").glob("[0-9]*/environ"):
        process = int(environment.parent.name)
        with contextlib.suppress(OSError):  # processes of other users, and processes that have just ended
            if process != os.getpid() and mark in environment.read_bytes():
                os.kill(process, signal.SIGKILL)
                found = True
    return found


def signalled_at_the_end_of_the_parent(number: int) -> None:
    """Let Linux send this process a signal when the thread that started it ends."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(DIE_WITH_PARENT, number)


def guard() -> None:
    """Start a process that only waits for the end of this one, however it ends, and kills its descendants."""
    if sys.platform != "linux" or not (mark := os.environ.get(MARK)):
        return
    guarded = os.getpid()
    if os.fork():
        return
    try:
        os.setsid()
        os.closerange(0, MOST_FILES)
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM])
        signalled_at_the_end_of_the_parent(signal.SIGTERM)
        if os.getppid() == guarded:
            signal.sigwait([signal.SIGTERM])
        kill_marked(mark)
    finally:
        os._exit(0)
