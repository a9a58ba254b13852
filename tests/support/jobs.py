"""Jobs for the engines of sweeps. Each item names the action that the job takes."""

import ctypes
import os
import signal
import sys
import time
from pathlib import Path


def breaking(setup, found):
    """Gathers nothing, as an installation that ends the processes of the cluster."""
    os.kill(os.getpid(), signal.SIGKILL)


def doing(setup):
    """Items are pairs of a word and a value; `setup` is given back with the value, and where that was done."""
    if setup == "never":
        raise ValueError("there is no such thing.")

    def do(item):
        word, value = item
        if word == "tell":
            print(value, file=sys.stderr)
        elif word == "raise":
            raise ValueError(value)
        elif word == "hang":
            time.sleep(600)
        elif word == "hang in C":
            ctypes.PyDLL(None).sleep(600)  # which gives no other thread of Python a turn
        elif word == "abort":
            os.abort()
        elif word == "exit":
            sys.exit(value)
        elif word == "die once" and not Path(value).exists():
            Path(value).touch()
            os.kill(os.getpid(), signal.SIGKILL)
        elif word == "sleep":
            time.sleep(value)
        return setup, value, os.getpid(), os.getcwd()

    return do
