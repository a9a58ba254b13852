"""The recipe for conda follows the package: its version, and its bounds of other packages."""

import re
from importlib.metadata import requires, version
from pathlib import Path

import yaml
from packaging.requirements import Requirement

RECIPE = yaml.safe_load((Path(__file__).parents[1] / ".github/conda/recipe.yaml").read_text())
NAMES = {"matplotlib": "matplotlib-base", "meshcat": "meshcat-python", "mujoco": "mujoco-python"}  # of conda-forge


def bounds(*extras):
    """The specifiers of the package and of these extras, by the names that conda-forge has."""
    found = {}
    for text in requires("overlapper"):
        each = Requirement(text)
        of = re.search(r'extra == "(\w+)"', str(each.marker)) if each.marker else None
        if (not of or of[1] in extras) and each.name != "overlapper":
            found[NAMES.get(each.name, each.name)] = str(each.specifier)
    return found


def stated(lines):
    return dict((*line.split(" ", 1), "")[:2] for line in lines)


def test_the_conda_recipe_has_the_version_of_the_package():
    assert RECIPE["context"]["version"] == version("overlapper")


def test_the_conda_recipe_requires_the_core_the_command_line_and_the_viewer():
    run = stated(RECIPE["requirements"]["run"])
    assert run.pop("python") == ">=3.10"
    assert run == bounds("cli", "view")
    assert stated(RECIPE["requirements"]["run_constraints"]) == {
        name: specifier for name, specifier in bounds("sim", "mujoco").items() if name != "numpy"
    }


def test_the_conda_recipe_builds_with_the_backend_of_the_package():
    text = (Path(__file__).parents[1] / "pyproject.toml").read_text()
    (backend,) = re.findall(r'"(scikit-build-core)(>=[\d.]+)"', text)
    (nanobind,) = re.findall(r'requires = .*"nanobind~=(\d+)\.(\d+)"', text)
    host = stated(RECIPE["requirements"]["host"])
    assert host[backend[0]] == backend[1]
    assert host["nanobind"] == f">={'.'.join(nanobind)},<{int(nanobind[0]) + 1}"
