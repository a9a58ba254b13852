"""The gap between two shapes of a mechanism, bounded from below for all configurations in a box of joint positions.

Rounding is charged: numbers are balls, a midpoint and a radius that contains the exact value. The core is not used.

At the centre of a box, `n` is an axis and `gap` the room between the two shapes along it. The path of joints between
the shapes is cut: the joints before the cut move shape A, the others move shape B, as seen from the link at the cut.
There are two bounds of the motion, and the better one counts.

- A joint c that turns by at most d_c moves a point by at most d_c R_c, where R_c is the distance of the point from the
  axis at the centre of the box. It suffices to look at the centre: the joints can be turned one after the other, and
  the joints nearer to the shape are turned last.
- Along n, a point moves by at most the sum of d_c |n . (u_c x (p - o_c))| + 1/2 d_c d_e R'. This is Taylor's formula.
  R' is the largest distance from the axis of the joint nearer to the shape: R + the sum of d R over the joints between
  that joint and the shape. A prismatic joint moves a point by d_c, and turns nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from flint import arb
from numpy.typing import NDArray

from overlapper import Box, Capsule, Cylinder, Ellipsoid, Hull, RoundedHull, Shape, Sphere
from overlapper.rational import rotation

Array = NDArray[np.float64]

UNIT = 2.0**-53  # the relative error of one rounded operation
MORE = 1 + 2.0**-44  # more than the relative error of a hundred rounded operations on numbers that are not negative
TINY = 1e-300  # more than the error of an underflow
LEVERS = 12  # balls that cover the points of a shape
SIDES = 32  # of the prism around a cylinder


class Ball(NamedTuple):
    """Arrays of numbers: each exact value is within `radius` of its `middle`."""

    middle: Array
    radius: Array

    def __matmul__(self, other: Ball) -> Ball:  # of 3 x 3 matrices, or of a matrix and columns
        a, b = np.abs(self.middle), np.abs(other.middle)
        error = a @ other.radius + self.radius @ (b + other.radius) + 4 * UNIT * (a @ b)
        return Ball(self.middle @ other.middle, error * MORE + TINY)

    def plus(self, other: Ball) -> Ball:
        middle = self.middle + other.middle
        return Ball(middle, (self.radius + other.radius + UNIT * np.abs(middle)) * MORE)

    def minus(self, other: Ball) -> Ball:
        return self.plus(Ball(-other.middle, other.radius))

    def times(self, other: Ball) -> Ball:
        middle, a, b = self.middle * other.middle, np.abs(self.middle), np.abs(other.middle)
        error = a * other.radius + self.radius * (b + other.radius) + UNIT * np.abs(middle)
        return Ball(middle, error * MORE + TINY)

    @property
    def turned(self) -> Ball:
        """The transposed matrices."""
        return Ball(self.middle.swapaxes(-1, -2), self.radius.swapaxes(-1, -2))

    @property
    def most(self) -> Array:
        """The largest possible length of the vectors (..., 3, 1)."""
        found: Array = np.sqrt(((np.abs(self.middle) + self.radius) ** 2).sum((-1, -2))) * MORE + TINY
        return found


def ball(values: Array, ulps: float = 0) -> Ball:
    values = np.asarray(values, dtype=float)
    return Ball(values, np.abs(values) * (2 * ulps * UNIT) + (TINY if ulps else 0))


def cross(u: Ball, v: Ball) -> Ball:
    """The cross products of columns (..., 3, 1)."""
    one, two = [1, 2, 0], [2, 0, 1]

    def part(each: Ball, order: list[int]) -> Ball:
        return Ball(each.middle[..., order, :], each.radius[..., order, :])

    return part(u, one).times(part(v, two)).minus(part(u, two).times(part(v, one)))


@dataclass(frozen=True, slots=True)
class ChainJoint:
    """A joint on the way to a shape, as `overlapper.simulation.kinematic_tree.Joint`, with the number that drives it.

    The position of the joint is multiplier * q[column] + shift. The column is -1 if nothing moves the joint.
    """

    kind: str
    position: Array
    orientation: Array
    axis: Array
    offset: Array
    column: int
    multiplier: float
    shift: float

    @property
    def moves(self) -> bool:
        return self.column >= 0 and self.multiplier != 0 and self.kind in ("revolute", "prismatic")


@dataclass(frozen=True)
class Body:
    """A shape as the hull of balls of equal `radius` about `points` (v, 3): the shape, or a body that contains it.

    A cylinder is within a prism of 32 sides, an ellipsoid within its bounding box. `position` and `orientation` are in
    the frame of its link. `joints` lead from the common link of a pair to that link.
    """

    points: Array
    radius: float
    position: Array
    orientation: Array
    joints: tuple[ChainJoint, ...]

    @cached_property
    def levers(self) -> tuple[Array, Array]:
        """Balls that contain the points of the body: centres (k, 3) and radii (k,)."""
        chosen = [int(((self.points - self.points.mean(0)) ** 2).sum(1).argmax())]
        away = np.full(len(self.points), np.inf)
        while len(chosen) < min(LEVERS, len(self.points)):
            away = np.minimum(away, ((self.points - self.points[chosen[-1]]) ** 2).sum(1))
            chosen.append(int(away.argmax()))
        nearest = ((self.points[:, None] - self.points[chosen]) ** 2).sum(2).argmin(1)
        groups = [self.points[nearest == k] for k in range(len(chosen)) if (nearest == k).any()]
        centres = np.array([(group.min(0) + group.max(0)) / 2 for group in groups])
        radii = np.array([np.sqrt(((group - c) ** 2).sum(1)).max() for group, c in zip(groups, centres)])
        return centres, radii * MORE + 16 * UNIT * np.abs(self.points).max()


def outer(shape: Shape) -> tuple[Array, float] | None:
    """Points and a radius of a body that contains the shape; None for a half-space, which has no such body."""
    match shape:
        case Sphere():
            return np.zeros((1, 3)), shape.radius
        case Capsule():
            return np.array([[0, 0, -shape.length / 2], [0, 0, shape.length / 2]]), shape.radius
        case Hull():
            return np.array(shape.vertices), 0.0
        case RoundedHull():
            return np.array(shape.core.vertices), shape.radius
        case Cylinder():
            turn = np.arange(SIDES) * (2 * np.pi / SIDES)
            rim = shape.radius / np.cos(np.pi / SIDES) * MORE * np.array([np.cos(turn), np.sin(turn)]).T
            ends = np.repeat([-shape.length / 2, shape.length / 2], SIDES)
            return np.column_stack([np.tile(rim, (2, 1)), ends]), 0.0
        case Box() | Ellipsoid():
            halves = shape.half_extents if isinstance(shape, Box) else shape.half_axes
            signs = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T
            return signs * halves, 0.0
        case _:
            return None


class Frame(NamedTuple):
    """Where a body is, and the axis `u` and the pivot `o` of each joint that moves it; columns (n, 3, 1)."""

    turn: Ball
    position: Ball
    axes: list[Ball]
    pivots: list[Ball]


@dataclass(frozen=True)
class Chain:
    """Two bodies, and the joints from their nearest common link to each. All coordinates are in that link's frame."""

    a: Body
    b: Body

    @cached_property
    def path(self) -> list[tuple[int, int, ChainJoint]]:
        """The joints that move, from body A to body B: body, number among the body's joints that move, joint."""
        ways = [[joint for joint in body.joints if joint.moves] for body in (self.a, self.b)]
        back = [(0, k, joint) for k, joint in enumerate(ways[0])][::-1]
        return back + [(1, k, joint) for k, joint in enumerate(ways[1])]

    @property
    def columns(self) -> list[int]:
        """The columns that move one body relative to the other, sorted."""
        return sorted({joint.column for _, _, joint in self.path})

    def placed(self, configurations: Array) -> list[Frame]:
        """Both bodies at configurations (n, m), whose columns are `columns`."""
        values = dict(zip(self.columns, configurations.T))
        return [_placed(body, values, len(configurations)) for body in (self.a, self.b)]

    def margins(self, lower: Array, upper: Array, axes: Array) -> tuple[Array, Array]:
        """A lower bound (n,) in m of the gap in boxes of joint positions, and how much each column takes of it (n, m).

        `lower` and `upper` (n, m) bound the boxes. `axes` (n, 3) point from body B to body A. They need no length. If
        the bound is positive, the two bodies have no common point anywhere in the box.
        """
        middle = centres(lower, upper)
        frames = self.placed(middle)
        most = np.maximum(upper - middle, middle - lower) * MORE  # a difference of doubles is rounded
        place = {column: k for k, column in enumerate(self.columns)}
        n = len(axes)
        half = np.array([most[:, place[j.column]] * abs(j.multiplier) * MORE for _, _, j in self.path]).reshape(-1, n)
        turns = np.array([joint.kind == "revolute" for _, _, joint in self.path], dtype=bool)
        normal = ball(axes[:, :, None])
        levers = [self._levers(body, frame, frames, turns, n) for body, frame in zip((self.a, self.b), frames)]
        # The cut at which the levers are smallest: the joints before the cut move A, the joints from the cut on move B.
        before = np.vstack([np.zeros(n), np.cumsum(half * levers[0], 0)])
        after = np.vstack([np.cumsum((half * levers[1])[::-1], 0)[::-1], np.zeros(n)])
        cuts = (before + after).argmin(0)
        bounds, shares = np.empty(n), np.zeros((n, len(place)))
        for cut in np.unique(cuts):
            rows = np.flatnonzero(cuts == cut)
            bounds[rows], taken = self._bounds(int(cut), rows, frames, normal, half, levers, turns)
            for k, (_, _, joint) in enumerate(self.path):
                shares[rows, place[joint.column]] += taken[k]
        return bounds, shares

    def _levers(self, body: Body, frame: Frame, frames: list[Frame], turns: NDArray[np.bool_], n: int) -> Array:
        """(joints, n): how far points of the body are from the axis of each joint, in m. 1 if prismatic."""
        centres, radii = body.levers
        local = frame.turn @ ball(centres.T[None])
        points = Ball(local.middle, local.radius).plus(Ball(frame.position.middle, frame.position.radius))
        found = np.empty((len(self.path), n))
        for k, (side, number, _) in enumerate(self.path):
            if not turns[k]:
                found[k] = frames[side].axes[number].most
            else:
                away = cross(frames[side].axes[number], points.minus(frames[side].pivots[number]))
                length = np.sqrt(((np.abs(away.middle) + away.radius) ** 2).sum(1)) * MORE
                found[k] = (length + radii).max(1) * MORE
        return found

    def _bounds(
        self,
        cut: int,
        rows: NDArray[np.intp],
        frames: list[Frame],
        normal: Ball,
        half: Array,
        levers: list[Array],
        turns: NDArray[np.bool_],
    ) -> tuple[Array, Array]:
        """The bounds of the boxes `rows` for a cut, and the share of each joint (joints, rows)."""
        axis = Ball(normal.middle[rows], normal.radius[rows])
        length = axis.most
        swings, plain, total = np.zeros((len(self.path), len(rows))), np.zeros(len(rows)), np.zeros(len(rows))
        sides = ((0, list(range(cut))), (1, list(range(len(self.path) - 1, cut - 1, -1))))
        for side, joints in sides:  # joints of a side from the body to the cut
            body, frame, sign = (self.a, self.b)[side], frames[side], (1, -1)[side]
            steps, reach = half[joints][:, rows], levers[side][joints][:, rows]
            # Taylor's second term: a pair of joints turns the lever of the joint that is nearer to the body.
            drift = np.vstack([np.zeros((1, len(rows))), np.cumsum(steps * reach, 0)[:-1]]) if joints else steps
            far = np.where(turns[joints][:, None], (reach + drift) * MORE, reach)
            outward = np.cumsum((steps * turns[joints][:, None])[::-1], 0)[::-1]
            second = (steps * far * (outward - steps * turns[joints][:, None] / 2)).sum(0) * MORE * length
            directions = []
            for k in joints:
                here, number, _ = self.path[k]
                part = frames[here].axes[number], frames[here].pivots[number]
                u, o = (Ball(each.middle[rows], each.radius[rows]) for each in part)
                directions.append((cross(axis, u) if turns[k] else axis.turned @ u, o))
            turn = Ball(frame.turn.middle[rows], frame.turn.radius[rows])
            position = Ball(frame.position.middle[rows], frame.position.radius[rows])
            ahead = _along(body, turn, position, axis)
            gap = sign * ahead.middle - ahead.radius - body.radius * length[:, None] * MORE
            least = gap.min(1)
            plain += least - (steps * reach).sum(0) * MORE * length - 4 * UNIT * np.abs(least)
            moved = np.zeros_like(gap)
            for place, k in enumerate(joints):
                w, o = directions[place]
                if turns[k]:
                    swing = _along(body, turn, position.minus(o), w)
                    size = np.abs(swing.middle) + swing.radius
                else:
                    size = np.broadcast_to((np.abs(w.middle) + w.radius)[:, :, 0], gap.shape)
                moved += size * steps[place][:, None]
                swings[k] = np.take_along_axis(size, gap.argmin(1)[:, None], 1)[:, 0] * steps[place]
            nearest = gap - moved * MORE - 4 * UNIT * np.abs(gap)
            total += nearest.min(1) - second - 4 * UNIT * np.abs(nearest.min(1))
            swings[joints] += steps * far * outward / 2
        bound = np.maximum(plain, total)
        return bound - 4 * UNIT * np.abs(bound) - TINY, swings


def centres(lower: Array, upper: Array) -> Array:
    """The middles of boxes, rounded. They are where `margins` places the bodies."""
    middle: Array = lower + (upper - lower) / 2
    return middle


def _along(body: Body, turn: Ball, position: Ball, direction: Ball) -> Ball:
    """The products (n, v) of a direction with the points of a body."""
    local = turn.turned @ direction
    base = position.turned @ direction
    middle = local.middle[..., 0] @ body.points.T
    sizes = np.abs(body.points).T
    error = (local.radius[..., 0] + 4 * UNIT * np.abs(local.middle[..., 0])) @ sizes
    found = middle + base.middle[..., 0]
    return Ball(found, (error + base.radius[..., 0] + UNIT * np.abs(found)) * MORE + TINY)


def _placed(body: Body, values: dict[int, Array], n: int) -> Frame:
    turn, position = ball(np.broadcast_to(np.eye(3), (n, 3, 3))), ball(np.zeros((n, 3, 1)))
    axes, pivots = [], []
    for joint in body.joints:
        position = position.plus(turn @ ball(joint.position[:, None]))
        turn = turn @ _matrix(joint.orientation)
        axis = joint.axis / np.linalg.norm(joint.axis) if joint.axis.any() else joint.axis
        numbers = values[joint.column] if joint.moves else np.zeros(1)
        if joint.kind == "revolute":
            about = turn @ ball(axis[:, None], 4)
            if joint.moves:
                axes.append(about)
                pivots.append(position)
            turn = turn @ _turns(axis, numbers, joint)
        elif joint.kind == "prismatic":
            along = turn @ ball(joint.axis[:, None])
            if joint.moves:
                axes.append(along)
                pivots.append(position)
            _, _, value = _driven(numbers, joint)
            position = position.plus(along.times(Ball(value.middle[:, None, None], value.radius[:, None, None])))
        position = position.plus(turn @ ball(joint.offset[:, None]))
    position = position.plus(turn @ ball(body.position[:, None]))
    turn = turn @ _matrix(body.orientation)
    return Frame(turn, position, axes, pivots)


def _matrix(quaternion: Array) -> Ball:
    """The exact rotation by the direction of a quaternion, rounded."""
    return ball(rotation(quaternion).astype(float), 1)


def _turns(axis: Array, numbers: Array, joint: ChainJoint) -> Ball:
    """Rotations about a unit axis, by Rodrigues' formula."""
    sine, cosine, _ = (Ball(each.middle[:, None, None], each.radius[:, None, None]) for each in _driven(numbers, joint))
    x, y, z = axis
    skew = ball(np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]), 4)
    around = ball(np.outer(axis, axis), 9)
    one = ball(np.eye(3))
    return one.times(cosine).plus(skew.times(sine)).plus(around.times(ball(np.ones((1, 1, 1))).minus(cosine)))


def _driven(numbers: Array, joint: ChainJoint) -> tuple[Ball, Ball, Ball]:
    """Sine, cosine and value of the position of a joint. FLINT bounds them, once for each distinct number."""
    distinct, which = np.unique(numbers, return_inverse=True)
    factor = arb(joint.multiplier) if joint.moves else arb(0)
    angles = [factor * arb(value) + arb(joint.shift) for value in distinct.tolist()]
    columns = [angle.sin_cos() for angle in angles]
    parts: list[Sequence[arb]] = [[sine for sine, _ in columns], [cosine for _, cosine in columns], angles]
    found = []
    for part in parts:
        middle = np.array([float(each.mid()) for each in part])
        radius = np.array([float((each - arb(m)).abs_upper()) for each, m in zip(part, middle.tolist())])
        found.append(Ball(middle[which], radius[which] * MORE + TINY))
    return found[0], found[1], found[2]
