"""What a task comes to: one row of the figures that people plot."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from overlapper.simulation.links import LinkContact, link_contacts

if TYPE_CHECKING:
    from overlapper.tables.frame import Frame
    from overlapper.tables.table import Value

# Every measure, in order, with its type; the unit is in the name. The columns of the worst pair, that of the largest
# volume, and of the deepest are empty if nothing overlaps.
MEASURES: dict[str, type] = {
    "steps": int,
    "time_s": float,
    "contact_time_s": float,
    "mean_volume_m3": float,
    "largest_volume_m3": float,
    "largest_volume_error_m3": float,
    "worst_step": int,
    "worstA": str,
    "worstB": str,
    **{f"mean_force_{axis}_m2": float for axis in "xyz"},
    **{f"mean_torque_{axis}_m3": float for axis in "xyz"},
    "largest_depth_m": float,
    "deepest_step": int,
    "deepestA": str,
    "deepestB": str,
}

# What volumetric contact adds: the largest force between two links.
FORCES: dict[str, type] = {"largest_force_n": float, "hardest_step": int, "hardestA": str, "hardestB": str}

Links = tuple[int, int, int, int]


@dataclass(slots=True)
class _Pair:
    """Two links so far: the largest volume, depth and force, each with its step, and the sum of the wrenches."""

    volume: float = 0.0
    volume_error: float = 0.0
    volume_step: int = 0
    depth: float = 0.0
    depth_step: int = 0
    force: float = 0.0
    force_step: int = 0
    wrench: NDArray[np.float64] = field(default_factory=lambda: np.zeros(6))

    def add(self, step: int, pair: LinkContact, force: float) -> None:
        if force > self.force:
            self.force, self.force_step = force, step
        if pair.volume > self.volume:
            self.volume, self.volume_error, self.volume_step = pair.volume, pair.volume_error, step
        if pair.depth > self.depth:
            self.depth, self.depth_step = pair.depth, step
        self.wrench += unit_wrench(pair)


def unit_wrench(pair: LinkContact) -> NDArray[np.float64]:
    """(6,) force and torque on the first of two overlapping links if pushing them into each other took a joule per m³.

    That is one pascal on the surface of the second within the first: the force, in N/Pa = m², is the area of what is
    pushed, as a vector from the second to the first; the torque, in Nm/Pa = m³, is about the origin of the world.
    """
    about = pair.overlap.about
    assert about is not None
    gradient = pair.gradient[0]
    force = -gradient[:3]
    return np.concatenate([force, np.cross(about, force) - gradient[3:]])


class Measures:
    """The frames of a run, taken in one by one. Volumes are of links as a whole, as in the summary of a run."""

    def __init__(self) -> None:
        self._steps, self._time, self._contact = 0, 0.0, 0.0
        self._volume = 0.0
        self._pairs: dict[Links, _Pair] = {}
        self._names: dict[tuple[int, int], str] = {}

    def add(self, frame: Frame[Any]) -> None:
        """Take in the next step."""
        passed, self._time = frame.time - self._time, frame.time
        self._steps += 1
        found = [pair for pair in link_contacts(frame.contacts) if pair]
        if not found:
            return
        self._contact += passed
        self._names |= frame.bodies.names
        between = {} if frame.forces is None else frame.forces.between_links()
        for pair in found:
            links = pair.bodyA, pair.linkA, pair.bodyB, pair.linkB
            self._pairs.setdefault(links, _Pair()).add(frame.step, pair, float(np.linalg.norm(between.get(links, 0.0))))
            self._volume += pair.volume

    def row(self) -> dict[str, Value]:
        """The columns of MEASURES and of FORCES."""
        row: dict[str, Value] = {
            "steps": self._steps,
            "time_s": self._time,
            "contact_time_s": self._contact,
            "mean_volume_m3": self._volume / max(self._steps, 1),
            "largest_volume_m3": 0.0,
            "largest_volume_error_m3": 0.0,
            "largest_depth_m": 0.0,
            "largest_force_n": 0.0,
        }
        if self._pairs:
            links, worst = max(self._pairs.items(), key=lambda item: item[1].volume)
            row |= {"largest_volume_m3": worst.volume, "largest_volume_error_m3": worst.volume_error}
            row |= {"worst_step": worst.volume_step, **self._named("worst", links)}
            wrench = (worst.wrench / self._steps).tolist()
            row |= dict(zip((name for name in MEASURES if name.startswith(("mean_force", "mean_torque"))), wrench))
            links, deepest = max(self._pairs.items(), key=lambda item: item[1].depth)
            row |= {"largest_depth_m": deepest.depth, "deepest_step": deepest.depth_step}
            row |= self._named("deepest", links)
            links, hardest = max(self._pairs.items(), key=lambda item: item[1].force)
            if hardest.force:
                row |= {"largest_force_n": hardest.force, "hardest_step": hardest.force_step}
                row |= self._named("hardest", links)
        return row

    def _named(self, word: str, links: Links) -> dict[str, Value]:
        return {f"{word}A": self._names[links[:2]], f"{word}B": self._names[links[2:]]}
