"""An affine frame in which the common part of convex bodies is about as long as wide, found in doubles.

Each constraint is { x : x'Qx + 2 b·x + c <= 0 } with a form Q that has no negative value. The frame is the frame of
Dikin's ellipsoid about the analytic centre (Nesterov and Nemirovskii, 1994). In it, the common part holds the unit ball
and lies in a ball whose radius is the number of constraints. Doubles only choose the frame. Its numbers are then taken
exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from flint import arb, fmpq
from numpy.typing import NDArray

from overlapper.proof.pieces import Ball, Egg, Plane, Quadric, Tube
from overlapper.proof.vectors import ORIGIN, Vector, dot, plus, rational, scaled, vector

Floats = NDArray[np.float64]
Matrix = tuple[Vector, Vector, Vector]

HALF = fmpq(1, 2)
UNIT: Matrix = (vector([1, 0, 0]), vector([0, 1, 0]), vector([0, 0, 1]))

# The largest number of frames, and of steps of Newton's method in a frame. Each frame is about the centre found in the
# frame before.
FRAMES, STEPS = 40, 60
# The least second derivative that is trusted, as a share of the greatest.
FLAT = 1e-13


@dataclass(frozen=True)
class Constraint:
    """x'Qx + 2 b·x + c <= 0, without rounding."""

    form: Matrix
    linear: Vector
    constant: fmpq

    def value(self, x: Vector) -> fmpq:
        return dot(x, plus(times(self.form, x), self.linear, 2)) + self.constant

    def within(self, origin: Vector, columns: Matrix) -> Constraint:
        """The constraint on y, where x = origin + y₀ columns[0] + y₁ columns[1] + y₂ columns[2]."""
        images = [times(self.form, column) for column in columns]
        slope = plus(times(self.form, origin), self.linear)
        form = tuple((dot(columns[0], image), dot(columns[1], image), dot(columns[2], image)) for image in images)
        linear = dot(columns[0], slope), dot(columns[1], slope), dot(columns[2], slope)
        return Constraint((form[0], form[1], form[2]), linear, self.value(origin))

    def in_doubles(self) -> Floats:
        """(10,): the upper half of the form, the linear part and the constant, divided by the largest of these."""
        (a, b, c), (_, d, e), (_, _, f) = self.form
        numbers = [a, b, c, d, e, f, *self.linear, self.constant]
        size = max(abs(x) for x in numbers)
        return np.array([double(x / size) for x in numbers])


def times(form: Matrix, x: Vector) -> Vector:
    return dot(form[0], x), dot(form[1], x), dot(form[2], x)


def double(x: fmpq) -> float:
    return int(x.p) / int(x.q)


def constraint(side: Quadric | Plane) -> Constraint:
    match side:
        case Plane(normal, offset):
            return Constraint((ORIGIN, ORIGIN, ORIGIN), scaled(normal, HALF), -offset)
        case Ball(centre, square):
            return _about(centre, UNIT, square)
        case Egg(centre, rows):
            form = [[sum((row[i] * row[j] for row in rows), ORIGIN[0]) for j in range(3)] for i in range(3)]
            return _about(centre, (vector_of(form[0]), vector_of(form[1]), vector_of(form[2])), fmpq(1))
        case Tube(point, axis, square):
            length = dot(axis, axis)
            form = [[(length if i == j else 0) - axis[i] * axis[j] for j in range(3)] for i in range(3)]
            rows = vector_of(form[0]), vector_of(form[1]), vector_of(form[2])
            return _about(point, rows, square * length)


def _about(centre: Vector, form: Matrix, square: fmpq) -> Constraint:
    slope = times(form, centre)
    return Constraint(form, scaled(slope, -1), dot(slope, centre) - square)


def scale_of(form: Matrix, other: Matrix) -> fmpq:
    """The factor that turns `form` into `other`, if they are proportional."""
    return (other[0][0] + other[1][1] + other[2][2]) / (form[0][0] + form[1][1] + form[2][2])


def is_alike(one: Quadric, other: Quadric) -> bool:
    form, wanted = constraint(one).form, constraint(other).form
    share = scale_of(form, wanted)
    return all(share * x == y for row, goal in zip(form, wanted) for x, y in zip(row, goal))


def within(plane: Plane, egg: Egg) -> Plane:
    """The plane in the coordinates in which the ellipsoid is the unit ball about the origin."""
    return Plane(solved(egg.rows, plane.normal), -plane.height(egg.centre))


def newton(hessian: Floats, gradient: Floats) -> Floats:
    """The step of Newton's method. It is zero if the matrix of second derivatives is singular in doubles."""
    try:
        step = np.array(np.linalg.solve(hessian, gradient), np.float64)
    except np.linalg.LinAlgError:
        return np.zeros(len(gradient))
    return step


class Barrier:
    """Constraints in doubles: values, gradients and forms of all constraints at one point."""

    def __init__(self, constraints: list[Constraint]) -> None:
        rows = np.array([constraint.in_doubles() for constraint in constraints])
        self.forms = rows[:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
        self.linear, self.constant = rows[:, 6:9], rows[:, 9]

    def at(self, y: Floats) -> tuple[Floats, Floats]:
        """Values (k,) and halves of gradients (k, 3)."""
        image = self.forms @ y + self.linear
        return (image + self.linear) @ y + self.constant, image

    def centre(self, y: Floats, towards: Floats | None = None) -> tuple[Floats, Floats]:
        """The analytic centre, found from a point inside, and the second derivatives of the barrier there.

        With `towards`, the minimum of towards · y plus the barrier instead of the centre.
        """
        pull = np.zeros(3) if towards is None else towards
        hessian = np.eye(3)
        for _ in range(STEPS):
            values, half = self.at(y)
            room = -values
            gradient = pull + 2 * (half / room[:, None]).sum(axis=0)
            hessian = 2 * np.einsum("kij,k->ij", self.forms, 1 / room)
            hessian += 4 * np.einsum("ki,kj,k->ij", half, half, 1 / room**2)
            step = -newton(hessian, gradient)
            fall = float(np.sqrt(max(-gradient @ step, 0.0)))
            share = 1.0 if fall < 0.25 else 1.0 / (1.0 + fall)
            while share > 1e-9 and not (self.at(y + share * step)[0] < 0).all():
                share /= 2
            y = y + share * step
            if fall < 1e-7 or share <= 1e-9:
                break
        return y, hessian

    def inside(self, y: Floats, radius: float) -> tuple[Floats, Floats, Floats | None]:
        """A point inside all constraints, the second derivatives of the barrier there, and None.

        The search starts at any point `y`. If it finds no point inside, the last value has weights of the constraints.
        `excluded` then bounds the volume by their weighted sum. The barrier has four variables: the point, and a level
        above the values of all constraints. The level falls from step to step. The point stays within 2 `radius` of the
        start.
        """
        scale = np.sqrt((self.linear**2).sum(axis=1)) + np.abs(self.forms).max(axis=(1, 2)) + 1e-300
        start, level = y.copy(), float((self.at(y)[0] / scale).max()) + 1.0
        mu, hessian = 1.0, np.eye(4)
        room = np.ones(len(scale))
        for _ in range(100):
            for _ in range(8):
                values, half = self.at(y)
                if (values < 0).all():
                    return y, hessian[:3, :3], None
                room = level - values / scale
                arm = y - start
                rest = 4 * radius**2 - arm @ arm
                slopes = np.hstack([2 * half / scale[:, None], -np.ones((len(scale), 1))]) / room[:, None]
                gradient = slopes.sum(axis=0)
                gradient[:3] += 2 * arm / rest
                gradient[3] += 1 / mu
                hessian = slopes.T @ slopes
                hessian[:3, :3] += 2 * np.einsum("kij,k->ij", self.forms, 1 / (room * scale))
                hessian[:3, :3] += 2 * np.eye(3) / rest + 4 * np.outer(arm, arm) / rest**2
                step = -newton(hessian, gradient)
                fall = float(np.sqrt(max(-gradient @ step, 0.0)))
                share = 1.0 if fall < 0.25 else 1.0 / (1.0 + fall)
                while share > 1e-9 and not self._is_in(y, level, share * step, scale, start, radius):
                    share /= 2
                y, level = y + share * step[:3], level + share * step[3]
                if fall < 0.25:
                    break
            if level > (len(scale) + 2) * mu or mu < 1e-13:
                break
            mu /= 4
        return y, hessian[:3, :3], 1 / (room * scale)

    def _is_in(self, y: Floats, level: float, step: Floats, scale: Floats, start: Floats, radius: float) -> bool:
        y, level = y + step[:3], level + step[3]
        arm = y - start
        return bool((level - self.at(y)[0] / scale > 0).all() and arm @ arm < 4 * radius**2)


@dataclass(frozen=True)
class RoundFrame:
    """Constraints on y, where x = origin + y₀ columns[0] + ..., and the volume of a unit cube of y."""

    origin: Vector  # strictly inside
    constraints: list[Constraint]
    unit: fmpq


# A rotation without special angles, so that planes of users are unlikely to be parallel to slices.
GENERIC = np.linalg.qr(np.array([[0.5377, 0.8622, -0.4336], [1.8339, 0.3188, 0.3426], [-2.2588, -1.3077, 3.5784]]))[0]


def framed(constraints: list[Constraint], around: Floats) -> RoundFrame | arb:
    """The frame in which the common part is round, or bounds of its volume if no point inside all was found."""
    middle, half = around.mean(axis=0), np.ptp(around, axis=0) / 2
    origin, size = vector(middle.tolist()), float(half.max())
    columns = exact_columns(np.eye(3) * size)
    least = arb(0).union(arb(8) * arb(rational(size)) ** 3)
    # Weights of constraints exclude a set only if together they bound it.
    bounded = [*constraints, constraint(Ball(origin, 4 * rational(size) ** 2))]
    for _ in range(FRAMES):
        local = [each.within(origin, columns) for each in bounded]
        barrier = Barrier(local)
        y = np.zeros(3)
        weights: Floats | None = None
        if all(each.constant < 0 for each in local):
            y, hessian = barrier.centre(y)
        else:
            y, hessian, weights = barrier.inside(y, 2.0)
            if weights is None:
                y, hessian = barrier.centre(y)
            else:
                bound = excluded(local, weights) * arb(abs(volume(columns)))
                least = bound if bound.upper() < least.upper() else least
                if least.upper() <= arb(rational(size)) ** 3 * arb(2) ** -220:
                    return least
        values, vectors = np.linalg.eigh(hessian)
        turn = vectors / np.sqrt(np.maximum(values, FLAT * values.max()))
        is_round = weights is None and np.abs(y).max() < 0.5 and values.max() < 8 and values.min() > 1 / 8
        if is_round and all(each.constant < 0 for each in local):
            columns = product(columns, turn @ GENERIC)
            final = [each.within(origin, columns) for each in constraints]
            return RoundFrame(origin, final, abs(volume(columns)))
        for k, share in enumerate(y):
            origin = plus(origin, columns[k], rational(float(share)))
        columns = product(columns, turn)
    return least


def excluded(local: list[Constraint], weights: Floats) -> arb:
    """A bound of the volume of the set where a weighted sum of the constraints is not positive."""
    form = [[fmpq(0)] * 3 for _ in range(3)]
    linear, constant = [fmpq(0)] * 3, fmpq(0)
    for constraint, weight in zip(local, weights / weights.max()):
        numbers = constraint.form, constraint.linear, constraint.constant
        size = max(abs(x) for x in (*numbers[0][0], *numbers[0][1], *numbers[0][2], *numbers[1], numbers[2]))
        share = rational(float(weight)) / size
        for i in range(3):
            linear[i] += share * constraint.linear[i]
            for j in range(3):
                form[i][j] += share * constraint.form[i][j]
        constant += share * constraint.constant
    rows: Matrix = vector_of(form[0]), vector_of(form[1]), vector_of(form[2])
    minor = rows[0][0] * rows[1][1] - rows[0][1] * rows[1][0]
    det = determinant(rows)
    if not (rows[0][0] > 0 and minor > 0 and det > 0):
        return arb("inf")
    lowest = constant - dot(vector_of(linear), solved(rows, vector_of(linear)))
    if lowest > 0:
        return arb(0)
    return arb(0).union(arb(4) / 3 * arb.pi() * arb(-lowest) ** (arb(3) / 2) / arb(det).sqrt())


def vector_of(numbers: list[fmpq]) -> Vector:
    return numbers[0], numbers[1], numbers[2]


def determinant(rows: Matrix) -> fmpq:
    a, b, c = rows
    x, y, z = (b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0])
    return a[0] * x + a[1] * y + a[2] * z


def solved(rows: Matrix, right: Vector) -> Vector:
    """x with x₀ rows[0] + x₁ rows[1] + x₂ rows[2] = right, by Cramer's rule."""
    found, det = [], determinant(rows)
    for k in range(3):
        replaced = [right if i == k else rows[i] for i in range(3)]
        found.append(determinant((replaced[0], replaced[1], replaced[2])) / det)
    return vector_of(found)


def exact_columns(matrix: Floats) -> Matrix:
    a, b, c = (vector(column.tolist()) for column in matrix.T)
    return a, b, c


def product(columns: Matrix, right: Floats) -> Matrix:
    found = []
    for column in right.T:
        total: Vector = (fmpq(0), fmpq(0), fmpq(0))
        for part, share in zip(columns, column):
            total = plus(total, part, rational(float(share)))
        found.append(short(total))
    return found[0], found[1], found[2]


def short(numbers: Vector) -> Vector:
    """The numbers rounded to some digits, so that fractions stay short. Any frame is valid."""
    return vector([double(x) for x in numbers])


def volume(columns: Matrix) -> fmpq:
    return determinant(columns)
