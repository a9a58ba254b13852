"""Scripts that ask pybullet for a window, where there may be no screen to show it on."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from typing import Any

import pybullet

WINDOWS = frozenset({pybullet.GUI, pybullet.GUI_SERVER, pybullet.GUI_MAIN_THREAD})


def open_no_window() -> None:
    """From now on, a client that asks for a window gets the same simulation without one."""
    connect: Callable[..., int] = pybullet.connect

    def connect_without(method: int, *args: Any, **kwargs: Any) -> int:
        return connect(pybullet.DIRECT if method in WINDOWS else method, *args, **kwargs)

    pybullet.connect = connect_without


def tell_of_windows(tell: Callable[[], object]) -> None:
    """From now on, `tell` is called before pybullet is asked for a window where there is no screen.

    pybullet then ends the process in C, and Python cannot report anything any more.
    """
    connect: Callable[..., int] = pybullet.connect

    def connect_telling(method: int, *args: Any, **kwargs: Any) -> int:
        if method in WINDOWS and sys.platform == "linux" and not os.environ.get("DISPLAY"):
            tell()
        return connect(method, *args, **kwargs)

    pybullet.connect = connect_telling
