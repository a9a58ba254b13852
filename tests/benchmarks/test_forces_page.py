"""The page about volumetric contact: it has every experiment, and its table of times has every part of a substep."""

import contextlib
import re

import pytest

from forces import cost, physics
from forces import page as forces_page
from harness import command
from overlapper.simulation import Bodies


def test_the_page_is_what_was_measured(tmp_path):
    page = forces_page.write_page(tmp_path / cost.RESULTS.name, tmp_path).read_text(encoding="utf-8")
    assert "$" not in page and "They were not measured yet." in page
    assert page.count("\n| ") == 62
    for name in ("energy", "friction"):
        assert (tmp_path / f"forces_{name}.png").stat().st_size > 10_000


@pytest.mark.filterwarnings("ignore::overlapper.simulation.cautions.SubstepsWarning")
def test_experiments_are_measured_by_both_laws():
    rows = [*physics.slides()]
    assert [(row.law, row.at) for row in rows] == [(law, n) for law in physics.LAWS for n in (1, 4, 20)]
    assert all(row.value == pytest.approx(1, abs=1e-4 if row.law == "volumetric" else 0.05) for row in rows)
    (loop,) = physics.loops()
    assert 0 < loop.value < 1


def test_the_parts_of_a_substep_are_timed_and_nothing_else_remains_of_it(tmp_path, monkeypatch):
    update = Bodies.update
    monkeypatch.setattr(cost, "STEPS", 2)
    ten = cost.SCENES["ten cubes on a plane"]
    monkeypatch.setattr(cost, "pile", lambda client, boxes=200: ten(client))
    monkeypatch.setattr(cost, "ROBOTS", ("kinematic_pusher",))
    monkeypatch.setattr(cost, "on_one_processor", lambda: None)
    assert command.main(["forces", f"--out={tmp_path}"]) == 0
    assert Bodies.update is update
    page = (tmp_path / "forces.md").read_text(encoding="utf-8")
    assert f"| {' | '.join([*cost.SCENES, cost.PILE])} |" in page
    assert all(f"| {part} |" in page for part in [*cost.PARTS, "else", "**all**"])
    assert "The pile of 200 boxes has 10 contacts" in page
    page = page[page.index("## Time of a step") : page.index("## The force law")]
    rows = re.findall(r"^\| ([^|]*) \| (\d+) \| ([\d.e-]+) \| ([\d.e-]+) \| ([\d.]+) \|$", page, re.MULTILINE)
    assert [name for name, *_ in rows] == [cost.PILE, cost.SMALL_PILE, "kinematic pusher"]
    assert all(
        float(times) == pytest.approx(float(ours) / float(bullet), rel=0.2) for _, _, bullet, ours, times in rows
    )


def test_what_is_called_within_counts_for_its_own_part():
    with cost.parts_timed() as watch, contextlib.ExitStack() as stack:
        scene = cost.Scene(cost.SCENES["a tower of ten cubes"], stack)
        scene.step(watch)
    us = {part: values[0] for part, values in scene.taken.items()}
    assert all(us[part] > 0 for part in cost.PARTS)
    assert sum(us[part] for part in cost.PARTS) + us["rest"] == pytest.approx(us["substep"])
