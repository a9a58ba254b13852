"""Bodies as masses and joints, with their shapes that press."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from overlapper import Batch, Overlaps, Shape
from overlapper._core import ContactSolver
from overlapper.quaternion import rotated
from overlapper.shapes.table import facts
from overlapper.simulation.asked_pairs import Among
from overlapper.simulation.bodies import AnyBodies
from overlapper.simulation.forces.parameter import Layers
from overlapper.simulation.layout import FARTHEST, Pose
from overlapper.simulation.mechanics import Mechanics
from overlapper.simulation.model import Array, LinkKey

# The largest number of lists of pairs whose laws are kept.
REMEMBERED = 8

# A patch is steady in a step in which its surfaces move over each other by less than this share of its depth, and turn
# by less than this angle (rad). Otherwise a box that rests some nanometres deep may lose its contact, and would then
# fall for a whole step.
QUIET, STEADY = 0.1, 2e-2

# When two links meet, they are not deeper in each other than this share of the smaller link's size.
SHALLOW = 5e-3


class _Pairs(NamedTuple):
    """The laws of pairs of shapes by name, and the sizes of the smaller links."""

    laws: dict[str, Array]
    sizes: Array


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
        self._smallest = self.sizes[self.sizes > 0].min(initial=np.inf)
        self._extents = _extents(bodies.shapes, self._links, len(self.dynamics.links))
        self._batch = Batch(bodies.shapes)  # for what is not yet: the one of `bodies` knows what is
        # By the pairs of shapes, as long as the simulator's numbers are the same.
        self._known: dict[bytes, _Pairs] = {}
        self._last: tuple[Overlaps, _Pairs] | None = None
        self._version = -1

    def are_stale(self) -> bool:
        return self.keys is not self._bodies.keys

    @property
    def of_shapes(self) -> NDArray[np.int64]:
        """(k,) the link of each shape, as an index in `dynamics.links`."""
        return self._links

    @property
    def has_tops(self) -> bool:
        """Whether there are prisms of height fields."""
        return self._tops is not None and bool(np.any(self._tops))

    def laws(self, found: Overlaps) -> dict[str, Array]:
        """The laws (p,) of each row by name. See `Layers.of`."""
        return self._of(found).laws

    def stiffness(self, found: Overlaps) -> Array:
        """(p,) the stiffness of each row in Pa/m."""
        return self._of(found).laws["stiffness"]

    def hardening(self, found: Overlaps) -> Array:
        """(p,) the hardening of each row in 1/m."""
        return self._of(found).laws.get("hardening", np.zeros(len(found)))

    def sizes_of(self, found: Overlaps) -> Array:
        """(p,) the size of the smaller link of each row in m: the diameter of a ball of its volume."""
        return self._of(found).sizes

    def flat_links(self) -> set[LinkKey]:
        """The links (body, link) that consist of half-spaces."""
        bounded = {key[:2] for key, shape in zip(self.keys, self._bodies.shapes) if facts(shape).bounded}
        return {key[:2] for key in self.keys} - bounded

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

    def are_steady(self, duration: float, velocity: Array) -> bool:
        """Whether the placed patches move little within a duration (s)."""
        solver = self.dynamics.solver
        travel, _ = solver.travel(duration, velocity)
        return bool((travel[:, 0] <= QUIET * solver.depths).all() and (travel[:, 1] <= STEADY).all())

    def are_deep(self, pairs: NDArray[np.int32], depths: Array) -> bool:
        """Whether one of the pairs (p, 2) of shapes is deeper than `SHALLOW` allows. Its depth in m is in `depths`."""
        return bool((depths > SHALLOW * self.sizes[self._links[pairs]].min(axis=1)).any())

    def ways(self, duration: float, velocity: Array) -> Array:
        """(n,) m: the points of each link move by at most so much within a duration (s)."""
        _, travel = self.dynamics.solver.travel(duration, velocity)
        return np.asarray(travel[:, 0] + self._extents * travel[:, 1])

    def may_meet(self, ways: Array) -> bool:
        """Whether two links may become deeper in each other than `SHALLOW` allows, if links move by `ways` (n,)."""
        return bool(ways.max(initial=0.0) > SHALLOW * self._smallest)

    def are_far(self, pairs: NDArray[np.int32], ways: Array) -> NDArray[np.bool_]:
        """(p,) whether two links of pairs (p, 2) of shapes may move by half of the smaller size in all."""
        links = self._links[pairs]
        return np.asarray(ways[links].sum(axis=1) > self.sizes[links].min(axis=1) / 2)

    def place(self, solver: ContactSolver, frames: Sequence[Pose], found: Overlaps) -> tuple[Array, Array]:
        """Give a solver the overlaps of links that have these frames.

        Returns by row the squares of frequencies (rad²/s²) and the stiffness (Pa/m).
        """
        laws = self._of(found).laws
        return solver.place(frames, found, self._links, **laws, tops=self._tops), laws["stiffness"]

    def _of(self, found: Overlaps) -> _Pairs:
        if self._version != self.dynamics.version or len(self._known) > REMEMBERED:
            self._known, self._version, self._last = {}, self.dynamics.version, None
        if self._last and self._last[0] is found:
            return self._last[1]
        key = found.pairs.tobytes()
        if key not in self._known:
            links = self._links[found.pairs]
            self._known[key] = _Pairs(
                self._layers.of(links, self.dynamics, self.sizes),
                np.asarray(self.sizes[links].min(axis=1)),
            )
        self._last = found, self._known[key]
        return self._known[key]

    def velocity(self) -> tuple[Array, set[int]]:
        """Return the velocities of all coordinates and the bodies that are lost.

        Velocities that are not finite are 0. The lost bodies are those that such velocities move.
        """
        velocity = self.dynamics.velocity()
        if np.abs(velocity).max(initial=0.0) < FARTHEST:
            return velocity, set()
        finite = np.abs(velocity) < FARTHEST
        bodies = self._bodies
        positions, orientations = self.dynamics.solver.ahead(
            bodies.time_step, velocity, self._links, bodies.positions, bodies.orientations
        )
        known = np.asarray((np.abs(positions) < FARTHEST).all(axis=1) & np.isfinite(orientations).all(axis=1))
        lost = {body for (body, _, _), placed in zip(self.keys, known.tolist()) if not placed}
        return np.where(finite, velocity, 0.0), lost

    def pairs_ahead(
        self, duration: float, velocity: Array, among: Among
    ) -> tuple[NDArray[np.int32], tuple[Array, Array]]:
        """Return the pairs whose boxes meet after a duration (s), and the poses of the shapes then.

        All coordinates keep this velocity.
        """
        bodies = self._bodies
        positions, orientations = self.dynamics.solver.ahead(
            duration, velocity, self._links, bodies.positions, bodies.orientations
        )
        return bodies.pairs_at(positions, orientations, among), (positions, orientations)

    def overlaps_at(self, pairs: NDArray[np.int32], poses: tuple[Array, Array]) -> Overlaps:
        """Return the overlaps of these pairs at poses that are not those now."""
        return self._batch.overlaps(*poses, pairs, separated=False)


def _sizes(shapes: Sequence[Shape], links: NDArray[np.int64], tops: Array | None, count: int) -> Array:
    """(count,) the diameters of balls with the volumes of the links, in m; infinite for planes and height fields."""
    volumes = np.array([shape.volume for shape in shapes], dtype=float)
    if tops is not None:
        volumes[tops.any(axis=1)] = np.inf
    found = np.zeros(count)
    np.add.at(found, links, volumes)
    return np.asarray(np.cbrt(6 / np.pi * found))


def _extents(shapes: Sequence[Shape], links: NDArray[np.int64], count: int) -> Array:
    """(count,) the lengths of the diagonals of the largest boxes around the links' shapes in m, 0 without a bound."""
    found = np.zeros(count)
    diagonals = np.linalg.norm([np.ptp(shape.bounds, axis=0) for shape in shapes] or np.empty((0, 3)), axis=1)
    np.maximum.at(found, links, np.where(np.isfinite(diagonals), diagonals, 0.0))
    return found
