"""What several commands ask for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import typer

from overlapper.cli.refusals import Refused

SceneArgument = Annotated[
    str, typer.Argument(help="Name of a scene, or path of a scene file (.py).", show_default=False)
]

OutOption = Annotated[Path | None, typer.Option(help="Table of all pairs in all steps: .csv, .parquet, .sqlite.")]

HtmlOption = Annotated[Path | None, typer.Option(help="Recording to look at in a browser, one file.")]

CheckOption = Annotated[
    Literal["fcl"] | None, typer.Option(help="Ask FCL about every pair, too, and explain what differs.")
]

ToleranceOption = Annotated[float, typer.Option(help="Relative accuracy of smooth shapes; polyhedra are exact.")]

PerOption = Annotated[
    Literal["shape", "link"], typer.Option(help="What the rows of --out are of: two shapes, or two links as a whole.")
]

MethodOption = Annotated[
    Literal["auto", "paper"], typer.Option(help="How overlaps are computed; `paper` is the article, step for step.")
]

SurfaceOption = Annotated[
    Literal["nominal", "margin"],
    typer.Option(help="Convex meshes as they are, or with the margin that Bullet lays around them."),
]

ConcaveOption = Annotated[
    Literal["decompose", "enclose", "skip"],
    typer.Option(help="Concave meshes: as convex parts, open ones too with walls around them, or not at all."),
]

ThresholdOption = Annotated[
    float, typer.Option(help="Concavity that may be left, from 0.01 (many parts) to 1 (the hull).")
]

PairsOption = Annotated[
    Literal["simulated", "all"] | None,
    typer.Option(help="Pairs that the simulator lets collide, or all of different bodies; by default PAIRS."),
]

ContactOption = Annotated[
    Literal["bullet", "volumetric"] | None,
    typer.Option(help="What pushes bodies apart: contact points, or the volumes they share; by default CONTACT."),
]

SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="A parameter of the scene; may be repeated.", show_default=False),
]


def given_parameters(settings: Sequence[str] | None) -> dict[str, str]:
    """What --set says, by name; Refused if it says nothing, or one thing twice."""
    given: dict[str, str] = {}
    for each in settings or ():
        name, sign, text = each.partition("=")
        if not (name and sign):
            raise Refused(f"--set must be NAME=VALUE, not {each!r}")
        if name in given:
            raise Refused(f"--set says {name} twice")
        given[name] = text
    return given


LeastDepthOption = Annotated[
    float, typer.Option(min=0.0, help="Depth in m below which an overlap is none to worry about.", show_default=False)
]

ExpectOption = Annotated[
    list[str] | None,
    typer.Option(metavar="A,B", help="Two that may overlap; * is any text; may be repeated.", show_default=False),
]


def expected_pairs(given: list[str] | None) -> list[tuple[str, str]]:
    """What --expect was given."""
    from overlapper.audit.allowed import allowed_pair

    try:
        return [allowed_pair(each) for each in given or ()]
    except ValueError as error:
        raise Refused(str(error)) from error


def refuse_out_of_range(tolerance: float, concave_threshold: float, out: Path | None) -> None:
    """Refuse what types cannot."""
    from overlapper.tables.table_file import TABLES

    if not 0 < tolerance < 1:
        raise Refused(f"--tolerance must lie between 0 and 1, not {tolerance}")
    if out and out.suffix not in TABLES:
        raise Refused(f"--out must end in {', '.join(TABLES)}, not {out.name!r}")
    if not 0.01 <= concave_threshold <= 1:
        raise Refused(f"--concave-threshold must lie between 0.01 and 1, not {concave_threshold}")
