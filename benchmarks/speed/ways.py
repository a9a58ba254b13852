"""Typical pairs and groups for each way of measuring an overlap, and what they cost: a table of docs/how.md.

    python benchmarks ways             measures, a minute or two, and writes the table into the page
    python benchmarks ways --rounds 3  likewise, sooner and less surely

Each is asked for its status and volume, anew in every call and on one thread. A round takes the median of some calls'
times, of the processor, so that other processes do not count; a figure is the least median of all rounds. Beside it, in
the same rounds: the same bodies by the dual hull, which one more body brings about, a rounded hull around all others;
and by the article's method.
"""

from __future__ import annotations

import re
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from statistics import median
from typing import NamedTuple

import numpy as np
from families import icosphere, prism

from harness.bodies import has
from harness.command import ROOT
from harness.page import table
from harness.timing import in_turn
from overlapper import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, Placed, RoundedHull, Sphere, overlap

# The ways that are there because they are faster than the dual hull.
COMPARED = ("clipping", "tracing", "closed form")

PAGE = ROOT / "docs" / "how.md"
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


HEADING = ("bodies", "way", "µs", "by the dual hull", "by the article")

Asked = Callable[[], float]


def questions(typical: Typical) -> list[Asked | str]:
    """For its own way, and for the dual hull and the article's method where these are other ways and answer."""
    bodies = typical.bodies
    found: list[Asked | str] = [asked(bodies, "auto"), "", ""]
    if typical.way in COMPARED:
        assert overlap(*bodies, AROUND).way == "dual hull"
        found[1] = asked((*bodies, AROUND), "auto")
    if not has(bodies, RoundedHull):  # which the article's method refuses
        right = overlap(*bodies, method="paper").status == overlap(*bodies).status
        found[2] = asked(bodies, "paper") if right else "wrong"
    return found


def asked(bodies: tuple[Placed, ...], method: str) -> Asked:
    def ask() -> float:
        common = overlap(*bodies, method=method)
        return common.volume if common else 0.0

    return ask


def measured(rows: dict[str, list[Asked | str]], rounds: int) -> dict[str, list[str]]:
    """The least median of each in µs, as the page has it."""
    calls = [each for row in rows.values() for each in row if callable(each)]
    medians = [[median(samples) for samples in in_turn(calls, 5, 0.02, 4e-4)] for _ in range(rounds)]
    least = iter(1e6 * min(of_call) for of_call in zip(*medians))

    def cell(each: Asked | str) -> str:
        if isinstance(each, str):
            return each
        us = next(least)
        return f"{us:,.1f}" if us < 20 else f"{us:,.0f}"

    return {name: [cell(each) for each in row] for name, row in rows.items()}


def options(parser: ArgumentParser) -> None:
    parser.add_argument("--rounds", type=int, default=15)


def main(chosen: Namespace) -> None:
    for name, typical in TYPICAL.items():
        way = overlap(*typical.bodies).way
        if way != typical.way:
            raise SystemExit(f"{name}: the way is {way}, not {typical.way}")
    page = PAGE.read_text(encoding="utf-8")
    pattern = re.escape(f"| {' | '.join(HEADING)} |") + r"\n(?:\|.*\n)+"
    if (count := len(re.findall(pattern, page))) != 1:
        raise SystemExit(f"{PAGE} has {count} such tables, not one")
    rows = measured({name: questions(typical) for name, typical in TYPICAL.items()}, chosen.rounds)
    text = table(HEADING, ([name, TYPICAL[name].way, *cells] for name, cells in rows.items()), left=2) + "\n"
    PAGE.write_text(re.sub(pattern, lambda _: text, page), encoding="utf-8")
    print(text)
