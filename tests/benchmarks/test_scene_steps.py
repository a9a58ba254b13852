"""The chart of steps: it has all parts, its volumes are those of single calls or the run ends, its page is drawn."""

import subprocess
from pathlib import Path

import pytest
import scene_steps
import typer

from overlapper.cli import bench


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(scene_steps, "SETTLING", 60)
    monkeypatch.setattr(scene_steps, "SAMPLES", (3, 3))
    monkeypatch.setattr(scene_steps, "on_one_processor", lambda: None)


def test_a_pile_is_measured_part_by_part_and_its_page_is_drawn(small, tmp_path):
    results = tmp_path / "steps.csv"
    scene_steps.measure([8, 16], results)
    us = scene_steps.read(results)
    for boxes in (8, 16):
        assert us["pairs examined"][boxes] >= us["pairs overlapping"][boxes] >= boxes / 2
        assert all(boxes in us[part] for part in (*scene_steps.PARTS, "ours", "stepSimulation", "getContactPoints"))
    page = scene_steps.write_page(results, tmp_path).read_text(encoding="utf-8")
    assert "| 8 |" in page and "| 16 |" in page and "$" not in page
    assert (tmp_path / "steps.png").stat().st_size > 10_000 and (tmp_path / "steps.svg").is_file()


def test_a_volume_that_is_not_that_of_a_single_call_ends_the_run(small, tmp_path, monkeypatch):
    class Half:
        def __init__(self, *shapes):
            self.volume = 0.5 * true(*shapes).volume

    true = scene_steps.overlap
    monkeypatch.setattr(scene_steps, "overlap", Half)
    with pytest.raises(ArithmeticError, match="pile of 8: "):
        scene_steps.measure([8], tmp_path / "steps.csv")
    assert "ours" not in scene_steps.read(tmp_path / "steps.csv")


@pytest.mark.parametrize(
    ("asked", "code", "started"),
    [
        ({}, 0, ["chart.py", "round_bodies.py", "scene_steps.py"]),
        ({}, 1, ["chart.py"]),
        ({"family": ["box deep"]}, 0, ["chart.py"]),
    ],
)
def test_the_charts_of_pairs_and_of_steps_are_made_by_one_command(asked, code, started, monkeypatch, tmp_path):
    commands = []

    def run(command):
        commands.append(command)
        return subprocess.CompletedProcess(command, code)

    monkeypatch.setattr(bench.subprocess, "run", run)
    with pytest.raises(typer.Exit) as end:
        bench.chart(**asked, seconds=1.0, out=tmp_path, page=True)
    assert end.value.exit_code == code
    assert [Path(command[1]).name for command in commands] == started
    assert all(command[-2:] == [f"--out={tmp_path}", "--page"] for command in commands)
