"""Hands out items in shares: many at once if items take milliseconds, and one by one near the end."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence

# The most items of a share, for each item that its taker does at once. Outcomes of more items would fill the memory.
LARGEST = 2_000


class Shares:
    """Numbers of items, which several threads take in shares of about `seconds`. Each number is in only one share.

    A share has at least `least` items, as long as there are any. These are the items that its taker does at once.
    """

    def __init__(self, count: int, takers: int, seconds: float, least: int = 1) -> None:
        self._next, self._count, self._seconds = 0, count, seconds
        self._takers, self._least = takers, least
        self._back: deque[int] = deque()
        self._done, self._spent = 0, 0.0
        self._lock = threading.Lock()

    def take(self) -> list[int]:
        """The next share; empty if no items are left."""
        with self._lock:
            left = self._count - self._next + len(self._back)
            # No taker should work long when all others have finished. Before any time is known, a share is small.
            fair = max(left // (2 * self._takers), 1)
            most = int(self._seconds * self._done / self._spent) if self._spent else 1
            share = []
            for _ in range(min(left, max(self._least, min(fair, most, LARGEST * self._least)))):
                if self._back:
                    share.append(self._back.popleft())
                else:
                    share.append(self._next)
                    self._next += 1
            return share

    def give_back(self, numbers: Sequence[int]) -> None:
        """Return items that were taken and not done."""
        with self._lock:
            self._back.extend(numbers)

    def learn(self, items: int, seconds: float) -> None:
        """Record that `items` items took `seconds` seconds."""
        with self._lock:
            self._done, self._spent = self._done + items, self._spent + seconds
