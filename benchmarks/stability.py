"""Who fails where: hard cases with exact answers, put to each peer in a process of its own.

    python benchmarks/stability.py                   all cases again, then the page and its pictures
    python benchmarks/stability.py --page            only the page and its pictures, from the results there are

Writes DIR/results/stability.csv (a case a line) and what benchmarks/stability_page.py makes of it. The cases are those
of tests/support/families.py made of vertices alone, so that every peer can be given them, and contacts of round bodies,
of which only depths and distances are asked. The truth is exact: rational arithmetic on the doubles that the peers get.
"""

from __future__ import annotations

import argparse
import csv
import inspect
import sys
from collections.abc import Callable, Iterator
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path[:0] = [str(HERE), str(HERE / "paper"), str(ROOT / "tests" / "support")]

try:
    import distance_peers
    import exact
    import families
    import numpy as np
    from distance_peers import DISTANCE_PEERS
    from paper_steps import lost_at, lost_given_a_point, volume_without_exact_signs
    from peers import PEERS
    from stability_results import NOT_ASKED, RIGHT, Question, distance_column, distance_verdict, failed, verdict
    from watched import Watched

    from overlapper import Placed
except ImportError as error:
    print(f"overlapper: the stability chart needs {error.name}: pip install '.[bench]'", file=sys.stderr)
    sys.exit(2)

RESULTS = HERE / "results" / "stability.csv"

TIME_LIMIT = 10.0  # s, for a question

# Vertices of one body, so that the exact truth stays a matter of seconds.
LARGEST = 170

# Families whose parameter runs over many decades get more cases, so that each decade has some.
DECADES = ("slivers", "tilted_slivers", "nearly_touching", "needles_and_plates", "far_away", "scaled", "round_contacts")
SHARE = dict.fromkeys(DECADES, 3)

# Families with round bodies whose signed distance is known.
ROUND = ("round_contacts",)

Judge = Callable[[Question, Any], str]

# A question without difficulty, asked before time counts.
FIRST = (families.CORNERS, families.CORNERS + 1.0)


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


def takes(answer: Callable[..., float | bool], question: Question) -> bool:
    """Whether a peer can be asked for what bodies have in common: they have vertices, and are not too many."""
    parameters = inspect.signature(answer).parameters.values()
    as_many = len(question.bodies) == len(parameters) or any(p.kind is p.VAR_POSITIONAL for p in parameters)
    return as_many and not question.round


# The run


def run(seed: int, count: int, path: Path) -> None:
    asked = questions(seed, count)
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [described(question) for question in asked]
    missing = []

    def put(name: str, answer: Callable[..., Any], fits: Callable[[Question], bool], judged: Judge) -> None:
        column = []
        with Watched(answer, TIME_LIMIT, FIRST) as peer:
            try:
                for question in tracked(asked, name):
                    column.append(judged(question, peer.ask(*question.bodies)) if fits(question) else NOT_ASKED)
            except ImportError as error:
                missing.append(f"{name} ({error.name} is not installed)")
                column = [NOT_ASKED] * len(asked)
        for row, cell in zip(rows, column):
            row[name] = cell

    for name, volume in PEERS.items():
        put(name, volume, partial(takes, volume), verdict)
    for name, distance in DISTANCE_PEERS.items():
        put(distance_column(name), distance, lambda question: question.signed_distance is not None, distance_verdict)
    put("way", distance_peers.way, lambda question: True, lambda _, answer: answer)
    for row, question in zip(rows, tracked(asked, "steps")):
        row["paper lost at"] = lost_at(*question.bodies) if failed(row["paper"]) else NOT_ASKED
        solid = not question.round and question.clear and question.common.dimension == 3
        row["given a point"] = lost_given_a_point(question.bodies, question.common) or RIGHT if solid else NOT_ASKED
        row["and by qhull"] = by_qhull(question) if solid else NOT_ASKED
    with path.open("w", newline="", encoding="utf-8") as file:
        file.write(f"# seed {seed}; {packages()}\n")
        for line in missing:
            file.write(f"# missing: {line}\n")
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    print(f"Written: {path}", *(f"Missing: {line}" for line in missing), sep="\n")


def by_qhull(question: Question) -> str:
    try:
        return verdict(question, volume_without_exact_signs(question.bodies, question.common))
    except Exception as error:
        return f"raises {type(error).__name__}"


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


def packages(*more: str) -> str:
    names = ["overlapper", "numpy", "scipy", "manifold3d", "trimesh", "python-fcl", "coal", "pybullet", *more]
    found = []
    for name in names:
        try:
            found.append(f"{name} {version(name)}")
        except ModuleNotFoundError:
            found.append(f"{name} missing")
    return ", ".join(found)


def tracked(items: list[Any], name: str) -> Iterator[Any]:
    """The items, counted on stderr if that is a terminal."""
    for i, item in enumerate(items):
        if sys.stderr.isatty() and i % 20 == 0:
            print(f"\r{name}: {i} of {len(items)}   ", end="", file=sys.stderr, flush=True)
        yield item
    if sys.stderr.isatty():
        print("\r" + " " * 40 + "\r", end="", file=sys.stderr)


def main() -> None:
    parser = argparse.ArgumentParser(description="Who fails where: hard cases with exact answers, put to each peer.")
    parser.add_argument("--seed", type=int, default=0, help="of the first case of each family")
    parser.add_argument("--count", type=int, default=2000, help="about so many cases")
    parser.add_argument("--out", type=Path, help="folder for results and page, by default those of the checkout")
    parser.add_argument("--page", action="store_true", help="only draw the page, from the results there are")
    chosen = parser.parse_args()
    results = chosen.out / "stability.csv" if chosen.out else RESULTS
    if not chosen.page:
        run(chosen.seed, chosen.count, results)
    try:
        from stability_page import write_page
    except ImportError as error:
        print(f"overlapper: the pictures need {error.name}: pip install '.[bench]'", file=sys.stderr)
        sys.exit(2)
    print(f"Written: {write_page(results, chosen.out or ROOT / 'docs')}")


if __name__ == "__main__":
    main()
