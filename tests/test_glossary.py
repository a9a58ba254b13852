"""The glossary defines each term once, and the pages use every term."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
GLOSSARY = ROOT / "docs/glossary.md"
ROWS = re.findall(r"^\| (?!term |---)([^|]+?) \| ([^|]+?) \|$", GLOSSARY.read_text(encoding="utf-8"), re.MULTILINE)
TERMS = [term for term, _ in ROWS]
PAGES = [ROOT / "README.md", *(page for page in sorted((ROOT / "docs").rglob("*.md")) if page != GLOSSARY)]


def test_terms_are_sorted_and_each_is_defined_once():
    assert len(TERMS) > 40
    assert sorted({term.lower() for term in TERMS}) == [term.lower() for term in TERMS]


def test_pages_use_every_term():
    text = " ".join("\n".join(page.read_text(encoding="utf-8") for page in PAGES).lower().split())
    assert [term for term in TERMS if term.lower() not in text] == []


def test_italics_are_terms():
    italics = {word for _, meaning in ROWS for word in re.findall(r"\*([^*]+)\*", meaning)}
    assert {word for word in italics if word not in TERMS and word.removesuffix("s") not in TERMS} == set()


def test_a_definition_has_short_sentences():
    sentences = [each for _, meaning in ROWS for each in re.split(r"(?<=[.:]) ", meaning)]
    assert [each for each in sentences if len(each.split()) > 25] == []
