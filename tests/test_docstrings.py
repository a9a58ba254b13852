"""Public docstrings have the sections of numpydoc: every argument has its type and its description."""

import doctest
import inspect
import pydoc
import re
from importlib import import_module
from pathlib import Path

import pytest
from numpydoc.validate import validate

import overlapper

REFERENCE = Path(__file__).parents[1] / "docs/reference"
ENTRY = re.compile(r"^\.\. auto(?:function|class):: ([\w.]+)", re.MULTILINE)
ENTRIES = [name for page in sorted(REFERENCE.glob("*.md")) for name in ENTRY.findall(page.read_text(encoding="utf-8"))]
CHECKS = {
    "GL06": "an unknown section",
    "GL07": "sections in another order",
    "GL08": "no docstring",
    "SS03": "a summary without a period",
    "PR01": "an argument without a line",
    "PR02": "a line without an argument",
    "PR03": "arguments in another order",
    "PR04": "an argument without a type",
    "PR07": "an argument without a description",
    "PR08": "a description without a capital",
    "PR09": "a description without a period",
    "PR10": "no space before a colon",
    "RT01": "no section of what is returned",
    "RT03": "no description of what is returned",
    "RT04": "a description without a capital",
    "RT05": "a description without a period",
}


def found(name):
    """The object of a dotted name."""
    module, _, rest = name.rpartition(".")
    try:
        return getattr(import_module(module), rest)
    except ModuleNotFoundError:
        return getattr(found(module), rest)


def methods(name):
    """The public methods that a class of this package defines."""
    owner = found(name)
    for each in dir(owner) if inspect.isclass(owner) else ():
        method = getattr(owner, each)
        ours = str(getattr(inspect.unwrap(method), "__module__", "")).startswith("overlapper")
        if not each.startswith("_") and inspect.isroutine(method) and ours:
            yield f"{name}.{each}"


EVERY = [*ENTRIES, *(method for name in ENTRIES for method in methods(name))]
WITH_EXAMPLES = [name for name in EVERY if ">>>" in (inspect.getdoc(found(name)) or "")]


@pytest.mark.parametrize("name", EVERY)
def test_sections_of_a_docstring_are_complete(name):
    faults = [f"{code}: {told}" for code, told in validate(name)["errors"] if code in CHECKS]
    assert faults == []


def test_a_docstring_without_an_argument_is_refused(monkeypatch):
    """That the checks above can fail."""
    whole = overlapper.random_polytope.__doc__
    for there, instead, code in (("n : int", "m : int", "PR01"), ("Returns\n    -------\n    Hull", "Hull", "RT01")):
        assert there in whole
        monkeypatch.setattr(overlapper.random_polytope, "__doc__", whole.replace(there, instead))
        assert code in {each for each, _ in validate("overlapper.random_polytope")["errors"]}


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_examples_of_a_docstring_show_what_comes_out(name):
    test = doctest.DocTestParser().get_doctest(inspect.getdoc(found(name)), {}, name, None, None)
    told = []
    assert doctest.DocTestRunner().run(test, out=told.append).failed == 0, "".join(told)


def test_every_function_and_shape_has_an_example_with_its_result():
    functions = [
        "overlap",
        "distance",
        "penetration_depth",
        "iou",
        "time_of_impact",
        "times_of_impact",
        "random_polytope",
        "Batch",
        "Placed",
    ]
    shapes = [kind.__name__ for kind in overlapper.Shape.__args__]
    assert {f"overlapper.{name}" for name in functions + shapes} <= {*WITH_EXAMPLES}


def test_help_of_overlap_fits_a_screen_and_begins_with_an_example():
    lines = pydoc.plain(pydoc.render_doc(overlapper.overlap)).splitlines()
    assert 24 <= len(lines) <= 50
    assert max(map(len, lines[3:])) <= 130
    first = next(i for i, line in enumerate(lines) if ">>>" in line)
    assert first < next(i for i, line in enumerate(lines) if line.strip() == "Parameters")
