"""A picture of bodies and their overlaps as a PNG, drawn without a browser or a display.

The camera, the light and the colours are those of a recording. Bodies are painted first, from far to near, each as a
whole, as the faces that a convex body turns to the camera never hide each other; then overlaps in the same way; then
what shines through everything. Pillow paints the faces, matplotlib draws lines and letters.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from overlapper import Overlap, Placed
from overlapper.install import hint
from overlapper.quaternion import rotated
from overlapper.shapes.drawing import polytope_edges
from overlapper.viewer.framing import Framing, View
from overlapper.viewer.labels import Bodies, Contact, Pair, labelled
from overlapper.viewer.look import (
    BODIES,
    BOTTOM,
    FIELD_OF_VIEW,
    GRID,
    GRID_OPACITY,
    GROUND,
    GROUND_OPACITY,
    INK,
    LIGHT,
    LINE,
    OVERLAPS,
    OWNER_COLORS,
    TOP,
    Array,
    Look,
    arrow_length,
    channels,
    to_draw,
    volume_text,
)
from overlapper.viewer.pressure import (
    FORCE,
    FRICTION,
    Arrow,
    DrawnForces,
    Forces,
    Press,
    Scale,
    colors,
    force_text,
    key_of,
    pressures,
)
from overlapper.viewer.tessellation import Ground, ground, tessellation
from overlapper.whole_file import beside

try:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure
    from matplotlib.offsetbox import AnchoredOffsetbox, DrawingArea, HPacker, TextArea, VPacker
    from matplotlib.patches import Polygon, Rectangle
    from PIL import Image, ImageDraw
except ImportError as missing:
    raise ImportError(f"overlapper.viewer.picture needs {hint('matplotlib')}") from missing

WIDTH, HEIGHT = 1200, 900  # pixels
FINER = 2  # times: so much larger are faces painted, to be smooth when made smaller
ROWS = 8  # of the table: the largest
BEHIND, BEFORE = 2, 4  # overlaps: where lines are drawn
NEAR = 4.0  # times its size: from how far an overlap is looked at

_Row = tuple[Pair, Overlap, "Press | None"]


def save(
    path: str | Path,
    bodies: Bodies,
    contacts: Iterable[Contact],
    title: str = "",
    close: bool = False,
    looks: tuple[Look, Look] = (BODIES, OVERLAPS),
    framing: Framing | None = None,
    forces: Forces | None = None,
) -> Path:
    """Draw the bodies where they are, the overlapping pairs among `contacts` and their `forces`; returns the path.

    With `close`, the camera comes near the largest of them. `looks` are those of the bodies and of the overlaps.
    A `framing` that has seen other moments, too, knows what moves; without one, the bodies that overlap are framed.
    """
    contacts = list(contacts)
    here = Framing(bodies)
    here.see(bodies, contacts)
    shared = sorted(labelled(bodies, contacts), key=lambda item: -item[2].overlap.volume)
    near = np.asarray(shared[0][2].overlap.bounds) if close and shared else None
    picture = _Picture(framing or here, here.side(), near)
    seen = None
    if forces is not None and looks[1].forces:
        seen = DrawnForces.of(bodies, contacts, forces, picture.height / 4, framing or here)
    for key, placed in zip(bodies.keys, bodies.placed, strict=True):
        picture.add_body(placed, np.array(bodies.colors[key[:2]][:3]), looks[0])
    table = []
    for pair, _, contact in shared:
        press = seen.pressed.get(key_of(contact)) if seen else None
        picture.add_overlap(to_draw(contact.overlap, picture.size), looks[1], press, seen.scale if seen else None)
        table.append((pair, contact.overlap, press))
    if seen:
        for arrow in seen.arrows:
            picture.add_force(arrow, seen.scale)
    picture.save(Path(path), title, table, seen.scale if seen else None)
    return Path(path)


@dataclass
class _Side:
    """What is seen of a convex body from outside, or from inside: polygons on the screen, and their colours.

    The opacity is that of all, or there is one of each polygon.
    """

    depth: float
    opacity: float | Sequence[float]
    polygons: list[Array]
    colors: list[Array]

    def paint(self, canvas: Image.Image) -> None:
        opacities = np.broadcast_to(self.opacity, len(self.polygons))
        if not opacities.any():
            return
        scale = FINER * HEIGHT / 2
        middle = np.array(canvas.size) / 2
        polygons = [np.clip(middle + points * [scale, -scale], -1e7, 1e7) for points in self.polygons]
        corners = np.concatenate(polygons)
        left, top = np.clip(np.floor(corners.min(axis=0)), 0, canvas.size).astype(int)
        right, bottom = np.clip(np.ceil(corners.max(axis=0)) + 1, 0, canvas.size).astype(int)
        if left >= right or top >= bottom:
            return
        paint = Image.new("RGB", (right - left, bottom - top))
        mask = Image.new("L", paint.size)
        for points, color, opacity in zip(polygons, self.colors, opacities, strict=True):
            outline = list(map(tuple, points - [left, top]))
            ImageDraw.Draw(paint).polygon(outline, fill=tuple((255 * color).round().astype(int)))
            ImageDraw.Draw(mask).polygon(outline, fill=round(255 * float(opacity)))
        paint.putalpha(mask)
        canvas.alpha_composite(paint, (int(left), int(top)))


class _Picture:
    def __init__(self, framing: Framing, back: Array, near: Array | None) -> None:
        view = View.of([near] if near is not None else framing.opening().framed, back)
        self.center, self.size, self._is_ground = framing.center, framing.size, framing.is_ground
        self.target, self.back, self.distance = view.at, view.back, view.distance(WIDTH / HEIGHT)
        if near is not None:
            self.distance = NEAR * float(np.linalg.norm(near[1] - near[0]))
        right = np.array([-self.back[1], self.back[0], 0.0]) / np.hypot(self.back[0], self.back[1])
        self.axes = np.array([right, np.cross(self.back, right), self.back])
        self.bodies: list[_Side] = []
        self.overlaps: list[_Side] = []
        self.lines: list[tuple[Array, Array, int]] = []  # (k, 2, 2) segments, (k, 4) colours, BEHIND or BEFORE
        self.heads: list[Array] = []
        self.dots: list[tuple[Array, Array, float]] = []
        self.pushes: list[tuple[Array, Any]] = []  # polygons, and their colours
        self.height = 2 * self.distance * float(np.tan(np.deg2rad(FIELD_OF_VIEW) / 2))  # m, seen where it looks at

    def seen(self, points: Array) -> tuple[Array, Array]:
        """Where world points (n, 3) are on the screen, (n, 2), in half heights from its middle, and how far off, m."""
        view = (points - self.target) @ self.axes.T
        depth = np.maximum(self.distance - view[:, 2], 1e-3 * self.distance)
        return view[:, :2] / (depth * np.tan(np.deg2rad(FIELD_OF_VIEW) / 2))[:, None], depth

    def _before_camera(self, ring: Array) -> Array:
        """What of a polygon (n, 3) is before the camera: (m, 3), of which there may be none."""
        ahead = 0.99 * self.distance - (ring - self.target) @ self.back
        if (ahead >= 0).all():
            return ring
        kept = []
        for here, there, a, b in zip(ring, np.roll(ring, -1, axis=0), ahead, np.roll(ahead, -1), strict=True):
            if a >= 0:
                kept.append(here)
            if (a >= 0) != (b >= 0):
                kept.append(here + a / (a - b) * (there - here))
        return np.array(kept).reshape(-1, 3)

    def add_body(self, placed: Placed, color: Array, look: Look) -> None:
        if self._is_ground(placed) and (drawn := self._ground(placed)):
            self._add_ground(placed, drawn, look)
            return
        outlined = tessellation(placed.shape)
        vertices = _in_world(placed, outlined.vertices)
        if look.faces:
            front = channels(look.front) if look.front else color
            back = channels(look.back) if look.back else None
            rings = list(outlined.faces)
            self._add_sides([vertices[ring] for ring in rings], [front] * len(rings), back, look.opacity, self.bodies)
        segments = outlined.edges if look.faces else outlined.wires
        if look.edges:
            shade = np.append(color, 0.35 if look.faces else 0.8)
            self._add_lines(_in_world(placed, segments), shade, BEHIND)
        if look.vertices:
            self.dots.append((self.seen(vertices)[0], color, 4.0))

    def _ground(self, placed: Placed) -> Ground | None:
        back = np.append(-placed.orientation[:3], placed.orientation[3])
        return ground(placed.shape, rotated(back, self.center - placed.position), self.size)

    def _add_ground(self, placed: Placed, drawn: Ground, look: Look) -> None:
        """The plane, which fades out from its middle, behind all that stands on it."""
        if look.faces:
            triangles = drawn.vertices[drawn.faces]
            strength = GROUND_OPACITY * drawn.strength(triangles.mean(axis=1))
            cells = [self._before_camera(_in_world(placed, each)) for each in triangles]
            seen = [(cell, each) for cell, each in zip(cells, strength, strict=True) if len(cell)]
            polygons = [self.seen(cell)[0] for cell, _ in seen]
            opacities = [float(each) for _, each in seen]
            self.bodies.append(_Side(np.inf, opacities, polygons, [np.array(GROUND)] * len(polygons)))
        if look.edges:
            strength = GRID_OPACITY * drawn.strength(drawn.edges.mean(axis=1))
            colors = np.column_stack([np.tile(GRID, (len(strength), 1)), strength])
            self._add_lines(_in_world(placed, drawn.edges), colors, BEHIND)

    def add_overlap(self, overlap: Overlap, look: Look, press: Press | None = None, scale: Scale | None = None) -> None:
        vertices, centroid = overlap.vertices, np.asarray(overlap.centroid)
        if look.faces and press and scale:
            corners, found = pressures(overlap, press, scale.top)
            shades = list(colors(found.mean(axis=1), scale.top))
            self._add_sides(list(corners), shades, None, look.opacity, self.overlaps, lit=False)
        elif look.faces:
            own = [np.array(OWNER_COLORS[owner % len(OWNER_COLORS)]) for owner in overlap.owner]
            fronts = [channels(look.front)] * len(own) if look.front else own
            back = channels(look.back) if look.back else np.array([0.3, 0.3, 0.3])
            self._add_sides([vertices[ring] for ring in overlap.facets], fronts, back, look.opacity, self.overlaps)
        if look.edges:
            self._add_lines(vertices[polytope_edges(overlap.facets)], np.append(LINE, 1.0), BEFORE)
        if look.vertices:
            self.dots.append((self.seen(vertices)[0], np.array(LINE), 5.0))
        if look.marks:
            self._add_marks(overlap, centroid, arrow=press is None)
        if np.ptp(vertices, axis=0).max() < 0.015 * self.size:
            self.dots.append((self.seen(centroid[None])[0], np.array(INK), 6.0))

    def add_force(self, arrow: Arrow, scale: Scale) -> None:
        """The force of a pair of links, and what of it is friction."""
        for force, color, thick in ((arrow.force, FORCE, 0.007), (arrow.friction, FRICTION, 0.009)):
            (start, end), _ = self.seen(np.array([arrow.start, arrow.start + scale.arrow(force)]))
            along = end - start
            length = float(np.linalg.norm(along))
            if length < 0.008:
                continue
            along /= length
            aside, head = np.array([-along[1], along[0]]), min(0.06, 0.6 * length)
            wide = min(3.2 * thick, 0.4 * head)
            outline = [(0, thick), (length - head, thick), (length - head, wide), (length, 0)]
            outline += [(length - head, -wide), (length - head, -thick), (0, -thick)]
            self.pushes.append((np.array([start + far * along + off * aside for far, off in outline]), color))

    def _add_marks(self, overlap: Overlap, centroid: Array, arrow: bool) -> None:
        ink = np.append(INK, 1.0)
        for ring in overlap.patch:
            self._add_lines(np.stack([ring, np.roll(ring, -1, axis=0)], axis=1), ink, BEFORE)
        if overlap.normal is None or not arrow:
            return
        tip = centroid + arrow_length(overlap.area, self.size) * overlap.normal
        self._add_lines(np.array([[centroid, tip]]), ink, BEFORE)
        (start, end), _ = self.seen(np.array([centroid, tip]))
        along = end - start
        aside = 0.3 * np.array([-along[1], along[0]])
        self.heads.append(np.array([end, end - 0.2 * along + 0.25 * aside, end - 0.2 * along - 0.25 * aside]))

    def _add_sides(
        self,
        faces: Sequence[Array],
        fronts: Sequence[Array],
        back: Array | None,
        opacity: float,
        to: list[_Side],
        lit: bool = True,
    ) -> None:
        """Faces, counter-clockwise from outside, flat and matt; first those seen from inside, if they have a colour.

        Those that are not `lit` have their colour from all sides.
        """
        outside, inside = _Side(0.0, opacity, [], []), _Side(0.0, opacity, [], [])
        eye = self.target + self.distance * self.back
        for corners, front in zip(faces, fronts, strict=True):
            normal = np.cross(corners - corners[0], np.roll(corners, -1, axis=0) - corners[0]).sum(axis=0)
            normal /= np.linalg.norm(normal) or 1.0
            light = 0.4 + 0.7 * (0.45 + 0.55 * max(0.0, float(normal @ LIGHT))) if lit else 1.0
            if normal @ (eye - corners[0]) > 0:
                side, color = outside, front * light
            elif back is not None:
                side, color = inside, back
            else:
                continue
            before = self._before_camera(corners)
            if not len(before):
                continue
            side.polygons.append(self.seen(before)[0])
            side.colors.append(np.minimum(color, 1.0))
        # Of two bodies, the one whose middle is nearer is taken for the one in front.
        depth = float(self.seen(np.mean([face.mean(axis=0) for face in faces], axis=0)[None])[1][0])
        outside.depth, inside.depth = depth, depth + 1e-6 * self.size
        to += [outside, inside]

    def _add_lines(self, segments: Array, colors: Array, order: int) -> None:
        """Segments (k, 2, 3) in the world; a colour with its opacity, (4,), or one of each, (k, 4)."""
        ahead = 0.99 * self.distance - (segments - self.target) @ self.back  # (k, 2)
        seen = (ahead > 0).any(axis=1)
        ends, ahead = segments[seen], ahead[seen]
        cut = np.clip(ahead / np.where(ahead == ahead[:, ::-1], 1, ahead - ahead[:, ::-1]), None, 1)
        behind = ahead < 0
        ends = np.where(behind[..., None], ends + cut[..., None] * (ends[:, ::-1] - ends), ends)
        colors = np.broadcast_to(colors, (len(segments), 4))[seen]
        self.lines.append((self.seen(ends.reshape(-1, 3))[0].reshape(-1, 2, 2), colors, order))

    def save(self, path: Path, title: str, table: Sequence[_Row], scale: Scale | None) -> None:
        figure = Figure(figsize=(WIDTH / 100, HEIGHT / 100), dpi=100, facecolor=BOTTOM)
        axes = figure.add_axes((0, 0, 1, 1), xlim=(-WIDTH / HEIGHT, WIDTH / HEIGHT), ylim=(-1, 1))
        axes.set_axis_off()
        axes.set_autoscale_on(False)
        shades = np.linspace(TOP, BOTTOM, HEIGHT)[:, None].repeat(WIDTH, axis=1)
        for order, layer in ((0, shades), (1, _painted(self.bodies)), (3, _painted(self.overlaps))):
            axes.imshow(layer, extent=(-WIDTH / HEIGHT, WIDTH / HEIGHT, -1, 1), aspect="auto", zorder=order)
        for segments, color, order in self.lines:
            axes.add_collection(LineCollection(list(segments), colors=color, linewidths=1.0, zorder=order))
        axes.add_collection(PolyCollection(self.heads, facecolors=[INK], zorder=BEFORE))
        for points, color, size in self.dots:
            axes.plot(*points.T, ".", color=tuple(color), markersize=size, zorder=BEFORE + 1)
        for polygon, color in self.pushes:
            patch = Polygon(polygon, facecolor=color, edgecolor=BOTTOM, linewidth=0.8, zorder=BEFORE + 2)
            axes.add_patch(patch)
        axes.add_artist(_table(title, table))
        if scale:
            axes.add_artist(_legend(scale))
        with beside(path) as file:
            FigureCanvasAgg(figure).print_png(str(file))  # type: ignore[no-untyped-call]


def _in_world(placed: Placed, points: Array) -> Array:
    return rotated(placed.orientation, points) + placed.position


def _painted(sides: Sequence[_Side]) -> Any:
    """(HEIGHT, WIDTH, 4), from far to near."""
    canvas = Image.new("RGBA", (FINER * WIDTH, FINER * HEIGHT))
    for side in sorted(sides, key=lambda side: -side.depth):
        side.paint(canvas)
    return np.asarray(canvas.resize((WIDTH, HEIGHT), Image.Resampling.BOX))


def _text(words: str, color: Any = LINE) -> TextArea:
    return TextArea(words, textprops={"color": color, "fontsize": 11, "family": "DejaVu Sans", "parse_math": False})


def _boxed(content: Any, corner: str) -> AnchoredOffsetbox:
    box = AnchoredOffsetbox(corner, child=content, pad=0.3, borderpad=0.7)
    box.patch.set(facecolor="#16181d", edgecolor="none", alpha=0.8, boxstyle="round,pad=0.2")
    box.set_zorder(20)
    return box


def _legend(scale: Scale) -> AnchoredOffsetbox:
    """What colours and arrows stand for."""
    ramp = DrawingArea(140, 10)
    steps = 140
    for k, color in enumerate(colors(np.arange(steps) / (steps - 1), 1.0)):
        ramp.add_artist(Rectangle((140 * k / steps, 0), 140 / steps + 0.5, 10, facecolor=color, linewidth=0))
    lines: list[Any] = [HPacker(children=[_text("0"), ramp, _text(scale.pressure)], pad=0, sep=8, align="center")]
    for words, color in ((f"force, {scale}", FORCE), ("of it friction", FRICTION)):
        arrow = DrawingArea(26, 10)
        arrow.add_artist(Polygon([(0, 3.5), (15, 3.5), (15, 0), (26, 5), (15, 10), (15, 6.5), (0, 6.5)], color=color))
        lines.append(HPacker(children=[arrow, _text(words)], pad=0, sep=8, align="center"))
    return _boxed(VPacker(children=lines, pad=4, sep=6), "lower right")


def _table(title: str, table: Sequence[_Row]) -> AnchoredOffsetbox:
    """The title, and the pairs with volume, depth and force, the largest first."""
    names: list[Any] = []
    volumes: list[Any] = []
    depths: list[Any] = []
    pushes: list[Any] = []
    for (first, second), overlap, press in table[:ROWS]:
        parts: list[Any] = [_text(first, OWNER_COLORS[0]), _text("–", "#9aa3b0"), _text(second, OWNER_COLORS[1])]
        names.append(HPacker(children=parts, pad=0, sep=4))
        volumes.append(_text(volume_text(overlap.volume)))
        depths.append(_text(f"{1e3 * (overlap.depth or 0.0):.3g} mm deep"))
        if press:
            pushes.append(_text(force_text(float(np.linalg.norm(press.force)))))
    columns: list[Any] = [
        VPacker(children=names, pad=0, sep=5),
        VPacker(children=volumes, pad=0, sep=5, align="right"),
        VPacker(children=depths, pad=0, sep=5, align="right"),
    ]
    if len(pushes) == len(names):
        columns.append(VPacker(children=pushes, pad=0, sep=5, align="right"))
    lines: list[Any] = [_text(title)] if title else []
    lines += [HPacker(children=columns, pad=0, sep=18)] if names else [_text("nothing overlaps", "#9aa3b0")]
    if len(table) > ROWS:
        lines.append(_text(f"and {len(table) - ROWS:,} more", "#9aa3b0"))
    return _boxed(VPacker(children=lines, pad=4, sep=7), "upper left")
