"""Bodies as masses and joints, with their shapes that press."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from overlapper import Batch, Overlaps, Shape
from overlapper._core import ContactSolver
from overlapper.quaternion import rotated
from overlapper.simulation.asked_pairs import Among
from overlapper.simulation.bodies import AnyBodies
from overlapper.simulation.forces.parameter import Layers
from overlapper.simulation.layout import FARTHEST, Pose
from overlapper.simulation.mechanics import Mechanics
from overlapper.simulation.model import Array


class Masses:
    """The masses and joints of the bodies that exist.

    They are stale if bodies have come or gone since.
    """

    def __init__(self, bodies: AnyBodies, mechanics: Mechanics, layers: Layers) -> None:
        self._bodies, self._layers = bodies, layers
        self.keys = bodies.keys
        self.dynamics = mechanics.dynamics(sorted({body for body, _, _ in self.keys}))
        self._links = np.array([self.dynamics.place[body, link] for body, link, _ in self.keys], dtype=np.int64)
        self._tops = bodies.tops
        self.sizes = _sizes(bodies.shapes, self._links, self._tops, len(self.dynamics.links))
        self._batch = Batch(bodies.shapes)  # for what is not yet: the one of `bodies` knows what is

    def are_stale(self) -> bool:
        return self.keys is not self._bodies.keys

    def stiffness(self, found: Overlaps) -> Array:
        """(p,) the stiffness of each row in Pa/m."""
        return self._laws(found)["stiffness"]

    def size(self, found: Overlaps) -> Array:
        """(p,) the size of the smaller link of each row, in m: the diameter of a ball of its volume."""
        return np.asarray(self.sizes[self._links[found.pairs]].min(axis=1))

    def areas(self, found: Overlaps) -> Array:
        """(p, 3) the area vectors of the patches, m², from the second to the first, at the poses now.

        A prism of a height field presses with its top alone.
        """
        areas: Array = np.array(found.gradient[:, 1, :3])
        if self._tops is None:
            return areas
        for side, sign in ((0, -1.0), (1, 1.0)):
            tops = self._tops[found.pairs[:, side]]
            rows = np.flatnonzero(tops.any(axis=1))
            turns = self._bodies.orientations[found.pairs[rows, side]]
            up, normals = sign * rotated(turns, np.array([0.0, 0.0, 1.0])), sign * rotated(turns, tops[rows])
            seen = np.maximum((areas[rows] * up).sum(axis=1), 0) / (up * normals).sum(axis=1)
            areas[rows] = seen[:, None] * normals
        return areas

    def place(self, solver: ContactSolver, frames: Sequence[Pose], found: Overlaps) -> tuple[Array, Array]:
        """Give a solver the overlaps of links that have these frames.

        Returns by row the squares of frequencies (rad²/s²) and the stiffness (Pa/m).
        """
        laws = self._laws(found)
        return solver.place(frames, found, self._links, **laws, tops=self._tops), laws["stiffness"]

    def _laws(self, found: Overlaps) -> dict[str, Array]:
        return self._layers.of(self._links[found.pairs], self.dynamics, self.sizes)

    def velocity(self) -> tuple[Array, set[int]]:
        """Return the velocities of all coordinates and the bodies that are lost.

        Velocities that are not finite are 0. The lost bodies are those that such velocities move.
        """
        velocity = self.dynamics.velocity()
        finite = np.abs(velocity) < FARTHEST
        if finite.all():
            return velocity, set()
        bodies = self._bodies
        positions, orientations = self.dynamics.solver.ahead(
            bodies.time_step, velocity, self._links, bodies.positions, bodies.orientations
        )
        known = np.asarray((np.abs(positions) < FARTHEST).all(axis=1) & np.isfinite(orientations).all(axis=1))
        lost = {body for (body, _, _), placed in zip(self.keys, known.tolist()) if not placed}
        return np.where(finite, velocity, 0.0), lost

    def ahead(self, duration: float, velocity: Array, among: Among) -> Overlaps:
        """Return the overlaps after a duration (s) in which all coordinates keep this velocity."""
        bodies = self._bodies
        positions, orientations = self.dynamics.solver.ahead(
            duration, velocity, self._links, bodies.positions, bodies.orientations
        )
        pairs = bodies.pairs_at(positions, orientations, among)
        return self._batch.overlaps(positions, orientations, pairs, separated=False)


def _sizes(shapes: Sequence[Shape], links: NDArray[np.int64], tops: Array | None, count: int) -> Array:
    """(count,) the diameters of balls with the volumes of the links, in m; infinite for planes and height fields."""
    volumes = np.array([shape.volume for shape in shapes], dtype=float)
    if tops is not None:
        volumes[tops.any(axis=1)] = np.inf
    found = np.zeros(count)
    np.add.at(found, links, volumes)
    return np.asarray(np.cbrt(6 / np.pi * found))
