"""A cover of joint positions by boxes, checked without the core: no hole, and room between two shapes in each box.

The search for a cover bounds the room by `overlapper.proof.chain`. The check does not use this bound. It has a bound of
its own, `overlapper.proof.interval_chain`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from overlapper.proof.chain import Array, Chain, centres
from overlapper.proof.interval_chain import IntervalChain
from overlapper.proof.refusal import CertificateError

PROVED, OPEN = -1, -2  # boxes that are not halved


def halves(lower: Array, upper: Array, level: NDArray[np.int8]) -> tuple[Array, Array]:
    """The halves of the boxes of a level, lower half first. Both end at the same double, so there is no hole."""
    rows = np.flatnonzero(level >= 0)
    columns = level[rows].astype(int)
    low, high = np.repeat(lower[rows], 2, 0), np.repeat(upper[rows], 2, 0)
    places = 2 * np.arange(len(rows))
    middle = centres(lower[rows, columns], upper[rows, columns])
    high[places, columns] = middle
    low[places + 1, columns] = middle
    return low, high


def open_share(lower: Array, upper: Array, level: NDArray[np.int8], whole: Array) -> float:
    """The share of the whole range that the open boxes of a level take. A range of width 0 counts as 1."""
    widths = np.where(whole > 0, (upper - lower) / np.where(whole > 0, whole, 1.0), 1.0)
    return float(widths[level == OPEN].prod(1).sum())


def check(chain: Chain, lower: Array, upper: Array, splits: NDArray[np.int8], axes: NDArray[np.float32]) -> float:
    """The share of the joint positions from `lower` to `upper` (m,) that a cover leaves open; 0 is a proof of "never".

    `splits` is a tree of boxes, level by level: the place of the column across which a box is halved, -1 for a proved
    box, -2 for an open one. `axes` (n, 3) are the axes of the proved boxes in their order.

    Raises
    ------
    CertificateError
        If the tree does not fit the joints between the shapes, if boxes or axes are missing or left over, or if the
        room along an axis is too small for what moves within its box.
    """
    low, high, whole, intervals = lower[None], upper[None], upper - lower, IntervalChain(chain)
    share, begin, used = 0.0, 0, 0
    if splits.ndim != 1 or axes.ndim != 2 or axes.shape[1] != 3:
        raise CertificateError("the cover is not a tree of boxes with an axis for each proved box")
    while len(low):
        level = splits[begin : begin + len(low)]
        begin += len(low)
        if len(level) < len(low):
            raise CertificateError("the cover has a hole: boxes are missing")
        if level.min() < OPEN or level.max() >= len(whole):
            raise CertificateError("the cover halves a box across a joint that is not between the links")
        proved = np.flatnonzero(level == PROVED)
        own = axes[used : used + len(proved)].astype(float)
        used += len(proved)
        if len(own) < len(proved):
            raise CertificateError("the cover has a proved box without an axis")
        if not all(intervals.has_room(low[box], high[box], axis) for box, axis in zip(proved, own)):
            raise CertificateError("the room along the axis of a box is too small for what moves within the box")
        share += open_share(low, high, level, whole)
        low, high = halves(low, high, level)
    if begin != len(splits) or used != len(axes):
        raise CertificateError("the cover has boxes or axes that are left over")
    return share
