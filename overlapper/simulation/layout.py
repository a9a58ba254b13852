"""The shapes of all bodies side by side, for one pass of arithmetic per step."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from overlapper import Batch, Shape, Sphere, _core
from overlapper.simulation.bullet.collider_poses import ColliderPoses
from overlapper.simulation.model import BASE, Array, Body


class Layout:
    """What is modelled of `bodies`, parallel to `keys`, which are (body, link, shape), sorted.

    `key_rows` (k, 3) are the same as an array, `shapes` and `batch` the shapes, `owners` (k,) their bodies, `colliders`
    (k,) the places of their links in `collider_rows`, by (body, link). `of_several_colliders` are the bodies that have
    shapes on more than their base. `positions` (k, 3) and `orientations` (k, 4) are where `pose` found them.
    """

    def __init__(self, client: int, bodies: Mapping[int, Body], hidden: Mapping[int, int]) -> None:
        """`hidden` are the places in a .bullet file of those whose poses have no other source."""
        shaped = {id: body.parts for id, body in bodies.items() if body.parts or body.ground}
        parts = [part for each in shaped.values() for part in each]
        self.keys = [(id, part.link, part.index) for id, each in shaped.items() for part in each]
        self.key_rows = np.array(self.keys, dtype=np.int64).reshape(-1, 3)
        self.shapes = [part.shape for part in parts]
        self.batch = Batch(self.shapes)
        self._local_positions = np.array([part.position for part in parts]).reshape(-1, 3)
        self._local_orientations = np.array([part.orientation for part in parts]).reshape(-1, 4)
        self.positions: Array = np.full_like(self._local_positions, np.nan)
        self.orientations: Array = np.full_like(self._local_orientations, np.nan)
        links = {id: sorted({part.link for part in each} - {BASE}) for id, each in shaped.items()}
        self.poses = ColliderPoses(client, links, hidden)
        self.collider_rows = {each: row for row, each in enumerate(sorted(self.poses.colliders))}
        self.colliders = np.array([self.collider_rows[id, link] for id, link, _ in self.keys], dtype=int)
        frames = {each: row for row, each in enumerate(self.poses.colliders)}
        self._frames = np.array([frames[id, link] for id, link, _ in self.keys], dtype=np.int64)
        self.owners = np.array([id for id, _, _ in self.keys], dtype=int)
        self.of_several_colliders = [id for id, each in links.items() if each]

    def reach(self, rows: NDArray[np.intp]) -> Array:
        """(n,) m: how far the shapes in these rows reach from their own origins; planes reach everywhere."""
        return np.array([_reach(self.shapes[row]) for row in rows])

    def pose(self) -> set[int]:
        """Place the shapes where their colliders are now; the bodies of which one is nowhere."""
        self.poses.read()
        self.positions, self.orientations = _core.world_poses(
            self.poses.frames, self._frames, self._local_positions, self._local_orientations
        )
        if math.isfinite(self.positions.sum() + self.orientations.sum()):
            return set()
        finite = np.isfinite(self.positions).all(axis=1) & np.isfinite(self.orientations).all(axis=1)
        return {*self.owners[~finite].tolist()}


def _reach(shape: Shape) -> float:
    if isinstance(shape, Sphere):
        return shape.radius
    return float(np.linalg.norm(np.abs(shape.bounds).max(axis=0)))
