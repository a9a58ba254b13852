"""The claims of the article, measured: how time grows with the size and the number of the bodies, and the best way.

Each claim is a list of ways to do the same, timed in turn at growing sizes. What this package answers is compared with
the exact truth, as is what the others answer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from statistics import median

import exact
import numpy as np
from strategies import directions

from harness.bodies import planes
from harness.command import Wrong
from harness.peers import MOST_IN_NUMPY, clipping
from harness.timing import in_turn
from overlapper import Hull, Placed, overlap
from speed import workloads
from speed.turns import error_of

Way = Callable[[], float]

SIZES = (25, 50, 100, 200, 400, 800)  # vertices of a body
COUNTS = (2, 4, 8, 16, 32, 64)  # bodies
VERTICES = 32  # of each of many bodies
SLOWEST = 0.2  # s: a way that takes longer is not asked at the next size


@dataclass
class Claim:
    """A line of the results. `us` is the median of the processor's time."""

    claim: str
    way: str
    vertices: int
    bodies: int
    us: str
    error: str


def pairs(seconds: float) -> list[Claim]:
    """O(n log n) for a pair, and cutting, which the article gives O(n³), beside duality."""
    rng, found, slow = np.random.default_rng(0), [], set()
    for size in SIZES:
        pair = workloads.apart(rng, directions(rng, size), directions(rng, size), 0.5)
        a, b = pair.bodies
        both, at = np.vstack([planes(body) for body in pair.bodies]), middle(a, b)
        ways = {
            "paper": lambda a=a, b=b: overlap(a, b, method="paper").volume,
            "auto": lambda a=a, b=b: overlap(a, b).volume,
            "duality": lambda both=both, at=at: by_one_hull([both], at),
        }
        if size <= MOST_IN_NUMPY:
            ways["cutting"] = clipping(pair.bodies, None)
        found += asked("pair", ways, slow, size, 2, pair.volume, seconds)
    return found


def groups(seconds: float) -> list[Claim]:
    """O(m n log n) for m bodies, and one hull of all duals beside the tree of pairs."""
    from manifold3d import Manifold

    rng, found, slow = np.random.default_rng(1), [], set()
    for count in COUNTS:
        clouds = [directions(rng, VERTICES) + 0.2 * directions(rng, 1) for _ in range(count)]
        bodies = [Placed(Hull(cloud)) for cloud in clouds]
        walls, meshes = [planes(body) for body in bodies], [Manifold.hull_points(cloud) for cloud in clouds]
        at = middle(*bodies)
        ways = {
            "paper": lambda bodies=bodies: overlap(*bodies, method="paper").volume,
            "auto": lambda bodies=bodies: overlap(*bodies).volume,
            "one hull": lambda walls=walls, at=at: by_one_hull(walls, at),
            "tree": lambda walls=walls, at=at: by_tree(walls, at),
            "manifold3d": lambda meshes=meshes: reduce(Manifold.__xor__, meshes).volume(),
        }
        volume = exact.common(*(exact.hull(cloud) for cloud in clouds)).volume
        found += asked("bodies", ways, slow, VERTICES, count, volume, seconds)
    return found


def asked(
    claim: str, ways: dict[str, Way], slow: set[str], vertices: int, bodies: int, volume: Fraction, seconds: float
) -> list[Claim]:
    """The ways in turn, but for those that were too slow before."""
    ways = {name: way for name, way in ways.items() if name not in slow}
    errors = {name: error_of(way(), volume) for name, way in ways.items()}
    if errors.get("auto", 0.0) > 1e-12:
        raise Wrong(f"{claim}, {vertices} vertices, {bodies} bodies: auto is off by {errors['auto']:.1e}")
    samples = dict(zip(ways, in_turn([*ways.values()], 3, seconds / len(ways))))
    slow |= {name for name in ways if median(samples[name]) > SLOWEST}
    return [
        Claim(claim, name, vertices, bodies, f"{1e6 * median(samples[name]):.4g}", f"{errors[name]:.2e}")
        for name in ways
    ]


# The two ways to treat many bodies, by the same hull of the same library


def middle(*bodies: Placed) -> np.ndarray:
    """A point well inside of what is common."""
    return overlap(*bodies).centroid


def duals(walls: np.ndarray, at: np.ndarray) -> np.ndarray:
    return walls[:, :3] / -(walls[:, :3] @ at + walls[:, 3])[:, None]


def by_one_hull(walls: list[np.ndarray], at: np.ndarray) -> float:
    """The hull of the duals of all planes of all bodies."""
    return volume_of_polar(np.vstack([duals(of_body, at) for of_body in walls]))


def by_tree(walls: list[np.ndarray], at: np.ndarray) -> float:
    """Two by two, only the planes that matter going on to the next level."""
    from scipy.spatial import ConvexHull

    level = [duals(of_body, at) for of_body in walls]
    while len(level) > 2:
        pairs = [np.vstack(level[i : i + 2]) for i in range(0, len(level), 2)]
        level = [pair[ConvexHull(pair).vertices] for pair in pairs]
    return volume_of_polar(np.vstack(level))


def volume_of_polar(points: np.ndarray) -> float:
    from scipy.spatial import ConvexHull

    equations = ConvexHull(points).equations
    return float(ConvexHull(equations[:, :3] / -equations[:, 3:]).volume)


# Each takes the seconds to spend on a size.
CLAIMS: tuple[Callable[[float], list[Claim]], ...] = (pairs, groups)
