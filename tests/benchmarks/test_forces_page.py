"""The page about volumetric contact: it has every experiment, and its table of times has every part of a substep."""

import contextlib

import forces
import forces_page
import forces_physics
import pytest

from overlapper.simulation import Bodies


def test_the_page_is_what_was_measured(tmp_path):
    page = forces_page.write_page(forces_physics.RESULTS, tmp_path, tmp_path / "none.csv").read_text(encoding="utf-8")
    assert "$" not in page and "They were not measured yet." in page
    assert page.count("\n| ") == 25
    for name in ("energy", "friction", "bodies"):
        assert (tmp_path / f"forces_{name}.png").stat().st_size > 10_000


@pytest.mark.filterwarnings("ignore::overlapper.simulation.cautions.SubstepsWarning")
def test_experiments_are_measured_by_both_laws():
    rows = [*forces_physics.slides()]
    assert [(row.law, row.at) for row in rows] == [(law, n) for law in forces_page.LAWS for n in (1, 4, 20)]
    assert all(row.value == pytest.approx(1, abs=1e-4 if row.law == "volumetric" else 0.05) for row in rows)
    (loop,) = forces_physics.loops()
    assert 0 < loop.value < 1


def test_the_parts_of_a_substep_are_timed_and_nothing_else_remains_of_it(tmp_path, monkeypatch):
    update = Bodies.update
    monkeypatch.setattr(forces, "STEPS", 2)
    monkeypatch.setattr(forces, "pile", forces.SCENES["ten cubes on a plane"])
    monkeypatch.setattr(forces, "on_one_processor", lambda: None)
    monkeypatch.setattr("sys.argv", ["forces.py", f"--out={tmp_path}"])
    forces.main()
    assert Bodies.update is update
    page = (tmp_path / "forces.md").read_text(encoding="utf-8")
    assert f"| {' | '.join([*forces.SCENES, forces.PILE])} |" in page
    assert all(f"| {part} |" in page for part in [*forces.PARTS, "else", "**all**"])
    assert "The pile of 200 boxes, 10 contacts, at 240 Hz" in page


def test_what_is_called_within_counts_for_its_own_part():
    with forces.Stopwatch() as watch, contextlib.ExitStack() as stack:
        scene = forces.Scene(forces.SCENES["a tower of ten cubes"], stack)
        scene.step(watch)
    us = {part: values[0] for part, values in scene.taken.items()}
    assert all(us[part] > 0 for part in forces.PARTS)
    assert sum(us[part] for part in forces.PARTS) + us["rest"] == pytest.approx(us["substep"])
