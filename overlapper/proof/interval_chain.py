"""The room between two shapes of a mechanism in a box of joint positions, in FLINT's interval arithmetic.

It checks what `overlapper.proof.chain` claims. Both take the same description of joints and shapes. The kinematics, the
bound and the arithmetic are different. The core is not used.

Poses are 4 x 4 matrices. A joint has a twist X, a 4 x 4 matrix with X (y, 1) = u x (y - o) for the axis u and the pivot
o at the centre of the box. A turn by an angle d moves the pose Y of a shape to

    Y + sin(d) X Y + (1 - cos(d)) X X Y,    which is Rodrigues' formula.

A joint that slides by d moves Y to Y + d X Y, where X has the axis in its last column.

Every configuration in the box is reached from the centre: the joints move one after another, beginning with the joint
next to the shape. Intervals contain all values of d and all poses Y before each move. The bound adds what each move can
take along the axis n. It needs no derivative.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce
from typing import NamedTuple

import numpy as np
from flint import arb, arb_mat

from overlapper.proof.chain import Array, Body, Chain, ChainJoint, centres
from overlapper.proof.vectors import rational
from overlapper.rational import rotation

PIECES = 256  # of a box, at most
ONE = arb_mat(np.eye(4).astype(int).tolist())
NOTHING = arb(0)


class Mover(NamedTuple):
    """A joint that moves a body, with its twist at the centre of a box. It moves by `most` to either side, at most.

    `link` is the pose of the link that it carries.
    """

    twist: arb_mat
    turns: bool
    most: arb
    column: int
    link: arb_mat

    @property
    def shares(self) -> tuple[arb, arb]:
        """Intervals of the factors of X Y and of X X Y."""
        if not self.turns:
            return self.most.union(-self.most), NOTHING
        sine = self.most.sin() if self.most < 1.5 else arb(1)
        versed = 2 * (self.most / 2).sin() ** 2 if self.most < 3 else arb(2)
        return sine.union(-sine), NOTHING.union(versed)


class Box(NamedTuple):
    """A box of joint positions, and both bodies at its centre, with the joints from the common link to each."""

    lower: Array
    middle: Array
    upper: Array
    poses: tuple[arb_mat, arb_mat]
    joints: tuple[list[Mover], list[Mover]]

    @property
    def path(self) -> list[Mover]:
        """The joints from body A to body B."""
        return [*self.joints[0][::-1], *self.joints[1]]

    def link(self, cut: int) -> arb_mat:
        """The pose of the link between the joints before the cut of the path and the others."""
        number = cut - len(self.joints[0])
        return self.joints[number > 0][abs(number) - 1].link if number else ONE


class Least(NamedTuple):
    """The least coordinate of a body along a normal: at the `centre` of a box, and in all of the `box`.

    `taken` (joints,) is about how much each joint takes of it.
    """

    centre: arb
    box: arb
    taken: list[float]


class IntervalChain:
    """Two bodies, and the joints from their nearest common link to each, in interval arithmetic."""

    def __init__(self, chain: Chain) -> None:
        self._columns = chain.columns
        self._bodies = IntervalBody(chain.a), IntervalBody(chain.b)

    def has_room(self, lower: Array, upper: Array, axis: Array) -> bool:
        """Whether the bodies have no common point for all joint positions from `lower` to `upper` (m,). True is proved.

        `axis` (3,) points from body B to body A at the centre of the box. It needs no length. One of the links
        between the bodies carries it. The box is halved where its intervals are too wide, into at most 256 pieces.
        """
        box = self._box(lower, upper)
        return any(self._is_proved(box, axis, cut) for cut in self._cuts(box))

    def _is_proved(self, whole: Box, axis: Array, cut: int) -> bool:
        """Whether there is room along an axis that the link at the cut carries."""
        carried = arb_mat([[*map(arb, axis.tolist()), 0]]) * whole.link(cut)
        pieces = [whole]
        for _ in range(2 * PIECES):
            box = pieces.pop()
            room, left, taken = self._room(box, cut, carried * box.link(cut).inv())
            if not left > 0:
                place = int(taken.argmax()) if len(taken) else -1
                if not room > 0 or place < 0 or not box.lower[place] < box.middle[place] < box.upper[place]:
                    return False
                first, second = box.upper.copy(), box.lower.copy()
                first[place] = second[place] = box.middle[place]
                pieces += [self._box(box.lower, first), self._box(second, box.upper)]
            if not pieces:
                return True
        return False

    def _box(self, lower: Array, upper: Array) -> Box:
        middle = centres(lower, upper)
        centre = dict(zip(self._columns, map(arb, middle.tolist())))
        most = {
            column: (high - centre[column]).max(centre[column] - low)
            for column, low, high in zip(self._columns, map(arb, lower.tolist()), map(arb, upper.tolist()))
        }
        poses, joints = zip(*(body.placed(centre, most) for body in self._bodies))
        return Box(lower, middle, upper, poses, joints)

    def _cuts(self, box: Box) -> list[int]:
        """Cuts of the path, by how much the bodies move. The joints before a cut move body A, the others body B."""
        a, b = (
            [float(joint.most) * body.lever(joint, pose) for joint in box.path]
            for body, pose in zip(self._bodies, box.poses)
        )
        return [int(cut) for cut in (np.cumsum([0, *a]) + np.cumsum([0, *b[::-1]])[::-1]).argsort()]

    def _room(self, box: Box, cut: int, normal: arb_mat) -> tuple[arb, arb, Array]:
        """The room at the middle of a box, what is left of it in the box, and what each column takes (m,)."""
        path = box.path
        a = self._bodies[0].least(box.poses[0], path[:cut], normal)
        b = self._bodies[1].least(box.poses[1], path[cut:][::-1], -1 * normal)
        taken = np.zeros(len(self._columns))
        for joint, share in zip(path, [*a.taken, *b.taken[::-1]]):
            taken[self._columns.index(joint.column)] += share
        return a.centre + b.centre, a.box + b.box, taken


class IntervalBody:
    """A body and the joints that lead to it, in intervals."""

    def __init__(self, body: Body) -> None:
        self._doubles = np.vstack([body.points.T, np.ones(len(body.points))])
        self._points, self._radius = arb_mat(self._doubles.tolist()), body.radius
        self._joints = [IntervalJoint(joint) for joint in body.joints]
        self._place = _pose(body.position, body.orientation)

    def placed(self, centre: Mapping[int, arb], most: Mapping[int, arb]) -> tuple[arb_mat, list[Mover]]:
        """The pose at the centre of a box, and the joints that move it, from the common link to the body."""
        pose, movers = ONE, []
        for joint in self._joints:
            pose = pose * joint.place
            moved = pose * joint.pose(centre) * joint.offset
            if joint.moves:
                twist = pose * joint.twist * pose.inv()
                reach = (joint.multiplier * most[joint.column]).abs_upper()
                movers.append(Mover(twist, joint.turns, reach, joint.column, moved))
            pose = moved
        return pose * self._place, movers

    def lever(self, joint: Mover, pose: arb_mat) -> float:
        """About how far a joint moves a point of the body, for each unit of its motion. It only serves to choose."""
        matrix = np.array((joint.twist * pose).tolist(), dtype=float)
        return float(np.linalg.norm(matrix @ self._doubles, axis=0).max()) + self._radius * joint.turns

    def least(self, pose: arb_mat, joints: Sequence[Mover], normal: arb_mat) -> Least:
        """The least coordinate along a normal (1, 4), for joints from the body to the cut."""
        x, y, z, _ = normal.entries()
        within = arb(self._radius) * (x * x + y * y + z * z).sqrt()
        centre = (normal * pose * self._points).entries()
        if not joints:
            return Least(_least(centre) - within, _least(centre) - within, [])
        rows: list[list[arb]] = []
        shares: list[arb] = []
        for joint in joints:
            first = joint.twist * pose
            second = joint.twist * first
            rows += [(normal * first).entries(), (normal * second).entries()]
            shares += joint.shares
            pose = pose + first * shares[-2] + second * shares[-1]
        moves = arb_mat(rows) * self._points
        total = (arb_mat([shares]) * moves).entries()
        box = [start + move for start, move in zip(centre, total)]
        nearest = min(range(len(box)), key=lambda k: float(box[k].lower()))
        taken = [float((share * moves[k, nearest]).abs_upper()) for k, share in enumerate(shares)]
        by_joint = [one + two for one, two in zip(taken[::2], taken[1::2])]
        return Least(_least(centre) - within, _least(box) - within, by_joint)


class IntervalJoint:
    """A joint in intervals: where it is, its twist in its own frame, and the way from it to its link."""

    def __init__(self, joint: ChainJoint) -> None:
        self.moves, self.turns, self.column = joint.moves, joint.kind == "revolute", joint.column
        self.multiplier, self._shift = arb(joint.multiplier if joint.moves else 0), arb(joint.shift)
        self.place = _pose(joint.position, joint.orientation)
        self.offset = ONE + _slide([arb(each) for each in joint.offset.tolist()])
        axis = [arb(each) for each in joint.axis.tolist()]
        if self.turns:
            x, y, z = axis
            length = (x * x + y * y + z * z).sqrt() if joint.axis.any() else arb(1)
            x, y, z = x / length, y / length, z / length
            self.twist = arb_mat([[0, -z, y, 0], [z, 0, -x, 0], [-y, x, 0, 0], [0, 0, 0, 0]])
        else:
            self.twist = _slide(axis) if joint.kind == "prismatic" else arb_mat(4, 4)

    def pose(self, centre: Mapping[int, arb]) -> arb_mat:
        """The motion of the joint at the centre of a box."""
        value = self.multiplier * centre[self.column] + self._shift if self.moves else self._shift
        if not self.turns:
            return ONE + self.twist * value
        return ONE + self.twist * value.sin() + self.twist * self.twist * (1 - value.cos())


def _pose(position: Array, orientation: Array) -> arb_mat:
    turn = [[arb(rational(each)) for each in row] for row in rotation(orientation).tolist()]
    rows = [[*row, arb(each)] for row, each in zip(turn, position.tolist())]
    return arb_mat([*rows, [NOTHING, NOTHING, NOTHING, arb(1)]])


def _slide(shift: Sequence[arb]) -> arb_mat:
    return arb_mat([[0, 0, 0, each] for each in (*shift, NOTHING)])


def _least(numbers: Sequence[arb]) -> arb:
    """A lower bound of all numbers; not a number if one of them is none."""
    return reduce(arb.min, numbers).lower()
