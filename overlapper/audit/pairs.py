"""The pairs of links of a robot that are tested, and how joints connect them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

from overlapper.audit.robot import Robot


@dataclass(frozen=True, slots=True)
class LinkPair:
    """Two links of a body with shapes, by their indices, the smaller index first.

    The links are `adjacent` if a joint connects them, or a chain of joints and links without shapes. They are `rigid`
    if no joint between them can be moved.
    """

    links: tuple[int, int]
    adjacent: bool
    rigid: bool


def link_pairs(robot: Robot) -> list[LinkPair]:
    """All pairs of links that have shapes, sorted."""
    shaped = {shape.link for shape in robot.tree.shapes}
    touching = _neighbours(robot)
    drivers = {link: robot.drivers(link) for link in shaped}
    return [
        LinkPair((a, b), b in touching[a], drivers[a] == drivers[b])
        for a, b in combinations(sorted(shaped), 2)
        if robot.tree.links[a].body == robot.tree.links[b].body
    ]


def _neighbours(robot: Robot) -> dict[int, set[int]]:
    """The adjacent links of each link. All neighbours of a link without a shape are adjacent to each other."""
    links = robot.tree.links
    shaped = {shape.link for shape in robot.tree.shapes} | {i for i, link in enumerate(links) if link.skipped}
    near: dict[int, set[int]] = {place: set() for place in range(len(links))}
    for place, link in enumerate(links):
        if link.parent >= 0:
            near[place].add(link.parent)
            near[link.parent].add(place)
    for place in near:
        if place not in shaped:
            for a in near[place]:
                near[a] = (near[a] | near[place]) - {a, place}
    return near
