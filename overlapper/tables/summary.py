"""The summary of a run: the figures of each pair of links, the answers of FCL or MuJoCo, and what was not modelled."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from overlapper.simulation.links import LinkContact, link_contacts

if TYPE_CHECKING:
    from overlapper.reference import By, Comparison
    from overlapper.simulation import Decomposed, Report, Skipped
    from overlapper.simulation.bodies import AnyBodies
    from overlapper.simulation.first_overlaps import FirstOverlaps
    from overlapper.tables.frame import Frame
    from overlapper.tables.still import Still


Links = tuple[int, int, int, int]  # bodyA, linkA, bodyB, linkB


@dataclass(slots=True)
class PairSummary:
    """Two links over a run: the number of steps in which they overlap, and their largest measures.

    Parameters
    ----------
    names : tuple of (str, str)
        Names of the two links.
    steps : int, default 0
        Number of steps in which they overlap.
    volume : float, default 0.0
        Largest common volume of the links as a whole, m³. Where shapes of one link overlap each other, the volume
        counts once.
    volume_error : float, default 0.0
        Error bound of `volume`, m³.
    volume_step : int, default 0
        Step of `volume`.
    depth : float, default 0.0
        Largest depth of two of their shapes, m.
    depth_step : int, default 0
        Step of `depth`.
    normal : tuple of float, default ()
        Direction of `depth`, from the second link to the first.
    force : float, default 0.0
        Largest force that pushes the two apart, N, with volumetric contact.
    force_step : int, default 0
        Step of `force`.
    """

    names: tuple[str, str]
    steps: int = 0
    volume: float = 0.0
    volume_error: float = 0.0
    volume_step: int = 0
    depth: float = 0.0
    depth_step: int = 0
    normal: tuple[float, ...] = ()
    force: float = 0.0
    force_step: int = 0

    def add(self, step: int, pair: LinkContact, force: float = 0.0) -> None:
        """Add the overlap of the links in a step, and the force between them.

        Parameters
        ----------
        step : int
            Number of the step.
        pair : LinkContact
            The overlap.
        force : float, default 0.0
            The force, N.
        """
        if force > self.force:
            self.force, self.force_step = force, step
        self.steps += 1
        if pair.volume > self.volume:
            self.volume, self.volume_error, self.volume_step = pair.volume, pair.volume_error, step
        if pair.depth > self.depth:
            self.depth, self.depth_step, self.normal = pair.depth, step, tuple(pair.normal.tolist())


def overlapping_links(frame: Frame[Any]) -> Iterator[tuple[Links, LinkContact, float]]:
    """Yield the pairs of links that overlap in a frame, and the force between the two in N.

    The force is 0 without volumetric contact.
    """
    between = {} if frame.forces is None else frame.forces.between_links()
    for pair in filter(None, link_contacts(frame.contacts)):
        links = pair.bodyA, pair.linkA, pair.bodyB, pair.linkB
        yield links, pair, float(np.linalg.norm(between.get(links, 0.0)))


def note_skipped(known: dict[Skipped, int], frame: Frame[AnyBodies] | Frame[Still]) -> None:
    """Add what a frame leaves out to `known`, which has the first step of each."""
    for each in frame.bodies.skipped:
        known.setdefault(each, frame.step)


@dataclass(frozen=True, slots=True)
class Disagreement:
    """A contact where another program differs from this package, or gave no answer. `explanation` is one sentence."""

    step: int
    names: tuple[str, str]
    verdict: str
    explanation: str


@dataclass(frozen=True, slots=True)
class Tunnelled:
    """Two links that passed through each other within a step. `fraction` is the part of the step before they met."""

    step: int
    names: tuple[str, str]
    fraction: float
    point: tuple[float, ...]


@dataclass(slots=True)
class Summary:
    """The frames of a run, added one by one.

    Parameters
    ----------
    scene : str
        Name of what was run.
    steps : int, default 0
        Number of steps.
    seconds : float, default 0.0
        Simulated time, s.
    pairs : dict of (bodyA, linkA, bodyB, linkB) to PairSummary
        The pairs of links that overlap in any step.
    report : Report, optional
        The sum of the reports of all steps.
    skipped : dict of Skipped to int
        Everything that was left out in any step, with the first such step.
    decomposed : list of Decomposed
        The concave meshes at the end.
    verdicts : Counter of str
        Numbers of verdicts of FCL or MuJoCo, if it was asked.
    disagreements : list of Disagreement
        The contacts where FCL or MuJoCo differs.
    forces : bool, default False
        Whether there were forces of volumetric contact.
    check : {'fcl', 'mujoco'}, default 'fcl'
        The program whose verdicts these are.
    between : bool, default False
        Whether first overlaps between steps were asked for.
    tunnelled : list of Tunnelled
        The pairs of links that passed through each other within a step.
    undecided : int, default 0
        Number of pairs of shapes whose first overlap was not decided.
    """

    scene: str
    steps: int = 0
    seconds: float = 0.0
    pairs: dict[Links, PairSummary] = field(default_factory=dict)
    report: Report | None = None
    skipped: dict[Skipped, int] = field(default_factory=dict)
    decomposed: list[Decomposed] = field(default_factory=list)
    verdicts: Counter[str] = field(default_factory=Counter)
    disagreements: list[Disagreement] = field(default_factory=list)
    forces: bool = False
    check: By = "fcl"
    between: bool = False
    tunnelled: list[Tunnelled] = field(default_factory=list)
    undecided: int = 0

    def add(self, frame: Frame[AnyBodies], opinions: Sequence[Comparison] = ()) -> None:
        """Add a frame.

        Parameters
        ----------
        frame : Frame
            Bodies and contacts of a step.
        opinions : sequence of Comparison, default ()
            Comparisons of its contacts with FCL or MuJoCo, if it was asked.
        """
        self.steps, self.seconds = frame.step, frame.time
        self.report = _sum(self.report, frame.bodies.report())
        note_skipped(self.skipped, frame)
        self.decomposed = frame.bodies.decomposed
        names = frame.bodies.names
        self.forces |= frame.forces is not None
        for links, pair, force in overlapping_links(frame):
            known = self.pairs.setdefault(links, PairSummary((names[links[:2]], names[links[2:]])))
            known.add(frame.step, pair, force)
        if frame.first is not None:
            self.between = True
            self._add_first(frame.step, frame.first, names)
        for contact, opinion in zip(frame.contacts, opinions):
            self._add_opinion(
                frame.step, (names[contact.bodyA, contact.linkA], names[contact.bodyB, contact.linkB]), opinion
            )

    def _add_first(self, step: int, first: FirstOverlaps, names: dict[tuple[int, int], str]) -> None:
        self.undecided += sum(each.status == "open" for each in first)
        seen: set[Links] = set()
        for each in sorted(first.tunnelled, key=lambda each: each.fraction):
            links = each.bodyA, each.linkA, each.bodyB, each.linkB
            if links not in seen:
                seen.add(links)
                both = names[links[:2]], names[links[2:]]
                self.tunnelled.append(Tunnelled(step, both, each.fraction, tuple(map(float, each.point))))

    def _add_opinion(self, step: int, names: tuple[str, str], opinion: Comparison) -> None:
        self.verdicts[opinion.verdict] += 1
        if opinion.verdict != "agree":
            self.disagreements.append(Disagreement(step, names, opinion.verdict, opinion.explanation))

    def largest(self) -> list[PairSummary]:
        """The pairs that overlap in any step.

        Returns
        -------
        list of PairSummary
            The largest volume first.
        """
        return sorted(self.pairs.values(), key=lambda pair: -pair.volume)

    def as_dict(self) -> dict[str, Any]:
        """Everything as JSON takes it.

        Returns
        -------
        dict
            Values are in SI units. The names of the entries end in the unit.
        """
        return {
            "scene": self.scene,
            "steps": self.steps,
            "time_s": self.seconds,
            "pairs": [
                {
                    "links": dict(zip(("bodyA", "linkA", "bodyB", "linkB"), key)),
                    "names": pair.names,
                    "steps_overlapping": pair.steps,
                    "largest_volume_m3": pair.volume,
                    "volume_error_m3": pair.volume_error,
                    "volume_step": pair.volume_step,
                    "largest_depth_m": pair.depth,
                    "depth_step": pair.depth_step,
                    "normal": pair.normal,
                    **({"largest_force_n": pair.force, "force_step": pair.force_step} if self.forces else {}),
                }
                for key, pair in sorted(self.pairs.items(), key=lambda item: -item[1].volume)
            ],
            "report": asdict(self.report) if self.report else None,
            "skipped": [asdict(each) | {"first_step": step} for each, step in self.skipped.items()],
            "decomposed": [
                asdict(each) | {"shapes": [*each.shapes], "path": str(each.path) if each.path else None}
                for each in self.decomposed
            ],
            **({"tunnelled": [asdict(each) for each in self.tunnelled]} if self.between else {}),
            **({"undecided": self.undecided} if self.between else {}),
            self.check: dict(self.verdicts),
            "disagreements": [asdict(each) for each in self.disagreements],
        }


def _sum(before: Report | None, now: Report) -> Report:
    """Return bodies and shapes as they are now, and pairs and facets of all steps."""
    if before is None:
        return now
    of_scene = {"bodies", "shapes", "shapes_read"}
    counts = {name: count for name, count in asdict(before).items() if name not in of_scene}
    return replace(now, **{name: count + getattr(now, name) for name, count in counts.items()})
