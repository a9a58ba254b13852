"""Numbers in the attributes of XML."""

from __future__ import annotations


def numbers(text: str) -> list[float | str]:
    """The numbers of an attribute; a word that is no number stays one."""
    return [_number(word) for word in text.split()]


def _number(word: str) -> float | str:
    try:
        return float(word)
    except ValueError:
        return word
