"""Where the time of a step goes: piles of 50 to 5,000 boxes, beside pybullet's own step and its contact points.

    python benchmarks steps                 all piles, some minutes, then the page and its picture
    python benchmarks steps --boxes 200     this pile alone
    python benchmarks steps --page          only the page, from the results there are

In every step pybullet and this package are asked in turn, on one processor, and the time is that of the processor, so
that other processes do not count. Every volume is compared with that of a call for its pair alone: if one bit differs,
the run ends. Writes steps.csv, a line per pile and part, to benchmarks/results/MACHINE, and the page steps.md with
steps.png to docs.
"""

from __future__ import annotations

import math
import random
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pybullet as p
import pybullet_data

from harness import results
from harness.command import Wrong
from harness.timing import Stopwatch, on_one_processor, quartiles, timed
from overlapper import Batch, overlap
from overlapper.simulation import Bodies

RESULTS = results.of_machine("steps.csv")
PAGE = "speed.steps_page"

PILES = (50, 100, 200, 500, 1000, 2000, 5000)
KINDS = ("jenga/jenga.urdf", "block.urdf", "domino/domino.urdf", "cube_small.urdf", "lego/lego.urdf")
LAYERS = 8  # so that piles of any size are as deep, and a box has as many neighbours
SETTLING = 120  # steps until the boxes lie on each other
SAMPLES = (8, 60)  # the fewest and the most of a pile
COLUMNS = ("boxes", "part", "us", "us_low", "us_high", "samples")

# The parts of a step in the order in which they come, and what they are called in the picture.
PARTS = {
    "reading": "poses asked of pybullet",
    "placing": "bodies noticed, shapes placed",
    "culling": "pairs whose boxes meet, and may collide",
    "geometry": "volume, centroid, normal, depth, gradient",
    "hand-over": "arrays handed over",
}
MEASURES = ("volume", "volume_error", "centroid", "normal", "depth", "gradient")


def fill(client: int, boxes: int) -> None:
    """The pile of the scene box_pile, as wide as it takes, between walls."""
    chance = random.Random(boxes)
    p.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=client)
    p.setGravity(0, 0, -9.81, physicsClientId=client)
    p.loadURDF("plane.urdf", physicsClientId=client)
    side = math.ceil(math.sqrt(boxes / LAYERS))
    half = 0.085 * side / 2 + 0.05
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        extents = [0.05 if x else half + 0.1, 0.05 if y else half + 0.1, 0.3]
        wall = p.createCollisionShape(p.GEOM_BOX, halfExtents=extents, physicsClientId=client)
        p.createMultiBody(0, wall, basePosition=[x * (half + 0.05), y * (half + 0.05), 0.3], physicsClientId=client)
    for k in range(boxes):
        layer, row, column = k // side**2, k // side % side - (side - 1) / 2, k % side - (side - 1) / 2
        p.loadURDF(
            chance.choice(KINDS),
            [0.085 * row, 0.085 * column, 0.1 + 0.07 * layer],
            p.getQuaternionFromEuler([chance.uniform(-3, 3) for _ in range(3)]),
            physicsClientId=client,
        )


class Steps:
    """The steps of one pile, and how long each part of them took."""

    def __init__(self, boxes: int) -> None:
        self.boxes = boxes
        self.client = p.connect(p.DIRECT)
        fill(self.client, boxes)
        for _ in range(SETTLING):
            p.stepSimulation(self.client)
        self.bodies = Bodies(self.client)
        self.batches = {kind: Batch(self.bodies.shapes) for kind in ("overlaps", "does not")}
        self.us: dict[str, list[float]] = {}
        self.counts: dict[str, int] = {}

    def take(self) -> None:
        """One step."""
        client, bodies, watch = self.client, self.bodies, Stopwatch()
        watch("stepSimulation", p.stepSimulation, client)
        watch("getContactPoints", p.getContactPoints, physicsClientId=client)
        watch("update", bodies.update)
        pairs = watch("culling", bodies.pairs)
        contacts = watch("overlaps", bodies.overlaps)
        found = contacts.overlaps
        watch("hand-over", lambda: [getattr(found, name) for name in MEASURES])
        # overlaps() finds the pairs once more, when the boxes are laid around the shapes already.
        watch("culling again", bodies.pairs)
        ids = list(range(self.boxes + 5))
        watch("reading", lambda: [p.getBasePositionAndOrientation(id, client) for id in ids])
        us = watch.take()
        geometry = us["overlaps"] - us["culling again"]
        ours = us["update"] + us["culling"] + geometry + us["hand-over"]
        us |= {"placing": us["update"] - us["reading"], "geometry": geometry, "ours": ours}
        us |= self.take_kinds(pairs, found.pairs)
        for part, value in us.items():
            self.us.setdefault(part, []).append(value)
        self.counts = {
            "pairs examined": len(pairs),
            "pairs overlapping": int((found.volume > 0).sum()),
            "pairs widened": int(found.widened.sum()),
        }

    def take_kinds(self, pairs: np.ndarray, overlapping: np.ndarray) -> dict[str, float]:
        """µs for a pair that overlaps, and for a pair that does not. The shapes are placed before."""
        placed, number = self.bodies.placed, np.array([len(self.bodies.placed), 1])
        poses = np.array([body.position for body in placed]), np.array([body.orientation for body in placed])
        apart = pairs[~np.isin(pairs @ number, overlapping @ number)]
        us = {}
        for kind, those in (("overlaps", overlapping), ("does not", apart)):
            batch = self.batches[kind]
            batch.candidate_pairs(*poses)
            took = timed(lambda: batch.overlaps(*poses, those))  # noqa: B023
            if len(those):
                us[f"a pair that {kind}"] = 1e6 * took / len(those)
        return us

    def check(self) -> None:
        """Raises Wrong if a volume is not that of a call for its pair alone."""
        contacts, placed = self.bodies.overlaps(), self.bodies.placed
        for (i, j), volume in zip(contacts.overlaps.pairs.tolist(), contacts.overlaps.volume.tolist()):
            alone = overlap(placed[i], placed[j]).volume
            if alone != volume:
                raise Wrong(f"pile of {self.boxes}: {volume!r} in a step, {alone!r} alone")

    def rows(self) -> Iterator[tuple]:
        for part, values in self.us.items():
            yield self.boxes, part, *(f"{each:.4g}" for each in quartiles(values)), len(values)
        for name, count in self.counts.items():
            yield self.boxes, name, count, "", "", 1


def options(parser: ArgumentParser) -> None:
    parser.add_argument("--boxes", type=int, action="append", help="a pile of so many; may be repeated")


def measure(chosen: Namespace, path: Path) -> None:
    """Writes each pile as soon as it is measured."""
    on_one_processor()
    with results.writing(path, COLUMNS, results.today()) as write:
        for boxes in chosen.boxes or PILES:
            steps = Steps(boxes)
            try:
                # The caches of processor and pairs are warm after the first.
                steps.take()
                steps.us.clear()
                for _ in range(max(SAMPLES[0], min(SAMPLES[1], 20000 // boxes))):
                    steps.take()
                steps.check()
                write(steps.rows())
            finally:
                p.disconnect(steps.client)
            print(f"{boxes:,} boxes: measured", flush=True)
