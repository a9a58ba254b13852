"""The page about times of impact is that of its results, and FCL is asked about the same motions.

FCL reads a point that it has never set. What it answers depends on what the memory contains, so no test asks for it.
"""

from pathlib import Path

import numpy as np
import pytest

from harness.command import Wrong
from motion import impacts, many, page
from overlapper import Placed, Sphere, TimeOfImpact, time_of_impact

ROOT = Path(__file__).parents[2]


def test_the_page_is_that_of_the_results(tmp_path):
    (results,) = (ROOT / "benchmarks/results").glob("*/motion.csv")
    written = page.write_page(results, tmp_path).read_text(encoding="utf-8")
    assert written == (ROOT / "docs/motion.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", impacts.KINDS, ids=lambda kind: kind.name)
def test_a_few_motions_of_each_kind_are_measured_and_checked(kind):
    rows = list(impacts.figures(kind, 6))
    found = {(library, figure): value for _, library, figure, value in rows}
    assert found["ours", "widest"] < 1.1e-9 and found["ours", "us"] > 0
    assert {library for library, figure in found if figure == "us"} == {*impacts.SETTINGS, "ours", "ours, one call"}
    assert {figure for _, figure in found} >= {"missed", "false", "late", "latest", "early", "us slowest"}


def test_a_constant_turn_ends_at_the_last_pose():
    (kind,) = (each for each in impacts.KINDS if each.name == "boxes, turned")
    for motion in impacts.motions(kind, 5, 8):
        ends = [impacts.at(start, end, impacts.turning(start, end), 1.0) for start, end in zip(motion, motion[2:])]
        for told, end in zip(ends, motion[2:]):
            assert np.abs(told.position - end.position).max() < 1e-12
            assert abs(told.orientation @ end.orientation) == pytest.approx(1, abs=1e-12)


def test_a_wrong_time_ends_the_run():
    kind = impacts.Kind("balls", lambda rng: (Sphere(0.5), Sphere(0.5)))
    motion = Placed(Sphere(0.5), (3, 0, 0)), Placed(Sphere(0.5)), Placed(Sphere(0.5), (-1, 0, 0)), Placed(Sphere(0.5))
    impacts.check(kind, motion, impacts.ours_of(motion))
    state = impacts.ours_of(motion).__getstate__()
    for change in ({1: 0.6, 2: 0.61}, {0: "separated"}, {2: 0.4}, {0: "touching"}):
        late = TimeOfImpact.__new__(TimeOfImpact)
        late.__setstate__(tuple(change.get(k, value) for k, value in enumerate(state)))
        with pytest.raises(Wrong, match=r"^balls: "):
            impacts.check(kind, motion, late)


@pytest.mark.parametrize("kind", many.KINDS)
def test_a_few_random_and_graded_motions_are_judged(kind, monkeypatch):
    monkeypatch.setattr(many, "CHUNK", 20)
    row, wrong = many.examined(kind, 900)
    assert (row["motions"], row["late"], row["false"], wrong) == (20, 0, 0, "")
    assert row["impact"] > 0
    assert sum(row[status] for status in ("impact", "separated", "touching", "overlapping", "open")) == 20


def changed(found, **change):
    """An answer with other numbers."""
    state = dict(enumerate(found.__getstate__()))
    other = TimeOfImpact.__new__(TimeOfImpact)
    other.__setstate__(
        tuple((state | {("status", "time", "time_upper").index(k): v for k, v in change.items()}).values())
    )
    return other


@pytest.mark.parametrize("kind", ["random", "grazing passes", "gaps at the end"])
def test_late_times_and_wrong_intervals_are_noticed(kind):
    met = 0
    for motion in list(many.motions(kind, 901))[:40]:
        found = time_of_impact(motion.a, motion.b, motion.of_a, motion.of_b)
        if found.status != "impact" or found.time < 0.1:
            continue
        met += 1
        assert not [*many.faults(motion, found)]
        if kind != "grazing passes":  # else the overlap may be over
            early = changed(found, time=found.time - 0.02, time_upper=found.time - 0.01)
            assert "false" in many.faults(motion, early)
        if motion.meets:
            assert "late" in many.faults(motion, changed(found, status="separated"))
        if kind == "random" and (late := min(found.time + 1e-5, 1.0)) < 1:
            assert "late" in many.faults(motion, changed(found, time=late, time_upper=late + 1e-9)), (motion, found)
    assert met > 5
