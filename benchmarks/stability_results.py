"""What an answer to a hard case is worth, and the file that keeps it."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import isfinite, isqrt
from pathlib import Path

import exact
import families
import numpy as np

# A volume further off than this, relative to the true one, is a failure.
ACCURACY = 1e-6

# Fraction of the smaller body's size within which bodies may as well be said to overlap as not to.
MARGIN = Fraction(1, 10**12)

# What stands in the table for a peer that was not asked, and for a right yes or no.
NOT_ASKED, RIGHT = "-", "ok"


@dataclass(frozen=True)
class Question:
    """A case as the peers get it, and what is exactly true of it."""

    case: families.Case
    bodies: tuple[np.ndarray, ...]

    @cached_property
    def solids(self) -> list[exact.Polytope]:
        return [exact.hull(body) for body in self.bodies]

    @cached_property
    def common(self) -> exact.Polytope:
        return exact.common(*self.solids)

    @property
    def volume(self) -> Fraction:
        return self.common.volume

    @cached_property
    def size(self) -> Fraction:
        """The diagonal of the smallest body's box."""
        return Fraction(min(float(np.linalg.norm(np.ptp(body, axis=0))) for body in self.bodies))

    @cached_property
    def clear(self) -> bool:
        """Whether yes or no can be wrong: what is common holds a ball of MARGIN times the size, or the bodies stay
        apart although every face is moved outwards by as much."""
        if self.common.dimension == 3:
            # A convex body of volume V and surface A holds a ball of radius V / A at least.
            return self.volume > MARGIN * self.size * Fraction(self.common.area) or self.shrunk(MARGIN * self.size)
        return self.common.dimension < 0 and not self.shrunk(-MARGIN * self.size)

    def shrunk(self, by: Fraction) -> bool:
        """Whether anything is left in common once every face has been moved inwards."""
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


def failed(cell: str) -> bool:
    return cell not in (RIGHT, NOT_ASKED) and not error_of(cell) <= ACCURACY


def error_of(cell: str) -> float:
    """The relative error of a volume; 1 where it is lost, nan where there is none."""
    try:
        return 1.0 if cell == "missed" else float(cell)
    except ValueError:
        return float("nan")


def read(path: Path) -> tuple[list[str], list[dict[str, str]]]:
    """The comments and the rows of a results file."""
    with path.open(newline="", encoding="utf-8") as file:
        lines = file.readlines()
    notes = [line[2:].strip() for line in lines if line.startswith("# ")]
    return notes, list(csv.DictReader(line for line in lines if not line.startswith("# ")))
