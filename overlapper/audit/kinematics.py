"""The poses of the shapes of a robot, in many configurations at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from overlapper.audit.robot import Robot

Array = NDArray[np.float64]
Numbers = Sequence[Array | float]  # the components of a vector, a quaternion or a matrix: a number each, or n


class Kinematics:
    """Places the `count` shapes of `robot.tree.shapes`, without pybullet.

    Rounding: the orientation of a link is its parent's orientation times one quaternion. Each joint from the base adds
    an error of a few units in the last place. The error of the position is this error times the length of the arm.
    """

    def __init__(self, robot: Robot) -> None:
        self._links, self._shapes = robot.tree.links, robot.tree.shapes
        self.count = len(self._shapes)
        names = {link.joint.name: place for place, link in enumerate(self._links)}
        columns = {degree.link: degree.column for degree in robot.degrees}
        # By link: the column that moves its joint, with multiplier and offset; -1 where the joint's leader stays at 0.
        self.driven = {place: (column, 1.0, 0.0) for place, column in columns.items()}
        for name, mimic in robot.mimics.items():
            column = columns.get(names[mimic.leader], -1)
            self.driven[names[name]] = column, mimic.multiplier, mimic.offset

    def poses(self, configurations: Array) -> tuple[Array, Array]:
        """Positions (n, k, 3) in m and unit quaternions xyzw (n, k, 4) of the shapes, in the frame of the world.

        `configurations` (n, m) have the columns of `robot.columns`.
        """
        n = len(configurations)
        frames = self._frames(np.asarray(configurations, dtype=float).T)
        positions, orientations = np.empty((n, self.count, 3)), np.empty((n, self.count, 4))
        for k, shape in enumerate(self._shapes):
            position, orientation, matrix = frames[shape.link]
            for axis, value in enumerate(_moved(position, matrix, shape.position)):
                positions[:, k, axis] = value
            for axis, value in enumerate(_product(orientation, shape.orientation.tolist())):
                orientations[:, k, axis] = value
        return positions, orientations

    def _frames(self, columns: Array) -> list[tuple[Numbers, Numbers, Numbers]]:
        """Position, quaternion and rotation matrix of the inertial frame of each link."""
        frames: list[tuple[Numbers, Numbers, Numbers]] = []
        world: tuple[Numbers, Numbers, Numbers] = (0.0,) * 3, (0.0, 0.0, 0.0, 1.0), (1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0)
        for place, link in enumerate(self._links):
            joint = link.joint
            position, orientation, matrix = frames[link.parent] if link.parent >= 0 else world
            column, multiplier, offset = self.driven.get(place, (-1, 0.0, 0.0))
            value = columns[column] * multiplier + offset if column >= 0 else offset
            pivot = _moved(position, matrix, joint.position)
            turn: Numbers = joint.orientation.tolist()
            if joint.kind == "spherical":
                turn = _product(turn, list(columns[column : column + 4]))
            elif joint.kind == "revolute":
                sine, cosine = np.sin(value / 2), np.cos(value / 2)
                about = _product(turn, [*joint.axis.tolist(), 0.0])
                turn = [cosine * a + sine * b for a, b in zip(turn, about)]
            turn = _product(orientation, turn)
            matrix = _matrix(turn)
            if joint.kind == "prismatic":
                pivot = [p + value * a for p, a in zip(pivot, _moved((0.0,) * 3, matrix, joint.axis))]
            frames.append((_moved(pivot, matrix, joint.offset), turn, matrix))
        return frames


def _product(a: Numbers, b: Numbers) -> Numbers:
    """The product of two quaternions xyzw."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def _matrix(q: Numbers) -> Numbers:
    """The rotation matrix, row by row, of a unit quaternion xyzw."""
    x, y, z, w = q
    x2, y2, z2 = 2 * x, 2 * y, 2 * z
    xx, yy, zz, xy, xz, yz, wx, wy, wz = x * x2, y * y2, z * z2, x * y2, x * z2, y * z2, w * x2, w * y2, w * z2
    return 1 - yy - zz, xy - wz, xz + wy, xy + wz, 1 - xx - zz, yz - wx, xz - wy, yz + wx, 1 - xx - yy


def _moved(position: Numbers, matrix: Numbers, vector: Array) -> Numbers:
    """The position plus the vector after rotation by the matrix."""
    x, y, z = vector.tolist()
    if not vector.any():
        return position
    return [p + a * x + b * y + c * z for p, a, b, c in zip(position, matrix[0::3], matrix[1::3], matrix[2::3])]
