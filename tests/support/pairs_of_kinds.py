"""Overlapping pairs of every two kinds of shapes, as functions of their numbers and of a small motion."""

from itertools import combinations_with_replacement

import numpy as np
from scipy.spatial.transform import Rotation

from overlapper import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Placed,
    RoundedHull,
    Sphere,
    overlap,
    random_polytope,
)

CORNERS = random_polytope(10, rng=5).vertices * 0.6
CORE = random_polytope(7, rng=6).vertices * 0.4

#: By kind: makes the shape, and its numbers.
KINDS = {
    "sphere": (Sphere, (0.6,)),
    "capsule": (Capsule, (0.4, 0.7)),
    "cylinder": (Cylinder, (0.5, 0.9)),
    "ellipsoid": (lambda *half: Ellipsoid(half), (0.7, 0.4, 0.5)),
    "box": (lambda *half: Box(half), (0.5, 0.4, 0.6)),
    "half-space": (lambda offset: HalfSpace((0.6, 0, 0.8), offset), (0.1,)),
    "hull": (lambda *points: Hull(np.reshape(points, (-1, 3))), tuple(CORNERS.ravel())),
    "rounded hull": (lambda radius: RoundedHull(CORE, radius), (0.25,)),
}
PAIRS = [pair for pair in combinations_with_replacement(KINDS, 2) if pair != ("half-space", "half-space")]


class PairOfKinds:
    """Two shapes in poses by chance. The numbers of a body are its shape's, a translation, and a rotation vector."""

    def __init__(self, kinds, seed=0):
        rng = np.random.default_rng(seed)
        self.kinds = kinds
        self.poses = [(0.25 * rng.normal(size=3), rng.normal(size=4)) for _ in kinds]
        self.numbers = [np.r_[KINDS[kind][1], np.zeros(6)] for kind in kinds]

    def bodies(self, numbers=None):
        """The placed shapes; without motion if no numbers are given."""
        bodies = []
        for kind, (position, turn), row in zip(self.kinds, self.poses, self.numbers if numbers is None else numbers):
            turned = Rotation.from_rotvec(row[-3:]) * Rotation.from_quat(turn)
            bodies.append(Placed(KINDS[kind][0](*row[:-6]), position + row[-6:-3], turned.as_quat()))
        return bodies

    def overlap(self, numbers):
        return overlap(*self.bodies(numbers), tolerance=1e-9)

    def gradient(self):
        """The derivatives by the numbers of each body, without motion."""
        found, rows = self.overlap(self.numbers), []
        for body, kind in enumerate(self.kinds):
            count = len(KINDS[kind][1])
            by_shape = found.shape_gradient[body, :count]
            if kind == "hull":
                turn = Rotation.from_quat(self.poses[body][1]).inv()
                by_shape = turn.apply(found.vertex_gradients[body]).ravel()
            rows.append(np.r_[by_shape, found.gradient[body]])
        return rows
