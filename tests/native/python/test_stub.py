"""The public surface of the native core is a text under version control: a change of it is a line in a diff."""

import difflib
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


def test_the_package_says_that_it_is_typed():
    assert Path(overlapper.__file__).with_name("py.typed").is_file()
