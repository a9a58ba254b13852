"""Text from outside, made fit for a terminal, for a line of a file and for a label."""

from __future__ import annotations


def printable(text: str) -> str:
    r"""The text with what cannot be seen written as Python escapes it, such as \x1b for the start of a colour."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def first_line(error: object) -> str:
    """The first line of what an error says, or what kind of error it is; without a full stop, as part of a sentence."""
    return printable((str(error).strip() or type(error).__name__).splitlines()[0].rstrip("."))
