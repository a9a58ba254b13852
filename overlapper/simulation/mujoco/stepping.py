"""Steps of a MuJoCo simulation in which other forces replace MuJoCo's contacts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any
from weakref import WeakSet

import mujoco
import numpy as np

from overlapper.simulation.model import LinkKey
from overlapper.simulation.mujoco.calls import stepped, unheard
from overlapper.simulation.mujoco.dynamics import MujocoDynamics
from overlapper.simulation.mujoco.geoms import collidable
from overlapper.simulation.mujoco.pair_rule import PairRule
from overlapper.simulation.mujoco.silence import end_silence, silence, silenced

EULER, SLEEP = mujoco.mjtIntegrator.mjINT_EULER, int(mujoco.mjtEnableBit.mjENBL_SLEEP)

_inside: WeakSet[mujoco.MjData] = WeakSet()
"""The simulations that a `MujocoStepping` has entered."""


class MujocoStepping:
    """See `Mechanics`.

    `wrenches` (b, 6) are forces and torques about the centres of mass of all bodies, for the next substep. `length` is
    that of the last substep, s.
    """

    restored = 0  # a restored state is the state of `data`, and nothing else is kept

    def __init__(self, model: Any, data: Any) -> None:
        self.model, self.data = model, data
        self.length = float(model.opt.timestep)
        self.wrenches = np.zeros((model.nbody, 6))
        self._must_be_supported()

    def dynamics(self, bodies: Sequence[int]) -> MujocoDynamics:
        return MujocoDynamics(self, bodies)

    def enter(self, pairs: Iterable[tuple[LinkKey, LinkKey]]) -> None:
        if self.data in _inside:
            raise RuntimeError("data already has an active VolumetricContact: leave its `with` block first")
        self._must_be_supported()
        self.turn_off(pairs)
        _inside.add(self.data)
        silence(self.model)

    def turn_off(self, pairs: Iterable[tuple[LinkKey, LinkKey]]) -> None:
        """Contacts are off for all pairs. ValueError if these are not all pairs that MuJoCo lets collide."""
        geoms = collidable(self.model)
        rule = PairRule(self.model, geoms)
        place = {geom: k for k, geom in enumerate(geoms.tolist())}
        asked = np.array([(place[a], place[b]) for (_, a), (_, b) in pairs], dtype=np.intp).reshape(-1, 2)
        if missing := rule.count(np.ones(len(geoms), dtype=np.int64)) - int(rule.allow(*asked.T).sum()):
            raise ValueError(
                f"pairs must contain all pairs that MuJoCo lets collide, but it leaves out {missing}: "
                "MuJoCo's contacts can only be turned off for all pairs at once"
            )

    def leave(self) -> None:
        _inside.discard(self.data)
        end_silence(self.model)

    def pose(self) -> None:
        mujoco.mj_kinematics(self.model, self.data)

    def prepare(self) -> None:
        """Do the first half of a step, up to the acceleration by everything except contacts."""
        self._must_be_supported()
        model, data = self.model, self.data
        with silenced(model):
            unheard("mj_step1")(model, data)
            mujoco.mj_fwdActuation(model, data)
            mujoco.mj_fwdAcceleration(model, data)
            mujoco.mj_fwdConstraint(model, data)
        self.wrenches[:] = 0

    def begin(self, length: float, duration: float, first: bool) -> None:
        self.length = length

    def step(self) -> None:
        """Do the second half of a step, with the wrenches in addition to the forces that a script has applied."""
        model, data = self.model, self.data
        duration, theirs = float(model.opt.timestep), data.xfrc_applied.copy()
        data.xfrc_applied += self.wrenches
        both = data.xfrc_applied.copy()
        model.opt.timestep = self.length
        try:
            unheard("mj_step2")(model, data)
        finally:
            model.opt.timestep = duration
            # MuJoCo resets data that has diverged. Then nothing of the script's forces is left.
            if np.array_equal(data.xfrc_applied, both, equal_nan=True):
                data.xfrc_applied[:] = theirs

    def stepped(self, duration: float) -> None:
        return

    def announce(self) -> None:
        stepped(self.data)

    def _must_be_supported(self) -> None:
        opt = self.model.opt
        if int(opt.integrator) != int(EULER):
            name = str(mujoco.mjtIntegrator(opt.integrator).name).removeprefix("mjINT_")
            raise ValueError(
                f"VolumetricContact needs MuJoCo's Euler integrator, not {name}: "
                "set model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER"
            )
        if int(opt.enableflags) & SLEEP:
            raise ValueError(
                "VolumetricContact does not support sleeping bodies: clear mujoco.mjtEnableBit.mjENBL_SLEEP in "
                "model.opt.enableflags"
            )
