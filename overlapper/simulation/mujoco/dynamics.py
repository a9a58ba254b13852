"""The bodies of a MuJoCo model as masses and joints, and their velocities."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from overlapper import _core
from overlapper.quaternion import composed
from overlapper.simulation.layout import FARTHEST, Pose
from overlapper.simulation.model import Array
from overlapper.simulation.mujoco.friction import friction
from overlapper.simulation.mujoco.geoms import collidable
from overlapper.simulation.mujoco.mocap import COORDINATES, MocapMotion

G = 9.81  # m/s²: bodies have a weight by this acceleration if there is no gravity
NO_TURN = (0.0, 0.0, 0.0, 1.0)
NOT_IMPLICIT = int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP) | int(mujoco.mjtDisableBit.mjDSBL_DAMPER)


class Step(Protocol):
    """The substep that a simulation makes. See `MujocoStepping`."""

    model: Any
    data: Any
    length: float
    wrenches: Array
    acceleration: Array
    mocap: MocapMotion


class MujocoDynamics:
    """See `Dynamics`: `links` are geoms (body, geom). Coordinates are MuJoCo's degrees of freedom, in its order.

    MuJoCo's own mass matrix and motion axes are used. So armature, ball joints and several joints of a body count. Six
    coordinates of each mocap body follow, which forces do not move.
    """

    def __init__(self, stepping: Step, bodies: Sequence[int]) -> None:
        self._stepping, self._model, self._data = stepping, stepping.model, stepping.data
        model, known = self._model, set(bodies)
        owner = model.geom_bodyid
        self.links = [(int(owner[g]), g) for g in collidable(model).tolist() if int(owner[g]) in known]
        self.place = {each: k for k, each in enumerate(self.links)}
        self._bodies = np.array([body for body, _ in self.links], dtype=np.int64)
        self._geoms = np.array([geom for _, geom in self.links], dtype=np.int64)
        self._trees = [slice(a, a + n) for a, n in zip(model.tree_dofadr.tolist(), model.tree_dofnum.tolist())]
        moved = [(k, dof) for k, (body, _) in enumerate(self.links) for dof in _moving(model, body)]
        trees = model.body_treeid[self._bodies]
        self._move = trees >= 0  # by forces
        self._mocap = stepping.mocap
        for k in np.flatnonzero(~self._move).tolist():
            if (number := self._mocap.moving(int(self._bodies[k]))) is not None:
                trees[k] = model.ntree + number
                moved += [(k, coordinate) for coordinate in range(COORDINATES)]
        of_mocap = [COORDINATES] * len(self._mocap.bodies)
        self._still = np.zeros(sum(of_mocap))
        coordinates = np.array([*model.tree_dofnum.tolist(), *of_mocap], dtype=np.int64)
        self.solver = _core.ContactSolver.of_trees(coordinates, trees, np.array(moved, dtype=np.int64).reshape(-1, 2))
        width = int(coordinates.max(initial=0))
        self._units = np.zeros((width, model.nv))  # row k has 1 at the k-th coordinate of each tree
        for tree in self._trees:
            self._units[range(tree.stop - tree.start), range(tree.start, tree.stop)] = 1
        self.version = 0
        self._later = mujoco.MjData(model)
        self._roots = model.body_rootid[model.dof_bodyid]
        # Without contacts, at the last `frames`.
        self.acceleration: Array = np.zeros(model.nv + len(self._still))

    def read(self) -> bool:
        self.version += 1  # the model is not compared
        return False  # `frames` reads all masses anyway

    def tree(self) -> None:
        return None

    def friction(self, pairs: NDArray[np.int64]) -> Array:
        first, second = self._geoms[pairs].T
        return friction(self._model, first, second)[:, 0]

    def resistance(self, pairs: NDArray[np.int64]) -> dict[str, Array]:
        _, spinning, rolling = friction(self._model, *self._geoms[pairs].T).T
        return {"restitution": np.zeros(len(pairs)), "rolling": rolling, "spinning": spinning}

    def weights(self) -> Array:
        model = self._model
        trees = model.body_treeid
        masses = np.bincount(trees + 1, model.body_mass, model.ntree + 1)
        masses[0] = 0  # of bodies that do not move
        return np.asarray((np.linalg.norm(model.opt.gravity) or G) * masses[trees[self._bodies] + 1])

    def other_forces(self) -> KnownForces:
        return KnownForces(self)

    def frames(self) -> list[Pose]:
        """The centres of mass of the links' bodies. Their orientations are not needed."""
        data = self._data
        inverse_mass = self._inverse_mass()
        axes, count = data.cdof, len(self._mocap.bodies)  # angular and linear, about the centre of mass of the tree
        unit = np.tile(np.eye(COORDINATES), (count, 1))
        self.solver.move(
            np.concatenate([axes[:, 3:], unit[:, :3]]),
            np.concatenate([axes[:, :3], unit[:, 3:]]),
            np.concatenate([data.subtree_com[self._roots], self._mocap.centres.repeat(COORDINATES, axis=0)]),
            np.concatenate([inverse_mass, np.zeros((len(unit), inverse_mass.shape[1]))]),
        )
        return [(each, NO_TURN) for each in data.xipos[self._bodies].tolist()]

    def _inverse_mass(self) -> Array:
        """(c, w) as the solver takes it. It also finds the acceleration without contacts.

        Euler's integrator treats the damping D of joints as implicit: it replaces M by M + h D in a step of h. So does
        this inverse. The length h is that of the last substep.
        """
        data, damping = self._data, self._stepping.length * self._damping()
        inverse = np.empty_like(self._units)
        mujoco.mj_solveM(self._model, data, inverse, self._units)
        inverse = np.ascontiguousarray(inverse.T)
        told = self._stepping.acceleration
        # MuJoCo resets data that diverges.
        self.acceleration = np.append(np.where(np.abs(told) < FARTHEST, told, 0.0), self._still)
        for tree in self._trees:
            if damping[tree].any():
                own = inverse[tree, : tree.stop - tree.start]
                own[:] = np.linalg.solve(np.eye(len(own)) + own * damping[tree], own)
                self.acceleration[tree] -= own @ (damping[tree] * self.acceleration[tree])
        return inverse

    def _damping(self) -> Array:
        """(c,) the derivatives of damping forces by the velocities, if the integrator treats them as implicit."""
        model = self._model
        if int(model.opt.disableflags) & NOT_IMPLICIT:
            return np.zeros(model.nv)
        damping, speed = model.dof_damping.copy(), np.abs(self._data.qvel)
        for k, coefficient in enumerate(model.dof_dampingpoly.T):
            damping += (k + 2) * coefficient * speed ** (k + 1)
        return np.asarray(damping)

    def velocity(self) -> Array:
        return np.append(self._data.qvel, self._mocap.velocity)

    def motors(self, length: float, share: float) -> None:
        return None  # MuJoCo computes their forces before those of contacts

    def constraints(self, length: float) -> None:
        return None  # the same holds for them

    def ahead(self, duration: float, velocity: Array) -> list[Pose]:
        data, later = self._data, self._later
        later.qpos[:] = data.qpos
        self._mocap.move(later, duration)
        mujoco.mj_integratePos(self._model, later.qpos, velocity[: self._model.nv], duration)
        mujoco.mj_kinematics(self._model, later)
        # MuJoCo's quaternions are wxyz.
        before, after = (each.xquat[self._bodies][:, [1, 2, 3, 0]] for each in (data, later))
        turns = composed(after, before * (-1, -1, -1, 1))
        return [*zip(later.xipos[self._bodies].tolist(), turns.tolist())]

    def apply(self, wrenches: NDArray[np.float64], frames: Sequence[Pose]) -> None:
        """Let forces and torques (n, 6) about the centres of mass act in the next step, and no others."""
        self._stepping.wrenches[:] = 0
        np.add.at(self._stepping.wrenches, self._bodies[self._move], wrenches[self._move])


class KnownForces:
    """See `OtherForces`: MuJoCo has computed the acceleration without contacts."""

    def __init__(self, dynamics: MujocoDynamics) -> None:
        self._dynamics = dynamics

    def ahead(self, velocity: Array, duration: float) -> Array:
        return np.asarray(velocity + duration * self._dynamics.acceleration)

    def learnt(self, velocity: Array) -> Array:
        return self._dynamics.acceleration

    def solved(self, velocity: Array, duration: float, ours: Array) -> None:
        return

    def left_at(self, velocity: Array) -> None:
        return


def _moving(model: Any, body: int) -> Iterator[int]:
    """The coordinates that move a body, among those of its tree. See mj_jac."""
    while body and not model.body_dofnum[body]:
        body = int(model.body_parentid[body])
    dof = int(model.body_dofadr[body] + model.body_dofnum[body]) - 1 if body else -1
    while dof >= 0:
        yield dof - int(model.tree_dofadr[model.dof_treeid[dof]])
        dof = int(model.dof_parentid[dof])
