"""The parameters of a scene: the arguments of `build(client, *, mass=1.0, seed=0)` other than the client.

The default of a parameter is a number, a text, True or False. Its values are of the same kind.
"""

from __future__ import annotations

import difflib
import inspect
import math
from collections.abc import Callable, Mapping
from typing import Any

from overlapper.printable import encodable

Parameter = bool | int | float | str

TRUTHS = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}


def _whole(text: str) -> int:
    """An integer that a table can hold."""
    if not -(2**63) <= (value := int(text)) < 2**63:
        raise ValueError
    return value


def _finite(text: str) -> float:
    if not math.isfinite(value := float(text)):
        raise ValueError
    return value


# The name of the values of each kind, and their reader. It raises KeyError or ValueError for invalid text.
READERS: dict[type, tuple[str, Callable[[str], Parameter]]] = {
    bool: ("true or false", lambda text: TRUTHS[text.strip().lower()]),
    int: ("a whole number of 64 bits", _whole),
    float: ("a finite number", _finite),
}

# The prefix of parameter names in the heading of a table: "set mass: 2.0".
HEADING = "set "


def parameters_of(build: Callable[..., Any], filled: bool = True) -> dict[str, Parameter]:
    """The parameters of `build` by name, with their defaults, if these are numbers, texts, True or False.

    With `filled`, the first argument is the simulation to be filled, and not a parameter.
    """
    try:
        taken = [*inspect.signature(build).parameters.values()][int(filled) :]
    except (TypeError, ValueError):  # C functions may raise these
        return {}
    named = [each for each in taken if each.kind in (each.POSITIONAL_OR_KEYWORD, each.KEYWORD_ONLY)]
    return {each.name: each.default for each in named if type(each.default) in (bool, int, float, str)}


def known(name: str, defaults: Mapping[str, Parameter], scene: str) -> None:
    """Raises ValueError if the scene has no parameter with this name."""
    if name in defaults:
        return
    if not defaults:
        raise ValueError(f"the scene {scene} has no parameter {name!r}: it has no parameters")
    nearest = difflib.get_close_matches(name, defaults, n=1)
    hint = f"; the nearest is {nearest[0]!r}" if nearest else ""
    raise ValueError(f"the scene {scene} has no parameter {name!r}{hint} (it has {described(defaults)})")


def value_of(name: str, text: str, default: Parameter) -> Parameter:
    """The value in a text, for a parameter with this default. ValueError if the text is not of the default's kind."""
    if isinstance(default, str):
        if (readable := encodable(text)) != text:
            raise ValueError(f"{name} must be text in UTF-8, not '{readable}'")
        return text
    words, read = READERS[type(default)]
    try:
        return read(text)
    except (ValueError, KeyError):
        raise ValueError(f"{name} must be {words} like its default {default}, not {text!r}") from None


def values_of(given: Mapping[str, str], defaults: Mapping[str, Parameter], scene: str) -> dict[str, Parameter]:
    """All parameters: those given as text, and defaults for the rest. ValueError names an invalid parameter."""
    for name in given:
        known(name, defaults, scene)
    return {**defaults, **{name: value_of(name, text, defaults[name]) for name, text in given.items()}}


def described(parameters: Mapping[str, Parameter]) -> str:
    """The parameters as text, such as "mass=2.0, seed=7"."""
    return ", ".join(f"{name}={value}" for name, value in parameters.items())


def heading_of(parameters: Mapping[str, Parameter]) -> dict[str, str]:
    """The parameters as lines of the heading of a table."""
    return {f"{HEADING}{name}": str(value) for name, value in parameters.items()}


def read_heading(metadata: Mapping[str, str]) -> dict[str, str]:
    """The parameters in the heading of a table, as text."""
    return {name.removeprefix(HEADING): text for name, text in metadata.items() if name.startswith(HEADING)}
