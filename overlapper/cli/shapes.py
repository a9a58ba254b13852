"""`overlapper shapes`: the modelled shapes of a file, a line per link and kind of shape, and the skipped shapes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table
from rich.text import Text

from overlapper.cli.figures import plain_table, show
from overlapper.cli.options import modelling, with_options
from overlapper.cli.refusals import Refused, say
from overlapper.printable import printable
from overlapper.simulation.settings import Modelling

if TYPE_CHECKING:
    from overlapper.simulation.bullet.inventory import Inventory, ListedShape


@with_options(modelled=modelling)
def shapes(
    file: Annotated[
        Path, typer.Argument(help="Model or saved scene: .urdf, .sdf, .xml (MJCF), .bullet.", show_default=False)
    ],
    *,
    modelled: Modelling,
    self_collision: Annotated[
        bool, typer.Option("--self-collision", help="Load the model with pybullet's URDF_USE_SELF_COLLISION.")
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object with every shape instead of the table.")
    ] = False,
) -> None:
    """List the shapes of a file that pybullet loads: by link, with sizes, pairs that may collide, and skipped shapes.

    The exit code is 0 if every shape is modelled, and 1 if a shape is skipped. It is 2 if pybullet cannot load the
    file, or would load something else than the file describes.

    Examples:

    [bold]overlapper shapes robot.urdf[/bold]

    [bold]overlapper shapes robot.urdf --self-collision --json[/bold]
    """
    from overlapper.simulation.bullet.inventory import inventory
    from overlapper.simulation.bullet.model_file import NotRead

    try:
        found = inventory(file, self_collision, modelled)
    except (NotRead, ImportError) as error:
        raise Refused(str(error)) from error
    if as_json:
        print(json.dumps(found.as_dict()))
    else:
        if found.links:
            show(_table(found))
        for line in _remarks(found):
            say(line)
    raise typer.Exit(1 if found.skipped else 0)


def _table(found: Inventory) -> Table:
    """The links that have shapes."""
    table = plain_table(
        caption="Sizes in m. Volume: sum of the volumes of the shapes. Meets: number of other links in the file that "
        "pybullet lets the link collide with.",
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
                Text("" if row else printable(link.name)),
                f"{len(shapes)} {_plural(kind)}" if len(shapes) > 1 else kind,
                _sizes(shapes),
                _rounded(1e6 * sum(shape.volume for shape in shapes)),
                "" if row else str(link.meets),
            )
    return table


def _remarks(found: Inventory) -> list[str]:
    """The lines below the table."""
    bodies = f"{found.bodies:,} bodies" if found.bodies != 1 else "1 body"
    lines = [
        f"{bodies}, {found.shapes_read:,} of {found.shapes:,} shapes modelled, "
        f"{found.pairs:,} pairs of shapes that pybullet lets collide."
    ]
    lines += [f"Concave: {name} is {parts:,} convex part{'s' * (parts > 1)}." for name, parts in found.decomposed]
    return lines + [f"Not modelled: {name}, {reason}." for name, reason in found.skipped]


def _sizes(shapes: Sequence[ListedShape]) -> str:
    """The size, if all shapes have the same. Otherwise the ranges of sides and of numbers of corners."""
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
