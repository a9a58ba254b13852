"""The common description of drawn bodies, overlaps and forces: faces, lines and dots.

Live views, pages, pictures and notebooks draw these. Lengths are in metres, colours are red, green and blue in 0..1.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from overlapper import Overlap, Placed
from overlapper.quaternion import rotated
from overlapper.shapes.drawing import Facets, Tessellation, polytope_edges
from overlapper.viewer.look import (
    AMBIENT,
    DIFFUSE,
    GRID,
    GRID_OPACITY,
    GROUND,
    GROUND_OPACITY,
    INK,
    LIGHT,
    LINE,
    Array,
    Look,
    arrow_length,
    channels,
    owner_color,
)
from overlapper.viewer.pressure import FORCE, FRICTION, Arrow, Press, Scale, colors, pressures
from overlapper.viewer.tessellation import Ground, cone, ground, rotation_from_z, tessellation

FRONT, BACK, BOTH = 0, 1, 2  # the sides from which a face is seen, as three.js counts them


@dataclass(frozen=True, eq=False, kw_only=True)
class Primitive:
    """`color` (3,), or one of each point; `strength`, one of each point, multiplies the opacity.

    Primitives with a higher `order` are drawn later. With `through`, nothing in front hides the primitive.
    """

    points: Array
    color: Array
    opacity: float = 1.0
    strength: Array | None = None
    order: float = 0.0
    through: bool = False
    name: str = ""
    visible: bool = True


@dataclass(frozen=True, eq=False, kw_only=True)
class Faces(Primitive):
    """Convex `facets`, rings of indices, counter-clockwise from outside, over `points` (n, 3).

    A face shows `glow` times its colour in the dark. Full light adds `lit` times its colour. By default a face has its
    own colour in any light.
    `normals` (n, 3) are the directions to shade by; None if facets are flat.
    """

    facets: Facets
    normals: Array | None = None
    glow: float = 1.0
    lit: float = 0.0
    side: int = FRONT

    def shade(self, normals: Array) -> Array:
        """The fraction (...) of their colour that faces with these unit normals (..., 3) in the world show."""
        shade: Array = self.glow + self.lit * (AMBIENT + DIFFUSE * np.maximum(normals @ LIGHT, 0))
        return shade


@dataclass(frozen=True, eq=False, kw_only=True)
class Lines(Primitive):
    """Segments `points` (m, 2, 3), from and to."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Dots(Primitive):
    """Dots at `points` (n, 3), `size` pixels wide."""

    size: float = 4.0


class Drawing:
    """How bodies and overlaps are drawn in a scene with this `center` and `size`, m."""

    def __init__(self, center: Array, size: float, is_ground: Callable[[Placed], bool], *looks: Look) -> None:
        """`looks` are those of the bodies and of the overlaps."""
        self.center, self.size, self._is_ground = center, size, is_ground
        self._bodies, self._overlaps = looks
        self._known: dict[bytes, Tessellation] = {}

    def ground(self, placed: Placed) -> Ground | None:
        """The part of a ground that is drawn, in the frame of its shape; None for any other shape."""
        if not self._is_ground(placed):
            return None
        back = np.append(-placed.orientation[:3], placed.orientation[3])
        return ground(placed.shape, rotated(back, self.center - placed.position), self.size)

    def body(self, placed: Placed, color: Sequence[float]) -> list[Primitive]:
        """The shape in its own frame. Invisible primitives are included, so that a page can show them."""
        look, own = self._bodies, np.array(color[:3])
        if seen := self.ground(placed):
            return _plane(seen, look)
        shape = pickle.dumps(placed.shape)
        solid = self._known[shape] = self._known.get(shape) or tessellation(placed.shape)
        skin = partial(Faces, points=solid.vertices, facets=solid.faces, opacity=look.opacity, visible=look.faces)
        skin = partial(skin, glow=0.0, lit=1.0)
        front = channels(look.front) if look.front else own
        inside = [skin(color=channels(look.back), side=BACK, name="inside")] if look.back else []
        return [
            skin(color=front, normals=solid.normals, name="faces"),
            *inside,
            Lines(points=solid.edges, color=own, opacity=0.35, name="edges", visible=look.edges and look.faces),
            Lines(points=solid.wires, color=own, name="wires", visible=look.edges and not look.faces),
            Dots(points=solid.vertices, color=own, name="vertices", visible=look.vertices),
        ]

    def overlap(self, overlap: Overlap, press: Press | None = None, scale: Scale | None = None) -> list[Primitive]:
        """Facets, patch outline and normal about the centroid, where single precision is enough.

        Facets are coloured by owner. With the forces of the pair and a scale, they are coloured by pressure, and there
        is no normal.
        """
        look, centroid = self._overlaps, np.asarray(overlap.centroid)
        vertices = overlap.vertices - centroid
        drawn: list[Primitive] = []
        if look.faces and press and scale:
            drawn.append(_pressed(overlap, press, scale, look.opacity))
        elif look.faces:
            drawn += self._facets(overlap, vertices)
        if look.edges:
            drawn.append(Lines(points=vertices[polytope_edges(overlap.facets)], color=np.array(LINE), order=1))
        if look.vertices:
            drawn.append(Dots(points=vertices, color=np.array(LINE), order=1))
        if look.marks:
            rings = [np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) - centroid for ring in overlap.patch]
            drawn += [_shining_line(np.concatenate(rings), "patch")] if rings else []
            drawn += self._normal(overlap) if press is None and overlap.normal is not None else []
        if np.ptp(vertices, axis=0).max() < 0.015 * self.size:
            drawn.append(Dots(points=np.zeros((1, 3)), color=np.array(INK), order=3, through=True, size=5.0))
        return drawn

    def _facets(self, overlap: Overlap, vertices: Array) -> list[Primitive]:
        """The faces of each owner, and those seen from inside where faces are seen through."""
        look = self._overlaps
        drawn: list[Primitive] = []
        for owner in np.unique(overlap.owner):
            rings = [ring for ring, each in zip(overlap.facets, overlap.owner, strict=True) if each == owner]
            skin = partial(Faces, points=vertices, facets=rings, opacity=look.opacity)
            own = channels(look.front) if look.front else owner_color(owner)
            if look.opacity < 1:
                back = channels(look.back) if look.back else 0.5 * own
                drawn.append(skin(color=back, side=BACK, order=0.5))
            # Faces glow, so that the colour of the owner is also seen on the shaded side.
            drawn.append(skin(color=own, glow=0.4, lit=0.7, order=1))
        return drawn

    def _normal(self, overlap: Overlap) -> list[Primitive]:
        length = arrow_length(overlap.area, self.size)
        arrow = length * np.asarray(overlap.normal)
        line = _shining_line(np.array([[np.zeros(3), arrow]]), "normal")
        return [line, _cones([cone(radius=0.05 * length, bottom=0.8 * length, top=length)], arrow, INK, 2)]

    def force(self, arrow: Arrow, scale: Scale, size: float) -> list[Primitive]:
        """The force of a pair of links and its friction, about the arrow's start, as thick as suits `size` m."""
        drawn: list[Primitive] = []
        for vector, color, thick in ((arrow.force, FORCE, 1.0), (arrow.friction, FRICTION, 1.2)):
            along = scale.arrow(vector)
            length = float(np.linalg.norm(along))
            if length < 0.002 * size:
                continue
            tip = min(0.02 * size, 0.6 * length)
            wide = min(0.005 * thick * size, 0.4 * tip)
            shaft, head = cone(wide / 3, 0.0, length - tip, wide / 3), cone(wide, length - tip, length)
            drawn.append(_cones([shaft, head], along, color, 2.5))
        return drawn


def _plane(seen: Ground, look: Look) -> list[Primitive]:
    """A ground in colours of its own, before all that stands on it."""
    plane = partial(Faces, color=np.array(GROUND), opacity=GROUND_OPACITY, side=BOTH, order=-2, name="faces")
    grid = partial(Lines, color=np.array(GRID), opacity=GRID_OPACITY, order=-1, name="edges")
    return [
        plane(points=seen.vertices, facets=seen.faces, strength=seen.strength(seen.vertices), visible=look.faces),
        grid(points=seen.edges, strength=seen.strength(seen.edges), visible=look.edges),
    ]


def _pressed(overlap: Overlap, press: Press, scale: Scale, opacity: float) -> Faces:
    """The surface coloured by pressure."""
    corners, found = (each.reshape(-1, *each.shape[2:]) for each in pressures(overlap, press, scale.top))
    points, facets = corners - np.asarray(overlap.centroid), np.arange(len(corners)).reshape(-1, 3)
    return Faces(points=points, facets=facets, color=colors(found, scale.top), opacity=opacity, order=1)


def _shining_line(segments: Array, name: str) -> Lines:
    return Lines(points=segments, color=np.array(INK), order=2, through=True, name=name)


def _cones(upright: Sequence[Tessellation], along: Array, color: Sequence[float], order: float) -> Faces:
    """Cones about z, turned to point along a vector, that shine through everything."""
    turn = rotation_from_z(along / np.linalg.norm(along))
    firsts = np.cumsum([0, *(len(each.vertices) for each in upright[:-1])])
    points = np.concatenate([each.vertices for each in upright]) @ turn.T
    facets = np.concatenate([each.faces + first for each, first in zip(upright, firsts)])
    return Faces(points=points, facets=facets, color=np.array(color), order=order, through=True)
