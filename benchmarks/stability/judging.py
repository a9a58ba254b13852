"""Verdicts on the answers to hard cases."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import isfinite, isqrt

import exact
import exact_distance
import families
import numpy as np

from harness.peers import NO_ANSWER, NO_DISTANCE, NOT_ASKED
from overlapper import Placed

# A volume, depth or distance further off than this, relative to the true one, is a failure.
ACCURACY = 1e-6

# Fraction of the smaller body's size within which bodies may as well be said to overlap as not to.
MARGIN = Fraction(1, 10**12)

# In tables: a right yes or no.
RIGHT = "ok"


@dataclass(frozen=True)
class Question:
    """A case as the peers get it, and what is exactly true of it."""

    case: families.Case
    bodies: tuple[np.ndarray | Placed, ...]

    @property
    def round(self) -> bool:
        """True if a body has no vertices. Then only the signed distance is asked for."""
        return any(isinstance(body, Placed) for body in self.bodies)

    @cached_property
    def solids(self) -> list[exact.Polytope | Placed]:
        return [body if isinstance(body, Placed) else exact.hull(body) for body in self.bodies]

    @cached_property
    def common(self) -> exact.Polytope:
        return exact.common(*self.solids)

    @property
    def volume(self) -> Fraction:
        return self.common.volume

    @cached_property
    def size(self) -> Fraction:
        """The diagonal of the smallest body's box."""
        boxes = (body.bounds if isinstance(body, Placed) else body for body in self.bodies)
        return Fraction(min(float(np.linalg.norm(np.ptp(box, axis=0))) for box in boxes))

    @cached_property
    def signed_distance(self) -> Fraction | None:
        """The distance of a pair; minus its depth if it overlaps. None for more bodies and for cylinders at an edge."""
        return exact_distance.signed_distance(*self.solids) if len(self.bodies) == 2 else None

    @cached_property
    def clear(self) -> bool:
        """True if yes or no can be wrong. Then the common set holds a ball of MARGIN times the size, or the bodies
        stay apart although every face is moved outwards by as much."""
        if self.common.dimension == 3:
            # A convex body of volume V and surface A holds a ball of radius V / A at least.
            return self.volume > MARGIN * self.size * Fraction(self.common.area) or self.shrunk(MARGIN * self.size)
        return self.common.dimension < 0 and not self.shrunk(-MARGIN * self.size)

    def shrunk(self, by: Fraction) -> bool:
        """True if the bodies have anything in common after every face has been moved inwards."""
        reach = 4 * int(max(float(np.abs(body).max()) for body in self.bodies) + 1)
        part = exact.hull([[x, y, z] for x in (-reach, reach) for y in (-reach, reach) for z in (-reach, reach)])
        for a, b, c, d in (plane for solid in self.solids for plane in solid.planes):
            length = isqrt(a * a + b * b + c * c) + 1
            moved = [x * by.denominator for x in (a, b, c, d)]
            moved[3] += length * by.numerator
            part = exact.clipped(part, exact.primitive(moved), 1)
        return part.dimension >= 0


def verdict(question: Question, answer: float | bool | str) -> str:
    """`ok`, or the relative error of the volume, or how the peer failed. `failed` tells them apart."""
    if isinstance(answer, str):
        return answer
    if isinstance(answer, bool):
        solid = question.common.dimension == 3
        return RIGHT if answer == solid or not question.clear else "missed" if solid else "phantom"
    if not isfinite(answer):
        return "not finite"
    off = abs(Fraction(answer) - question.volume)
    if question.clear and question.common.dimension == 3:
        return "missed" if answer == 0 else f"{float(off / question.volume):.1e}"
    if question.clear:
        return RIGHT if answer == 0 else "phantom"
    # As much as a sheet of that thickness and of the smaller body's size.
    return RIGHT if off <= 2 * MARGIN * question.size**3 else "phantom"


def distance_column(peer: str) -> str:
    return f"{peer}: signed distance"


def distance_verdict(question: Question, answer: float | str) -> str:
    """The same of a signed distance. Bodies that are less than MARGIN of their size deep or apart touch."""
    if isinstance(answer, str):
        return answer
    if not isfinite(answer) or abs(answer) > NO_DISTANCE:
        return NO_ANSWER
    truth, band = question.signed_distance, MARGIN * question.size
    assert truth is not None
    off = abs(Fraction(answer) - truth)
    if abs(truth) <= band:
        return RIGHT if off <= 2 * band else "missed" if answer > 0 else "phantom"
    if truth * Fraction(answer) <= 0:
        return "missed" if truth < 0 else "phantom"
    return f"{float(off / abs(truth)):.1e}"


def failed(cell: str) -> bool:
    return cell not in (RIGHT, NOT_ASKED) and not error_of(cell) <= ACCURACY


def error_of(cell: str) -> float:
    """The relative error of a volume; 1 where it is lost, nan where no error is given."""
    try:
        return 1.0 if cell == "missed" else float(cell)
    except ValueError:
        return float("nan")
