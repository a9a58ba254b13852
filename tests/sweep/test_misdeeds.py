"""Tasks that misbehave, each in a way of its own: each is one row that says so, and none stops or changes another."""

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from busy import slowness
from misdeeds import MUST_SAY, SCENE
from sweeping import rows

LIMIT = 4  # s, on an idle machine, where no other task takes half a second


@pytest.mark.parametrize("engine", ["processes", "ray"])
def test_tasks_that_misbehave_are_a_row_each_and_stop_no_other(engine, tmp_path, monkeypatch):
    if engine == "ray":
        pytest.importorskip("ray")
    monkeypatch.chdir(tmp_path)
    Path("scene.py").write_text(SCENE)
    # A good task comes behind each, in the same process as a rule.
    Path("points.csv").write_text(
        "deed,again\n" + "".join(f"{deed},0\nnothing,{k}\n" for k, deed in enumerate(MUST_SAY))
    )
    Path("left").mkdir()
    words = ["--points", "points.csv", "--limit", str(LIMIT * slowness()), "--memory", "400", "--out", "runs", "--json"]
    command = [sys.executable, "-m", "overlapper", "sweep", "scene.py", *words, "--engine", engine, "--workers", "2"]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=1200)
    told = json.loads(done.stdout)
    assert (done.returncode, told["missing"], told["finished"]) == (1, 0, True), done.stderr
    found = {(row["deed"], row["again"]): ("done", "") for row in rows("runs")}
    found |= {(row["deed"], row["again"]): (row["what"], row["sentence"]) for row in rows("runs", "failures")}
    for deed, (what, sentence) in MUST_SAY.items():
        assert found[deed, 0][0] == what and re.fullmatch(sentence, found[deed, 0][1]), (deed, found[deed, 0])
    others = {key: outcome for key, outcome in found.items() if key[1]}
    assert set(others.values()) == {("done", "")}, others
    lost = {row["deed"]: row["diverged"] for row in rows("runs") if row["diverged"]}
    assert lost == {"no number": 1, "huge number": 1, "no time": 2} and told["diverged"] == 3
    assert all(len(row["traceback"]) < 25_000 for row in rows("runs", "failures"))
    # Nothing of it outlives the sweep by more than moments, not even a process that has left its group.
    left = os.listdir("left")
    assert len(left) >= 2
    for _ in range(100):
        if not any(psutil.pid_exists(int(each)) for each in left):
            return
        time.sleep(0.1)
    pytest.fail(f"of the processes {left} some are there still")
