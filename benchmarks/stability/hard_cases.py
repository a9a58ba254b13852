"""Who fails where: hard cases with exact answers, put to each peer in a process of its own.

    python benchmarks stability                   all cases again, then the page and its pictures
    python benchmarks stability --page            only the page and its pictures, from the results there are

Writes benchmarks/results/stability.csv (a case a line), and the page stability.md with its pictures to docs. The cases
are those of tests/support/families.py made of vertices alone, so that every peer can be given them, and contacts of
round bodies, for which only depths and distances are asked. The truth is exact: rational arithmetic on the doubles that
the peers get.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from pathlib import Path

import exact
import families
import numpy as np

from harness import results
from harness.peers import NOT_ASKED, HardCase, hard_cases
from harness.watched import Watched
from overlapper import Placed
from stability.judging import Question, distance_column, distance_verdict, verdict

RESULTS = results.FOLDER / "stability.csv"
PAGE = "stability.page"

TIME_LIMIT = 10.0  # s, for a question

# Vertices of one body, so that the exact truth stays a matter of seconds.
LARGEST = 170

# Families whose parameter runs over many decades get more cases, so that each decade has some.
DECADES = ("slivers", "tilted_slivers", "nearly_touching", "needles_and_plates", "far_away", "scaled", "round_contacts")
SHARE = dict.fromkeys(DECADES, 3)

# Families with round bodies whose signed distance is known.
ROUND = ("round_contacts",)

# A question without difficulty, asked before time counts.
FIRST = (families.CORNERS, families.CORNERS + 1.0)


def options(parser: ArgumentParser) -> None:
    parser.add_argument("--seed", type=int, default=0, help="of the first case of each family")
    parser.add_argument("--count", type=int, default=2000, help="about so many cases")


def measure(chosen: Namespace, path: Path) -> None:
    asked = questions(chosen.seed, chosen.count)
    table = Columns([described(question) for question in asked], FIRST)
    flat = [None if question.round else question.bodies for question in asked]
    pairs = [None if question.signed_distance is None else question.bodies for question in asked]
    for kind in ("volume", "overlaps"):
        for name in hard_cases(kind):
            table.put(name, HardCase(kind, name), flat, verdict, asked)
    for name in hard_cases("distance"):
        table.put(distance_column(name), HardCase("distance", name), pairs, distance_verdict, asked)
    table.write(path, f"seed {chosen.seed}; {results.packages()}")


def questions(seed: int, count: int) -> list[Question]:
    """About so many, from every family that is made of vertices, and from ROUND."""
    asked = [name for name in families.FAMILIES if families_of_vertices(name) or name in ROUND]
    unit = count / sum(SHARE.get(name, 1) for name in asked)
    found = []
    for name in asked:
        for i in range(max(1, round(unit * SHARE.get(name, 1)))):
            case = families.make(name, seed + i)
            bodies = tuple(
                body if isinstance(body, Placed) else np.array(families.points_of(body), float) for body in case.bodies
            )
            if all(isinstance(body, Placed) or len(body) <= LARGEST for body in bodies):
                found.append(Question(case, bodies))
    return found


def families_of_vertices(name: str) -> bool:
    return not any(isinstance(body, (families.Below, Placed)) for body in families.make(name, 0).bodies)


class Columns:
    """A table that grows by a column for each peer, which is asked in a process of its own."""

    def __init__(self, rows: list[dict[str, str]], first: tuple) -> None:
        self.rows, self.first, self.missing = rows, first, []

    def put(self, name: str, answer: Callable, bodies: list[tuple | None], judged: Callable, truths: list) -> None:
        """Adds the answers of a peer about bodies, judged by the truth about them. The peer is not asked about None.

        A peer that knows none of the bodies gets no column. A peer whose package is missing gets an empty one.
        """
        with Watched(answer, TIME_LIMIT, self.first) as peer:
            try:
                answers = [NOT_ASKED if each is None else peer.ask(*each) for each in bodies]
            except ImportError as error:
                self.missing.append(f"missing: {name} ({error.name} is not installed)")
                print(self.missing[-1])
                return self.fill(name, [NOT_ASKED] * len(bodies))
        if set(answers) != {NOT_ASKED}:
            self.fill(name, [judged(truth, answer) for truth, answer in zip(truths, answers)])

    def fill(self, name: str, cells: list[str]) -> None:
        for row, cell in zip(self.rows, cells):
            row[name] = cell

    def write(self, path: Path, note: str) -> None:
        with results.writing(path, list(self.rows[0]), note, *self.missing) as write:
            write(row.values() for row in self.rows)


def described(question: Question) -> dict[str, str]:
    case, distance = question.case, question.signed_distance
    return {
        "family": case.family,
        "seed": str(case.seed),
        "detail": case.detail,
        "parameter": f"{case.parameter:.3g}",
        "bodies": str(len(question.bodies)),
        "common": NOT_ASKED if question.round else exact.NAMES[question.common.dimension],
        "clear": NOT_ASKED if question.round else "yes" if question.clear else "no",
        "volume": NOT_ASKED if question.round else f"{float(question.volume):.6g}",
        "signed distance": NOT_ASKED if distance is None else f"{float(distance):.6g}",
    }
