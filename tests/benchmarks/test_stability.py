"""The stability benchmark: what counts as a failure, and that a peer which ends its process costs no other case."""

import errno
import os
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import families
import numpy as np
import pytest

from harness import command, peers, results
from harness.watched import Watched
from overlapper import Box, Capsule, Cylinder, HalfSpace, Placed, RoundedHull, Sphere
from overlapper.cli import bench
from stability import hard_cases, judging
from stability import page as stability_page

ROOT = Path(__file__).parents[2]

CUBE = families.CORNERS

coal = peers.HardCase("distance", "coal")


def question(*bodies):
    return judging.Question(families.Case("", 0.0, bodies), bodies)


DEEP = question(CUBE, CUBE + [1.5, 0.25, 0.5])  # 0.5 x 1.75 x 1.5
APART = question(CUBE, CUBE + [2.5, 0.0, 0.0])
TOUCHING = question(CUBE, CUBE + [2.0, 0.25, 0.5])


# Peers that misbehave; functions of this module, so that another process can import them.


def aborts_when_apart(a: np.ndarray, b: np.ndarray) -> bool:
    if (a.max(0) < b.min(0)).any():
        os.abort()
    return True


def hangs_when_apart(a: np.ndarray, b: np.ndarray) -> bool:
    if (a.max(0) < b.min(0)).any():
        time.sleep(60)
    return True


def raises(a: np.ndarray, b: np.ndarray) -> bool:
    raise ZeroDivisionError


def is_not_installed(a: np.ndarray, b: np.ndarray) -> bool:
    import a_package_that_nobody_has  # noqa: F401

    return True


def test_right_answers_are_no_failures():
    volume = 0.5 * 1.75 * 1.5
    assert judging.verdict(DEEP, volume * (1 + 1e-9)) == "1.0e-09"
    assert not judging.failed("1.0e-09")
    assert judging.verdict(DEEP, True) == judging.verdict(APART, False) == judging.verdict(APART, 0.0) == "ok"


@pytest.mark.parametrize(
    ("asked", "answer", "words"),
    [
        (DEEP, 0.0, "missed"),
        (DEEP, False, "missed"),
        (DEEP, 1.3, "9.5e-03"),
        (DEEP, float("nan"), "not finite"),
        (DEEP, -1.3125, "2.0e+00"),
        (APART, True, "phantom"),
        (APART, 1e-30, "phantom"),
        (TOUCHING, 1e-6, "phantom"),
        (TOUCHING, "crash SIGABRT", "crash SIGABRT"),
    ],
)
def test_wrong_answers_are_failures(asked, answer, words):
    assert judging.verdict(asked, answer) == words
    assert judging.failed(words)


def test_bodies_that_touch_may_be_said_to_overlap_or_not():
    assert [judging.verdict(TOUCHING, answer) for answer in (True, False, 0.0, 1e-13)] == ["ok"] * 4


@pytest.mark.parametrize(("depth", "clear"), [(1e-11, True), (1e-13, False), (-1e-13, False), (-1e-10, True)])
def test_yes_and_no_are_judged_beyond_a_margin_of_the_size(depth, clear):
    assert question(CUBE, CUBE + [2 - depth, 0.25, 0.5]).clear is clear


@pytest.mark.parametrize(
    ("asked", "answer", "words"),
    [
        (DEEP, -0.5, "0.0e+00"),
        (DEEP, -0.5 * (1 + 1e-9), "1.0e-09"),
        (APART, 0.5, "0.0e+00"),
        (TOUCHING, 0.0, "ok"),
        (TOUCHING, -1e-12, "ok"),
    ],
)
def test_right_depths_and_distances_are_no_failures(asked, answer, words):
    assert judging.distance_verdict(asked, answer) == words
    assert not judging.failed(words)


@pytest.mark.parametrize(
    ("asked", "answer", "words"),
    [
        (DEEP, -0.51, "2.0e-02"),
        (DEEP, 0.0, "missed"),
        (DEEP, 0.5, "missed"),
        (APART, -0.5, "phantom"),
        (APART, 0.0, "phantom"),
        (TOUCHING, 1e-6, "missed"),
        (TOUCHING, -1e-6, "phantom"),
        (APART, float("nan"), "no answer"),
        (DEEP, -np.finfo(float).max, "no answer"),
        (DEEP, "hang", "hang"),
    ],
)
def test_wrong_depths_and_distances_are_failures(asked, answer, words):
    assert judging.distance_verdict(asked, answer) == words
    assert judging.failed(words)


# As much as pybullet can tell, which of all of these libraries asks with the least digits.
ROUGH = 1e-3

ROUND = [
    (Placed(Sphere(0.5), (0, 0, 1.25)), -0.25),
    (Placed(Capsule(0.5, 1), (0, 0, 2.25)), 0.25),
    (Placed(Cylinder(0.5, 1), (0, 0, 1.25)), -0.25),
]


@pytest.mark.parametrize("name", [name for name in peers.PEERS["distance"] if "coal" not in name])
def test_each_library_is_asked_for_depths_and_distances_of_every_kind_of_body(name):
    answer = peers.HardCase("distance", name)
    assert answer(*DEEP.bodies) == pytest.approx(-0.5, abs=ROUGH)
    assert answer(*APART.bodies) == pytest.approx(0.5, abs=ROUGH)
    for body, distance in ROUND:
        assert answer(CUBE, body) == pytest.approx(distance, abs=ROUGH)
        assert answer(body, CUBE) == pytest.approx(distance, abs=ROUGH)


class Anything:
    """An object that takes any arguments."""

    def __init__(self, *_: object, **__: object) -> None: ...


def coal_that_answers(monkeypatch, answer):
    """A stand-in for coal that does as `answer(request)` says, and what it was given."""
    given = []

    class Request:
        gjk_max_iterations, epa_max_iterations = 128, 64

    def kept(name):
        return lambda *arguments, **_: given.append((name, *arguments)) or name

    fake = SimpleNamespace(
        DistanceRequest=Request,
        DistanceResult=Anything,
        StdVec_Vec3s=list,
        ConvexBase=SimpleNamespace(convexHull=kept("hull")),
        Transform3s=type("Transform3s", (Anything,), {"Identity": staticmethod(lambda: None)}),
        Sphere=kept("sphere"),
        Capsule=kept("capsule"),
        Cylinder=kept("cylinder"),
        distance=lambda one, at, other, there, request, result: answer(request),
    )
    monkeypatch.setitem(sys.modules, "coal", fake)
    return given


def test_coal_is_asked_with_the_shapes_and_the_tolerance_that_are_meant(monkeypatch):
    for name, tolerance in (("coal", 1e-6), ("coal, 1e-12", 1e-12)):
        given = coal_that_answers(monkeypatch, lambda request: request.epa_tolerance + request.gjk_tolerance)
        for body, _ in ROUND:
            assert peers.HardCase("distance", name)(CUBE, body) == 2 * tolerance
        kinds = [("sphere", 0.5), ("capsule", 0.5, 1), ("cylinder", 0.5, 1)]
        assert [each for each in given if each[0] != "hull"] == kinds


def test_coal_grows_the_core_of_a_rounded_hull(monkeypatch):
    coal_that_answers(monkeypatch, lambda _: -0.5)
    radii = []
    grown = SimpleNamespace(setSweptSphereRadius=radii.append)
    monkeypatch.setattr(sys.modules["coal"].ConvexBase, "convexHull", lambda *_: grown)
    assert coal(CUBE, Placed(RoundedHull(CUBE, 0.125))) == -0.5
    assert radii == [0.125]


def test_a_coal_answer_that_changes_with_more_iterations_counts_as_no_answer(monkeypatch):
    coal_that_answers(monkeypatch, lambda request: 1 / request.gjk_max_iterations)
    assert coal(*DEEP.bodies) == "out of iterations"
    coal_that_answers(monkeypatch, lambda request: -np.finfo(float).max / request.gjk_max_iterations)
    assert judging.distance_verdict(DEEP, coal(*DEEP.bodies)) == "no answer"


def test_pybullet_that_finds_no_points_has_no_answer(monkeypatch):
    import pybullet

    monkeypatch.setattr(pybullet, "getClosestPoints", lambda *_: ())
    assert peers.HardCase("distance", "pybullet")(*DEEP.bodies) == "no answer"


TURNED = (0.5, 0.5, 0.5, 0.5)  # x to y, y to z, z to x
POSED = [
    (Placed(Capsule(0.5, 1), (1.75, 0, 0), TURNED), -0.25),
    (Placed(Cylinder(0.5, 2), (1.75, 0, 0), TURNED), -0.25),
]


@pytest.mark.parametrize("name", [name for name in peers.PEERS["distance"] if "coal" not in name])
def test_each_library_is_asked_about_boxes_and_other_bodies_at_poses(name):
    answer, box = peers.HardCase("distance", name), Placed(Box([0.5, 1.0, 2.0]), (0, 0, 0), TURNED)
    upright = Placed(Box([1, 1, 1]))
    for body, distance in POSED:
        assert answer(upright, body) == pytest.approx(distance, abs=ROUGH)
    assert answer(box, Placed(Sphere(0.5), (0, 0.75, 0))) == pytest.approx(-0.25, abs=ROUGH)


def test_libraries_that_lack_a_shape_are_not_asked():
    ball, hull = Placed(Sphere(1.0)), Placed(RoundedHull(CUBE, 0.1))
    for name in ("fcl", "pybullet"):
        for other in (Placed(HalfSpace([0, 0, 1], 0)), hull):
            assert peers.HardCase("distance", name)(ball, other) == peers.NOT_ASKED


def test_kinds_of_failures_are_told_apart():
    cells = ["2.0e-02", "missed", "phantom", "no answer", "out of iterations", "raises ValueError", "crash 1", "hang"]
    assert [stability_page.kind(cell) for cell in cells] == [stability_page.WRONG, *stability_page.KINDS]


def test_a_crash_and_a_hang_are_answers_and_the_next_case_is_asked_again():
    for answer, end in ((aborts_when_apart, "crash SIGABRT"), (hangs_when_apart, "hang")):
        with Watched(answer, 2.0, hard_cases.FIRST) as peer:
            assert [peer.ask(*asked.bodies) for asked in (DEEP, APART, TOUCHING)] == [True, end, True]


def test_an_exception_is_an_answer_and_a_missing_package_is_not():
    with Watched(raises, 2.0, hard_cases.FIRST) as peer:
        assert peer.ask(*DEEP.bodies) == "raises ZeroDivisionError"
    missing = pytest.raises(ImportError, match="a_package_that_nobody_has")
    with Watched(is_not_installed, 2.0, hard_cases.FIRST) as peer, missing:
        peer.ask(*DEEP.bodies)


def test_halfspaces_find_the_volume_of_hulls_in_general_position():
    for seed in range(5):
        bodies = families.make("general", seed).bodies
        truth = float(question(*bodies).volume)
        assert peers.HardCase("volume", "scipy")(*bodies) == pytest.approx(truth, rel=1e-9)


@pytest.mark.parametrize("folder", ["", "/nowhere"])
def test_r3d_is_missing_where_no_folder_with_it_is_named(folder, monkeypatch):
    monkeypatch.setenv("R3D", folder)
    with pytest.raises(ImportError, match=r"^the variable R3D names no folder with the sources of r3d$"):
        peers.HardCase("volume", "r3d")(*DEEP.bodies)


def test_the_page_says_what_the_committed_results_say():
    notes, rows = results.read(hard_cases.RESULTS)
    assert len(rows) > 800
    assert {*stability_page.peers_of(rows), *stability_page.DISTANCES} <= set(rows[0])
    assert (ROOT / "docs" / "stability.md").read_text(encoding="utf-8") == stability_page.text(notes, rows)


def test_the_command_writes_results_page_and_pictures(tmp_path, monkeypatch):
    few = ("general", "slivers", "many_bodies")
    monkeypatch.setattr(hard_cases, "families_of_vertices", lambda name: name in few)
    assert command.main(["stability", "--seed=3", "--count=1", f"--out={tmp_path}"]) == 0
    notes, rows = results.read(tmp_path / "stability.csv")
    assert notes[0].startswith("seed 3; overlapper")
    missing = {note.removeprefix("missing: ").partition(" (")[0] for note in notes[1:]}
    for peer in [*stability_page.peers_of(rows), *stability_page.DISTANCES]:
        asked = [row for row in rows if row[peer] != peers.NOT_ASKED]
        assert bool(asked) is (peer not in missing)
    rounds = [row for row in rows if row["family"] in hard_cases.ROUND]
    assert {row["auto"] for row in rounds} == {peers.NOT_ASKED}
    pictures = {f"stability{name}.png" for name in ("", "_degeneracy", "_distances", "_distances_degeneracy")}
    assert {"stability.md", *pictures} <= {path.name for path in tmp_path.iterdir()}


def test_without_a_checkout_the_command_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(bench, "__file__", str(tmp_path / "overlapper" / "cli" / "bench.py"))
    with pytest.raises(bench.Refused, match="needs a checkout"):
        bench.stability()


def test_without_another_process_the_command_says_so(monkeypatch):
    def fail(*_, **__):
        raise OSError(errno.EAGAIN, os.strerror(errno.EAGAIN))

    monkeypatch.setattr(subprocess, "run", fail)
    with pytest.raises(bench.Refused, match=r"^stability could not be started \(.*unavailable\)$"):
        bench.stability()


def test_a_missing_package_is_named_in_one_sentence():
    benchmarks = str(ROOT / "benchmarks")
    program = "import sys, runpy; sys.modules['hypothesis'] = None; sys.argv = ['benchmarks', 'stability']; "
    program += f"sys.path.insert(0, {benchmarks!r}); runpy.run_path({benchmarks!r}, run_name='__main__')"
    alone = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert alone.returncode == 2
    assert alone.stderr == "overlapper: stability needs hypothesis: pip install '.[bench]'\n"
