"""Makes text from outside safe for a terminal, a line of a file and a label."""

from __future__ import annotations

LONGEST = 1_000  # the most characters of a sentence


def printable(text: str) -> str:
    r"""The text with invisible characters as Python escapes, such as \x1b for the start of a colour."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def first_line(error: object, most: int = LONGEST) -> str:
    """The first line of the text of an error, or else its type; without a full stop, as part of a sentence.

    A line is shortened to about `most` characters.
    """
    try:
        said = str(error).strip()
    except Exception:  # raised by the error's own __str__
        said = ""
    return printable(shortened((said or type(error).__name__).splitlines()[0].rstrip("."), most))


def shortened(text: str, most: int) -> str:
    """The text, or about `most` characters of its two ends, with the number of characters left out between them."""
    half = most // 2
    if len(text) <= most:
        return text
    return f"{text[:half]} ... ({len(text) - 2 * half:,} characters left out) ... {text[-half:]}"


def encodable(text: str) -> str:
    r"""The text with lone surrogates written as \udcff. They stand for bytes that are not UTF-8."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")
