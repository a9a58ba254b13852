"""FCL beside ours: it agrees where it can, its crashes are answers, and the arbiter decides disagreements."""

import itertools
import os
import re
import signal
import subprocess
import sys
import textwrap

import numpy as np
import pytest
from strategies import hull_points, moved, quaternion

from overlapper import Box, Capsule, Cylinder, HalfSpace, Hull, Placed, Sphere, overlap, reference
from overlapper.reference import TOLERANCE, Fcl

CUBE = Box([0.5, 0.5, 0.5])

KINDS = {
    "box": lambda rng: Box(rng.uniform(0.2, 1.0, 3)),
    "sphere": lambda rng: Sphere(rng.uniform(0.2, 1.0)),
    "capsule": lambda rng: Capsule(*rng.uniform(0.2, 1.0, 2)),
    "cylinder": lambda rng: Cylinder(*rng.uniform(0.2, 1.0, 2)),
    "hull": lambda rng: Hull(hull_points(rng, 30)),
    "half_space": lambda rng: HalfSpace(rng.normal(size=3), rng.uniform(-1.0, 1.0)),
}
COMBINATIONS = [pair for pair in itertools.combinations_with_replacement(KINDS, 2) if pair != ("half_space",) * 2]

# FCL 0.7 throws "The origin is outside of the polytope" out of the signed distance of these.
KILLER = (Placed(CUBE), Placed(CUBE, (1.0 - 1e-9, 0.75, -1.0)))


class Claim:
    """An overlap that says what it is told to say."""

    def __init__(self, a, b, signed_distance, normal):
        self.shapes, self.normal = (a, b), np.asarray(normal, float)
        self.depth, self.distance = max(-signed_distance, 0.0), max(signed_distance, 0.0)

    def __bool__(self):
        return self.depth > 0.0


@pytest.fixture(scope="module")
def fcl():
    with Fcl() as referee:
        yield referee


def random_overlaps(kinds, seed, count=6):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield overlap(*(Placed(KINDS[kind](rng), rng.uniform(-1, 1, 3), quaternion(rng)) for kind in kinds))


@pytest.mark.parametrize("kinds", COMBINATIONS, ids="-".join)
def test_fcl_agrees_or_is_wrong(fcl, kinds):
    """FCL ends its distance search early beside curved shapes: always too far, by less than 1e-3 m at this size."""
    comparisons = fcl.compare_many(random_overlaps(kinds, seed=len(kinds[0]) * 31 + len(kinds[1])))
    for comparison in comparisons:
        if comparison.verdict == "disagree":
            assert comparison.nearer == "ours", comparison.explanation
            assert comparison.ours.signed_distance > 0.0 and {"sphere", "capsule", "cylinder"} & set(kinds)
            assert 0.0 < comparison.theirs.signed_distance - comparison.ours.signed_distance < 1e-3
        else:
            assert comparison.verdict == "agree", comparison.explanation
    assert any(comparison.verdict == "agree" for comparison in comparisons)


@pytest.mark.parametrize("kinds", [pair for pair in COMBINATIONS if "half_space" not in pair], ids="-".join)
def test_depths_agree_within_the_tolerance_of_fcl(fcl, kinds):
    rng = np.random.default_rng(7)
    bodies = [Placed(KINDS[kind](rng), (0.1 * i, 0.05, 0.0), quaternion(rng)) for i, kind in enumerate(kinds)]
    comparison = fcl.compare(overlap(*bodies))
    assert comparison.verdict == "agree", comparison.explanation
    assert comparison.ours.overlapping and comparison.theirs.overlapping
    assert abs(comparison.ours.signed_distance - comparison.theirs.signed_distance) <= TOLERANCE


def test_a_half_space_has_a_depth_but_no_distance_in_fcl(fcl):
    floor = Placed(HalfSpace((0, 0, 1), 0.2))
    deep, apart = fcl.compare_many(overlap(Placed(CUBE, (0, 0, z)), floor) for z in (0.5, 3.0))
    assert deep.theirs.overlapping and deep.theirs.signed_distance == pytest.approx(-0.2, abs=1e-15)
    assert not apart.theirs.overlapping and apart.theirs.signed_distance is None
    assert (deep.verdict, apart.verdict) == ("agree", "agree")


def test_a_pair_that_ends_the_process_is_reported_and_the_next_is_answered(fcl):
    crashed = fcl.compare(overlap(*KILLER))
    assert crashed.verdict == "crashed"
    assert crashed.theirs.overlapping and crashed.theirs.signed_distance is None
    assert "SIGABRT" in crashed.explanation and "origin is outside of the polytope" in crashed.explanation
    assert max(map(abs, crashed.exact)) < 1e-15
    assert fcl.compare(overlap(Placed(CUBE), Placed(CUBE, (0.75, 0, 0)))).verdict == "agree"


def test_a_crash_in_a_batch_costs_only_its_own_pair(fcl):
    gaps = [0.1, None, 0.2, None, None, 0.3]
    pairs = [KILLER if gap is None else (Placed(CUBE), Placed(CUBE, (1.0 + gap, 0, 0))) for gap in gaps]
    comparisons = fcl.compare_many(overlap(*pair) for pair in pairs)
    assert [c.verdict for c in comparisons] == ["crashed" if gap is None else "agree" for gap in gaps]
    assert [c.theirs.signed_distance for c in comparisons] == [gap and pytest.approx(gap, abs=1e-9) for gap in gaps]


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="a process cannot be stopped on this system")
def test_a_process_that_hangs_is_given_up_after_the_time_limit():
    cubes = overlap(Placed(CUBE), Placed(CUBE, (0.75, 0, 0)))
    with Fcl(time_limit=0.2) as fcl:
        assert fcl.compare(cubes).verdict == "agree"
        os.kill(fcl._worker.process.pid, signal.SIGSTOP)
        stopped = fcl.compare(cubes)
        assert stopped.verdict == "crashed" and stopped.theirs is None
        assert "no answer within 0.2 s" in stopped.explanation
        assert fcl.compare(cubes).verdict == "agree"


def test_a_process_killed_between_two_questions_is_started_again():
    cubes = overlap(Placed(CUBE), Placed(CUBE, (0.75, 0, 0)))
    with Fcl() as fcl:
        fcl.compare(cubes)
        fcl._worker.process.kill()
        fcl._worker.process.wait()
        assert fcl.compare(cubes).verdict == "agree"


def test_leaving_the_block_ends_the_process():
    with Fcl() as fcl:
        fcl.compare(overlap(Placed(CUBE), Placed(CUBE, (0.75, 0, 0))))
        process = fcl._worker.process
        assert process.poll() is None
    assert process.returncode is not None


def test_a_script_needs_no_main_guard_and_leaves_no_process(tmp_path):
    script = tmp_path / "check.py"
    script.write_text(
        textwrap.dedent("""
            from overlapper import Sphere, overlap, Placed
            from overlapper.reference import Fcl
            fcl = Fcl()
            print(fcl.compare(overlap(Sphere(1.0), Placed(Sphere(1.0), (1.5, 0, 0)))).verdict)
            print(fcl._worker.process.pid)
        """)
    )
    run = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True, timeout=60)
    verdict, pid = run.stdout.split()
    assert verdict == "agree" and run.stderr == ""
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid), 0)


def test_cubes_of_a_tenth_of_a_millimetre_that_fcl_calls_apart_are_decided_for_us(fcl):
    """FCL takes a gain below 1e-6 m for none, whatever the size of the bodies."""
    size, rng = 1e-4, np.random.default_rng(0)
    cube = Placed(Box([size / 2] * 3))
    shifts = [np.array([0.9, *rng.uniform(-0.5, 0.5, 2)]) * size for _ in range(8)]
    turns = [quaternion(rng) for _ in shifts]
    pairs = [(moved(cube, orientation=q), moved(moved(cube, shift), orientation=q)) for shift, q in zip(shifts, turns)]
    comparisons = fcl.compare_many(overlap(*pair) for pair in pairs)
    assert all(c.ours.signed_distance == pytest.approx(-1e-5, rel=1e-9) for c in comparisons)
    lost = [c for c in comparisons if c.theirs.signed_distance > 0.0]
    assert len(lost) > 0
    for comparison in lost:
        assert (comparison.verdict, comparison.nearer) == ("disagree", "ours")
        assert comparison.exact == pytest.approx((-1e-5, -1e-5), rel=1e-9)


def test_touching_cubes_agree_and_the_sentence_says_why(fcl):
    touching = fcl.compare(overlap(Placed(CUBE), Placed(CUBE, (1.0, 0.3, 0.2))))
    assert touching.verdict == "agree"
    assert touching.theirs.overlapping and not touching.ours.overlapping
    assert "touching" in touching.explanation and touching.exact[0] <= 0.0 <= touching.exact[1]


@pytest.mark.parametrize(
    ("claimed", "winner"), [(-0.25, None), (-0.2, "fcl"), (-0.3, "fcl"), (0.1, "fcl"), (-0.25 - 1e-5, "fcl")]
)
def test_a_wrong_claim_of_ours_loses(fcl, claimed, winner):
    comparison = fcl.compare(Claim(Placed(CUBE), Placed(CUBE, (0.75, 0.1, 0.2)), claimed, (-1, 0, 0)))
    assert comparison.verdict == ("disagree" if winner else "agree")
    assert comparison.nearer == winner
    if winner:
        assert "so FCL is nearer" in comparison.explanation
        assert comparison.exact == pytest.approx((-0.25, -0.25), abs=1e-3 * abs(claimed + 0.25))


def test_a_wrong_yes_beside_a_half_space_loses_without_a_distance(fcl):
    ball, floor = Placed(Sphere(0.5), (0, 0, 0.6)), Placed(HalfSpace((0, 0, 1), 0.0))
    comparison = fcl.compare(Claim(ball, floor, -0.1, (0, 0, 1)))
    assert (comparison.verdict, comparison.nearer, comparison.theirs.signed_distance) == ("disagree", "fcl", None)


def test_pairs_that_fcl_cannot_answer_are_unsupported(fcl):
    three = overlap(Placed(CUBE), Placed(CUBE, (0.1, 0, 0)), Placed(CUBE, (0.2, 0, 0)))
    planes = Claim(Placed(HalfSpace((0, 0, 1), 0.0)), Placed(HalfSpace((0, 0, -1), -1.0)), 1.0, (0, 0, -1))
    pair = overlap(Placed(CUBE), Placed(CUBE, (0.75, 0, 0)))
    comparisons = fcl.compare_many([three, pair, planes])
    assert [c.verdict for c in comparisons] == ["unsupported", "agree", "unsupported"]
    assert "two bodies" in comparisons[0].explanation and "half-spaces" in comparisons[2].explanation


def test_every_explanation_is_one_sentence(fcl):
    pairs = [KILLER, (Placed(CUBE), Placed(CUBE, (0.75, 0, 0))), (Placed(CUBE), Placed(CUBE, (1, 0.3, 0.2)))]
    for comparison in fcl.compare_many(overlap(*pair) for pair in pairs):
        assert comparison.explanation.endswith(".")
        assert "\n" not in comparison.explanation


def test_without_python_fcl_one_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setattr(reference, "fcl", None)
    with pytest.raises(ImportError, match=re.escape("overlapper.reference needs python-fcl: pip install python-fcl")):
        Fcl()
