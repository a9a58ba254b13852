"""Costs of single features: each benchmark runs on a small case and prints its figures."""

import re
import sys

import exact
import families
import numpy as np
import pytest

from costs import audit, kills, recording
from harness import command, figures
from overlapper import Placed, Sphere
from paper import pictures


def said(capsys, *arguments):
    assert command.main([str(each) for each in arguments]) == 0
    return capsys.readouterr().out


def test_rings_of_a_chain_are_decomposed_and_measured(capsys):
    lines = said(capsys, "concave", 0.9).splitlines()
    assert re.match(r"[\d,]+ triangles, [\d.]+ cm³ each, [\d.]+ cm³ shared", lines[0])
    threshold, parts, _, ring, shared = lines[2].split()[:5]
    assert (float(threshold), int(parts) > 0) == (0.9, True) and float(ring) > float(shared) > 0


def test_a_recording_is_made_saved_and_shown(capsys, monkeypatch):
    monkeypatch.setattr(recording, "BODIES", 8)
    monkeypatch.setattr(recording, "FRAMES", 2)
    lines = said(capsys, "recording", "mixed", "--steps=4").splitlines()
    assert re.match(r"mixed: 8 bodies, 4 frames, \d+ overlaps: [\d.]+ MB", lines[0])
    assert re.match(r"  shown, at 1280 x 800: \d+ ms a frame on the page's thread, \d+ ms to draw it", lines[2])


def test_a_sweep_is_timed_part_by_part(capsys):
    lines = said(capsys, "sweep", 1, "--tasks=4", "--grasps=0").splitlines()
    figures = {line[:20].strip(): float(line[20:27]) for line in lines}
    assert set(figures) == {"a run", "more in the worker", "in the parent", "there and back", "overhead per task"}
    assert figures["a run"] > 0


def test_a_watched_script_is_timed_beside_itself(capsys):
    lines = said(capsys, "watch", 1, "--steps=2", "--scene=r2d2", "--way=every step").splitlines()
    assert lines[0].startswith("r2d2: µs per step") and float(lines[2].split()[2]) > float(lines[1].split()[2]) > 0
    assert re.match(r"start: -?\d+\.\d\d s more", lines[3])


SWEEP = """
import subprocess, sys, time
from pathlib import Path

folder = Path(sys.argv[-1], "tasks.parquet")
folder.mkdir(parents=True, exist_ok=True)
worker = subprocess.Popen(["sleep", "60"])
for number in range(6):
    if not (part := folder / f"{number}.parquet").exists():
        time.sleep(0.15)
        part.write_bytes(bytes([BITS]))
worker.kill()
"""


@pytest.mark.parametrize("spoilt", [False, True])
def test_a_sweep_is_killed_at_random_moments_and_compared_with_one_that_was_not(spoilt, capsys, monkeypatch, tmp_path):
    """A script that takes the options of a sweep stands for the command."""
    text = SWEEP.replace("BITS", "time.time_ns() % 251" if spoilt else "number")
    (tmp_path / "sweep.py").write_text(text, encoding="utf-8")
    monkeypatch.setattr(kills, "SWEEP", (sys.executable, str(tmp_path / "sweep.py")))
    if spoilt:
        with pytest.raises(SystemExit, match="tasks have other bits"):
            command.main(["kills", "6", "1", "--kills=1"])
    else:
        words = said(capsys, "kills", 6, 1, "--kills=1")
        assert "undisturbed: 6 tasks" in words and "killed 2 times: the same" in words
        assert "  parent killed when" in words and "  worker killed when" in words


def test_a_robot_is_a_row_of_the_table_of_audits():
    cells = audit.row_of(audit.ROBOTS / audit.FRANKA, 4)
    assert len(cells) == 9 and cells[0] == "panda"
    assert int(cells[3]) == sum(map(int, cells[4:8])) > 0


def test_pairs_that_are_answered_differently_are_judged_by_proof():
    one, near, far = (Placed(Sphere(0.5), (x, 0, 0)) for x in (0, 0.875, 1.25))
    assert audit.judged([one, near], True) == "yes by ours alone, which by proof overlap (1e-01 m deep)"
    assert audit.judged([one, far], False) == "no by ours alone, which by proof share nothing (2e-01 m apart)"


def test_hard_cases_are_checked_by_the_rules(capsys, tmp_path):
    words = said(capsys, "stress", "--count=3", "--family=general", "--workers=1", f"--out={tmp_path / 'rows.csv'}")
    assert re.search(r"all +3 +\d+ +\d+ .* 0 *\n", words)
    assert len((tmp_path / "rows.csv").read_text(encoding="utf-8").splitlines()) == 4


@pytest.mark.parametrize("cause", pictures.PICTURES)
def test_each_cause_of_a_lost_overlap_has_its_picture(cause, tmp_path):
    figures.style()
    bodies = [families.CORNERS - [0, 0, 1], 0.5 * families.TETRA + np.array([0.1, 0.2, 0.5 - 1e-9])]
    path = tmp_path / "cause.png"
    pictures.PICTURES[cause](bodies, exact.common(*map(exact.hull, bodies)), path)
    assert path.stat().st_size > 5_000
