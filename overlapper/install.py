"""Hints on missing libraries. They name the library and not an extra, because this package may be on no index."""

from __future__ import annotations

import sys
import sysconfig


def hint(*packages: str) -> str:
    """The packages, and the command that installs them, as the end of a sentence about the code that needs them."""
    return f"{' and '.join(packages)}: pip install {' '.join(packages)}"


def simulator_hint() -> str:
    """The hint for pybullet. conda-forge builds it for more systems and versions than PyPI has wheels for."""
    has_wheel = sys.version_info < (3, 12) and sysconfig.get_platform() == "linux-x86_64"
    where = ", or conda install -c conda-forge pybullet"
    wheels = " (pip has wheels for CPython 3.10 and 3.11 on Linux x86-64, and compiles it elsewhere)"
    return hint("pybullet") + where + ("" if has_wheel else wheels)
