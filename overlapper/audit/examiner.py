"""Finds which links overlap in a block of configurations. Blocks are spread over processes."""

from __future__ import annotations

import itertools
import pickle

import numpy as np
from numpy.typing import NDArray

from overlapper import Batch, Overlaps
from overlapper.audit.kinematics import Kinematics
from overlapper.audit.pairs import LinkPair, link_pairs
from overlapper.audit.robot import Robot
from overlapper.audit.sampling import Sampling
from overlapper.audit.tally import Array, Counts, ShapeOverlaps, Tally
from overlapper.quaternion import rotated
from overlapper.shapes.table import facts

Mask = NDArray[np.bool_]

AT_ONCE = 16_384  # shapes that are placed at once: few enough to stay in the processor's caches
COMPARED = 1_000_000  # distances between balls that are computed at once, for the same reason

WITH_ADJACENT = 512  # random configurations in which adjacent links are tested
SLACK = 1e-12  # of the largest coordinate: thousands of units in the last place; kinematics lose only a few


class Examiner:
    """Tests blocks of configurations, and keeps one `Batch` from block to block.

    Adjacent links overlap by design in most robots, and their overlap depends only on the joints between them. They are
    tested at rest, at the corners and in the first 512 random configurations. Pairs that no joint moves are tested only
    at rest. Overlaps with a depth of `least_depth` (m) or less do not count. `pairs` are the pairs of links to test:
    all, if it is None.
    """

    def __init__(
        self,
        robot: Robot,
        sampling: Sampling,
        tolerance: float = 1e-3,
        least_depth: float = 0.0,
        pairs: list[LinkPair] | None = None,
    ) -> None:
        self.robot, self.sampling = robot, sampling
        self.tolerance, self.least_depth = tolerance, least_depth
        self.kinematics = Kinematics(robot)
        self.pairs = link_pairs(robot) if pairs is None else pairs
        shapes = [each.shape for each in robot.tree.shapes]
        links = np.array([each.link for each in robot.tree.shapes])
        first, second = np.triu_indices(len(shapes), 1)
        places = {pair.links: k for k, pair in enumerate(self.pairs)}
        pair = np.array([places.get((a, b), -1) for a, b in zip(links[first].tolist(), links[second].tolist())], int)
        self._first, self._second, self._pair = (each[pair >= 0] for each in (first, second, pair))
        balls = [facts(shape).ball() for shape in shapes]
        self._centres = np.array([centre for centre, _ in balls]).reshape(-1, 3)
        self._radii = np.array([radius for _, radius in balls])
        self._copies = max(1, AT_ONCE // max(len(shapes), 1))
        self._batch = Batch(shapes * self._copies)
        self._positions = np.zeros((self._copies, len(shapes), 3))
        self._orientations = np.tile([0.0, 0.0, 0.0, 1.0], (self._copies, len(shapes), 1))
        self._pair_of = np.full((len(shapes),) * 2, -1)
        self._pair_of[self._first, self._second] = self._pair

    @property
    def setup(self) -> bytes:
        """The argument with which `prepared` makes the same examiner in another process.

        It is bytes because jobs are compared, and == between arrays does not give a single bool.
        """
        sampling = self.sampling.count, self.sampling.seed
        return pickle.dumps((self.robot, sampling, self.tolerance, self.least_depth, self.pairs))

    def shape_pairs(self, *pairs: LinkPair) -> Counts:
        """(s, 2): the pairs of shapes of these pairs of links, as indices of shapes."""
        among = np.isin(self._pair, [self.pairs.index(pair) for pair in pairs])
        return np.stack([self._first[among], self._second[among]], axis=1)

    def __call__(self, block: int) -> Tally:
        """The tally of a block of configurations."""
        numbers, configurations = np.array(self.sampling.blocks[block]), self.sampling.block(block)
        rigid = np.array([pair.rigid for pair in self.pairs], dtype=bool)
        adjacent = np.array([pair.adjacent for pair in self.pairs], dtype=bool)
        tally = self._look(numbers[:1], configurations[:1], rigid) if block == 0 else Tally.none(len(self.pairs))
        alike = int((numbers < self.sampling.first_random + WITH_ADJACENT).sum())
        cuts = sorted({*range(0, len(numbers), self._copies), alike, len(numbers)})
        for start, stop in itertools.pairwise(cuts):
            asked = ~rigid if start < alike else ~rigid & ~adjacent
            tally += self._look(numbers[start:stop], configurations[start:stop], asked)
        return tally

    def _look(self, numbers: Counts, configurations: Array, asked: Mask) -> Tally:
        positions, orientations = self.kinematics.poses(configurations)
        rows, among = self._near(positions, orientations, np.flatnonzero(asked[self._pair]))
        n, k = len(numbers), self.kinematics.count
        # The batch holds `_copies` copies of the shapes. Copies that are not needed now keep their old poses.
        self._positions[:n], self._orientations[:n] = positions, orientations
        found = self._batch.overlaps(
            self._positions.reshape(-1, 3),
            self._orientations.reshape(-1, 4),
            np.stack([rows * k + self._first[among], rows * k + self._second[among]], axis=1),
            self.tolerance,
            separated=False,
        )
        counts = self.counts(found)
        first, second = found.pairs[counts].T
        pairs = self._pair_of[first % k, second % k]
        seen = ShapeOverlaps(pairs, first // k, found.volume[counts], found.depth[counts])
        return seen.tally(asked, numbers, self.sampling.first_random)

    def counts(self, found: Overlaps) -> NDArray[np.bool_]:
        """Which rows count as overlaps."""
        return np.asarray((found.status == Overlaps.OVERLAPPING) & (found.depth > self.least_depth))

    def _near(self, positions: Array, orientations: Array, wanted: Counts) -> tuple[Counts, Counts]:
        """Configurations (m,) and pairs of shapes (m,), among the `wanted` pairs, whose bounding balls meet."""
        centres = positions + rotated(orientations, self._centres)
        slack = SLACK * float(np.abs(centres).max(initial=0.0))
        columns = np.ascontiguousarray(centres.transpose(2, 1, 0))
        rows, among = [], []
        step = max(1, COMPARED // max(len(positions), 1))
        for start in range(0, len(wanted), step):
            pairs = wanted[start : start + step]
            a, b = self._first[pairs], self._second[pairs]
            squares = sum((axis[a] - axis[b]) ** 2 for axis in columns)
            reach = self._radii[a] + self._radii[b] + slack
            pair, row = np.nonzero(squares <= (reach * reach)[:, None])
            rows.append(row)
            among.append(pairs[pair])
        nobody = np.empty(0, dtype=np.int64)
        return np.concatenate([nobody, *rows]), np.concatenate([nobody, *among])


def prepared(setup: bytes) -> Examiner:
    """The examiner of a setup."""
    robot, sampling, tolerance, least_depth, pairs = pickle.loads(setup)
    return Examiner(robot, Sampling(robot, *sampling), tolerance, least_depth, pairs)
