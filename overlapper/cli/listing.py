"""An inventory for a person to read: a line per link and kind of shape, and what is left out."""

from __future__ import annotations

from collections.abc import Sequence

from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from overlapper.simulation.inventory import Inventory, ListedShape


def shapes_table(found: Inventory) -> Table:
    """The links that have shapes."""
    table = Table(
        caption="Sizes in m. Volume: of each shape by itself, added up. Meets: how many other links in the file "
        "pybullet lets the link collide with.",
        caption_justify="left",
        box=SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
        collapse_padding=True,
    )
    table.add_column("link", overflow="fold")
    table.add_column("shapes", no_wrap=True)
    table.add_column("size", overflow="fold")
    for header in ("volume\ncm³", "meets"):
        table.add_column(header, justify="right", no_wrap=True)
    for link in found.links:
        for row, kind in enumerate(dict.fromkeys(shape.kind for shape in link.shapes)):
            shapes = [shape for shape in link.shapes if shape.kind == kind]
            table.add_row(
                Text("" if row else link.name),
                f"{len(shapes)} {_plural(kind)}" if len(shapes) > 1 else kind,
                _sizes(shapes),
                _rounded(1e6 * sum(shape.volume for shape in shapes)),
                "" if row else str(link.meets),
            )
    return table


def remarks(found: Inventory) -> list[str]:
    """What there is to say below the table."""
    bodies = f"{found.bodies:,} bodies" if found.bodies != 1 else "1 body"
    lines = [
        f"{bodies}, {found.shapes_read:,} of {found.shapes:,} shapes modelled, "
        f"{found.pairs:,} pairs of shapes that pybullet lets collide."
    ]
    lines += [f"Concave: {name} is {parts:,} convex part{'s' * (parts > 1)}." for name, parts in found.decomposed]
    return lines + [f"Not modelled: {name}, {reason}." for name, reason in found.skipped]


def _sizes(shapes: Sequence[ListedShape]) -> str:
    """That of one, or of all if they are the same; else from the least to the largest side or number of corners."""
    if len({shape.size for shape in shapes}) == 1:
        return shapes[0].size
    sides = [side for shape in shapes for side in shape.box]
    corners = [shape.corners for shape in shapes]
    span = f"sides {min(sides):.3g} to {max(sides):.3g}"
    return f"{min(corners)} to {max(corners)} corners, {span}" if max(corners) else span


def _rounded(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000 else f"{value:.4g}"


def _plural(kind: str) -> str:
    return f"{kind}es" if kind.endswith("x") else f"{kind}s"
