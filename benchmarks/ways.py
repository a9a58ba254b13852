"""Typical pairs and groups for each way of measuring an overlap, and what they cost: a table of docs/how.md.

    python benchmarks/ways.py             measures, a minute or two, and writes the table into the page
    python benchmarks/ways.py --rounds 3  likewise, sooner and less surely

Each is asked for its status and volume, anew in every call and on one thread. A round takes the median of some calls'
times, of the processor, so that what else the machine does counts for nobody; a figure is the least median of all
rounds. Beside it, in the same rounds: the same bodies by the dual hull, which one more body brings about, a rounded
hull around all others; and by the article's method.
"""

from __future__ import annotations

import argparse
import math
import re
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import NamedTuple

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "tests" / "support")]

from families import icosphere, prism  # noqa: E402

from overlapper import (  # noqa: E402
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
)

# The ways that are there because they are faster than the dual hull.
COMPARED = ("clipping", "tracing", "closed form")

PAGE = HERE.parent / "docs" / "how.md"
TURN = (0.3, -0.5, 0.2, 0.8)
ABOUT_Z = (0, 0, 0.1, 1)
CUBE = Box([0.5, 0.5, 0.5])
BALLS = {20 * 4**k: Hull(icosphere(k)) for k in (1, 2, 3, 4)}  # by their facets
FLOOR = Placed(HalfSpace([0, 0, 1], 0))
# What of these bodies shares something with others, shares all of it with this one.
AROUND = Placed(RoundedHull(100 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]), 1))


class Typical(NamedTuple):
    bodies: tuple[Placed, ...]
    way: str  # as the page says


TYPICAL = {
    "two boxes, apart": Typical((Placed(CUBE), Placed(CUBE, (2, 0.5, 0.4), TURN)), "separation"),
    "two boxes": Typical((Placed(CUBE), Placed(CUBE, (0.6, 0.5, 0.4), TURN)), "clipping"),
    "a box in the floor": Typical((Placed(CUBE, (0, 0, 0.3), TURN), FLOOR), "clipping"),
    "three boxes": Typical(
        (Placed(CUBE), Placed(CUBE, (0.2, 0.1, 0.3), TURN), Placed(CUBE, (0.1, 0.3, 0.2), ABOUT_Z)), "clipping"
    ),
    "a mesh of 1,280 facets in the floor": Typical((Placed(BALLS[1280], (0, 0, 0.1)), FLOOR), "dual hull"),
    "a mesh of 320 facets in the floor": Typical((Placed(BALLS[320], (0, 0, 0.1), TURN), FLOOR), "clipping"),
    "a box resting on another, 1 µm deep": Typical(
        (Placed(CUBE), Placed(CUBE, (0.1, 0.2, 1 - 1e-6), ABOUT_Z)), "wide clipping"
    ),
    "two meshes of 80 facets": Typical((Placed(BALLS[80]), Placed(BALLS[80], (0.6, 0.5, 0.4), TURN)), "tracing"),
    "two meshes of 1,280 facets": Typical((Placed(BALLS[1280]), Placed(BALLS[1280], (0.6, 0.5, 0.4), TURN)), "tracing"),
    "two meshes of 5,120 facets": Typical((Placed(BALLS[5120]), Placed(BALLS[5120], (0.6, 0.5, 0.4), TURN)), "tracing"),
    "three meshes of 1,280 facets": Typical(
        (
            Placed(BALLS[1280]),
            Placed(BALLS[1280], (0.6, 0.5, 0.4), TURN),
            Placed(BALLS[1280], (0.1, -0.6, 0.4), ABOUT_Z),
        ),
        "dual hull",
    ),
    "a mesh of 320 facets and the same once more": Typical((Placed(BALLS[320]), Placed(BALLS[320])), "dual hull"),
    "two boxes flush at the sides": Typical((Placed(CUBE), Placed(CUBE, (0, 0, 0.7))), "dual hull"),
    "a ball in the floor": Typical((Placed(Sphere(0.5), (0, 0, 0.3)), FLOOR), "closed form"),
    "a cylinder, tilted, in the floor": Typical((Placed(Cylinder(0.5, 1), (0, 0, 0.3), TURN), FLOOR), "closed form"),
    "a ball on the face of a box": Typical((Placed(Sphere(0.5), (0.01, 0.02, 0.9)), Placed(CUBE)), "closed form"),
    "a ball over the corner of a box": Typical(
        (Placed(Sphere(0.5), (0.6, 0.4, 0.5)), Placed(CUBE, (0, 0, 0), TURN)), "closed form"
    ),
    "a cylinder in the corner of a box": Typical(
        (Placed(Cylinder(0.3, 1), (0.3, 0.2, 0.5), TURN), Placed(CUBE)), "closed form"
    ),
    "a capsule in the corner of a box": Typical(
        (Placed(Capsule(0.3, 1), (0.3, 0.2, 0.5), TURN), Placed(CUBE)), "closed form"
    ),
    "an ellipsoid on the face of a box": Typical(
        (Placed(Ellipsoid([0.5, 0.3, 0.4]), (0.01, 0.02, 0.75), TURN), Placed(CUBE)), "closed form"
    ),
    "two balls": Typical((Placed(Sphere(0.5)), Placed(Sphere(0.5), (0.6, 0, 0))), "closed form"),
    "two cylinders": Typical((Placed(Cylinder(0.5, 1)), Placed(Cylinder(0.5, 1), (0.3, 0.2, 0.1), TURN)), "slicing"),
    "a ball on the side of a capsule": Typical(
        (Placed(Sphere(0.5)), Placed(Capsule(0.3, 1), (0.6, 0, 0.1), TURN)), "slicing"
    ),
    "two meshes of 20 facets with margins, 1 mm each": Typical(
        (
            Placed(RoundedHull(0.1 * icosphere(0), 1e-3)),
            Placed(RoundedHull(0.1 * icosphere(0), 1e-3), (0.12, 0.07, 0.09), TURN),
        ),
        "slicing",
    ),
    "a rounded hull of 80 facets and a box": Typical(
        (Placed(RoundedHull(icosphere(1), 0.05)), Placed(CUBE, (0.9, 0.3, 0.4), TURN)), "slicing"
    ),
    "a box stacked on another, flush, 1 µm deep": Typical(
        (Placed(CUBE), Placed(CUBE, (0, 0, 1 - 1e-6))), "wide dual hull"
    ),
    "a box resting on another, 1e-14 m deep": Typical(
        (Placed(CUBE), Placed(CUBE, (0.1, 0.2, 1 - 1e-14), ABOUT_Z)), "wide dual hull"
    ),
    "two boxes, 4e-15 m apart": Typical((Placed(CUBE), Placed(CUBE, (1 + 4e-15, 0, 0))), "wide separation"),
    "two boxes that touch": Typical((Placed(CUBE), Placed(CUBE, (1, 0.2, 0.1))), "doubt"),
    "a cylinder that stands on another": Typical(
        (Placed(Cylinder(0.5, 1)), Placed(Cylinder(0.5, 1), (0, 0, 1))), "doubt"
    ),
    "a drum of 256 sides that stands on another": Typical(
        (Placed(Hull(prism(256))), Placed(Hull(prism(256)), (0, 0, 1))), "doubt"
    ),
}


@dataclass
class Clock:
    ask: Callable[[], object]
    calls: int = 0
    medians: list[float] = field(default_factory=list)

    def round(self) -> None:
        """Calls for some ms, in batches that are long enough for the clock."""
        if not self.calls:
            begin = time.process_time()
            self.ask()
            self.ask()
            self.calls = max(1, math.ceil(4e-4 / max(1e-7, time.process_time() - begin)))
        taken = []
        while len(taken) < 5 or (sum(taken) < 0.02 and len(taken) < 40):
            begin = time.process_time()
            for _ in range(self.calls):
                self.ask()
            taken.append(time.process_time() - begin)
        self.medians.append(median(taken) / self.calls)

    def __str__(self) -> str:
        us = 1e6 * min(self.medians)
        return f"{us:,.1f}" if us < 20 else f"{us:,.0f}"


def clocks(typical: Typical) -> list[Clock | str]:
    """For its own way, and for the dual hull and the article's method where these are other ways and answer."""
    found: list[Clock | str] = [clock(typical.bodies, "auto"), "", ""]
    if typical.way in COMPARED:
        assert overlap(*typical.bodies, AROUND).way == "dual hull"
        found[1] = clock((*typical.bodies, AROUND), "auto")
    if not any(isinstance(body.shape, RoundedHull) for body in typical.bodies):  # which the article's method refuses
        right = overlap(*typical.bodies, method="paper").status == overlap(*typical.bodies).status
        found[2] = clock(typical.bodies, "paper") if right else "wrong"
    return found


def clock(bodies: tuple[Placed, ...], method: str) -> Clock:
    def ask() -> float:
        common = overlap(*bodies, method=method)
        return common.volume if common else 0.0

    return Clock(ask)


HEADING = ("bodies", "way", "µs", "by the dual hull", "by the article")


def table(rows: dict[str, list[Clock | str]]) -> str:
    lines = [f"| {' | '.join(HEADING)} |", "|---|---|--:|--:|--:|"]
    for name, row in rows.items():
        lines.append(f"| {name} | {TYPICAL[name].way} | {' | '.join(map(str, row))} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=15)
    rounds = parser.parse_args().rounds
    for name, typical in TYPICAL.items():
        way = overlap(*typical.bodies).way
        if way != typical.way:
            raise SystemExit(f"{name}: the way is {way}, not {typical.way}")
    rows = {name: clocks(typical) for name, typical in TYPICAL.items()}
    for _ in range(rounds):
        for row in rows.values():
            for each in row:
                if isinstance(each, Clock):
                    each.round()
    text = table(rows)
    page = PAGE.read_text(encoding="utf-8")
    heading = re.escape(text.splitlines()[0])
    written, count = re.subn(heading + r"\n(?:\|.*\n)+", lambda _: text, page)
    if count != 1:
        raise SystemExit(f"{PAGE} has {count} such tables, not one")
    PAGE.write_text(written, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
