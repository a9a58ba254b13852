"""MuJoCo's own answers for pairs of geoms: which of its contacts overlap, and its signed distances."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from overlapper.simulation.mujoco.geoms import HFIELD
from overlapper.simulation.mujoco.pair_rule import NO_CONTACTS, PairRule, contact_filter

SLEEP = int(mujoco.mjtEnableBit.mjENBL_SLEEP)
FAR = 1e10  # m; mj_geomDistance searches as far as this


def own_distances(model: Any, data: Any, pairs: NDArray[np.int64]) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """(n,) whether the pairs (n, 2) of geoms overlap by MuJoCo, and (n,) their signed distances, m.

    The distance from a height field is NaN. A pair overlaps if one of its contacts has a negative `dist`. If MuJoCo
    does not test the pair, the sign of the distance decides.
    """
    least: dict[tuple[int, ...], float] = {}
    for geoms, distance in zip(np.sort(data.contact.geom, axis=1).tolist(), data.contact.dist.tolist()):
        least[tuple(geoms)] = min(distance, least.get(tuple(geoms), distance))
    distances = np.array([_signed_distance(model, data, *pair) for pair in pairs.tolist()], dtype=float)
    distances[(model.geom_type[pairs] == HFIELD).any(axis=1)] = np.nan
    untested = np.where(_tested(model, data, pairs), 0.0, distances).tolist()
    asked = map(tuple, np.sort(pairs, axis=1).tolist())
    return np.array([least.get(pair, other) < 0 for pair, other in zip(asked, untested)], dtype=bool), distances


def _signed_distance(model: Any, data: Any, first: int, second: int) -> float:
    # A larger limit makes some depths too large if native CCD is disabled.
    depth = mujoco.mj_geomDistance(model, data, first, second, 0.0, None)
    return float(depth if depth < 0 else mujoco.mj_geomDistance(model, data, first, second, FAR, None))


def _tested(model: Any, data: Any, pairs: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(n,) whether MuJoCo tests these pairs for contacts in any case."""
    off, on = int(model.opt.disableflags) & NO_CONTACTS, int(model.opt.enableflags) & SLEEP
    if off or on or mujoco.get_mjcb_contactfilter() is not contact_filter():
        return np.zeros(len(pairs), dtype=bool)
    return PairRule(model, data, np.arange(model.ngeom)).allow(*pairs.T)
