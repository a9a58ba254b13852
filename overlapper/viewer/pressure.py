"""Forces as they are drawn: pressures as colours, and an arrow for each pair of links.

A pressure is stiffness times the extent of the overlap along the direction of the pressures, with the hardening of the
contact. The colours are viridis.
Differences of colour are in proportion to differences of value, for colour-blind readers, too. Higher pressures are
lighter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from overlapper import Overlap
from overlapper.shapes.drawing import polytope_edges, triangles
from overlapper.viewer.framing import Framing
from overlapper.viewer.labels import DrawnBodies, DrawnContact, Key, LinkName, key_of, labelled
from overlapper.viewer.look import Array, channels, to_draw

COLORS = ("#440154", "#472d7b", "#3b528b", "#2c728e", "#21908c", "#27ad81", "#5dc863", "#aadc32", "#fde725")
FORCE = (1.00, 1.00, 1.00)  # arrows: no pressure has this colour
FRICTION = (1.00, 0.42, 0.21)
STEP = 1 / 25  # of the scale: a triangle is cut in four if its pressures differ by more
HALVINGS = 4  # the most times that the sides of a triangle are halved
RIM = 0.01  # of the way to the middle: pressures of a facet are taken so far within its rim, where they may jump to 0
ALONG = 1e-6  # the sine of the least angle between a facet and the pressures by which the facet ends a depth


class Forces(Protocol):
    """Forces between pairs of shapes, a row for each pair, in SI units and in the world frame."""

    @property
    def pairs(self) -> NDArray[np.int64]: ...
    @property
    def force(self) -> Array: ...
    @property
    def torque(self) -> Array: ...
    @property
    def energy(self) -> Array: ...
    @property
    def slip(self) -> Array: ...
    @property
    def normal(self) -> Array: ...
    @property
    def stiffness(self) -> Array: ...
    @property
    def hardening(self) -> Array: ...


@dataclass(frozen=True)
class Press:
    """The `force` (3,) on the first of a pair in N, and its torque, energy, slip and stiffness in N m, J, m/s and Pa/m.

    `hardening` is in 1/m. `normal` (3,) is the unit direction of the pressures. Friction is the force across it.
    """

    force: Array
    torque: float
    energy: float
    slip: float
    normal: Array
    stiffness: float
    hardening: float = 0.0

    @property
    def friction(self) -> Array:
        across: Array = self.force - (self.force @ self.normal) * self.normal
        return across

    def pressure(self, depth: Any) -> Any:
        """The pressures in Pa at these depths in m."""
        return self.stiffness * depth * (1 + self.hardening * depth)


def presses(forces: Forces | None) -> dict[Key, Press]:
    """The press of each pair of shapes; empty for None."""
    if forces is None:
        return {}
    torque, slip = (np.linalg.norm(each, axis=1) for each in (forces.torque, forces.slip))
    return {
        tuple(key): Press(forces.force[row], torque[row], forces.energy[row], slip[row], forces.normal[row], *laws)
        for row, (key, *laws) in enumerate(
            zip(forces.pairs.tolist(), forces.stiffness.tolist(), forces.hardening.tolist(), strict=True)
        )
    }


def depths(overlap: Overlap, normal: Array, points: Array) -> Array:
    """The extent (...) of the overlap, m, along the normal through points (..., 3) in it or on it."""
    planes = overlap.halfspaces
    slopes = planes[:, :3] @ normal
    room = np.maximum(-(points @ planes[:, :3].T + planes[:, 3]), 0)
    ends = np.abs(slopes) > ALONG
    ways = room[..., ends] / np.abs(slopes[ends])
    sides = [np.where(side, ways, np.inf).min(axis=-1, initial=np.inf) for side in (slopes[ends] > 0, slopes[ends] < 0)]
    found: Array = sides[0] + sides[1]
    return found


def deepest(overlap: Overlap, normal: Array) -> float:
    """The largest depth, m, at corners, middles of edges and facets, and the centroid."""
    corners, edges = overlap.vertices, overlap.vertices[polytope_edges(overlap.facets)].mean(axis=1)
    middles = [corners[ring].mean(axis=0) for ring in overlap.facets]
    points = np.concatenate([corners, edges, middles, [overlap.centroid]])
    return float(depths(overlap, normal, points).max())


def pressures(overlap: Overlap, press: Press, top: float) -> tuple[Array, Array]:
    """Triangles (k, 3, 3) of the surface, and the pressures (k, 3) at their corners, Pa.

    Pressures within a triangle differ by a small part of `top`.
    """
    corners = overlap.vertices[triangles(overlap.facets)]
    middles = np.array([overlap.vertices[ring].mean(axis=0) for ring in overlap.facets])
    facet = np.repeat(np.arange(len(middles)), [len(ring) - 2 for ring in overlap.facets])
    done = []
    for halving in range(HALVINGS + 1):
        points = np.concatenate([corners, corners.mean(axis=1, keepdims=True)], axis=1)
        within = points + RIM * (middles[facet][:, None] - points)
        found = press.pressure(depths(overlap, press.normal, within))
        even = (np.ptp(np.minimum(found, top), axis=1) <= STEP * top) | (halving == HALVINGS)
        done.append((corners[even], found[even, :3]))
        corners, facet = corners[~even], np.tile(facet[~even], 4)
        halves = (corners + np.roll(corners, -1, axis=1)) / 2
        outer = [np.stack([corners[:, k], halves[:, k], halves[:, k - 1]], axis=1) for k in range(3)]
        corners = np.concatenate([*outer, halves])
    return np.concatenate([each for each, _ in done]), np.concatenate([each for _, each in done])


def colors(pressure: Array, top: float) -> Array:
    """The colours (..., 3) of pressures (...); `top` and more have the last colour."""
    places = np.linspace(0, 1, len(COLORS))
    stops = np.array([channels(color) for color in COLORS])
    return np.stack([np.interp(pressure / top, places, stops[:, part]) for part in range(3)], axis=-1)


def usual(values: Sequence[float], weights: Sequence[float]) -> float:
    """The value below which four fifths of the weights lie; 0 without weights. A few large values have no effect."""
    if not len(values) or not sum(weights):
        return 0.0
    order = np.argsort(values)
    below = np.cumsum(np.asarray(weights)[order])
    return float(np.asarray(values)[order][np.searchsorted(below, 0.8 * below[-1] * (1 - 1e-12))])


def rounded_up(value: float, digits: Sequence[float] = (1, 1.5, 2, 3, 4, 5, 6, 8, 10)) -> float:
    """The value rounded up to one of these digits times a power of ten."""
    if not value > 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * next(each for each in digits if each * power >= value * (1 - 1e-9)))


@dataclass(frozen=True)
class Scale:
    """Arrows: `length` m stand for `force` N. The last colour stands for `top` Pa."""

    length: float
    force: float
    top: float

    @classmethod
    def of(cls, force: float, top: float, length: float) -> Scale:
        """The scale by which an arrow of that force has about that length, m, and at least half of it."""
        unit = 10.0 ** np.floor(np.log10(length))
        return cls(float(unit), rounded_up(force * unit / length, range(1, 11)), rounded_up(top))

    def suits(self, force: float, top: float, length: float) -> bool:
        """True if usual forces and pressures are neither too large nor too small for it, or there are none."""
        drawn = force * self.length / self.force
        return not force or (length / 6 <= drawn <= 1.5 * length and self.top / 12 <= top <= 1.5 * self.top)

    def arrow(self, force: Array) -> Array:
        """The arrow of a force, m."""
        return force * (self.length / self.force)

    def __str__(self) -> str:
        return f"{_in_unit(self.length, LENGTHS)} = {_in_unit(self.force, NEWTONS)}"

    @property
    def pressure(self) -> str:
        """The pressure of the last colour, in words."""
        return _in_unit(self.top, PASCALS)


def usual_force(some: Sequence[Arrow]) -> float:
    forces = [float(np.linalg.norm(each.force)) for each in some]
    return usual(forces, forces)


@dataclass(frozen=True)
class DrawnForces:
    """The forces of a frame as they are drawn: by pair of shapes, by pair of links, and the scale of both."""

    pressed: Mapping[Key, Press]
    arrows: Sequence[Arrow]
    scale: Scale

    @classmethod
    def of(
        cls,
        bodies: DrawnBodies,
        contacts: Sequence[DrawnContact],
        forces: Forces | None,
        length: float,
        framing: Framing,
        before: Scale | None = None,
    ) -> DrawnForces:
        """The forces with usual arrows about as long as `length`, m. The scale `before` is kept as long as it suits."""
        pressed = presses(forces)
        found = arrows(bodies, contacts, pressed, framing.pushed_second) if pressed else []
        overlapping = [each for each in contacts if each.overlap and key_of(each) in pressed]
        tops = [
            press.pressure(deepest(to_draw(each.overlap, framing.size), press.normal))
            for each in overlapping
            for press in [pressed[key_of(each)]]
        ]
        top = usual(tops, [float(np.linalg.norm(pressed[key_of(each)].force)) for each in overlapping])
        force = usual_force(found)
        fits = before is not None and before.suits(force, top, length)
        return cls(pressed, found, before if before is not None and fits else Scale.of(force, top, length))


LENGTHS = ((1e-3, "mm"), (1e-2, "cm"), (1.0, "m"))
NEWTONS = ((1e-6, "µN"), (1e-3, "mN"), (1.0, "N"), (1e3, "kN"), (1e6, "MN"))
PASCALS = ((1.0, "Pa"), (1e3, "kPa"), (1e6, "MPa"), (1e9, "GPa"))


def _in_unit(value: float, units: Sequence[tuple[float, str]]) -> str:
    unit, name = next((each for each in reversed(units) if value >= each[0] * (1 - 1e-9)), units[0])
    return f"{value / unit:.3g} {name}"


def force_text(force: float) -> str:
    return _in_unit(force, NEWTONS)


@dataclass(frozen=True)
class Arrow:
    """The sum of the forces between two links on one of them, and of their friction, in N; `start` (3,) is in m."""

    links: tuple[LinkName, LinkName]
    start: Array
    force: Array
    friction: Array


def arrows(
    bodies: DrawnBodies,
    contacts: Iterable[DrawnContact],
    pressed: Mapping[Key, Press],
    on_second: Callable[[DrawnContact], bool] = lambda contact: False,
) -> list[Arrow]:
    """An arrow for each pair of links, from the mean of its overlaps weighted by force; on the first or second."""
    sums: dict[tuple[LinkName, LinkName], Arrow] = {}
    weights: dict[tuple[LinkName, LinkName], float] = {}
    for _, links, contact in labelled(bodies, contacts):
        press = pressed.get(key_of(contact))
        weight = float(np.linalg.norm(press.force)) if press else 0.0
        if press is None or not weight:
            continue
        sign = -1.0 if on_second(contact) else 1.0
        before = sums.get(links, Arrow(links, np.zeros(3), np.zeros(3), np.zeros(3)))
        total = weights[links] = weights.get(links, 0.0) + weight
        sums[links] = replace(
            before,
            start=before.start + (np.asarray(contact.overlap.centroid) - before.start) * (weight / total),
            force=before.force + sign * press.force,
            friction=before.friction + sign * press.friction,
        )
    return list(sums.values())
