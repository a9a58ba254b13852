"""Pages of docs: templates, tables in Markdown, and figures in words."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from string import Template

from harness.command import ROOT


def write(template: Path, page: Path, **parts: object) -> Path:
    """Fills the template and writes the page. KeyError if the template names a part that is not given."""
    page.write_text(filled(template, **parts), encoding="utf-8")
    return page


def filled(template: Path, **parts: object) -> str:
    return Template(template.read_text(encoding="utf-8")).substitute(parts)


def named(path: Path) -> Path:
    """The path as a page names it."""
    return path.relative_to(ROOT) if path.is_relative_to(ROOT) else path


def indented(notes: Iterable[str]) -> str:
    return "\n".join(f"    {note}" for note in notes)


def table(heading: Sequence[str], rows: Iterable[Iterable[str]], left: int = 1) -> str:
    """In Markdown: so many columns to the left, the others to the right."""
    marks = "".join(["---|"] * left + ["--:|"] * (len(heading) - left))
    return "\n".join([f"| {' | '.join(heading)} |", f"|{marks}", *(f"| {' | '.join(row)} |" for row in rows)])


def duration(us: float) -> str:
    """Microseconds in the unit that suits them."""
    for unit, size in (("s", 1e6), ("ms", 1e3)):
        if us >= size:
            return f"{us / size:.3g} {unit}"
    return f"{us:.3g} µs"


def times(ratio: float) -> str:
    """How many times, in few digits."""
    return f"{ratio:,.0f}" if ratio >= 10 else f"{ratio:.1f}"
