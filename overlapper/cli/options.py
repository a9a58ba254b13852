"""What several commands ask for."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

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
