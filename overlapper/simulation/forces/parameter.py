"""Parameters of contacts: numbers, or functions of the pair of links."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Iterable, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from overlapper.simulation.mechanics import Dynamics
from overlapper.simulation.model import Array, LinkKey

OfPair = Callable[[LinkKey, LinkKey], float]
"""The value for a pair of links ((body, link), (body, link)), the lesser first."""

# If no dissipation is given, in s: it resists what rolls by little. Depths recover within the second time.
DISSIPATION, RECOVERY = 1e-3, 0.02

# In N: bodies without a weight, which forces do not move, count as bodies of this weight.
LIGHTEST = 1e-3

# If no stiffness is given, but a dissipation: in Pa/m, soft enough to follow each swing.
STIFFNESS = 1e7

# If neither is given: a ball with this many times the weight of the heavier body rests at this share of its
# diameter.
LOAD, SHARE = 10.0, 1e-3


class Layers:
    """The elastic layers of the bodies: the laws of contact, as `VolumetricContact` takes them.

    With `distributed` friction, the coefficients are those of the simulator.
    """

    def __init__(
        self,
        stiffness: float | OfPair | None,
        dissipation: float | OfPair | None,
        friction: float | OfPair | Literal["distributed"] | None,
        restitution: float | OfPair | None,
        rolling: float | OfPair | None,
        hardening: float | OfPair | None,
    ) -> None:
        self.distributed = isinstance(friction, str) and friction == "distributed"
        self.recovers = dissipation is None
        if restitution is not None and not self.recovers:
            raise ValueError("restitution must not be given with dissipation, which determines how bodies bounce")
        if hardening is not None and self.distributed:
            raise ValueError(
                "hardening must not be given with friction='distributed', which knows the linear law alone"
            )
        self._dissipation = Parameter("dissipation", DISSIPATION if dissipation is None else dissipation, "s")
        if stiffness is None and not self.recovers:
            stiffness = STIFFNESS
        # Values that are not given are those of the simulator, or follow from masses and sizes.
        given = {"stiffness": stiffness, "friction": None if self.distributed else friction}
        given |= {"restitution": restitution, "rolling": rolling, "hardening": hardening}
        units = {"stiffness": "Pa/m", "rolling": "m", "hardening": "1/m"}
        self._given = {
            name: Parameter(name, value, units.get(name, ""), positive=name == "stiffness")  # type: ignore[arg-type]
            for name, value in given.items()
            if value is not None
        }

    def check(self, pairs: Iterable[tuple[LinkKey, LinkKey]], flat: Container[LinkKey]) -> None:
        """Raise a ValueError if one of these pairs of links has a hardening, and neither link is `flat`.

        The shapes of flat links are half-spaces.
        """
        hardening = self._given.get("hardening")
        if hardening is None:
            return
        for a, b in pairs:
            if a not in flat and b not in flat and hardening.of_links(a, b) > 0:
                raise ValueError(
                    f"hardening must be 0 between {a} and {b}, as neither is a half-space, whose patches are flat; "
                    "it may be a function of the pair"
                )

    def of(self, pairs: NDArray[np.int64], dynamics: Dynamics, sizes: Array) -> dict[str, Array]:
        """Return the laws of each pair (p,), by the names of the arguments of `ContactSolver.place`.

        `pairs` (p, 2) are pairs of indices in `dynamics.links`. `sizes` (n,) in m are those of the links.
        """
        found = {name: each.of(pairs, dynamics.links) for name, each in self._given.items()}
        if "stiffness" not in found:
            found["stiffness"] = resting_stiffness(dynamics.weights()[pairs].max(axis=1), sizes[pairs].min(axis=1))
        if "friction" not in found:
            found["friction"] = dynamics.friction(pairs)
        simulated = dynamics.resistance(pairs)
        found = simulated | found
        if not self.recovers:
            del found["restitution"]
        found["recovery"] = np.full(len(pairs), RECOVERY if self.recovers else 0.0)
        found["dissipation"] = self._dissipation.of(pairs, dynamics.links)
        return found


def resting_stiffness(weights: Array, sizes: Array) -> Array:
    """Return the stiffness in Pa/m at which balls of these diameters (m) rest `SHARE` of them deep.

    Each ball bears `LOAD` times its weight (N).
    """
    volumes = np.pi / 2 * SHARE**2 * sizes**3  # of a shallow cap of a ball
    return np.asarray(LOAD * np.maximum(weights, LIGHTEST) / np.where(np.isfinite(volumes), volumes, 1.0))


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
        if (a, b) not in self._known:
            self._known[a, b] = self.of_links(self._links[a], self._links[b])
        return self._known[a, b]

    def of_links(self, first: LinkKey, second: LinkKey) -> float:
        """The value for two links."""
        if self._function is None:
            return self._number
        return self._checked(self._function(first, second), f" of {first} and {second}")

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
