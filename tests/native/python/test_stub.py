"""The public surface of the native core is a text under version control: a change of it is a line in a diff."""

import ast
import difflib
import re
import subprocess
import sys
from pathlib import Path

import overlapper._core

COMMITTED = Path(__file__).with_name("core_stub.pyi")


def test_the_native_surface_is_the_committed_one():
    built = Path(overlapper._core.__file__).with_name("_core.pyi")
    difference = difflib.unified_diff(
        COMMITTED.read_text().splitlines(), built.read_text().splitlines(), COMMITTED.name, built.name, lineterm=""
    )
    changes = "\n".join(difference)
    assert not changes, f"{changes}\nIf the change is meant: cp {built} {COMMITTED}"


def test_the_type_of_ways_has_all_their_names():
    literal = re.search(r"def way\(self\) -> Literal\[(.*)\]", COMMITTED.read_text())[1]
    assert ast.literal_eval(f"({literal})") == overlapper.Overlaps.WAYS


def test_user_programs_type_check_against_the_stub(tmp_path):
    program = "from overlapper import Sphere, overlap; reveal_type(overlap(Sphere(1.0), Sphere(2.0)).volume)"
    mypy = [sys.executable, "-m", "mypy", "--cache-dir", tmp_path, "-c", program]
    checked = subprocess.run(mypy, cwd=tmp_path, capture_output=True, text=True)
    assert 'Revealed type is "float"' in checked.stdout, checked.stdout
