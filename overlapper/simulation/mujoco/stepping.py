"""Steps of a MuJoCo simulation in which other forces replace MuJoCo's contacts."""

from __future__ import annotations

import warnings
from _ctypes import CFuncPtr
from collections.abc import Callable, Iterable, Sequence
from typing import Any
from weakref import WeakKeyDictionary

import mujoco
import numpy as np

from overlapper.printable import printable
from overlapper.simulation.mechanics import OtherForces
from overlapper.simulation.model import Array, LinkKey
from overlapper.simulation.mujoco.calls import begins, stepped, unheard
from overlapper.simulation.mujoco.dynamics import MujocoDynamics
from overlapper.simulation.mujoco.geoms import collidable
from overlapper.simulation.mujoco.mocap import MocapMotion
from overlapper.simulation.mujoco.pair_rule import PairRule
from overlapper.simulation.mujoco.silence import end_silence, silence, silenced

OF_CONTACTS = int(mujoco.mjtSensor.mjSENS_TOUCH), int(mujoco.mjtSensor.mjSENS_CONTACT)
EULER, SLEEP = mujoco.mjtIntegrator.mjINT_EULER, int(mujoco.mjtEnableBit.mjENBL_SLEEP)

_inside: WeakKeyDictionary[Any, MujocoStepping] = WeakKeyDictionary()
"""By MjData: the `MujocoStepping` that has entered it."""

_before: Callable[[Any, Any], None] | None = None
"""The control callback of the script, which `_control` replaces and calls."""


def _control(model: Any, data: Any) -> None:
    """MuJoCo's control callback while any simulation is entered. MuJoCo calls it in each step of any simulation."""
    if _before is not None:
        _before(model, data)
    if stepping := _inside.get(data):
        stepping.respond()


class MujocoStepping:
    """See `Mechanics`.

    `wrenches` (b, 6) are our forces and torques about the centres of mass of all bodies, in the last substep or in the
    one to come. `length` is that of the last substep, s. `acceleration` (c,) is that of all coordinates by everything
    except contacts, now.
    """

    def __init__(self, model: Any, data: Any) -> None:
        self.model, self.data = model, data
        self.length = float(model.opt.timestep)
        self.wrenches = np.zeros((model.nbody, 6))
        self.acceleration = np.zeros(model.nv)
        self.mocap = MocapMotion(model, data)
        self._begins = True  # the next substep is the first one of a time step
        self._answer: Callable[[], None] = _nothing
        self._sensors_told = False
        self._by_hand = False  # within a step that `prepare` and `step` make
        self._given: tuple[Array, Array] | None = None  # the script's xfrc_applied, and the same with our forces
        self._must_be_supported()

    def dynamics(self, bodies: Sequence[int]) -> MujocoDynamics:
        return MujocoDynamics(self, bodies)

    def resumed(self, others: OtherForces) -> OtherForces:
        return others  # they follow from the state of `data`

    def enter(
        self, pairs: Iterable[tuple[LinkKey, LinkKey]], answer: Callable[[], None], step: Callable[[], None]
    ) -> None:
        global _before
        if self.data in _inside:
            raise RuntimeError("data already has an active VolumetricContact: leave its `with` block first")
        self._must_be_supported()
        self.turn_off(pairs)
        self._tell_of_sensors()
        if not _inside:
            before = mujoco.get_mjcb_control()
            if isinstance(before, CFuncPtr):
                raise ValueError(
                    "mujoco.set_mjcb_control has set a function of C: VolumetricContact can only call a Python function"
                )
            _before = before
            mujoco.set_mjcb_control(_control)
        _inside[self.data] = self
        self._answer = answer
        silence(self.model)

    def turn_off(self, pairs: Iterable[tuple[LinkKey, LinkKey]]) -> None:
        """Contacts are off for all pairs. ValueError if these are not all pairs that MuJoCo lets collide."""
        geoms = collidable(self.model)
        rule = PairRule(self.model, self.data, geoms)
        place = {geom: k for k, geom in enumerate(geoms.tolist())}
        asked = np.array([(place[a], place[b]) for (_, a), (_, b) in pairs], dtype=np.intp).reshape(-1, 2)
        if missing := rule.count(np.ones(len(geoms), dtype=np.int64)) - int(rule.allow(*asked.T).sum()):
            raise ValueError(
                f"pairs must contain all pairs that MuJoCo lets collide, but it leaves out {missing}: "
                "MuJoCo's contacts can only be turned off for all pairs at once"
            )

    def _tell_of_sensors(self) -> None:
        """Warn once of the sensors that read 0 without MuJoCo's contacts. The line of the `with` is named."""
        sensors = np.flatnonzero(np.isin(self.model.sensor_type, OF_CONTACTS)).tolist()
        if not sensors or self._sensors_told:
            return
        self._sensors_told = True
        names = ", ".join(printable(self.model.sensor(k).name) or f"sensor {k}" for k in sensors)
        warnings.warn(f"VolumetricContact replaces MuJoCo's contacts, so these sensors read 0: {names}", stacklevel=4)

    def leave(self) -> None:
        global _before
        del _inside[self.data]
        self._answer = _nothing
        self._take()
        end_silence(self.model)
        if not _inside:
            if mujoco.get_mjcb_control() is _control:
                mujoco.set_mjcb_control(_before)
            _before = None

    def pose(self) -> None:
        mujoco.mj_kinematics(self.model, self.data)

    def prepare(self) -> None:
        """Do the first half of a step, up to the acceleration by everything except contacts."""
        self._take()
        self._by_hand = True
        try:
            with silenced(self.model):
                unheard("mj_step1")(self.model, self.data)
                if self._begins:
                    self.mocap.note()
                    self._begins = False
                self._accelerate()
        finally:
            self._by_hand = False

    def respond(self) -> None:
        """Add the forces of a step that MuJoCo makes. MuJoCo has just computed the forces that depend on velocities."""
        if self._by_hand:
            return
        self._take()
        self.length = float(self.model.opt.timestep)
        self.mocap.note()
        self._accelerate()
        self._answer()
        self._give()

    def begin(self, length: float, duration: float, first: bool) -> None:
        self.length = length

    def step(self) -> None:
        """Do the second half of a step, with the wrenches in addition to the forces that a script has applied."""
        opt, duration = self.model.opt, float(self.model.opt.timestep)
        self._give()
        self._by_hand, opt.timestep = True, self.length
        try:
            unheard("mj_step2")(self.model, self.data)
        finally:
            self._by_hand, opt.timestep = False, duration
            self._take()

    def stepped(self, duration: float) -> None:
        self._begins = True

    def announce_begin(self) -> None:
        begins(self.data)

    def announce(self) -> None:
        stepped(self.data)

    def _accelerate(self) -> None:
        """Find the acceleration of all coordinates by everything except contacts.

        Limits and equalities react to contacts. Their forces are those that react to the contacts of the last substep.
        """
        self._must_be_supported()
        model, data = self.model, self.data
        mujoco.mj_fwdActuation(model, data)
        mujoco.mj_fwdAcceleration(model, data)
        self.acceleration = data.qacc_smooth.copy()
        if not data.nefc:
            return
        self._give()
        mujoco.mj_fwdAcceleration(model, data)
        mujoco.mj_fwdConstraint(model, data)
        self.acceleration += data.qacc - data.qacc_smooth
        self._take()

    def _give(self) -> None:
        """Apply the wrenches in addition to the forces that the script has applied."""
        applied = self.data.xfrc_applied
        theirs = applied.copy()
        applied += self.wrenches
        self._given = theirs, applied.copy()

    def _take(self) -> None:
        """Take the wrenches away again, except from bodies to which other forces have been applied since."""
        if self._given is not None:
            theirs, both = self._given
            same = ((self.data.xfrc_applied == both) | np.isnan(both)).all(axis=1)
            self.data.xfrc_applied[same] = theirs[same]
            self._given = None

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


def _nothing() -> None:
    return
