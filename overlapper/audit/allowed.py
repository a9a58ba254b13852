"""Pairs that are allowed to overlap. The command line names each by two patterns with a comma between them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from fnmatch import fnmatchcase

Patterns = tuple[str, str]


def allowed_pair(text: str) -> Patterns:
    """The two patterns of "A,B". ValueError if there are not exactly two patterns."""
    first, comma, second = text.partition(",")
    if not (first and comma and second):
        raise ValueError(f"--expect must be two names with a comma between them, not {text!r}")
    return first, second


def must_name_some(allowed: Sequence[Patterns], names: Collection[str], kind: str) -> None:
    """ValueError if a pattern matches none of the `names`. `kind` is the word for the named things in the message."""
    for pattern in (each for pair in allowed for each in pair):
        if not any(fnmatchcase(name, pattern) for name in names):
            raise ValueError(f"no {kind} is called {pattern!r}")


def is_allowed(names: tuple[str, str], allowed: Sequence[Patterns]) -> bool:
    """Whether a pair of names is one of the allowed ones, in either order."""
    return any(all(map(fnmatchcase, each, patterns)) for patterns in allowed for each in (names, names[::-1]))
