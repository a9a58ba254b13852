"""The forces on bodies that do not come from contacts. pybullet does not tell them: velocities do."""

from __future__ import annotations

from overlapper.simulation.model import Array


class LearntForces:
    """See `OtherForces`: the last acceleration of all coordinates, found from the change of their velocities."""

    def __init__(self, gravity: Array) -> None:
        """Begin with `gravity`, the acceleration that is known before anything has moved."""
        self._acceleration = gravity
        self._before: tuple[Array, float, Array] | None = None  # velocity, duration and our part of the acceleration
        self._left: Array | None = None  # the velocity that the last step left

    def ahead(self, velocity: Array, duration: float) -> Array:
        """Return the velocity after a duration (s), if it keeps changing as it did."""
        if self._before:
            before, length, _ = self._before
            return velocity + duration / length * (velocity - before)
        return velocity + duration * self._acceleration

    def learnt(self, velocity: Array) -> Array:
        """Return the acceleration by everything except contacts, now that the coordinates have this velocity."""
        # It is told by how velocities have changed, unless somebody has set them since.
        if self._before and (self._left is None or (self._left == velocity).all()):
            before, length, ours = self._before
            # After forces() nothing may have moved; a body that rests to the last bit tells nothing new.
            if not (before == velocity).all():
                self._acceleration = (velocity - before) / length - ours
        return self._acceleration

    def solved(self, velocity: Array, duration: float, ours: Array) -> None:
        """Record that from this velocity on, contacts accelerate the coordinates by `ours` for a duration (s)."""
        self._before, self._left = (velocity, duration, ours), None

    def left_at(self, velocity: Array) -> None:
        """Record that a step has ended with this velocity."""
        self._left = velocity
