"""The charts of speed, each as PNG and SVG, from rows of the results; and one of them to hover over, as HTML."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from harness import figures
from harness.figures import PALE, plt
from harness.page import duration, write
from harness.peers import TIMED, Look
from speed.turns import Row

# Where an answer without any error is drawn: below the half-ulp of 1e-16.
EXACT = 1e-17

# Ways that are not peers, drawn as the peer that they are most like.
ALIKE = {"cutting": "clipping", "duality": "scipy", "one hull": "scipy", "tree": "voxels"}

US = (0.1, 3e7)  # time per pair, from left to right


LOOKS = {name: peer.look for name, peer in TIMED.items() if peer.look}


def start() -> None:
    ticks = {"xtick.major.size": 2, "ytick.major.size": 2}
    figures.style(
        **{"font.size": 8, "font.family": "DejaVu Sans", "axes.linewidth": 0.6, "axes.edgecolor": "#999999", **ticks}
    )


def save(figure: Figure, path: Path) -> None:
    figures.save(figure, path, 170, 128, svg=True)


def marks(look: Look, lines: float) -> dict[str, object]:
    """How a method's marks are drawn, with lines of that width between them."""
    fill = "white" if look.hollow else look.colour
    edge, width = (look.colour, 1.1) if look.hollow else ("white", 0.6)
    shape = {"marker": look.marker, "ms": look.size, "mfc": fill, "mec": edge, "mew": width}
    return {"color": look.colour, "lw": lines, **shape}


# Error over time


def accuracy(rows: list[Row], families: list[str], columns: int, path: Path, hover: Path | None = None) -> None:
    """A panel for each family, every method at every setting a point."""
    lines = -(-len(families) // columns)
    size = (2.35 * columns + 0.4, 2.05 * lines + 1.1)
    figure, axes = plt.subplots(lines, columns, figsize=size, sharex=True, sharey=True, squeeze=False)
    words: dict[str, tuple[str, str]] = {}
    for ax, family in zip(axes.flat, families):
        panel(ax, family, [row for row in rows if row.family == family], words)
    for ax in axes.flat[len(families) :]:
        ax.set_axis_off()
        above = axes.flat[list(axes.flat).index(ax) - columns]
        above.tick_params(labelbottom=True)
    for ax in axes[:, 0]:
        ax.set_ylabel("error, relative")
    for ax in axes[-1]:
        ax.set_xlabel("time per pair")
    top = 1 - 0.62 / size[1]
    figure.legend(handles=list(legend()), ncols=6, loc="upper center", frameon=False, handletextpad=0.3)
    figure.tight_layout(rect=(0, 0, 1, top), h_pad=0.6, w_pad=0.5)
    if hover:
        write_hover(hover, figure, words)
    save(figure, path)


def panel(ax: Axes, family: str, rows: list[Row], words: dict[str, tuple[str, str]]) -> None:
    ax.set(xscale="log", yscale="log", xlim=US, ylim=(3e-18, 8))
    ax.set_title(family, fontsize=8.5, fontweight="bold", loc="left", pad=3)
    ax.set_xticks([1e0, 1e2, 1e4, 1e6], ["1 µs", "100 µs", "10 ms", "1 s"])
    ax.set_yticks([EXACT, 1e-12, 1e-8, 1e-4, 1], ["none", "1e−12", "1e−8", "1e−4", "1"])
    ax.minorticks_off()
    ax.grid(color=PALE, lw=0.5)
    ax.set_axisbelow(True)
    for name, look in LOOKS.items():
        found = [row for row in rows if row.method == name and row.us and row.error]
        x = [float(row.us) for row in found]
        y = [min(1.0, max(EXACT, float(row.error))) for row in found]
        order = 3 + 2 * look.ours + look.joined
        if look.joined and len(found) > 1:
            ax.plot(x, y, color=look.colour, lw=1.0, alpha=0.6, zorder=order - 1)
        for row, across, up in zip(found, x, y):
            key = f"point{len(words)}"
            words[key] = (row.method, spoken(row))
            ax.plot(across, up, **marks(look, 0), ls="none", zorder=order, gid=key, clip_on=False)


def legend() -> Iterator[Line2D]:
    for name, look in LOOKS.items():
        yield Line2D([], [], label=f"{name} (ours)" if look.ours else name, **marks(look, 1.0 if look.joined else 0))


def spoken(row: Row) -> str:
    """A point in words, for those who hover over it."""
    setting = f" at {row.setting}" if row.setting else ""
    error = "without error" if float(row.error) == 0 else f"{row.quantity} off by {float(row.error):.1e}"
    note = f" ({row.note})" if row.note else ""
    return f"{row.family}: {row.method}{setting}, {duration(float(row.us))} a pair, {error}{note}"


# Time over size


@dataclass(frozen=True)
class Growth:
    """A panel: for each method its points (size, µs), and the power of the size with which it grows, where fitted."""

    title: str
    along: str
    lines: dict[str, list[tuple[float, float]]]
    powers: dict[str, float]


def growth(panels: list[Growth], path: Path) -> None:
    """Time over size, a line for each method that is named at its end with its power."""
    figure, axes = plt.subplots(1, len(panels), figsize=(9.4, 4.2), sharey=True, squeeze=False)
    for ax, shown in zip(axes[0], panels):
        ax.set(xscale="log", yscale="log", xlabel=shown.along)
        ax.set_title(shown.title, fontsize=9.5, fontweight="bold", loc="left")
        ax.grid(color=PALE, lw=0.5)
        for name, points in shown.lines.items():
            look = look_of(name)
            ax.plot(
                *zip(*points), color=look.colour, marker=look.marker, ms=look.size, lw=2.2 if look.ours else 1.2,
                mec="white", mew=0.5, zorder=5 if look.ours else 3,
            )  # fmt: skip
        ticks = sorted({x for points in shown.lines.values() for x, _ in points})
        ax.set_xticks(ticks, [f"{t:,.0f}" for t in ticks])
        ax.set_xlim(min(ticks) / 1.3, max(ticks) * (max(ticks) / min(ticks)) ** 0.55)
        ax.minorticks_off()
    times = [us for shown in panels for points in shown.lines.values() for _, us in points]
    decades = 10.0 ** np.arange(np.floor(np.log10(min(times))), np.ceil(np.log10(max(times))) + 1)
    axes[0, 0].set_yticks(decades, [duration(us) for us in decades])
    axes[0, 0].minorticks_off()
    axes[0, 0].set_ylabel("time")
    for ax, shown in zip(axes[0], panels):
        name_ends(ax, shown)
    figure.tight_layout(w_pad=1.0)
    save(figure, path)


def look_of(name: str) -> Look:
    return LOOKS.get(name) or LOOKS[ALIKE[name]]


def name_ends(ax: Axes, shown: Growth) -> None:
    """Names to the right of the last points, moved apart where they would lie on each other."""
    low, high = np.log10(ax.get_ylim())
    level = -np.inf
    for name, points in sorted(shown.lines.items(), key=lambda item: item[1][-1][1]):
        level = max(np.log10(points[-1][1]), level + 0.055 * (high - low))
        power = f", {shown.powers[name]:.2f}" if name in shown.powers else ""
        look = look_of(name)
        ax.annotate(
            name + power, points[-1], (1.3 * points[-1][0], 10**level), color=look.colour, fontsize=8, va="center",
            fontweight="bold" if look.ours else "normal", annotation_clip=False,
        )  # fmt: skip


# To hover over


def write_hover(path: Path, figure: Figure, words: dict[str, tuple[str, str]]) -> None:
    """The figure with words for every point, in a page that needs nothing else."""
    ET.register_namespace("", "http://www.w3.org/2000/svg")
    ET.register_namespace("xlink", "http://www.w3.org/1999/xlink")
    drawn = StringIO()
    figure.savefig(drawn, format="svg", metadata={"Date": None})
    root = ET.fromstring(drawn.getvalue())
    for group in root.iter("{http://www.w3.org/2000/svg}g"):
        method, said = words.get(group.get("id", ""), ("", ""))
        if said:
            group.set("class", "point")
            group.set("data-method", method)
            group.set("data-words", said)
    svg = ET.tostring(root, encoding="unicode")
    write(Path(__file__).with_name("hover.html"), path, svg=svg)
