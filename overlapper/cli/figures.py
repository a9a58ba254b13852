"""The tables of commands: how they look, and volumes and their errors in them."""

from __future__ import annotations

import sys
from decimal import ROUND_UP, Context

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

# Units for the volumes of one table, in m³: the largest of them that makes the largest volume a tenth or more.
VOLUME_UNITS = {"m³": 1.0, "cm³": 1e-6, "mm³": 1e-9, "µm³": 1e-18}


# One digit of an error bound, which must remain one.
ROUNDED_UP = Context(prec=1, rounding=ROUND_UP)


def volume_unit(largest: float) -> str:
    """The unit for the volumes of a table, by the largest of them in m³."""
    return next((unit for unit, size in VOLUME_UNITS.items() if largest >= 0.1 * size), "µm³")


def show(what: Table | str, stderr: bool = False, markup: bool = True) -> None:
    """Print it at the width of the terminal. In files and pipes, it is wide enough for any of the tables."""
    is_terminal = (sys.stderr if stderr else sys.stdout).isatty()
    Console(stderr=stderr, width=None if is_terminal else 140, highlight=False).print(what, markup=markup)


def plain_table(title: str | None = None, caption: str | None = None) -> Table:
    """A table without columns yet, with a rule below their names and no frame."""
    return Table(
        title=title,
        caption=caption,
        caption_justify="left",
        box=SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
        collapse_padding=True,
    )
