"""Models whose contacts are turned off for a while, because other forces replace them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from weakref import WeakKeyDictionary

import mujoco

CONTACT = int(mujoco.mjtDisableBit.mjDSBL_CONTACT)

_silent: WeakKeyDictionary[Any, tuple[int, int]] = WeakKeyDictionary()
"""By model: how often it was silenced, and CONTACT if contacts were off before."""


def silence(model: Any) -> None:
    """Turn the contacts of a model off, until `end_silence` was called as often."""
    times, before = _silent.get(model, (0, int(model.opt.disableflags) & CONTACT))
    _silent[model] = times + 1, before
    model.opt.disableflags |= CONTACT


def end_silence(model: Any) -> None:
    """Undo one call of `silence`. The last one restores the flag of contacts."""
    times, before = _silent.pop(model)
    if times > 1:
        _silent[model] = times - 1, before
    elif not before:
        model.opt.disableflags &= ~CONTACT


@contextmanager
def silenced(model: Any) -> Iterator[None]:
    """Contacts are off within the `with`."""
    silence(model)
    try:
        yield
    finally:
        end_silence(model)


def asked_flags(model: Any) -> int:
    """The flags that disable parts of MuJoCo, as they are without `silence`."""
    flags = int(model.opt.disableflags)
    return flags & ~CONTACT | _silent[model][1] if model in _silent else flags
