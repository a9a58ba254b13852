"""The bodies of a pybullet client as masses and joints, and their velocities."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import chain, repeat
from typing import Any

import numpy as np
import pybullet
from numpy.typing import NDArray

from overlapper import _core
from overlapper.quaternion import rotated
from overlapper.simulation.bullet.calls import unheard
from overlapper.simulation.bullet.commands import Commands
from overlapper.simulation.bullet.constraints import constraints
from overlapper.simulation.bullet.joints import joint_between
from overlapper.simulation.bullet.other_forces import LearntForces
from overlapper.simulation.mechanics import Links
from overlapper.simulation.model import BASE, Array

# By kinematic_tree.Kind: the number that _core.ContactSolver knows it by, and how many coordinates it has.
JOINTS = {"held": (0, 0), "planar": (0, 0), "revolute": (1, 1), "prismatic": (2, 1), "spherical": (3, 3)}
MASS, FRICTION, INERTIA, RESTITUTION, ROLLING, SPINNING = 0, 1, 2, 5, 6, 7  # of getDynamicsInfo
SURFACE = (FRICTION, RESTITUTION, ROLLING, SPINNING)
MOST_TORQUE = 10.0  # m: Bullet takes no larger coefficients for the torques of two bodies
G = 9.81  # m/s²: bodies have a weight by this acceleration if there is no gravity
HELD = (-1, 0, np.zeros(3), np.zeros(3))  # a base: no parent, no joint

flattened = chain.from_iterable

Known = tuple[list[Any], _core.ContactSolver]


class BulletDynamics:
    """See `Dynamics`: the links of some bodies, base by base, and the `solver` that knows their masses and joints.

    `links` are (body, link) in the solver's order, and `place` is the index of each. `commands` knows motors, and
    changes of constraints.
    """

    def __init__(self, client: int, bodies: Sequence[int], commands: Commands | None = None) -> None:
        self._client = client
        self._commands = commands or Commands(client)
        self._joints = {id: [*range(pybullet.getNumJoints(id, client))] for id in bodies}
        self.links = [(id, link) for id, joints in self._joints.items() for link in (BASE, *joints)]
        self.place = {each: k for k, each in enumerate(self.links)}
        self._masses: list[Any] = [None]  # equals no real list of masses, so that the first `read` makes a solver
        self._surface: Array = np.zeros((len(self.links), len(SURFACE)))
        self._told: list[Any] = []
        # Of a step, with the length of its substeps. A script changes constraints between two steps.
        self._constraints: tuple[float, Array | None] | None = None
        self.version = 0
        self.read()

    def read(self) -> bool:
        """Read masses and friction again. True if a mass or inertia has changed, so that there is a new solver."""
        read, client = pybullet.getDynamicsInfo, self._client
        self._constraints = None
        told = [read(id, link, client) for id, link in self.links]
        gravity = self._gravity()
        if [gravity, told] == self._told:
            return False
        self._told = [gravity, told]
        self.version += 1
        self._surface = np.array([[each[k] for k in SURFACE] for each in told]).reshape(-1, len(SURFACE))
        masses = [(each[MASS], each[INERTIA]) for each in told]
        changed = masses != self._masses
        if changed:
            self._masses = masses
            self._model()
        self._weights = (np.linalg.norm(gravity) or G) * self._moved_masses()
        return changed

    def known(self) -> Known:
        """The masses, and a solver that has the last forces."""
        return self._masses, self.solver.copy()

    def resume(self, known: Known) -> bool:
        """Go on with these last forces. False if masses have changed since, as the forces are then of no use."""
        masses, solver = known
        if masses is not self._masses:
            return False
        self.solver = solver.copy()
        return True

    def friction(self, pairs: NDArray[np.int64]) -> Array:
        """(p,) the products of the two links' lateralFriction."""
        return np.asarray(self._surface[pairs, 0].prod(axis=1))

    def resistance(self, pairs: NDArray[np.int64]) -> dict[str, Array]:
        """(p,) the products of the two links' restitution, and the rolling and spinning friction as in Bullet.

        Bullet adds the products of the rolling friction of each link with the lateral friction of the other link.
        """
        sliding, restitution, *torques = np.moveaxis(self._surface[pairs], 2, 0)
        rolling, spinning = (np.minimum((each * sliding[:, ::-1]).sum(axis=1), MOST_TORQUE) for each in torques)
        return {"restitution": restitution.prod(axis=1), "rolling": rolling, "spinning": spinning}

    def weights(self) -> Array:
        """(n,) the weights of the links' bodies in N, 0 for bodies that nothing moves."""
        return self._weights

    def _moved_masses(self) -> Array:
        """(n,) the masses of the links' bodies, 0 for bodies that forces do not move."""
        jointed = {id for id, _, _ in (*self._single, *self._spherical)}
        of_body = {}
        for id, joints in self._joints.items():
            masses = [self._masses[self.place[id, link]][MASS] for link in (BASE, *joints)]
            of_body[id] = sum(masses) if masses[0] > 0 or id in jointed else 0.0
        return np.array([of_body[id] for id, _ in self.links])

    def _gravity(self) -> list[float]:
        told = pybullet.getPhysicsEngineParameters(self._client)
        return [told[f"gravityAcceleration{axis}"] for axis in "XYZ"]

    def other_forces(self) -> LearntForces:
        """Forces of which only gravity on free bases is known before any motion."""
        down = self._gravity()
        found = np.zeros(self.solver.coordinates)
        for (id, _), first in self._bases.items():
            if self._masses[self.place[id, BASE]][MASS] > 0:
                found[first : first + 3] = down
        return LearntForces(found)

    def _model(self) -> None:
        client = self._client
        rows: list[tuple[Any, ...]] = []
        self._bases: dict[tuple[int, int], int] = {}  # the first coordinate of each
        # By body: joints with one and with three coordinates, and the indices of their coordinates.
        self._single: list[tuple[int, list[int], list[int]]] = []
        self._spherical: list[tuple[int, list[int], list[int]]] = []
        at = 0
        for (id, joints), frames in zip(self._joints.items(), self._frames_by_body()):
            poses = [tuple(map(np.array, each[:2])) for each in frames]
            self._bases[id, BASE] = at
            at += 6
            first = len(rows)
            rows.append(HELD)
            single: tuple[list[int], list[int]] = ([], [])
            spherical: tuple[list[int], list[int]] = ([], [])
            for joint in joints:
                told = pybullet.getJointInfo(id, joint, client)
                parent = 1 + told[16]
                between = joint_between(client, id, told, poses[parent], poses[1 + joint])
                number, coordinates = JOINTS[between.kind]
                # Bullet rotates about the unit axis, but translates along the axis as given in the file.
                axis = rotated(between.orientation, np.array(told[13]))
                rows.append((first + parent, number, axis, between.position))
                if coordinates:
                    which = single if coordinates == 1 else spherical
                    which[0].append(joint)
                    which[1].extend(range(at, at + coordinates))
                at += coordinates
            self._single += [(id, *single)] if single[0] else []
            self._spherical += [(id, *spherical)] if spherical[0] else []
        self._of_bases = np.add.outer(np.array([*self._bases.values()], dtype=int), range(6))
        parents, numbers, axes, pivots = zip(*rows) if rows else ([], [], [], [])
        masses = [mass for mass, _ in self._masses]
        inertias = np.array([inertia for _, inertia in self._masses]).reshape(-1, 3)
        where = np.reshape(axes, (-1, 3)), np.reshape(pivots, (-1, 3))
        self._tree = Links(parents, numbers, *where, np.array(masses), inertias)
        self.solver = _core.ContactSolver(*self._tree)

    def tree(self) -> Links:
        return self._tree

    def frames(self) -> list[Any]:
        """The inertial frames of the links: tuples of pybullet that begin with position and quaternion."""
        return [each for body in self._frames_by_body() for each in body]

    def _frames_by_body(self) -> list[list[Any]]:
        client = self._client
        found = []
        for id, joints in self._joints.items():
            frames: list[Any] = [pybullet.getBasePositionAndOrientation(id, client)]
            if joints:
                frames += pybullet.getLinkStates(id, joints, computeForwardKinematics=1, physicsClientId=client)
            found.append(frames)
        return found

    def velocity(self) -> Array:
        """The velocities of all coordinates: of bases in m/s and rad/s, in the world, and of joints in rad/s or m/s."""
        client = self._client
        velocity = np.empty(self.solver.coordinates)
        pairs = map(pybullet.getBaseVelocity, self._joints, repeat(client))
        bases = np.fromiter(flattened(flattened(pairs)), float, 6 * len(self._joints))
        velocity[self._of_bases] = bases.reshape(-1, 6)
        self._states = [pybullet.getJointStates(id, joints, client) for id, joints, _ in self._single]
        for (_, _, at), states in zip(self._single, self._states):
            velocity[at] = [state[1] for state in states]
        for id, joints, at in self._spherical:
            states = pybullet.getJointStatesMultiDof(id, joints, client)
            velocity[at] = [each for state in states for each in state[1]]
        return velocity

    def motors(self, length: float, share: float) -> Array | None:
        servos = self._commands.servos
        if not servos:
            return None
        rows: list[float] = []
        for (id, joints, coordinates), states in zip(self._single, self._states):
            for joint, coordinate, state in zip(joints, coordinates, states):
                servo = servos.get((id, joint))
                if servo and servo.force > 0 and math.isfinite(state[0]):
                    rows += (coordinate, *servo.in_a_step(state[0], length, share))
        return np.array(rows).reshape(-1, 4)

    def constraints(self, length: float) -> Array | None:
        if self._constraints is None or self._constraints[0] != length:
            commands, found = self._commands, None
            if pybullet.getNumConstraints(self._client):
                found = constraints(self._client, self.place, commands.changes(), commands.error_reduction, length)
            self._constraints = length, found
        return self._constraints[1]

    def ahead(self, duration: float, velocity: Array) -> None:
        return None

    def apply(self, wrenches: NDArray[np.float64], frames: Sequence[Any]) -> None:
        """Let forces and torques (n, 6) about their centres of mass act on the links in the simulator's next step."""
        client, axes = self._client, pybullet.WORLD_FRAME
        push, turn = unheard("applyExternalForce"), unheard("applyExternalTorque")
        for (id, link), wrench, frame in zip(self.links, wrenches.tolist(), frames):
            if any(wrench):
                push(id, link, wrench[:3], frame[0], axes, client)
                turn(id, link, wrench[3:], axes, client)
