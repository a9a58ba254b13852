"""The answer of a proof for a pair of links, with the covers that prove it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from overlapper.audit.pairs import LinkPair
from overlapper.audit.tally import Array

Verdict = Literal["never", "overlaps", "open"]


@dataclass(frozen=True, slots=True)
class Cover:
    """The boxes of joint positions between two shapes, by their numbers, as a tree.

    The first box is the whole range of the columns. `splits` has for each box, level by level, the place among the
    columns across which the box is halved. The halves stand in the next level, the lower half first. -1 marks a box
    that is proved, -2 one that is open. `axes` (n, 3) are the axes of the proved boxes in their order, single
    precision.
    """

    shapes: tuple[int, int]
    splits: NDArray[np.int8]
    axes: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Proof:
    """The answer for a pair of links, by their `names`.

    `verdict` is "never" if all boxes are proved, "overlaps" if a configuration is known in which the pair overlaps,
    else "open". `open_share` is the share of the joint positions that is left, of the pair of shapes with the largest
    share. `least` is the least distance seen in m, `values` (m,) the configuration, both None if none was looked at.
    `why` says why the pair was not looked at, "" if it was. `boxes` counts the boxes that were looked at.
    """

    pair: LinkPair
    names: tuple[str, str]
    verdict: Verdict
    open_share: float
    least: float | None
    values: Array | None
    why: str
    boxes: int
    covers: tuple[Cover, ...] = field(default=(), repr=False)
