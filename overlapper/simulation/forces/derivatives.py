"""Derivatives of a step with volumetric contact."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from overlapper.simulation.forces.forces import Forces
from overlapper.simulation.model import Array

REASONS = {
    "opening": "the pressure is at zero, so the contact opens or closes",
    "cone": "the friction is at its limit and the contact does not slip",
    "rolling": "the rolling resistance is at its limit and the contact does not roll",
    "edge": "the centre of pressure is at the edge of the patch",
    "impact": "the approach is at the speed or the depth where a bounce begins",
    "tipping": "whether the contact keeps its place as the bodies turn is at a limit, or unknown as they do not turn",
    "carrier": "both bodies turn equally fast, so neither carries the other around",
    "shared": "bodies could share the forces of several patches in other ways, so only the sum has a derivative",
}


@dataclass(frozen=True)
class Kink:
    """A contact whose law has a kink at the solution. Derivatives on the two sides differ.

    Parameters
    ----------
    row : int
        The row of the contact in `Forces`.
    pair : tuple of int
        (bodyA, linkA, shapeA, bodyB, linkB, shapeB).
    reason : str
        'opening', 'cone', 'rolling', 'edge', 'impact', 'tipping', 'carrier' or 'shared'.
    """

    row: int
    pair: tuple[int, ...]
    reason: str

    def __str__(self) -> str:
        a, b = self.pair[:2], self.pair[3:5]
        return f"{a} and {b}: {REASONS[self.reason]}"


@dataclass(frozen=True, eq=False, repr=False)
class StepDerivatives:
    """The derivatives of a substep with volumetric contact: what `VolumetricContact.derivatives` returns.

    They are derivatives of the velocities at the end of the substep, and of the contact forces. They follow from the
    equations of the contacts at their solution (implicit differentiation), and are right to rounding. Central
    differences of steps agree to 1e-6.

    There are n coordinates: those of the velocities. A base has its linear velocity at its centre of mass and its
    angular velocity, both in the world. The joints of its links follow. Poses have the same n coordinates, as small
    motions from the pose: a translation in m and a rotation vector in rad about the centre of mass for a base, both in
    the world, and the position of each joint. There are p contacts, the rows of `forces`. A matrix has a row for each
    result and a column for each cause. A contact has the force on the first of the pair in N, then the
    torque on it in N m about `Forces.centre`, in the world. The centre moves with the poses.

    These are held: the acceleration by all other forces such as gravity, the length of the substep, whether a contact
    is damped as one that swings too fast, and what the solver remembers of the substep before.

    Parameters
    ----------
    forces : Forces
        The contact forces of the substep.
    coordinates : list of tuple
        Body, link and name of each coordinate. The names are 'x', 'y', 'z', 'rx', 'ry', 'rz' for a base. They are
        'joint' for a joint with one coordinate, and 'rx', 'ry', 'rz' for a spherical joint, about the axes of its link.
    velocity : (n,) ndarray
        The velocities at the end of the substep, m/s and rad/s.
    kinks : list of Kink
        The contacts whose laws are not smooth here. The derivatives are then those of one side. It is empty if all
        derivatives exist. Where bodies stick to several others, some causes would tear them apart: those columns are
        NaN.
    velocity_by_velocity : (n, n) ndarray
        The velocities at the end by those at the beginning.
    velocity_by_force : (n, n) ndarray
        The velocities at the end by external forces and torques on the coordinates during the substep.
    velocity_by_stiffness : (n, p) ndarray
        The velocities at the end by the stiffness of each contact.
    velocity_by_friction : (n, p) ndarray
        The velocities at the end by the coefficient of friction of each contact.
    contact_by_velocity : (p, 6, n) ndarray
        The contacts by the velocities at the beginning.
    contact_by_force : (p, 6, n) ndarray
        The contacts by external forces and torques on the coordinates.
    contact_by_stiffness : (p, 6, p) ndarray
        The contacts by the stiffness of each contact.
    contact_by_friction : (p, 6, p) ndarray
        The contacts by the coefficient of friction of each contact.
    moved : (ndarray, ndarray)
        The poses (n, n) at the end by those at the beginning and by the velocities at the end. A held base stays.
    by_pose : (ndarray, ndarray) or str
        The matrices `velocity_by_pose` and `contact_by_pose`, or a sentence that tells why they are not known.
    """

    forces: Forces
    coordinates: list[tuple[int, int, str]]
    velocity: Array
    kinks: list[Kink]
    velocity_by_velocity: Array
    velocity_by_force: Array
    velocity_by_stiffness: Array
    velocity_by_friction: Array
    contact_by_velocity: Array
    contact_by_force: Array
    contact_by_stiffness: Array
    contact_by_friction: Array
    moved: tuple[Array, Array] = field(repr=False)
    by_pose: tuple[Array, Array] | str = field(repr=False)

    @property
    def velocity_by_pose(self) -> Array:
        """(n, n) the velocities at the end by the poses at the beginning.

        Raises
        ------
        ValueError
            If derivatives by poses are not known for a contact. The message names it. They are known for boxes, hulls
            and half-spaces, and for a ball on a half-space.
        """
        return self._by_pose()[0]

    @property
    def contact_by_pose(self) -> Array:
        """(p, 6, n) the contacts by the poses at the beginning.

        Raises
        ------
        ValueError
            As for `velocity_by_pose`.
        """
        return self._by_pose()[1]

    @property
    def A(self) -> Array:
        """(2n, 2n) poses and velocities at the end by those at the beginning, as A of `mjd_transitionFD`.

        Poses move on by the velocities at the end.

        Raises
        ------
        ValueError
            As for `velocity_by_pose`.
        """
        kept, moved = self.moved
        by_pose, by_velocity = self.velocity_by_pose, self.velocity_by_velocity
        return np.block([[kept + moved @ by_pose, moved @ by_velocity], [by_pose, by_velocity]])

    @property
    def B(self) -> Array:
        """(2n, n) poses and velocities at the end by forces on the coordinates, as B of `mjd_transitionFD`."""
        return np.concatenate([self.moved[1] @ self.velocity_by_force, self.velocity_by_force])

    def _by_pose(self) -> tuple[Array, Array]:
        if isinstance(self.by_pose, str):
            raise ValueError(self.by_pose)
        return self.by_pose

    def __repr__(self) -> str:
        kinks = f"{len(self.kinks)} kinks" if self.kinks else "smooth"
        return f"StepDerivatives({len(self.coordinates)} coordinates, {len(self.forces)} contacts, {kinks})"
