"""MuJoCo's coefficients of friction for pairs of geoms."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from overlapper.simulation.model import Array

# From so many dimensions of a contact on, it has sliding, torsional and rolling friction.
DIMENSIONS = (2, 4, 6)
OF_PAIR = [0, 2, 3]  # the places of these coefficients among those of an explicit pair
OVERRIDE = int(mujoco.mjtEnableBit.mjENBL_OVERRIDE)


def friction(model: Any, first: NDArray[np.int64], second: NDArray[np.int64]) -> Array:
    """(p, 3) sliding, torsional (m) and rolling friction (m) of the geoms `first` with the geoms `second`.

    The geom with the higher priority decides. With equal priorities, the larger coefficient counts. An explicit pair
    has its own coefficients. A contact of dimension 1 has no friction, one of dimension 3 only sliding friction, and
    one of dimension 4 no rolling friction. See mj_contactParam and mj_assignFriction.
    """
    priority, both = model.geom_priority, np.stack([first, second])
    values = model.geom_friction[both]
    dimensions = model.geom_condim[both]
    decides = priority[both] >= priority[both[::-1]]
    coefficient = np.where(decides[..., None], values, 0.0).max(axis=0)
    dimension = np.where(decides, dimensions, 0).max(axis=0)
    explicit = {
        tuple(sorted(pair)): k for k, pair in enumerate(zip(model.pair_geom1.tolist(), model.pair_geom2.tolist()))
    }
    for row, pair in enumerate(zip(first.tolist(), second.tolist())) if explicit else ():
        if (k := explicit.get(tuple(sorted(pair)))) is not None:
            coefficient[row], dimension[row] = model.pair_friction[k, OF_PAIR], model.pair_dim[k]
    if int(model.opt.enableflags) & OVERRIDE:
        coefficient[:] = model.opt.o_friction[OF_PAIR]
    return np.where(dimension[:, None] >= DIMENSIONS, coefficient, 0.0)
