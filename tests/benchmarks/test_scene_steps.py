"""The chart of steps: it has all parts, its volumes are those of single calls or the run ends, its page is drawn."""

import subprocess

import pytest
import typer

from harness import command, results
from overlapper.cli import bench
from speed import steps, steps_page


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(steps, "SETTLING", 60)
    monkeypatch.setattr(steps, "SAMPLES", (3, 3))
    monkeypatch.setattr(steps, "on_one_processor", lambda: None)


def test_a_pile_is_measured_part_by_part_and_its_page_is_drawn(small, tmp_path):
    assert command.main(["steps", "--boxes=8", "--boxes=16", f"--out={tmp_path}"]) == 0
    us = steps_page.read(tmp_path / "steps.csv")
    for boxes in (8, 16):
        assert us["pairs examined"][boxes] >= us["pairs overlapping"][boxes] >= boxes / 2
        assert all(boxes in us[part] for part in (*steps.PARTS, "ours", "stepSimulation", "getContactPoints"))
    page = (tmp_path / "steps.md").read_text(encoding="utf-8")
    assert "| 8 |" in page and "| 16 |" in page and "$" not in page
    assert (tmp_path / "steps.png").stat().st_size > 10_000


def test_a_volume_that_is_not_that_of_a_single_call_ends_the_run(small, tmp_path, monkeypatch, capsys):
    class Half:
        def __init__(self, *shapes):
            self.volume = 0.5 * true(*shapes).volume

    true = steps.overlap
    monkeypatch.setattr(steps, "overlap", Half)
    assert command.main(["steps", "--boxes=8", f"--out={tmp_path}"]) == 1
    assert "overlapper: wrong: pile of 8: " in capsys.readouterr().err
    assert results.read(tmp_path / "steps.csv")[1] == []


@pytest.mark.parametrize(
    ("asked", "code", "started"),
    [
        ({}, 0, ["chart", "round", "steps"]),
        ({}, 1, ["chart"]),
        ({"family": ["box deep"]}, 0, ["chart"]),
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
    assert [each[2] for each in commands] == started
    assert all(each[-2:] == [f"--out={tmp_path}", "--page"] for each in commands)
