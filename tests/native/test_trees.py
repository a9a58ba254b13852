"""The trees in which the core looks for the few of many, against looking at all of them."""

import ctypes
import subprocess
from pathlib import Path

import numpy as np
import pytest
from families import icosphere
from numpy.ctypeslib import ndpointer
from scipy.spatial import ConvexHull

ROOT = Path(__file__).parents[2]
NATIVE = ROOT / "overlapper" / "native"
SOURCES = [
    ROOT / "tests" / "support" / "trees.cpp",
    *(NATIVE / name for name in ("overlap/dual_tree.cpp", "overlap/plane_tree.cpp", "shapes/facet_tree.cpp")),
]
NUMBERS, INDICES, FLAGS = (ndpointer(kind, flags="C_CONTIGUOUS") for kind in (float, np.int32, np.uint8))


@pytest.fixture(scope="module")
def trees(tmp_path_factory):
    library = tmp_path_factory.mktemp("trees") / "trees.so"
    flags = ["-std=c++20", "-O1", "-ffp-contract=off", "-shared", "-fPIC"]
    subprocess.run(["c++", *flags, "-I", NATIVE, "-o", library, *SOURCES], check=True)
    trees = ctypes.CDLL(str(library))
    trees.make_dual_tree.argtypes, trees.make_dual_tree.restype = [NUMBERS, ctypes.c_int], ctypes.c_void_p
    trees.drop_dual_tree.argtypes = [ctypes.c_void_p]
    trees.reaching.argtypes = [ctypes.c_void_p, NUMBERS, ctypes.c_int, ctypes.c_double, ctypes.c_int, FLAGS]
    trees.misfits.argtypes = [NUMBERS, ctypes.c_int, NUMBERS, ctypes.c_int, ctypes.c_double, NUMBERS]
    trees.make_facet_tree.argtypes = [NUMBERS, ctypes.c_int, NUMBERS, INDICES, INDICES, ctypes.c_int]
    trees.make_facet_tree.restype = ctypes.c_void_p
    trees.drop_facet_tree.argtypes = [ctypes.c_void_p]
    trees.foot.argtypes = [ctypes.c_void_p, NUMBERS, ctypes.c_double, NUMBERS]
    return trees


def circle(count, rng, height=1.0):
    turns = rng.uniform(0, 2 * np.pi, count)
    return np.column_stack([np.cos(turns), np.sin(turns), np.full(count, height)])


def cloud(count, rng):
    return rng.normal(size=(count, 3))


POINTS = {
    "cloud": cloud,
    "ball": lambda n, rng: (p := cloud(n, rng)) / np.linalg.norm(p, axis=1)[:, None],
    "circle": circle,
    "two circles close together": lambda n, rng: np.vstack(
        [circle(n // 2, rng, 0.01), circle(n - n // 2, rng, -0.01) * [1, 0.9, 1] + [0.1, 0, 0]]
    ),
    "line": lambda n, rng: np.outer(rng.normal(size=n), [1, 2, 3]),
    "needle": lambda n, rng: cloud(n, rng) * [1e-6, 1e-9, 1] @ np.linalg.qr(rng.normal(size=(3, 3)))[0],
    "far off": lambda n, rng: cloud(n, rng) * 1e-3 + [5, 6, 7],
    "one point": lambda n, rng: np.tile(rng.normal(size=3), (n, 1)),
    "few points": lambda n, rng: rng.choice(cloud(5, rng), n),
}
RINGS = {
    "triangle": lambda rng: rng.normal(size=(3, 3)),
    "triangle of one size": lambda rng: rng.normal(size=3) + 1e-6 * rng.normal(size=(3, 3)),
    "many corners": lambda rng: circle(50, rng, rng.normal()),
}


@pytest.mark.parametrize("count", [0, 1, 8, 9, 700])
@pytest.mark.parametrize("family", POINTS)
def test_a_dual_tree_visits_what_reaches_a_corner(trees, family, count):
    rng = np.random.default_rng([count, *family.encode()])
    points = np.ascontiguousarray(POINTS[family](count, rng).reshape(-1, 3), float)
    tree = trees.make_dual_tree(points, count)
    for ring in (make(rng) for make in RINGS.values() for _ in range(10)):
        reach = points @ ring.T
        rounding = 1e-14 * (1 + np.abs(points) @ np.abs(ring).T)
        # As often as not few points reach a corner, which are those that the tree is for.
        for level in np.quantile(reach, [0, 0.5, 0.99, 1]) if count else [0.0]:
            reached = np.zeros((count, len(ring)), np.uint8)
            visited = trees.reaching(tree, ring, len(ring), level, count + 1, reached)
            assert visited == reached.any(axis=1).sum()
            assert (reached <= 1).all()
            assert (reached[reach > level + rounding] == 1).all()
            assert (reached[reach < level - rounding] == 0).all()
            if visited > 1:
                assert trees.reaching(tree, ring, len(ring), level, 1, reached) == -2
    trees.drop_dual_tree(tree)


@pytest.mark.parametrize("spread", [0, 1e-15, 1e-9, 1e-3])
@pytest.mark.parametrize("family", [name for name in POINTS if name != "line"])
def test_a_plane_tree_knows_the_plane_that_a_vertex_misses_most(trees, family, spread):
    rng = np.random.default_rng([int(1 / max(spread, 1e-16)), *family.encode()])
    duals = np.ascontiguousarray(POINTS[family](500, rng))
    vertices = rng.normal(size=3) + spread * rng.normal(size=(40, 3))
    most = np.max(np.abs(vertices @ duals.T - 1) / np.linalg.norm(duals, axis=1), axis=1)
    found = np.empty(len(vertices))
    trees.misfits(duals, len(duals), vertices, len(vertices), np.inf, found)
    np.testing.assert_allclose(found, most, rtol=1e-12)
    # An answer that is enough may be less than the most, but not less than enough.
    enough = float(np.median(most))
    trees.misfits(duals, len(duals), vertices, len(vertices), enough, found)
    np.testing.assert_allclose(found[most < enough * (1 - 1e-12)], most[most < enough * (1 - 1e-12)], rtol=1e-12)
    assert (found <= most * (1 + 1e-12)).all()
    assert (found[most >= enough] >= enough * (1 - 1e-12)).all()


def rim(count):
    turns = 2 * np.pi * np.arange(count) / count
    return np.column_stack([np.cos(turns), np.sin(turns), 0 * turns])


SOLIDS = {
    "icosphere": icosphere(2),
    "cloud": cloud(300, np.random.default_rng(0)),
    "cone": np.vstack([rim(200), [[0.2, 0, 1]]]),
    "prism": np.vstack([rim(101) + [0, 0, 1], rim(101)]),
    "plate": np.vstack([rim(64) + [0, 0, 1e-5], rim(64)]),
    "needle": icosphere(2) * [1e-4, 1e-4, 1] @ np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0],
    "box": np.array(list(np.ndindex(2, 2, 2)), float),
}


def facets_of(points):
    """Planes, and rings of corners counter-clockwise from outside, facets in one plane merged."""
    hull = ConvexHull(points)
    planes: list[np.ndarray] = []
    corners: list[set[int]] = []
    for equation, simplex in zip(hull.equations, hull.simplices, strict=True):
        same = [i for i, plane in enumerate(planes) if np.abs(plane - equation).max() < 1e-9]
        if not same:
            planes.append(equation)
            corners.append(set())
        corners[same[0] if same else -1] |= set(simplex)
    rings = []
    for plane, own in zip(planes, corners, strict=True):
        of = np.array(sorted(own))
        at = points[of] - points[of].mean(axis=0)
        along = at[np.argmax((at**2).sum(axis=1))]
        rings.append(
            of[np.argsort(np.arctan2(at @ np.cross(plane[:3], along), at @ along * np.linalg.norm(plane[:3])))]
        )
    return np.array(planes) * [1, 1, 1, -1], rings


@pytest.mark.parametrize("name", SOLIDS)
def test_the_foot_on_a_polytope_is_proved(trees, name):
    points = np.ascontiguousarray(SOLIDS[name], float)
    planes, rings = facets_of(points)
    start = np.cumsum([0, *map(len, rings)]).astype(np.int32)
    ring = np.concatenate(rings).astype(np.int32)
    tree = trees.make_facet_tree(points, len(points), np.ascontiguousarray(planes), ring, start, len(rings))
    rng = np.random.default_rng(2)
    size = np.ptp(points, axis=0).max()
    found = np.empty(6)
    outside = 0
    for scale in np.repeat([0.1, 1, 10], 100):
        x = points[rng.integers(len(points))] + scale * size * rng.normal(size=3)
        if (planes[:, :3] @ x - planes[:, 3]).max() < 1e-9 * size:
            continue
        outside += 1
        trees.foot(tree, x, np.inf, found)
        point, outward = found[:3], found[3:] / np.linalg.norm(found[3:])
        away = np.linalg.norm(x - point)
        # The point is of the polytope, and nothing of that lies beyond the plane through it across the way to x.
        assert (planes[:, :3] @ point - planes[:, 3]).max() < 1e-9 * size
        assert (points @ outward).max() < outward @ point + 1e-9 * size
        np.testing.assert_allclose(outward, (x - point) / away, atol=1e-7 * max(1, size / away))
        trees.foot(tree, x, away**2 * (1 + 1e-9), found)
        assert found[3:].any()
        trees.foot(tree, x, away**2 * (1 - 1e-9), found)
        assert not found[3:].any()
    assert outside > 100
    trees.drop_facet_tree(tree)
