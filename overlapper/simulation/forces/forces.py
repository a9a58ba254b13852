"""The forces between bodies that share volumes, as arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from overlapper import Overlaps
from overlapper.columns import FORCE_COLUMNS, FORCE_MEASURES, Columns, Tabular
from overlapper.simulation.contacts import Contacts
from overlapper.simulation.forces.energy import energies
from overlapper.simulation.forces.pads import Pad
from overlapper.simulation.forces.tactile import TactileImage, image
from overlapper.simulation.layout import Pose
from overlapper.simulation.model import Array, LinkKey
from overlapper.simulation.settings import Asking

# There is no patch where the area vector is less than this part of the surface of what is shared, as to the solver.
NO_PATCH = 1e-6


@dataclass(frozen=True, eq=False)
class Forces(Tabular):
    """Forces between overlapping pairs of shapes, a row for each pair, in SI units and world coordinates.

    As a table, by `to_pandas()`, `to_arrow()` and `to_polars()`, they have the columns of `contacts` and the columns
    that volumetric contact adds to `overlapper run`.

    Parameters
    ----------
    contacts : Contacts
        The overlaps of the pairs.
    force : (p, 3) ndarray
        In N. It acts on the first of each pair at `centre`. The opposite force acts on the second.
    torque : (p, 3) ndarray
        In N m. It acts on the first about `centre`. The opposite torque acts on the second. It comes from pressures
        that change and from friction that resists spinning.
    slip : (p, 3) ndarray
        In m/s. The velocity of the first over the second at `centre`, along the patch, at the end of the step.
    normal : (p, 3) ndarray
        The direction of the pressures: a unit vector from the second to the first.
    directed : (p,) ndarray of bool
        False where the overlap has no direction. `normal` is then the last known one.
    stiffness : (p,) ndarray
        In Pa/m.
    hardening : (p,) ndarray
        In 1/m. See `VolumetricContact`.
    frame : callable
        Returns position and quaternion xyzw of the frame of a link (body, link), at the time of the contacts.
    residual : float, default 0
        How much a slip would still change if each pair was solved again by itself, as a fraction of the largest slip
        without forces or with them. Each group of bodies that touch each other has its own largest slip. The residual
        is that of the worst group. It is at most 1e-8 if the forces are settled. In a mean, it is the largest of all
        substeps.
    """

    contacts: Contacts
    force: Array
    torque: Array
    slip: Array
    normal: Array
    directed: NDArray[np.bool_]
    stiffness: Array
    hardening: Array
    frame: Callable[[LinkKey], Pose]
    residual: float = 0.0

    @property
    def pairs(self) -> NDArray[np.int64]:
        """(p, 6) integers bodyA, linkA, shapeA, bodyB, linkB, shapeB of each row."""
        return self.contacts.keys

    @property
    def centre(self) -> Array:
        """(p, 3) the centroid of the common volume in m.

        The force goes through this point. For pairs that touch, it is not a number.
        """
        centroid: Array = self.contacts.overlaps.centroid
        return centroid

    @cached_property
    def energy(self) -> Array:
        """(p,) the energy in J that the pressures store.

        It is half of stiffness times the square of the depth, integrated over the patch. It is computed when it is
        first asked for. For a pair with a half-space, it follows from the depth of the centroid. A hardening adds its
        part from the second moments of the volume. Otherwise the energy is the work of drawing the two apart along the
        normal, computed from 16 volumes for each pair.
        """
        return energies(self.contacts.overlaps, self.normal, self.stiffness, self.hardening)

    def on(self, body: int, link: int | None = None) -> tuple[Array, Array]:
        """Force and torque on a body or on a link of it, from all pairs.

        Forces between links of one body cancel, unless one link is given.

        Parameters
        ----------
        body : int
            The number of the body.
        link : int, optional
            The number of the link, -1 for the base. Default: the whole body.

        Returns
        -------
        force : (3,) ndarray
            The force in N, in world coordinates.
        torque : (3,) ndarray
            The torque about the world's origin in N m.

        Raises
        ------
        ValueError
            If there is no such body or link.
        """
        self._check(body, link)
        force, moment = np.zeros(3), np.zeros(3)
        keys, centre = self.pairs, np.nan_to_num(self.centre)
        for first, sign in ((0, 1.0), (3, -1.0)):
            rows = keys[:, first] == body
            if link is not None:
                rows &= keys[:, first + 1] == link
            force += sign * self.force[rows].sum(axis=0)
            moment += sign * (self.torque[rows] + np.cross(centre[rows], self.force[rows])).sum(axis=0)
        return force, moment

    def pressure(self, link: LinkKey, grid: Pad, tolerance: float = 1e-2) -> TactileImage:
        """The pressure and the shear on the taxels of a pad, as a tactile sensor feels them.

        Each taxel gets the force of the pressures and the friction within its cell, seen along the normal of the
        contact. The forces of all taxels and the force outside add up to the force on the link, to rounding. A contact
        whose pressures do not press against the front of the pad is outside.

        At rest, the pressure at a point is stiffness times the depth, and its integral over each cell is exact for
        polyhedra. In motion, pressure and shear are the depth times linear functions of the place: the only ones with
        the force and the torque of the contact. Where a contact tips fast, pressures at its edge may be negative.

        Parameters
        ----------
        link : (int, int)
            Body and link of the pad, -1 for the base. In MuJoCo: body and geom.
        grid : TaxelGrid or Taxels
            The taxels.
        tolerance : float, default 0.01
            Allowed relative error of the common volume of round bodies, which count as polytopes here. It has no
            influence on the sum of all forces. Polyhedra are exact and ignore it.

        Returns
        -------
        TactileImage
            An entry for each taxel.

        Raises
        ------
        TypeError
            If `grid` is something else.
        ValueError
            If there is no such link, it has no modelled shape, `tolerance` is invalid, or a contact of the link has a
            `hardening`.
        """
        if not isinstance(grid, Pad):
            raise TypeError(f"grid must be a TaxelGrid or Taxels, not {grid!r}")
        if not (isinstance(link, tuple) and len(link) == 2):
            raise ValueError(f"link must be (body, link), not {link!r}")
        self._check(*link)
        Asking(tolerance=tolerance)  # raises for an invalid value
        touching = (self.pairs[:, :2] == link).all(axis=1) | (self.pairs[:, 3:5] == link).all(axis=1)
        if (self.hardening[touching] > 0).any():
            raise ValueError(f"pressure of {link} is known for a hardening of 0 alone, where it is linear in the depth")
        try:
            frame = self.frame(link)
        except KeyError:
            raise ValueError(f"link {link} has no modelled shape") from None
        return image(self.contacts, self.force, self.torque, self.normal, frame, link, grid, tolerance)

    def between_links(self) -> dict[tuple[int, int, int, int], Array]:
        """Forces between links.

        Returns
        -------
        dict
            By (bodyA, linkA, bodyB, linkB): the force (3,) in N on the first link.
        """
        found: dict[tuple[int, int, int, int], Array] = {}
        for (a, la, _, b, lb, _), force in zip(self.pairs.tolist(), self.force):
            found[a, la, b, lb] = found.get((a, la, b, lb), 0.0) + force
        return found

    @cached_property
    def measures(self) -> Array:
        """(p, 10) force, torque, energy and slip, in the order of the columns of `overlapper run`."""
        return np.column_stack([getattr(self, name) for name in FORCE_MEASURES])

    def columns(self) -> Columns:
        """The columns of the table by name.

        Returns
        -------
        dict of str to ndarray or list
            A value for each row.
        """
        return {**self.contacts.columns(), **dict(zip(FORCE_COLUMNS, self.measures.T))}

    def _check(self, body: int, link: int | None) -> None:
        """Raise a ValueError if there is no such body, or no such link of it."""
        known = self.contacts.names
        if not any(id == body for id, _ in known):
            raise ValueError(f"there is no body {body} in the simulation")
        if link is not None and (body, link) not in known:
            raise ValueError(f"body {body} has no link {link}")

    def __len__(self) -> int:
        return len(self.force)

    def __repr__(self) -> str:
        settled = "" if self.residual <= 1e-8 else f", residual {self.residual:.0e}"
        return (
            f"Forces({len(self)} pairs, {np.linalg.norm(self.force, axis=1).max(initial=0.0):.3g} N at most{settled})"
        )


def have_patches(found: Overlaps, sizes: Array) -> NDArray[np.bool_]:
    """Return (p,) whether area vectors of these sizes in m² are more than rounding of the common surface."""
    clear: NDArray[np.bool_] = sizes > NO_PATCH * found.area_bound
    if (clear | (found.area_bound == 0)).all():
        return clear
    return np.asarray(sizes > NO_PATCH * found.area)


def mean(
    contacts: Contacts,
    parts: Sequence[tuple[float, Forces]],
    stiffness: Array,
    hardening: Array,
    area: Array,
    frame: Callable[[LinkKey], Pose],
) -> Forces:
    """Return the mean forces of a step for the overlaps now, with the frames of links now.

    `parts` are the parts of the step: each has its fraction of the step and its forces. `slip` is that of the last
    part. `stiffness` (p,) in Pa/m, `hardening` (p,) in 1/m and the area vectors `area` (p, 3) in m² are those of the
    contacts.
    """
    found = contacts.overlaps
    count = 1 + max(int(each.pairs.max(initial=0)) for each in (found, *(part.contacts.overlaps for _, part in parts)))
    codes = _codes(found, count)
    size = np.linalg.norm(area, axis=1)
    directed = have_patches(found, size) | (found.volume == 0)
    normal: Array = np.array(found.normal)
    patches = directed & (size > 0)
    normal[patches] = area[patches] / size[patches, None]
    force, torque, slip = (np.zeros((len(found), 3)) for _ in range(3))
    for part, forces in parts:
        before = _codes(forces.contacts.overlaps, count)
        _, now, then = np.intersect1d(codes, before, assume_unique=True, return_indices=True)
        force[now] += part * forces.force[then]
        torque[now] += part * forces.torque[then]
        if forces is parts[-1][1]:
            slip[now] = forces.slip[then]
            lost = ~directed[now]
            normal[now[lost]] = forces.normal[then[lost]]
    residual = max((forces.residual for _, forces in parts), default=0.0)
    return Forces(contacts, force, torque, slip, normal, directed, stiffness, hardening, frame, residual)


def _codes(found: Overlaps, count: int) -> NDArray[np.int64]:
    """Return the pair of each row as one number; `count` is larger than all indices of shapes."""
    first, second = found.pairs.T.astype(np.int64)
    return np.asarray(first * count + second)
