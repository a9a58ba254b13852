"""Reports items that are under way for very long, because nothing else ends them."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Sequence

LATE = 600.0  # s after which items are reported

Late = Callable[[Sequence[int], float], object]
"""Called with the numbers of some items and the seconds for which one of them has been under way."""


class Patience:
    """Reports each item that is under way for longer than LATE once. Any thread may call `begin` and `end`."""

    def __init__(self, late: Late | None) -> None:
        self._late = late
        self._begun: dict[Hashable, tuple[Sequence[int], float]] = {}
        self._told: set[tuple[int, ...]] = set()

    def begin(self, who: Hashable, numbers: Sequence[int]) -> None:
        """`who` begins with some items, and has ended its earlier items."""
        self._begun[who] = numbers, time.monotonic()

    def end(self, who: Hashable) -> None:
        """`who` has ended its items."""
        self._begun.pop(who, None)

    def look(self) -> None:
        """Report items that are late."""
        for numbers, since in tuple(self._begun.values()) if self._late else ():
            passed = time.monotonic() - since
            if self._late and passed > LATE and tuple(numbers) not in self._told:
                self._told.add(tuple(numbers))
                self._late(numbers, passed)
