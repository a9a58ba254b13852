"""Functions of the core answer what inspect, pydoc, pickle and copy ask of a function."""

import copy
import inspect
import pickle
import pydoc
import sys

import numpy as np
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


def raising(value):
    raise TypeError(f"radius must be {value}")


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


CLASSES = [
    kind for kind in vars(overlapper).values() if isinstance(kind, type) and kind.__module__ == "overlapper._core"
]
FOUND = (overlapper.Overlap, overlapper.Overlaps, overlapper.TimeOfImpact, overlapper.TimesOfImpact)
MADE = [kind for kind in CLASSES if kind not in FOUND]  # by users
ROOM = overlapper.Batch([Sphere(1)])
CALLS = {
    **{name: getattr(overlapper, name) for name in FUNCTIONS},
    **{kind.__name__: kind for kind in MADE},
    **{
        f"{kind.__name__}.{name}": member
        for kind in CLASSES
        for name, member in vars(kind).items()
        if not name.startswith("_") and callable(member)
    },
}


def test_all_of_the_core_that_users_call_is_found():
    assert {"Capsule", "Placed", "Batch.overlaps", "Overlap.certificate"} <= {*CALLS}


@pytest.mark.parametrize("name", CALLS)
def test_missing_unknown_and_additional_arguments_are_refused_in_one_sentence(name):
    call, signature = CALLS[name], inspect.signature(CALLS[name])
    needed = [
        each
        for each in signature.parameters.values()
        if each.default is each.empty and each.kind is each.POSITIONAL_OR_KEYWORD
    ]
    own = [Sphere(1)] * len(needed)
    if "self" in signature.parameters:
        own[0] = ROOM if name.startswith("Batch") else overlapper.overlap(Sphere(1), Sphere(1))
    wrong = [(own, {"unheard_of": 1}, "unexpected keyword argument 'unheard_of'")]
    if len(needed) > 1 or (needed and needed[0].name != "self"):
        wrong.append((own[:-1], {}, f"missing a required argument: '{needed[-1].name}'"))
    if not any(each.kind is each.VAR_POSITIONAL for each in signature.parameters.values()):
        wrong.append((own + [None] * 9, {}, "too many positional arguments"))
    for given, named, problem in wrong:
        with pytest.raises(TypeError) as refusal:
            call(*given, **named)
        said = str(refusal.value)
        assert said.startswith(f"{name}(") and said.endswith(problem) and "\n" not in said and "self" not in said


@pytest.mark.parametrize("name", CALLS)
def test_every_argument_of_a_wrong_kind_is_refused_in_one_sentence_with_its_name(name):
    call, signature = CALLS[name], inspect.signature(CALLS[name])
    right = {
        "shape": Sphere(1), "shapes": [Sphere(1)], "a": Sphere(1), "b": Sphere(1), "radius": 1, "length": 1,
        "offset": 1,
        "vertices": np.eye(4)[:, :3], "half_extents": [1, 1, 1], "half_axes": [1, 1, 1], "normal": [0, 0, 1],
        "positions": [[0, 0, 0]], "orientations": [[0, 0, 0, 1]], "matrix": np.eye(4), "self": ROOM,
    }  # fmt: skip
    named = {
        each: right[each]
        for each, of in signature.parameters.items()
        if each in right and of.kind is of.POSITIONAL_OR_KEYWORD
    }
    for each, of in signature.parameters.items():
        if each == "self" or of.kind is of.VAR_POSITIONAL:
            continue
        given = {**named, each: object()}
        with pytest.raises((TypeError, ValueError), match=rf"\b{each}\b.* must ") as refusal:
            call(*([given.pop("self")] if "self" in given else []), **given)
        assert "\n" not in str(refusal.value)


def test_a_method_of_another_object_is_refused_by_the_types_of_its_arguments():
    with pytest.raises(
        TypeError, match=r"^Batch.candidate_pairs\(positions, orientations=None\) takes no \(int, list, list\)$"
    ):
        overlapper.Batch.candidate_pairs(3, [], [])


def test_an_error_within_a_call_stays_as_it_is():
    with pytest.raises(TypeError, match=r"^radius must be 3$"):
        _core.function(raising)(3)


@pytest.mark.parametrize("kind", MADE)
def test_a_class_has_a_signature_with_types(kind):
    parameters = inspect.signature(kind).parameters
    assert parameters and "self" not in parameters
    assert all(each.annotation is not each.empty for each in parameters.values())


def test_a_class_of_users_has_the_signature_of_its_own_constructor():
    class Scene(overlapper.Batch):
        def __init__(self, count: int) -> None:
            super().__init__([Sphere(1)] * count)

    assert [*inspect.signature(Scene).parameters] == ["count"]
    assert len(Scene(3).candidate_pairs(np.zeros((3, 3)), np.tile([0, 0, 0, 1.0], (3, 1)))) == 3


@pytest.mark.parametrize("name", [name for name in CALLS if "." in name])
def test_a_method_is_found_by_inspect_and_pydoc(name):
    method = CALLS[name]
    assert inspect.isroutine(method) and repr(method) == f"<function {name.split('.')[1]}>"
    assert inspect.signature(method).return_annotation is not inspect.Signature.empty
    assert inspect.getdoc(method)
    assert method.__qualname__ == name


def test_a_method_is_bound_to_its_object():
    bound = ROOM.candidate_pairs
    assert bound.__self__ is ROOM and [*inspect.signature(bound).parameters] == ["positions", "orientations"]
    assert len(bound([[0, 0, 0]], [[0, 0, 0, 1]])) == 0


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
