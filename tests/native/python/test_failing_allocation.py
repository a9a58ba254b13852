"""A refused request for memory is a MemoryError. The process goes on, and no answer is wrong, then or later."""

import ctypes
import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from overlapper import Batch, Box, Capsule, Cylinder, HalfSpace, Hull, Overlap, Placed, RoundedHull, Sphere, overlap

SOURCE = Path(__file__).parents[2] / "support" / "failing_allocation.c"

# Every request is refused in turn up to this one, and further on one in twenty.
EVERY = 400

RNG = np.random.default_rng(0)
POINTS, MANY = RNG.normal(size=(30, 3)), RNG.normal(size=(150, 3))
TURNED = ((0.3, 0.2, 0.1), (1, 2, 3, 4))
SHAPES = [Box([0.5, 0.5, 0.5]), Hull(POINTS), Sphere(0.7), Cylinder(0.3, 1)] * 3
POSES = RNG.normal(size=(12, 3)), RNG.normal(size=(12, 4))


def figures(found: Overlap) -> list:
    """All that can be asked of an overlap, as it can be compared."""
    names = ("status", "way", "volume", "volume_error", "area", "centroid", "inertia", "gradient", "depth", "normal")
    names += ("distance", "witness_a", "witness_b", "vertices", "halfspaces", "owner")
    return [as_compared(getattr(found, name)) for name in names] + [ring.tolist() for ring in found.patch]


def as_compared(value):
    """Bytes of arrays, as NaN differs from itself, and as numpy's text may raise a SystemError for want of memory."""
    return value.tobytes() if isinstance(value, np.ndarray) else value


def of_many(batch: Batch) -> list:
    found = batch.overlaps(*POSES, tolerance=0.1, threads=1)
    return [as_compared(array) for array in (found.pairs, found.volume, found.depth, found.gradient)]


def kept_row() -> Overlap:
    """One that took long, so that its batch keeps it."""
    batch = Batch(LONG)
    found = batch.overlaps([[0, 0, 0], [0.3, 0.2, 0.1]], [[0, 0, 0, 1], [1, 2, 3, 4]], tolerance=0.1, threads=1)
    return found[0]


LONG = [Cylinder(0.3, 1), Hull(POINTS)]
WARM = Batch(SHAPES)

SCENES = {
    "boxes": lambda: figures(overlap(Box([1, 1, 1]), Placed(Box([1, 1, 1]), *TURNED))),
    "hulls": lambda: figures(overlap(Hull(POINTS), Placed(Hull(POINTS), *TURNED))),
    "many facets": lambda: figures(overlap(Hull(MANY), Placed(Hull(MANY), *TURNED))),
    "a sliver": lambda: figures(overlap(Hull(POINTS), Placed(Hull(-POINTS), tuple(1.999999999 * POINTS[0])))),
    "apart": lambda: figures(overlap(POINTS, POINTS + 20)),
    "balls": lambda: figures(overlap(Sphere(1), Placed(Sphere(1), (1.5, 0, 0)), tolerance=0.1)),
    "a capsule in a half-space": lambda: figures(overlap(Capsule(1, 1), HalfSpace([0, 1, 1], 0), tolerance=0.1)),
    "a cylinder and a box": lambda: figures(overlap(Cylinder(1, 1), Placed(Box([1, 1, 1]), *TURNED), tolerance=0.1)),
    "rounded hulls": lambda: figures(
        overlap(RoundedHull(POINTS, 0.1), Placed(RoundedHull(POINTS, 0.1), *TURNED), tolerance=0.1)
    ),
    "three bodies": lambda: [
        overlap(POINTS, POINTS + 0.1, Placed(Sphere(2), (1, 1, 1)), tolerance=0.1).vertices.tolist()
    ],
    "by the article": lambda: figures(overlap(POINTS, POINTS + 0.1, method="paper")),
    "a proof": lambda: [repr(overlap(POINTS[:6], POINTS[:6] + 0.1).certificate().verify())],
    "a batch": lambda: of_many(Batch(SHAPES)),
    "a batch once more": lambda: of_many(WARM),
    "a row of a batch": lambda: figures(
        Batch(SHAPES[:4]).overlaps(POSES[0][:4], POSES[1][:4], tolerance=0.1, threads=1)[0]
    ),
    "a row that its batch has, too": lambda: figures(kept_row()),
}


def report(name: str) -> Counter:
    """Counts the outcomes of a scene and of its repetition, with each request for memory refused in turn."""
    refuse_allocation = ctypes.PyDLL(None).refuse_allocation
    refuse_allocation.argtypes, refuse_allocation.restype = [ctypes.c_long], ctypes.c_long
    scene, number, came = SCENES[name], 0, Counter()
    wanted = scene()
    while True:
        number += 1 if number < EVERY else number // 20
        refuse_allocation(number)
        try:
            found = "as ever" if scene() == wanted else "wrong"
        except MemoryError:
            found = "MemoryError"
        except BaseException as error:
            found = type(error).__name__
        if refuse_allocation(0):
            return came
        came[found] += 1
        came["again as ever" if scene() == wanted else "wrong afterwards"] += 1


@pytest.fixture(scope="module")
def refusing(tmp_path_factory):
    library = tmp_path_factory.mktemp("refusing") / "refusing.so"
    subprocess.run(["cc", "-O1", "-shared", "-fPIC", "-o", library, SOURCE, "-ldl"], check=True)
    return {**os.environ, "LD_PRELOAD": str(library)}


@pytest.mark.parametrize("name", SCENES)
def test_the_nth_request_for_memory_that_is_refused_is_a_memory_error(refusing, name):
    program = f"import json, {__name__} as t; print(json.dumps(t.report({name!r})))"
    process = subprocess.run(
        [sys.executable, "-c", program],
        env={**refusing, "PYTHONPATH": str(Path(__file__).parent)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert process.returncode == 0, process.stderr
    came = json.loads(process.stdout)
    # numpy raises these two for want of memory where arrays hold objects.
    of_numpy = {"SystemError", "IndexError"} if name == "a proof" else set()
    assert came.keys() <= {"MemoryError", "as ever", "again as ever"} | of_numpy
    assert came["MemoryError"] > 20
