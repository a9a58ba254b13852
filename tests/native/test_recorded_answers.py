"""Answers of the core as they were recorded: a change of any figure, or of the work it takes, is a line in a diff.

Counts and words are exact, and measures within MEASURES: the inputs are the same on every machine, but libm is not. The
rules that answers must keep are tested elsewhere; here, what keeps the rules and is different all the same is seen: a
bound ten times as wide, a way ten times as long. `pytest tests/native/test_recorded_answers.py --overlapper-record`
writes what is found, for a change that is meant.
"""

from __future__ import annotations

import csv
import pickle
from pathlib import Path
from random import Random

import numpy as np
import pytest
from plain_cases import GROUPS, SHAPES, PlainCase, ball_of_points, cloud, plain_cases, plain_crowds, quaternion, vector

from overlapper import Batch, Box, Hull, Overlap, RoundedHull, overlap, overlaps

RECORDED = Path(__file__).with_name("recorded")
# How far a measure may be off, relative to itself or in SI units, whichever is more; all else is exact.
SIZES = dict.fromkeys(("volume", "area", "reach", "rim"), (1e-11, 1e-17))
# The rounding of determinants differs from processor to processor.
ENCLOSED = {"enclosed": (1e-11, 1e-16)}
LENGTHS = dict.fromkeys(("depth", "distance"), (1e-10, 1e-15))
SUMS = dict.fromkeys(
    (
        "inertia",
        "gradient",
        "normal",
        "centroid",
        "witnesses",
        "plane",
        "bounds",
        "walls",
        "normals",
        "skew",
        "leaning",
    ),
    (1e-10, 1e-13),
)
# Sums of logarithms, in which a sliver weighs as much as a large body.
LOGARITHMS = {"log error": (1e-6, 1e-5)} | dict.fromkeys(
    ("log volume", "log area", "log depth", "log distance", "log reach", "log rim"), (1e-9, 1e-7)
)
# A bound that is twice as wide in one case adds 1 to its sum; what libm changes adds up to less.
ERRORS = ("area", "centroid", "inertia", "vertices", "depth", "distance", "witnesses", "force", "moment")
LOGARITHMS |= dict.fromkeys((f"log error of {name}" for name in ERRORS), (1e-7, 0.02))
LOGARITHMS |= {"log patch distance": (1e-9, 1e-6)}
MEASURES = SIZES | ENCLOSED | LENGTHS | SUMS | LOGARITHMS | {"error": (1e-6, 0.0)}
WEIGHTS = np.array([0.59, 0.83, -0.71, 0.37, 0.97, -0.43, 0.61, -0.89, 0.53])


def as_one(numbers) -> float:
    """Numbers as one that changes with any of them."""
    flat = np.asarray(numbers, float).ravel()
    return float(sum(flat * np.resize(WEIGHTS, len(flat)))) if len(flat) else 0.0


def answer_of(case: PlainCase) -> dict[str, object]:
    try:
        found = overlap(*case.bodies, tolerance=case.tolerance, method=case.method)
    except ValueError as refusal:
        return {"status": str(refusal)}
    row: dict[str, object] = {
        "status": found.status, "way": found.way,
        "widened": found.widened, "touched": found.facets_touched, "planes": planes_asked(case),
        "volume": found.volume, "error": found.volume_error, "area": found.area, "inertia": as_one(found.inertia),
        "gradient": as_one(found.gradient),
    }  # fmt: skip
    if len(case.bodies) == 2:
        row |= {"depth": found.depth, "distance": found.distance, "normal": as_one(found.normal)}
    if found:
        row |= {"centroid": as_one(found.centroid)}
        row |= surface_of(found)
    elif len(case.bodies) == 2:
        row |= {"witnesses": as_one([found.witness_a, found.witness_b]), "plane": as_one(found.separating_plane)}
    return row


def surface_of(found: Overlap) -> dict[str, object]:
    arms, walls = found.vertices - found.centroid, found.halfspaces
    return {
        "corners": len(found.vertices), "facets": len(walls), "around": sum(map(len, found.facets)),
        "owned": int((found.owner == 0).sum()), "patches": len(found.patch),
        "patch": sum(map(len, found.patch)), "reach": float((arms * arms).sum()),
        "enclosed": float(np.linalg.det(arms[found.faces]).sum() / 6), "skew": float(((arms @ WEIGHTS[:3]) ** 3).sum()),
        "walls": float(walls[:, 3].sum()), "leaning": float(walls[:, :3] @ WEIGHTS[3:6] @ (found.owner + 1)),
        "rim": sum(float(np.sqrt(((np.roll(ring, -1, axis=0) - ring) ** 2).sum(axis=1)).sum()) for ring in found.patch),
    }  # fmt: skip


def planes_asked(case: PlainCase) -> int | None:
    """The work of a pair where it is counted, in a batch."""
    if len(case.bodies) != 2:
        return None
    bodies = [(body.shape, body.position, body.orientation) for body in case.bodies]
    shapes, positions, orientations = zip(*bodies)
    found = overlaps(shapes, positions, orientations, pairs=[(0, 1)], tolerance=case.tolerance, method=case.method)
    return found.planes_asked


def hulls() -> dict[str, dict[str, object]]:
    rng = Random("hulls")
    grid = [(x / 4, y / 4, z / 4) for x in range(5) for y in range(5) for z in range(5)]
    clouds = {f"{count} in a cube": cloud(rng, count) for count in (4, 5, 9, 30, 200)}
    clouds |= {f"{count} on a sphere": ball_of_points(rng, count) for count in (12, 100, 1000)}
    clouds |= {
        "a lattice": np.array(grid),
        "a lattice turned": np.array(grid) @ [[0.36, 0.48, -0.8], [-0.8, 0.6, 0], [0.48, 0.64, 0.6]],
    }
    clouds |= {f"a lattice turned, of {size} m": size * clouds["a lattice turned"] for size in (1e-3, 1e3, 1e6)}
    for gap in (1e-17, 1e-15, 1e-13, 1e-9):
        for count in (5, 40):
            flat = cloud(rng, count) * (1, 1, gap)
            clouds[f"{count} on a base {gap} rough"] = np.vstack([flat, flat * (0.5, 0.5, 1) + (0, 0, 1)])
    clouds |= {f"a flake {thin} thick": cloud(rng, 20) * (1, 1, thin) for thin in (1e-6, 1e-10, 1e-13)}
    rows = {}
    for name, points in clouds.items():
        hull = pickle.loads(pickle.dumps(Hull(points)))
        rows[name] = {
            "corners": len(hull.vertices), "exact corners": len(hull.corners), "facets": len(hull.facets),
            "triangles": len(hull.triangles), "around": sum(len(ring) for ring in hull.facets),
            "volume": hull.volume, "centroid": as_one(hull.centroid), "bounds": as_one(hull.bounds),
            "walls": float(hull.halfspaces[:, 3].sum()), "normals": float(abs(hull.halfspaces[:, :3]).sum()),
        }  # fmt: skip
        if len(points) < 100:
            grown = RoundedHull(points, 0.125)
            rows[f"{name}, rounded"] = {
                "volume": grown.volume, "centroid": as_one(grown.centroid), "bounds": as_one(grown.bounds),
            }  # fmt: skip
    return rows


def moving() -> dict[str, dict[str, object]]:
    """A batch that is asked again and again, as some of its bodies move."""
    rng = Random("moving")
    names = ["box", "hull", "ball", "box", "capsule", "fine hull", "cylinder", "hull", "box", "half-space"]
    shapes = [SHAPES[name](rng) for name in names * 2] + [Box((1, 1, 1)), Hull(ball_of_points(rng, 300))]
    where = np.array([vector(rng, 1.6) for _ in shapes])
    turns = np.array([quaternion(rng) for _ in shapes], float)
    # Boxes of other sizes, and a pile of boxes that touch, high up.
    shapes += [Box(np.full(3, 2.0**-k)) for k in range(3, 9)] + [Box((0.25, 0.125, 0.5))] * 6
    where = np.vstack([where, [vector(rng, 1.0) for _ in range(6)], [(k % 2 * 1e-3, 9, 1e3 + k) for k in range(6)]])
    turns = np.vstack([turns, [(0, 0, 0, 1)] * 12])
    batch, rows = Batch(shapes), {}
    for step in range(12):
        found = batch.overlaps(where, turns, threads=1 + step % 3)
        rows[f"step {step}"] = {
            "pairs": len(found), "examined": found.examined, "planes": found.planes_asked,
            "candidates": len(batch.candidate_pairs(where, turns)), "widened": int(found.widened.sum()),
            "touched": int(found.facets_touched.sum()), "volume": float(found.volume.sum()),
            "error": float(found.volume_error.sum()), "area": float(found.area.sum()),
            "depth": float(found.depth.sum()), "normal": as_one(found.normal), "gradient": as_one(found.gradient),
        }  # fmt: skip
        for i in range(len(shapes) - 6):
            if rng.random() < (0.0 if step == 3 else 0.4):
                where[i] += vector(rng, rng.choice([1e-9, 1e-2, 0.5]))
                if rng.random() < 0.5:
                    turns[i] += [rng.uniform(-0.1, 0.1) for _ in range(4)]
    return rows


def crowds() -> dict[str, dict[str, object]]:
    """The answers of all cases of a sort, added up."""
    sorts: dict[str, list[dict[str, object]]] = {}
    for case in plain_crowds():
        sorts.setdefault(case.name, []).append(answer_of(case))
    return {name: together(answers) for name, answers in sorts.items()}


def together(answers: list[dict[str, object]]) -> dict[str, object]:
    row: dict[str, object] = {}
    for column in ("status", "way"):
        words = [str(answer[column]) for answer in answers]
        row[column] = ", ".join(f"{words.count(word)} {word}" for word in sorted(set(words)))
    for column in dict.fromkeys(column for answer in answers for column in answer):
        values = [answer[column] for answer in answers if isinstance(answer.get(column), (int, float))]
        if f"log {column}" in LOGARITHMS:
            row[f"log {column}"] = float(sum(np.log2(value) for value in values if value > 0))
        elif values:
            row[column] = sum(values)
    return row


def errors() -> dict[str, dict[str, object]]:
    """All error bounds, and the patch's mean distance, of the cases of a group that were measured in the same way."""
    sorts: dict[str, list[dict[str, object]]] = {}
    for case in (each for group in GROUPS for each in plain_cases(group)):
        try:
            found = overlap(*case.bodies, tolerance=case.tolerance, method=case.method)
        except ValueError:
            continue
        sorts.setdefault(f"{found.status} by {found.way}", []).append(errors_of(found))
    for case in plain_crowds(4):
        found = overlap(*case.bodies, tolerance=case.tolerance, method=case.method)
        sorts.setdefault(case.name, []).append(errors_of(found))
    return {name: sums_of_logarithms(rows) for name, rows in sorts.items()}


def errors_of(found: Overlap) -> dict[str, float]:
    stated = {name: getattr(found.errors, name, None) for name in ERRORS}
    stated |= {"force": found.errors.gradient[:, :3].sum(), "moment": found.errors.gradient[:, 3:].sum()}
    row = {f"log error of {name}": value for name, value in stated.items() if value}
    return row | ({"log patch distance": found.patch_distance} if found.patch_distance else {})


def sums_of_logarithms(rows: list[dict[str, float]]) -> dict[str, object]:
    columns = dict.fromkeys(column for row in rows for column in row)
    return {"cases": len(rows)} | {
        column: float(sum(np.log2(row[column]) for row in rows if column in row)) for column in columns
    }


def of_group(group: str) -> dict[str, dict[str, object]]:
    return {case.name: answer_of(case) for case in plain_cases(group)}


def written(value: object) -> str:
    return "" if value is None else f"{value:.17g}" if isinstance(value, float) else str(value)


def is_as_recorded(column: str, found: str, recorded: str) -> bool:
    if found == recorded:
        return True
    if column not in MEASURES or not (found and recorded):
        return False
    relative, absolute = MEASURES[column]
    return abs(float(found) - float(recorded)) <= max(relative * abs(float(recorded)), absolute)


@pytest.mark.parametrize("group", [*GROUPS, "hulls", "moving", "crowds", "errors"])
def test_answers_are_as_they_were_recorded(group, request):
    rows = {"hulls": hulls, "moving": moving, "crowds": crowds, "errors": errors}.get(group, lambda: of_group(group))()
    columns = list(dict.fromkeys(["case", *(column for row in rows.values() for column in row)]))
    file = RECORDED / f"{group}.csv"
    recorded: dict[str, dict[str, str]] = {}
    if file.exists():
        with file.open(newline="") as lines:
            recorded = {row["case"]: row for row in csv.DictReader(lines)}
    found = {name: {column: written(row.get(column)) for column in columns[1:]} for name, row in rows.items()}
    changed = {
        name: [
            f"{name}: {column} is {row[column]}, recorded {recorded.get(name, {}).get(column)}"
            for column in columns[1:]
            if not is_as_recorded(column, row[column], recorded.get(name, {}).get(column) or "")
        ]
        for name, row in found.items()
    }
    if request.config.getoption("overlapper_record"):
        file.parent.mkdir(exist_ok=True)
        with file.open("w", newline="") as out:
            writer = csv.DictWriter(out, columns, lineterminator="\n")
            writer.writeheader()
            for name, row in found.items():
                # A row keeps its digits if it is as recorded.
                kept = recorded[name] if name in recorded and not changed[name] else {"case": name} | row
                writer.writerow({column: kept.get(column, "") for column in columns})
        return
    assert list(rows) == list(recorded)
    all_changed = [line for lines in changed.values() for line in lines]
    assert not all_changed, "\n".join(all_changed[:20])
