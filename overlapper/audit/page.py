"""The page of an audit: one frame for each pair of links that overlaps, with its worst pose."""

from __future__ import annotations

import colorsys
from dataclasses import dataclass
from pathlib import Path

from overlapper import Placed
from overlapper.audit.audit import Audit, PairAudit
from overlapper.audit.kinematics import Array, Kinematics
from overlapper.audit.robot import Robot, shape_keys

Color = tuple[float, float, float, float]

MOST = 100  # the most poses of a page, so that it opens quickly

SHARED = "#ff4fa3"  # a colour that the links do not have


def shown(audit: Audit) -> list[PairAudit]:
    """The pairs that a page shows, the largest volume first: all pairs that overlap and are not adjacent."""
    met = [each for each in audit.pairs if each.largest and not each.pair.adjacent]
    return sorted(met, key=_volume, reverse=True)[:MOST]


def addresses(audit: Audit, path: Path) -> dict[tuple[int, int], str]:
    """For each pair of links, the link that opens the page at its pose."""
    return {each.pair.links: f"{path.name}#t={frame}" for frame, each in enumerate(shown(audit))}


def write_page(audit: Audit, path: Path) -> None:
    """Write a page with the pose of the largest volume of each pair, or the rest pose if no pair overlaps.

    ImportError without meshcat.
    """
    from overlapper.viewer import Look, Recording

    recording = Recording(overlaps=Look(edges=False, front=SHARED, back=SHARED))
    scene = _Scene(audit.robot)
    for frame, each in enumerate(shown(audit)):
        assert each.largest
        recording.add(scene.at(each.largest.values), each.largest.contact.contacts, float(frame), _caption(each))
    if not shown(audit):
        recording.add(scene.at(audit.sampling.configuration(0)), [], 0.0, "at rest; no links overlap")
    recording.save(path)


def _volume(audited: PairAudit) -> float:
    return audited.largest.contact.volume if audited.largest else 0.0


def _caption(audited: PairAudit) -> str:
    often = f", {audited.fraction[0]:.2%}" if audited.fraction else ""
    return f"{' and '.join(audited.names)}{often}"


@dataclass(frozen=True, slots=True)
class _DrawnRobot:
    """The bodies in the form that views take."""

    keys: list[tuple[int, int, int]]
    placed: list[Placed]
    colors: dict[tuple[int, int], Color]
    names: dict[tuple[int, int], str]
    labels: dict[int, str]


class _Scene:
    """A robot to be drawn in one pose after another, each link in its own colour."""

    def __init__(self, robot: Robot) -> None:
        self._kinematics = Kinematics(robot)
        self._shapes = [each.shape for each in robot.tree.shapes]
        self._keys = [(body, link, shape) for body, link, shape in shape_keys(robot).tolist()]
        links = sorted({key[:2] for key in self._keys})
        # Hues a golden ratio apart stay distinct however many links there are.
        self._colors = {link: (*colorsys.hsv_to_rgb(0.618034 * k % 1, 0.35, 0.85), 1.0) for k, link in enumerate(links)}
        self._labels = dict(enumerate(robot.tree.bodies))
        self._names = {(body, link): robot.link_names[link] for body, link in links}

    def at(self, values: Array) -> _DrawnRobot:
        (positions,), (orientations,) = self._kinematics.poses(values[None])
        placed = [Placed(*each) for each in zip(self._shapes, positions, orientations)]
        return _DrawnRobot(self._keys, placed, self._colors, self._names, self._labels)
