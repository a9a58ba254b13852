"""MuJoCo's rule of which geoms may collide, for any pairs of geoms."""

from __future__ import annotations

from _ctypes import CFuncPtr
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

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
        body = model.geom_bodyid[geoms].astype(np.int64)
        weld = model.body_weldid[body].astype(np.int64)
        self._body, self._weld = body, weld
        self._parent = model.body_weldid[model.body_parentid[weld]].astype(np.int64)
        self._fixed = model.body_dofnum[weld] == 0
        self._group, self._mask = model.geom_contype[geoms].copy(), model.geom_conaffinity[geoms].copy()
        self._geoms, self._model, self._data, self._filter = geoms.tolist(), model, data, contact_filter()
        if self._filter:
            on = (self._group | self._mask) != 0
            self._group = np.where(on, model.body_contype[body], 0)
            self._mask = np.where(on, model.body_conaffinity[body], 0)
        self._surface = np.isin(model.geom_type[geoms], (PLANE, HFIELD))
        flags = asked_flags(model)
        self._by_parent = not flags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
        self._none = bool(flags & NO_CONTACTS)
        self._excluded = np.unique(model.exclude_signature.astype(np.int64))
        place = np.full(model.ngeom, -1)
        place[geoms] = np.arange(len(geoms))
        first, second = place[model.pair_geom1], place[model.pair_geom2]
        known = (first >= 0) & (second >= 0)
        self._explicit = np.unique(self._code(np.minimum(first, second)[known], np.maximum(first, second)[known]))
        self.lasting = not self._filter

    def allow(self, first: Indices, second: Indices) -> Mask:
        """Whether the geoms at these indices may collide, pair by pair."""
        if self._none:
            return np.zeros(len(first), dtype=bool)
        group, mask, weld, parent = self._group, self._mask, self._weld, self._parent
        allowed = ((group[first] & mask[second]) | (group[second] & mask[first])) != 0
        allowed &= (weld[first] != weld[second]) & ~(self._fixed[first] & self._fixed[second])
        if self._by_parent:  # MuJoCo does not count the world as a parent
            related = (weld[first] == parent[second]) | (weld[second] == parent[first])
            allowed &= ~(related & (weld[first] != 0) & (weld[second] != 0))
        if len(self._excluded):
            a, b = self._body[first], self._body[second]
            allowed &= ~np.isin((np.minimum(a, b) << 16) + np.maximum(a, b), self._excluded)
        if self._filter:
            for k in np.flatnonzero(allowed).tolist():
                a, b = self._geoms[first[k]], self._geoms[second[k]]
                allowed[k] = not self._filter(self._model, self._data, a, b)
        if len(self._explicit):
            allowed |= np.isin(self._code(np.minimum(first, second), np.maximum(first, second)), self._explicit)
        # Two planes, two height fields, or one of each have no contacts.
        return np.asarray(allowed & ~(self._surface[first] & self._surface[second]))

    def count(self, weights: NDArray[np.int64]) -> int:
        """How many pairs of shapes may collide, if `weights` (n,) says how many shapes each geom has."""
        places = np.flatnonzero(weights)
        total = 0
        at_once = max(1, ROWS // max(len(places), 1))
        for begin in range(0, len(places), at_once):
            first, second = np.meshgrid(places[begin : begin + at_once], places, indexing="ij")
            each = first < second
            a, b = first[each], second[each]
            total += int((weights[a] * weights[b])[self.allow(a, b)].sum())
        return total

    def _code(self, first: Indices, second: Indices) -> Indices:
        return np.asarray(first * np.int64(len(self._body)) + second)
