"""Writes docs/economy.md: the pairs and facets that are examined in each scene, and the time.

python docs/economy.py
"""

from __future__ import annotations

import platform
import re
import time
import warnings
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import mean, median

import numpy as np
import pybullet

from overlapper import Box, HalfSpace, Hull, Overlaps, Shape
from overlapper.scenes.scene import Scene, load_scene, scenes_in
from overlapper.simulation import Bodies, Recorder, Report, SkippedShapeWarning

HERE = Path(__file__).resolve().parent

WORDS = """\
<!-- Written by docs/economy.py. -->
# Benchmarks: work and time per scene

This page counts the pairs and facets that `update()` and `overlaps()` examine in a step of each scene of
[`scenes/`](../scenes). The counts are averages over all steps.

{table}

- **shapes**: the shapes of the scene. They are read once. If some are not modelled, the number of modelled shapes
  follows.
- **pairs possible**: the pairs of shapes that the simulator lets collide.
- **examined**: the pairs whose bounding boxes overlap.
- **overlapping**: the pairs with a common volume.
- **facets there**: the number of all facets of the boxes, hulls and half-spaces of all examined pairs. Round shapes
  have none.
- **asked**: the planes that were placed and compared with corners, and the planes that a shape returned for a ray or
  a point. A pair that has not moved asks for none.
- **touched**: the planes that took part in the computation of the common part. Tangent planes of round shapes count,
  too.
- **again**: the overlaps that were measured again in wider arithmetic. They are so thin that the error in doubles is
  more than 1e-12 of their volume.
- **time**: the processor time of `update()` and `overlaps()` at the default tolerance, the median step, on one
  thread{machine}.

## Methods per scene

This table has the number of pairs that overlap or touch in a step, by the
[method](how.md#which-method-measures-which-bodies) that measured them. The numbers are averages over all steps.

{ways}

`python docs/economy.py` runs the scenes and writes this page. `bodies.report()` has these counts for any scene, and
`overlapper run` prints them.
"""

HEADING = (
    "scene", "shapes", "pairs possible", "examined", "overlapping", "facets there", "asked", "touched", "again", "time",
)  # fmt: skip


COUNTS = (
    "pairs_possible", "pairs_examined", "pairs_overlapping", "planes_asked", "facets_touched", "pairs_widened",
)  # fmt: skip


# The ways of what overlaps or touches.
ANSWERS = [way for way in Overlaps.WAYS if not way.endswith("separation") and way != "paper"]


def facets(shape: Shape) -> int:
    return len(shape.facets) if isinstance(shape, Hull) else 6 * isinstance(shape, Box) + isinstance(shape, HalfSpace)


@dataclass
class Economy:
    """The work of each step of a scene: its report, the facets of the pairs examined, and the time it took."""

    reports: list[Report] = field(default_factory=list)
    facets_there: list[int] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    by_way: Counter[str] = field(default_factory=Counter)  # pairs that overlap or touch, of all steps

    def row(self, name: str) -> list[str]:
        last = self.reports[-1]
        read = "" if last.shapes_read == last.shapes else f", {last.shapes_read:,} of them modelled"
        possible, examined, overlapping, asked, touched, widened = (
            rounded(mean(getattr(report, count) for report in self.reports)) for count in COUNTS
        )
        there = rounded(mean(self.facets_there))
        took = f"{1e3 * median(self.seconds):.2g} ms"
        return [name, f"{last.shapes:,}{read}", possible, examined, overlapping, there, asked, touched, widened, took]

    def ways(self, name: str) -> list[str]:
        return [name, *(rounded(self.by_way[way] / len(self.reports)) if self.by_way[way] else "" for way in ANSWERS)]


def rounded(count: float) -> str:
    if 0 < count < 0.05:
        return "< 0.1"
    return f"{count:,.0f}" if count >= 10 or count == int(count) else f"{count:.1f}"


def economy(scene: Scene) -> Economy:
    """Runs the scene."""
    client, found = pybullet.connect(pybullet.DIRECT), Economy()
    recorder = Recorder(client)
    try:
        step = scene.build(client)
        bodies = Bodies(client, recorder=recorder)
        sizes = np.array([facets(shape) for shape in bodies.shapes])
        for i in range(scene.steps):
            if step:
                step(i)
            pybullet.stepSimulation(client)
            begin = time.process_time()
            bodies.update()
            contacts = bodies.overlaps(pairs=scene.pairs)
            found.seconds.append(time.process_time() - begin)
            found.by_way.update(Overlaps.WAYS[way] for way in contacts.overlaps.way)
            found.reports.append(bodies.report())
            found.facets_there.append(int(sizes[bodies.pairs(scene.pairs)].sum()))
    finally:
        recorder.close()
        pybullet.disconnect(client)
    return found


def table(heading: Sequence[str], rows: Iterable[list[str]]) -> str:
    rule = "|---|" + "--:|" * (len(heading) - 1)
    return "\n".join([f"| {' | '.join(heading)} |", rule, *(f"| {' | '.join(row)} |" for row in rows)])


def main() -> None:
    warnings.simplefilter("ignore", SkippedShapeWarning)
    rows, ways = [], []
    for path in scenes_in(HERE.parent / "scenes"):
        scene = load_scene(path)
        found = economy(scene)
        rows.append(found.row(scene.name))
        ways.append(found.ways(scene.name))
        print("  ".join(rows[-1]), flush=True)
    text = WORDS.format(table=table(HEADING, rows), ways=table(("scene", *ANSWERS), ways), machine=f" of {machine()}")
    (HERE / "economy.md").write_text(text, encoding="utf-8")


def machine() -> str:
    listed = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text(encoding="utf-8"))
    return listed[1].strip() if listed else platform.machine()


if __name__ == "__main__":
    main()
