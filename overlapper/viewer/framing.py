"""Cameras that show moving and overlapping bodies, from the side where most of the main overlap is seen.

The main overlap is the largest of two moving bodies, as of a hand and what it holds. If there is none, it is the
largest of a moving body, and else the largest of all.

Half-spaces, and bodies of one link that are far larger than all others, are grounds. No view is made to fit a ground.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from overlapper import Overlap, Placed
from overlapper.shapes.drawing import triangles
from overlapper.viewer.labels import DrawnBodies, DrawnContact, key_of
from overlapper.viewer.look import FIELD_OF_VIEW, Array
from overlapper.viewer.tessellation import bounded

GROUND = 30.0  # a ground is this many times larger than all other bodies: pybullet's plane, if these are under 9 m.
BACK = np.array([0.60, -0.68, 0.42]) / np.linalg.norm([0.60, -0.68, 0.42])  # the usual way to the camera
TURNS = np.deg2rad([0, 30, -30, 60, -60, 90, -90, 120, -120, 150, -150, 180])  # of BACK about z
NOWHERE = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
STILL = 1e-3  # of the scene's size: smaller motions are ignored
LARGEST = 8.0  # over the smaller of the two links that overlap: the size of the opening view, so that both are seen


@dataclass(frozen=True)
class View:
    """A camera looks at the point `at`, m, from the unit direction `back`. It sees the boxes `framed`, each (2, 3)."""

    at: Array
    back: Array
    framed: Sequence[Array]

    @classmethod
    def of(cls, framed: Sequence[Array], back: Array = BACK) -> View:
        """The view of boxes, each (2, 3): lower and upper corner."""
        return cls(around(framed).mean(axis=0), back, framed)

    def distance(self, aspect: float = 4 / 3) -> float:
        """The distance, m, from which all that is framed is seen; `aspect` is the picture's width over its height."""
        corners = np.array(self.framed)
        corners = np.array([corners[:, list(pick), range(3)] for pick in np.ndindex(2, 2, 2)]).reshape(-1, 3) - self.at
        right = np.array([-self.back[1], self.back[0], 0.0]) / np.hypot(self.back[0], self.back[1])
        slope = np.tan(np.deg2rad(FIELD_OF_VIEW) / 2)
        aside = np.maximum(np.abs(corners @ np.cross(self.back, right)), np.abs(corners @ right) / aspect)
        return float(1.15 * np.max(aside / slope + corners @ self.back))


@dataclass(frozen=True)
class _Met:
    """The largest overlap of two bodies, and the shapes of all bodies but grounds at its moment."""

    overlap: Overlap
    moment: int
    links: tuple[tuple[int, int], tuple[int, int]]  # body and link of each of the two
    shapes: tuple[list[tuple[int, int, int]], Array]  # body, link and shape; the boxes (n, 2, 3) around them, m


class Framing:
    """The views of all moments seen so far. The first moment defines which bodies are grounds, and the scene's size.

    `center` and `size` are those of the box around all bodies but grounds, m.
    """

    def __init__(self, bodies: DrawnBodies) -> None:
        self._ground_size = _ground_size(bodies)
        box = around([box for _, box in self._bounded(bodies)])
        self.center, self.size = box.mean(axis=0), float(np.linalg.norm(box[1] - box[0]))
        self._moments = 0
        self._first: dict[tuple[int, int, int], Array] = {}  # the boxes of shapes when they were first seen
        self._largest: dict[frozenset[int], _Met] = {}  # of each pair of bodies
        self._moved: set[int] = set()
        self._met: set[int] = set()
        self._shared: dict[tuple[int, ...], Array] = {}

    @property
    def main(self) -> Overlap | None:
        """The main overlap so far."""
        found = self._main()
        return found.overlap if found else None

    @property
    def moment(self) -> int:
        """The number of the moment of the main overlap, counted from 0; -1 if there is no overlap."""
        found = self._main()
        return found.moment if found else -1

    def _main(self) -> _Met | None:
        def rank(pair: frozenset[int]) -> tuple[int, float]:
            return len(pair & self._moved), self._largest[pair].overlap.volume

        return self._largest[max(self._largest, key=rank)] if self._largest else None

    def is_ground(self, placed: Placed) -> bool:
        """True for a half-space, and for a shape as large as a body that is a ground."""
        return not bounded(placed.shape) or _extent(placed.bounds) >= self._ground_size

    def pushed_second(self, contact: DrawnContact) -> bool:
        """True if a force is drawn on the second body: the first is a ground, or rests while the second moves."""
        if self.is_ground(contact.overlap.shapes[0]):
            return True
        return contact.bodyA not in self._moved and contact.bodyB in self._moved

    def see(self, bodies: DrawnBodies, contacts: Iterable[DrawnContact]) -> None:
        """Add a moment: the bodies where they are now, and their contacts."""
        bounded = self._bounded(bodies)
        for key, box in bounded:
            if np.abs(box - self._first.setdefault(key, box)).max() > STILL * self.size:
                self._moved.add(key[0])
        shapes = [key for key, _ in bounded], np.array([box for _, box in bounded]).reshape(-1, 2, 3)
        for each in contacts:
            if not each.overlap:
                continue
            box = np.asarray(each.overlap.bounds)
            if _extent(box) >= self._ground_size:
                continue  # both are grounds
            pair = key_of(each)
            self._met |= {each.bodyA, each.bodyB}
            self._shared[pair] = around([self._shared.get(pair, box), box])
            both = frozenset((each.bodyA, each.bodyB))
            if both not in self._largest or each.overlap.volume > self._largest[both].overlap.volume:
                links = (each.bodyA, each.linkA), (each.bodyB, each.linkB)
                self._largest[both] = _Met(each.overlap, self._moments, links, shapes)
        self._moments += 1

    def opening(self) -> View:
        """The view of moving and overlapping bodies, near enough that the bodies of the main overlap are seen."""
        framed, main = self._moving(), self._main()
        if main:
            keys, boxes = main.shapes
            of_links = [[box for key, box in zip(keys, boxes) if key[:2] == link] for link in main.links]
            sizes = [_extent(around(each)) for each in of_links if each]
            half = LARGEST * min(sizes, default=np.inf) / (2 * np.sqrt(3))
            low, high = np.asarray(main.overlap.centroid) + [[-half], [half]]
            framed = [np.clip(box, low, high) for box in framed if (box[0] <= high).all() and (low <= box[1]).all()]
        return View.of(framed, self.side())

    def moving(self) -> View:
        """The view of all moving and overlapping bodies. If nothing moves, the view of the overlapping bodies."""
        return View.of(self._moving(), self.side())

    def _moving(self) -> list[Array]:
        if self._moved:
            boxes = [box for key, box in self._first.items() if key[0] in self._moved]
            # The moving bodies of the main overlap are framed at its moment, too.
            if main := self._main():
                there = {body for body, _ in main.links} & self._moved
                boxes += [box for key, box in zip(*main.shapes) if key[0] in there]
        else:
            boxes = [box for key, box in self._first.items() if key[0] in self._met]
        return [*boxes, *self._shared.values()] or self._all()

    def whole(self) -> View:
        """The view of all bodies except grounds."""
        return View.of([*self._all(), *self._shared.values()], self.side())

    def _all(self) -> list[Array]:
        return list(self._first.values()) or [NOWHERE]

    def side(self) -> Array:
        """The direction to the side from which the main overlap is seen best."""
        main = self._main()
        return _side(main.overlap, main.shapes[1]) if main else BACK

    def _bounded(self, bodies: DrawnBodies) -> list[tuple[tuple[int, int, int], Array]]:
        """The shapes of all bodies that are not grounds, and the boxes around them."""
        boxes = _boxes(bodies)
        sizes = _sizes(boxes)
        return [(key, box) for key, box in boxes if sizes[key[0]] < self._ground_size]


def around(boxes: Sequence[Array]) -> Array:
    """The box (2, 3) around boxes; a box about the origin if there are no boxes."""
    corners = np.array(boxes or [NOWHERE])
    return np.array([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])


def _boxes(bodies: DrawnBodies) -> list[tuple[tuple[int, int, int], Array]]:
    return [
        (key, np.asarray(placed.bounds))
        for key, placed in zip(bodies.keys, bodies.placed, strict=True)
        if bounded(placed.shape)
    ]


def _sizes(boxes: Iterable[tuple[tuple[int, int, int], Array]]) -> dict[int, float]:
    """The size of each body, m."""
    of_body: dict[int, list[Array]] = defaultdict(list)
    for key, box in boxes:
        of_body[key[0]].append(box)
    return {body: _extent(around(each)) for body, each in of_body.items()}


def _ground_size(bodies: DrawnBodies) -> float:
    """The size, m, from which a body is a ground: one link, and GROUND times larger than all smaller bodies."""
    jointed = {body for body, link, _ in bodies.keys if link >= 0}
    sizes = sorted(((size, body) for body, size in _sizes(_boxes(bodies)).items()), reverse=True)
    found = np.inf
    for (size, body), (smaller, _) in pairwise(sizes):
        if body in jointed:
            break
        if size >= GROUND * smaller > 0:
            found = size
    return float(found)


def _extent(box: Array) -> float:
    return float(np.linalg.norm(box[1] - box[0]))


def _side(overlap: Overlap, boxes: Array) -> Array:
    """The direction from which most of the overlap's surface is seen, and few boxes are in front of it."""
    corners = overlap.vertices[triangles(overlap.facets)]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    centroid = np.asarray(overlap.centroid)
    lower, upper = (boxes[:, k] - centroid for k in (0, 1))
    elsewhere = ((lower > 0) | (upper < 0)).any(axis=1)
    best: Array = BACK
    most = -1.0
    for rank, turn in enumerate(TURNS):
        cos, sin = np.cos(turn), np.sin(turn)
        back = np.array([cos * BACK[0] - sin * BACK[1], sin * BACK[0] + cos * BACK[1], BACK[2]])
        enters, leaves = (np.sort([lower / back, upper / back], axis=0)[k] for k in (0, 1))
        in_front = elsewhere & (enters.max(axis=1) < leaves.min(axis=1)) & (leaves.min(axis=1) > 0)
        # Another side is chosen only if it is clearly better than the usual one.
        seen = np.abs(areas @ back).sum() * 0.8 ** in_front.sum() * (1 - 0.02 * rank)
        if seen > most:
            best, most = back, float(seen)
    return best
