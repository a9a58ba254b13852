"""`overlapper sweep` on the command line: text for people, JSON for programs, a page, and exit codes."""

import json
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from busy import slowness
from command import overlapper
from sweeping import BALLS, parts, rows


@pytest.fixture(autouse=True)
def balls(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "balls.py").write_text(BALLS)


def sweep(*arguments):
    return overlapper("sweep", "balls.py", *arguments)


def test_a_sweep_prints_its_result_and_writes_a_page():
    done = sweep("--grid", "apart=0.1:0.3:3", "--seeds", "2", "--set", "seconds=0", "--out", "runs", "--pages", "1")
    assert (done.returncode, done.stderr) == (0, "a scene may talk\n")  # for its page, here
    assert done.stdout == ("balls: 6 of 6 tasks are done.\nWritten: runs/tasks.parquet\nWritten: runs/summary.html\n")
    page = Path("runs/summary.html").read_text()
    assert "6 of 6 tasks are done over apart (3), seed (2). Something overlaps in 2 of them." in page
    # Nothing of it is loaded from elsewhere.
    assert not re.search(r'(?:src|href)="(?:https?:)?//', page) and "default-src 'none'" in page
    assert page.count("<svg") == 2 and "largest volume, cm³" in page
    # The page beside the first command is there; it is what the command writes.
    worst = min((row for row in rows("runs") if row["worst_step"]), key=lambda row: (row["apart"], row["seed"]))
    link, command = re.search(r'<a href="([^"]*)">[^<]*</a><br><code>([^<]*)</code>', page).groups()
    name = f"views/{worst['task'][:12]}.html"
    assert link == f"{name}#t={1 / 240:.6g}"
    assert command == f"overlapper view balls.py --set=apart=0.1 --html=runs/{name}"
    size = Path("runs", name).stat().st_size
    Path("runs", name).unlink()
    words = shlex.split(command)
    subprocess.run([sys.executable, "-m", *words], check=True, capture_output=True)
    assert Path("runs", name).stat().st_size == pytest.approx(size, rel=1e-3)


def test_json_lists_failures_with_exit_code_1():
    done = sweep("--grid", "fate=good,raises,dies", "--points", "points.csv", "--out", "runs", "--json")
    assert (done.returncode, done.stderr) == (2, "overlapper: points.csv: No such file or directory\n")
    Path("points.csv").write_text("apart\n0.1\n0.12\n")
    done = sweep("--grid", "fate=good,raises", "--points", "points.csv", "--out", "runs", "--json")
    told = json.loads(done.stdout)
    assert (done.returncode, done.stderr) == (1, "")
    assert (told["tasks"], told["done"], told["there_before"], told["missing"]) == (4, 2, 0, 0)
    assert [(row["apart"], row["what"]) for row in sorted(told["failed"], key=lambda row: row["apart"])] == [
        (0.1, "raised"),
        (0.12, "raised"),
    ]
    assert told["page"] == "runs/summary.html" and told["finished"] is True
    assert "<h2>Failed: 2 raised</h2>" in Path("runs/summary.html").read_text()
    text = sweep("--grid", "fate=good,raises", "--points", "points.csv", "--out", "runs").stdout.splitlines()
    assert text[0] == "balls: 2 of 4 tasks are done, 2 of them before."
    assert re.fullmatch(r"Failed: apart=0.1\d*, seed=0, fate=raises, seconds=0.0: .*apart must be more", text[1])
    assert text[3] == "Tracebacks: runs/failures.parquet; --retry runs these tasks again"


def test_a_sweep_says_what_has_moved_since_another():
    words = ["--grid", "apart=0.1:0.3:3", "--grid", "fate=good,raises", "--grid", "seed=0,1"]
    assert sweep(*words, "--out", "before").returncode == 1
    # A task that failed in both sweeps has not moved.
    same = sweep(*words, "--out", "same", "--check", "before")
    assert same.returncode == 0 and "\nAll 12 tasks are as in before.\nWritten: " in same.stdout
    Path("balls.py").write_text(BALLS.replace("radius=0.1", "radius=0.101"))
    moved = sweep(*words, "--out", "after", "--check", "before")
    lines = moved.stdout.splitlines()
    start = next(k for k, line in enumerate(lines) if "have moved" in line)
    assert moved.returncode == 1
    assert lines[start].startswith("4 of 12 tasks have moved since before: largest_volume_m3 in 4, mean_volume_m3 in 4")
    assert all(line.startswith("    apart=0.") for line in lines[start + 1 : start + 5])
    assert lines[start + 5] == "Written: after/tasks.parquet"
    page = Path("after/summary.html").read_text()
    assert "<p>4 of 12 tasks have moved since before: " in page and "tasks that moved, %" in page
    told = json.loads(sweep(*words[:2], "--out", "after", "--check", "before", "--json").stdout)["check"]
    assert told.pop("measures")["largest_depth_m"] == 2 and len(told.pop("moved")) == 2
    assert told == {"recorded": "before", "compared": 3, "not_recorded": 0, "gone": 9}


def test_a_failure_that_was_not_recorded_has_moved():
    assert sweep("--seeds", "2", "--out", "before").returncode == 0
    Path("balls.py").write_text(BALLS.replace('fate == "raises"', "seed"))
    moved = sweep("--seeds", "2", "--out", "after", "--check", "before")
    assert moved.returncode == 1
    assert "\n1 of 2 tasks have moved since before: task in 1.\n    apart=0.15, seed=1, fate=good" in moved.stdout
    more = sweep("--set", "seed=0", "--out", "after", "--check", "before")
    assert (
        more.returncode == 0
        and "\nNot compared: 0 new tasks, 1 tasks that only the recorded sweep has.\n" in more.stdout
    )


def test_a_sweep_with_nothing_to_compare_is_refused_before_it_begins():
    assert sweep("--seeds", "2", "--out", "before").returncode == 0
    for words, sentence in (
        (["--set", "seed=7", "--check", "before"], "--check before: the folder has no task of this sweep"),
        (["--check", "nowhere"], "--check nowhere: the folder has no sweep"),
        (["--check", "./runs"], "--check and --out are the same folder"),
    ):
        done = sweep(*words, "--out", "runs")
        assert (done.returncode, done.stdout, done.stderr) == (2, "", f"overlapper: {sentence}\n")
    Path("expected").mkdir()
    Path("expected/balls.csv").write_text("# budget mass: relative 1 absolute 1\n")
    done = sweep("--seeds", "2", "--check", "before", "--out", "runs")
    assert (
        done.returncode == 2
        and "expected/balls.csv has a budget for 'mass', which must be one of volume" in done.stderr
    )
    assert not Path("runs").exists()


def test_without_a_limit_a_task_that_takes_very_long_is_named():
    late = 1.5 * slowness()  # s
    seconds = round(3 * late, 1)
    start = (
        f"import sys\nfrom overlapper.jobs import patience\nfrom overlapper.cli import main\npatience.LATE = {late}\n"
    )
    words = ["sweep", "balls.py", "--grid", f"seconds=0,{seconds}", "--workers", "1", "--out"]
    command = [sys.executable, "-c", f"{start}sys.argv[1:] = {words!r} + sys.argv[1:]\nmain()"]
    done = subprocess.run([*command, "runs"], capture_output=True, text=True, timeout=120)
    words = f"apart=0.15, seed=0, fate=good, seconds={seconds} has run for 0 min; --limit ends such tasks"
    assert (done.returncode, " ".join(done.stderr.split())) == (0, words)
    limited = subprocess.run([*command, "limited", "--limit", "600"], capture_output=True, text=True, timeout=120)
    assert (limited.returncode, limited.stderr) == (0, "")


def test_ctrl_c_ends_a_sweep_that_goes_on_later():
    words = ["--seeds", "40", "--set", "seconds=0.1", "--out", "runs", "--workers", "2"]
    command = [sys.executable, "-m", "overlapper", "sweep", "balls.py", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while not (Path("runs/tasks.parquet").is_dir() and parts("runs")):
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        said, complaints = process.communicate(timeout=60)
    assert (process.returncode, complaints) == (130, "")
    assert "Interrupted; the same command continues with the missing tasks.\n" in said
    assert 0 < len(parts("runs")) < 40 and "<h2>The worst tasks</h2>" in Path("runs/summary.html").read_text()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--grid", "mass=1"], "the scene balls has no parameter 'mass' (it has apart=0.15, seed=0, fate=good, "),
        (["--steps-kept", "some"], "--steps-kept must be summary, 'every N' or all, not 'some'"),
        (["--steps-kept", "every 0"], "--steps-kept must be summary, 'every N' or all, not 'every 0'"),
        (["--address", "auto"], "--address needs --engine ray"),
        (["--range", "apart=0:1"], "--range needs --sample"),
    ],
)
def test_invalid_sweeps_are_refused_in_one_sentence(arguments, sentence):
    done = sweep(*arguments, "--out", "runs")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"overlapper: {sentence}") and done.stderr.count("\n") == 1
    assert not Path("runs").exists()


def test_a_path_that_is_no_folder_is_refused():
    Path("runs").write_text("a file")
    done = sweep("--out", "runs")
    assert (done.returncode, done.stdout, done.stderr) == (2, "", "overlapper: runs: File exists\n")


def test_a_sweep_without_finished_tasks_has_no_page():
    done = sweep("--set", "fate=raises", "--out", "runs")
    assert (done.returncode, done.stderr) == (1, "")
    lines = done.stdout.splitlines()
    assert lines[0] == "balls: 0 of 1 tasks are done." and lines[1].startswith(
        "Failed: apart=0.15, seed=0, fate=raises"
    )
    assert lines[2:] == ["Tracebacks: runs/failures.parquet; --retry runs these tasks again"]
    assert not Path("runs/summary.html").exists()


# Two boxes. One may be thrown to where no number is, and a mesh without its last triangle may lie beside them.
LOSSES = '''
"""Two boxes."""
import pathlib
import pybullet as p

STEPS = 3


def build(client, *, lost="nothing"):
    box = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.1] * 3, physicsClientId=client)
    for x in (0, 0.15):
        p.createMultiBody(x and 1, box, basePosition=[x, 0, 0], physicsClientId=client)
    if lost == "a shape":
        pathlib.Path("open.obj").write_text("v 0 0 0\\nv 1 0 0\\nv 0 1 0\\nv 0 0 1\\nf 1 3 2\\nf 1 2 4\\nf 2 3 4\\n")
        flags = p.GEOM_FORCE_CONCAVE_TRIMESH
        mesh = p.createCollisionShape(p.GEOM_MESH, fileName="open.obj", flags=flags, physicsClientId=client)
        p.createMultiBody(0, mesh, physicsClientId=client)

    def step(i):
        if lost == "a body" and i == 1:
            p.resetBasePositionAndOrientation(1, [float("nan")] * 3, [0, 0, 0, 1], physicsClientId=client)

    return step
'''


def test_the_row_the_text_the_page_and_the_exit_code_say_what_a_task_left_out():
    Path("balls.py").write_text(LOSSES)
    words = ["--grid", "lost=nothing,a body,a shape"]
    done = sweep(*words, "--out", "runs")
    assert done.returncode == 1 and done.stdout.splitlines()[:3] == [
        "balls: 3 of 3 tasks are done.",
        "1 of 3 tasks have diverged: a body had no finite pose, and was left out. "
        "The first is box#1 of lost=a body, in step 2.",
        "1 of 3 tasks have shapes that are not modelled. The first is open of lost=a shape.",
    ]
    columns = ("skipped", "first_skipped", "diverged", "first_diverged", "diverged_step")
    assert {row["lost"]: tuple(row[name] for name in columns) for row in rows("runs")} == {
        "nothing": (0, None, 0, None, None),
        "a body": (0, None, 1, "box#1", 2),
        "a shape": (1, "open", 0, None, None),
    }
    assert "1 of 3 tasks have diverged" in Path("runs/summary.html").read_text()
    told = json.loads(sweep(*words, "--out", "runs", "--json").stdout)
    assert (told["done"], told["there_before"], told["skipped"], told["diverged"]) == (0, 3, 1, 1)
    same = sweep(*words, "--out", "same", "--check", "runs")
    assert same.returncode == 0 and "All 3 tasks are as in runs." in same.stdout
    Path("balls.py").write_text(LOSSES.replace('lost == "a body"', "lost"))
    moved = sweep(*words, "--out", "after", "--check", "runs")
    assert moved.returncode == 1 and "2 of 3 tasks have moved since runs: diverged in 2" in moved.stdout
