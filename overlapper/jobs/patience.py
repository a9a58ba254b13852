"""Items that are under way for so long that somebody should hear of it, as nothing else ends them."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Sequence

LATE = 600.0  # s after which items are told of

Late = Callable[[Sequence[int], float], object]
"""Called with the numbers of some items, one of which is under way for so many seconds."""


class Patience:
    """Tells of items that are under way for longer than LATE, once of each. Any thread may say what begins and ends."""

    def __init__(self, late: Late | None) -> None:
        self._late = late
        self._begun: dict[Hashable, tuple[Sequence[int], float]] = {}
        self._told: set[tuple[int, ...]] = set()

    def begin(self, who: Hashable, numbers: Sequence[int]) -> None:
        """Somebody begins with some items, and has ended those before."""
        self._begun[who] = numbers, time.monotonic()

    def end(self, who: Hashable) -> None:
        """Somebody has ended his items."""
        self._begun.pop(who, None)

    def look(self) -> None:
        """Tell of items that are late."""
        for numbers, since in tuple(self._begun.values()) if self._late else ():
            passed = time.monotonic() - since
            if self._late and passed > LATE and tuple(numbers) not in self._told:
                self._told.add(tuple(numbers))
                self._late(numbers, passed)
