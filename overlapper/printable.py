"""Text from outside, made fit for a terminal, for a line of a file and for a label."""

from __future__ import annotations

LONGEST = 1_000  # characters of a sentence


def printable(text: str) -> str:
    r"""The text with what cannot be seen written as Python escapes it, such as \x1b for the start of a colour."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def first_line(error: object, most: int = LONGEST) -> str:
    """The first line of what an error says, or what kind of error it is; without a full stop, as part of a sentence.

    A line is shortened to about `most` characters.
    """
    try:
        said = str(error).strip()
    except Exception:  # of the error's own __str__
        said = ""
    return printable(shortened((said or type(error).__name__).splitlines()[0].rstrip("."), most))


def shortened(text: str, most: int) -> str:
    """The text, or about `most` characters of its two ends, with the number of those between them."""
    half = most // 2
    if len(text) <= most:
        return text
    return f"{text[:half]} ... ({len(text) - 2 * half:,} characters left out) ... {text[-half:]}"


def encodable(text: str) -> str:
    r"""The text with lone surrogates, which stand for bytes that are no UTF-8, written as \udcff."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")
