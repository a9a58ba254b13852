"""Processes that a script starts and that load the library of a simulator: what they step is not noticed here.

Linux tells which libraries a process has loaded. It is asked again and again, from the first process on.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

LOOK = 0.05  # s from one look to the next; to import the library takes longer

# Events of Python's audit hooks with which a process may be started; multiprocessing has none but its import.
STARTS = frozenset({"subprocess.Popen", "os.posix_spawn", "os.system", "os.spawn", "pty.spawn"})
SPAWNING = frozenset({"multiprocessing.popen_spawn_posix", "multiprocessing.popen_forkserver"})


class OtherProcesses:
    """Notes which processes that this one starts from now on load `library`.

    A process that is forked off and goes on as this one is not among them. Nothing is noted but on Linux.
    """

    def __init__(self, library: str) -> None:
        self._library = f"/{library}.".encode()
        self.found: set[int] = set()
        """The numbers of these processes."""
        self._process = os.getpid()
        self._thread: threading.Thread | None = None
        if sys.platform == "linux":
            sys.addaudithook(self._hear)

    def _hear(self, event: str, arguments: tuple[Any, ...]) -> None:
        starts = event in STARTS or (event == "import" and arguments[0] in SPAWNING)
        if starts and self._thread is None and os.getpid() == self._process:
            self._thread = threading.Thread(target=self._look, name="overlapper: other processes", daemon=True)
            self._thread.start()

    def _look(self) -> None:
        own = Path(f"/proc/{self._process}/cmdline").read_bytes()
        while True:
            for process in descendants(self._process):
                with suppress(OSError):  # it has ended
                    # The command first: between fork and exec, a process has the libraries of this one.
                    if (process / "cmdline").read_bytes() != own and self._library in (process / "maps").read_bytes():
                        self.found.add(int(process.name))
            time.sleep(LOOK)


def descendants(process: int) -> Iterator[Path]:
    """The folder in /proc of each process that a process has started, and of those that these have started."""
    for children in Path(f"/proc/{process}/task").glob("*/children"):
        with suppress(OSError):
            for child in children.read_text().split():
                yield Path("/proc", child)
                yield from descendants(int(child))
