"""The shapes of all bodies as arrays, for one pass of arithmetic per step."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from overlapper import Batch, Shape, _core
from overlapper.shapes.table import facts
from overlapper.simulation.model import BASE, Array, LinkKey, ModelledBody

FARTHEST = 1e25  # m; the core measures nothing beyond

Pose = Sequence[Sequence[float]]
"""Begins with a position in m and a quaternion xyzw."""

Frames = Sequence[Pose] | Array
"""Poses, or an array (n, 7) with a position and a quaternion xyzw in each row."""


class Poses(Protocol):
    """The frames of the bases and links that shapes are fixed to."""

    @property
    def colliders(self) -> Sequence[LinkKey]:
        """(body, link) of each frame, in the order of `read`."""

    def read(self) -> Frames:
        """The present frames."""


class Layout:
    """The modelled shapes of `bodies`, parallel to `keys`, which are (body, link, shape), sorted.

    `key_rows` (k, 3) are the keys as an array. `shapes` and `batch` are the shapes, and `owners` (k,) are their bodies.
    `colliders` (k,) are the rows of their links in `collider_rows`, which is by (body, link). `of_several_colliders`
    are the bodies with shapes on links other than the base. `positions` (k, 3) and `orientations` (k, 4) are the poses
    of the shapes at the last `pose`. `tops` (k, 3) are those of `ModelledShape`, or None if all faces of all shapes are
    free.
    """

    def __init__(
        self, bodies: Mapping[int, ModelledBody], poses: Callable[[Mapping[int, Sequence[int]]], Poses]
    ) -> None:
        """`poses` makes the reader of the frames of bodies and their links."""
        shaped = {id: body.shapes for id, body in bodies.items() if body.shapes or body.grounds}
        modelled = [each for shapes in shaped.values() for each in shapes]
        self.keys = [(id, each.link, each.index) for id, shapes in shaped.items() for each in shapes]
        self.key_rows = np.array(self.keys, dtype=np.int64).reshape(-1, 3)
        self.shapes = [each.shape for each in modelled]
        self.batch = Batch(self.shapes)
        local_positions = np.array([each.position for each in modelled]).reshape(-1, 3)
        local_orientations = np.array([each.orientation for each in modelled]).reshape(-1, 4)
        tops = np.array([each.top for each in modelled]).reshape(-1, 3)
        self.tops: Array | None = tops if tops.any() else None
        self.positions: Array = np.full_like(local_positions, np.nan)
        self.orientations: Array = np.full_like(local_orientations, np.nan)
        links = {
            id: sorted(({each.link for each in shapes} | {each.link for each in bodies[id].grounds}) - {BASE})
            for id, shapes in shaped.items()
        }
        self.poses = poses(links)
        self._read: Frames = ()
        self.collider_rows = {each: row for row, each in enumerate(sorted(self.poses.colliders))}
        self.colliders = np.array([self.collider_rows[id, link] for id, link, _ in self.keys], dtype=int)
        self._place = {each: row for row, each in enumerate(self.poses.colliders)}
        places = np.array([self._place[id, link] for id, link, _ in self.keys], dtype=np.int64)
        self._fixed = _core.FixedShapes(places, local_positions, local_orientations)
        self.owners = np.array([id for id, _, _ in self.keys], dtype=int)
        self.of_several_colliders = [id for id, each in links.items() if each]

    def frame(self, collider: LinkKey) -> Pose:
        """The frame of a collider at the last `pose`."""
        return self.frames()(collider)

    def frames(self) -> Callable[[LinkKey], Pose]:
        """A function that returns the frame of a collider at the last `pose`, also after later ones."""
        return partial(_frame, self._place, self._read)

    def reach(self, rows: NDArray[np.intp]) -> Array:
        """(n,) how far the shapes in these rows extend from their own origins, m; infinite for planes."""
        return np.array([_reach(self.shapes[row]) for row in rows])

    def placed(self, frames: Frames) -> tuple[Array, Array]:
        """The positions and orientations of the shapes if their colliders have these frames."""
        positions, orientations, _ = self._fixed.world(frames, FARTHEST)
        return positions, orientations

    def pose(self) -> set[int]:
        """Place the shapes by the present poses of their colliders. Returns the bodies with an unusable pose."""
        self._read = self.poses.read()
        self.positions, self.orientations, usable = self._fixed.world(self._read, FARTHEST)
        if usable:
            return set()
        finite = (np.abs(self.positions) < FARTHEST).all(axis=1) & np.isfinite(self.orientations).all(axis=1)
        return {*self.owners[~finite].tolist()}


def _frame(place: Mapping[LinkKey, int], read: Frames, collider: LinkKey) -> Pose:
    frame = read[place[collider]]
    return (frame[:3].tolist(), frame[3:].tolist()) if isinstance(frame, np.ndarray) else frame


def _reach(shape: Shape) -> float:
    corner = np.abs(shape.bounds).max(axis=0)
    return float(corner[0] if facts(shape).isotropic else np.linalg.norm(corner))
