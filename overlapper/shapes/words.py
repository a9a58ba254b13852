"""Numbers in words."""

from __future__ import annotations

from collections.abc import Iterable


def times(sides: Iterable[float]) -> str:
    return " × ".join(f"{side:.4g}" for side in sides)
