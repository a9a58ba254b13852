"""Gives the core what inspect, pydoc and pickle expect: signatures, docstrings and names.

A refusal of arguments becomes one sentence that shows the right call."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar, cast

from overlapper import _core

if TYPE_CHECKING:
    import inspect

F = TypeVar("F")


def introspectable(of_core: F) -> F:
    """The function of the core, with the docstring and the signature of its last overload."""
    return _described(of_core, _core.function, "")


def introspect(kind: type) -> None:
    """Gives signatures to a class of the core and to its methods."""
    for name, member in [*vars(kind).items()]:
        if hasattr(member, "__nb_signature__") and not name.startswith("_"):
            make = _core.method if type(member).__name__ == "nb_method" else _core.function
            setattr(kind, name, _described(member, make, f"{kind.__name__}."))
    if hasattr(vars(kind).get("__init__"), "__nb_signature__"):
        kind.__signature__ = _Constructor()  # type: ignore[attr-defined]
        _core.explain_constructor(kind)


def signature(core: Any) -> inspect.Signature:
    """The signature of the last overload, with types as text."""
    import inspect  # only on use: it would add a quarter to the import time of the package

    found: dict[str, Any] = {}
    exec(f"from __future__ import annotations\n{core.__nb_signature__[-1][0]}: ...", found)
    return inspect.signature(found[core.__name__])


def _described(of_core: F, make: Any, prefix: str) -> F:
    core: Any = of_core
    made: Any = make(core)
    made.__name__, made.__qualname__ = core.__name__, prefix + core.__name__
    made.__module__ = __package__
    made.__doc__ = core.__nb_signature__[-1][1]
    made._signature = signature
    return cast("F", made)


class _Constructor:
    """The signature of a class, made when it is asked for."""

    def __get__(self, instance: object, owner: Any) -> inspect.Signature:
        if not hasattr(owner.__init__, "__nb_signature__"):
            raise AttributeError("__signature__")  # a class of users, with a constructor of its own
        found = signature(owner.__init__)
        return found.replace(parameters=[*found.parameters.values()][1:])


def _refusal(called: Any, given: list[Any], named: dict[str, Any]) -> str:
    """The sentence about the first argument that is missing, unknown or of the wrong kind."""
    found = _Constructor().__get__(None, called) if isinstance(called, type) else signature(called)
    names = [*found.parameters.values()]
    kinds = [type(value).__name__ for value in [*given, *named.values()]]
    if names and names[0].name == "self":
        names, given = names[1:], given[1:]
    found = found.replace(parameters=names)
    plain = [each.replace(annotation=each.empty) for each in names]
    call = f"{called.__qualname__}{found.replace(parameters=plain, return_annotation=found.empty)}"
    try:
        bound = found.bind(*given, **named)
    except TypeError as problem:
        return f"{call}: {problem}"
    for name, value in bound.arguments.items():
        if found.parameters[name].annotation == "bool" and not isinstance(value, bool):
            return f"{call}: {name} must be True or False, not {type(value).__name__}"
    return f"{call} takes no ({', '.join(kinds)})"


_core.explain_with(_refusal)
