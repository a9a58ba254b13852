"""Proofs that two links never overlap: covers of the joint positions by boxes, each with a separating axis.

A box that has no such axis is halved, across the column that takes most of the gap. The core proposes the axes.
`overlapper.proof.chain` bounds the gaps, with rounding charged, and without the core.
"""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from overlapper import Placed, overlap
from overlapper.audit.audit import Audit
from overlapper.audit.kinematics import Kinematics
from overlapper.audit.pairs import LinkPair
from overlapper.audit.proofs import Cover, Proof, Verdict
from overlapper.audit.robot import Robot, not_modelled
from overlapper.audit.sampling import Sampling
from overlapper.install import hint
from overlapper.jobs.executor import Executor, outcomes
from overlapper.jobs.hand import Failed, Job

try:
    from overlapper.proof.chain import Array, Body, Chain, ChainJoint, centres, outer
    from overlapper.proof.cover import OPEN, PROVED, halves, open_share
except ModuleNotFoundError as error:
    raise ImportError(f"a proof over all configurations needs {hint('python-flint')}") from error

MANY = 1024  # boxes at a time, which bounds the memory
FULL_TURN = np.nextafter(math.pi, 4.0)  # a bound of an endless joint: the double below pi would leave a gap


def chain_between(robot: Robot, a: int, b: int) -> Chain | str:
    """The chain between two shapes of a robot, by their numbers; a sentence why there is none."""
    links, driven = robot.tree.links, Kinematics(robot).driven

    def way(place: int) -> list[int]:
        found = []
        while place >= 0:
            found.append(place)
            place = links[place].parent
        return found[::-1]

    ways = [way(robot.tree.shapes[number].link) for number in (a, b)]
    common = sum(1 for p, q in zip(*ways) if p == q)
    bodies = []
    for number, places in zip((a, b), ways):
        shape = robot.tree.shapes[number]
        points = outer(shape.shape)
        if points is None:
            return "a half-space has no bounds"
        joints = []
        for place in places[common:]:
            joint = links[place].joint
            if joint.kind == "spherical":
                return f"the spherical joint {joint.name} is between the links"
            column, multiplier, shift = driven.get(place, (-1, 0.0, 0.0))
            joints.append(
                ChainJoint(
                    joint.kind, joint.position, joint.orientation, joint.axis, joint.offset, column, multiplier, shift
                )
            )
        bodies.append(Body(*points, shape.position, shape.orientation, tuple(joints)))
    return Chain(*bodies)


def ranges(robot: Robot) -> dict[int, tuple[float, float]]:
    """The range of each column; an endless joint takes a full turn. Spherical joints have none."""
    return {
        each.column: (each.lower, each.upper) if each.range == "limited" else (-FULL_TURN, FULL_TURN)
        for each in robot.degrees
        if each.range != "spherical"
    }


def prove(
    audit: Audit,
    limit: int,
    least_depth: float = 0.0,
    engine: Executor | None = None,
    progress: Callable[[Iterator[Proof], int], Iterable[Proof]] = lambda proofs, count: proofs,
) -> list[Proof]:
    """The answer for each pair of links that is not adjacent, in the order of the audit.

    A pair that overlapped in the audit is "overlaps", with its deepest configuration. At most about `limit` boxes are
    looked at for each of the other pairs. Overlaps of a depth of `least_depth` (m) or less do not
    count. The result does not depend on the engine.
    """
    found: dict[tuple[int, int], Proof] = {}
    asked: list[LinkPair] = []
    for each in audit.pairs:
        if each.pair.adjacent:
            continue
        if each.deepest is None:
            asked.append(each.pair)
        else:
            values = each.deepest.values
            found[each.pair.links] = Proof(each.pair, each.names, "overlaps", 1.0, 0.0, values, "", 0)
    setup = pickle.dumps((audit.robot, limit, least_depth))
    for proof in progress(_proofs(asked, setup, engine), len(asked)):
        found[proof.pair.links] = proof
    return [found[each.pair.links] for each in audit.pairs if not each.pair.adjacent]


def _proofs(asked: Sequence[LinkPair], setup: bytes, engine: Executor | None) -> Iterator[Proof]:
    if engine is None or len(asked) < 2:
        yield from map(prepared(setup), asked)
        return
    job = Job("overlapper.audit.prove", "prepared", setup)
    for number, outcome in outcomes(engine, job, asked):
        if isinstance(outcome, Failed):
            raise RuntimeError(
                f"the proof of links {asked[number].links} failed: {outcome.sentence}\n{outcome.traceback}"
            )
        yield outcome.value


def prepared(setup: bytes) -> Prover:
    """The prover of a setup."""
    return Prover(*pickle.loads(setup))


class Prover:
    """Answers for pairs of links of a robot."""

    def __init__(self, robot: Robot, limit: int, least_depth: float = 0.0) -> None:
        self.robot, self.limit, self.least_depth = robot, limit, least_depth
        self.ranges = ranges(robot)

    def __call__(self, pair: LinkPair) -> Proof:
        robot = self.robot
        names = robot.link_names[pair.links[0]], robot.link_names[pair.links[1]]
        numbers = [[k for k, each in enumerate(robot.tree.shapes) if each.link == link] for link in pair.links]
        partial = [f"{name} is not modelled whole" for name in names if name in not_modelled(robot)]
        covers: list[Cover] = []
        share, boxes = 0.0, 0
        least: float = math.inf
        values: Array | None = None
        shapes = list(product(*numbers))
        for place, (a, b) in enumerate(shapes):
            chain = chain_between(robot, a, b)
            if isinstance(chain, str):
                return Proof(pair, names, "open", 1.0, None, None, chain, boxes)
            search = Search(self, chain, (a, b), (self.limit - boxes) // (len(shapes) - place))
            cover, left = search.run()
            boxes += search.boxes
            if search.least < least:
                least, values = search.least, search.values
            if search.overlaps:
                return Proof(pair, names, "overlaps", 1.0, 0.0, search.values, "", boxes)
            covers.append(cover)
            share = max(share, left)
        verdict: Verdict = "open" if share or partial else "never"
        return Proof(pair, names, verdict, share, least, values, "; ".join(partial), boxes, tuple(covers))


class Search:
    """The search for the cover of a pair of shapes. `least` is the least distance seen, `values` its configuration."""

    def __init__(self, prover: Prover, chain: Chain, shapes: tuple[int, int], limit: int) -> None:
        self.prover, self.chain, self.shapes, self.limit = prover, chain, shapes, limit
        self.boxes, self.least, self.overlaps = 0, math.inf, False
        self.values: Array | None = None
        placed = [prover.robot.tree.shapes[number].shape for number in shapes]
        self._a, self._b = placed

    def run(self) -> tuple[Cover, float]:
        """The cover, and the share of the first box that is left open."""
        columns = self.chain.columns
        lower = np.array([[self.prover.ranges[column][0] for column in columns]])
        upper = np.array([[self.prover.ranges[column][1] for column in columns]])
        whole = (upper - lower)[0]
        splits: list[NDArray[np.int8]] = []
        axes: list[NDArray[np.float32]] = []
        share = 0.0
        while len(lower) and not self.overlaps:
            level = np.full(len(lower), OPEN, dtype=np.int8)
            for start in range(0, len(lower), MANY):
                part = slice(start, start + MANY)
                found = self._axes(lower[part], upper[part])
                if self.overlaps:
                    break
                margins, shares = self.chain.margins(lower[part], upper[part], found.astype(float))
                level[part] = self._halved(lower[part], upper[part], shares)
                level[part][margins > 0] = PROVED
                axes.append(found[margins > 0])
            self.boxes += len(lower)
            more = np.flatnonzero(level >= 0)
            if self.boxes + 2 * len(more) > self.limit:
                level[more] = OPEN
            share += open_share(lower, upper, level, whole)
            splits.append(level)
            lower, upper = halves(lower, upper, level)
        made = np.concatenate([np.empty((0, 3), np.float32), *axes])
        return Cover(self.shapes, np.concatenate(splits) if splits else np.empty(0, np.int8), made), share

    def _axes(self, lower: Array, upper: Array) -> NDArray[np.float32]:
        """The axes along which the shapes are separated at the centres of boxes; 0 where they touch or overlap."""
        middle = centres(lower, upper)
        frames = self.chain.placed(middle)
        poses = [matrices(each.turn.middle, each.position.middle) for each in frames]
        found = np.zeros((len(lower), 3), dtype=np.float32)
        for k, (pose_a, pose_b) in enumerate(zip(*poses)):
            met = overlap(Placed(self._a, pose_a), Placed(self._b, pose_b))
            distance = float(met.distance or 0.0)
            if distance < self.least:
                self.least, self.values = distance, self._configuration(middle[k])
            if met.status == "separated":
                found[k] = met.normal
            elif met.status == "overlapping" and float(met.depth or 0.0) > self.prover.least_depth:
                self.overlaps, self.values = True, self._configuration(middle[k])
                break
        return found

    def _halved(self, lower: Array, upper: Array, shares: Array) -> NDArray[np.int8]:
        """The place of the column across which each box is halved; OPEN for a box that doubles cannot halve."""
        middle = centres(lower, upper)
        shares = np.where((lower < middle) & (middle < upper), shares, -1.0)
        if not shares.shape[1]:
            return np.full(len(lower), OPEN, dtype=np.int8)
        return np.where(shares.max(1) >= 0, shares.argmax(1), OPEN).astype(np.int8)

    def _configuration(self, values: Array) -> Array:
        """All columns: those between the links, and the others at rest."""
        whole = rest(self.prover.robot)
        whole[self.chain.columns] = values
        return whole


def rest(robot: Robot) -> Array:
    """The rest pose: joints at 0, or halfway between limits that exclude 0."""
    return np.array(Sampling(robot, 1, 0).configuration(0))


def matrices(turn: Array, position: Array) -> Array:
    found = np.zeros((len(turn), 4, 4))
    found[:, :3, :3], found[:, :3, 3], found[:, 3, 3] = turn, position[:, :, 0], 1.0
    return found
