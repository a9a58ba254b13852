"""The equations that the solution of a step with volumetric contact satisfies, and their derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from overlapper import HalfSpace, Overlap, Overlaps
from overlapper.quaternion import rotated
from overlapper.shapes.table import facts
from overlapper.simulation.forces.derivatives import Kink, StepDerivatives
from overlapper.simulation.forces.forces import Forces
from overlapper.simulation.forces.laws import UNKNOWNS, Fixed, Inputs, LinkLaws
from overlapper.simulation.forces.moving_patch import TINY, Geometry, MovingPatch, Unfollowed, following
from overlapper.simulation.forces.trees import SPHERICAL, Tree, trees, turn_of
from overlapper.simulation.layout import Pose
from overlapper.simulation.mechanics import Links
from overlapper.simulation.model import BASE, Array, LinkKey

# The equations of the patches are solved again until a step of Newton's method changes less than this share.
POLISHED, POLISHES = 1e-13, 8

# The laws here and in the core agree if the solution of the core changes slips by less than this share of the speeds.
AGREED = 1e-5

# Singular values of the scaled equations below this share of the largest are zero: forces that bodies could share.
SINGULAR = 1e-11

# A part of a vector that is smaller than this counts as none.
SHARED = 1e-6


class Solved(NamedTuple):
    """A step as it was solved: what derivatives are made of."""

    forces: Forces
    duration: float
    velocity: Array
    acceleration: Array
    damped: NDArray[np.bool_] | None
    frames: Sequence[Pose]  # of links, inertial
    links: Sequence[LinkKey]
    tree: Links
    of_shapes: NDArray[np.int64]  # the link of each shape
    laws: dict[str, Array]
    history: Array


@dataclass
class _Group:
    """The patches (rows) between two links."""

    rows: NDArray[np.int64]
    links: tuple[int, int]
    laws: LinkLaws
    real: Inputs
    moving: list[MovingPatch] | None
    planes: Array  # (g, 2, 3)
    plane_sides: NDArray[np.int64]  # (g,) the side of each half-space, -1 without one

    # Derivatives of residuals (g * 8), wrench (12), forces and torques (g * 6), by the inputs of each name.
    by: dict[str, tuple[Array, Array, Array]]


class StepEquations:
    """The equations of a solved step: the laws of all patches, and the motion of the bodies."""

    def __init__(self, solved: Solved) -> None:
        self._solved = solved
        self.forces = solved.forces
        quaternions = np.array([frame[1] for frame in solved.frames], dtype=float).reshape(-1, 4)
        positions = np.array([frame[0] for frame in solved.frames], dtype=float).reshape(-1, 3)
        self._trees = trees(solved.tree, positions, quaternions)
        self._tree_of = [tree for tree in self._trees for _ in tree.rows]
        self._count = sum(tree.coordinates for tree in self._trees)
        self._kinks: list[Kink] = []
        self._unfollowed = ""
        self._inverse = np.zeros((self._count, self._count))
        for tree in self._trees:
            self._inverse[tree.span, tree.span] = tree.inverse_mass
        self._groups = self._grouped()
        self._solve()

    def derivatives(self) -> StepDerivatives:
        """The derivatives of the step."""
        velocity, contact = self._velocity, self._contact
        return StepDerivatives(
            forces=self.forces,
            coordinates=self._named(),
            velocity=self.velocity,
            kinks=self._kinks,
            velocity_by_velocity=velocity["velocity"],
            velocity_by_force=velocity["force"],
            velocity_by_stiffness=velocity["stiffness"],
            velocity_by_friction=velocity["friction"],
            contact_by_velocity=contact["velocity"],
            contact_by_force=contact["force"],
            contact_by_stiffness=contact["stiffness"],
            contact_by_friction=contact["friction"],
            moved=self._moved_on(),
            by_pose=self._unfollowed or (velocity["pose"], contact["pose"]),
        )

    def _named(self) -> list[tuple[int, int, str]]:
        names, found = ("x", "y", "z", "rx", "ry", "rz"), []
        for tree in self._trees:
            body = self._solved.links[tree.rows[0]][0]
            found += [(body, BASE, name) for name in names]
            for row in tree.rows[1:]:
                of_link = ((), ("joint",), ("joint",), names[3:])[self._solved.tree.joints[row]]
                found += [(*self._solved.links[row], name) for name in of_link]
        return found

    def _moved_on(self) -> tuple[Array, Array]:
        """(n, n) the poses at the end by those before, at the same velocities, and by these velocities."""
        h, n = self._solved.duration, self._count
        turned, moved = np.eye(n), h * np.eye(n)
        for tree in self._trees:
            at = [] if tree.held else [(tree.first + 3, 1)]
            if tree.held:
                moved[tree.first : tree.first + 6] = 0
            first = tree.first + 6
            for row in tree.rows[1:]:
                kind = self._solved.tree.joints[row]
                at += [(first, -1)] if kind == SPHERICAL else []
                first += (0, 1, 1, 3)[kind]
            for start, side in at:  # a rotation in the world, or about the axes that turn with the link
                vector, block = side * h * self.velocity[start : start + 3], slice(start, start + 3)
                turned[block, block] = turn_of(vector)
                moved[block, block] = h * _left_jacobian(vector)
        return turned, moved

    def _grouped(self) -> list[_Group]:
        solved, found = self._solved, self.forces.contacts.overlaps
        rows_of: dict[tuple[int, int], list[int]] = {}
        for row in np.flatnonzero(found.status == Overlaps.OVERLAPPING).tolist():
            a, b = solved.of_shapes[found.pairs[row]].tolist()
            rows_of.setdefault((a, b), []).append(row)
        return [self._group(np.array(rows), links) for links, rows in rows_of.items()]

    def _group(self, rows: NDArray[np.int64], links: tuple[int, int]) -> _Group:
        solved, found, forces = self._solved, self.forces.contacts.overlaps, self.forces
        trees_here, speeds = [self._tree_of[link] for link in links], []
        places = [link - tree.rows[0] for link, tree in zip(links, trees_here)]
        centres = np.array([tree.positions[place] for tree, place in zip(trees_here, places)])
        none = np.zeros(len(rows))
        laws = {name: solved.laws.get(name, np.zeros(len(forces)))[rows] for name in solved.laws} | {
            name: none
            for name in ("recovery", "restitution", "rolling", "spinning", "hardening")
            if name not in solved.laws
        }
        damped = none.astype(bool) if solved.damped is None else np.asarray(solved.damped[rows], dtype=bool)
        free = solved.velocity + solved.duration * solved.acceleration
        for velocity in (solved.velocity, free):
            speeds.append(max(np.abs(self._motion(link, velocity)[:3]).max() for link in links))
        pull = max(np.abs(solved.duration * self._motion(link, solved.acceleration)[:3]).max() for link in links)
        fixed = Fixed(
            duration=solved.duration,
            **{
                name: laws[name]
                for name in ("dissipation", "recovery", "restitution", "rolling", "spinning", "hardening")
            },
            directed=forces.directed[rows],
            normal=forces.normal[rows],
            damped=damped,
            history=solved.history[rows],
            speed=float(max(*speeds, pull)) or 1.0,
        )
        geometry, moving, planes, sides = [], [], [], []
        for row in rows.tolist():
            overlap = found[row]
            geometry.append(_geometry(overlap))
            try:
                moving.append(following(overlap, centres))
            except Unfollowed as of:
                self._unfollow(row, str(of))
            plane, side = _plane(overlap)
            planes.append(plane)
            sides.append(side)
        link_laws = LinkLaws(fixed)
        # The velocities at the end follow from the forces of the core.
        real = Inputs(
            centres[None],
            np.array(geometry)[None],
            np.array(planes)[None],
            self._admittance(links)[None],
            self._pair_motion(links, solved.velocity)[None],
            np.zeros((1, 12)),
            np.zeros((1, 12)),
            np.zeros((1, len(rows), UNKNOWNS)),
            laws["stiffness"][None],
            laws["friction"][None],
        )
        real = real._replace(unknowns=link_laws.start(forces.force[rows], forces.torque[rows], real)[None])
        followed = moving if len(moving) == len(rows) else None
        return _Group(rows, links, link_laws, real, followed, np.array(planes), np.array(sides), {})

    def _unfollow(self, row: int, why: str) -> None:
        if not self._unfollowed:
            pair = tuple(self.forces.pairs[row].tolist())
            self._unfollowed = (
                f"derivatives by pose are not known for the contact between {pair[:2]} and {pair[3:5]} {why}"
            )

    def _tell(self, row: int, reason: str) -> None:
        self._kinks.append(Kink(row, tuple(self.forces.pairs[row].tolist()), reason))

    def _place(self, link: int) -> tuple[Tree, int]:
        """The body of a link, and the place of the link in it."""
        tree = self._tree_of[link]
        return tree, link - tree.rows[0]

    def _motion(self, link: int, velocity: Array) -> Array:
        tree, at = self._place(link)
        found: Array = tree.jacobian[at] @ velocity[tree.span]
        return found

    def _pair_motion(self, links: tuple[int, int], velocity: Array) -> Array:
        return np.concatenate([self._motion(link, velocity) for link in links])

    def _pair_jacobian(self, links: tuple[int, int]) -> Array:
        """(12, n) the motions of two links by all coordinates."""
        found = np.zeros((12, self._count))
        for k, link in enumerate(links):
            tree, at = self._place(link)
            found[6 * k : 6 * k + 6, tree.span] = tree.jacobian[at]
        return found

    def _admittance(self, links: tuple[int, int]) -> Array:
        jacobian = self._pair_jacobian(links)
        found: Array = jacobian @ self._inverse @ jacobian.T
        return found

    def _solve(self) -> None:
        h, velocity = self._solved.duration, self._solved.velocity
        self._jacobians = [self._pair_jacobian(group.links) for group in self._groups]
        mean = {id(tree): tree.mean_motion(h, velocity[tree.span]) for tree in self._trees}
        for group in self._groups:
            parts = [mean[id(tree)][0][at] for tree, at in map(self._place, group.links)]
            group.real = group.real._replace(mean=np.concatenate(parts)[None])
        self._polish(velocity + h * self._solved.acceleration)
        for group in self._groups:
            for k, reason in dict.fromkeys(group.laws.regimes.kinks):
                self._tell(int(group.rows[k]), reason)
            if group.laws.at_edge and not all(self._tree_of[link].single for link in group.links):
                self._unfollow(
                    int(group.rows[0]), "of a body with joints, whose pressures are at the edge of the patch"
                )
        poses = not self._unfollowed
        for group in self._groups:
            group.by = _by_inputs(group, poses, single=[self._tree_of[link].single for link in group.links])
        system, effects = self._system()
        for k, row in enumerate([row for group in self._groups for row in group.rows.tolist()]):
            if system.shared[UNKNOWNS * k : UNKNOWNS * (k + 1)].any():
                self._tell(row, "shared")
        n, p = self._count, len(self.forces)
        none = [np.zeros((len(group.by["after"][0]), n)) for group in self._groups]
        self._velocity: dict[str, Array] = {}
        self._contact: dict[str, Array] = {}
        answer = partial(self._answer, system, effects)
        answer("velocity", np.eye(n), [self._by_velocity(*each, mean) for each in zip(self._groups, self._jacobians)])
        answer("force", h * self._inverse, none)
        for cause in ("stiffness", "friction"):
            answer(cause, np.zeros((n, p)), [_spread(group, cause, p) for group in self._groups])
        if poses:
            turned = {id(tree): tree.by_pose() for tree in self._trees}
            rows = [self._by_pose(*each, mean, turned) for each in zip(self._groups, self._jacobians)]
            answer("pose", self._pushed_by_pose(turned), rows)

    def _answer(self, system: _System, effects: Array, cause: str, direct: Array, rows: list[Array]) -> None:
        """Find how velocities and contacts change by a cause.

        `direct` (n, m) is the change of the velocities if unknowns do not change. `rows` are the changes of the
        residuals if neither velocities nor unknowns change.
        """
        count = direct.shape[1]
        missing = [
            own + group.by["after"][0] @ (jacobian @ direct)
            for own, group, jacobian in zip(rows, self._groups, self._jacobians)
        ]
        unknowns = -system.solve(np.concatenate(missing or [np.zeros((0, count))]))
        self._velocity[cause] = direct + effects @ unknowns
        contact = np.zeros((len(self.forces), 6, count))
        start = 0
        for group, jacobian in zip(self._groups, self._jacobians):
            end = start + group.real.unknowns[0].size
            found = group.by["unknowns"][2] @ unknowns[start:end]
            if cause == "pose":
                found = found + group.by["pose"][2] @ jacobian
            contact[group.rows] = found.reshape(len(group.rows), 6, count)
            start = end
        self._contact[cause] = contact

    def _by_velocity(self, group: _Group, jacobian: Array, mean: _Means) -> Array:
        """(8g, n) the change of the residuals by the velocities before the step."""
        of_mean = np.zeros((12, self._count))
        for k, (tree, at) in enumerate(map(self._place, group.links)):
            of_mean[6 * k : 6 * k + 6, tree.span] = mean[id(tree)][1][:, at].T
        found: Array = group.by["before"][0] @ jacobian + group.by["mean"][0] @ of_mean
        return found

    def _by_pose(self, group: _Group, jacobian: Array, mean: _Means, turned: dict[int, tuple[Array, Array]]) -> Array:
        """(8g, n) the change of the residuals by the poses, while the velocities of the coordinates stay."""
        found: Array = group.by["pose"][0] @ jacobian
        for k, (tree, at) in enumerate(map(self._place, group.links)):
            side = slice(6 * k, 6 * k + 6)
            motions = [("mean", mean[id(tree)][2][:, at].T)]
            for name, velocity in (("before", self._solved.velocity), ("after", self.velocity)):
                motions.append((name, np.einsum("jcn,n->cj", turned[id(tree)][0][:, at], velocity[tree.span])))
            for name, motion in motions:
                found[:, tree.span] += group.by[name][0][:, side] @ motion
        return found

    def _pushed_by_pose(self, turned: dict[int, tuple[Array, Array]]) -> Array:
        """(n, n) the change of the velocities by the poses, if the forces along the axes of the patches stay."""
        h, n = self._solved.duration, self._count
        pushes, changes = np.zeros(n), np.zeros((n, n))
        for group, jacobian in zip(self._groups, self._jacobians):
            wrench = group.laws.wrench(group.real).wrench[0].real
            pushes += jacobian.T @ wrench
            changes += jacobian.T @ group.by["pose"][1] @ jacobian
            for k, (tree, at) in enumerate(map(self._place, group.links)):
                by = np.einsum("jcn,c->nj", turned[id(tree)][0][:, at], wrench[6 * k : 6 * k + 6])
                changes[tree.span, tree.span] += by
        found = h * self._inverse @ changes
        for tree in self._trees:
            by = np.einsum("jab,b->aj", turned[id(tree)][1], pushes[tree.span])
            found[tree.span, tree.span] += h * by
        return found

    def _polish(self, free: Array) -> None:
        """Solve the laws to rounding, from the solution of the core, which stops at 1e-8."""
        self._set_end(free)
        for group in self._groups:
            group.laws(group.real, find=True)
            self._split(group)
        self._find_branches()
        scale = np.abs(self.velocity).max(initial=0)
        scale = max(scale, np.abs(self._solved.duration * self._solved.acceleration).max(initial=0)) or 1.0
        for attempt in range(POLISHES if self._groups else 0):
            missing = np.concatenate([group.laws(group.real).residual[0].real.ravel() for group in self._groups])
            for group in self._groups:
                group.by = _by_inputs(group, poses=False, only=("after", "unknowns"))
            system, effects = self._system()
            step = -system.nearest(missing)
            change = float(np.abs(effects @ step).max(initial=0) / scale)
            if attempt == 0 and not change <= AGREED:
                raise RuntimeError(
                    f"the contact forces are not settled: a step of Newton's method changes velocities by {change:.0e} "
                    "of the largest, so that they have no derivatives"
                )
            start = 0
            for group in self._groups:
                unknowns = group.real.unknowns
                more = step[start : start + unknowns[0].size].reshape(unknowns.shape)
                group.real = group.real._replace(unknowns=unknowns + more)
                start += more.size
            self._set_end(free)
            if change < POLISHED:
                break
        self._find_branches()

    def _find_branches(self) -> None:
        for group in self._groups:
            group.laws.regimes.kinks.clear()
            group.laws(group.real, find=True)

    @staticmethod
    def _split(group: _Group) -> None:
        """Split the torques of contacts that resist rolling: pressures give theirs, and rolling resistance the rest."""
        rolls = group.laws.fixed.rolling > 0
        if not rolls.any():
            return
        unknowns = group.real.unknowns.copy()
        more = -group.laws(group.real).residual[:, rolls, 1:3]
        unknowns[:, rolls, 1:3] += more
        unknowns[:, rolls, 3:5] -= more
        group.real = group.real._replace(unknowns=unknowns)

    def _set_end(self, free: Array) -> None:
        """Find the velocity at the end, which follows from the forces and the velocity without them."""
        pushes = np.zeros(self._count)
        for group, jacobian in zip(self._groups, self._jacobians):
            pushes += jacobian.T @ group.laws.wrench(group.real).wrench[0].real
        self.velocity = free + self._solved.duration * self._inverse @ pushes
        for group in self._groups:
            group.real = group.real._replace(after=self._pair_motion(group.links, self.velocity)[None])

    def _system(self) -> tuple[_System, Array]:
        """The equations of the unknowns, and the velocities (n, 8p) by the unknowns."""
        h, sizes = self._solved.duration, [group.real.unknowns[0].size for group in self._groups]
        ends = np.cumsum([0, *sizes])
        effects = np.zeros((self._count, ends[-1]))
        matrix, units = np.zeros((ends[-1], ends[-1])), np.ones(ends[-1])
        for k, (group, jacobian) in enumerate(zip(self._groups, self._jacobians)):
            effects[:, ends[k] : ends[k + 1]] = h * self._inverse @ (jacobian.T @ group.by["unknowns"][1])
        for k, (group, jacobian) in enumerate(zip(self._groups, self._jacobians)):
            here = slice(ends[k], ends[k + 1])
            matrix[here] = group.by["after"][0] @ (jacobian @ effects)
            matrix[here, here] += group.by["unknowns"][0]
            moved = np.abs(jacobian @ effects[:, here]).max(axis=0, initial=0)
            units[here] = 1 / np.where(moved > 0, moved, 1)
        return _System(matrix, units), effects


_Means = dict[int, tuple[Array, Array, Array]]


def _spread(group: _Group, cause: str, count: int) -> Array:
    """(8g, count) the changes of residuals by a law of each contact."""
    by = group.by[cause][0]
    found = np.zeros((len(by), count))
    found[:, group.rows] = by
    return found


class _System:
    """Linear equations of the unknowns in `units`, solved by the least unknowns where they are not unique."""

    def __init__(self, matrix: Array, units: Array) -> None:
        self._units = units
        scaled = matrix * units
        rows = np.abs(scaled).max(axis=1, initial=0)
        self._rows = 1 / np.where(rows > 0, rows, 1)
        left, sizes, right = np.linalg.svd(scaled * self._rows[:, None])
        large = sizes > SINGULAR * sizes.max(initial=0)
        self._left, self._right, self._sizes = left[:, large], right[large], sizes[large]
        self._never = left[:, ~large]
        self.shared: NDArray[np.bool_] = (np.abs(right[~large]) > SHARED).any(axis=0)

    def nearest(self, side: Array) -> Array:
        """Return the unknowns (m,) or (m, k) that miss the right side by the least."""
        scaled = (side.T * self._rows).T
        found = self._right.T @ ((self._left.T @ scaled).T / self._sizes).T
        result: Array = (found.T * self._units).T
        return result

    def solve(self, side: Array) -> Array:
        """Return the unknowns (m, k). Columns that no unknowns solve are not a number."""
        scaled = (side.T * self._rows).T
        unsolved = np.abs(self._never.T @ scaled).max(axis=0, initial=0)
        solvable = unsolved <= SHARED * np.abs(scaled).max(axis=0, initial=0)
        return np.where(solvable, self.nearest(side), np.nan)


def _left_jacobian(vector: Array) -> Array:
    """(3, 3) the rotation in the world by a small change of a rotation vector (3,)."""
    steps = vector + 1j * TINY * np.eye(3)
    back = turn_of(np.asarray(-vector))
    return np.stack([_axis((turn.imag / TINY) @ back) for turn in turn_of(steps)], axis=-1)


def _axis(turn: Array) -> Array:
    return np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2


def _geometry(overlap: Overlap) -> Array:
    inertia, none = overlap.inertia, np.zeros(3)
    spread = np.trace(inertia) / 2 * np.eye(3) - inertia
    patch = overlap.patch_area, overlap.patch_centre, overlap.patch_moments, overlap.patch_distance
    area, centre, moments, distance = (
        np.nan_to_num(np.asarray(default if each is None else each, dtype=float))
        for each, default in zip(patch, (none, none, np.zeros((3, 3)), 0.0))
    )
    found: Array = Geometry(overlap.volume, overlap.centroid, area, centre, moments, distance, spread).flat()
    return found


def _plane(overlap: Overlap) -> tuple[Array, int]:
    """A point and the normal (2, 3) of a half-space, and its side; zeros and -1 without one."""
    for side, each in enumerate(overlap.shapes):
        if isinstance(each.shape, HalfSpace):
            told = facts(each.shape).side(np.zeros(3))
            assert told is not None
            normal = rotated(each.orientation, told[0])
            return np.array([each.position + told[1] * normal, normal]), side
    return np.zeros((2, 3)), -1


def _by_inputs(
    group: _Group, poses: bool, only: Sequence[str] = (), single: Sequence[bool] = (True, True)
) -> dict[str, tuple[Array, Array, Array]]:
    """The derivatives of the laws of two links by their inputs, by complex steps."""
    real, g = group.real, len(group.rows)
    widths = {"before": 12, "mean": 12, "after": 12, "unknowns": UNKNOWNS * g, "stiffness": g, "friction": g}
    widths = {name: width for name, width in widths.items() if not only or name in only}
    if poses:
        widths["pose"] = 12
    count = sum(widths.values())
    given = {name: np.repeat(np.asarray(value, dtype=complex), count, axis=0) for name, value in real._asdict().items()}
    spans, start = {}, 0
    for name, width in widths.items():
        spans[name] = slice(start, start + width)
        if name != "pose":
            rows = np.arange(start, start + width)
            given[name].reshape(count, -1)[rows, np.arange(width)] += 1j * TINY
        start += width
    if poses:
        _displace(group, given, spans["pose"], single)
    answer = group.laws(Inputs(**given))
    outputs = (
        answer.residual.reshape(count, -1),
        answer.wrench,
        np.concatenate([answer.force, answer.torque], axis=-1).reshape(count, -1),
    )
    return {name: tuple(each[span].imag.T / TINY for each in outputs) for name, span in spans.items()}


def _displace(group: _Group, given: dict[str, Any], span: slice, single: Sequence[bool]) -> None:
    """Move the links, their patches and half-spaces in a complex step along their motions."""
    assert group.moving is not None
    step = 1j * TINY
    for k in range(2):
        for axis, unit in enumerate(np.eye(3)):
            linear, angular = span.start + 6 * k + axis, span.start + 6 * k + 3 + axis
            given["centres"][linear, k] += step * unit
            rows = group.plane_sides == k
            given["planes"][linear, rows, 0] += step * unit
            arm = group.planes[rows, 0] - group.real.centres[0, k].real
            given["planes"][angular, rows, 0] += step * np.cross(unit, arm)
            given["planes"][angular, rows, 1] += step * np.cross(unit, group.planes[rows, 1])
            if single[k]:
                block = slice(6 * k + 3, 6 * k + 6)
                turn = np.cross(np.eye(3), unit)  # its rows times a vector: unit × vector
                inverse = group.real.admittance[0, block, block].real
                given["admittance"][angular, block, block] += step * (turn @ inverse - inverse @ turn)
    for patch, moving in enumerate(group.moving):
        given["geometry"][span, patch] += step * moving.by_motion.T
