"""Tactile images: how the force of each contact is spread over the taxels of a pad."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from overlapper import Overlap, Overlaps, Placed, overlap
from overlapper.quaternion import rotated
from overlapper.simulation.contacts import Contacts
from overlapper.simulation.forces.cells import moments, whole
from overlapper.simulation.forces.pads import Pad
from overlapper.simulation.layout import Pose
from overlapper.simulation.model import Array, LinkKey

# Radii of gyration of a patch that are smaller, over the larger one, squared, count as none.
NARROW = 1e-12


@dataclass(frozen=True, eq=False)
class TactileImage:
    """Pressure and shear on the taxels of a pad, in SI units.

    Parameters
    ----------
    force : (..., 3) ndarray
        In N, in world coordinates. It acts on the link within each taxel.
    pressure : (...) ndarray
        In Pa. The mean pressure on each taxel: its force against its normal over its area.
    shear : (..., 2) ndarray
        In Pa. The mean shear on each taxel, along its x axis and its y axis.
    outside : (3,) ndarray
        In N, in world coordinates. The force on the link that no taxel feels.
    """

    force: Array
    pressure: Array
    shear: Array
    outside: Array

    def __repr__(self) -> str:
        shape, felt = self.pressure.shape, np.linalg.norm(self.force.reshape(-1, 3).sum(axis=0))
        return f"TactileImage({shape}, {felt:.3g} N felt, {np.linalg.norm(self.outside):.3g} N outside)"


def image(
    contacts: Contacts,
    force: Array,
    torque: Array,
    normal: Array,
    frame: Pose,
    link: LinkKey,
    pad: Pad,
    tolerance: float,
) -> TactileImage:
    """Return the image of the contacts of a `link` on its `pad`.

    `force`, `torque` and `normal` (p, 3) are those of the rows of `contacts`. `frame` is that of the link at the time
    of the contacts. Round bodies count as polytopes within this `tolerance` of their common volume.
    """
    felt, total = np.zeros((int(np.prod(pad.shape)), 3)), np.zeros(3)
    position, orientation = (np.array(each, dtype=float) for each in frame[:2])
    turn = rotated(orientation, np.eye(3))  # rows are the axes of the link in the world
    for first, sign in ((0, 1.0), (3, -1.0)):
        for row in np.flatnonzero((contacts.keys[:, first : first + 2] == link).all(axis=1)).tolist():
            total += sign * force[row]
            if contacts.overlaps.status[row] == Overlaps.OVERLAPPING:
                wrench = sign * force[row] @ turn.T, sign * torque[row] @ turn.T
                away = -sign * normal[row] @ turn.T
                _add(felt, pad, contacts.overlaps[row], away, wrench, position, turn, tolerance)
    axes = pad.axes.reshape(-1, 3, 3)
    traction = np.einsum("ijk,ik->ij", axes, felt) / pad.areas.reshape(-1, 1)
    world = felt @ turn
    return TactileImage(
        world.reshape(*pad.shape, 3),
        -traction[:, 2].reshape(pad.shape),
        traction[:, :2].reshape(*pad.shape, 2),
        total - world.sum(axis=0),
    )


def _add(
    felt: Array,
    pad: Pad,
    found: Overlap,
    away: Array,
    wrench: tuple[Array, Array],
    position: Array,
    turn: Array,
    tolerance: float,
) -> None:
    """Add the force of a contact within each taxel to `felt` (n, 3), all in axes of the link.

    `away` is the direction from which the link is pressed. The traction along a line of this direction is the depth
    times a linear function of the place. There is one such function with the force and the torque of the contact.
    """
    centroid = found.centroid
    assert centroid is not None
    # Near the origin, the corners keep more digits of a shallow depth.
    moved = [Placed(each.shape, each.position - centroid, each.orientation) for each in found.shapes]
    here = overlap(*moved, tolerance=tolerance)
    if not here:
        return
    x = np.cross(away, np.eye(3)[np.argmin(np.abs(away))])
    x /= np.linalg.norm(x)
    sight = np.stack([x, np.cross(away, x), away])
    seen, cells = pad.cells(sight)
    cells = cells - sight[:2] @ (turn @ (centroid - position))
    surface = (here.vertices @ turn.T @ sight.T)[here.faces]
    volume, *middle = whole(surface)
    depths = moments(surface, cells)
    about = (depths[:, 1:] - depths[:, :1] * np.array(middle) / volume) / volume
    force, torque = (sight @ each for each in wrench)
    inertia = sight @ turn @ here.inertia @ turn.T @ sight.T / here.volume
    second = (np.trace(inertia) / 2 * np.eye(3) - inertia)[:2, :2]
    tipping = np.linalg.pinv(second, rcond=NARROW, hermitian=True) @ [-torque[1], torque[0]]
    spin = torque[2] / np.trace(second)
    each = depths[:, :1] / volume * force
    each[:, 2] += about @ tipping
    each[:, :2] += spin * np.stack([-about[:, 1], about[:, 0]], axis=1)
    np.add.at(felt, seen, each @ sight)
