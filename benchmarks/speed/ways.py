"""Typical pairs and groups for each way of measuring an overlap, and what they cost: a table of docs/how.md.

    python benchmarks ways             measures, a minute or two, and writes the table into the page
    python benchmarks ways --rounds 3  likewise, sooner and less surely

Each is asked for its status and volume, anew in every call and on one thread. A round takes the median of some calls'
times, of the processor, so that other processes do not count; a figure is the least median of all rounds. Beside it, in
the same rounds: the same bodies by the dual hull, which one more body brings about, an ellipsoid around all others;
and by the article's method.
"""

from __future__ import annotations

import re
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from statistics import median
from typing import NamedTuple

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
# An ellipsoid around all others: whatever they share, they share with it, too.
AROUND = Placed(Ellipsoid([100, 101, 102]))


class Typical(NamedTuple):
    bodies: tuple[Placed, ...]
    way: str  # as the page says


def typical(way: str, *bodies: tuple | Placed) -> Typical:
    """Each body is placed, or a shape with its position and orientation, as far as they are not those at rest."""
    return Typical(tuple(body if isinstance(body, Placed) else Placed(*body) for body in bodies), way)


BALL, DRUM, CAN, CAPSULE = Sphere(0.5), Hull(prism(256)), Cylinder(0.5, 1), Capsule(0.3, 1)
FLOOR = Placed(HalfSpace([0, 0, 1], 0))
BOX = (CUBE,)
WITH_MARGIN = RoundedHull(0.1 * icosphere(0), 1e-3)
ASIDE = (0.6, 0.5, 0.4)

TYPICAL = {
    "two boxes, apart": typical("separation", BOX, (CUBE, (2, 0.5, 0.4), TURN)),
    "two boxes": typical("clipping", BOX, (CUBE, ASIDE, TURN)),
    "a box in the floor": typical("clipping", (CUBE, (0, 0, 0.3), TURN), FLOOR),
    "three boxes": typical("clipping", BOX, (CUBE, (0.2, 0.1, 0.3), TURN), (CUBE, (0.1, 0.3, 0.2), ABOUT_Z)),
    "a mesh of 1,280 facets in the floor": typical("dual hull", (BALLS[1280], (0, 0, 0.1)), FLOOR),
    "a mesh of 320 facets in the floor": typical("clipping", (BALLS[320], (0, 0, 0.1), TURN), FLOOR),
    "a box resting on another, 1 µm deep": typical("wide clipping", BOX, (CUBE, (0.1, 0.2, 1 - 1e-6), ABOUT_Z)),
    "two meshes of 80 facets": typical("tracing", (BALLS[80],), (BALLS[80], ASIDE, TURN)),
    "two meshes of 1,280 facets": typical("tracing", (BALLS[1280],), (BALLS[1280], ASIDE, TURN)),
    "two meshes of 5,120 facets": typical("tracing", (BALLS[5120],), (BALLS[5120], ASIDE, TURN)),
    "three meshes of 1,280 facets": typical(
        "dual hull", (BALLS[1280],), (BALLS[1280], ASIDE, TURN), (BALLS[1280], (0.1, -0.6, 0.4), ABOUT_Z)
    ),
    "a mesh of 320 facets and the same once more": typical("dual hull", (BALLS[320],), (BALLS[320],)),
    "two boxes flush at the sides": typical("clipping", BOX, (CUBE, (0, 0, 0.7))),
    "a ball in the floor": typical("closed form", (BALL, (0, 0, 0.3)), FLOOR),
    "a cylinder, tilted, in the floor": typical("closed form", (CAN, (0, 0, 0.3), TURN), FLOOR),
    "a ball on the face of a box": typical("closed form", (BALL, (0.01, 0.02, 0.9)), BOX),
    "a ball over the corner of a box": typical("closed form", (BALL, (0.6, 0.4, 0.5)), (CUBE, (0, 0, 0), TURN)),
    "a cylinder in the corner of a box": typical("closed form", (Cylinder(0.3, 1), (0.3, 0.2, 0.5), TURN), BOX),
    "a capsule in the corner of a box": typical("closed form", (CAPSULE, (0.3, 0.2, 0.5), TURN), BOX),
    "an ellipsoid on the face of a box": typical(
        "closed form", (Ellipsoid([0.5, 0.3, 0.4]), (0.01, 0.02, 0.75), TURN), BOX
    ),
    "two balls": typical("closed form", (BALL,), (BALL, (0.6, 0, 0))),
    "two cylinders": typical("slicing", (CAN,), (CAN, (0.3, 0.2, 0.1), TURN)),
    "a ball on the side of a capsule": typical("slicing", (BALL,), (CAPSULE, (0.6, 0, 0.1), TURN)),
    "two meshes of 20 facets with margins, 1 mm each": typical(
        "closed form", (WITH_MARGIN,), (WITH_MARGIN, (0.12, 0.07, 0.09), TURN)
    ),
    "a rounded hull of 80 facets and a box": typical(
        "closed form", (RoundedHull(icosphere(1), 0.05),), (CUBE, (0.9, 0.3, 0.4), TURN)
    ),
    "a box stacked on another, flush, 1 µm deep": typical("wide clipping", BOX, (CUBE, (0, 0, 1 - 1e-6))),
    "a box resting on another, 1e-14 m deep": typical("wide dual hull", BOX, (CUBE, (0.1, 0.2, 1 - 1e-14), ABOUT_Z)),
    "two boxes, 4e-15 m apart": typical("wide separation", BOX, (CUBE, (1 + 4e-15, 0, 0))),
    "two boxes that touch": typical("doubt", BOX, (CUBE, (1, 0.2, 0.1))),
    "a cylinder that stands on another": typical("doubt", (CAN,), (CAN, (0, 0, 1))),
    "a drum of 256 sides that stands on another": typical("doubt", (DRUM,), (DRUM, (0, 0, 1))),
}

HEADING = ("bodies", "way", "µs", "by the dual hull", "by the article")

Asked = Callable[[], float]


def questions(case: Typical) -> list[Asked | str]:
    """For its own way, and for the dual hull and the article's method where these are other ways and answer."""
    bodies = case.bodies
    found: list[Asked | str] = [asked(bodies, "auto"), "", ""]
    if case.way in COMPARED:
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
    for name, case in TYPICAL.items():
        way = overlap(*case.bodies).way
        if way != case.way:
            raise SystemExit(f"{name}: the way is {way}, not {case.way}")
    page = PAGE.read_text(encoding="utf-8")
    pattern = re.escape(f"| {' | '.join(HEADING)} |") + r"\n(?:\|.*\n)+"
    if (count := len(re.findall(pattern, page))) != 1:
        raise SystemExit(f"{PAGE} has {count} such tables, not one")
    rows = measured({name: questions(typical) for name, typical in TYPICAL.items()}, chosen.rounds)
    text = table(HEADING, ([name, TYPICAL[name].way, *cells] for name, cells in rows.items()), left=2) + "\n"
    PAGE.write_text(re.sub(pattern, lambda _: text, page), encoding="utf-8")
    print(text)
