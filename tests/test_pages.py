"""The README and the docs run as they are pasted: the blocks of a page one after the other, in an empty folder.

Python shares one namespace and one process per page. A command in `sh` exits with 0, or with 1 where that is an answer.
A `console` block shows a command and its output; `...` stands for text that differs between runs. `text` is no code.
"""

import contextlib
import doctest
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = [str(page.relative_to(ROOT)) for page in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))]
BLOCK = re.compile(r"^```([^`\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
# .ci/run runs the commands that make the environment. test_live.py runs the commands that wait for Ctrl-C.
ELSEWHERE = re.compile(r"(make|python3 -m venv|\. env/bin/activate|pip install|conda install)\b|.* --live\b")
# Commands that run no scene and no script share the process of their page: trimesh alone takes a second to import.
SHARES_THE_PROCESS = re.compile(r"overlapper (audit|clashes|intersect|shapes)\b")
# These exit with 1 if something overlaps, has moved or is skipped.
ANSWERS_BY_EXIT_CODE = re.compile(r"overlapper (audit|clashes|check|diff|shapes)\b|pytest\b")

LOOP = """
import sys
import pybullet
import pybullet_data

assert sys.argv[1:] in ([], ["--seed", "3"])
pybullet.connect(pybullet.DIRECT)
pybullet.setAdditionalSearchPath(pybullet_data.getDataPath())
pybullet.setGravity(0, 0, -9.8)
pybullet.loadURDF("plane.urdf")
pybullet.loadURDF("r2d2.urdf", [0, 0, 0.5])
for _ in range(20):
    pybullet.stepSimulation()
"""


def blocks(page):
    """(line, language, text) of each block that is not a directive of Sphinx."""
    text = (ROOT / page).read_text(encoding="utf-8")
    found = [(text.count("\n", 0, block.start(2)), block[1], block[2]) for block in BLOCK.finditer(text)]
    return [block for block in found if not block[1].startswith("{")]


def run(page):
    """All blocks, as the one thing that this process does."""
    namespace = {"__name__": "__main__"}
    for line, language, text in blocks(page):
        if language == "python":
            with contextlib.redirect_stdout(sys.stderr):
                exec(compile("\n" * line + text, page, "exec"), namespace)
        elif language == "sh":
            for command in text.splitlines():
                shell(page, command)
        elif language == "console":
            for command, shown in re.findall(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", text, re.MULTILINE):
                said = "".join(f"{line.rstrip()}\n" for line in shell(page, command).strip("\n").splitlines())
                if not doctest.OutputChecker().check_output(shown, said, doctest.ELLIPSIS):
                    sys.exit(f"{page}: {command} printed\n{said}")


def shell(page, command):
    """The output of the command. A command that fails ends the page."""
    if ELSEWHERE.match(command):
        return ""
    if SHARES_THE_PROCESS.match(command) and not of_the_shell(command):
        from command import overlapper

        done = overlapper(*shlex.split(command, comments=True)[1:])
    else:
        done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=300)
    if done.returncode not in ((0, 1) if ANSWERS_BY_EXIT_CODE.match(command) else (0,)) or "Traceback" in done.stderr:
        sys.exit(f"{page}: {command} ended with {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def of_the_shell(command):
    """Whether a command has more than words, quoted words and a comment."""
    return re.search(r"[|&;<>$`*?~\\\[{]", re.sub(r"""#.*|"[^"$`\\]*"|'[^']*'""", "", command))


def meshes(folder):
    import trimesh

    folder.mkdir(exist_ok=True)
    for seed, name in enumerate(("bolt.stl", "plate.obj", "bracket.stl")):
        trimesh.creation.icosphere(2, 0.1).apply_translation([0.1 * seed, 0, 0]).export(folder / name)


def parts(folder):
    import bearing

    bearing.write(folder / "parts")


def assembly(folder):
    from step_text import step_text

    pytest.importorskip("cascadio")
    cube = [[x, y, z] for z in (0, 10.0) for x, y in ((0, 0), (10, 0), (10, 10), (0, 10))]
    rings = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    bodies = {"wheel": (np.array(cube), rings), "axle": (np.array(cube) + 5, rings)}
    (folder / "gearbox.step").write_text(step_text(bodies))


def table(folder):
    scene = ROOT / "examples" / "ci" / "scenes" / "crates.py"
    command = [sys.executable, "-m", "overlapper", "run", scene, "--out", folder / "run.csv", "--json"]
    subprocess.run(command, check=True, capture_output=True)
    for name in ("monday.csv", "tuesday.csv"):
        shutil.copy(folder / "run.csv", folder / name)


def database(folder):
    from overlapper import random_polytope, write_polytopes

    polytopes = ((10 + seed, random_polytope(30, "ball", rng=seed)) for seed in range(3))
    write_polytopes(f"sqlite:///{folder / 'parts.db'}", polytopes)


def turntable(path):
    import robots

    robots.turntable(path)


def model(name):
    import pybullet_data

    return Path(pybullet_data.getDataPath(), name)


# Files of the reader that pages name: scripts, scenes, models, meshes, tables.
OF_THE_READER = {
    "my_script.py": lambda folder: (folder / "my_script.py").write_text(LOOP),
    "plain.py": lambda folder: (folder / "plain.py").write_text(LOOP),
    "my_scene.py": lambda folder: shutil.copy(ROOT / "examples/ci/scenes/crates.py", folder / "my_scene.py"),
    "pytest scenes": lambda folder: shutil.copytree(ROOT / "examples/ci", folder, dirs_exist_ok=True),
    "scenes/expected": lambda folder: shutil.copytree(ROOT / "scenes/expected", folder / "scenes/expected"),
    "run.csv": table,
    "monday.csv": table,
    "robot.urdf": lambda folder: shutil.copy(model("block.urdf"), folder / "robot.urdf"),
    "audit assets": lambda folder: meshes(folder / "assets"),
    "arm.urdf": lambda folder: turntable(folder / "arm.urdf"),
    "humanoid.xml": lambda folder: shutil.copy(model("mjcf/humanoid.xml"), folder / "humanoid.xml"),
    "panda/panda.urdf": lambda folder: shutil.copytree(model("franka_panda"), folder / "panda"),
    "clashes parts": parts,
    "gearbox.step": assembly,
    "sqlite:///parts.db": database,
    "bolt.stl": meshes,
    "bracket.stl": meshes,
}


def test_the_pages_that_are_known_have_code():
    assert sum(bool(blocks(page)) for page in PAGES) > 8


@pytest.mark.parametrize("page", PAGES)
def test_a_block_says_what_it_is(page):
    assert {language for _, language, _ in blocks(page)} <= {"python", "sh", "console", "text"}


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page)])
def test_a_page_runs_as_it_is_pasted(page, tmp_path):
    pasted = "".join(text for _, _, text in blocks(page))
    for name, give in OF_THE_READER.items():
        if re.search(rf"\b{re.escape(name)}\b", pasted):
            give(tmp_path)
    env = os.environ | {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "XDG_CACHE_HOME": str(tmp_path / "cache"),
        "MPLBACKEND": "agg",
    }
    done = subprocess.run([sys.executable, __file__, page], cwd=tmp_path, env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-4000:]


@pytest.mark.parametrize(
    ("block", "why"),
    [
        ("python\nundefined", "undefined"),
        ("sh\nls no_such_scene", "ended with 2"),
        ("console\n$ echo '1.50 s, 3 pairs'\n... s, 4 pairs", "printed\n1.50 s, 3 pairs"),
    ],
)
def test_a_page_that_does_not_run_is_reported(block, why, tmp_path):
    (tmp_path / "page.md").write_text(f"```{block}\n```\n")
    done = subprocess.run([sys.executable, __file__, tmp_path / "page.md"], capture_output=True, text=True)
    assert done.returncode == 1 and why in done.stderr


@pytest.mark.parametrize(
    ("command", "shell"),
    [
        ('overlapper clashes parts --expect "bolt*,plate*"  # glTF, 3MF; or STEP', False),
        ("overlapper clashes parts/*.stl", True),
        ("overlapper audit arm.urdf > pairs.txt", True),
        ('overlapper audit "$ROBOT"', True),
    ],
)
def test_a_command_of_the_shell_is_given_to_it(command, shell):
    assert bool(of_the_shell(command)) == shell


def test_output_that_differs_between_runs_may_be_left_out(tmp_path):
    (tmp_path / "page.md").write_text("```console\n$ echo '1.50 s, 4 pairs'\n... s, 4 pairs\n$ echo 2\n2\n```\n")
    subprocess.run([sys.executable, __file__, tmp_path / "page.md"], check=True)


if __name__ == "__main__":
    sys.path.append(str(ROOT / "tests" / "support"))
    run(sys.argv[1])
