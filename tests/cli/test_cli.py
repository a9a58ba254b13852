"""The command line: a table for people, JSON for programs, one sentence and exit code 2 for what the user can mend."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from command import overlapper

from overlapper.cli.check import check
from overlapper.cli.refusals import Refused
from overlapper.tables.table_file import read_table

TWO_CUBES = '''
"""A cube rests 2 cm deep in another."""
import pybullet as p

STEPS = 8
PAIRS = "all"  # a filter keeps them where they are


def build(client):
    cube = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05] * 3, physicsClientId=client)
    p.createMultiBody(0, cube, physicsClientId=client)
    upper = p.createMultiBody(1, cube, basePosition=[0, 0, 0.08], physicsClientId=client)
    p.setCollisionFilterPair(0, upper, -1, -1, 0, physicsClientId=client)
    print("a scene may talk")

    def step(i):
        assert i < STEPS, "no more"

    return step
'''

BENT = """
import pybullet as p
STEPS = 2


def build(client):
    cube = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05] * 3, physicsClientId=client)
    p.createMultiBody(0, cube, physicsClientId=client)
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    bent = p.createCollisionShape(
        p.GEOM_MESH, vertices=corners, indices=[0, 1, 2, 0, 2, 3], physicsClientId=client
    )
    p.createMultiBody(0, bent, physicsClientId=client)
"""

FAILS_LATE = TWO_CUBES.replace("i < STEPS", "i < 5")
LONG = TWO_CUBES.replace("STEPS = 8", "STEPS = 1_000_000")
SLOW = TWO_CUBES.replace("def build(client):", "def build(client):\n    print('here'); import time; time.sleep(30)")
WAIT = """

def wait():
    import os, pathlib, time

    pathlib.Path("writes").write_text(str(os.getpid()))
    os.rename("writes", "waits")
    time.sleep(60)
"""


@pytest.fixture(autouse=True)
def scene_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "two_cubes.py").write_text(TWO_CUBES)


def in_a_process(*arguments, **environment):
    """Runs the command line where a scene may limit its process, or with other environment variables."""
    words = [sys.executable, "-m", "overlapper", *arguments]
    return subprocess.run(words, capture_output=True, text=True, timeout=60, env={**os.environ, **environment})


def refusal(*arguments, run=overlapper):
    """The sentence on stderr of a command that must fail with exit code 2 and nothing on stdout."""
    done = run(*arguments)
    assert (done.returncode, done.stdout) == (2, "")
    return done.stderr.removeprefix("a scene may talk\n")


@pytest.mark.parametrize(
    ("option", "choices"),
    [
        ("--contact", "'bullet', 'mujoco', 'volumetric'"),
        ("--surface", "'nominal', 'margin'"),
        ("--method", "'auto', 'paper'"),
    ],
)
def test_an_invalid_choice_is_refused_with_the_valid_ones(option, choices):
    assert refusal("run", "franka_lift", option, "some") == (
        f"overlapper: Invalid value for '{option}': 'some' is not one of {choices}.\n"
    )


def test_the_version_is_that_of_the_package():
    assert re.fullmatch(r"overlapper \d+\.\d+\.\d+\n", overlapper("--version").stdout)


def test_help_shows_examples_and_a_bare_command_prints_help():
    assert "overlapper run franka_grasp" in overlapper().stdout
    assert "overlapper watch --html mine.html my_script.py" in overlapper().stdout
    assert "--html my_scene.html" in overlapper("run", "--help").stdout
    assert "overlapper watch --direct my_script.py" in overlapper("watch", "--help").stdout


def test_help_is_broken_at_the_margin_only_and_has_a_short_name():
    text = in_a_process("run", "-h", COLUMNS="200", TERMINAL_WIDTH="200").stdout
    assert "which fills a pybullet client. build(client) may return a function step(i)" in text


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("overlapper au", ["audit"]),
        ("overlapper run --hel", ["--help"]),
        ("overlapper run franka_g", ["franka_grasp"]),
        ("overlapper run r2d2_fall --contact vol", ["volumetric"]),
    ],
)
def test_a_shell_is_offered_commands_options_scenes_and_choices(line, offered):
    words = {"COMP_WORDS": line, "COMP_CWORD": str(len(line.split()) - 1), "_OVERLAPPER_COMPLETE": "complete_bash"}
    assert in_a_process(**words).stdout.split() == offered


def test_completion_of_a_shell_is_installed_by_an_option(tmp_path):
    # Otherwise typer looks for the shell that started the tests, which may be none that has completion.
    told = {"_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    assert in_a_process("--install-completion", "bash", HOME=str(tmp_path), **told).returncode == 0
    assert ".bash_completions/overlapper.sh" in (tmp_path / ".bashrc").read_text()
    assert "_OVERLAPPER_COMPLETE=complete_bash" in (tmp_path / ".bash_completions/overlapper.sh").read_text()


def test_scenes_are_listed_with_what_happens_in_them():
    assert re.search(r"^box_pile +Two hundred boxes", overlapper("scenes").stdout, re.MULTILINE)


def test_a_scene_with_a_syntax_error_is_listed_as_such(tmp_path):
    (tmp_path / "scenes").mkdir()
    (tmp_path / "scenes" / "half.py").write_text("def build(")
    assert re.search(r"^half +\(not a Python file\)$", overlapper("scenes").stdout, re.MULTILINE)


def test_shapes_that_are_not_modelled_are_named_below_the_table(tmp_path):
    (tmp_path / "bent.py").write_text(BENT)
    done = overlapper("run", "bent.py")
    assert done.returncode == 1
    assert "Nothing overlaps in 2 steps." in done.stdout
    assert "2 bodies, 1 of 2 shapes read" in done.stdout
    assert re.search(r"^Not modelled: mesh, .*concave", done.stdout, re.MULTILINE)
    assert done.stderr == ""
    (told,) = json.loads(overlapper("run", "bent.py", "--json").stdout)["skipped"]
    assert (told["name"], told["first_step"], told["diverged"]) == ("mesh", 1, False)
    (tmp_path / "bent.py").write_text(f'"""Bent."""{BENT}')
    checked("bent.py", "--record")
    recorded = checked("bent.py")
    done = overlapper("view", "bent.py", "--png", "bent.png")
    assert done.returncode == 1 and "Not modelled: mesh, " in done.stderr
    assert recorded[0] == 0 and "    note: not modelled: mesh, " in recorded[1]


CROSSES = '''
"""Two crosses of three bars, 0.2 apart: in each, all bars lie over the middle."""
import pybullet as p

STEPS = 2
PAIRS = "all"  # a filter keeps them where they are


def build(client):
    bars = [[0.3, 0.1, 0.1], [0.1, 0.3, 0.1], [0.1, 0.1, 0.3]]
    for x in (0.0, 0.2):
        cross = p.createCollisionShapeArray(
            [p.GEOM_BOX] * 3, halfExtents=bars, collisionFramePositions=[[0, 0, 0]] * 3, physicsClientId=client
        )
        p.createMultiBody(x, cross, basePosition=[x, 0, 0], physicsClientId=client)
    p.setCollisionFilterPair(0, 1, -1, -1, 0, physicsClientId=client)
'''


FILTERED = '''"""Two cubes that a pair filter keeps apart, and a third."""
import pybullet as p
STEPS = 1
def build(client):
    cube = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.5] * 3, physicsClientId=client)
    for x in (0, 0.9, 1.8):
        p.createMultiBody(1, cube, basePosition=[x, 0, 0], physicsClientId=client)
    p.setCollisionFilterPair(0, 1, -1, -1, 0, physicsClientId=client)
'''


def test_pairs_are_those_that_the_scene_lets_collide_or_all(tmp_path):
    (tmp_path / "filtered.py").write_text(FILTERED)
    for options, count in (((), 1), (("--pairs", "all"), 2)):
        answer = json.loads(overlapper("run", "filtered.py", "--json", *options).stdout)
        assert len(answer["pairs"]) == answer["report"]["pairs_overlapping"] == count


def test_links_as_a_whole_are_measured_where_their_shapes_overlap_each_other(tmp_path):
    (tmp_path / "crosses.py").write_text(CROSSES)
    done = overlapper("run", "crosses.py", "--json", "--out", "shapes.csv")
    (pair,) = json.loads(done.stdout)["pairs"]
    # Each middle lies in an arm of the other.
    assert pair["largest_volume_m3"] == pytest.approx(2 * 0.2**3, rel=1e-6)
    assert pair["volume_error_m3"] < 1e-12
    overlapper("run", "crosses.py", "--per", "link", "--out", "links.csv")
    shapes, links = (read_table(tmp_path / name) for name in ("shapes.csv", "links.csv"))
    assert [row["step"] for row in links] == [1, 2]
    for row in links:
        assert row["shapeA"] is row["shapeB"] is row["area_m2"] is None
        assert (row["nameA"], row["nameB"], row["status"]) == ("body 0", "body 1", "overlapping")
        assert row["volume_m3"] == pytest.approx(2 * 0.2**3, rel=1e-6)
        step = [each for each in shapes if each["step"] == row["step"]]
        assert sum(each["volume_m3"] for each in step) > 1.4 * row["volume_m3"]
        assert row["depth_m"] == max(each["depth_m"] for each in step)


CUP = '''
"""A ball lies a centimetre deep in an open box that is one concave mesh."""
import pybullet as p

STEPS = 1
PAIRS = "all"  # a filter keeps them where they are


def build(client):
    corners = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    corners += [[x, y, z] for x in (-0.8, 0.8) for y in (-0.8, 0.8) for z in (-0.8, 1)]
    bottom, well = [0, 2, 6, 4], [8, 12, 14, 10]
    walls = [[0, 4, 5, 1], [4, 6, 7, 5], [6, 2, 3, 7], [2, 0, 1, 3]]
    inside = [[8, 9, 13, 12], [12, 13, 15, 14], [14, 15, 11, 10], [10, 11, 9, 8]]
    rim = [[1, 5, 13, 9], [5, 7, 15, 13], [7, 3, 11, 15], [3, 1, 9, 11]]
    quads = [bottom, well, *walls, *inside, *rim]
    indices = [corner for a, b, c, d in quads for corner in (a, b, c, a, c, d)]
    cup = p.createCollisionShape(
        p.GEOM_MESH, vertices=corners, indices=indices, meshScale=[0.1] * 3, physicsClientId=client
    )
    p.createMultiBody(0, cup, physicsClientId=client)
    ball = p.createCollisionShape(p.GEOM_SPHERE, radius=0.03, physicsClientId=client)
    p.createMultiBody(1, ball, basePosition=[0, 0, -0.06], physicsClientId=client)
    p.setCollisionFilterPair(0, 1, -1, -1, 0, physicsClientId=client)
    p.setGravity(0, 0, 0, physicsClientId=client)
'''


def test_a_concave_mesh_is_named_with_its_parts_and_where_they_are_kept(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "cup.py").write_text(CUP)
    first, second = (overlapper("run", "cup.py") for _ in range(2))
    assert first.stdout == second.stdout
    assert "CoACD decomposes a mesh of 28 triangles, once" in first.stderr and second.stderr == ""
    words = r"^Concave: mesh is (\d+) convex parts of (\S+) m³ together, the mesh bounds (\S+) m³; kept in (.*)\.$"
    parts, volume, mesh, path = re.search(words, first.stdout, re.MULTILINE).groups()
    assert int(parts) >= 5
    assert float(mesh) == pytest.approx(8e-3 - 0.16**2 * 0.18, rel=1e-3)
    assert float(volume) == pytest.approx(float(mesh), rel=0.05)
    assert (tmp_path / "cache") in Path(path).parents and Path(path).is_file()
    (pair,) = json.loads(overlapper("run", "cup.py", "--json").stdout)["pairs"]
    cap = 3.14159 * 0.01**2 * (0.09 - 0.01) / 3  # of a ball of 3 cm, 1 cm high
    assert pair["largest_volume_m3"] == pytest.approx(cap, rel=0.05)
    skipped = overlapper("run", "cup.py", "--concave", "skip")
    assert "Not modelled: mesh, a concave mesh is left out" in skipped.stdout


def test_a_threshold_out_of_range_is_refused():
    assert refusal("run", "two_cubes.py", "--concave-threshold", "2") == (
        "overlapper: --concave-threshold must lie between 0.01 and 1, not 2.0\n"
    )


def test_a_run_prints_a_table_of_pairs_with_units():
    done = overlapper("run", "two_cubes.py")
    assert done.returncode == 0
    lines = done.stdout.splitlines()
    quantities, units, _, first, second = lines[next(k for k, line in enumerate(lines) if "volume" in line) :][:5]
    assert quantities.split() == ["volume", "±", "depth", "normal", "at"]
    assert units.split() == ["pair", "of", "links", "steps", "cm³", "cm³", "mm", "x,", "y,", "z", "step"]
    assert first.split()[0] == "box#0"
    assert second.split() == ["box#1"]
    steps, volume, _, depth, *normal, _ = first.split()[1:]
    assert (steps, volume, depth, normal) == ("8", "200", "20", ["+0.00", "+0.00", "-1.00"])
    assert "2 of 2 shapes read" in done.stdout
    assert done.stderr == "a scene may talk\n"


def test_stdout_has_nothing_but_json():
    done = overlapper("run", "two_cubes.py", "--steps", "3", "--json", "--check", "fcl", "--out", "two.csv")
    summary = json.loads(done.stdout)
    (pair,) = summary["pairs"]
    assert pair["links"] == {"bodyA": 0, "linkA": -1, "bodyB": 1, "linkB": -1}
    assert pair["steps_overlapping"] == 3
    assert pair["largest_volume_m3"] == pytest.approx(2e-4)
    assert pair["largest_depth_m"] == pytest.approx(0.02)
    assert pair["normal"] == pytest.approx([0, 0, -1])
    assert summary["report"]["pairs_examined"] == 3
    assert summary["fcl"] == {"agree": 3}
    assert summary["out"] == "two.csv"


def test_a_run_writes_its_table_and_its_recording():
    done = overlapper("run", "two_cubes.py", "--out", "made/two.csv", "--html", "made/two.html", "--check", "fcl")
    assert done.returncode == 0
    rows = read_table(Path("made/two.csv"))
    assert [row["step"] for row in rows] == list(range(1, 9))
    assert all(row["volume_m3"] == pytest.approx(2e-4) and row["fcl"] == "agree" for row in rows)
    with open("made/two.html", encoding="utf-8") as page:
        assert page.read(100).lstrip().lower().startswith("<!doctype html>")
    assert "FCL on 8 pairs that overlap or touch: 8 agree." in done.stdout
    assert "made/two.csv" in done.stdout and "made/two.html" in done.stdout


@pytest.mark.parametrize("method", ["auto", "paper"])
def test_both_methods_find_the_same_overlap(method):
    summary = json.loads(overlapper("run", "two_cubes.py", "--steps", "1", "--method", method, "--json").stdout)
    assert summary["settings"]["method"] == method
    assert summary["pairs"][0]["largest_volume_m3"] == pytest.approx(2e-4)


def test_an_unknown_scene_is_refused_with_the_nearest():
    assert re.fullmatch(
        r"overlapper: there is no scene 'box_pil'; the nearest is 'box_pile' \(known scenes: .*\)\n",
        refusal("run", "box_pil"),
    )


def test_a_broken_scene_is_refused_with_what_pybullet_said_of_it(tmp_path):
    (tmp_path / "broken.py").write_text(
        "import pybullet as p\nSTEPS = 1\ndef build(c):\n  p.loadURDF('no.urdf', physicsClientId=c)"
    )
    assert refusal("run", "broken.py") == (
        "overlapper: the scene broken.py cannot be built at line 4: error: Cannot load URDF file "
        "(URDF file 'no.urdf' not found)\n"
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--steps", "0"], "'--steps'"),
        (["--steps", "many"], "'--steps'"),
        (["--method", "guess"], "'auto', 'paper'"),
        (["--check", "gut"], "'fcl'"),
        (["--check", "mujoco"], "--check mujoco needs a simulation of MuJoCo, but bullet runs"),
        (["--tolerance", "0"], "--tolerance must lie between 0 and 1, not 0.0"),
        (["--tolerance", "nan"], "--tolerance must lie between 0 and 1, not nan"),
        (["--out", "two.txt"], "--out must end in .csv, .parquet, .sqlite, not 'two.txt'"),
        (["--out", "two_cubes.py/two.csv"], "cannot write two_cubes.py"),
        (["--html", "."], "cannot write ."),
        (["--colour"], "--colour"),
    ],
)
def test_a_bad_option_is_refused_in_one_sentence(arguments, words):
    sentence = refusal("run", "two_cubes.py", *arguments)
    assert sentence.startswith("overlapper: ")
    assert words in sentence
    assert sentence.count("\n") == 1


@pytest.mark.parametrize(
    ("module", "arguments", "packages"),
    [
        ("typer", [], "typer rich"),
        ("rich", [], "typer rich"),
        ("pybullet", [], "pybullet, or conda install -c conda-forge pybullet"),
        ("fcl", ["--check", "fcl"], "python-fcl"),
        ("meshcat", ["--html", "two.html"], "meshcat"),
        ("pyarrow", ["--out", "two.parquet"], "pyarrow"),
    ],
)
def test_a_missing_library_is_named_with_what_installs_it(module, arguments, packages):
    program = f"""
import importlib.util, sys
found = importlib.util.find_spec
importlib.util.find_spec = lambda name, *rest: None if name == {module!r} else found(name, *rest)
sys.modules[{module!r}] = None
sys.argv = ["overlapper", "run", "two_cubes.py", *{arguments!r}]
from overlapper.cli import main
main()
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("overlapper: ")
    assert f"pip install {packages}\n" in done.stderr


@pytest.mark.parametrize("ending", ["csv", "parquet", "sqlite"])
def test_rows_before_a_failure_are_on_disk(tmp_path, ending):
    (tmp_path / "fails.py").write_text(FAILS_LATE)
    sentence = refusal("run", "fails.py", "--out", f"fails.{ending}", "--html", "fails.html")
    left = f"fails.unfinished.{ending.replace('parquet', 'csv')}"
    assert sentence.endswith(
        "fails before step 6 at line 17: AssertionError: no more; "
        f"the steps before are in {left} and fails.unfinished.html\n"
    )
    assert [row["step"] for row in read_table(tmp_path / left)] == [1, 2, 3, 4, 5]
    assert (tmp_path / "fails.unfinished.html").stat().st_size > 0
    assert not (tmp_path / f"fails.{ending}").exists() and not (tmp_path / "fails.html").exists()


def size_of(pattern):
    return sum(path.stat().st_size for path in Path().glob(pattern))


def interrupted(*args, said, after, grown=None):
    """Its output and its complaints, if Ctrl-C comes so many seconds after the scene has said that.

    With `grown`, the seconds begin when the files of this pattern have grown.
    """
    command = [sys.executable, "-m", "overlapper", *args]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert process.stderr.readline() == said + "\n"
        if grown:
            before = size_of(grown)
            while size_of(grown) <= before and process.poll() is None:
                time.sleep(0.01)
        time.sleep(after)
        process.send_signal(signal.SIGINT)
        output, complaints = process.communicate(timeout=30)
    assert process.returncode == 130
    return output, complaints


def test_ctrl_c_while_the_commands_are_imported_ends_without_a_traceback():
    code = (
        "import sys\n"
        "class Interrupting:\n"
        "    def find_spec(self, name, path, target=None):\n"
        "        if name == 'overlapper.cli.watch': raise KeyboardInterrupt\n"
        "sys.meta_path.insert(0, Interrupting())\n"
        "import overlapper.cli\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "overlapper: interrupted\n")


@pytest.mark.parametrize("library", ["typer", "rich"])
def test_ctrl_c_while_a_library_of_the_command_line_is_imported_is_one_line(library, tmp_path):
    (tmp_path / f"{library}.py").write_text("raise KeyboardInterrupt")
    done = subprocess.run(
        [sys.executable, "-m", "overlapper", "scenes"],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "overlapper: interrupted\n")


@pytest.mark.parametrize("ending", ["csv", "parquet", "sqlite"])
def test_rows_before_an_interruption_are_on_disk(tmp_path, ending):
    (tmp_path / "long.py").write_text(LONG)
    table = f"long.{ending}"
    output, _ = interrupted("run", "long.py", "--out", table, said="a scene may talk", after=0.3, grown="*.unfinished*")
    steps = [row["step"] for row in read_table(tmp_path / table)]
    assert steps == list(range(1, len(steps) + 1))
    said = re.search(r"Interrupted after step (\d+)", output)
    assert said is not None
    assert len(steps) - int(said[1]) in (0, 1)


@pytest.mark.parametrize("command", ["run", "view"])
def test_an_early_interruption_writes_nothing_and_says_so(tmp_path, command):
    (tmp_path / "slow.py").write_text(SLOW)
    (tmp_path / "old.html").write_text("of yesterday")
    options = ["--out", "old.csv"] if command == "run" else []
    output, complaints = interrupted(command, "slow.py", "--html", "old.html", *options, said="here", after=0)
    assert output == ""
    assert complaints.strip() == "overlapper: interrupted; nothing was written"
    assert (tmp_path / "old.html").read_text() == "of yesterday"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["old.html", "slow.py", "two_cubes.py"]


def test_a_view_that_is_interrupted_writes_what_came_before(tmp_path):
    (tmp_path / "long.py").write_text(LONG)
    output, _ = interrupted("view", "long.py", "--html", "long.html", said="a scene may talk", after=0.5)
    assert output == "Written: long.html\n"
    assert (tmp_path / "long.html").stat().st_size > 100_000


@pytest.mark.parametrize("ending", ["csv", "parquet", "sqlite"])
def test_a_scene_that_cannot_be_built_costs_no_earlier_table(tmp_path, ending):
    (tmp_path / "bad.py").write_text("STEPS = 1\ndef build(client):\n    raise ValueError('typo')")
    (tmp_path / f"old.{ending}").write_text("of yesterday")
    assert refusal("run", "bad.py", "--out", f"old.{ending}").endswith("at line 3: ValueError: typo\n")
    assert (tmp_path / f"old.{ending}").read_text() == "of yesterday"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bad.py", f"old.{ending}", "two_cubes.py"]


# Beyond its limit, whatever the process writes is refused by the system, as by a disk that is full.
FULL = TWO_CUBES.replace("STEPS = 8", "STEPS = 200").replace(
    'assert i < STEPS, "no more"', "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM, ROOM))"
)


@pytest.mark.parametrize("ending", ["csv", "parquet", "sqlite", "html"])
@pytest.mark.parametrize("room", [0, 2500, 12_000])
def test_a_disk_that_is_full_costs_no_earlier_file(tmp_path, ending, room):
    (tmp_path / f"old.{ending}").write_text("of yesterday")
    (tmp_path / "full.py").write_text(FULL.replace("ROOM", str(room)))
    said = refusal("run", "full.py", "--html" if ending == "html" else "--out", f"old.{ending}", run=in_a_process)
    assert said.startswith("overlapper: cannot write ") and said.count("\n") == 1
    assert (tmp_path / f"old.{ending}").read_text() == "of yesterday"
    kept = tmp_path / f"old.unfinished.{ending.replace('parquet', 'csv')}"
    assert ("; the steps before are in" in said) == kept.exists()
    if kept.exists():
        steps = [row["step"] for row in read_table(kept)]
        assert steps == list(range(1, len(steps) + 1))


LACKING = {
    "room": (
        "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (2500, 2500))",
        "overlapper: the scene lacking.py cannot be read: the physics server of physicsClientId 0 could not write its",
    ),
    "memory": (
        "import overlapper.simulation as s; s.Bodies.overlaps = lambda *_, **__: (_ for _ in ()).throw(MemoryError())",
        "overlapper: there is not enough memory for this",
    ),
    "processes": (
        "import subprocess; subprocess.Popen = lambda *_, **__: open('/no/such/place')",
        "overlapper: overlapper.reference cannot start FCL: its process could not be started (",
    ),
}


@pytest.mark.parametrize("what", LACKING)
def test_a_run_that_lacks_something_costs_no_earlier_file_and_says_what_it_lacks(tmp_path, what):
    line, sentence = LACKING[what]
    (tmp_path / "old.csv").write_text("of yesterday")
    built = TWO_CUBES.replace("def build(client):", f"def build(client):\n    {line}")
    assert built != TWO_CUBES
    (tmp_path / "lacking.py").write_text(built)
    said = refusal("run", "lacking.py", "--out", "old.csv", "--check", "fcl", run=in_a_process)
    assert said.startswith(sentence) and said.count("\n") == 1
    assert (tmp_path / "old.csv").read_text() == "of yesterday"
    assert not (tmp_path / "old.unfinished.csv").exists()


def test_names_reach_no_terminal_with_their_escapes(tmp_path):
    link = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    link += '<collision><geometry><box size="1 1 1"/></geometry></collision>'
    tip = '<link name="tip"/><joint name="j" type="fixed"><parent link="a\x1b[31mred"/><child link="tip"/></joint>'
    (tmp_path / "red.urdf").write_text(f'<robot name="r\x1b[31m"><link name="a\x1b[31mred">{link}</link>{tip}</robot>')
    (tmp_path / "red.py").write_text(
        'PAIRS = "all"\nSTEPS = 1\nimport pybullet as p\n'
        "def build(client):\n    for _ in range(2): p.loadURDF('red.urdf', physicsClientId=client)\n"
    )
    (tmp_path / "bad.py").write_text("STEPS = 1\ndef build(client):\n    raise ValueError('\x1b[31m')")
    (tmp_path / "scenes").mkdir()
    (tmp_path / "scenes" / "blue.py").write_text('"""In \x1b[34mblue."""')
    for command in (
        ["shapes", "\x1b[31m.urdf"],
        ["run", "red.py", "--out", "red.csv"],
        ["run", "bad.py"],
        ["view", "\x1b[31m.csv"],
        ["diff", "\x1b[31m.csv", "red.csv"],
        ["scenes"],
    ):
        done = overlapper(*command)
        assert "\x1b[3" not in done.stdout + done.stderr
        assert "\\x1b[3" in done.stdout + done.stderr
    assert "\x1b" not in (tmp_path / "red.csv").read_text()


def checked(*arguments):
    """Exit code, stdout and stderr of `overlapper check`."""
    done = overlapper("check", *arguments)
    return done.returncode, done.stdout, done.stderr


@pytest.fixture
def two_scenes(tmp_path):
    """A folder of scenes that are as recorded."""
    (tmp_path / "guarded" / "deeper").mkdir(parents=True)
    for path in ("one.py", "deeper/two.py"):
        (tmp_path / "guarded" / path).write_text(TWO_CUBES)
    (tmp_path / "guarded" / "no_scene.py").write_text("STEPS = 8")
    assert checked("guarded", "--record")[0] == 0
    return tmp_path / "guarded"


def test_scenes_as_recorded_are_checked_with_exit_code_0(two_scenes):
    code, said, complaints = checked("guarded")
    assert (code, complaints.replace("a scene may talk\n", "")) == (0, "")
    assert said == "guarded/deeper/two.py: as recorded\nguarded/one.py: as recorded\n"


def test_a_scene_that_has_moved_is_told_with_exit_code_1(two_scenes):
    (two_scenes / "one.py").write_text(TWO_CUBES.replace("[0, 0, 0.08]", "[0, 0, 0.07]"))
    code, said, _ = checked("guarded", "--out", "pages")
    assert code == 1
    assert said.startswith("guarded/deeper/two.py: as recorded\nguarded/one.py: moved\n    geometry  as recorded")
    assert "    dynamics  4 moved" in said
    assert "off by 0.01 where 0.0001 is allowed, 100 times its budget" in said
    assert "before and after: pages/one.moved.html" in said
    assert [path.name for path in Path("pages").iterdir()] == ["one.moved.html"]


def test_scenes_of_one_name_have_a_page_each(two_scenes):
    (two_scenes / "deeper" / "two.py").rename(two_scenes / "deeper" / "one.py")
    (two_scenes / "deeper" / "expected" / "two.csv").rename(two_scenes / "deeper" / "expected" / "one.csv")
    for path in ("one.py", "deeper/one.py"):
        (two_scenes / path).write_text(TWO_CUBES.replace("[0, 0, 0.08]", "[0, 0, 0.07]"))
    assert checked("guarded", "--out", "pages")[0] == 1
    names = {"deeper-one.moved.html", "guarded-one.moved.html"}
    assert {path.name for path in Path("pages").iterdir()} == names


LOST = """
        if i == 4:
            p.resetBasePositionAndOrientation(1, [float("nan")] * 3, [0, 0, 0, 1], physicsClientId=client)
"""
DIVERGES = TWO_CUBES.replace('"no more"\n', f'"no more"{LOST}')


def test_a_scene_that_diverges_has_moved_and_is_not_recorded(two_scenes):
    (two_scenes / "one.py").write_text(DIVERGES)
    code, said, _ = checked("guarded/one.py")
    assert code == 1 and "box#1" in said and "note      not modelled: box#1, it has no finite pose" in said
    code, said, complaints = checked("guarded/one.py", "--record")
    assert (code, said) == (2, "")
    assert complaints.endswith("overlapper: guarded/one.py is not recorded, because box#1 diverged in step 6\n")
    done = overlapper("run", "guarded/one.py", "--out", "one.csv")
    assert done.returncode == 1 and "\nNot modelled from step 5 on: box#1, it has no finite pose" in done.stdout
    assert overlapper("run", "guarded/deeper/two.py", "--out", "two.csv").returncode == 0
    done = overlapper("diff", "one.csv", "two.csv")
    assert done.returncode == 1
    assert done.stdout.startswith("left out  moved\n    by one.csv alone: box#1 from step 5 on, it has no finite pose")
    assert overlapper("diff", "one.csv", "one.csv").stdout.startswith("left out  the same\n")


def test_a_new_scene_is_written_with_exit_code_1_once(two_scenes):
    (two_scenes / "three.py").write_text(TWO_CUBES)
    assert checked("guarded/three.py")[:2] == (
        1,
        "guarded/three.py: new\n    written: guarded/expected/three.csv\n"
        "    look at the file and commit it: later runs are compared with it\n",
    )
    assert checked("guarded/three.py")[0] == 0


def test_scenes_that_cannot_be_run_are_told_with_exit_code_2_after_all_others(two_scenes):
    (two_scenes / "deeper" / "two.py").write_text(FAILS_LATE)
    (two_scenes / "one.py").write_text(TWO_CUBES.replace("[0, 0, 0.08]", "[0, 0, 0.07]"))
    code, said, complaints = checked("guarded")
    assert code == 2
    assert "guarded/one.py: moved" in said
    assert "overlapper: the scene guarded/deeper/two.py fails before step 6 at line 17: AssertionError" in complaints


@pytest.mark.parametrize("workers", ["1", "2"])
def test_scenes_are_told_in_their_order_by_however_many_processes(two_scenes, workers):
    # The first is the last to be through.
    (two_scenes / "a.py").write_text(
        TWO_CUBES.replace("a scene may talk", "a talks").replace("STEPS = 8", "STEPS = 300")
    )
    for name in "bcd":
        (two_scenes / f"{name}.py").write_text(TWO_CUBES.replace("a scene may talk", f"{name} talks"))
    (two_scenes / "c.py").write_text(FAILS_LATE)
    for path in (two_scenes / "deeper").glob("*.py"):
        path.unlink()
    code, said, complaints = checked("guarded", "guarded/../guarded/a.py", "--workers", workers)
    assert code == 2
    assert re.findall(r"^guarded.*", said, re.MULTILINE) == [
        "guarded/a.py: new",
        "guarded/b.py: new",
        "guarded/d.py: new",
        "guarded/one.py: as recorded",
    ]
    assert list(dict.fromkeys(complaints.splitlines())) == [
        "a talks",
        "b talks",
        "a scene may talk",
        "overlapper: the scene guarded/c.py fails before step 6 at line 17: AssertionError: no more",
        "d talks",
    ]


def test_scenes_that_end_their_process_are_told_with_exit_code_2(two_scenes):
    dies = "import os; os.abort()\n    print("
    # As a fault of this package would be.
    faulty = "import overlapper.scenes.check as check\ncheck.examine = lambda *_: 1 / 0\nimport pybullet"
    (two_scenes / "one.py").write_text(TWO_CUBES.replace("print(", dies))
    (two_scenes / "deeper" / "two.py").write_text(TWO_CUBES.replace("import pybullet", faulty))
    code, said, complaints = checked("guarded/one.py", "guarded/deeper/two.py")
    assert (code, said) == (2, "")
    assert complaints == (
        "overlapper: guarded/one.py: its process ended with signal SIGABRT\n"
        "overlapper: guarded/deeper/two.py: ZeroDivisionError: division by zero\n"
    )


@pytest.mark.parametrize("workers", ["1", "2"])
def test_ctrl_c_ends_a_check(two_scenes, workers):
    (two_scenes / "one.py").write_text(
        TWO_CUBES.replace("def build(client):", "def build(client):\n    wait()", 1) + WAIT
    )
    words = ["check", "guarded/one.py", "guarded/deeper/two.py", "--workers", workers]
    with subprocess.Popen([sys.executable, "-m", "overlapper", *words], stdout=-1, stderr=-1, text=True) as process:
        deadline = time.monotonic() + 30
        while not Path("waits").exists() and time.monotonic() < deadline:
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        said, complaints = process.communicate(timeout=30)
    assert (process.returncode, said) == (130, "")
    assert complaints == "overlapper: interrupted; nothing was written\n"
    waiting = int(Path("waits").read_text())
    assert waiting == process.pid or not psutil.pid_exists(waiting)


def test_scenes_are_refused_if_no_process_can_start(two_scenes, monkeypatch):
    def lacking(*_, **__):
        raise OSError(12, "Cannot allocate memory")

    monkeypatch.setattr(subprocess, "Popen", lacking)
    with pytest.raises(Refused, match=r"^a worker process could not be started \(.*Cannot allocate memory\)$"):
        check([two_scenes])


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda folder: folder / "nowhere", "there is no scene file"),
        (lambda folder: folder / "expected", "the folder"),
        (
            lambda folder: (folder / "expected" / "one.csv").write_text("# steps") and folder,
            "expected/one.csv is not a table of overlaps: it has no columns",
        ),
    ],
)
def test_arguments_that_cannot_be_checked_are_refused(two_scenes, spoil, words):
    code, _, complaints = checked(str(spoil(two_scenes)))
    assert code == 2
    assert words in complaints


def test_tables_are_compared(two_scenes):
    def diff(*tables):
        done = overlapper("diff", *tables)
        return done.returncode, done.stdout + done.stderr

    overlapper("run", "two_cubes.py", "--out", "before.csv")
    overlapper("run", "two_cubes.py", "--out", "same.sqlite")
    Path("two_cubes.py").write_text(TWO_CUBES.replace("[0, 0, 0.08]", "[0, 0, 0.07]"))
    overlapper("run", "two_cubes.py", "--out", "after.csv")
    assert diff("before.csv", "same.sqlite") == (0, "poses     the same\noverlaps  the same\n")
    code, said = diff("before.csv", "after.csv")
    assert code == 1
    assert "poses     8 moved" in said
    assert "step 8, 0/-1/0 and 1/-1/0: volume_m3 is 0.0003, recorded as 0.0002: off by 0.0001" in said
    assert diff("before.csv", "nowhere.csv") == (2, "overlapper: nowhere.csv: No such file or directory\n")
    assert diff("two_cubes.py", "after.csv")[0] == 2


def test_a_bar_is_drawn_on_a_terminal_only(tmp_path):
    assert "two_cubes" not in overlapper("run", "two_cubes.py", "--json").stderr
    pty = pytest.importorskip("pty")
    mine, theirs = pty.openpty()
    command = [sys.executable, "-m", "overlapper", "run", "two_cubes.py", "--json"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=theirs, env=os.environ | {"TERM": "xterm"}):
        os.close(theirs)
        seen = b""
        try:
            while part := os.read(mine, 4096):
                seen += part
        except OSError:  # Linux's way to say that the other end is closed
            pass
    os.close(mine)
    assert b"two_cubes" in seen
