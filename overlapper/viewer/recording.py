"""A run recorded to one HTML file, for any browser, without a server and without a network.

The page keeps bodies, poses, polytopes and numbers in arrays of narrow types. A pose at rest is written once. Vertices
are 16-bit fractions of their polytope's size. Numbers have five digits. With forces, the planes of facets are written,
too, as pressures depend on depths far below the last bit of a vertex.
"""

from __future__ import annotations

import base64
import gzip
import html
import json
import math
import pickle
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overlapper import Overlap, Placed
from overlapper.shapes.table import facts
from overlapper.viewer.framing import Framing, View
from overlapper.viewer.labels import (
    ROOT,
    DrawnBodies,
    DrawnContact,
    LinkName,
    Met,
    Pair,
    body_paths,
    key_of,
    labelled,
    must_be_drawn,
    own_names,
)
from overlapper.viewer.look import (
    BODIES,
    INK,
    LIGHT,
    LINE,
    MANY_FACETS,
    OVERLAPS,
    OWNER_COLORS,
    Array,
    Look,
    to_draw,
)
from overlapper.viewer.page_text import filled, licences
from overlapper.viewer.pressure import (
    COLORS,
    FORCE,
    FRICTION,
    Forces,
    Press,
    arrows,
    deepest,
    presses,
    rounded_up,
    usual,
    usual_force,
)
from overlapper.viewer.stage import Stage, rgb, set_room
from overlapper.whole_file import beside

from meshcat import Visualizer  # isort: skip  # after the stage, which says what to install
from meshcat.servers.zmqserver import VIEWER_ROOT  # isort: skip
from meshcat.transformations import translation_matrix  # isort: skip

# The scripts of the page, each after the scripts that it needs.
SCRIPTS = ("film", "scene", "forces", "look", "numbers", "camera", "chart", "list", "panels", "time")
ASPECTS = (0.4, 0.5, 0.6, 0.8, 1.0, 1.25, 1.5, 2.0)
ARRAYS = {"float32": "Float32Array", "uint32": "Uint32Array", "int32": "Int32Array", "uint16": "Uint16Array"}
ARRAYS |= {"int16": "Int16Array", "uint8": "Uint8Array"}


# Columns and their bits: volume; its error, whose first digit is shown; depth, area and centroid; normal.
NUMBERS = [(slice(0, 1), 17), (slice(1, 2), 6), (slice(2, 7), 17), (slice(7, 10), 14)]
# The same for force, torque, energy and slip; direction of the pressures; stiffness and hardening.
PRESSES = [(slice(0, 6), 17), (slice(6, 9), 14), (slice(9, 11), 17)]
UNPRESSED = (0.0,) * 11


class Recording:
    """A run as one self-contained HTML file with a time slider. It is made without a server and read without a network.

    The page shows one recorded frame at a time and never a mixture of two. The bodies drawn are therefore those of the
    overlaps drawn. `recording.html#t=0.25` opens at that time, paused. `#t=0.25&from=1,0,1&at=0,0,0.5` also puts the
    camera at the point `from`, and turns it to the point `at`. `#t=0.25&pair=cup,hand` also shows the numbers of that
    pair. About 30 frames per second are enough for a smooth view.

    Parameters
    ----------
    bodies : Look
        How bodies are drawn.
    overlaps : Look
        How overlaps are drawn.
    """

    def __init__(self, bodies: Look = BODIES, overlaps: Look = OVERLAPS) -> None:
        self._looks = {"bodies": bodies, "overlaps": overlaps}
        self._tape = _Tape([])
        self._visualizer = Visualizer(window=self._tape)
        self._stage: Stage | None = None
        self._framing: Framing | None = None
        self._start = 0.0
        self._times: list[float] = []
        self._names: list[str] = []
        self._bodies: dict[str, tuple[bytes, str]] = {}
        self._nodes: dict[str, int] = {}
        self._link_names: list[tuple[str, str]] = []  # the label of the body of each node, and the link's own name
        self._grounds: list[int] = []  # nodes
        self._poses: dict[str, tuple[float, ...]] = {}  # the last pose of each node
        self._keys: list[tuple[int, int, tuple[float, ...]]] = []  # frame, node, pose
        self._pairs: dict[Pair, int] = {}
        self._links: dict[Pair, tuple[LinkName, LinkName]] = {}
        self._drawn: dict[Pair, tuple[Overlap, int]] = {}  # the last of each pair, and its polytope
        self._polytopes = _Polytopes()
        self._sightings: list[tuple[int, int, int]] = []  # frame, pair, polytope
        self._numbers: list[Array] = []
        self._contacts: dict[Pair, DrawnContact] = {}  # the first contact of each pair
        self._presses: list[tuple[float, ...]] = []  # of each sighting
        self._depths: dict[int, float] = {}  # of polytopes
        self._tunnelled: list[tuple[int, str]] = []  # frame, pair of links
        self._left_out: dict[str, None] = {}  # a sentence for each shape or body that is not modelled in some frame
        self._usual: list[tuple[float, float]] = []  # N and Pa, in each frame that has forces

    def add(
        self,
        bodies: DrawnBodies,
        contacts: Iterable[DrawnContact],
        time: float,
        name: str = "",
        forces: Forces | None = None,
        first: Iterable[Met] = (),
    ) -> None:
        """Record the bodies where they are now, with their overlaps.

        Parameters
        ----------
        bodies : Bodies
            The bodies.
        contacts : iterable of Contact
            Those that overlap are drawn.
        time : float
            Simulated time, s. It must increase from call to call. The page counts from the first.
        name : str, default ''
            Name of the frame. Frames with a name are not moments of one run: the page shows the names instead of the
            times.
        forces : Forces, optional
            Forces to draw.
        first : iterable of FirstOverlap, default ()
            First overlaps since the step before. The page names the pairs that have tunnelled.

        Raises
        ------
        TypeError
            If `time` is not a number.
        ValueError
            If `time` is not later than that of the frame before.
        """
        must_be_drawn(bodies, contacts)
        if not isinstance(time, Real):
            raise TypeError(f"time must be a number of seconds, not {time!r}")
        if self._stage is None or self._framing is None:
            self._framing = Framing(bodies)
            self._stage = Stage(self._framing, *self._looks.values())
            self._start = time
            self._visualizer[ROOT].set_transform(translation_matrix(self._stage.center))
        seconds = time - self._start
        if self._times and not seconds > self._times[-1]:
            raise ValueError(f"time must increase from frame to frame: {time} s is not later than the frame before")
        self._times.append(seconds)
        self._names.append(name)
        for each in getattr(bodies, "skipped", ()):  # bodies outside a simulation have no `skipped`
            self._left_out[f"{each.name}, {each.reason}"] = None
        colors, owners = bodies.colors, own_names(bodies)
        places = {
            self._add_body(self._stage, path, placed, colors[key[:2]], owners[key[:2]]): _pose(self._stage, placed)
            for path, key, placed in zip(body_paths(bodies), bodies.keys, bodies.placed, strict=True)
        }
        absent = (0.0,) * 7
        for node in {**self._poses, **places}:
            pose = places.get(node, absent)
            if self._poses.get(node, absent) != pose:
                self._keys.append((len(self._times) - 1, self._nodes[node], pose))
            self._poses[node] = pose
        contacts = list(contacts)
        self._framing.see(bodies, contacts)
        pressed = presses(forces)
        tops: list[float] = []
        weights: list[float] = []
        for pair, links, contact in labelled(bodies, contacts):
            self._links.setdefault(pair, links)
            self._contacts.setdefault(pair, contact)
            press = pressed.get(key_of(contact))
            tops.append(self._add_overlap(self._stage, pair, contact.overlap, press))
            weights.append(float(np.linalg.norm(press.force)) if press else 0.0)
        for each in first:
            if each.tunnelled:
                a, b = (bodies.names[link] for link in ((each.bodyA, each.linkA), (each.bodyB, each.linkB)))
                self._tunnelled.append((len(self._times) - 1, f"{a} – {b}"))
        if any(weights):
            self._usual.append((usual_force(arrows(bodies, contacts, pressed)), usual(tops, weights)))

    def __repr__(self) -> str:
        until = f", {self._times[-1]:g} s" if self._times else ""
        return f"Recording({len(self._times)} frames{until}, {len(self._pairs)} pairs)"

    def save(self, path: str | Path) -> Path:
        """Write the frames added so far to one HTML file.

        Parameters
        ----------
        path : str or Path
            The file.

        Returns
        -------
        Path
            The path of the file.

        Raises
        ------
        ValueError
            If there are no frames.
        """
        text = self._page(Path(path).stem)
        with beside(path) as file:
            file.write_text(text, encoding="utf-8")
        return Path(path)

    def _repr_html_(self) -> str:
        """The page in a notebook; a line of text if there is no frame."""
        if not self._times:
            return html.escape(repr(self))
        return f'<iframe srcdoc="{html.escape(self._page())}" style="width:100%;height:600px;border:0"></iframe>'

    def _page(self, title: str = "") -> str:
        if self._stage is None or self._framing is None:
            raise ValueError("there is nothing to save: add at least one frame first")
        tape = _Tape(list(self._tape.commands))
        set_room(Visualizer(window=tape), self._framing.opening())
        folder = Path(__file__).with_name("page")
        texts = {
            "script": "\n".join((folder / f"{name}.js").read_text(encoding="utf-8") for name in SCRIPTS),
            "meshcat": Path(VIEWER_ROOT, "main.min.js").read_text(encoding="utf-8"),
            "commands": _packed(f"[{','.join(tape.commands)}]".encode()),
            "licences": licences(Path(VIEWER_ROOT).parent),
            "film": _packed(_film({"title": title} | self._heading(self._stage, self._framing), self._arrays())),
        }
        return filled(folder / "recording.html", texts)

    def _heading(self, stage: Stage, framing: Framing) -> dict[str, Any]:
        return {
            "times": self._times,
            "names": self._names if any(self._names) else None,
            "leftOut": list(self._left_out),
            "tunnelled": list(dict.fromkeys(self._tunnelled)),
            "pairs": list(self._pairs),
            "links": list(self._links.values()),
            "nodes": list(self._nodes),
            "linkNames": self._link_names,
            "center": stage.center.tolist(),
            "size": stage.size,
            "moment": max(framing.moment, 0),
            "views": {"opening": _seen_from(framing.opening()), "whole": _seen_from(framing.whole())},
            "grounds": self._grounds,
            "looks": {name: asdict(look) for name, look in self._looks.items()},
            "colors": {"owners": [rgb(color) for color in OWNER_COLORS[:2]], "ink": rgb(INK), "line": rgb(LINE)},
            "light": LIGHT.tolist(),
            "forces": self._scale(framing),
        }

    def _scale(self, framing: Framing) -> dict[str, Any] | None:
        """The scale of arrows and colours: the median over frames, so that a short impact does not count."""
        if not self._usual:
            return None
        force, pressure = np.median(self._usual, axis=0).tolist()
        return {
            "usual": force,
            "top": rounded_up(pressure),
            "colors": COLORS,
            "force": rgb(FORCE),
            "friction": rgb(FRICTION),
            "on_second": [framing.pushed_second(contact) for contact in self._contacts.values()],
        }

    def _arrays(self) -> dict[str, NDArray[Any]]:
        frames, nodes, poses = (list(column) for column in zip(*self._keys, strict=True)) if self._keys else ([],) * 3
        sightings = np.array(self._sightings, dtype=np.uint32).reshape(-1, 3)
        numbers = np.array(self._numbers, dtype=np.float32).reshape(-1, 10)
        return {
            "key_frame": np.array(frames, dtype=np.uint32),
            "key_node": np.array(nodes, dtype=np.uint32),
            "key_pose": np.array(poses, dtype=np.float32).reshape(-1, 7).T,
            "sighting_start": np.searchsorted(sightings[:, 0], np.arange(len(self._times) + 1)).astype(np.uint32),
            "sighting_pair": sightings[:, 1],
            "sighting_polytope": sightings[:, 2],
            "numbers": np.hstack([_rounded(numbers[:, column], bits) for column, bits in NUMBERS]).T,
            **self._polytopes.arrays(),
            **self._pressing(),
        }

    def _pressing(self) -> dict[str, NDArray[Any]]:
        """The arrays of forces; empty if the recording has no forces."""
        rows = self._presses if self._usual else []
        columns = np.array(rows, dtype=np.float32).reshape(-1, len(UNPRESSED))
        return {
            "presses": np.hstack([_rounded(columns[:, column], bits) for column, bits in PRESSES]).T,
            "planes": np.concatenate(self._polytopes.planes).T if rows else np.empty(0, np.float32),
        }

    def _add_body(self, stage: Stage, path: str, placed: Placed, color: Sequence[float], owner: tuple[str, str]) -> str:
        """The node of the body. A new body is drawn."""
        shape = pickle.dumps(placed.shape)
        drawn, node = self._bodies.get(path, (None, path))
        if drawn != shape:
            node = path if drawn is None else f"{path} from frame {len(self._times)}"
            self._visualizer[node].set_object(stage.body(placed, color))
            self._bodies[path] = shape, node
            self._nodes[node] = len(self._nodes)
            self._link_names.append(owner)
            if stage.drawing.ground(placed):
                self._grounds.append(self._nodes[node])
        return node

    def _add_overlap(self, stage: Stage, pair: Pair, overlap: Overlap, press: Press | None) -> float:
        """Record the overlap; returns about its highest pressure, Pa."""
        number = self._pairs.setdefault(pair, len(self._pairs))
        last, polytope = self._drawn.get(pair, (None, -1))
        slack = 2 if len(overlap.owner) > MANY_FACETS else 1
        if last is None or not _look_alike(last, overlap, slack):
            polytope = self._polytopes.add(to_draw(overlap, stage.size), stage.center, polytope, slack)
            self._drawn[pair] = overlap, polytope
        self._sightings.append((len(self._times) - 1, number, polytope))
        measures = [overlap.volume, overlap.volume_error, overlap.depth or 0.0, overlap.area]
        normal = np.zeros(3) if overlap.normal is None else overlap.normal
        self._numbers.append(np.hstack([measures, np.asarray(overlap.centroid) - stage.center, normal]))
        if press is None:
            self._presses.append(UNPRESSED)
            return 0.0
        measured = press.torque, press.energy, press.slip
        self._presses.append((*press.force, *measured, *press.normal, press.stiffness, press.hardening))
        if polytope not in self._depths:
            self._depths[polytope] = deepest(to_draw(self._drawn[pair][0], stage.size), press.normal)
        pressure: float = press.pressure(self._depths[polytope])
        return pressure


@dataclass
class _Polytopes:
    """Facets by vertices and owners. If only the vertices have moved, their motions are kept instead."""

    frames: list[tuple[float, ...]] = field(default_factory=list)  # middle, and the unit: half the longest side
    previous: list[int] = field(default_factory=list)  # the polytope that vertices are counted from, or -1
    vertices: list[NDArray[np.int16]] = field(default_factory=list)
    owners: list[NDArray[np.integer[Any]]] = field(default_factory=list)
    facets: list[list[NDArray[np.int32]]] = field(default_factory=list)
    planes: list[NDArray[np.float32]] = field(
        default_factory=list
    )  # normal, and offset from the middle in units, of each facet

    def add(self, overlap: Overlap, center: Array, like: int, slack: int) -> int:
        """Keep the overlap, about `center`. `like` is the earlier polytope of the pair, or -1. Returns its number.

        Round overlaps have a `slack` above 1. They are drawn to within a tenth, so 1/1000 of the size is fine enough
        for vertices.
        """
        lower, upper = np.asarray(overlap.bounds)
        unit = float((upper - lower).max()) / 2
        self.frames.append((*((lower + upper) / 2 - center), unit))
        grain = 64 if slack > 1 else 1
        steps = np.round((overlap.vertices - (lower + upper) / 2) / unit * 32767 / grain) * grain
        grid = np.clip(steps, -32767, 32767).astype(np.int16)
        self.previous.append(like if like >= 0 and self.vertices[like].shape == grid.shape else -1)
        self.vertices.append(grid)
        self.owners.append(overlap.owner)
        self.facets.append(overlap.facets)
        self.planes.append(_facet_planes(overlap, (lower + upper) / 2, unit))
        return len(self.vertices) - 1

    def arrays(self) -> dict[str, NDArray[Any]]:
        moved = [
            grid - self.vertices[like] if like >= 0 else grid  # modulo 2^16
            for grid, like in zip(self.vertices, self.previous, strict=True)
        ]
        rings = [ring for facets in self.facets for ring in facets]
        return {
            "polytope_frame": np.array(self.frames, dtype=np.float32).reshape(-1, 4).T,
            "polytope_previous": np.array(self.previous, dtype=np.int32),
            "polytope_vertices": np.array([len(grid) for grid in self.vertices], dtype=np.uint16),
            "polytope_facets": np.array([len(facets) for facets in self.facets], dtype=np.uint16),
            "vertices": np.concatenate([np.zeros((0, 3), np.int16), *moved]),
            "owners": np.concatenate([np.zeros(0), *self.owners]).astype(np.uint8),
            "ring_length": np.array([len(ring) for ring in rings], dtype=np.uint16),
            "rings": np.concatenate([np.zeros(0), *rings]).astype(np.uint16),
        }


class _Tape:
    """Replaces meshcat's window, and keeps the commands instead of sending them to a server.

    A geometry that is used again is kept only by its uuid.
    """

    def __init__(self, commands: list[str]) -> None:
        self.commands = commands
        self._known: set[str] = set()

    def send(self, command: Any) -> None:
        lowered = command.lower()
        for each in lowered.get("object", {}).get("geometries", ()):
            if each["uuid"] in self._known:
                del each["data"]
            self._known.add(each["uuid"])
        self.commands.append(json.dumps(lowered, default=lambda packed: base64.b64encode(packed.data).decode()))


def _seen_from(view: View) -> dict[str, Any]:
    """A view for the page, with its distance for each of ASPECTS."""
    distances = {f"{aspect:g}": view.distance(aspect) for aspect in ASPECTS}
    return {"at": view.at.tolist(), "back": view.back.tolist(), "distances": distances}


def _pose(stage: Stage, placed: Placed) -> tuple[float, ...]:
    """Position about the scene's centre, and quaternion.

    Both are rounded to about a millionth, far below a pixel, so that a body at rest has one pose.
    """
    position = np.round((placed.position - stage.center) / stage.size, 6) * stage.size
    return (*position.tolist(), *np.round(placed.orientation, 6).tolist())


def _facet_planes(overlap: Overlap, middle: Array, unit: float) -> NDArray[np.float32]:
    """The planes of facets, rounded to a small part of the thickness, so that their last bytes pack well."""
    planes = np.array(overlap.halfspaces)
    planes[:, 3] = (planes[:, 3] + planes[:, :3] @ middle) / unit
    thickness = 2 * overlap.volume / (overlap.area * unit)
    step = 2.0 ** np.floor(np.log2(thickness / 60))
    fine: NDArray[np.float32] = (np.round(planes / step) * step).astype(np.float32)
    return fine


def _look_alike(a: Overlap, b: Overlap, slack: int) -> bool:
    """True if the drawing of one overlap can stand for the other.

    Neither shape has moved by more than 1/200 of the overlap's size. This is one pixel if the overlap fills a quarter
    of the page. Volume and area have changed by at most 3 %, which matters for thin overlaps. `slack` multiplies both
    limits.
    """
    changed = max(abs(b.volume / a.volume - 1), abs(b.area / a.area - 1))
    if changed >= 0.03 * slack:
        return False
    size, centroid = float(np.ptp(np.asarray(a.bounds), axis=0).max()), np.asarray(a.centroid)
    return all(
        _motion(before, after, centroid, size) < slack * size / 200
        for before, after in zip(a.shapes, b.shapes, strict=True)
    )


def _motion(before: Placed, after: Placed, point: Array, reach: float) -> float:
    """About the largest motion, m, of the shape within `reach` of a point."""
    if facts(before.shape).isotropic:
        return math.dist(after.position, before.position)
    # A quaternion and its negative are the same rotation.
    turn = 2 * min(math.dist(after.orientation, sign * before.orientation) for sign in (1, -1))
    return math.dist(after.position, before.position) + (math.dist(before.position, point) + reach) * turn


def _rounded(numbers: NDArray[np.float32], bits: int) -> NDArray[np.float32]:
    """Numbers rounded to so many of their 24 significant bits, so that the last bytes pack well."""
    spare = 24 - bits
    raised = np.ascontiguousarray(numbers).view(np.uint32) + np.uint32(1 << (spare - 1))
    rounded: NDArray[np.float32] = (raised >> spare << spare).view(np.float32)
    return rounded


def _film(heading: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """The length of the heading, the heading in JSON, and of each array all first bytes, all second bytes, ...

    Numbers of similar size have similar first bytes, and similar bytes pack best side by side.
    """
    kinds = {name: [ARRAYS[array.dtype.name], array.size] for name, array in arrays.items()}
    head = json.dumps({**heading, "arrays": kinds}).encode()
    parts = [np.ascontiguousarray(array).reshape(-1, 1).view(np.uint8).T.tobytes() for array in arrays.values()]
    return b"".join([len(head).to_bytes(4, "little"), head, *parts])


def _packed(data: bytes) -> str:
    return base64.b64encode(gzip.compress(data, compresslevel=9, mtime=0)).decode()
