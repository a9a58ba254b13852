"""What is made of the bodies of a pybullet client: convex parts in the frames of their links, and what is left out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from overlapper import Shape
from overlapper.polytopes.decomposition import check_threshold
from overlapper.simulation.height_field import HeightField

Array = NDArray[np.float64]
Color = tuple[float, float, float, float]
Concave = Literal["decompose", "enclose", "skip"]
Surface = Literal["nominal", "margin"]

BASE = -1


@dataclass(frozen=True, slots=True)
class Skipped:
    """Shapes of one link that are not modelled, and why.

    `body` and `link` are pybullet's indices: link -1 is the base, body -1 one to which pybullet gives no id. `name` is
    what the link is called, `reason` one sentence.
    """

    body: int
    link: int
    name: str
    reason: str


@dataclass(frozen=True, slots=True)
class Decomposed:
    """A concave mesh of one link, modelled as the union of convex parts: the shapes `shapes` of it.

    `body` and `link` are pybullet's indices, link -1 is the base; `name` is what the link is called.
    `volume` (m³) is that of the parts together, `mesh_volume` what the mesh bounds; None where its surface is open or
    turns both ways. `path` is where the parts are kept on disk, None if the mesh had them already and they are exact.
    """

    body: int
    link: int
    name: str
    shapes: range
    volume: float
    mesh_volume: float | None
    path: Path | None


@dataclass(frozen=True, slots=True)
class Part:
    """A modelled shape, placed in the frame of its collider: the inertial frame of the base or link."""

    link: int
    index: int
    shape: Shape
    position: Array
    orientation: Array


@dataclass(frozen=True, slots=True)
class Ground:
    """A height field, placed in the frame of its collider."""

    field: HeightField
    position: Array
    orientation: Array

    def part(self, number: int) -> Part:
        return Part(BASE, number, self.field.prism(number), self.position, self.orientation)


@dataclass(frozen=True, slots=True)
class Settings:
    """How shapes are modelled: see `simulation.Bodies`. ValueError if there is no such way."""

    concave: Concave
    threshold: float
    surface: Surface

    def __post_init__(self) -> None:
        for name, choices in (("concave", get_args(Concave)), ("surface", get_args(Surface))):
            if (chosen := getattr(self, name)) not in choices:
                raise ValueError(f"{name} must be one of {', '.join(map(repr, choices))}, not {chosen!r}")
        check_threshold(self.threshold)


@dataclass(frozen=True, slots=True)
class Body:
    name: str
    link_names: dict[int, str]
    colors: dict[int, Color]
    parents: dict[int, int]  # of each link
    margin: float  # of the base's outermost shape
    shape_count: int
    parts: tuple[Part, ...]
    skipped: tuple[Skipped, ...]
    decomposed: tuple[Decomposed, ...]
    ground: Ground | None = None  # of which `parts` are the prisms modelled so far
