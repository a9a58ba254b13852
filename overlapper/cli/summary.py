"""What a run came to: a line per pair of links, what FCL said of it, and how little of the scene had to be modelled."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from decimal import ROUND_UP, Context
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from overlapper.printable import printable
from overlapper.reference import Comparison
from overlapper.scenes.run import Frame
from overlapper.simulation import Bodies, Decomposed, Report, Skipped
from overlapper.simulation.links import LinkContact, link_contacts

# Units for the volumes of one table, in m³: the largest of them that makes the largest volume a tenth or more.
VOLUME_UNITS = {"m³": 1.0, "cm³": 1e-6, "mm³": 1e-9, "µm³": 1e-18}


# One digit of an error bound, which must remain one.
ROUNDED_UP = Context(prec=1, rounding=ROUND_UP)


@dataclass(slots=True)
class PairSummary:
    """Two links over a run: in how many steps they overlap, and the figures of the largest overlap, with its step.

    Volumes are in m³ and of the links as a whole, where the shapes of one overlap each other counted once. Depths are
    in m and of two of their shapes; `normal` is that of the largest, from the second link to the first.
    """

    names: tuple[str, str]
    steps: int = 0
    volume: float = 0.0
    volume_error: float = 0.0
    volume_step: int = 0
    depth: float = 0.0
    depth_step: int = 0
    normal: tuple[float, ...] = ()

    def add(self, step: int, pair: LinkContact) -> None:
        """Take in what the links have in common in a step."""
        self.steps += 1
        if pair.volume > self.volume:
            self.volume, self.volume_error, self.volume_step = pair.volume, pair.volume_error, step
        if pair.depth > self.depth:
            self.depth, self.depth_step, self.normal = pair.depth, step, tuple(pair.normal.tolist())


@dataclass(frozen=True, slots=True)
class Disagreement:
    """FCL and we differ, or FCL gave no answer; `explanation` is one sentence."""

    step: int
    names: tuple[str, str]
    verdict: str
    explanation: str


@dataclass(slots=True)
class Summary:
    """The frames of a run, taken in one by one."""

    scene: str
    steps: int = 0
    seconds: float = 0.0
    pairs: dict[tuple[int, int, int, int], PairSummary] = field(default_factory=dict)
    report: Report | None = None
    skipped: list[Skipped] = field(default_factory=list)
    decomposed: list[Decomposed] = field(default_factory=list)
    verdicts: Counter[str] = field(default_factory=Counter)
    disagreements: list[Disagreement] = field(default_factory=list)

    def add(self, frame: Frame[Bodies], opinions: Sequence[Comparison] = ()) -> None:
        """Take in a frame; `opinions` are FCL's of its contacts, if it was asked."""
        self.steps, self.seconds = frame.step, frame.time
        self.report = _sum(self.report, frame.bodies.report())
        self.skipped, self.decomposed = frame.bodies.skipped, frame.bodies.decomposed
        names = frame.bodies.names
        for pair in filter(None, link_contacts(frame.contacts)):
            key = pair.bodyA, pair.linkA, pair.bodyB, pair.linkB
            self.pairs.setdefault(key, PairSummary((names[key[:2]], names[key[2:]]))).add(frame.step, pair)
        for contact, opinion in zip(frame.contacts, opinions):
            self._add_opinion(
                frame.step, (names[contact.bodyA, contact.linkA], names[contact.bodyB, contact.linkB]), opinion
            )

    def _add_opinion(self, step: int, names: tuple[str, str], opinion: Comparison) -> None:
        self.verdicts[opinion.verdict] += 1
        if opinion.verdict != "agree":
            self.disagreements.append(Disagreement(step, names, opinion.verdict, opinion.explanation))

    def largest(self) -> list[PairSummary]:
        """The pairs that overlap in any step, the largest volume first."""
        return sorted(self.pairs.values(), key=lambda pair: -pair.volume)

    def as_dict(self) -> dict[str, Any]:
        """Everything, as JSON takes it: SI units, said in the names."""
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
                }
                for key, pair in sorted(self.pairs.items(), key=lambda item: -item[1].volume)
            ],
            "report": asdict(self.report) if self.report else None,
            "skipped": [asdict(each) for each in self.skipped],
            "decomposed": [
                asdict(each) | {"shapes": [*each.shapes], "path": str(each.path) if each.path else None}
                for each in self.decomposed
            ],
            "fcl": dict(self.verdicts),
            "disagreements": [asdict(each) for each in self.disagreements],
        }


def _sum(before: Report | None, now: Report) -> Report:
    """Bodies and shapes as they are now, pairs and facets of all steps."""
    if before is None:
        return now
    of_scene = {"bodies", "shapes", "shapes_read"}
    counts = {name: count for name, count in asdict(before).items() if name not in of_scene}
    return replace(now, **{name: count + getattr(now, name) for name, count in counts.items()})


def overlaps_table(summary: Summary, limit: int = 20) -> Table:
    """The `limit` largest pairs, of which there must be one, for a reader who knows nothing of this program."""
    pairs = summary.largest()
    unit = next((unit for unit, size in VOLUME_UNITS.items() if pairs[0].volume >= 0.1 * size), "µm³")
    left_out = f"\nThe {limit} largest of {len(pairs)} pairs." if len(pairs) > limit else ""
    table = Table(
        title=f"Overlaps of {summary.scene} in {summary.steps} steps, {summary.seconds:.3g} s",
        caption="Volume: the largest in any step, true to within ±. Depth: the shortest way to part the two, or the "
        "deepest of their shapes, in the step where that is longest. Normal: that way, for the first of them."
        + left_out,
        caption_justify="left",
        box=SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
        collapse_padding=True,
    )
    # Two lines a pair and narrow numbers, so that a terminal of 80 columns holds the table.
    table.add_column("pair of links", overflow="fold")
    for header in ("steps", f"volume\n{unit}", f"±\n{unit}", "depth\nmm", "normal\nx, y, z", "at\nstep"):
        table.add_column(header, justify="right", no_wrap=True)
    for pair in pairs[:limit]:
        table.add_row(
            Text("\n ".join(map(printable, pair.names))),
            str(pair.steps),
            f"{pair.volume / VOLUME_UNITS[unit]:.4g}",
            f"{ROUNDED_UP.create_decimal(pair.volume_error / VOLUME_UNITS[unit]):e}",
            f"{1e3 * pair.depth:.3g}",
            " ".join(f"{round(component, 2) + 0.0:+.2f}" for component in pair.normal),
            str(pair.depth_step),
        )
    return table


def remarks(summary: Summary, limit: int = 10) -> list[str]:
    """What there is to say below the table: what was modelled and what not, and the first `limit` disagreements."""
    lines = str(summary.report).splitlines() if summary.report else []
    lines += [f"Not modelled: {each.name}, {each.reason}." for each in summary.skipped]
    lines += [_decomposed(each) for each in summary.decomposed]
    if summary.verdicts:
        counts = ", ".join(f"{count:,} {verdict}" for verdict, count in summary.verdicts.most_common())
        lines.append(f"FCL on {sum(summary.verdicts.values()):,} pairs that overlap or touch: {counts}.")
    for each in summary.disagreements[:limit]:
        lines.append(f"  step {each.step}, {' – '.join(each.names)}, {each.verdict}: {each.explanation}")
    if len(summary.disagreements) > limit:
        rest = len(summary.disagreements) - limit
        lines.append(f"  and {rest:,} more, each explained in the file of --out and by --json.")
    return lines


def _decomposed(mesh: Decomposed) -> str:
    parts = f"{len(mesh.shapes)} convex parts" if len(mesh.shapes) > 1 else "one convex part"
    bounds = "surface is open" if mesh.mesh_volume is None else f"mesh bounds {mesh.mesh_volume:.4g} m³"
    kept = f"; kept in {mesh.path}" if mesh.path else ""
    return f"Concave: {mesh.name} is {parts} of {mesh.volume:.4g} m³ together, the {bounds}{kept}."
