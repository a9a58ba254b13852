"""Processes that a script starts and that load the library of a simulator. Their steps are not noticed here.

Linux tells which libraries a process has loaded. It is asked repeatedly after the first process has started.
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

LOOK = 0.05  # s between two looks; importing the library takes longer

# Audit events of Python that may start a process. For multiprocessing, there is only the event of its import.
STARTS = frozenset({"subprocess.Popen", "os.posix_spawn", "os.system", "os.spawn", "pty.spawn"})
SPAWNING = frozenset({"multiprocessing.popen_spawn_posix", "multiprocessing.popen_forkserver"})


class OtherProcesses:
    """Notes the processes that this process starts from now on and that load `library`.

    Forked processes that run the same program are not noted. Nothing is noted on systems other than Linux.
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
                with suppress(OSError):  # the process has ended
                    # The command is read first: between fork and exec, a process has the libraries of this one.
                    if (process / "cmdline").read_bytes() != own and self._library in (process / "maps").read_bytes():
                        self.found.add(int(process.name))
            time.sleep(LOOK)


def descendants(process: int) -> Iterator[Path]:
    """The folder in /proc of each descendant of a process."""
    for children in Path(f"/proc/{process}/task").glob("*/children"):
        with suppress(OSError):
            for child in children.read_text().split():
                yield Path("/proc", child)
                yield from descendants(int(child))
