"""MuJoCo's rule of which geoms may collide, for any pairs of geoms."""

from __future__ import annotations

from _ctypes import CFuncPtr
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from overlapper import _core
from overlapper.simulation.collision_rules import Indices, Mask, Rules
from overlapper.simulation.mujoco.geoms import HFIELD, PLANE
from overlapper.simulation.mujoco.silence import asked_flags

NO_CONTACTS = int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
ROWS = 1 << 20  # pairs counted at a time


def in_force(model: Any) -> list[NDArray[Any]]:
    """All numbers of the model that the rule depends on, except flags. They may be edited at any time."""
    return [
        model.geom_contype,
        model.geom_conaffinity,
        model.body_contype,
        model.body_conaffinity,
        model.geom_type,
        model.pair_geom1,
        model.pair_geom2,
        model.exclude_signature,
    ]


def contact_filter() -> Callable[[Any, Any, int, int], int] | None:
    """The contact filter that was set with mujoco.set_mjcb_contactfilter, if it is a function of Python."""
    found: Any = mujoco.get_mjcb_contactfilter()
    return None if isinstance(found, CFuncPtr) else found


class PairRule(Rules):
    """Which pairs of these geoms may collide, by index into `geoms`.

    A pair may collide if the mask of one geom admits the other, if they are not welded together or both fixed, if
    neither is the other's parent, and if their bodies are not excluded. An explicit pair may collide in any case.
    Nothing collides while contacts or constraints are disabled. See mj_collision in engine_collision_driver.c.

    With a contact filter, the masks of the bodies decide instead of those of the geoms, and then the filter.
    """

    def __init__(self, model: Any, data: Any, geoms: NDArray[np.int64]) -> None:
        body = model.geom_bodyid[geoms]
        weld = model.body_weldid[body]
        parent = model.body_weldid[model.body_parentid[weld]]
        group, mask = model.geom_contype[geoms], model.geom_conaffinity[geoms]
        self._geoms, self._model, self._data, self._filter = geoms.tolist(), model, data, contact_filter()
        if self._filter:
            on = (group | mask) != 0
            group = np.where(on, model.body_contype[body], 0)
            mask = np.where(on, model.body_conaffinity[body], 0)
        fixed, surface = model.body_dofnum[weld] == 0, np.isin(model.geom_type[geoms], (PLANE, HFIELD))
        flags = asked_flags(model)
        place = np.full(model.ngeom, -1)
        place[geoms] = np.arange(len(geoms))
        explicit = np.stack([place[model.pair_geom1], place[model.pair_geom2]], axis=1)
        explicit = explicit[(explicit >= 0).all(axis=1)]
        numbers = np.stack([group, mask, body, weld, parent, fixed, surface], axis=1).astype(np.int64)
        by_parent = not flags & int(mujoco.mjtDisableBit.mjDSBL_FILTERPARENT)
        self._rule = _core.WeldRule(numbers, model.exclude_signature, explicit, by_parent, bool(flags & NO_CONTACTS))
        self.lasting = not self._filter

    def allow(self, first: Indices, second: Indices) -> Mask:
        """Whether the geoms at these indices may collide, pair by pair."""
        allowed = self._rule.allow(first, second)
        if self._filter:
            asked = self._rule.allow(first, second, listed=False)
            for k in np.flatnonzero(asked).tolist():
                a, b = self._geoms[first[k]], self._geoms[second[k]]
                if self._filter(self._model, self._data, a, b):
                    allowed[k] = self._rule.lists(int(first[k]), int(second[k]))
        return allowed

    def count(self, weights: NDArray[np.int64]) -> int:
        """How many pairs of shapes may collide, if `weights` (n,) says how many shapes each geom has."""
        if not self._filter:
            return self._rule.count(weights)
        places = np.flatnonzero(weights)
        total = 0
        at_once = max(1, ROWS // max(len(places), 1))
        for begin in range(0, len(places), at_once):
            first, second = np.meshgrid(places[begin : begin + at_once], places, indexing="ij")
            each = first < second
            a, b = first[each], second[each]
            total += int((weights[a] * weights[b])[self.allow(a, b)].sum())
        return total

    def mask(self, colliders: Indices) -> _core.PairMask:
        return _core.PairMask.of_rule(colliders, self._rule)
