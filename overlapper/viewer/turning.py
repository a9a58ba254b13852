"""A picture that turns, as SVG: bodies by their silhouettes, and every facet of what they share.

The camera is far away, so that lines stay lines. The overlap is convex, so no facet that faces the camera hides another
facet. The corners of polygons move from each of the STEPS to the next, in any browser and without a script.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from overlapper import Overlap, Placed
from overlapper import overlap as common_part
from overlapper.quaternion import rotated
from overlapper.shapes.table import facts
from overlapper.viewer.framing import around
from overlapper.viewer.look import BODIES, BOTTOM, INK, MANY_FACETS, OVERLAPS, TOP, Array, hexadecimal, owner_color
from overlapper.viewer.primitives import Drawing, Faces, Lines

_Screen = Callable[[Array], Array]

WIDTH, HEIGHT = 480, 360  # pixels
SECONDS = 16  # a turn
STEPS = 24  # of a turn
ABOVE = np.deg2rad(25)  # the horizon
AROUND = 48  # corners of a silhouette
NEAR = 2.5  # times half the size of the overlap: how much is seen to each side
LEAST = 1e-150  # m, the least half height of a picture: coordinates are divided by it
EDGES = 200  # of a body: more edges would hide it, and are not drawn
COARSE = 0.05  # the tolerance of round overlaps, as every facet is written STEPS times
GROUND = 0.9  # times half the height: the size of the scene, which sets how far planes are drawn


def turning(overlap: Overlap) -> str:
    """The bodies of an overlap and what they share, turning about the vertical through its middle."""
    center, reach = _framed(overlap)
    drawing = Drawing(center, GROUND * reach, lambda placed: not facts(placed.shape).bounded, BODIES, OVERLAPS)
    views = _views()

    def screen(points: Array) -> Array:
        """Points (n, 3) of the world on the screen at each step, (STEPS + 1, n, 2), in half pixels."""
        flat = np.einsum("sij,nj->sni", views[:, :2], np.atleast_2d(points) - center) / reach
        screens: Array = np.clip(np.array([WIDTH, HEIGHT]) + flat * [HEIGHT, -HEIGHT], -9999, 9999)
        return screens

    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" '
        f'viewBox="0 0 {2 * WIDTH} {2 * HEIGHT}"><defs><linearGradient id="g" x2="0" y2="1">'
        f'<stop stop-color="{hexadecimal(TOP)}"/><stop offset="1" stop-color="{hexadecimal(BOTTOM)}"/>'
        "</linearGradient></defs>"
        f'<rect width="100%" height="100%" rx="12" fill="url(#g)"/>'
    ]
    for number, placed in enumerate(overlap.shapes):
        parts += _body(drawing, placed, owner_color(number), screen)
    if overlap:
        coarse = common_part(*overlap.shapes, tolerance=COARSE) if len(overlap.owner) > MANY_FACETS else overlap
        parts += _common(drawing, coarse or overlap, views[:, 2], screen)
    elif overlap.witness_a is not None:
        ends = screen(np.array([overlap.witness_a, overlap.witness_b]))
        parts.append(_path(ends, f'stroke="{hexadecimal(INK)}" stroke-width="4"'))
    return "".join([*parts, "</svg>"])


def _framed(overlap: Overlap) -> tuple[Array, float]:
    """The middle of the picture, and its half height, m."""
    bodies = [np.asarray(each.bounds) for each in overlap.shapes if facts(each.shape).bounded]
    lower, upper = around([np.asarray(overlap.bounds)] if overlap else bodies)
    reach = float(np.linalg.norm(upper - lower)) / 2
    largest = max((float(np.linalg.norm(box[1] - box[0])) / 2 for box in bodies), default=reach)
    return (lower + upper) / 2, max(min(NEAR * reach, largest) if overlap else 1.1 * reach, LEAST)


def _views() -> Array:
    """Right, up and the direction to the camera at each step, (STEPS + 1, 3, 3); the last step is the first."""
    turn = np.linspace(0, 2 * np.pi, STEPS + 1) - np.deg2rad(49)
    right = np.stack([-np.sin(turn), np.cos(turn), 0 * turn], axis=1)
    level = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    back = np.cos(ABOVE) * level + [0, 0, np.sin(ABOVE)]
    return np.stack([right, np.cross(back, right), back], axis=1)


def _body(drawing: Drawing, placed: Placed, color: Array, screen: _Screen) -> Iterator[str]:
    """The silhouette of a body, and its edges."""
    paint = f'stroke="{hexadecimal(color)}" stroke-width="2"'
    for each in drawing.body(placed, color.tolist()):
        points = rotated(placed.orientation, each.points) + placed.position
        if each.name == "faces":
            fill = f'fill="{hexadecimal(color)}" fill-opacity=".16"'
            corners = _moving("points", map(_points, _outermost(screen(points))))
            yield f"<polygon {fill} {paint} stroke-opacity='.7'>{corners}</polygon>"
        elif each.name == "edges" and 0 < len(points) <= EDGES:
            yield _path(screen(points.reshape(-1, 3)), f"{paint} stroke-opacity='.3'")


def _outermost(screens: Array) -> Array:
    """The farthest points (s, AROUND, 2) in AROUND directions among the points (s, n, 2) of each screen."""
    angles = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
    farthest = (screens @ np.array([np.cos(angles), np.sin(angles)])).argmax(axis=1)
    return np.take_along_axis(screens, farthest[:, :, None], axis=1)


def _common(drawing: Drawing, overlap: Overlap, backs: Array, screen: _Screen) -> Iterator[str]:
    """The facets, each while it is turned to the camera, and the patch outline."""
    for each in drawing.overlap(overlap):
        points = each.points + np.asarray(overlap.centroid)
        if isinstance(each, Faces) and not each.through:
            yield from _facets(each, points, backs, screen)
        elif isinstance(each, Lines) and each.name == "patch":
            yield _path(screen(points.reshape(-1, 3)), f'stroke="{hexadecimal(INK)}" stroke-width="3"')


def _facets(faces: Faces, points: Array, backs: Array, screen: _Screen) -> Iterator[str]:
    for ring in faces.facets:
        corners = points[ring]
        normal = np.cross(corners - corners[0], np.roll(corners, -1, axis=0) - corners[0]).sum(axis=0)
        normal /= np.linalg.norm(normal) or 1.0
        color = hexadecimal(np.minimum(faces.shade(normal) * faces.color, 1.0))
        sides = ["visible" if back @ normal > 0 else "hidden" for back in backs]
        moving = _moving("points", map(_points, screen(corners)))
        shown = _moving("visibility", sides, ' calcMode="discrete"')
        yield f'<polygon fill="{color}" stroke="{color}" stroke-width="1">{moving}{shown}</polygon>'


def _path(screens: Array, paint: str) -> str:
    """Segments by the ends (s, 2 n, 2) on each screen."""
    paths = ("".join(f"M{_points(line)}" for line in lines.reshape(-1, 2, 2)) for lines in screens)
    return f'<path fill="none" {paint}>{_moving("d", paths)}</path>'


def _moving(name: str, values: Iterable[str], how: str = "") -> str:
    return (
        f'<animate attributeName="{name}" dur="{SECONDS}s" repeatCount="indefinite" values="{";".join(values)}"{how}/>'
    )


def _points(points: Array) -> str:
    return " ".join(f"{x:.0f},{y:.0f}" for x, y in points)
