"""The constraints of a pybullet client between links, as `ContactSolver.solve` takes them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pybullet

from overlapper.simulation.bullet.calls import Arguments
from overlapper.simulation.bullet.commands import DEFAULT_MAX_FORCE
from overlapper.simulation.model import Array, LinkKey

# By pybullet's numbers of kinds: the number that `ContactSolver.solve` knows the kind by.
KINDS = {pybullet.JOINT_POINT2POINT: 0, pybullet.JOINT_FIXED: 1, pybullet.JOINT_PRISMATIC: 2}
WORLD = -1  # for a body, and for its place


class Told(NamedTuple):
    """The answer of getConstraintInfo, without what gears have."""

    parent: int
    parent_link: int
    child: int
    child_link: int
    kind: int
    axis: tuple[float, ...]
    pivot_in_parent: tuple[float, ...]
    pivot_in_child: tuple[float, ...]
    frame_in_parent: tuple[float, ...]
    frame_in_child: tuple[float, ...]
    force: float


def constraints(
    client: int, place: Mapping[LinkKey, int], changes: Mapping[Any, Arguments], error_reduction: float, length: float
) -> Array:
    """Return the `constraints` of `ContactSolver.solve` for a step of `length` (s).

    `place` is the place of each link in the solver. `changes` are the arguments of changeConstraint by constraint, as
    far as they are known. A step reduces errors of position by the fraction `error_reduction`. Constraints of other
    bodies and of other kinds have no row.
    """
    rows = []
    for k in range(pybullet.getNumConstraints(client)):
        key = pybullet.getConstraintUniqueId(k, client)
        told = Told(*pybullet.getConstraintInfo(key, client)[: len(Told._fields)])
        links = (told.parent, told.parent_link), (told.child, told.child_link)
        places = [WORLD if each[0] == WORLD else place.get(each) for each in links]
        if told.kind not in KINDS or None in places:
            continue
        # If no force was set, pybullet reports the default, which it keeps as an impulse.
        unset = told.force == DEFAULT_MAX_FORCE and "maxForce" not in changes.get(key, {})
        limit = told.force / length if unset else told.force
        frames = told.pivot_in_parent, told.frame_in_parent, told.pivot_in_child, told.frame_in_child, told.axis
        numbers = [number for each in frames for number in each]
        rows.append((key, KINDS[told.kind], *places, *numbers, error_reduction / length, limit))
    return np.array(rows, dtype=float).reshape(-1, 23)
