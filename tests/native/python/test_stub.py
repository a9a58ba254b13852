"""The public surface of the native core is a text under version control: a change of it is a line in a diff."""

import ast
import difflib
import re
import shlex
import subprocess
import sys
from pathlib import Path

import overlapper._core

COMMITTED = Path(overlapper.__file__).with_name("_core.pyi")


def test_the_native_surface_is_the_committed_one(tmp_path):
    built, folder = tmp_path / "_core.pyi", Path(overlapper._core.__file__).parent
    write = [sys.executable, "-m", "nanobind.stubgen", "-q", "-m", "_core", "-i", str(folder), "-o"]
    subprocess.run([*write, str(built)], check=True)
    difference = difflib.unified_diff(
        COMMITTED.read_text().splitlines(), built.read_text().splitlines(), COMMITTED.name, built.name, lineterm=""
    )
    changes = "\n".join(difference)
    assert not changes, f"{changes}\nIf the change is meant: {shlex.join([*write, str(COMMITTED)])}"


def test_the_type_of_ways_has_all_their_names():
    literal = re.search(r"def way\(self\) -> Literal\[(.*)\]", COMMITTED.read_text())[1]
    assert ast.literal_eval(f"({literal})") == overlapper.Overlaps.WAYS


def test_user_programs_type_check_against_the_stub(tmp_path):
    program = """
import numpy as np
from overlapper import Batch, Sphere, overlap, overlaps
from overlapper.mujoco import Bodies
overlaps([Sphere(1.0), np.eye(4, 3)], np.zeros((2, 4, 4)))
Batch([Sphere(1.0), np.eye(4, 3)])
reveal_type(overlap(Sphere(1.0), Sphere(2.0)).volume)
def geoms(bodies: Bodies) -> list[int]:
    contacts = bodies.overlaps()
    return [contacts[0].geomB, *(contact.geomA for contact in contacts[1:])]
"""
    mypy = [sys.executable, "-m", "mypy", "--cache-dir", tmp_path, "--follow-imports=silent", "-c", program]
    checked = subprocess.run(mypy, cwd=tmp_path, capture_output=True, text=True)
    assert 'Revealed type is "float"' in checked.stdout and checked.returncode == 0, checked.stdout
