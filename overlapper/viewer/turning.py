"""A picture that turns, as SVG: bodies as they stand out against what is behind, and every facet of what they share.

It is seen from afar, so that lines stay lines, and of what is convex no facet that is seen hides another one. What
moves are the corners of polygons, from one of so many STEPS to the next, in any browser and without a script.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from overlapper import Overlap, Placed
from overlapper import overlap as common_part
from overlapper.quaternion import rotated
from overlapper.shapes.table import facts
from overlapper.viewer.framing import around
from overlapper.viewer.look import BOTTOM, INK, LIGHT, MANY_FACETS, OWNER_COLORS, TOP, Array
from overlapper.viewer.tessellation import rotation_from_z, tessellation

_Seen = Callable[[Array], Array]

WIDTH, HEIGHT = 480, 360  # pixels
SECONDS = 16  # a turn
STEPS = 24  # of a turn
ABOVE = np.deg2rad(25)  # the horizon: where the camera is
AROUND = 48  # corners of an outline
NEAR = 2.5  # times half the size of what is shared: how much is seen to each side
COARSE = 0.05  # the tolerance by which what is round is drawn
LEAST = 1e-150  # m, half the height of a picture: less cannot be divided by
EDGES = 200  # of a body: more are a net that hides it


def turning(overlap: Overlap) -> str:
    """The bodies of an overlap and what they share, turning about the vertical through its middle."""
    placed = list(overlap.shapes)
    center, reach = _framed(overlap, placed)
    views = _views()

    def seen(points: Array) -> Array:
        """(STEPS + 1, n, 2): where points of the world (n, 3) are on the screen at each step, in half pixels."""
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
    for number, each in enumerate(placed):
        parts += _body(each, OWNER_COLORS[number % len(OWNER_COLORS)], center, reach, seen)
    if overlap:
        parts += _common(_coarse(overlap), views[:, 2], seen)
    elif overlap.witness_a is not None:
        path = _moving("points", map(_points, seen(np.array([overlap.witness_a, overlap.witness_b]))))
        parts.append(f'<polyline fill="none" stroke="{hexadecimal(INK)}" stroke-width="4">{path}</polyline>')
    return "".join([*parts, "</svg>"])


def _framed(overlap: Overlap, placed: Sequence[Placed]) -> tuple[Array, float]:
    """The middle of the picture, and how far above and below it is seen, m."""
    bodies = [np.asarray(each.bounds) for each in placed if facts(each.shape).bounded]
    lower, upper = around([np.asarray(overlap.bounds)] if overlap else bodies)
    reach = float(np.linalg.norm(upper - lower)) / 2
    largest = max((float(np.linalg.norm(box[1] - box[0])) / 2 for box in bodies), default=reach)
    return (lower + upper) / 2, max(min(NEAR * reach, largest) if overlap else 1.1 * reach, LEAST)


def _views() -> Array:
    """(STEPS + 1, 3, 3): right, up and the way to the camera at each step; the last is the first."""
    turn = np.linspace(0, 2 * np.pi, STEPS + 1) - np.deg2rad(49)
    right = np.stack([-np.sin(turn), np.cos(turn), 0 * turn], axis=1)
    level = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    back = np.cos(ABOVE) * level + [0, 0, np.sin(ABOVE)]
    return np.stack([right, np.cross(back, right), back], axis=1)


def _body(placed: Placed, color: Sequence[float], center: Array, reach: float, seen: _Seen) -> Iterator[str]:
    """What is seen of a body: how it stands out, and its edges."""
    if not facts(placed.shape).bounded:
        edges = np.empty((0, 3))
        rings = seen(_disc(placed, center, 2 * reach))
    else:
        drawn = tessellation(placed.shape)
        rings = _outermost(seen(rotated(placed.orientation, drawn.vertices) + placed.position))
        edges = rotated(placed.orientation, drawn.edges.reshape(-1, 3)) + placed.position
    paint = f'stroke="{hexadecimal(color)}" stroke-width="2"'
    faint = f'fill="{hexadecimal(color)}" fill-opacity=".16"'
    yield f"<polygon {faint} {paint} stroke-opacity='.7'>{_moving('points', map(_points, rings))}</polygon>"
    if 0 < len(edges) <= 2 * EDGES:
        ends = seen(edges)
        paths = ("".join(f"M{_points(line)}" for line in lines.reshape(-1, 2, 2)) for lines in ends)
        yield f'<path fill="none" {paint} stroke-opacity=".3">{_moving("d", paths)}</path>'


def _disc(placed: Placed, center: Array, radius: float) -> Array:
    """(AROUND, 3) points of a half-space's boundary plane, about the one that is nearest to `center`."""
    side = facts(placed.shape).side(center)
    assert side is not None
    normal, offset, _ = side
    normal = rotated(placed.orientation, normal)
    foot = center - (normal @ (center - placed.position) - offset) * normal
    angles = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
    across, along = rotation_from_z(normal).T[:2]
    points: Array = foot + radius * (np.cos(angles)[:, None] * across + np.sin(angles)[:, None] * along)
    return points


def _outermost(screens: Array) -> Array:
    """(s, AROUND, 2): of the points (s, n, 2) of each screen those that lie farthest in so many directions."""
    angles = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
    farthest = (screens @ np.array([np.cos(angles), np.sin(angles)])).argmax(axis=1)
    return np.take_along_axis(screens, farthest[:, :, None], axis=1)


def _coarse(overlap: Overlap) -> Overlap:
    """With no more facets than a page should hold, times so many steps."""
    if len(overlap.owner) <= MANY_FACETS:
        return overlap
    return common_part(*overlap.shapes, tolerance=COARSE) or overlap


def _common(overlap: Overlap, backs: Array, seen: _Seen) -> Iterator[str]:
    """The facets of what is shared, in the colours of those they lie on, each as long as it is turned to the camera."""
    for ring, owner, plane in zip(overlap.facets, overlap.owner, overlap.halfspaces, strict=True):
        normal = np.asarray(plane[:3])
        light = 0.4 + 0.7 * (0.45 + 0.55 * max(0.0, float(normal @ LIGHT)))
        color = hexadecimal(np.minimum(light * np.array(OWNER_COLORS[owner % len(OWNER_COLORS)]), 1.0))
        faces = ["visible" if back @ normal > 0 else "hidden" for back in backs]
        moving = _moving("points", map(_points, seen(overlap.vertices[ring])))
        shown = _moving("visibility", faces, ' calcMode="discrete"')
        yield f'<polygon fill="{color}" stroke="{color}" stroke-width="1">{moving}{shown}</polygon>'
    for outline_of_patch in overlap.patch:
        path = _moving("points", map(_points, seen(outline_of_patch)))
        yield f'<polygon fill="none" stroke="{hexadecimal(INK)}" stroke-width="3">{path}</polygon>'


def _moving(name: str, values: Iterator[str] | Sequence[str], how: str = "") -> str:
    return (
        f'<animate attributeName="{name}" dur="{SECONDS}s" repeatCount="indefinite" values="{";".join(values)}"{how}/>'
    )


def _points(points: Array) -> str:
    return " ".join(f"{x:.0f},{y:.0f}" for x, y in points)


def hexadecimal(color: Sequence[float] | Array) -> str:
    """#rrggbb of red, green and blue in 0..1."""
    return "#" + "".join(f"{round(255 * each):02x}" for each in color)
