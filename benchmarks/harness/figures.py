"""The common style of the charts. Nothing else imports matplotlib's pyplot."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

INK, PALE, OURS = "#222222", "#e3e3e3", "#d1001f"


def style(**more: object) -> None:
    """Starts a page's charts: matplotlib's own style, but for these settings."""
    plt.rcdefaults()
    plt.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "overlapper", **more})


def tidy(*axes: Axes) -> None:
    """A pale grid behind the curves, no frame above and at the right, titles bold at the left."""
    for ax in axes:
        ax.grid(color=PALE, lw=0.5)
        ax.set_axisbelow(True)
        ax.spines[["top", "right"]].set_visible(False)
        ax.title.set(fontsize=10, fontweight="bold", ha="left", x=0)


def save(figure: Figure, path: Path, dpi: int = 130, colours: int = 0, svg: bool = False) -> None:
    """As PNG, with so few colours as flat charts need if a number is given; as SVG without a date, too, if asked."""
    if svg:
        figure.savefig(path.with_suffix(".svg"), metadata={"Date": None})
    figure.savefig(path.with_suffix(".png"), dpi=dpi)
    plt.close(figure)
    if colours:
        with Image.open(path.with_suffix(".png")) as image:
            image.convert("RGB").quantize(colours).save(path.with_suffix(".png"), optimize=True)
