"""MuJoCo's coefficients of sliding friction for pairs of geoms."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from overlapper.simulation.model import Array

OVERRIDE = int(mujoco.mjtEnableBit.mjENBL_OVERRIDE)


def friction(model: Any, first: NDArray[np.int64], second: NDArray[np.int64]) -> Array:
    """(p,) the coefficients of the geoms `first` with the geoms `second`. See mj_contactParam and mj_assignFriction.

    The geom with the higher priority decides. With equal priorities, the larger coefficient counts. An explicit pair
    has its own coefficient. A contact of dimension 1 has no friction.
    """
    priority, both = model.geom_priority, np.stack([first, second])
    values = model.geom_friction[both, 0]
    dimensions = model.geom_condim[both]
    decides = priority[both] >= priority[both[::-1]]
    coefficient = np.where(decides, values, 0.0).max(axis=0)
    dimension = np.where(decides, dimensions, 0).max(axis=0)
    explicit = {
        tuple(sorted(pair)): k for k, pair in enumerate(zip(model.pair_geom1.tolist(), model.pair_geom2.tolist()))
    }
    for row, pair in enumerate(zip(first.tolist(), second.tolist())) if explicit else ():
        if (k := explicit.get(tuple(sorted(pair)))) is not None:
            coefficient[row], dimension[row] = model.pair_friction[k, 0], model.pair_dim[k]
    if int(model.opt.enableflags) & OVERRIDE:
        coefficient[:] = model.opt.o_friction[0]
    return np.where(dimension > 1, coefficient, 0.0)
