"""The warnings of volumetric contact, each given once for a pair of links."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from overlapper.simulation.bodies import AnyBodies
from overlapper.simulation.cautions import (
    DepthWarning,
    NoDirectionWarning,
    NoStepWarning,
    SkippedShapeWarning,
    SubstepsWarning,
    UnsettledWarning,
)
from overlapper.simulation.contacts import Contacts
from overlapper.simulation.model import Array, LinkKey

# A contact that stays deep for longer, in s, is worth a warning.
LASTING = 0.1

# A larger residual of the solver is worth a warning.
SETTLED = 1e-8


class Told:
    """The pairs of links and the bodies that users were already warned of.

    Warnings name the line that calls the caller's caller, or a line that is `further` calls away.
    """

    further = 0

    def __init__(self, bodies: AnyBodies) -> None:
        self._bodies = bodies
        self._known: set[tuple[type[Warning], LinkKey, LinkKey]] = set()
        self._lost: set[int] = set()
        self._unsettled = False
        self._deep: dict[tuple[int, ...], float] = {}  # for how long

    def of_substeps(
        self, contacts: Contacts, damped: NDArray[np.bool_], frequency2: Array, duration: float, substeps: int
    ) -> None:
        """Warn of the `damped` rows: `substeps` of this `duration` (s) are too few for their frequencies."""
        for row, a, b in self._new(SubstepsWarning, contacts, damped):
            frequency = math.sqrt(frequency2[row])
            needed = math.ceil(frequency * duration * max(1, substeps))
            warnings.warn(
                f"{substeps} substeps are too few for the stiffness between {a} and {b}, which oscillate at up to "
                f"{frequency:.0f} rad/s: with fewer than {needed} substeps, their contact loses energy",
                SubstepsWarning,
                stacklevel=4 + self.further,
            )

    def of_depth(
        self, contacts: Contacts, deep: NDArray[np.bool_], depths: Array, sizes: Array, duration: float
    ) -> None:
        """Warn of rows that stay `deep`, with their mean depths and the sizes of their smaller links in m.

        `duration` (s) is that of the step.
        """
        if not self._deep and not deep.any():
            return
        keys = [tuple(contacts.keys[row].tolist()) for row in np.flatnonzero(deep).tolist()]
        self._deep = {key: self._deep.get(key, 0.0) + duration for key in keys}
        stays = deep.copy()
        stays[deep] = [self._deep[key] > LASTING for key in keys]
        for row, a, b in self._new(DepthWarning, contacts, stays):
            warnings.warn(
                f"{a} and {b} stay {depths[row]:.2g} m deep in each other on average, and the smaller one measures "
                f"{sizes[row]:.2g} m: the stiffness is too small for their force",
                DepthWarning,
                stacklevel=4 + self.further,
            )

    def of_direction(self, contacts: Contacts, lost: NDArray[np.bool_]) -> None:
        """Warn of the rows that have `lost` their direction."""
        for _, a, b in self._new(NoDirectionWarning, contacts, lost):
            warnings.warn(
                f"{a} and {b} overlap without a direction of force, because one lies within the other "
                "or goes through it; the force keeps its last direction",
                NoDirectionWarning,
                stacklevel=4 + self.further,
            )

    def of_residual(self, residual: float, sweeps: int) -> None:
        """Warn once of forces that are not `SETTLED`."""
        if residual > SETTLED and not self._unsettled:
            self._unsettled = True
            warnings.warn(
                f"contact forces are inaccurate in some steps: the solver ended after {sweeps} sweeps, while slips "
                f"still changed by {residual:.1e} of the largest slip; `residual` has this number for each step",
                UnsettledWarning,
                stacklevel=4 + self.further,
            )

    def of_velocity(self, lost: Iterable[int]) -> None:
        """Warn of the `lost` bodies, which have no finite velocity."""
        for body in sorted(set(lost) - self._lost):
            self._lost.add(body)
            link, name = next((link, name) for (id, link), name in sorted(self._bodies.names.items()) if id == body)
            warnings.warn(
                f"{name} (body {body}, link {link}) has no contacts, because its velocity is not finite: "
                "the simulation has diverged",
                SkippedShapeWarning,
                stacklevel=4 + self.further,
            )

    def of_no_step(self, positions: Array, orientations: Array) -> None:
        """Warn of a `with` block without a step, if shapes are no longer where they were at its beginning."""
        try:
            self._bodies.update()
        except ValueError:
            return  # the simulation has ended
        now = self._bodies.positions, self._bodies.orientations
        if not all(map(np.array_equal, now, (positions, orientations))):
            warnings.warn(
                "VolumetricContact made no step within its `with`, although bodies have moved: a step is not noticed "
                "if its function was imported by name before, as in `from pybullet import stepSimulation`",
                NoStepWarning,
                stacklevel=3,
            )

    def _new(self, kind: type[Warning], contacts: Contacts, rows: NDArray[np.bool_]) -> Iterator[tuple[int, str, str]]:
        """Yield the rows whose pairs were not warned of yet, with the names of their links."""
        names = self._bodies.names
        for row in np.flatnonzero(rows).tolist():
            a, la, _, b, lb, _ = contacts.keys[row].tolist()
            if (kind, (a, la), (b, lb)) not in self._known:
                self._known.add((kind, (a, la), (b, lb)))
                yield row, names[a, la], names[b, lb]
