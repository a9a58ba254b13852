"""The reference has every public name, and its examples and the tutorial run as pasted."""

import ast
import re
import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest

import overlapper
import overlapper.simulation
import overlapper.viewer
from overlapper.proof import claims
from overlapper.scenes import pytest_plugin

DOCS = Path(__file__).parents[1] / "docs"
PAGES = {page.stem: page.read_text(encoding="utf-8") for page in sorted((DOCS / "reference").glob("*.md"))}
ENTRY = re.compile(r"^\.\. (?:auto|py:)\w+:: ([\w.]+)", re.MULTILINE)
ENTRIES = {name for page in PAGES.values() for name in ENTRY.findall(page)}
EXAMPLES = {
    f"{name} {i}": example
    for name, page in [*PAGES.items(), ("tutorial", (DOCS / "tutorial.md").read_text(encoding="utf-8"))]
    for i, example in enumerate(re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL), 1)
}


def offered(package):
    """What is in `__all__`, and what is imported when it is asked for: type checkers are told of that."""
    tree = ast.parse(Path(package.__file__).read_text(encoding="utf-8"))
    lazy = [line for node in tree.body if isinstance(node, ast.If) for line in node.body]
    names = {alias.name for line in lazy if isinstance(line, ast.ImportFrom) for alias in line.names}
    assert names
    return (names | set(package.__all__)) - {"Watch"}  # which is offered as `watch`


@pytest.mark.parametrize("package", [overlapper, overlapper.simulation, overlapper.viewer], ids=lambda p: p.__name__)
def test_every_public_name_has_an_entry(package):
    missing = {name for name in offered(package) if f"{package.__name__}.{name}" not in ENTRIES}
    # The one table is described where it is at home.
    assert missing <= ({"Log"} if package is overlapper.simulation else set())


def test_every_certificate_has_an_entry():
    assert {f"overlapper.proof.claims.{kind.__name__}" for kind in get_args(claims.Certificate)} <= ENTRIES


def test_every_option_of_pytest_has_an_entry():
    source = Path(pytest_plugin.__file__).read_text(encoding="utf-8")
    options = set(re.findall(r'"(--overlapper-\w+)"', source))
    assert options == set(re.findall(r"^\.\. option:: (--[\w-]+)", PAGES["scenes"], re.MULTILINE))


@pytest.mark.parametrize("page", PAGES)
def test_every_page_has_an_example(page):
    assert f"{page} 1" in EXAMPLES


@pytest.mark.parametrize("example", EXAMPLES)
def test_an_example_runs_as_pasted(example, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(EXAMPLES[example], encoding="utf-8")
    done = subprocess.run([sys.executable, script], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
