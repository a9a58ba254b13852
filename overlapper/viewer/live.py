"""A live view of bodies and their overlaps in meshcat.

Each overlap is drawn after the bodies, so that none of them tints it, with an arrow and a line. The arrow starts at the
centroid and points along `normal`, the way that pushes the first shape out of the second; the line is the patch
outline. Both shine through everything, and the arrow is as long as a fixed part of the scene, so that an overlap of a
millimetre between bodies of a metre is still found. In meshcat's tree the bodies are
`/overlapper/bodies/<body>/<link>/<shape>` and the overlaps `/overlapper/overlaps/<a>-<b>/<volume>`.
"""

from __future__ import annotations

import pickle
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from overlapper import Overlap
from overlapper.process import START_LIMIT, Ended, NotStarted, Worker
from overlapper.viewer.framing import Framing
from overlapper.viewer.labels import Bodies, Contact, body_paths, pairs
from overlapper.viewer.look import BODIES, OVERLAPS, Array, Look, volume_text
from overlapper.viewer.recording import Recording
from overlapper.viewer.stage import Stage, matrix

import meshcat  # isort: skip  # after the stage, which says what to install
from overlapper.viewer.server import Window, must_be_here, serve  # isort: skip

__all__ = ["Recording", "Viewer"]


class Viewer:
    """A live view of a simulation: call `show` after each step.

    A visualizer that is passed in keeps its own camera, lights and background. Without one a meshcat server is started,
    whose address is `url`, the bodies of the first `show` are framed, and `close`, or the end of a `with` block, stops
    the server. It is seen on this machine only, unless `host` is another of its addresses, or "0.0.0.0" for all.
    """

    def __init__(
        self, visualizer: Any = None, bodies: Look = BODIES, overlaps: Look = OVERLAPS, *, host: str = "127.0.0.1"
    ) -> None:
        self._server: Worker | None = None
        self.visualizer = visualizer
        if visualizer is None:
            self._serve(host)
        self._looks = bodies, overlaps
        self._stage: Stage | None = None
        self._shapes: dict[str, bytes] = {}
        self._poses: dict[str, Array] = {}
        self._pairs: set[tuple[str, str]] = set()

    def _serve(self, host: str) -> None:
        must_be_here(host)
        try:
            self._server = Worker(serve)
            self._server.send(host)
            self.visualizer = meshcat.Visualizer(window=Window(*self._server.receive(START_LIMIT)))
        except Ended as ended:
            raise NotStarted(f"the live view has no server: its process {ended}") from None

    @property
    def url(self) -> str:
        """Where a browser finds it."""
        return str(self.visualizer.url())

    def show(self, bodies: Bodies, contacts: Iterable[Contact]) -> None:
        """Draw the bodies where they are now and the overlapping pairs among `contacts`, in place of what was there."""
        contacts = list(contacts)
        if self._stage is None:
            framing = Framing(bodies)
            self._stage = Stage(framing, *self._looks)
            if self._server:
                framing.see(bodies, contacts)
                self._stage.set(self.visualizer, framing.whole())  # what will move is not known yet
        self._show_bodies(self._stage, bodies)
        self._show_overlaps(self._stage, pairs(bodies, contacts))

    def _show_bodies(self, stage: Stage, bodies: Bodies) -> None:
        paths, colors = body_paths(bodies), bodies.colors
        for path in self._shapes.keys() - set(paths):
            self.visualizer[path].delete()
            del self._shapes[path], self._poses[path]
        for path, key, placed in zip(paths, bodies.keys, bodies.placed, strict=True):
            shape = pickle.dumps(placed.shape)
            if self._shapes.get(path) != shape:
                self.visualizer[path].set_object(stage.body(placed, colors[key[:2]]))
                self._shapes[path] = shape
            pose = matrix(placed)
            if not np.array_equal(self._poses.get(path, ()), pose):
                self.visualizer[path].set_transform(pose)
                self._poses[path] = pose

    def _show_overlaps(self, stage: Stage, overlaps: Mapping[tuple[str, str], Overlap]) -> None:
        for pair in self._pairs:
            self.visualizer[_path(pair)].delete()
        for pair, overlap in overlaps.items():
            self.visualizer[f"{_path(pair)}/{volume_text(overlap.volume)}"].set_object(stage.overlap(overlap))
        self._pairs = set(overlaps)

    def close(self) -> None:
        """Stop the server, if this view started it."""
        if self._server and not self.visualizer.window.zmq_socket.closed:
            self.visualizer.window.zmq_socket.close()
            self._server.close()

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _path(pair: tuple[str, str]) -> str:
    return f"/overlapper/overlaps/{pair[0]}-{pair[1]}"
