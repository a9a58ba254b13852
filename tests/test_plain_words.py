"""Sentences of the README and the docs are short. A sentence of code or of a table's figures is none."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
MOST_WORDS = 25
# Fenced and indented blocks, comments, pictures.
NO_PROSE = re.compile(r"^ *```.*?^ *```|<!--.*?-->|!\[[^\]]*\]\([^)]*\)|^(?: {4}.*\n)+", re.MULTILINE | re.DOTALL)
# A cell of a table, an entry of a list and a heading end a sentence without a full stop.
ENDS = re.compile(r"\||^ *(?:-|\d+\.|#+) |\n\s*\n", re.MULTILINE)
STOP = re.compile(r"(?<!of [A-Z])(?<!and [A-Z])(?<!, [A-Z])(?<!is [A-Z])[.!?][*)\"]*\s+")  # not after an initial


def long_sentences(text):
    """The sentences with too many words. Code and the address of a link count as one word."""
    prose = re.sub(r"`[^`]*`", "code", NO_PROSE.sub("", text))
    prose = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", prose)
    sentences = [each for part in ENDS.split(prose) for each in STOP.split(" ".join(part.split()))]
    return [each for each in sentences if sum(bool(re.search(r"\w", word)) for word in each.split()) > MOST_WORDS]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_sentences_are_short(page):
    assert long_sentences(page.read_text(encoding="utf-8")) == []


def test_a_long_sentence_is_found():
    assert long_sentences("- a `b c` [d e](f) " + "g " * 20 + "h.\n\nShort.\n") == []
    assert len(long_sentences("Short. " + "a " * 25 + "b. Short.")) == 1
    assert len(long_sentences("| short | " + "a " * 26 + "|")) == 1
