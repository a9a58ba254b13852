"""Bodies as masses and joints, with their shapes that press."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from overlapper import Batch, Overlaps
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
        self._batch = Batch(bodies.shapes)  # for what is not yet: the one of `bodies` knows what is

    def are_stale(self) -> bool:
        return self.keys is not self._bodies.keys

    def stiffness(self, found: Overlaps) -> Array:
        """(p,) the stiffness of each row in Pa/m."""
        return self._layers.of(self._links[found.pairs], self.dynamics)[0]

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
        layers = self._layers.of(self._links[found.pairs], self.dynamics)
        return solver.place(frames, found, self._links, *layers, tops=self._tops), layers[0]

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
