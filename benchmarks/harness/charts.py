"""Charts, each described by its panels: points, bars, texts, or cells with figures. matplotlib draws them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from PIL import Image

INK, PALE, OURS, BOOK = "#222222", "#e3e3e3", "#d1001f", "#1f5fbf"


@dataclass(frozen=True)
class Series:
    """Points, in matplotlib's words: `format` is a marker and dashes, `style` has all other arguments of its plot().

    With `bottom` each value is a bar that begins there.
    """

    x: Sequence[float]
    y: Sequence[float]
    label: str | None = None
    format: str = "-"
    bottom: Any = None
    style: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Cells:
    """A table of figures (rows, columns), nan where there is none.

    `shade` maps a figure to 0 ... 1, or to None where it is as good as can be. `label` says it in few characters.
    """

    values: np.ndarray
    shade: Callable[[float], float | None]
    label: Callable[[float], str]
    colours: Callable[[float], Any]


@dataclass(frozen=True)
class Panel:
    """`axes` are arguments of Axes.set(), `legend` those of Axes.legend(). A tick is a place with its name."""

    title: str = ""
    series: Sequence[Series] = ()
    axes: Mapping[str, Any] = field(default_factory=dict)
    xticks: Mapping[float, str] | None = None
    yticks: Mapping[float, str] | None = None
    legend: Mapping[str, Any] | None = None
    texts: Sequence[tuple[float, float, str, str]] = ()  # place, words, colour
    cells: Cells | None = None
    above: bool = False  # names of columns above the panel, slanted


def draw(
    path: Path, panels: Sequence[Panel], size: tuple[float, float], columns: int = 0, font: float = 8,
    widths: Sequence[float] | None = None, key: Sequence[Series] = (), dpi: int = 130, colours: int = 0,
    share: bool = False,
) -> None:  # fmt: skip
    """Draws panels in rows of so many columns, with a key above all if one is given.

    The PNG has so few colours as flat charts need, if a number is given.
    """
    plt.rcdefaults()
    plt.rcParams.update({"font.size": font})
    columns = columns or len(panels)
    rows = -(-len(panels) // columns)
    figure, axes = plt.subplots(
        rows, columns, figsize=size, squeeze=False, sharex=share, sharey=share, width_ratios=widths
    )
    for ax, panel in zip(axes.flat, panels):
        show(ax, panel)
    for ax in axes.flat[len(panels) :]:
        ax.set_axis_off()
        axes.flat[list(axes.flat).index(ax) - columns].tick_params(labelbottom=True)
    handles = [Line2D([], [], label=each.label, **each.style) for each in key]
    figure.legend(handles=handles, ncols=6, loc="upper center", frameon=False, handletextpad=0.3)
    if share:
        for ax in axes.flat:
            ax.label_outer()
    figure.tight_layout(rect=(0, 0, 1, 1 - 0.62 * bool(key) / size[1]))
    figure.savefig(path, dpi=dpi)
    plt.close(figure)
    if colours:
        with Image.open(path) as image:
            image.convert("RGB").quantize(colours).save(path, optimize=True)


def show(ax: Axes, panel: Panel) -> None:
    for each in panel.series:
        if each.bottom is None:
            ax.plot(each.x, each.y, each.format, label=each.label, **each.style)
        else:
            ax.bar(each.x, each.y, bottom=each.bottom, label=each.label, **each.style)
    if panel.cells:
        show_cells(ax, panel.cells)
    else:
        ax.grid(color=PALE, lw=0.5)
        ax.set_axisbelow(True)
        ax.spines[["top", "right"]].set_visible(False)
    ax.set(**panel.axes)
    ax.set_title(panel.title, loc="left", fontsize=plt.rcParams["font.size"] + 0.5, fontweight="bold")
    for axis, ticks in ((ax.xaxis, panel.xticks), (ax.yaxis, panel.yticks)):
        if ticks is not None:
            axis.set_ticks(list(ticks), list(ticks.values()))
            axis.minorticks_off()
    if panel.above:
        ax.xaxis.tick_top()
        plt.setp(ax.get_xticklabels(), rotation=40, ha="left", rotation_mode="anchor")
    for x, y, words, colour in panel.texts:
        ax.annotate(words, (x, y), color=colour, fontsize=7, ha="center")
    if panel.legend is not None:
        ax.legend(**({"frameon": False, "fontsize": 7.5} | dict(panel.legend)))


def show_cells(ax: Axes, cells: Cells) -> None:
    for (i, j), value in np.ndenumerate(cells.values):
        strength = None if np.isnan(value) else cells.shade(value)
        colour = "#f0f0f0" if np.isnan(value) else "#ffffff" if strength is None else cells.colours(strength)
        ax.add_patch(plt.Rectangle((j - 0.47, i - 0.45), 0.94, 0.9, facecolor=colour, edgecolor="#dddddd", lw=0.5))
        ink = "white" if strength is not None and strength > 0.6 else "#999999" if strength is None else INK
        ax.text(j, i, cells.label(value), ha="center", va="center", color=ink, fontsize=7)
    rows, columns = cells.values.shape
    ax.set(xlim=(-0.5, columns - 0.5), ylim=(rows - 0.5, -0.5))
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)
