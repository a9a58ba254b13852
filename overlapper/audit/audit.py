"""An audit of a robot: how often each pair of links overlaps, with which volume and depth, and in which poses."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import reduce
from operator import add
from typing import Literal

from overlapper import Batch, Overlaps
from overlapper.audit.examiner import Examiner
from overlapper.audit.pairs import LinkPair
from overlapper.audit.proofs import Proof
from overlapper.audit.robot import Robot, shape_keys
from overlapper.audit.sampling import Sampling
from overlapper.audit.tally import Array, Tally
from overlapper.jobs.executor import Executor, outcomes
from overlapper.jobs.hand import Failed, Job
from overlapper.simulation.contacts import Contacts
from overlapper.simulation.links import LinkContact, link_contacts

Status = Literal["never", "sometimes", "always"]

FEW = 4  # blocks: this process does them in the time that another process takes to start
NORMAL_95 = 1.959963984540054  # 95 % of a normal distribution lie between minus this value and this value


@dataclass(frozen=True, slots=True)
class Pose:
    """A configuration by its number: `values` (m,) in the order of the robot's columns, in rad and m.

    `contact` is the overlap of the two links in this configuration.
    """

    number: int
    values: Array
    contact: LinkContact


@dataclass(frozen=True, slots=True)
class PairAudit:
    """A pair of links, by their `names`, and in how many configurations it overlapped.

    The pair overlapped in `met` of `asked` configurations. `status` is "never", "sometimes" or "always". `fraction` is
    the fraction among random configurations, with the bounds of its 95 % Wilson interval; None without any of these.
    `largest` is the configuration with the largest volume, summed over the pairs of shapes. `deepest` is the
    configuration with the largest depth. `at_rest` is True if the pair overlaps in configuration 0, the rest pose.
    """

    pair: LinkPair
    names: tuple[str, str]
    status: Status
    asked: int
    met: int
    fraction: tuple[float, float, float] | None
    largest: Pose | None
    deepest: Pose | None
    at_rest: bool


@dataclass(frozen=True, slots=True)
class Audit:
    """A robot, its sampled configurations, and the pairs of links that have shapes, in their order.

    `proofs` has the answers of `overlapper.audit.prove.prove`, by the links of a pair, if they were asked for.
    """

    robot: Robot
    sampling: Sampling
    pairs: list[PairAudit]
    proofs: Mapping[tuple[int, int], Proof] = field(default_factory=dict)

    def of_status(self, status: Status, adjacent: bool = False) -> list[PairAudit]:
        return [each for each in self.pairs if each.status == status and each.pair.adjacent == adjacent]


def audit(
    robot: Robot,
    configurations: int = 100_000,
    seed: int = 0,
    tolerance: float = 1e-3,
    least_depth: float = 0.0,
    engine: Executor | None = None,
    progress: Callable[[Iterator[Tally], int], Iterable[Tally]] = lambda blocks, count: blocks,
) -> Audit:
    """Audit a robot in the given number of configurations. The result does not depend on the engine.

    `tolerance` has the same meaning as in `overlapper.overlap`. Overlaps with a depth of `least_depth` (m) or less do
    not count. `progress(blocks, count)` passes on the tallies of the `count` blocks. ValueError for less than one
    configuration, or a negative seed.
    """
    sampling = Sampling(robot, configurations, seed)
    examiner = Examiner(robot, sampling, tolerance, least_depth)
    tally = reduce(add, progress(_tallies(examiner, engine), len(sampling.blocks)))
    sights = _Sights(examiner)
    audited = []
    for k, pair in enumerate(examiner.pairs):
        asked, met = int(tally.asked[k]), int(tally.met[k])
        status: Status = "never" if not met else "always" if met == asked else "sometimes"
        random = int(tally.random_asked[k])
        fraction = wilson(int(tally.random_met[k]), random) if random else None
        places = (int(tally.volume.at[k]), int(tally.depth.at[k])) if met else ()
        largest, deepest = [sights.of(pair, place) for place in places] or (None, None)
        names = robot.link_names[pair.links[0]], robot.link_names[pair.links[1]]
        at_rest = status == "always" or (status == "sometimes" and sights.meet(pair, 0))
        audited.append(PairAudit(pair, names, status, asked, met, fraction, largest, deepest, at_rest))
    return Audit(robot, sampling, audited)


def wilson(met: int, asked: int) -> tuple[float, float, float]:
    """A fraction, and the bounds of the 95 % Wilson interval of the underlying probability."""
    fraction, z = met / asked, NORMAL_95
    middle, weight = fraction + z * z / (2 * asked), 1 + z * z / asked
    spread = z * math.sqrt(fraction * (1 - fraction) / asked + z * z / (4 * asked * asked))
    lower, upper = (middle - spread) / weight, (middle + spread) / weight
    return fraction, lower if met else 0.0, upper if met < asked else 1.0  # rounding would miss 0 and 1


def _tallies(examiner: Examiner, engine: Executor | None) -> Iterator[Tally]:
    """The tally of each block, in any order."""
    blocks = range(len(examiner.sampling.blocks))
    if engine is None or len(blocks) <= FEW:
        yield from map(examiner, blocks)
        return
    job = Job("overlapper.audit.examiner", "prepared", examiner.setup)
    for block, outcome in outcomes(engine, job, blocks):
        if isinstance(outcome, Failed):
            raise RuntimeError(f"block {block} of configurations failed: {outcome.sentence}\n{outcome.traceback}")
        yield outcome.value


class _Sights:
    """Measures two links in one configuration again, with all quantities of an overlap."""

    def __init__(self, examiner: Examiner) -> None:
        self._examiner, tree = examiner, examiner.robot.tree
        self._batch = Batch([each.shape for each in tree.shapes])
        self.keys = shape_keys(examiner.robot)

    def of(self, pair: LinkPair, number: int) -> Pose:
        (contact,) = link_contacts(Contacts(self.keys, self._overlaps(pair, number)))
        return Pose(number, self._examiner.sampling.configuration(number), contact)

    def meet(self, pair: LinkPair, number: int) -> bool:
        return bool(self._examiner.counts(self._overlaps(pair, number)).any())

    def _overlaps(self, pair: LinkPair, number: int) -> Overlaps:
        examiner = self._examiner
        (positions,), (orientations,) = examiner.kinematics.poses(examiner.sampling.configuration(number)[None])
        return self._batch.overlaps(
            positions, orientations, examiner.shape_pairs(pair), examiner.tolerance, separated=False
        )
