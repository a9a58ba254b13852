"""A picture of bodies and their overlaps as a PNG, drawn without a browser or a display.

The camera, the light and the colours are those of a recording. At every pixel the nearest face is in front. Bodies are
painted first, then overlaps, then arrows. matplotlib draws lines and letters.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from overlapper import Overlap
from overlapper.install import hint
from overlapper.quaternion import rotated
from overlapper.shapes.drawing import triangles
from overlapper.viewer.framing import Framing, View
from overlapper.viewer.labels import DrawnBodies, DrawnContact, Pair, key_of, labelled
from overlapper.viewer.look import (
    BODIES,
    BOTTOM,
    FIELD_OF_VIEW,
    LINE,
    OVERLAPS,
    OWNER_COLORS,
    TOP,
    Array,
    Look,
    to_draw,
    volume_text,
)
from overlapper.viewer.pressure import FORCE, FRICTION, DrawnForces, Forces, Press, Scale, colors, force_text
from overlapper.viewer.primitives import BACK, BOTH, Dots, Drawing, Faces, Primitive
from overlapper.viewer.raster import painted
from overlapper.whole_file import beside

try:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure
    from matplotlib.offsetbox import AnchoredOffsetbox, DrawingArea, HPacker, TextArea, VPacker
    from matplotlib.patches import Polygon, Rectangle
except ImportError as missing:
    raise ImportError(f"overlapper.viewer.picture needs {hint('matplotlib')}") from missing

WIDTH, HEIGHT = 1200, 900  # pixels
ROWS = 8  # of the table, for the largest overlaps
NEAR = 4.0  # times the size of an overlap: the distance of a camera that is close
SLOPE = float(np.tan(np.deg2rad(FIELD_OF_VIEW) / 2))
UNTURNED = np.array([0.0, 0.0, 0.0, 1.0])
SOLID, SHARED, SHINING = range(3)  # layers: a later one hides an earlier one

_Row = tuple[Pair, Overlap, "Press | None"]


def save(
    path: str | Path,
    bodies: DrawnBodies,
    contacts: Iterable[DrawnContact],
    title: str = "",
    close: bool = False,
    looks: tuple[Look, Look] = (BODIES, OVERLAPS),
    framing: Framing | None = None,
    forces: Forces | None = None,
) -> Path:
    """Draw the bodies where they are, the overlapping pairs among `contacts` and their `forces`. Returns the path.

    With `close`, the camera is near the largest overlap. `looks` are those of the bodies and of the overlaps. A
    `framing` that has seen other moments knows the moving bodies. Without a framing, the overlapping bodies are framed.
    """
    contacts = list(contacts)
    here = Framing(bodies)
    here.see(bodies, contacts)
    framing = framing or here
    shared = sorted(labelled(bodies, contacts), key=lambda item: -item[2].overlap.volume)
    near = np.asarray(shared[0][2].overlap.bounds) if close and shared else None
    picture = _Picture(_Camera.of(framing, here.side(), near))
    drawing = Drawing(framing.center, framing.size, framing.is_ground, *looks)
    height = 2 * picture.camera.distance * SLOPE  # m, seen where the camera looks at
    drawn = DrawnForces.of(bodies, contacts, forces if looks[1].forces else None, height / 4, framing)
    for key, placed in zip(bodies.keys, bodies.placed, strict=True):
        picture.add(drawing.body(placed, bodies.colors[key[:2]]), SOLID, placed.position, placed.orientation)
    table = []
    for pair, _, contact in shared:
        press = drawn.pressed.get(key_of(contact))
        coarse = to_draw(contact.overlap, framing.size)
        picture.add(drawing.overlap(coarse, press, drawn.scale), SHARED, np.asarray(coarse.centroid))
        table.append((pair, contact.overlap, press))
    for arrow in drawn.arrows:
        picture.add(drawing.force(arrow, drawn.scale, 2 * height), SHINING, arrow.start)
    picture.save(Path(path), title, table, drawn.scale if drawn.pressed else None)
    return Path(path)


@dataclass(frozen=True)
class _Camera:
    """A camera looks at the point `at` from a `distance`, in m. The rows of `axes` (3, 3) point right, up and back."""

    at: Array
    axes: Array
    distance: float

    @classmethod
    def of(cls, framing: Framing, back: Array, near: Array | None) -> _Camera:
        """A camera that sees what the framing has, or the box `near` (2, 3)."""
        view = View.of([near] if near is not None else framing.moving().framed, back)
        right = np.array([-back[1], back[0], 0.0]) / np.hypot(back[0], back[1])
        distance = view.distance(WIDTH / HEIGHT) if near is None else NEAR * float(np.linalg.norm(near[1] - near[0]))
        return cls(view.at, np.array([right, np.cross(back, right), back]), distance)

    def seen(self, points: Array) -> Array:
        """Points (..., 3) of the world in the camera's frame: the camera is the origin and looks along -z."""
        seen: Array = (points - self.at) @ self.axes.T - [0, 0, self.distance]
        return seen

    def on_screen(self, seen: Array) -> Array:
        """Points (..., 3) in the camera's frame on the screen, (..., 2), in half heights from its middle."""
        screen: Array = seen[..., :2] / (SLOPE * np.maximum(-seen[..., 2:], 1e-3 * self.distance))
        return screen


class _Picture:
    def __init__(self, camera: _Camera) -> None:
        self.camera = camera
        self._faces: list[list[tuple[Array, Array]]] = [[], [], []]  # triangles and colours, by layer
        self._lines: list[tuple[Array, Array, int]] = []  # segments on the screen, colours, layer
        self._dots: list[tuple[Array, Dots, int]] = []

    def add(self, primitives: Sequence[Primitive], layer: int, position: Array, turn: Array = UNTURNED) -> None:
        """Add primitives in a frame with that position and orientation in the world."""
        for each in primitives:
            if not each.visible:
                continue
            points = rotated(turn, each.points) + position
            on = SHINING if each.through else layer
            if isinstance(each, Faces):
                self._faces[on].append(self._seen_faces(each, points))
            elif isinstance(each, Dots):
                self._dots.append((self.camera.on_screen(self.camera.seen(points)), each, on))
            else:
                self._add_lines(each, self.camera.seen(points), on)

    def _seen_faces(self, faces: Faces, points: Array) -> tuple[Array, Array]:
        """The triangles (k, 3, 3) that face the camera, in the camera's frame, and their colours (k, 4)."""
        facets = triangles(faces.facets)
        corners = points[facets]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
        eye = self.camera.at + self.camera.distance * self.camera.axes[2]
        turned = ((eye - corners[:, 0]) * normals).sum(axis=1) <= 0
        normals[turned] *= -1
        color = faces.color if faces.color.ndim == 1 else faces.color[facets].mean(axis=1)
        opacity = faces.opacity * (1.0 if faces.strength is None else faces.strength[facets].mean(axis=1))
        shaded = np.minimum(faces.shade(normals)[:, None] * color, 1)
        kept = np.full(len(facets), True) if faces.side == BOTH else turned == (faces.side == BACK)
        rgba = np.column_stack([shaded, np.broadcast_to(opacity, len(shaded))])
        return self.camera.seen(corners[kept]), rgba[kept]

    def _add_lines(self, lines: Primitive, ends: Array, layer: int) -> None:
        """Segments (k, 2, 3) in the camera's frame are cut off near the camera and behind it."""
        opacity = lines.opacity * (np.ones(len(ends)) if lines.strength is None else lines.strength.mean(axis=1))
        ahead = -ends[..., 2] - 0.01 * self.camera.distance  # (k, 2)
        seen = (ahead > 0).any(axis=1)
        ends, ahead = ends[seen], ahead[seen]
        part = np.clip(ahead / np.where(ahead == ahead[:, ::-1], 1, ahead - ahead[:, ::-1]), None, 1)
        ends = np.where((ahead < 0)[..., None], ends + part[..., None] * (ends[:, ::-1] - ends), ends)
        colors = np.column_stack([np.tile(lines.color, (len(ends), 1)), opacity[seen]])
        self._lines.append((self.camera.on_screen(ends), colors, layer))

    def save(self, path: Path, title: str, table: Sequence[_Row], scale: Scale | None) -> None:
        figure = Figure(figsize=(WIDTH / 100, HEIGHT / 100), dpi=100, facecolor=BOTTOM)
        aspect = WIDTH / HEIGHT
        axes = figure.add_axes((0, 0, 1, 1), xlim=(-aspect, aspect), ylim=(-1, 1))
        axes.set_axis_off()
        axes.set_autoscale_on(False)
        shades = np.linspace(TOP, BOTTOM, HEIGHT)[:, None].repeat(WIDTH, axis=1)
        axes.imshow(shades, extent=(-aspect, aspect, -1, 1), aspect="auto", zorder=0)
        for layer, faces in enumerate(self._faces):
            if faces:
                corners, paint = (np.concatenate(each) for each in zip(*faces, strict=True))
                image = painted(corners, paint, SLOPE, WIDTH, HEIGHT)
                axes.imshow(image, extent=(-aspect, aspect, -1, 1), aspect="auto", zorder=layer + 1)
        for segments, color, layer in self._lines:
            axes.add_collection(LineCollection(list(segments), colors=color, linewidths=1.0, zorder=layer + 1.3))
        for points, dots, layer in self._dots:
            axes.plot(*points.T, ".", color=tuple(dots.color), markersize=dots.size + 1, zorder=layer + 1.6)
        axes.add_artist(_table(title, table))
        if scale:
            axes.add_artist(_legend(scale))
        with beside(path) as file:
            FigureCanvasAgg(figure).print_png(str(file))  # type: ignore[no-untyped-call]


def _text(words: str, color: Any = LINE) -> TextArea:
    return TextArea(words, textprops={"color": color, "fontsize": 11, "family": "DejaVu Sans", "parse_math": False})


def _boxed(content: Any, corner: str) -> AnchoredOffsetbox:
    box = AnchoredOffsetbox(corner, child=content, pad=0.3, borderpad=0.7)
    box.patch.set(facecolor="#16181d", edgecolor="none", alpha=0.8, boxstyle="round,pad=0.2")
    box.set_zorder(20)
    return box


def _legend(scale: Scale) -> AnchoredOffsetbox:
    """The scale of colours and arrows."""
    ramp = DrawingArea(140, 10)
    steps = 140
    for k, color in enumerate(colors(np.arange(steps) / (steps - 1), 1.0)):
        ramp.add_artist(Rectangle((140 * k / steps, 0), 140 / steps + 0.5, 10, facecolor=color, linewidth=0))
    lines: list[Any] = [HPacker(children=[_text("0"), ramp, _text(scale.pressure)], pad=0, sep=8, align="center")]
    for words, color in ((f"force, {scale}", FORCE), ("friction, part of it", FRICTION)):
        arrow = DrawingArea(26, 10)
        arrow.add_artist(Polygon([(0, 3.5), (15, 3.5), (15, 0), (26, 5), (15, 10), (15, 6.5), (0, 6.5)], color=color))
        lines.append(HPacker(children=[arrow, _text(words)], pad=0, sep=8, align="center"))
    return _boxed(VPacker(children=lines, pad=4, sep=6), "lower right")


def _table(title: str, table: Sequence[_Row]) -> AnchoredOffsetbox:
    """The title, and volume, depth and force of pairs, the largest first."""
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
