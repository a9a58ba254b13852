"""Parameters of contacts: numbers, or functions of the pair of links."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overlapper.simulation.model import Array, LinkKey

OfPair = Callable[[LinkKey, LinkKey], float]
"""The value for a pair of links ((body, link), (body, link)), the lesser first."""


class Parameter:
    """A number, or one for each pair of links."""

    def __init__(self, name: str, given: float | OfPair, unit: str, positive: bool = False) -> None:
        self._name, self._unit, self._positive = name, f" {unit}" if unit else "", positive
        self._function = given if callable(given) else None
        self._number = 0.0 if callable(given) else self._checked(given, "")
        self._known: dict[tuple[int, int], float] = {}
        self._links: Sequence[LinkKey] = ()

    def of(self, pairs: NDArray[np.int64], links: Sequence[LinkKey]) -> Array:
        """(p,) of pairs (p, 2) of places in `links`."""
        if self._function is None:
            return np.full(len(pairs), self._number)
        if links is not self._links:
            self._links, self._known = links, {}
        return np.array([self._of_pair(a, b) for a, b in pairs.tolist()], dtype=float)

    def _of_pair(self, a: int, b: int) -> float:
        assert self._function is not None
        if (a, b) not in self._known:
            first, second = self._links[a], self._links[b]
            of = f" of {first} and {second}"
            self._known[a, b] = self._checked(self._function(first, second), of)
        return self._known[a, b]

    def _checked(self, given: Any, of: str) -> float:
        least = "greater than 0" if self._positive else "0 or greater"
        try:
            number = float(given)
        except (TypeError, ValueError):
            number = math.nan
        if isinstance(given, str) or not (number > 0 or (number == 0 and not self._positive)) or math.isinf(number):
            raise ValueError(f"{self._name}{of} must be a number{self._unit} {least}, not {given!r}")
        return number
