"""Functions of the core answer what inspect, pydoc, pickle and copy ask of a function."""

import copy
import inspect
import pickle
import pydoc
import sys

import pytest

import overlapper
from overlapper import Box, Placed, Sphere, _core
from overlapper.functions import introspectable

FUNCTIONS = {
    "overlap": ["shapes", "tolerance", "method"],
    "overlaps": ["shapes", "positions", "orientations", "pairs", "tolerance", "threads", "method", "separated"],
    "iou": ["a", "b", "tolerance"],
    "distance": ["a", "b"],
    "penetration_depth": ["a", "b"],
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_signature_has_names_types_and_defaults(name):
    signature = inspect.signature(getattr(overlapper, name))
    assert [*signature.parameters] == FUNCTIONS[name]
    assert all(each.annotation is not inspect.Parameter.empty for each in signature.parameters.values())
    assert signature.return_annotation in ("Overlap", "Overlaps", "float")
    assert "tolerance" not in signature.parameters or signature.parameters["tolerance"].default == 1e-3


@pytest.mark.parametrize("name", FUNCTIONS)
def test_help_says_the_signature_once_and_then_the_docstring(name):
    text = pydoc.plain(pydoc.render_doc(getattr(overlapper, name)))
    assert [line.startswith(f"{name}(") for line in text.splitlines()].count(True) == 1
    assert inspect.getdoc(getattr(_core, name)).splitlines()[-1] in text


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_is_pickled_and_copied_by_its_name(name):
    function = getattr(overlapper, name)
    assert pickle.loads(pickle.dumps(function)) is function
    assert copy.deepcopy(function) is function
    assert repr(function) == f"<function {name}>"


def test_arguments_and_errors_are_those_of_the_core():
    a, b = Placed(Box([1, 1, 1])), Placed(Sphere(0.5), (0.5, 0, 0))
    assert overlapper.iou(a, b=b, tolerance=1e-6) == _core.iou(a, b=b, tolerance=1e-6) > 0
    assert overlapper.overlap(a, b).volume == _core.overlap(a, b).volume
    with pytest.raises(ValueError, match=r"^tolerance must be greater than 0 and less than 1$"):
        overlapper.iou(a, b, tolerance=2)
    with pytest.raises(TypeError, match="incompatible function arguments"):
        overlapper.distance(a)


def test_a_class_may_hold_a_function():
    class Measured:
        distance = overlapper.distance

    assert Measured().distance(Box([1, 1, 1]), Placed(Box([1, 1, 1]), (3, 0, 0))) == 1


def test_a_function_goes_with_its_last_reference():
    kind = type(overlapper.iou)
    before = sys.getrefcount(_core.iou), sys.getrefcount(kind)
    functions = [introspectable(_core.iou) for _ in range(100)]
    assert sys.getrefcount(_core.iou) >= before[0] + 100 and sys.getrefcount(kind) >= before[1] + 100
    functions.clear()
    assert (sys.getrefcount(_core.iou), sys.getrefcount(kind)) == before


@pytest.mark.parametrize("ask", [repr, pickle.dumps])
def test_a_function_without_a_name_cannot_be_shown_or_pickled(ask):
    with pytest.raises(AttributeError):
        ask(_core.function(_core.iou))
