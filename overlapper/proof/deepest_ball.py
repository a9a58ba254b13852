"""The largest ball in the common part of bodies, and the planes that prove it, in rational arithmetic."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction

import numpy as np

from overlapper.proof.claims import CertificateError, OwnedPlane, support_above
from overlapper.proof.rational_body import RationalBody
from overlapper.rational import Exact

# The most rounds: on round bodies Kelley's method never ends by itself.
ROUNDS = 200


def room(planes: Sequence[OwnedPlane]) -> Fraction:
    return sum((plane.offset for plane in planes), Fraction(0))


def supporting(bodies: Sequence[RationalBody], normal: Exact, owner: int) -> OwnedPlane:
    """The plane with the given normal, of any length, that body number `owner` touches from below."""
    return OwnedPlane(normal, support_above(bodies[owner], normal), owner)


class DeepestBall:
    """The largest ball in the common part, by cutting planes in rational arithmetic (see methods/dual/deepest_ball.h).

    The linear programme is: the largest r with normal . x + length r <= offset for all supporting planes. Here `length`
    is the length of the normal up to rounding. The dual weights four planes so that weighted normals add up to zero.
    """

    def __init__(self, bodies: list[RationalBody], hints: Sequence[OwnedPlane] = ()) -> None:
        self.bodies = bodies
        self.basis = self._simplex()
        self.weights = self._solve(np.array([self._row(plane) for plane in self.basis]).T, [0, 0, 0, 1])
        for plane in hints:
            self.exchange(plane)

    def without_common_point(self) -> list[OwnedPlane]:
        """Weighted planes whose normals add up to zero, and whose offsets add up to less than zero."""
        for _ in range(ROUNDS):
            planes = self.weighted()
            if room(planes) < 0:
                break
            centre, radius = self.ball()
            if not self.exchange(self.tightest(centre, radius)):
                break
        if room(planes) >= 0 or any(plane.owner < 0 for plane in planes):
            raise CertificateError("no planes were found that prove the bodies apart: they may have a common point")
        return planes

    def settled(self) -> tuple[list[OwnedPlane], Exact]:
        """Weighted planes that leave the least room, and the centre of the largest ball between them."""
        for _ in range(ROUNDS):
            centre, radius = self.ball()
            if not self.exchange(self.tightest(centre, radius)):
                break
        planes = self.weighted()
        if any(plane.owner < 0 for plane in planes):
            raise CertificateError("no planes were found between which the common part is closed")
        return planes, centre

    def weighted(self) -> list[OwnedPlane]:
        return [OwnedPlane(w * p.normal, w * p.offset, p.owner) for w, p in zip(self.weights, self.basis) if w > 0]

    def ball(self) -> tuple[Exact, Fraction]:
        rows = np.array([self._row(plane) for plane in self.basis])
        *centre, radius = self._solve(rows, [plane.offset for plane in self.basis])
        return np.array(centre), radius

    def tightest(self, centre: Exact, radius: Fraction) -> OwnedPlane | None:
        """The plane beyond which the ball reaches farthest; None if the ball is inside all bodies."""
        found, farthest = None, Fraction(0)
        for owner, body in enumerate(self.bodies):
            plane = supporting(self.bodies, body.tightest(centre), owner)
            length = self._row(plane)[3]
            outside = (plane.normal @ centre + length * radius - plane.offset) / length
            if outside > farthest:
                found, farthest = plane, outside
        return found

    def exchange(self, entering: OwnedPlane | None) -> bool:
        """Puts a plane into the basis. It replaces the plane whose removal keeps all weights from becoming negative."""
        if entering is None:
            return False
        share = self._solve(np.array([self._row(plane) for plane in self.basis]).T, self._row(entering))
        ratios = [(weight / s, i) for i, (weight, s) in enumerate(zip(self.weights, share)) if s > 0]
        if not ratios:
            return False
        ratio, leaving = min(ratios)
        self.weights = self.weights - ratio * share
        self.weights[leaving] = ratio
        self.basis[leaving] = entering
        return True

    @staticmethod
    def _row(plane: OwnedPlane) -> Exact:
        return np.array([*plane.normal, Fraction(math.sqrt(plane.normal @ plane.normal))])

    def _simplex(self) -> list[OwnedPlane]:
        """Four planes around one of the bodies; if no body is bounded, around everything, and owned by no body."""
        directions = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) * Fraction(1)
        for owner, body in enumerate(self.bodies):
            if body.facts.bounded:
                return [supporting(self.bodies, direction, owner) for direction in directions]
        planes = [body.facts.planes for body in self.bodies if body.facts.planes]
        reach = max(map(abs, np.hstack([*(body.position for body in self.bodies), *(each.levels for each in planes)])))
        return [OwnedPlane(direction, Fraction(2**20 * (1 + reach)), -1) for direction in directions]

    @staticmethod
    def _solve(matrix: Exact, right: Iterable[Fraction | int]) -> Exact:
        """Solves linear equations by Gaussian elimination."""
        rows: Exact = np.column_stack([matrix, np.array([*right], object)]) * Fraction(1)
        size = len(rows)
        for k in range(size):
            pivot = k + int(np.argmax(rows[k:, k] != 0))
            rows[[k, pivot]] = rows[[pivot, k]]
            rows[k] = rows[k] / rows[k, k]
            others = np.arange(size) != k
            rows[others] = rows[others] - rows[others, k, None] * rows[k]
        return rows[:, -1]
