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

from overlapper.reference import Comparison
from overlapper.regression import Frame
from overlapper.simulation import Contact, Report, Skipped

# Units for the volumes of one table, in m³: the largest of them that makes the largest volume a tenth or more.
VOLUME_UNITS = {"m³": 1.0, "cm³": 1e-6, "mm³": 1e-9, "µm³": 1e-18}


# One digit of an error bound, which must remain one.
ROUNDED_UP = Context(prec=1, rounding=ROUND_UP)


@dataclass(slots=True)
class PairSummary:
    """Two links over a run: in how many steps they overlap, and the figures of the largest overlap, with its step.

    Volumes are in m³, lengths in m, each of one shape of either link: the shapes of a link may overlap each other, so
    that sums would count some volumes twice. `normal` is that of the largest depth, from the second link to the first.
    """

    names: tuple[str, str]
    steps: int = 0
    last_step: int = 0
    volume: float = 0.0
    volume_error: float = 0.0
    volume_step: int = 0
    depth: float = 0.0
    depth_step: int = 0
    normal: tuple[float, ...] = ()

    def add(self, step: int, contact: Contact) -> None:
        """Take in an overlap of two of their shapes; all those of one step come one after the other."""
        overlap = contact.overlap
        assert overlap.depth is not None and overlap.normal is not None
        if step != self.last_step:
            self.steps, self.last_step = self.steps + 1, step
        if overlap.volume > self.volume:
            self.volume, self.volume_error, self.volume_step = overlap.volume, overlap.volume_error, step
        if overlap.depth > self.depth:
            self.depth, self.depth_step, self.normal = overlap.depth, step, tuple(overlap.normal.tolist())


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
    verdicts: Counter[str] = field(default_factory=Counter)
    disagreements: list[Disagreement] = field(default_factory=list)

    def add(self, frame: Frame, opinions: Sequence[Comparison] = ()) -> None:
        """Take in a frame; `opinions` are FCL's of its contacts, if it was asked."""
        self.steps, self.seconds = frame.step, frame.time
        self.report = _sum(self.report, frame.bodies.report())
        self.skipped = frame.bodies.skipped
        names = frame.bodies.names
        for k, contact in enumerate(frame.contacts):
            links = (contact.bodyA, contact.linkA), (contact.bodyB, contact.linkB)
            pair = names[links[0]], names[links[1]]
            if contact.overlap:
                self.pairs.setdefault(links[0] + links[1], PairSummary(pair)).add(frame.step, contact)
            if opinions:
                self._add_opinion(frame.step, pair, opinions[k])

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
            "fcl": dict(self.verdicts),
            "disagreements": [asdict(each) for each in self.disagreements],
        }


def _sum(before: Report | None, now: Report) -> Report:
    """Bodies and shapes as they are now, pairs and facets of all steps."""
    if before is None:
        return now
    counts = ("pairs_possible", "pairs_examined", "pairs_overlapping", "facets_touched")
    return replace(now, **{name: getattr(before, name) + getattr(now, name) for name in counts})


def overlaps_table(summary: Summary, limit: int = 20) -> Table:
    """The `limit` largest pairs, of which there must be one, for a reader who knows nothing of this program."""
    pairs = summary.largest()
    unit = next((unit for unit, size in VOLUME_UNITS.items() if pairs[0].volume >= 0.1 * size), "µm³")
    left_out = f"\nThe {limit} largest of {len(pairs)} pairs." if len(pairs) > limit else ""
    table = Table(
        title=f"Overlaps of {summary.scene} in {summary.steps} steps, {summary.seconds:.3g} s",
        caption="Volume: the largest in any step, true to within ±. Depth: the shortest way to part the two, in the "
        "step where that is longest. Normal: that way, for the first of them." + left_out,
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
            Text("\n ".join(pair.names)),
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
    if summary.verdicts:
        counts = ", ".join(f"{count:,} {verdict}" for verdict, count in summary.verdicts.most_common())
        lines.append(f"FCL on {sum(summary.verdicts.values()):,} pairs that overlap or touch: {counts}.")
    for each in summary.disagreements[:limit]:
        lines.append(f"  step {each.step}, {' – '.join(each.names)}, {each.verdict}: {each.explanation}")
    if len(summary.disagreements) > limit:
        rest = len(summary.disagreements) - limit
        lines.append(f"  and {rest:,} more, each explained in the file of --out and by --json.")
    return lines
