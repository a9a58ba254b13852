"""Bodies and their overlaps in meshcat: live in a running visualizer, or recorded to one HTML file.

Bodies are drawn by their collision shapes, translucent and in their own colours. An overlap is opaque and drawn after
the bodies, so that none of them tints it. Each facet has the colour of the shape whose surface it lies on: orange for
the first of the pair, sky blue for the second, from the palette of Okabe and Ito, which the common kinds of colour
blindness keep apart. The bodies' own colours would say less, for in many models everything is white or grey. The arrow
starts at the centroid and points along `normal`, the way that pushes the first shape out of the second; the line is
the patch outline. Both shine through everything, and the arrow is as long as a fixed part of the scene, so that an
overlap of a millimetre between bodies of a metre is still found. In meshcat's tree the bodies are
`/overlapper/bodies/<body>/<link>/<shape>` and the overlaps `/overlapper/overlaps/<a>-<b>/<volume>`. Lengths are in
metres and the world's z axis is up.
"""

from __future__ import annotations

import base64
import gzip
import json
import pickle
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from overlapper import HalfSpace, Overlap, Placed
from overlapper import overlap as common_part
from overlapper.surface import cone, plate, rotation_from_z, surface, triangles

try:
    import meshcat
    from meshcat import geometry
    from meshcat.animation import Animation, AnimationClip, AnimationTrack
    from meshcat.servers.zmqserver import VIEWER_ROOT
    from meshcat.transformations import quaternion_matrix, rotation_matrix, translation_matrix
except ImportError as missing:
    raise ImportError("overlapper.viewer needs meshcat: pip install 'overlapper[view]'") from missing

Array = NDArray[np.float64]

BODIES, OVERLAPS = "/overlapper/bodies", "/overlapper/overlaps"
OWNER_COLORS = [
    (0.90, 0.62, 0.00),
    (0.34, 0.71, 0.91),
    (0.00, 0.62, 0.45),
    (0.94, 0.89, 0.26),
    (0.80, 0.47, 0.65),
    (0.84, 0.37, 0.00),
    (0.00, 0.45, 0.70),
]
BODY_OPACITY = 0.35
INK = 0xFF4FA3  # for what shines through: a colour that models hardly ever have
MANY_FACETS = 300  # more than are seen: what is round is drawn within 3 % of its size, with a fraction of them
FIELD_OF_VIEW = 35.0  # degrees, from bottom to top


class Bodies(Protocol):
    """What is drawn: shapes in the world by (body, link, shape); the colours of the links and their distinct names."""

    @property
    def keys(self) -> Sequence[tuple[int, int, int]]: ...
    @property
    def placed(self) -> Sequence[Placed]: ...
    @property
    def colors(self) -> Mapping[tuple[int, int], Sequence[float]]: ...
    @property
    def names(self) -> Mapping[tuple[int, int], str]: ...


class Contact(Protocol):
    """A pair of shapes, each by body, link and index within the link, and what they have in common."""

    @property
    def bodyA(self) -> int: ...
    @property
    def linkA(self) -> int: ...
    @property
    def shapeA(self) -> int: ...
    @property
    def bodyB(self) -> int: ...
    @property
    def linkB(self) -> int: ...
    @property
    def shapeB(self) -> int: ...
    @property
    def overlap(self) -> Overlap: ...


class Viewer:
    """A live view of a simulation: call `show` after each step.

    A visualizer that is passed in keeps its own camera, lights and background. Without one a meshcat server is started
    and its address printed, the bodies of the first `show` are framed, and `close`, or the end of a `with` block, stops
    the server.
    """

    def __init__(self, visualizer: Any = None) -> None:
        self._owned = visualizer is None
        self.visualizer = meshcat.Visualizer() if visualizer is None else visualizer
        self._stage: _Stage | None = None
        self._shapes: dict[str, bytes] = {}
        self._poses: dict[str, Array] = {}
        self._pairs: set[tuple[str, str]] = set()

    def show(self, bodies: Bodies, contacts: Iterable[Contact]) -> None:
        """Draw the bodies where they are now and the overlapping pairs among `contacts`, in place of what was there."""
        if self._stage is None:
            self._stage = _Stage(bodies.placed)
            if self._owned:
                self._stage.set(self.visualizer, _boxes(bodies.placed))
        self._show_bodies(self._stage, bodies)
        self._show_overlaps(self._stage, _pairs(bodies, contacts))

    def _show_bodies(self, stage: _Stage, bodies: Bodies) -> None:
        paths, colors = _body_paths(bodies), bodies.colors
        for path in self._shapes.keys() - set(paths):
            self.visualizer[path].delete()
            del self._shapes[path], self._poses[path]
        for path, key, placed in zip(paths, bodies.keys, bodies.placed, strict=True):
            shape = pickle.dumps(placed.shape)
            if self._shapes.get(path) != shape:
                self.visualizer[path].set_object(stage.body(placed, colors[key[:2]]))
                self._shapes[path] = shape
            pose = _matrix(placed)
            if not np.array_equal(self._poses.get(path, ()), pose):
                self.visualizer[path].set_transform(pose)
                self._poses[path] = pose

    def _show_overlaps(self, stage: _Stage, overlaps: Mapping[tuple[str, str], Overlap]) -> None:
        for pair in self._pairs:
            self.visualizer[_overlap_path(pair)].delete()
        for pair, overlap in overlaps.items():
            self.visualizer[f"{_overlap_path(pair)}/{_volume_text(overlap.volume)}"].set_object(stage.overlap(overlap))
        self._pairs = set(overlaps)

    def close(self) -> None:
        """Stop the server, if this view started it."""
        if self._owned and not self.visualizer.window.zmq_socket.closed:
            self.visualizer.window.zmq_socket.close()
            self.visualizer.window.server_proc.kill()
            self.visualizer.window.server_proc.communicate()

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Recording:
    """A run as one self-contained HTML file with a time slider; made without a server, read without a network.

    The page shows one recorded frame at a time and never a mixture of two, so the bodies drawn are those that made the
    overlaps drawn. `recording.html#t=0.25` opens at that time, paused; `#t=0.25&from=1,0,1&at=0,0,0.5` with the camera
    at one point of the world and turned to another. About 30 frames a second are enough to look at.
    """

    def __init__(self) -> None:
        self._tape = _Tape([])
        self._visualizer = meshcat.Visualizer(window=self._tape)
        self._stage: _Stage | None = None
        self._start = 0.0
        self._frames: list[dict[str, Any]] = []
        self._framed: list[Array] = []
        self._bodies: dict[str, tuple[bytes, str]] = {}
        self._films: dict[str, _Film] = {}
        self._tracks: dict[str, dict[str, _HeldTrack]] = {}
        self._visible: set[tuple[str, str]] = set()

    def add(self, bodies: Bodies, contacts: Iterable[Contact], time: float) -> None:
        """Record the bodies where they are now and the overlapping pairs among `contacts`.

        `time` in seconds must increase from call to call; the page counts from the first.
        """
        if self._stage is None:
            self._stage = _Stage(bodies.placed)
            self._start = time
            self._framed.extend(_boxes(bodies.placed))
            self._visualizer[BODIES].set_transform(translation_matrix(self._stage.center))
        # three.js keeps the times of key frames in float32, and a frame must be found at exactly its own time.
        seconds = float(np.float32(time - self._start))
        if self._frames and not seconds > self._frames[-1]["time"]:
            raise ValueError(f"time must increase from frame to frame: {time} s came no later than the frame before")
        overlaps = _pairs(bodies, contacts)
        self._frames.append({"time": seconds, "overlaps": [_row(*item) for item in _largest_first(overlaps)]})
        colors = bodies.colors
        visible = {
            self._add_body(path, placed, colors[key[:2]])
            for path, key, placed in zip(_body_paths(bodies), bodies.keys, bodies.placed, strict=True)
        }
        visible |= {self._add_overlap(_overlap_path(pair), overlap) for pair, overlap in overlaps.items()}
        for node, switch in visible ^ self._visible:
            self._key(node, switch, "boolean", (node, switch) in visible)
        self._visible = visible

    def save(self, path: str | Path) -> Path:
        """Write what was added so far to one HTML file, and return its path."""
        if self._stage is None:
            raise ValueError("there is nothing to save: add at least one frame first")
        tape = _Tape(list(self._tape.commands))
        visualizer = meshcat.Visualizer(window=tape)
        self._stage.set(visualizer, self._framed)
        for node, film in self._films.items():
            frames = [(frame, {"name": f"frame{number}", "visible": False}) for number, frame in enumerate(film.frames)]
            visualizer[f"{node}/at most {_volume_text(film.largest)}"].set_object(_Group(*frames))
        visualizer.set_animation(self._animation(), repetitions=1_000_000)
        page = Path(__file__).with_name("recording.html").read_text(encoding="utf-8")
        page = page.replace("{{meshcat}}", Path(VIEWER_ROOT, "main.min.js").read_text(encoding="utf-8"))
        page = page.replace("{{commands}}", _packed("[" + ",".join(tape.commands) + "]"))
        page = page.replace("{{frames}}", _packed(json.dumps(self._frames)))
        Path(path).write_text(page, encoding="utf-8")
        return Path(path)

    def _add_body(self, path: str, placed: Placed, color: Sequence[float]) -> tuple[str, str]:
        """Move the body, and draw it if it is new; returns the node and the track that switches it on."""
        assert self._stage is not None
        shape = pickle.dumps(placed.shape)
        drawn, node = self._bodies.get(path, (None, path))
        if drawn != shape:
            node = path if drawn is None else f"{path} from frame {len(self._frames)}"
            self._visualizer[node].set_object(self._stage.body(placed, color))
            self._bodies[path] = shape, node
        # Key frames are float32, so they are about the scene's centre. A millionth of the scene is far below a pixel:
        # what rests keeps its key frame in spite of rounding.
        position = np.round((placed.position - self._stage.center) / self._stage.size, 6) * self._stage.size
        self._key(node, ".position", "vector3", position.tolist())
        self._key(node, ".quaternion", "quaternion", np.round(placed.orientation, 6).tolist())
        return node, ".visible"

    def _add_overlap(self, path: str, overlap: Overlap) -> tuple[str, str]:
        """Put the overlap on the film of its pair; returns the node and the track that switches this frame on."""
        assert self._stage is not None
        film = self._films.setdefault(path, _Film())
        shown = (path, f"frame{len(film.frames) - 1}.visible") in self._visible
        if not (shown and film.last is not None and _look_alike(film.last, overlap)):
            film.frames.append(self._stage.overlap(overlap))
            film.last = overlap
            self._framed.append(np.asarray(overlap.bounds))
        film.largest = max(film.largest, overlap.volume)
        return path, f"frame{len(film.frames) - 1}.visible"

    def _key(self, node: str, name: str, jstype: str, value: Any) -> None:
        tracks = self._tracks.setdefault(node, {})
        time = self._frames[-1]["time"]
        if name not in tracks:
            hidden_before = jstype == "boolean" and time > 0
            tracks[name] = _HeldTrack(name, jstype, [0.0], [False]) if hidden_before else _HeldTrack(name, jstype)
        if tracks[name].values[-1:] != [value]:
            tracks[name].set_property(time, value)

    def _animation(self) -> Animation:
        """All clips end together, as each is played by itself, and late enough to show the last frame, too."""
        last = self._frames[-1]["time"]
        end = last + last / max(len(self._frames) - 1, 1)
        animation = Animation()
        for node, tracks in self._tracks.items():
            closed = {name: track.until(end) for name, track in tracks.items()}
            animation.clips[self._visualizer[node].path] = AnimationClip(closed, fps=1)
        return animation


@dataclass
class _Film:
    """What a pair had in common, one frame visible at a time: meshcat can switch an object but not reshape it."""

    frames: list[_Group] = field(default_factory=list)
    last: Overlap | None = None
    largest: float = 0.0


class _Tape:
    """In the place of meshcat's window: keeps the commands instead of sending them to a server."""

    def __init__(self, commands: list[str]) -> None:
        self.commands = commands

    def send(self, command: Any) -> None:
        self.commands.append(json.dumps(command.lower(), default=lambda packed: base64.b64encode(packed.data).decode()))


class _HeldTrack(AnimationTrack):  # type: ignore[misc]
    """Key frames whose value holds until the next one, named as in three.js: `.property` or `object.property`."""

    def until(self, end: float) -> _HeldTrack:
        return _HeldTrack(self.name, self.jstype, [*self.frames, end], [*self.values, self.values[-1]])

    def lower(self) -> dict[str, Any]:
        interpolate_discrete = 2300  # three.js, constants.js
        return {**super().lower(), "name": self.name, "interpolation": interpolate_discrete}


class _Stage:
    """Background, lights, camera, and the sizes that follow the scene; fixed by the first bodies seen."""

    def __init__(self, placed: Sequence[Placed]) -> None:
        boxes = np.array(_boxes(placed))
        lower, upper = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
        self.center = (lower + upper) / 2
        self.size = float(np.linalg.norm(upper - lower))
        # Mostly of their own light, so that an owner is known from the shaded side, too.
        self._owner_skins = [_skin(_rgb(color, 0.7), flat=True, emissive=_rgb(color, 0.4)) for color in OWNER_COLORS]
        through_everything = {"color": INK, "transparent": True, "depthTest": False}
        self._shining = geometry.LineBasicMaterial(**through_everything)
        self._dot = geometry.Points(
            _lines(np.zeros((1, 1, 3))), _DotMaterial(size=5, sizeAttenuation=False, **through_everything)
        )
        head = cone(radius=0.05, bottom=0.8, top=1.0)
        self._arrowhead = geometry.Mesh(
            _Mesh(head.vertices, head.faces), geometry.MeshBasicMaterial(**through_everything)
        )

    def body(self, placed: Placed, color: Sequence[float]) -> _Group:
        """A translucent shape with its creases, in its own frame; a half-space is a plate as large as the scene."""
        paint = _rgb(color)
        if isinstance(placed.shape, HalfSpace):
            center = np.linalg.inv(_matrix(placed)) @ [*self.center, 1]
            drawn, side, opacity = plate(placed.shape, center[:3], self.size), 2, 0.4 * BODY_OPACITY
        else:
            drawn, side, opacity = surface(placed.shape), 0, BODY_OPACITY
        skin = _skin(paint, drawn.normals is None, opacity=opacity, depthWrite=False, side=side)
        edge = geometry.LineBasicMaterial(color=paint, opacity=opacity, transparent=True, depthWrite=False)
        return _Group(
            (geometry.Mesh(_Mesh(drawn.vertices, drawn.faces, drawn.normals), skin), {}),
            (geometry.LineSegments(_lines(drawn.edges), edge), {}),
        )

    def overlap(self, overlap: Overlap) -> _Group:
        """Facets by owner, patch outline and normal; about the centroid, where float32 is fine enough."""
        if len(overlap.owner) > MANY_FACETS:
            overlap = common_part(*overlap.shapes, tolerance=0.03) or overlap
        centroid = np.asarray(overlap.centroid)
        vertices = overlap.vertices - centroid
        faces = triangles(overlap.facets)
        owners = np.repeat(overlap.owner, [len(facet) - 2 for facet in overlap.facets])
        parts: list[tuple[geometry.Object, dict[str, Any]]] = []
        for owner in np.unique(owners):
            used, renumbered = np.unique(faces[owners == owner], return_inverse=True)
            mesh = _Mesh(vertices[used], renumbered.reshape(-1, 3))
            parts.append((geometry.Mesh(mesh, self._owner_skins[owner % len(OWNER_COLORS)]), {"renderOrder": 1}))
        lines = [np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) - centroid for ring in overlap.patch]
        if overlap.normal is not None:
            # In proportion to the patch, but neither lost in the scene nor in the way of others.
            length = float(np.clip(np.sqrt(overlap.area) / 3, 0.03 * self.size, 0.06 * self.size))
            lines.append(np.array([[np.zeros(3), length * overlap.normal]]))
            pose = np.eye(4)
            pose[:3, :3] = length * rotation_from_z(overlap.normal)
            parts.append((self._arrowhead, {"renderOrder": 2, "matrix": pose.T.ravel().tolist()}))
        if lines:
            parts.append((geometry.LineSegments(_lines(np.concatenate(lines)), self._shining), {"renderOrder": 2}))
        if np.ptp(vertices, axis=0).max() < 0.015 * self.size:
            parts.append((self._dot, {"renderOrder": 3}))
        return _Group((_Group(*parts), {"position": centroid.tolist()}))

    def set(self, visualizer: Any, framed: Sequence[Array]) -> None:
        """A dark room, plain light, and a camera that sees the boxes `framed`, each (2, 3): lower and upper corner."""
        for name in ("Grid", "Axes", "Lights/PointLightNegativeX", "Lights/PointLightPositiveX"):
            visualizer[f"/{name}"].set_property("visible", False)
        visualizer["/Background"].set_property("top_color", [0.20, 0.23, 0.28])
        visualizer["/Background"].set_property("bottom_color", [0.09, 0.10, 0.13])
        center, back, distance = _camera(framed)
        # meshcat's camera circles about the page's origin; so the scene is moved there, and the camera moved with it.
        z_up = rotation_matrix(-np.pi / 2, (1, 0, 0))
        visualizer["/"].set_transform(z_up @ translation_matrix(-center))
        visualizer["/Cameras/default"].set_transform(translation_matrix(center))
        camera = visualizer["/Cameras/default/rotated/<object>"]
        x, y, z = (distance * back).tolist()
        camera.set_property("position", [x, z, -y])
        camera.set_property("fov", FIELD_OF_VIEW)
        camera.set_property("near", distance / 500)
        camera.set_property("far", distance * 100)
        light = visualizer["/Lights/FillLight/<object>"]
        light.set_property("position", (center + [0.5, -0.8, 1.4]).tolist())
        light.set_property("intensity", 0.55)
        visualizer["/Lights/AmbientLight/<object>"].set_property("intensity", 0.45)


class _Group(geometry.Object):  # type: ignore[misc]
    """Objects that make one node of the tree, each with more of its attributes in three.js's object format."""

    def __init__(self, *parts: tuple[geometry.Object, dict[str, Any]]) -> None:
        geometry.SceneElement.__init__(self)
        self.parts = parts

    def lower(self) -> dict[str, Any]:
        lowered = [part.lower() for part, _ in self.parts]
        return {
            "metadata": {"version": 4.5, "type": "Object"},
            "geometries": _once(each for part in lowered for each in part["geometries"]),
            "materials": _once(each for part in lowered for each in part["materials"]),
            "object": {
                "uuid": self.uuid,
                "type": "Group",
                "children": [
                    _placed(part["object"], more) for part, (_, more) in zip(lowered, self.parts, strict=True)
                ],
            },
        }


def _placed(child: dict[str, Any], more: dict[str, Any]) -> dict[str, Any]:
    """meshcat gives every object a matrix, the identity for these, that would win over a position."""
    return {key: value for key, value in child.items() if key != "matrix"} | more


def _once(elements: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    return list({each["uuid"]: each for each in elements}.values())


class _DotMaterial(geometry.GenericMaterial):  # type: ignore[misc]
    _type = "PointsMaterial"


class _Mesh(geometry.TriangularMeshGeometry):  # type: ignore[misc]
    """meshcat's triangles, with normals."""

    def __init__(self, vertices: Array, faces: NDArray[Any], normals: Array | None = None) -> None:
        super().__init__(vertices, faces)
        self.normals = normals

    def lower(self, object_data: dict[str, Any]) -> dict[str, Any]:
        lowered: dict[str, Any] = super().lower(object_data)
        if self.normals is not None:
            lowered["data"]["attributes"]["normal"] = geometry.pack_numpy_array(self.normals.T)
        return lowered


def _skin(paint: int, flat: bool, **properties: Any) -> geometry.MeshPhongMaterial:
    """Matt, and "transparent" even if opaque: three.js draws what is so called last, and in the order asked for."""
    properties = {"color": paint, "transparent": True, "flatShading": flat, "specular": 0, "side": 0} | properties
    return geometry.MeshPhongMaterial(**properties)


def _lines(segments: Array) -> geometry.PointsGeometry:
    """Segments (k, 2, 3), from and to."""
    return geometry.PointsGeometry(np.ascontiguousarray(segments.reshape(-1, 3).T, dtype=np.float32))


def _camera(framed: Sequence[Array]) -> tuple[Array, Array, float]:
    """The point to look at, the unit direction from it to the camera, and how far off that sees all boxes, in 4 : 3."""
    boxes = np.array(framed)
    center = (boxes[:, 0].min(axis=0) + boxes[:, 1].max(axis=0)) / 2
    back = np.array([0.60, -0.68, 0.42]) / np.linalg.norm([0.60, -0.68, 0.42])
    right = np.array([-back[1], back[0], 0.0]) / np.hypot(back[0], back[1])
    corners = np.array([boxes[:, list(pick), range(3)] for pick in np.ndindex(2, 2, 2)]).reshape(-1, 3) - center
    slope = np.tan(np.deg2rad(FIELD_OF_VIEW) / 2)
    aside = np.maximum(np.abs(corners @ np.cross(back, right)), np.abs(corners @ right) / (4 / 3))
    return center, back, float(1.15 * np.max(aside / slope + corners @ back))


def _matrix(placed: Placed) -> Array:
    """The pose as a 4 x 4 matrix."""
    x, y, z, w = placed.orientation
    matrix: Array = quaternion_matrix([w, x, y, z])
    matrix[:3, 3] = placed.position
    return matrix


def _boxes(placed: Iterable[Placed]) -> list[Array]:
    """The boxes (2, 3) around what is bounded; one about the origin if nothing is."""
    boxes = [np.asarray(each.bounds) for each in placed if not isinstance(each.shape, HalfSpace)]
    return boxes or [np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])]


def _largest_first(overlaps: Mapping[tuple[str, str], Overlap]) -> list[tuple[tuple[str, str], Overlap]]:
    return sorted(overlaps.items(), key=lambda item: item[1].volume, reverse=True)


def _look_alike(a: Overlap, b: Overlap) -> bool:
    """True if the one can stand for the other in a picture: no vertex is off by more than a thousandth of the size."""
    size = np.ptp(np.asarray(a.bounds), axis=0).max()
    same = a.vertices.shape == b.vertices.shape and np.array_equal(a.owner, b.owner)
    return bool(same and np.abs(a.vertices - b.vertices).max() < 1e-3 * size)


def _link_names(bodies: Bodies) -> dict[tuple[int, int], tuple[str, str]]:
    """What the tree calls the body and the link: a slash would begin a new level of it."""
    names = {}
    for (body, link), name in bodies.names.items():
        first, _, rest = name.partition("/")
        names[body, link] = first or str(body), rest.replace("/", ".") or str(link)
    return names


def _body_paths(bodies: Bodies) -> list[str]:
    names = _link_names(bodies)
    return [f"{BODIES}/{'/'.join(names[body, link])}/{shape}" for body, link, shape in bodies.keys]


def _pairs(bodies: Bodies, contacts: Iterable[Contact]) -> dict[tuple[str, str], Overlap]:
    """The overlapping pairs by their names; a link or shape is named only where its body or link has more than one."""
    names = _link_names(bodies)
    links = Counter(body for body, _ in names)
    shapes = Counter((body, link) for body, link, _ in bodies.keys)

    def name(body: int, link: int, shape: int) -> str:
        first, rest = names[body, link]
        label = f"{first}.{rest}" if links[body] > 1 else first
        return f"{label}.{shape}" if shapes[body, link] > 1 else label

    return {
        (name(c.bodyA, c.linkA, c.shapeA), name(c.bodyB, c.linkB, c.shapeB)): c.overlap for c in contacts if c.overlap
    }


def _overlap_path(pair: tuple[str, str]) -> str:
    return f"{OVERLAPS}/{pair[0]}-{pair[1]}"


def _volume_text(volume: float) -> str:
    for cubic_metres, unit in ((1e-9, "mm³"), (1e-6, "cm³"), (1e-3, "dm³")):
        if volume < 1000 * cubic_metres:
            return f"{volume / cubic_metres:.3g} {unit}"
    return f"{volume:.3g} m³"


def _row(pair: tuple[str, str], overlap: Overlap) -> dict[str, Any]:
    """What the page's table says of a pair."""
    return {
        "pair": pair,
        "volume": _volume_text(overlap.volume),
        "depth": f"{1e3 * (overlap.depth or 0.0):.3g} mm",
        "centroid": np.asarray(overlap.centroid).tolist(),
        "size": float(np.linalg.norm(np.ptp(np.asarray(overlap.bounds), axis=0))),
    }


def _rgb(color: Sequence[float], brightness: float = 1.0) -> int:
    """Red, green and blue in 0..1 as three.js's one number."""
    red, green, blue = (round(255 * min(max(part * brightness, 0.0), 1.0)) for part in color[:3])
    return red << 16 | green << 8 | blue


def _packed(text: str) -> str:
    return base64.b64encode(gzip.compress(text.encode(), compresslevel=6, mtime=0)).decode()
