"""The measures of a task: one row of numbers to plot."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from overlapper.simulation.links import LinkContact
from overlapper.tables.summary import Links, PairSummary, note_skipped, overlapping_links

if TYPE_CHECKING:
    from overlapper.simulation.model import Skipped
    from overlapper.tables.frame import Frame
    from overlapper.tables.table import Value

# The number of links with shapes that were left out in any step, and the number of bodies that had no finite pose, each
# with the name of the first; and the step at which the first body had no finite pose.
LEFT_OUT: dict[str, type] = {
    "skipped": int,
    "first_skipped": str,
    "diverged": int,
    "first_diverged": str,
    "diverged_step": int,
}

# The measures, in order, with their types; the unit is in the name. The worst pair is the pair with the largest volume.
# The columns of the worst pair and of the deepest pair are empty if nothing overlaps.
MEASURES: dict[str, type] = {
    "steps": int,
    "time_s": float,
    "contact_time_s": float,
    **LEFT_OUT,
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

# The columns of volumetric contact: the largest force between two links.
FORCES: dict[str, type] = {"largest_force_n": float, "hardest_step": int, "hardestA": str, "hardestB": str}


@dataclass(slots=True)
class _Pair(PairSummary):
    """The summary of two links up to the current step, with the sum of their wrenches."""

    wrench: NDArray[np.float64] = field(default_factory=lambda: np.zeros(6))

    def add(self, step: int, pair: LinkContact, force: float = 0.0) -> None:
        PairSummary.add(self, step, pair, force)  # super() does not work in a dataclass with slots
        self.wrench += unit_wrench(pair)


def unit_wrench(pair: LinkContact) -> NDArray[np.float64]:
    """(6,) force and torque on the first of two overlapping links at an energy of one joule per m³ of common volume.

    This equals a pressure of one pascal on the second link's surface within the first. The force, in N/Pa = m², is
    the vector area of this surface, from the second to the first. The torque, in Nm/Pa = m³, is about the origin of the
    world.
    """
    about = pair.overlap.about
    assert about is not None
    gradient = pair.gradient[0]
    force = -gradient[:3]
    return np.concatenate([force, np.cross(about, force) - gradient[3:]])


class Measures:
    """Measures the frames of a run one by one. Volumes are of whole links, as in the summary of a run."""

    def __init__(self) -> None:
        self._steps, self._time, self._contact = 0, 0.0, 0.0
        self._volume = 0.0
        self._pairs: dict[Links, _Pair] = {}
        self._left_out: dict[Skipped, int] = {}

    def add(self, frame: Frame[Any]) -> None:
        """Add the next step."""
        passed, self._time = frame.time - self._time, frame.time
        self._steps += 1
        note_skipped(self._left_out, frame)
        touched = False
        for links, pair, force in overlapping_links(frame):
            names = frame.bodies.names
            known = self._pairs.setdefault(links, _Pair((names[links[:2]], names[links[2:]])))
            known.add(frame.step, pair, force)
            self._volume += pair.volume
            touched = True
        if touched:
            self._contact += passed

    def row(self) -> dict[str, Value]:
        """The columns of MEASURES and of FORCES."""
        row: dict[str, Value] = {
            "steps": self._steps,
            "time_s": self._time,
            "contact_time_s": self._contact,
            **self._not_looked_at(),
            "mean_volume_m3": self._volume / max(self._steps, 1),
            "largest_volume_m3": 0.0,
            "largest_volume_error_m3": 0.0,
            "largest_depth_m": 0.0,
            "largest_force_n": 0.0,
        }
        if self._pairs:
            worst = max(self._pairs.values(), key=lambda pair: pair.volume)
            row |= {"largest_volume_m3": worst.volume, "largest_volume_error_m3": worst.volume_error}
            row |= {"worst_step": worst.volume_step, "worstA": worst.names[0], "worstB": worst.names[1]}
            wrench = (worst.wrench / self._steps).tolist()
            row |= dict(zip((name for name in MEASURES if name.startswith(("mean_force", "mean_torque"))), wrench))
            deepest = max(self._pairs.values(), key=lambda pair: pair.depth)
            row |= {"largest_depth_m": deepest.depth, "deepest_step": deepest.depth_step}
            row |= {"deepestA": deepest.names[0], "deepestB": deepest.names[1]}
            hardest = max(self._pairs.values(), key=lambda pair: pair.force)
            if hardest.force:
                row |= {"largest_force_n": hardest.force, "hardest_step": hardest.force_step}
                row |= {"hardestA": hardest.names[0], "hardestB": hardest.names[1]}
        return row

    def _not_looked_at(self) -> dict[str, Value]:
        """The columns of LEFT_OUT."""
        skipped, diverged = (
            [(each.name, step) for each, step in self._left_out.items() if each.diverged == which]
            for which in (False, True)
        )
        row: dict[str, Value] = {"skipped": len(skipped), "diverged": len(diverged)}
        if skipped:
            row["first_skipped"] = skipped[0][0]
        if diverged:
            row |= {"first_diverged": diverged[0][0], "diverged_step": diverged[0][1]}
        return row
