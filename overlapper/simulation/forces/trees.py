"""Bodies of links in complex numbers: motions of links by coordinates, and inverse mass matrices.

The core does the same in real numbers (overlapper/native/forces/multibody.cpp). Complex steps find derivatives here.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from overlapper.quaternion import rotated
from overlapper.simulation.forces.moving_patch import TINY, dot
from overlapper.simulation.mechanics import Links
from overlapper.simulation.model import Array

HELD, REVOLUTE, PRISMATIC, SPHERICAL = range(4)  # joints, as `ContactSolver` numbers them
OF_JOINT = (0, 1, 1, 3)  # coordinates


def turned_by(vector: Any, arm: Any) -> Any:
    """How far an arm (..., 3) moves if it turns by a rotation vector (..., 3). Both may be complex."""
    square = dot(vector, vector)
    small = np.abs(square) < 1e-8
    safe = np.where(small, 1.0, square)
    t = np.sqrt(safe)
    sine = np.where(small, 1 - square / 6 + square**2 / 120, np.sin(t) / t)
    versine = np.where(small, 0.5 - square / 24 + square**2 / 720, (1 - np.cos(t)) / safe)
    once = np.cross(vector, arm)
    return sine[..., None] * once + versine[..., None] * np.cross(vector, once)


def turn_of(vector: Any) -> Any:
    """The rotation matrices (..., 3, 3) of rotation vectors (..., 3)."""
    columns = [axis + turned_by(vector, np.broadcast_to(axis, vector.shape)) for axis in np.eye(3)]
    return np.stack(columns, axis=-1)


def vector_of(turn: Any) -> Any:
    """The rotation vectors (..., 3) of rotation matrices by less than half a turn."""
    twice = np.stack(
        [
            turn[..., 2, 1] - turn[..., 1, 2],
            turn[..., 0, 2] - turn[..., 2, 0],
            turn[..., 1, 0] - turn[..., 0, 1],
        ],
        axis=-1,
    )
    square = dot(twice, twice) / 4  # of the sine
    cosine = (np.trace(turn, axis1=-2, axis2=-1) - 1) / 2
    small = np.abs(square) < 1e-8
    sine = np.sqrt(np.where(small, 1.0, square))
    angle = np.where(cosine.real > 0, np.arcsin(sine), np.pi - np.arcsin(sine))
    ratio = np.where(small, 1 + square / 6 + 3 * square**2 / 40, angle / sine)
    return ratio[..., None] / 2 * twice


class Tree:
    """A body: its links and its coordinates, and the motions by them where the links are now."""

    def __init__(self, links: Links, rows: range, first: int, positions: Array, turns: Array) -> None:
        self.rows, self.first = rows, first
        self._links = links
        self._moved: list[list[tuple[int, int]]] = []  # of each link: joints (link) and their first coordinates
        count = 6
        for k, row in enumerate(rows):
            own = OF_JOINT[links.joints[row]] if k else 0
            above = self._moved[links.parents[row] - rows[0]] if k else []
            self._moved.append([*above, *([(k, count)] if own else [])])
            count += own
        self.coordinates = count
        self.positions, self.turns = positions[rows], turns[rows]
        self.held = not links.masses[rows[0]] > 0
        self.jacobian = self._jacobian(self.positions[None], self.turns[None])[0]
        self.inverse_mass = self._inverse_mass(self.turns[None], self.jacobian[None])[0]

    @property
    def single(self) -> bool:
        """Whether the body has one link."""
        return len(self.rows) == 1

    @property
    def span(self) -> slice:
        """Its coordinates among all."""
        return slice(self.first, self.first + self.coordinates)

    def _displaced(self) -> tuple[Any, Any]:
        """Positions (n, l, 3) and turns (n, l, 3, 3) of the links in a complex step along each coordinate."""
        motions = np.moveaxis(self.jacobian, 2, 0)  # (n, l, 6)
        positions = self.positions + 1j * TINY * motions[..., :3]
        turned = np.cross(motions[..., 3:, None], self.turns, axis=-2)
        return positions, self.turns + 1j * TINY * turned

    def by_pose(self) -> tuple[Array, Array]:
        """The derivatives (n, l, 6, n) of `jacobian` and (n, n, n) of `inverse_mass` by each coordinate, first axis."""
        positions, turns = self._displaced()
        jacobian = self._jacobian(positions, turns)
        return jacobian.imag / TINY, self._inverse_mass(turns, jacobian).imag / TINY

    def mean_motion(self, duration: float, velocity: Array) -> tuple[Array, Array, Array]:
        """The motions (l, 6) of the links in a step, if coordinates keep their `velocity`, over its duration.

        The derivatives (n, l, 6) by the velocity and by the poses follow.
        """
        count = self.coordinates
        moving = velocity + 1j * TINY * np.eye(count)
        where = np.broadcast_to(self.positions, (count, *self.positions.shape))
        turned = np.broadcast_to(self.turns, (count, *self.turns.shape))
        found = self._ahead(duration, moving, where, turned)
        if self.single:
            return found[0].real, found.imag / TINY, np.zeros((count, 1, 6))
        by_pose = self._ahead(duration, np.broadcast_to(velocity, (count, count)), *self._displaced())
        return found[0].real, found.imag / TINY, by_pose.imag / TINY

    def _joint(self, k: int, positions: Any, turns: Any) -> tuple[Any, Any, int]:
        """Axes (d, m, 3) and pivot (d, 3) of the joint of a link in the world, and its kind."""
        links, row = self._links, self.rows[k]
        parent, kind = links.parents[row] - self.rows[0], links.joints[row]
        pivot = positions[:, parent] + turns[:, parent] @ links.pivots[row]
        if kind == SPHERICAL:
            return np.swapaxes(turns[:, k], 1, 2), pivot, kind
        return (turns[:, parent] @ links.axes[row])[:, None], pivot, kind

    def _jacobian(self, positions: Any, turns: Any) -> Any:
        """(d, l, 6, n) the motions of the links at their centres of mass, by the coordinates."""
        found = np.zeros((*positions.shape[:2], 6, self.coordinates), dtype=positions.dtype)
        for k in range(len(self.rows)):
            for axis in range(3):
                found[:, k, axis, axis] = found[:, k, 3 + axis, 3 + axis] = 1
                arm = positions[:, k] - positions[:, 0]
                found[:, k, :3, 3 + axis] = np.cross(np.eye(3)[axis], arm)
            for joint, at in self._moved[k]:
                axes, pivot, kind = self._joint(joint, positions, turns)
                for m in range(axes.shape[1]):
                    if kind == PRISMATIC:
                        found[:, k, :3, at + m] = axes[:, m]
                    else:
                        found[:, k, :3, at + m] = np.cross(axes[:, m], positions[:, k] - pivot)
                        found[:, k, 3:, at + m] = axes[:, m]
        return found

    def _inverse_mass(self, turns: Any, jacobian: Any) -> Any:
        """(d, n, n) zeros for coordinates that forces do not move."""
        links, count = self._links, self.coordinates
        found = np.zeros((len(jacobian), count, count), dtype=jacobian.dtype)
        if self.single:
            mass, inertia = links.masses[self.rows[0]], np.asarray(links.inertias[self.rows[0]], dtype=float)
            if mass > 0:
                inverse = np.where(inertia > 0, 1 / np.where(inertia > 0, inertia, 1), 0)
                found[:, range(3), range(3)] = 1 / mass
                found[:, 3:, 3:] = (turns[:, 0] * inverse) @ np.swapaxes(turns[:, 0], 1, 2)
            return found
        mass = np.zeros_like(found)
        for k, row in enumerate(self.rows):
            if not links.masses[row] > 0:
                continue
            linear, angular = jacobian[:, k, :3], np.swapaxes(turns[:, k], 1, 2) @ jacobian[:, k, 3:]
            mass += links.masses[row] * np.swapaxes(linear, 1, 2) @ linear
            mass += np.swapaxes(angular, 1, 2) @ (np.maximum(links.inertias[row], 0)[:, None] * angular)
        diagonal = np.diagonal(mass[0]).real
        free = (diagonal > 1e-14 * diagonal.max(initial=0)) & (np.arange(count) >= (6 if self.held else 0))
        which = np.flatnonzero(free)
        if len(which):
            found[:, which[:, None], which] = np.linalg.inv(mass[:, which[:, None], which])
        return found

    def _ahead(self, duration: float, velocity: Any, positions: Any, turns: Any) -> Any:
        """(d, l, 6) the motions of the links over the duration, if coordinates keep their velocity (d, n)."""
        moved, turned = [], []
        for k, row in enumerate(self.rows):
            if k == 0:
                moved.append(duration * velocity[:, :3])
                turned.append(turn_of(duration * velocity[:, 3:6]))
                continue
            parent = self._links.parents[row] - self.rows[0]
            here, above = positions[:, k], positions[:, parent]
            joint, away = np.broadcast_to(np.eye(3), turned[0].shape), here - above
            if OF_JOINT[self._links.joints[row]]:
                axes, pivot, kind = self._joint(k, positions, turns)
                _, at = self._moved[k][-1]
                by = duration * np.einsum("dm,dmi->di", velocity[:, at : at + axes.shape[1]], axes)
                if kind == PRISMATIC:
                    away = away + by
                else:
                    joint = turn_of(by)
                    away = pivot - above + np.einsum("dij,dj->di", joint, here - pivot)
            moved.append(moved[parent] + above + np.einsum("dij,dj->di", turned[parent], away) - here)
            turned.append(turned[parent] @ joint)
        linear, angular = np.stack(moved, axis=1), vector_of(np.stack(turned, axis=1))
        return np.concatenate([linear, angular], axis=-1) / duration


def trees(links: Links, positions: Array, quaternions: Array) -> list[Tree]:
    """The bodies, whose links are at these positions (n, 3) with these quaternions xyzw (n, 4)."""
    turns = (
        np.stack([rotated(quaternions, axis) for axis in np.eye(3)], axis=-1) if len(positions) else np.empty((0, 3, 3))
    )
    bases = [row for row, parent in enumerate(links.parents) if parent < 0]
    found: list[Tree] = []
    for base, end in zip(bases, [*bases[1:], len(links.parents)]):
        first = found[-1].span.stop if found else 0
        found.append(Tree(links, range(base, end), first, positions, turns))
    return found
