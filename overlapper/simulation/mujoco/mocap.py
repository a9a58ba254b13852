"""The velocities of bodies that a script moves by hand (mocap bodies)."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from overlapper.simulation.layout import FARTHEST
from overlapper.simulation.model import Array

COORDINATES = 6  # of each body: velocity of its origin and angular velocity, in the world


class MocapMotion:
    """The velocities of the mocap bodies of `data`, from their poses at the beginnings of the last three steps.

    `bodies` are the numbers of the mocap bodies. `velocity` (m, 6) has m/s and rad/s. It is the slower one of the
    velocities of the last two steps. A body that jumps once has no velocity.
    """

    def __init__(self, model: Any, data: Any) -> None:
        self.bodies = np.flatnonzero(model.body_mocapid >= 0)
        self._model, self._data = model, data
        self._numbers = model.body_mocapid[self.bodies]
        self.velocity: Array = np.zeros((len(self.bodies), COORDINATES))
        self._latest = self._last = self.velocity  # of the last step and of the step before, as measured
        self._at: tuple[float, Array, Array] | None = None
        self._before: tuple[float, Array, Array] | None = None  # at an earlier time than `_at`

    @property
    def centres(self) -> Array:
        """(m, 3) the points that the velocities are about."""
        return np.asarray(self._data.xpos[self.bodies])

    def note(self) -> None:
        """Read the poses at the beginning of a step, after MuJoCo's kinematics. The last call at a time counts."""
        if not len(self.bodies):
            return
        time = float(self._data.time)
        positions, quaternions = self._data.xpos[self.bodies], self._data.xquat[self.bodies]
        if self._at and self._at[0] != time:
            self._before, self._last = self._at, self._latest
        now = np.zeros_like(self.velocity)
        if self._before and time > self._before[0]:
            earlier, old_positions, old_quaternions = self._before
            now[:, :3] = positions - old_positions
            now[:, 3:] = [_turn(*each) for each in zip(old_quaternions, quaternions)]
            now /= time - earlier
            now[~(np.abs(now) < FARTHEST).all(axis=1)] = 0  # a script may have set a pose that is not finite
        self.velocity = now.copy()
        for part in (slice(0, 3), slice(3, 6)):
            faster = np.linalg.norm(now[:, part], axis=1) > np.linalg.norm(self._last[:, part], axis=1)
            self.velocity[faster, part] = self._last[faster, part]
        self._latest, self._at = now, (time, positions, quaternions)

    def move(self, later: Any, duration: float) -> None:
        """Place the mocap bodies of other data where they are after a duration (s)."""
        later.mocap_pos[:], later.mocap_quat[:] = self._data.mocap_pos, self._data.mocap_quat
        for number, velocity in zip(self._numbers.tolist(), self.velocity):
            later.mocap_pos[number] += duration * velocity[:3]
            speed = float(np.linalg.norm(velocity[3:]))
            if speed > 0:
                turn, turned = np.empty(4), np.empty(4)
                mujoco.mju_axisAngle2Quat(turn, velocity[3:] / speed, speed * duration)
                mujoco.mju_mulQuat(turned, turn, later.mocap_quat[number])
                later.mocap_quat[number] = turned

    def moving(self, body: int) -> int | None:
        """The index in `bodies` of the mocap body that carries a body without joints. None if there is none."""
        parents = self._model.body_parentid
        while body and parents[body]:
            body = int(parents[body])
        return int(np.searchsorted(self.bodies, body)) if body in self.bodies else None


def _turn(before: Array, after: Array) -> Array:
    """The rotation vector in the world from one quaternion wxyz to another."""
    back, between, vector = np.empty(4), np.empty(4), np.empty(3)
    mujoco.mju_negQuat(back, before)
    mujoco.mju_mulQuat(between, after, back)
    mujoco.mju_quat2Vel(vector, between, 1.0)
    return vector
