"""Central differences of a step with volumetric contact, by the solver of the core at neighbouring arguments."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from overlapper import Batch
from overlapper.simulation import StepDerivatives, VolumetricContact
from overlapper.simulation.forces.trees import trees

CAUSES = {"velocity": 1e-5, "force": 1e-4, "stiffness": 1e-5, "friction": 1e-5, "pose": 1e-7}  # and steps


@dataclass
class Resolved:
    """The step that `contact.forces()` solves, to be solved again with other arguments."""

    contact: VolumetricContact
    solver: Any
    derivatives: StepDerivatives

    @classmethod
    def of(cls, contact: VolumetricContact) -> Resolved:
        solver = contact._masses.dynamics.solver.copy()
        contact.forces()
        return cls(contact, solver, contact.derivatives())

    def solved(self, cause: str = "", which: int = 0, step: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Velocities (n,) at the end and contacts (p, 6). The stiffness is changed by a part of itself."""
        masses, duration, velocity, other, damped, _ = self.contact._solved
        found = self.contact.last.contacts.overlaps
        frames = [(np.array(frame[0]), np.array(frame[1])) for frame in self.contact._frames]
        laws = {name: np.array(values) for name, values in masses.laws(found).items()}
        velocity, other = velocity.copy(), other.copy()
        bodies = trees(masses.dynamics.tree(), *(np.array(each) for each in zip(*frames)))
        moved = next((each for each in bodies if each.span.start <= which < each.span.stop), None)
        if cause == "velocity":
            velocity[which] += step
        elif cause == "stiffness":
            laws["stiffness"][which] *= 1 + step
        elif cause == "friction":
            laws["friction"][which] += step
        elif cause == "force":
            other[moved.span] += step * moved.inverse_mass[:, which - moved.first]
        elif cause == "pose":
            along = np.zeros(moved.coordinates)
            along[which - moved.first] = step
            positions = np.array(self.contact.bodies.positions)
            orientations = np.array(self.contact.bodies.orientations)
            for link, motion in zip(moved.rows, moved.mean_motion(1.0, along)[0]):
                turn, (centre, orientation) = Rotation.from_rotvec(motion[3:]), frames[link]
                for shape in np.flatnonzero(masses.of_shapes == link):
                    positions[shape] = centre + motion[:3] + turn.apply(positions[shape] - centre)
                    orientations[shape] = (turn * Rotation.from_quat(orientations[shape])).as_quat()
                frames[link] = centre + motion[:3], (turn * Rotation.from_quat(orientation)).as_quat()
            found = Batch(self.contact.bodies.shapes).overlaps(positions, orientations, found.pairs)
        solver = self.solver.copy()
        solver.place(frames, found, masses.of_shapes, **laws)
        force, torque, *_, ours, _, _ = solver.solve(duration, velocity, other, damped, False, settled=1e-15)
        return velocity + duration * (other + ours), np.concatenate([force, torque], axis=1)

    def difference(self, cause: str, which: int) -> list[np.ndarray]:
        """The velocities (n,) and the contacts (p, 6) by one of a cause."""
        step = CAUSES[cause]
        ahead, behind = (self.solved(cause, which, sign * step) for sign in (1, -1))
        width = 2 * step * (self.contact.last.stiffness[which] if cause == "stiffness" else 1)
        return [(one - two) / width for one, two in zip(ahead, behind)]

    def differences(self, cause: str) -> tuple[np.ndarray, np.ndarray]:
        """The velocities (n, m) and the contacts (p, 6, m) by a cause."""
        of_contacts = cause in ("stiffness", "friction")
        count = len(self.contact.last) if of_contacts else len(self.derivatives.coordinates)
        columns = [self.difference(cause, which) for which in range(count)]
        return tuple(np.stack(each, axis=-1) for each in zip(*columns))

    def error(self, cause: str) -> float:
        """The largest error of a derivative by a cause, over the largest derivative by it."""
        errors = []
        for name, found in zip(("velocity", "contact"), self.differences(cause)):
            derived = getattr(self.derivatives, f"{name}_by_{cause}")
            assert derived.shape == found.shape
            errors.append(np.abs(derived - found).max(initial=0) / (np.abs(found).max(initial=0) or 1))
        return max(errors)
