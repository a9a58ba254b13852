"""A live view of bodies and their overlaps in meshcat.

Each overlap is drawn after the bodies, so that none of them tints it, with an arrow and a line. The arrow starts at the
centroid and points along `normal`, the direction that pushes the first shape out of the second. The line is the
patch outline. Both shine through everything. The arrow is as long as a fixed part of the scene, so that an overlap of a
millimetre between bodies of a metre is still found. In meshcat's tree the bodies are
`/overlapper/bodies/<body>/<link>/<shape>` and the overlaps `/overlapper/overlaps/<a>-<b>/<volume>`. Where there are
forces, overlaps are coloured by pressure, and arrows are `/overlapper/forces/<scale>/<a>-<b>/<force>`; the scale says
how long arrows are and what the last colour stands for.
"""

from __future__ import annotations

import pickle
from collections.abc import Iterable
from typing import Any

import numpy as np

from overlapper.jobs.worker import START_LIMIT, Ended, NotStarted, Worker
from overlapper.viewer.framing import Framing
from overlapper.viewer.labels import DrawnBodies, DrawnContact, body_paths, in_tree, key_of, labelled, must_be_drawn
from overlapper.viewer.look import BODIES, OVERLAPS, Array, Look, volume_text
from overlapper.viewer.pressure import DrawnForces, Forces, Scale, force_text
from overlapper.viewer.recording import Recording
from overlapper.viewer.stage import Stage, matrix, set_room

import meshcat  # isort: skip  # after the stage, which says what to install
from overlapper.viewer.server import Window, must_be_here, serve  # isort: skip

__all__ = ["Recording", "Viewer"]

FORCES = "/overlapper/forces"


class Viewer:
    """A live view of a simulation: call `show` after each step.

    Without `visualizer`, a meshcat server is started at the address `url`, and the bodies of the first `show` are
    framed. `close`, or the end of a `with` block, stops the server.

    Parameters
    ----------
    visualizer : meshcat.Visualizer, optional
        A visualizer to draw in. It keeps its own camera, lights and background.
    bodies : Look
        How bodies are drawn.
    overlaps : Look
        How overlaps are drawn.
    host : str, default '127.0.0.1'
        Address of this machine for the server. "0.0.0.0" shows the view to the network.
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
        self._framing: Framing | None = None
        self._scale: Scale | None = None
        self._pushing = False  # True while arrows are drawn

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
        """The address for a browser."""
        return str(self.visualizer.url())

    def show(self, bodies: DrawnBodies, contacts: Iterable[DrawnContact], forces: Forces | None = None) -> None:
        """Draw the bodies where they are now, with their overlaps. This replaces the earlier drawing.

        Parameters
        ----------
        bodies : Bodies
            The bodies.
        contacts : iterable of Contact
            Those that overlap are drawn.
        forces : Forces, optional
            Forces to draw.
        """
        must_be_drawn(bodies, contacts)
        contacts = list(contacts)
        if self._stage is None or self._framing is None:
            self._framing = Framing(bodies)
            self._stage = Stage(self._framing, *self._looks)
            if self._server:
                self._framing.see(bodies, contacts)
                set_room(self.visualizer, self._framing.whole())  # nothing has moved yet
        if forces is not None:
            self._framing.see(bodies, contacts)
        drawn = forces if self._looks[1].forces else None
        seen = DrawnForces.of(bodies, contacts, drawn, 0.15 * self._stage.size, self._framing, self._scale)
        self._scale = seen.scale if seen.arrows else self._scale
        self._show_bodies(self._stage, bodies)
        self._show_overlaps(self._stage, bodies, contacts, seen)
        self._show_forces(self._stage, seen)

    def _show_bodies(self, stage: Stage, bodies: DrawnBodies) -> None:
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

    def _show_overlaps(
        self, stage: Stage, bodies: DrawnBodies, contacts: list[DrawnContact], seen: DrawnForces
    ) -> None:
        for pair in self._pairs:
            self.visualizer[_path(pair)].delete()
        self._pairs = set()
        for pair, _, contact in labelled(bodies, contacts):
            drawn = stage.overlap(contact.overlap, seen.pressed.get(key_of(contact)), seen.scale)
            self.visualizer[f"{_path(pair)}/{volume_text(contact.overlap.volume)}"].set_object(drawn)
            self._pairs.add(pair)

    def _show_forces(self, stage: Stage, seen: DrawnForces) -> None:
        if self._pushing:
            self.visualizer[FORCES].delete()
        self._pushing = bool(seen.arrows)
        scale = f"{FORCES}/{seen.scale}, {seen.scale.pressure}"
        for each in seen.arrows:
            pair = "-".join(in_tree(name) for _, name in each.links)
            force = force_text(float(np.linalg.norm(each.force)))
            self.visualizer[f"{scale}/{pair}/{force}"].set_object(stage.force(each, seen.scale))

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
    return f"/overlapper/overlaps/{'-'.join(map(in_tree, pair))}"
