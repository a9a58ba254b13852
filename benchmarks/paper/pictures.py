"""One picture for each step at which the article's method loses an overlap, each of a case that does fail there."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import exact
import numpy as np
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from harness import figures
from harness.figures import INK, plt
from overlapper import Hull
from paper.steps import MINIMAL_STEP, SAME_VERTEX, SHIFTS, about_centroid, common_point, dual, polar_vertices

BODY, WRONG = "#4f83b5", "#c8553d"
GROUP_COLOURS = ["#c8553d", "#4f83b5", "#f4a259", "#5b8e7d", "#8c5e99", "#bc4b51", "#3d5a80", "#8a817c"]


class Magnified:
    """The common part in its own principal axes, each stretched to the same length: a sliver becomes a body."""

    def __init__(self, common: exact.Polytope) -> None:
        self.centre = common.centroid
        offsets = self.offsets(map(exact.coordinates, common.vertices))
        self.axes = np.linalg.svd(offsets, full_matrices=False)[2]
        self.extents = np.abs(offsets @ self.axes.T).max(0)

    def offsets(self, points) -> np.ndarray:
        """From the centroid; subtracted before anything is rounded."""
        return np.array([exact.subtract(exact.vector(p), self.centre) for p in points], float)

    def __call__(self, points) -> np.ndarray:
        return self.offsets(points) @ self.axes.T / self.extents


def stage(title: str) -> tuple[plt.Figure, Axes3D]:
    figure = plt.figure(figsize=(5.4, 4.0))
    ax = figure.add_subplot(projection="3d")
    ax.set_axis_off()
    ax.set_box_aspect((1, 1, 1), zoom=1.4)
    ax.view_init(elev=14, azim=-62)
    figure.text(0.03, 0.96, title, fontsize=9.5, fontweight="bold", va="top", color=INK)
    return figure, ax


def finish(figure: plt.Figure, ax: Axes3D, reach: float, caption: str, path: Path) -> None:
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach), zlim=(-reach, reach))
    figure.text(0.03, 0.03, caption, fontsize=8, color=INK, va="bottom", linespacing=1.4)
    figure.subplots_adjust(left=0, right=1, bottom=0.08, top=0.98)
    save(figure, path)


def save(figure: plt.Figure, path: Path) -> None:
    """With 64 colours, which is all that flat charts need, and a third of the size."""
    figures.save(figure, path, 180, 64)


def solid(ax: Axes3D, rings: list[np.ndarray], colour: str, alpha: float = 0.25) -> None:
    ax.add_collection3d(Poly3DCollection(rings, facecolor=colour, edgecolor=colour, alpha=alpha, linewidths=0.8))


def rings_of(part: exact.Polytope, frame: Magnified) -> list[np.ndarray]:
    return [frame(map(exact.coordinates, facet.ring)) for facet in part.facets]


def steps_in_thicknesses(bodies: Sequence[np.ndarray], common: exact.Polytope) -> float:
    """The minimal step of the 26 shifts, in half thicknesses of what is common."""
    return MINIMAL_STEP * min(np.ptp(body, axis=0).max() for body in bodies) / Magnified(common).extents[2]


def draw_shifts(bodies: Sequence[np.ndarray], common: exact.Polytope, path: Path) -> None:
    frame = Magnified(common)
    reference = (bodies[0].min(0) + bodies[0].max(0)) / 2
    point = common_point(*(Hull(body - reference).vertices for body in bodies))
    step = MINIMAL_STEP * min(np.ptp(body, axis=0).max() for body in bodies)
    start = frame([exact.add(exact.vector(point), exact.vector(reference))])[0]
    ends = np.array([start + frame.axes @ (step * d) / frame.extents for d in SHIFTS])
    figure, ax = stage("The 26 shifts: none of them ends inside")
    solid(ax, rings_of(common, frame), BODY)
    ax.add_collection3d(Line3DCollection([[start, end] for end in ends], colors=WRONG, linewidths=0.7, alpha=0.5))
    ax.scatter(*ends.T, color=WRONG, s=9, depthshade=False)
    ax.scatter(*start, color=INK, s=30, depthshade=False)
    caption = (
        f"Blue: what is common, {2 * frame.extents[2]:.1e} thick, stretched to be seen. Black: GJK's common point,\n"
        f"on the boundary. Red: where the shifts of {step:.1e} lead."
    )
    finish(figure, ax, 1.05 * max(1.0, np.abs(ends).max()), caption, path)


def draw_planes(bodies: Sequence[np.ndarray], common: exact.Polytope, path: Path) -> None:
    frame = Magnified(common)
    planes, point = about_centroid(bodies, common)
    corner = exact.add(exact.vector(point), exact.vector((bodies[0].min(0) + bodies[0].max(0)) / 2))
    vertices = polar_vertices([dual(plane, point) for plane in planes.tolist()])
    rounded = exact.hull(exact.add(v, corner) for v in vertices)
    figure, ax = stage("Rounded planes: another polytope, before any dual is taken")
    solid(ax, rings_of(common, frame), BODY)
    outlines = [np.vstack([ring, ring[:1]]) for ring in rings_of(rounded, frame)]
    ax.add_collection3d(Line3DCollection(outlines, colors=WRONG, linewidths=1.4))
    off = float(abs(rounded.volume - common.volume) / common.volume)
    size = max(float(np.ptp(body, axis=0).max()) for body in bodies)
    caption = (
        f"Blue: what is common, {2 * frame.extents[2]:.1e} thick, stretched; the larger body measures {size:.1e}.\n"
        f"Red: the exact intersection of the bodies' planes in doubles; its volume is off by {off:.0e}."
    )
    finish(figure, ax, 1.05 * max(1.0, max(np.abs(o).max() for o in outlines)), caption, path)


def draw_coplanar(bodies: Sequence[np.ndarray], common: exact.Polytope, path: Path) -> None:
    planes, point = about_centroid(bodies, common)
    duals = exact.hull(planes[:, :3] / -(planes @ np.append(point, 1))[:, None])
    vertices = np.array(polar_vertices(map(exact.coordinates, duals.vertices)), float)
    same = SAME_VERTEX * np.ptp(vertices, axis=0).max()
    group = [int(np.argmax(np.linalg.norm(vertices - v, axis=1) <= same)) for v in vertices]
    several = [g for g in dict.fromkeys(group) if group.count(g) > 1]
    frame = Magnified(duals)
    figure, ax = stage("Coplanar duals: one vertex comes out several times")
    colours = dict(zip(several, GROUP_COLOURS * len(several)))
    for name, ring in zip(group, rings_of(exact.hull(map(exact.coordinates, duals.vertices)), frame)):
        solid(ax, [ring], colours.get(name, "#cccccc"), 0.75 if name in colours else 0.12)
    most = max((group.count(g) for g in several), default=1)
    caption = (
        f"The hull of the {len(duals.vertices)} dual points that matter, stretched. Facets of one colour are coplanar\n"
        f"but for rounding: {most} of them are one vertex of the intersection, rounded {most} times."
    )
    finish(figure, ax, 1.05, caption, path)


PICTURES = {"shifts": draw_shifts, "planes": draw_planes, "coplanar": draw_coplanar}
