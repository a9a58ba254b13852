"""Packages that import the names that they offer on first access."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module


def lazily(package: str, offers: Mapping[str, tuple[str, ...]], needs: str | None = None) -> Callable[[str], object]:
    """The `__getattr__` of a package (PEP 562) that offers names of its modules.

    `needs` is the text of the ImportError for a library that is not installed. Without it, the module's text is kept.
    """
    homes = {name: module for module, names in offers.items() for name in names}

    def getattr_(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        try:
            return getattr(import_module(f".{homes[name]}", package), name)
        except ImportError as error:
            if needs:
                raise ImportError(f"{package} needs {needs}") from error
            raise

    return getattr_
