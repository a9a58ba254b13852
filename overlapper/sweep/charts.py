"""Charts of the results of a sweep over its parameters: lines and heat maps, as SVG for a page."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overlapper.install import hint

Values = NDArray[np.float64]

# The most values of a parameter that are drawn separately. More values, as in a sample, are put into this many bins.
APART = 24
BINS = 12

# The ticks are the values of the parameter if it has at most this many. More labels would overlap.
LABELLED = 6


@dataclass(frozen=True, slots=True)
class Measure:
    """A column to draw, with its label and the factor to its unit."""

    column: str
    label: str
    factor: float


MEASURES = (
    Measure("largest_volume_m3", "largest volume, cm³", 1e6),
    Measure("largest_depth_m", "largest depth, mm", 1e3),
    Measure("contact_time_s", "time in contact, s", 1.0),
    Measure("mean_force_m2", "mean contact area, mm²", 1e6),
)

# The measure of volumetric contact.
FORCE = Measure("largest_force_n", "largest force, N", 1.0)


@dataclass(frozen=True, slots=True)
class Axis:
    """A parameter: the values of the tasks in groups, each with its middle and its edges."""

    name: str
    group: NDArray[np.intp]
    middles: Values
    edges: Values
    labels: list[str] | None = None
    log: bool = False


def axis(name: str, values: Sequence[Any] | NDArray[Any]) -> Axis:
    """The axis of a parameter with these values. There are at least two."""
    values = np.asarray(values)
    if values.dtype.kind not in "if":
        kinds, group = np.unique(values, return_inverse=True)
        middles = np.arange(len(kinds), dtype=float)
        return Axis(name, group, middles, _edges(middles), list(map(str, kinds)))
    found = values.astype(float)
    # The axis is logarithmic if the largest value is ten times the least or more.
    log = bool(found.min() > 0 and found.max() >= 10 * found.min() and values.dtype.kind == "f")
    scaled = np.log(found) if log else found
    middles = np.unique(scaled)
    if len(middles) > APART:
        edges = np.linspace(scaled.min(), scaled.max(), BINS + 1)
        group = np.clip(np.searchsorted(edges, scaled, side="right") - 1, 0, BINS - 1)
        middles = (edges[:-1] + edges[1:]) / 2
    else:
        edges, group = _edges(middles), np.searchsorted(middles, scaled)
    back = np.exp if log else np.asarray
    labels = [f"{value:.3g}" for value in back(middles)] if len(middles) <= LABELLED else None
    return Axis(name, group, back(middles), back(edges), labels, log)


def _edges(middles: Values) -> Values:
    between = (middles[:-1] + middles[1:]) / 2
    return np.concatenate([[2 * middles[0] - between[0]], between, [2 * middles[-1] - between[-1]]])


def lines(across: Axis, measured: Sequence[tuple[Measure, Values]], middle: Callable[[Values], Any] = np.median) -> str:
    """Each measure over a parameter: the `middle` of the tasks at each value, and the band that holds all of them."""
    figure = _figure(3.1 * len(measured), 2.5)
    for axes, (measure, values) in zip(np.atleast_1d(figure.subplots(1, len(measured))), measured):
        groups = [values[across.group == k] * measure.factor for k in range(len(across.middles))]
        there = [k for k, group in enumerate(groups) if len(group)]
        x = across.middles[there]
        middles, least, most = ([of(groups[k]) for k in there] for of in (middle, np.min, np.max))
        axes.fill_between(x, least, most, alpha=0.2, linewidth=0)
        axes.plot(x, middles, ".-", markersize=4, linewidth=1.2)
        axes.set(xlabel=across.name, title=measure.label)
        axes.ticklabel_format(useOffset=False)
        _scaled(axes.xaxis, axes.set_xscale, across)
        axes.grid(alpha=0.3)
    return _svg(figure)


def heat_map(
    across: Axis, up: Axis, measured: Sequence[tuple[Measure, Values]], middle: Callable[[Values], Any] = np.median
) -> str:
    """The middle of each measure for each pair of values of two parameters. Pairs without a task stay white."""
    cell = up.group * len(across.middles) + across.group
    order = np.argsort(cell, kind="stable")
    places, begins = np.unique(cell[order], return_index=True)
    groups = np.split(order, begins[1:])
    figure = _figure(4.2 * len(measured), 3.1)
    for axes, (measure, values) in zip(np.atleast_1d(figure.subplots(1, len(measured))), measured):
        cells = np.full((len(up.middles), len(across.middles)), np.nan)
        for place, group in zip(places, groups):
            cells.flat[place] = middle(values[group]) * measure.factor
        drawn = axes.pcolormesh(across.edges, up.edges, cells, cmap="viridis", edgecolors="face", linewidth=0.2)
        figure.colorbar(drawn, ax=axes).ax.ticklabel_format(useOffset=False)
        axes.set(xlabel=across.name, ylabel=up.name, title=measure.label)
        _scaled(axes.xaxis, axes.set_xscale, across)
        _scaled(axes.yaxis, axes.set_yscale, up)
    return _svg(figure)


def _scaled(ticks: Any, set_scale: Any, axis: Axis) -> None:
    if axis.log:
        set_scale("log")
    if axis.labels:
        ticks.set_ticks(axis.middles, axis.labels)
        ticks.set_ticks([], minor=True)


def must_be_there() -> None:
    """ImportError without matplotlib."""
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError as error:
        raise ImportError(f"the summary of a sweep needs {hint('matplotlib')}") from error


def _figure(width: float, height: float) -> Any:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def _svg(figure: Any) -> str:
    """The figure as an element of a page. Equal figures give equal text."""
    import matplotlib

    file = io.StringIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "overlapper", "font.size": 8}):
        figure.savefig(file, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    svg = file.getvalue()
    return re.sub(r"<metadata>.*?</metadata>", "", svg[svg.index("<svg") :], flags=re.DOTALL)
