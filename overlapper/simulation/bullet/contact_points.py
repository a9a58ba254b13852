"""pybullet's contact points between links, where no overlap is found."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import pybullet
from numpy.typing import NDArray

from overlapper.shapes.table import facts
from overlapper.simulation.collision_rules import Mask
from overlapper.simulation.contacts import Contacts
from overlapper.simulation.layout import Layout
from overlapper.simulation.model import LinkKey

DISTANCE = 8  # of a contact point


def links_in_contact_with_each_other(client: int, body: int) -> tuple[int, int] | None:
    """Two links of a body between which Bullet has a contact point, -1 for the base; None if there are none."""
    points = pybullet.getContactPoints(body, body, physicsClientId=client)
    return (points[0][3], points[0][4]) if points else None


def touching_within_margins(
    client: int, found: Contacts, layout: Layout, chosen: Callable[[NDArray[np.int32]], Mask]
) -> int:
    """The number of `chosen` pairs of links, one with a hull, that touch in Bullet but are not in `found`.

    Bullet lays a margin around hulls, and its contact points lie on the surfaces with margins. They are from its last
    collision detection.
    """
    links = _touching(client) - {((a, la), (b, lb)) for a, la, _, b, lb, _ in found.keys.tolist()}
    starts = np.searchsorted(layout.colliders, np.arange(len(layout.collider_rows) + 1))
    widened = [facts(shape).bullet_margin for shape in layout.shapes]
    pairs: list[tuple[int, int]] = []
    number: list[int] = []  # for each pair of shapes: the index of its pair of links
    for k, (a, b) in enumerate(links):
        if a in layout.collider_rows and b in layout.collider_rows:
            first, second = (
                range(starts[row], starts[row + 1]) for row in map(layout.collider_rows.__getitem__, (a, b))
            )
            some = [(i, j) for i, j in product(first, second) if widened[i] or widened[j]]
            pairs += some
            number += [k] * len(some)
    asked = chosen(np.array(pairs, dtype=np.int32).reshape(-1, 2))
    return len(np.unique(np.array(number, dtype=int)[asked]))


def _touching(client: int) -> set[tuple[LinkKey, LinkKey]]:
    """The pairs of links that touch at a contact point of Bullet, the lesser first."""
    points = pybullet.getContactPoints(physicsClientId=client)
    pairs = (sorted([(each[1], each[3]), (each[2], each[4])]) for each in points if each[DISTANCE] <= 0)
    return {(first, second) for first, second in pairs}
