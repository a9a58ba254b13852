"""The `Source` of a MuJoCo model with its data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from overlapper.simulation.layout import Layout, Pose
from overlapper.simulation.model import LinkKey, ModelledBody, Skipped
from overlapper.simulation.mujoco.contact import GeomContact
from overlapper.simulation.mujoco.geoms import collidable, drawn_from, modelled_bodies
from overlapper.simulation.mujoco.pair_rule import PairRule, contact_filter, in_force
from overlapper.simulation.mujoco.stepping import MujocoStepping
from overlapper.simulation.source import Source

XYZW = np.array([1, 2, 3, 0])


class GeomPoses:
    """The poses of some geoms of `data`. MuJoCo's quaternions are wxyz."""

    def __init__(self, data: Any, colliders: Sequence[LinkKey]) -> None:
        self.colliders = colliders
        self._data, self._geoms = data, np.array([geom for _, geom in colliders], dtype=np.intp)

    def read(self) -> list[Pose]:
        positions = self._data.geom_xpos.take(self._geoms, axis=0)
        orientations = self._data.geom_xquat.take(self._geoms, axis=0).take(XYZW, axis=1)
        return list(zip(positions.tolist(), orientations.tolist()))


class MujocoSource(Source):
    """See `Source`; the arguments are those of `Bodies`."""

    engine = "mujoco"
    contact = GeomContact

    def __init__(self, model: Any, data: Any, given_names: Mapping[int, str]) -> None:
        self._model, self._data, self._given_names = model, data, dict(given_names)
        self.bodies: dict[int, ModelledBody] = {}
        self._read: tuple[bytes, bytes] | None = None  # the numbers of the model from which the bodies were read
        self._rule: tuple[object, Layout, PairRule] | None = None
        self._flexes_told = self._filter_told = False

    @property
    def time_step(self) -> float:
        return float(self._model.opt.timestep)

    def refresh(self) -> list[Skipped] | None:
        if self._model.ngeom and not self._data.geom_xquat.any():
            raise ValueError("data has no poses yet: call mujoco.mj_forward(model, data) first")
        now = drawn_from(self._model), in_force(self._model)
        if now == self._read:
            return None
        before = {each for body in self.bodies.values() for each in body.skipped} | set(
            self.skipped if self._read else ()
        )
        self._read = now
        self.bodies = modelled_bodies(self._model, collidable(self._model), self._given_names)
        skipped = [*(each for body in self.bodies.values() for each in body.skipped), *self.skipped]
        return [each for each in skipped if each not in before]

    def poses(self, links: Mapping[int, Sequence[int]]) -> GeomPoses:
        return GeomPoses(self._data, [(body, geom) for body, geoms in links.items() for geom in geoms])

    def rules(self, layout: Layout) -> PairRule:
        assert self._read  # by `refresh`
        now = self._read[1], contact_filter()
        if not self._rule or self._rule[0] != now or self._rule[1] is not layout:
            geoms = np.array([geom for _, geom in layout.collider_rows], dtype=np.int64)
            self._rule = now, layout, PairRule(self._model, self._data, geoms)
        return self._rule[2]

    @property
    def skipped(self) -> list[Skipped]:
        """The flexes, which are not rigid."""
        kind = mujoco.mjtObj.mjOBJ_FLEX
        names = (mujoco.mj_id2name(self._model, kind, k) or f"flex {k}" for k in range(self._model.nflex))
        return [Skipped(-1, -1, name, "flexes are deformable bodies, which are not modelled") for name in names]

    @property
    def unidentified(self) -> int:
        return int(self._model.nflex)

    def mechanics(self) -> MujocoStepping:
        lost = next((each for body in self.bodies.values() for each in body.skipped), None)
        if lost := lost or next(iter(self.skipped), None):
            raise ValueError(f"VolumetricContact cannot replace MuJoCo's contacts of {lost.name}: {lost.reason}")
        return MujocoStepping(self._model, self._data)

    def cautions(self, layout: Layout) -> Iterator[Warning]:
        """One warning if a contact filter in C decides which pairs collide, as Python cannot ask the filter."""
        if not self._filter_told and mujoco.get_mjcb_contactfilter() is not contact_filter():
            self._filter_told = True
            yield UserWarning(
                "mujoco.set_mjcb_contactfilter set a function of C, so the masks do not decide which pairs collide: "
                "give the pairs with overlaps(pairs=...)"
            )
