"""The page about times of impact is that of its results, and FCL is asked about the same motions.

FCL reads a point that it has never set. What it answers depends on what the memory contains, so no test asks for it.
"""

from pathlib import Path

import numpy as np
import pytest

from harness.command import Wrong
from motion import impacts, page
from overlapper import Placed, Sphere, TimeOfImpact

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
