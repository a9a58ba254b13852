"""A scene at one moment, apart from the simulator: as it was seen, or as it was recorded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from overlapper import Batch, Placed, Shape
from overlapper.polytopes.shape_text import shape_of, text_of
from overlapper.simulation.contacts import Contacts
from overlapper.tables.table import Key, Row, key, placements, poses, rows

if TYPE_CHECKING:
    from overlapper.simulation import Forces, Skipped
    from overlapper.simulation.bodies import AnyBodies


@dataclass(frozen=True, slots=True)
class Still:
    """The shapes of a scene at one moment, apart from the simulator. The fields are those of `simulation.Bodies`.

    With volumetric contact, `forces` are those of the frame.
    """

    keys: list[Key]
    shapes: list[Shape]
    positions: NDArray[np.float64]
    orientations: NDArray[np.float64]
    names: dict[tuple[int, int], str]
    labels: dict[int, str]
    colors: dict[tuple[int, int], tuple[float, float, float, float]]
    forces: Forces | None = None
    skipped: tuple[Skipped, ...] = ()

    @classmethod
    def of(cls, bodies: AnyBodies, forces: Forces | None = None) -> Still:
        """Return the bodies as they are now. The simulation does not change them later."""
        return cls(
            list(bodies.keys),
            list(bodies.shapes),
            bodies.positions.copy(),
            bodies.orientations.copy(),
            bodies.names,
            bodies.labels,
            bodies.colors,
            forces,
            tuple(bodies.skipped),
        )

    @classmethod
    def recorded(cls, recorded: Sequence[Row], shapes: Mapping[Key, Shape]) -> Still:
        """Return the shapes of a step where its rows place them. Names are numbers, and all shapes are grey.

        KeyError of a (body, link, shape) that `shapes` does not have.
        """
        where = {each: pose for (_, each), pose in poses(recorded).items()}
        keys = sorted(where)
        ordered = np.array([where[each] for each in keys]).reshape(-1, 7)
        links = {each[:2] for each in keys}
        return cls(
            keys,
            [shapes[each] for each in keys],
            ordered[:, :3],
            ordered[:, 3:],
            {(body, link): f"body {body}/link {link}" for body, link in links},
            {body: f"body {body}" for body, _ in links},
            dict.fromkeys(links, (0.6, 0.6, 0.6, 1.0)),
        )

    def as_written(self) -> Still:
        """Return a copy with the shapes as they will be read from a file."""
        read = {id(shape): shape_of(text_of(shape)) for shape in self.shapes}
        return replace(self, shapes=[read[id(shape)] for shape in self.shapes])

    def moved(self, by: Sequence[float]) -> Still:
        """Return a copy without forces, moved by a vector in m."""
        return replace(self, positions=self.positions + by, forces=None)

    @property
    def placed(self) -> list[Placed]:
        """The shapes with their poses, parallel to `keys`."""
        return [Placed(*each) for each in zip(self.shapes, self.positions, self.orientations)]

    def rows(self, step: int, tolerance: float) -> list[Row]:
        """Return a row for each pair of shapes that overlap or touch, and a row for each other shape.

        The shapes of a pair are of different bodies.
        """
        pairs = rows(step, 0.0, self, self.contacts(tolerance), forces=self.forces)
        met = {shape for row in pairs for shape in (key(row)[:3], key(row)[3:])}
        return pairs + [row for row in self.placements(step) if key(row)[:3] not in met]

    def placements(self, step: int) -> list[Row]:
        """Return a row for each shape, as if it were alone."""
        return [{"step": step, **row, "status": "alone"} for row in placements(self, "A").values()]

    def contacts(self, tolerance: float) -> Contacts:
        """Return the pairs of shapes of different bodies that overlap or touch."""
        # Pairs of static bodies are in it, too: whether they may be left out is the simulator's business.
        batch, where = Batch(self.shapes), (self.positions, self.orientations)
        keys = np.array(self.keys, dtype=np.int64).reshape(-1, 3)
        bodies, pairs = keys[:, 0], batch.candidate_pairs(*where)
        among = pairs[bodies[pairs[:, 0]] != bodies[pairs[:, 1]]]
        return Contacts(keys, batch.overlaps(*where, among, tolerance, separated=False), self.names)
