"""Methods of `Facts` that several kinds of shapes share. A kind of shape inherits the classes that apply to it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from overlapper.rational import Exact
from overlapper.shapes.facts import Floats
from overlapper.shapes.planes import Planes


class Flat(ABC):
    """A shape that is the intersection of the half-spaces below its planes."""

    isotropic = False
    has_blocks = True
    has_exits = True
    rounding = 0.0
    half_axes = None

    @property
    @abstractmethod
    def planes(self) -> Planes: ...

    def holds(self, points: Exact, scale: int, margin: Fraction | int) -> NDArray[np.bool_]:
        return self.planes.hold(points, scale, margin)

    def tightest(self, point: Exact) -> Exact:
        return self.planes.tightest(point)

    def exits(self, start: Exact, arms: Exact, scale: int, fine: int) -> Exact:
        return self.planes.exits(start, arms, scale, fine)


class Round:
    """A bounded shape with a curved side. `side` does not report its flat sides, if it has any."""

    bounded = True
    planes = None

    def side(self, towards: Floats) -> None:
        return None
