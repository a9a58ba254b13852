"""An overlap in a notebook: a picture that turns, and its numbers."""

from __future__ import annotations

import base64
from collections.abc import Iterator

import numpy as np

from overlapper import Overlap
from overlapper.viewer.look import Array, hexadecimal, owner_color, volume_text
from overlapper.viewer.turning import HEIGHT, WIDTH, turning


def overlap_html(overlap: Overlap) -> str:
    """A picture and a table. They have no script, so notebooks that are not trusted show them, too."""
    picture = base64.b64encode(turning(overlap).encode()).decode()
    rows = "".join(
        f'<tr><th style="text-align:left">{name}</th><td style="text-align:left">{value}</td></tr>'
        for name, value in _numbers(overlap)
    )
    return (
        '<div style="display:flex;flex-wrap:wrap;gap:1em;align-items:center">'
        f'<img width="{WIDTH}" height="{HEIGHT}" alt="{_told(overlap)}" src="data:image/svg+xml;base64,{picture}"/>'
        f"<table>{rows}</table></div>"
    )


def _told(overlap: Overlap) -> str:
    kinds = [type(placed.shape).__name__ for placed in overlap.shapes]
    return f"{' and '.join(kinds)}, {overlap.status}"


def _numbers(overlap: Overlap) -> Iterator[tuple[str, str]]:
    """Names and values, with units; the distance if there is no volume."""
    colors = [hexadecimal(owner_color(k)) for k in range(len(overlap.shapes))]
    kinds = [
        f'<span style="color:{color}">\u25a0</span> {type(placed.shape).__name__}'
        for color, placed in zip(colors, overlap.shapes)
    ]
    yield "bodies", ", ".join(kinds)
    yield "status", overlap.status
    errors = overlap.errors
    if overlap:
        yield "volume", f"{volume_text(overlap.volume)} \u00b1 {overlap.volume_error / overlap.volume:.0e} of it"
        yield "centroid", f"{_vector(np.asarray(overlap.centroid))} m"
        yield "area", f"{overlap.area:.4g} m\u00b2"
    if overlap and overlap.depth is not None and errors.depth is not None:
        yield "depth", f"{1e3 * overlap.depth:.4g} mm \u00b1 {1e3 * errors.depth:.0e}"
    if overlap.normal is not None:
        yield "normal", _vector(overlap.normal)
    if overlap.distance and errors.distance is not None:
        yield "distance", f"{1e3 * overlap.distance:.4g} mm \u00b1 {1e3 * errors.distance:.0e}"


def _vector(values: Array) -> str:
    """The values as text. A value that is only rounding error beside the others is written 0."""
    least = 1e-12 * float(abs(values).max())
    return ", ".join(f"{value if abs(value) > least else 0.0:.4g}" for value in values)
