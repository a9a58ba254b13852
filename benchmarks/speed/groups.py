"""Time over the number of bodies: the article's claim of O(m n log n) for m bodies, beside this package and a peer."""

from __future__ import annotations

from collections.abc import Iterator
from statistics import median
from typing import NamedTuple

import exact
import numpy as np
from strategies import directions

from harness.command import Wrong
from harness.peers import PEERS
from harness.timing import in_turn
from overlapper import Hull, Placed
from speed.turns import error_of

COUNTS = (2, 4, 8, 16, 32, 64)  # bodies
VERTICES = 32  # of each
ASKED = ("paper", "auto", "manifold3d")
SLOWEST = 0.2  # s: a peer that takes longer is not asked about more bodies


class Row(NamedTuple):
    """A line of the results. `us` is the median of the processor's time."""

    method: str
    vertices: int
    bodies: int
    us: str
    error: str


def measured(seconds: float) -> Iterator[Row]:
    """The peers in turn, for about so many seconds at each number of bodies. Raises Wrong."""
    rng, asked = np.random.default_rng(1), list(ASKED)
    for count in COUNTS:
        clouds = [directions(rng, VERTICES) + 0.2 * directions(rng, 1) for _ in range(count)]
        bodies = [Placed(Hull(cloud)) for cloud in clouds]
        volume = exact.common(*map(exact.hull, clouds)).volume
        calls = {name: PEERS["volume"][name].prepare(bodies, PEERS["volume"][name].settings[0]) for name in asked}
        errors = {name: error_of(call(), volume) for name, call in calls.items()}
        if errors["auto"] > 1e-12:
            raise Wrong(f"{count} bodies: auto is off by {errors['auto']:.1e}")
        samples = dict(zip(asked, in_turn([*calls.values()], 3, seconds / len(calls))))
        for name in asked:
            yield Row(name, VERTICES, count, f"{1e6 * median(samples[name]):.4g}", f"{errors[name]:.2e}")
        asked = [name for name in asked if median(samples[name]) <= SLOWEST]
