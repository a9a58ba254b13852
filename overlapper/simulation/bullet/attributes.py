"""Numbers in the attributes of XML."""

from __future__ import annotations


def numbers(text: str) -> list[float | str]:
    """The numbers of an attribute. A word that is not a number stays a string."""
    return [_number(word) for word in text.split()]


def _number(word: str) -> float | str:
    try:
        return float(word)
    except ValueError:
        return word
