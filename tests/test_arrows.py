"""The arrows between the parts of the house point down, in Python and in C++, and each library has one room."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NATIVE = ROOT / "overlapper" / "native"

# The sources that are here are looked at, not the package that is installed.
LINTER = """
import sys
sys.meta_path[:] = [finder for finder in sys.meta_path if "editable" not in type(finder).__module__]
sys.path.insert(0, "")
from importlinter.cli import lint_imports_command
lint_imports_command()
"""

# The folders of the core from above down: a file may include those of its own and of lower ones.
FLOORS = ["python", "batch", "motion", "overlap", "methods", "distance", "shapes", "forces", "geometry"]

# The ways that know nothing of each other.
APART = ["methods/clipping", "methods/tracing", "methods/dual"]

# The folders of the ways for round pairs, each with those that its files may include.
ROUND = {
    "closed_forms": ["closed_forms", "quadric"],
    "lenses": ["lenses", "pieces", "slicing", "quadric"],
    "offset": ["offset", "slicing"],
    "pieces": ["pieces", "slicing", "quadric"],
    "seam": ["seam", "lenses", "pieces", "slicing", "quadric"],
    "slicing": ["slicing", "quadric"],
    "quadric": ["quadric"],
}


def contracts(folder: Path) -> tuple[int, str]:
    """The exit code and the report of import-linter on the sources in a folder."""
    command = [sys.executable, "-c", LINTER, "--config", "pyproject.toml", "--no-cache"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60)
    return done.returncode, done.stdout + done.stderr


def test_the_package_imports_neither_numpy_nor_what_knows_its_version():
    program = "import sys, overlapper; print(*{'numpy', 'importlib.metadata'} & {*sys.modules})"
    loaded = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert loaded.split() == []


def test_python_imports_only_downwards_and_each_library_in_one_room():
    code, report = contracts(ROOT)
    assert code == 0, report


@pytest.mark.parametrize(
    ("file", "line", "arrow"),
    [
        ("viewer/stage.py", "from overlapper.tables.still import Still", "viewer.stage -> overlapper.tables.still"),
        ("union.py", "import overlapper.reference", "union -> overlapper.reference"),
        ("viewer/live.py", "from overlapper.simulation import Bodies", "viewer.live -> overlapper.simulation"),
        ("viewer/live.py", "import pybullet", "viewer.live -> pybullet"),
        ("scenes/run.py", "import pybullet", "scenes.run -> pybullet"),
        ("simulation/bodies.py", "import pybullet", "simulation.bodies -> pybullet"),
        (
            "simulation/bodies.py",
            "from overlapper.simulation.bullet.recorder import Recorder",
            "simulation.bodies -> overlapper.simulation.bullet.recorder",
        ),
        ("simulation/links.py", "import fcl", "simulation.links -> fcl"),
        ("cli/view.py", "import meshcat.geometry", "cli.view -> meshcat"),
        ("cli/refusals.py", "from sqlalchemy.exc import SQLAlchemyError", "cli.refusals -> sqlalchemy"),
        ("simulation/contacts.py", "import coacd", "simulation.contacts -> coacd"),
        ("tables/table.py", "import matplotlib.pyplot", "tables.table -> matplotlib"),
    ],
)
def test_a_broken_import_rule_is_named_with_both_modules(file, line, arrow, tmp_path):
    sources = shutil.ignore_patterns("native", "*.so", "__pycache__")
    shutil.copytree(ROOT / "overlapper", tmp_path / "overlapper", ignore=sources)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    broken = tmp_path / "overlapper" / file
    broken.write_text(f"{broken.read_text()}\n{line}\n")
    code, report = contracts(tmp_path)
    assert code == 1
    assert f"overlapper.{arrow}" in report


def test_a_part_without_a_floor_is_named(tmp_path):
    sources = shutil.ignore_patterns("native", "*.so", "__pycache__")
    shutil.copytree(ROOT / "overlapper", tmp_path / "overlapper", ignore=sources)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    (tmp_path / "overlapper" / "helpers.py").write_text("")
    code, report = contracts(tmp_path)
    assert code == 1
    assert "overlapper.helpers" in report


def broken_includes(native: Path) -> set[tuple[str, str]]:
    """The files of the core that include one of a higher folder, or of a way beside theirs, with the file included."""
    found = set()
    for path in [*native.rglob("*.h"), *native.rglob("*.cpp")]:
        file = path.relative_to(native).as_posix()
        if file.startswith("fuzz/"):  # which is above all
            continue
        for included in re.findall(r'^\s*#\s*include "([^"]+)"', path.read_text(encoding="utf-8"), re.MULTILINE):
            floor, below = (FLOORS.index(each.partition("/")[0]) for each in (file, included))
            ways = [next((way for way in APART if each.startswith(f"{way}/")), None) for each in (file, included)]
            beside = ways[0] is not None and floor == below and ways[1] != ways[0]
            rooms = [each.removeprefix("methods/round/").partition("/")[0] for each in (file, included)]
            within_round = included.startswith("methods/round/") and rooms[0] in ROUND
            if below < floor or beside or (within_round and rooms[1] not in ROUND[rooms[0]]):
                found.add((file, included))
    return found


def test_the_core_includes_only_downwards():
    found = broken_includes(NATIVE)
    lines = "\n".join(f"{file} includes {included}" for file, included in sorted(found))
    assert not lines, lines


@pytest.mark.parametrize(
    ("file", "included", "broken"),
    [
        ("geometry/polytope.cpp", "shapes/hull.h", True),
        ("distance/portal.cpp", "methods/tracing/trace.h", True),
        ("methods/paper.cpp", "overlap/overlap.h", True),
        ("methods/clipping/clip.cpp", "methods/dual/region.h", True),
        ("methods/tracing/trace.cpp", "methods/choose.h", True),
        ("methods/round/closed_forms/lens.cpp", "methods/round/round.h", True),
        ("methods/round/closed_forms/lens.cpp", "methods/round/pieces/measure.h", True),
        ("methods/round/slicing/slice.cpp", "methods/round/pieces/pieces.h", True),
        ("methods/round/quadric/ball.cpp", "methods/round/slicing/wall.h", True),
        ("methods/round/pieces/cap.cpp", "methods/round/quadric/stretch.h", False),
        ("methods/round/round.cpp", "methods/round/closed_forms/closed_forms.h", False),
        ("methods/tracing/trace.cpp", "methods/tracing/seam.h", False),
        ("methods/paper.cpp", "methods/clipping/clip.h", False),
        ("overlap/overlap.cpp", "geometry/vec.h", False),
        ("python/batch.cpp", "python/arrays.h", False),
        ("fuzz/fuzz_overlap.cpp", "batch/batch.h", False),
    ],
)
def test_an_include_that_points_up_is_named_with_both_files(file, included, broken, tmp_path):
    path = tmp_path / file
    path.parent.mkdir(parents=True)
    path.write_text(f'#include "{included}"\n#include <vector>\n')
    assert broken_includes(tmp_path) == ({(file, included)} if broken else set())
