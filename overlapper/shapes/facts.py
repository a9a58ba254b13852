"""The properties of a shape that Python needs. Each kind of shape has its own file with them, named in `table`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from overlapper.rational import Exact
from overlapper.shapes.drawing import Tessellation
from overlapper.shapes.planes import Planes

Floats = NDArray[np.float64]
FclModel = tuple[str, tuple[Any, ...]]  # the name of FCL's class, and the arguments; hashable


@dataclass(frozen=True)
class Block:
    """A part of a shape with at most one curved side, in the shape's own frame. All numbers but `radius` are exact.

    With `centre`, the block lies in the ball of `radius` about it. With `axis`, it lies in the cylinder of `radius`
    about this line. The block lies below `planes`, each a normal (3,) and an offset. It lies within `radius` of the
    hull of `spine` (k, 3), which is None if the block is unbounded. Its planes cut off at most the volume `lost`.
    """

    planes: Sequence[tuple[Exact, Fraction]]
    spine: Exact | None
    radius: float = 0.0
    centre: Exact | None = None
    axis: Exact | None = None
    lost: Fraction = Fraction(0)


class Facts(Protocol):
    """The properties of one shape, in the shape's own frame and in SI units."""

    name: str  # for a sentence, with its article
    bounded: bool
    isotropic: bool  # no rotation about the origin changes it
    has_blocks: bool  # it consists of `blocks`, each with at most one ball or cylinder
    has_exits: bool  # `exits` are known exactly
    bullet_margin: bool  # Bullet collides with a margin around it

    def __init__(self, shape: Any) -> None: ...

    def parameters(self) -> list[float | Floats]:
        """The arguments with which its class makes the same shape."""

    def words(self) -> tuple[str, str, int]:
        """Its kind, its dimensions in m, and its number of corners (0 for all but hulls), for an inventory."""

    def tessellation(self) -> Tessellation:
        """Its surface as triangles. TypeError for a shape that is not bounded."""

    def side(self, towards: Floats) -> tuple[Floats, float, Floats] | None:
        """Unit normal, offset and corners (k, 3) of the flat side that best faces a point; None without flat sides.

        The side of a half-space has no corners.
        """

    def ball(self) -> tuple[Floats, float]:
        """Centre (3,) and radius of a ball around the shape; the radius is infinite if the shape is not bounded."""

    def fcl(self) -> FclModel | str:
        """The shape for FCL, or the sentence that says why FCL is not used."""

    def core_tip(self, direction: Floats) -> Floats:
        """A farthest point (3,) of the shape without its `rounding`. TypeError if distances are not known exactly."""

    @property
    def rounding(self) -> float:
        """The radius of a ball that `core_tip` leaves out. The shape is the Minkowski sum of its core and this ball."""

    @property
    def planes(self) -> Planes | None:
        """The planes that bound it, exactly; None if it is round."""

    @property
    def half_axes(self) -> Exact | None:
        """The units of the axes in which the shape is a ball of radius 1; `blocks` use these units. None for 1 m."""

    def support(self, direction: Exact, scale: int) -> tuple[Fraction, Fraction] | None:
        """(flat, square): flat + sqrt(square) is the greatest direction . x / scale; None if there is none."""

    def holds(self, points: Exact, scale: int, margin: Fraction | int) -> NDArray[np.bool_]:
        """Whether the shape holds the ball of radius `margin` about each of points (n, 3) / scale; points are integers.

        True is proved. False may be returned for a ball that just fits.
        """

    def tightest(self, point: Exact) -> Exact:
        """The normal, of any length, of the plane of the shape above which a point is highest."""

    def exits(self, start: Exact, arms: Exact, scale: int, fine: int) -> Exact:
        """The shares of arms (n, 3) at which rays from `start` leave the shape, in units of 2^-fine, rounded down.

        `start`, a point inside, and `arms` are integers over `scale`. TypeError without `has_exits`.
        """

    def blocks(self) -> list[Block]:
        """The blocks that make up the shape. TypeError without `has_blocks`; ValueError for an inexact hull."""
