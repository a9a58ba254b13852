"""Gives functions of the core what inspect, pydoc and pickle expect: a signature, a docstring and a name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar, cast

from overlapper._core import function

if TYPE_CHECKING:
    import inspect

F = TypeVar("F")


def introspectable(of_core: F) -> F:
    """The function of the core, with the docstring and the signature of its last overload."""
    core: Any = of_core
    made: Any = function(core)
    made.__name__ = made.__qualname__ = core.__name__
    made.__module__ = __package__
    made.__doc__ = core.__nb_signature__[-1][1]
    made._signature = signature
    return cast("F", made)


def signature(core: Any) -> inspect.Signature:
    """The signature of the last overload, with types as text."""
    import inspect  # only on use: it would add a quarter to the import time of the package

    found: dict[str, Any] = {}
    exec(f"from __future__ import annotations\n{core.__nb_signature__[-1][0]}: ...", found)
    return inspect.signature(found[core.__name__])
