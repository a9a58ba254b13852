"""The `Source` of a MuJoCo model with its data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from overlapper import _core
from overlapper.simulation.layout import Layout
from overlapper.simulation.model import Array, LinkKey, ModelledBody, Skipped
from overlapper.simulation.mujoco.contact import GeomContact
from overlapper.simulation.mujoco.geoms import collidable, drawn_from, modelled_bodies
from overlapper.simulation.mujoco.pair_rule import PairRule, contact_filter, in_force
from overlapper.simulation.mujoco.silence import asked_flags
from overlapper.simulation.mujoco.stepping import MujocoStepping
from overlapper.simulation.source import Source

UNPOSED = [[0.0, 0.0, 0.0, 0.0]]
"""The quaternion of the first geom, as long as MuJoCo has not computed the poses of any geom."""


class GeomPoses:
    """The poses of some geoms of `data`. MuJoCo's quaternions are wxyz."""

    def __init__(self, data: Any, colliders: Sequence[LinkKey]) -> None:
        self.colliders = colliders
        geoms = np.array([geom for _, geom in colliders], dtype=np.int64)
        self._frames = _core.ChosenFrames(data.geom_xpos, data.geom_xquat, geoms)

    def read(self) -> Array:
        return self._frames.read()


class MujocoSource(Source):
    """See `Source`; the arguments are those of `Bodies`."""

    engine = "mujoco"
    poses_lag = True
    contact = GeomContact

    def __init__(self, model: Any, data: Any, given_names: Mapping[int, str]) -> None:
        self._model, self._data, self._given_names = model, data, dict(given_names)
        self.bodies: dict[int, ModelledBody] = {}
        self._first_turn = data.geom_xquat[:1]
        # The numbers of the model from which the bodies and the rules were read.
        self._drawn, self._in_force = _core.Snapshot(drawn_from(model)), _core.Snapshot(in_force(model))
        self._flags = -1
        self._was_read = False
        self._rule: tuple[object, Layout, PairRule] | None = None
        self._filter_told = False
        # At the end of the last step: time, coordinates, and the poses of mocap bodies.
        self._end: tuple[float, Array, Array, Array] | None = None
        self._spare: Any = None  # a second MjData, for poses at other coordinates

    @property
    def time_step(self) -> float:
        return float(self._model.opt.timestep)

    def refresh(self) -> list[Skipped] | None:
        if self._first_turn.tolist() == UNPOSED:
            raise ValueError("data has no poses yet: call mujoco.mj_forward(model, data) first")
        flags, other_flags = asked_flags(self._model), self._flags
        drawn, in_force = self._drawn.renew(), self._in_force.renew()
        if self._was_read and not drawn and not in_force and flags == other_flags:
            return None
        self._rule, self._flags = None, flags
        before = {each for body in self.bodies.values() for each in body.skipped} | set(
            self.skipped if self._was_read else ()
        )
        self._was_read = True
        self.bodies = modelled_bodies(self._model, collidable(self._model), self._given_names)
        skipped = [*(each for body in self.bodies.values() for each in body.skipped), *self.skipped]
        return [each for each in skipped if each not in before]

    def poses(self, links: Mapping[int, Sequence[int]]) -> GeomPoses:
        return GeomPoses(self._data, [(body, geom) for body, geoms in links.items() for geom in geoms])

    def step_ended(self) -> None:
        data = self._data
        self._end = data.time, data.qpos.copy(), data.mocap_pos.copy(), data.mocap_quat.copy()

    def end_of_step(self, layout: Layout) -> tuple[Array, Array] | None:
        """Mocap bodies are moved between steps. Only if the time goes back, this is a reset and not a motion."""
        data = self._data
        if self._end is None or np.array_equal(self._end[1], data.qpos):
            return None
        if self._spare is None:
            self._spare = mujoco.MjData(self._model)
        time, self._spare.qpos[:], *mocap = self._end
        if data.time >= time:
            mocap = [data.mocap_pos, data.mocap_quat]
        self._spare.mocap_pos[:], self._spare.mocap_quat[:] = mocap
        mujoco.mj_kinematics(self._model, self._spare)
        return layout.placed(GeomPoses(self._spare, layout.poses.colliders).read())

    def rules(self, layout: Layout) -> PairRule:
        asked = contact_filter()
        if not self._rule or self._rule[0] is not asked or self._rule[1] is not layout:
            geoms = np.array([geom for _, geom in layout.collider_rows], dtype=np.int64)
            self._rule = asked, layout, PairRule(self._model, self._data, geoms)
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
