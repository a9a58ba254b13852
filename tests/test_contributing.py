"""CONTRIBUTING is true: the files and names that it names exist, its lists are short, and versions agree."""

import os
import re
import subprocess
from importlib import metadata
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
CONTRIBUTING = (ROOT / ".github" / "CONTRIBUTING.md").read_text()
QUOTED = re.findall(r"`([^`]+)`", CONTRIBUTING)


def make_targets():
    """As `make help` lists them."""
    said = subprocess.run(
        ["make", "--no-print-directory", "help"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return {line.split()[1]: line.split(maxsplit=2)[2] for line in said.stdout.splitlines()}


@pytest.mark.parametrize(
    "name", sorted({word for text in QUOTED for word in text.split() if "/" in word or word.endswith(".toml")})
)
def test_a_file_that_is_named_exists(name):
    made = (".venv/", "build/")
    if not name.startswith(made):
        assert (ROOT / name.replace("NAME", "box_pile")).exists()


def test_targets_that_are_named_exist():
    named = {match[1] for text in QUOTED for match in [re.match(r"make (\S+)", text)] if match}
    assert named
    assert named <= make_targets().keys() | {"help"}


def test_names_of_code_are_in_the_files_that_are_named_with_them():
    for line in re.findall(r"^- `([^`]+\.(?:py|h|cpp|toml))`: (.*(?:\n  .*)*)", CONTRIBUTING, re.MULTILINE):
        file, text = line
        if "NAME" in file:
            continue
        source = (ROOT / file).read_text()
        for name in re.findall(r"`([A-Za-z_]+)`", text):
            assert name in source, (file, name)


def test_nothing_takes_more_than_four_files_to_add():
    lists = re.split(r"^### ", CONTRIBUTING, flags=re.MULTILINE)[1:]
    lengths = {text.splitlines()[0]: len(re.findall(r"^- ", text.split("\n## ")[0], re.MULTILINE)) for text in lists}
    assert max(lengths.values()) in range(1, 5), lengths


def test_help_lists_every_target_that_is_made_by_hand():
    makefile = (ROOT / "Makefile").read_text()
    phony = re.search(r"^\.PHONY: (.*)", makefile, re.MULTILINE)[1].split()
    assert list(make_targets()) == phony


def test_make_lets_python_write_bytecode_where_the_environment_forbids_it(tmp_path):
    rules = f"include {ROOT / 'Makefile'}\n.PHONY: environment\nenvironment: ; @env\n"
    (tmp_path / "probe.mk").write_text(rules)
    forbidden = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1", "OTHER_OF_THE_ENVIRONMENT": "1"}
    make = ["make", "--silent", "--no-print-directory", "--file", str(tmp_path / "probe.mk"), "environment"]
    names = [line.partition("=")[0] for line in subprocess.check_output(make, env=forbidden, text=True).splitlines()]
    assert "OTHER_OF_THE_ENVIRONMENT" in names and "PYTHONDONTWRITEBYTECODE" not in names


def test_hooks_have_the_formatters_of_the_environment():
    hooks = (ROOT / ".pre-commit-config.yaml").read_text()
    extra = (ROOT / "pyproject.toml").read_text()
    pinned = set(re.findall(r"(?:ruff|clang-format)==[\d.]+", hooks))
    assert {pin.partition("==")[0] for pin in pinned} == {"ruff", "clang-format"}
    assert all(f'"{pin}"' in extra for pin in pinned)


@pytest.mark.parametrize("tool", ["ruff", "clang-format"])
def test_the_formatters_here_are_the_pinned_ones(tool):
    version = re.search(rf'"{tool}==([\d.]+)"', (ROOT / "pyproject.toml").read_text())[1]
    assert metadata.version(tool) == version
