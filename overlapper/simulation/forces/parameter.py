"""Parameters of contacts: numbers, or functions of the pair of links."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from overlapper.simulation.mechanics import Dynamics
from overlapper.simulation.model import Array, LinkKey

OfPair = Callable[[LinkKey, LinkKey], float]
"""The value for a pair of links ((body, link), (body, link)), the lesser first."""

# If no dissipation is given: it resists what rolls by little, and motion along the normal is damped besides.
DISSIPATION, DAMPING = 1e-3, 1.0


class Layers:
    """The elastic layers of the bodies: stiffness, dissipation and friction, as `VolumetricContact` takes them.

    With `distributed` friction, the coefficients are those of the simulator.
    """

    def __init__(
        self,
        stiffness: float | OfPair,
        dissipation: float | OfPair | None,
        friction: float | OfPair | Literal["distributed"] | None,
    ) -> None:
        self.distributed = isinstance(friction, str) and friction == "distributed"
        self._stiffness = Parameter("stiffness", stiffness, "Pa/m", positive=True)
        self._dissipation = Parameter("dissipation", DISSIPATION if dissipation is None else dissipation, "s")
        self._damping = DAMPING if dissipation is None else 0.0
        self._friction = None
        if friction is not None and not self.distributed:
            self._friction = Parameter("friction", friction, "")  # type: ignore[arg-type]  # no other text is a number

    def of(self, pairs: NDArray[np.int64], dynamics: Dynamics) -> tuple[Array, Array, Array, Array]:
        """Return stiffness, dissipation, coefficient of friction and damping ratio along the normal, each (p,).

        `pairs` (p, 2) are pairs of indices in `dynamics.links`.
        """
        links = dynamics.links
        friction = self._friction.of(pairs, links) if self._friction else dynamics.friction(pairs)
        damping = np.full(len(pairs), self._damping)
        return self._stiffness.of(pairs, links), self._dissipation.of(pairs, links), friction, damping


class Parameter:
    """A number for all pairs of links, or one number for each pair."""

    def __init__(self, name: str, given: float | OfPair, unit: str, positive: bool = False) -> None:
        self._name, self._unit, self._positive = name, f" in {unit}" if unit else "", positive
        self._function = given if callable(given) else None
        self._number = 0.0 if callable(given) else self._checked(given, "")
        self._known: dict[tuple[int, int], float] = {}
        self._links: Sequence[LinkKey] = ()

    def of(self, pairs: NDArray[np.int64], links: Sequence[LinkKey]) -> Array:
        """Return (p,) the values for `pairs` (p, 2), which are pairs of indices in `links`."""
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
        others = ", or 'distributed'" if self._name == "friction" and not of else ""
        try:
            number = float(given)
        except (TypeError, ValueError):
            number = math.nan
        if isinstance(given, str) or not (number > 0 or (number == 0 and not self._positive)) or math.isinf(number):
            raise ValueError(f"{self._name}{of} must be a number{self._unit} {least}{others}, not {given!r}")
        return number
