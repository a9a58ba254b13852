"""How busy the machine is, for tests whose subject is a limit of time."""

import subprocess
import sys
import time

IDLE = 0.15  # s that a process with numpy, whose bytecode is there, takes to start where nothing else runs


def slowness():
    """How many times as long as on an idle machine a process takes to start now; at least 1."""
    begin = time.perf_counter()
    subprocess.run([sys.executable, "-c", "import numpy"], check=True)
    return max(1.0, (time.perf_counter() - begin) / IDLE)
