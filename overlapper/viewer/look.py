"""How bodies and overlaps are drawn, in a live view, in a recording and in a picture.

Bodies are drawn by their collision shapes, translucent and in their own colours. Each facet of an overlap has the
colour of the shape whose surface it lies on: orange for the first of the pair, sky blue for the second. They are from
the palette of Okabe and Ito, so that readers with common kinds of colour blindness can tell them apart. The bodies' own
colours would say less, as in many models everything is white or grey.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overlapper import Overlap
from overlapper import overlap as common_part

Array = NDArray[np.float64]

OWNER_COLORS = [
    (0.90, 0.62, 0.00),
    (0.34, 0.71, 0.91),
    (0.00, 0.62, 0.45),
    (0.94, 0.89, 0.26),
    (0.80, 0.47, 0.65),
    (0.84, 0.37, 0.00),
    (0.00, 0.45, 0.70),
]
INK = (1.00, 0.31, 0.64)  # marks that shine through everything: a colour that models hardly ever have
LINE = (0.91, 0.92, 0.94)  # edges and vertices of overlaps
TOP, BOTTOM = (0.20, 0.23, 0.28), (0.09, 0.10, 0.13)  # the background
GROUND, GRID = (0.36, 0.40, 0.47), (0.62, 0.68, 0.77)  # the face and the lines of a ground
GROUND_OPACITY, GRID_OPACITY = 0.5, 0.45  # in the middle of a ground, which fades out from there
LIGHT = np.array([0.5, -0.8, 1.4]) / np.linalg.norm([0.5, -0.8, 1.4])  # the direction to the light
AMBIENT, DIFFUSE = 0.45, 0.55  # light from all sides, light from that direction
FIELD_OF_VIEW = 35.0  # degrees, from bottom to top
PARTS = ("faces", "edges", "vertices", "marks", "forces")  # what a Look may show
MANY_FACETS = 100  # polytopes with more facets stand for round overlaps


@dataclass(frozen=True, slots=True)
class Look:
    """How each body or overlap is drawn.

    Parameters
    ----------
    faces : bool, default True
        Whether faces are drawn.
    edges : bool, default True
        Whether edges are drawn.
    vertices : bool, default False
        Whether vertices are drawn.
    opacity : float, default 1.0
        Opacity of the faces, from 0 to 1.
    front : str, optional
        Colour of faces from outside, as #rrggbb. Default: each body or overlap has its own colour.
    back : str, optional
        Colour of faces from inside, as #rrggbb. Default: the inside of overlaps has a darker shade of their colour, and
        the inside of bodies is not drawn.
    marks : bool, default True
        Whether the patch outline and the normal of an overlap are drawn.
    forces : bool, default True
        Whether forces, if there are any, are drawn: arrows replace normals, and pressures replace colours of overlaps.

    Raises
    ------
    ValueError
        If `opacity` or a colour is invalid.
    """

    faces: bool = True
    edges: bool = True
    vertices: bool = False
    opacity: float = 1.0
    front: str | None = None
    back: str | None = None
    marks: bool = True
    forces: bool = True

    def __post_init__(self) -> None:
        if not 0 <= self.opacity <= 1:
            raise ValueError(f"opacity must lie between 0 and 1, not {self.opacity}")
        for name in ("front", "back"):
            color = getattr(self, name)
            if color is not None and not re.fullmatch("#[0-9a-fA-F]{6}", color):
                raise ValueError(f"{name} must be a colour like #e69f00, not {color!r}")


BODIES = Look(opacity=0.35)
OVERLAPS = Look(edges=False)


def channels(color: str) -> Array:
    """Red, green and blue (3,) in 0..1 of a colour #rrggbb."""
    return np.array([int(color[k : k + 2], 16) for k in (1, 3, 5)]) / 255


def owner_color(number: int) -> Array:
    """The colour (3,) of the facets that lie on the surface of the shape with that number."""
    return np.array(OWNER_COLORS[number % len(OWNER_COLORS)])


def hexadecimal(color: Sequence[float] | Array) -> str:
    """The colour #rrggbb of red, green and blue in 0..1."""
    return "#" + "".join(f"{round(255 * each):02x}" for each in color)


def to_draw(overlap: Overlap, size: float) -> Overlap:
    """The overlap, a round one with no more facets than are seen in a scene of that size, m."""
    if len(overlap.owner) <= MANY_FACETS:
        return overlap
    extent = np.ptp(np.asarray(overlap.bounds), axis=0).max() / size
    return common_part(*overlap.shapes, tolerance=0.03 if extent > 0.1 else 0.1 if extent > 0.04 else 0.2) or overlap


def arrow_length(area: float, size: float) -> float:
    """The length of the normal, m: in proportion to the patch, within bounds that suit a scene of that size."""
    return float(np.clip(np.sqrt(area) / 3, 0.03 * size, 0.06 * size))


def volume_text(volume: float) -> str:
    for cubic_metres, unit in ((1e-9, "mm³"), (1e-6, "cm³"), (1e-3, "dm³")):
        if volume < 1000 * cubic_metres:
            return f"{volume / cubic_metres:.3g} {unit}"
    return f"{volume:.3g} m³"
