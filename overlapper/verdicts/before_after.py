"""The page of a scene that has moved: its worst step as recorded and as it is today, side by side."""

from __future__ import annotations

import base64
import gzip
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from html import escape
from pathlib import Path

from overlapper.tables.still import Still
from overlapper.verdicts.comparison import Move
from overlapper.verdicts.verdict import Verdict
from overlapper.viewer import Recording
from overlapper.viewer.page_text import filled
from overlapper.whole_file import beside

LIMIT = 3  # the most moves shown for a cause; the terminal counts the rest


def save(verdict: Verdict, name: str, path: Path) -> Path:
    """Write the page of a verdict with moves to one self-contained HTML file, and return its path."""
    step = verdict.worst_step
    before, after = (stills.get(step) for stills in (verdict.expected.stills, verdict.today))
    frames = (_dressed(before, after), f"step {step} as recorded"), (after, f"step {step} today")
    stills = [(still, name) for still, name in frames if still is not None and still.keys]
    sections = verdict.causes | ({"overlaps": verdict.overlaps} if verdict.overlaps else {})
    recording = _recording(stills, verdict.expected.tolerance)
    texts = {
        "title": escape(f"{name} has moved"),
        "step": str(step),
        "verdicts": "\n".join(_section(*each) for each in sections.items()),
        "recording": base64.b64encode(gzip.compress(recording, compresslevel=6, mtime=0)).decode(),
    }
    page = filled(Path(__file__).with_suffix(".html"), texts, recording.decode())
    path.parent.mkdir(parents=True, exist_ok=True)
    with beside(path) as file:
        file.write_text(page, encoding="utf-8")
    return path


def _dressed(before: Still | None, after: Still | None) -> Still | None:
    """The recorded step with today's names and colours, because a recording has none."""
    if before is None or after is None:
        return before
    names, labels = before.names | after.names, before.labels | after.labels
    return replace(before, names=names, labels=labels, colors=before.colors | after.colors)


def _recording(stills: Sequence[tuple[Still, str]], tolerance: float) -> bytes:
    """The named frames as a page of `overlapper.viewer`. The link `#t=1` opens the second frame."""
    recording = Recording()
    for time, (still, name) in enumerate(stills):
        recording.add(still, still.contacts(tolerance), float(time), name)
    with tempfile.TemporaryDirectory() as folder:
        return recording.save(Path(folder) / "page.html").read_bytes()


def _section(cause: str, moves: Sequence[Move]) -> str:
    if not moves:
        return f'<p><b>{cause}</b><span class="kept">as recorded</span></p>'
    worst = sorted(moves, key=lambda move: -move.part)
    rows = "\n".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in move.cells()) + "</tr>" for move in worst[:LIMIT]
    )
    heads = "".join(f"<th>{head}</th>" for head in Move.HEADS)
    count = f"{len(moves):,} moved" + (f", of which the worst {LIMIT}:" if len(moves) > LIMIT else "")
    return f'<p><b>{cause}</b><span class="moved">{count}</span></p>\n<table><tr>{heads}</tr>\n{rows}</table>'
