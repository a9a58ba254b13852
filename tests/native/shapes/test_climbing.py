"""Hulls of many facets, on which queries climb from neighbour to neighbour."""

import numpy as np
import pytest
from families import icosphere

from overlapper import HalfSpace, Hull, Placed, distance, overlap


def prism(sides, height=1.0):
    angle = 2 * np.pi * np.arange(sides) / sides
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.vstack([np.column_stack([circle, np.full(sides, z)]) for z in (-height, height)])


def latitudes(bands):
    """A ball by meridians and parallels: slivers crowd at its poles."""
    angles = np.pi * np.arange(bands + 1) / bands
    turns = 2 * np.pi * np.arange(2 * bands) / (2 * bands)
    rings = [
        np.column_stack([np.sin(a) * np.cos(turns), np.sin(a) * np.sin(turns), np.full(2 * bands, np.cos(a))])
        for a in angles[1:-1]
    ]
    return np.vstack([*rings, [[0, 0, 1], [0, 0, -1]]])


def cone(sides):
    """A pole with as many neighbours as the base has corners, which are not evenly spread."""
    return np.vstack([prism(sides, 0.0)[:sides] @ np.diag([1, 1e-2, 1]), [[0.3, 0, 1]]])


def cloud(seed, count, stretch):
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1)[:, None] * stretch


MANY = {
    "icosphere": icosphere(3),
    "prism of 256 sides": prism(256),
    "plate of 256 sides": prism(256, 1e-4),
    "pole slivers": latitudes(32),
    "needle": cloud(1, 500, (1, 1, 1e4)),
    "plate": cloud(2, 500, (1, 1, 1e-4)),
    "ball of points": cloud(3, 700, (1, 1, 1)),
    "two sizes": np.vstack([cloud(4, 300, (1, 1, 1)), cloud(5, 300, (1e-3, 1e-3, 1e-3)) + [0, 0, 1.2]]),
    "cone": cone(300),
    "two cones": np.vstack([cone(300), [[0, 0, -1]]]),
    "flat cone": cone(300) * [1, 1, 1e-9],
    "cone of 5000 sides": cone(5000),
    "moment curve": np.linspace(0, 1, 300)[:, None] ** [1, 2, 3],
    "trigonometric curve": np.array([[np.cos(t), np.sin(t), np.cos(2 * t)] for t in 2 * np.pi * np.arange(900) / 900]),
    "two arcs": np.vstack([[[t, 0, t**2 - 3], [0, t, 3 - t**2]] for t in np.linspace(-1, 1, 800)]),
    "grid on a cube": np.array(list(np.ndindex(7, 7, 7)), float) - 3,
}


@pytest.mark.parametrize("points", MANY.values(), ids=MANY)
def test_climbing_reaches_the_lowest_corner(points):
    hull = Hull(points)
    rng = np.random.default_rng(0)
    corners = np.asarray(hull.vertices)
    normals = np.vstack([rng.normal(size=(100, 3)), np.eye(3), -np.eye(3), rng.choice(corners, 50)])
    for normal in normals / np.linalg.norm(normals, axis=1)[:, None]:
        ground = HalfSpace(normal, -2 * np.abs(corners).max())
        lowest = (corners @ ground.normal).min() - ground.offset
        assert distance(Placed(hull), ground) == pytest.approx(lowest, rel=1e-15)


@pytest.mark.parametrize("points", MANY.values(), ids=MANY)
def test_climbing_finds_the_facets_around_a_smaller_copy(points):
    hull = Hull(points)
    middle = np.asarray(hull.centroid)
    inner = Placed(Hull((np.asarray(hull.vertices) - middle) * 0.75), middle)
    common = overlap(hull, inner)
    assert common.volume == pytest.approx(0.75**3 * hull.volume, rel=1e-9)
    # Pushed out half of the way to its border, it stays inside; twice as far, it does not.
    corner = np.asarray(hull.vertices)[0]
    for share, whole in ((0.12, True), (0.5, False)):
        moved = overlap(hull, Placed(inner.shape, middle + share * (corner - middle)))
        assert (moved.volume == pytest.approx(inner.shape.volume, rel=1e-9)) == whole
