"""The article's method replayed step by step, to find the first step that loses what two bodies have in common.

The replay does in doubles what the method does in doubles, and everything after the step under trial without rounding:
if the answer is wrong by then, no care in later steps could have saved it. It follows
`overlapper/native/methods/paper.cpp`, which a failing case may still leave by another way; that is reported as "not
reproduced".
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import combinations, product

import exact
import numpy as np

from overlapper import Hull

STEPS = {
    "1 common point": "GJK sees no common point",
    "2 shifts": "the common point is on the boundary, and none of the 26 shifts leads inside",
    "3 planes": "the planes of the bodies, rounded before the method begins",
    "3 duals": "the dual points, rounded",
    "4 coplanar duals": "planes that meet in one vertex become several vertices, apart by rounding",
    "5 vertices": "the vertices of the intersection, rounded",
    "5 second hull": "facets of the vertices' hull joined, as if they were coplanar but for rounding",
    "not reproduced": "the replay gets it right",
}

SHIFTS = [np.array(d) / np.linalg.norm(d) for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)]
MINIMAL_STEP = 2.0**-26  # of the smaller body's extent, as in paper.cpp
SAME_VERTEX = 1e-9  # of the common part's extent, as in paper.cpp

# Beyond this relative error of the volume a step counts as lost, the same as a failure in the chart.
FAILURE = 1e-6


def lost_at(*bodies: np.ndarray) -> str:
    """The name of the step, a key of STEPS; several bodies are halved as the method does, pair by pair."""
    level = [np.asarray(body, float) for body in bodies]
    while len(level) > 1:
        level, pairs = level[len(level) // 2 * 2 :], list(zip(level[::2], level[1::2]))
        parts = []
        for a, b in pairs:
            step, part = pair_lost_at(a, b)
            if step is not None:
                return step
            if part is None:  # rightly nothing
                return "not reproduced"
            parts.append(part)
        level = parts + level
    return "not reproduced"


def pair_lost_at(a: np.ndarray, b: np.ndarray) -> tuple[str | None, np.ndarray | None]:
    """The step that loses the volume, or None; and the vertices found, of use to the next pair."""
    reference = (a.min(0) + a.max(0)) / 2
    clouds = [a - reference, b - reference]
    solids = [exact.hull(cloud) for cloud in clouds]
    truth = exact.common(*solids).volume
    if truth == 0:
        return None, None
    hulls = [Hull(cloud) for cloud in clouds]
    point = common_point(hulls[0].vertices, hulls[1].vertices)
    if point is None:
        return "1 common point", None
    planes = np.vstack([hull.halfspaces for hull in hulls])
    point = shifted_inside(clouds, planes, point)
    if point is None:
        return "2 shifts", None
    return lost_after(planes, point, truth)


def lost_after(planes: np.ndarray, point: np.ndarray, truth: Fraction) -> tuple[str | None, np.ndarray | None]:
    exact_duals = [dual(plane, point) for plane in planes.tolist()]
    if wrong(volume_of_polar(exact_duals), truth):
        return "3 planes", None
    with np.errstate(all="ignore"):
        duals = planes[:, :3] / -(planes @ np.append(point, 1))[:, None]
    if wrong(volume_of_polar(duals), truth):
        return "3 duals", None
    vertices = point + np.array(polar_vertices(duals), float)
    if wrong(exact.hull(vertices).volume, truth):
        return "5 vertices", None
    if wrong(volume_of(vertices), truth):
        return "5 second hull" if wrong(volume_of(snapped(vertices)), truth) else "4 coplanar duals", None
    return None, vertices


def lost_given_a_point(bodies: Sequence[np.ndarray], common: exact.Polytope) -> str | None:
    """The step lost at if steps 1 and 2 had found the best of points, the centroid of what is common."""
    planes, point = about_centroid(bodies, common)
    return lost_after(planes, point, common.volume)[0]


def volume_without_exact_signs(bodies: Sequence[np.ndarray], common: exact.Polytope) -> float:
    """Steps 3 to 5 about the centroid, the hulls by qhull, whose signs are those of rounded numbers."""
    from scipy.spatial import ConvexHull, HalfspaceIntersection

    return float(ConvexHull(HalfspaceIntersection(*about_centroid(bodies, common)).intersections).volume)


def about_centroid(bodies: Sequence[np.ndarray], common: exact.Polytope) -> tuple[np.ndarray, np.ndarray]:
    """All planes and the centroid, both counted from the middle of the first body."""
    reference = (bodies[0].min(0) + bodies[0].max(0)) / 2
    planes = np.vstack([Hull(body - reference).halfspaces for body in bodies])
    return planes, np.array(exact.subtract(common.centroid, exact.vector(reference)), float)


def wrong(volume: Fraction | None, truth: Fraction) -> bool:
    return volume is None or abs(volume - truth) > FAILURE * truth


# Steps 1 and 2


def common_point(a: np.ndarray, b: np.ndarray) -> np.ndarray | None:
    """A point of both hulls by GJK on their difference; None if it finds them apart."""
    simplex = [support(a, b, np.array([-1.0, 0, 0]))]
    weights, nearest = np.ones(1), simplex[0][0] - simplex[0][1]
    for _ in range(256):
        if not nearest.any():
            break
        corner = support(a, b, -nearest)
        if any((corner[0] - corner[1] == p - q).all() for p, q in simplex):
            return None
        found = nearest_of(simplex + [corner])
        if not found[2] @ found[2] < nearest @ nearest:
            return None
        simplex, weights, nearest = found
    return weights @ np.array([p for p, _ in simplex])


def support(a: np.ndarray, b: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return a[np.argmax(a @ direction)], b[np.argmin(b @ direction)]


def nearest_of(simplex: list) -> tuple[list, np.ndarray, np.ndarray]:
    """The part of a simplex nearest to the origin, the weights of its corners there, and that point."""
    best = None
    for size in range(1, len(simplex) + 1):
        for part in combinations(simplex, size):
            found = WEIGH[size](*(p - q for p, q in part))
            if found is not None and (best is None or found[1] @ found[1] < best[2] @ best[2]):
                best = (list(part), found[0] / found[0].sum(), found[1])
    return best


def weigh_point(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.ones(1), a


def weigh_segment(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    weights = np.array([b @ (b - a), -a @ (b - a)])
    if not (weights > 0).all():
        return None
    share = weights / weights.sum()
    return weights, a + share[1] * (b - a) if share[0] > share[1] else b - share[0] * (b - a)


def weigh_triangle(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    normal = np.array(exact.cross(exact.vector(b - a), exact.vector(c - a)), float)
    weights = np.array([normal @ np.cross(b, c), normal @ np.cross(c, a), normal @ np.cross(a, b)])
    if not (weights > 0).all():
        return None
    return weights, normal @ min((a, b, c), key=lambda p: p @ p) / (normal @ normal) * normal


def weigh_tetrahedron(*corners: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    a, b, c, d = map(exact.vector, corners)
    volumes = [exact.dot(p, exact.cross(q, r)) for p, q, r in ((b, d, c), (a, c, d), (a, d, b), (a, b, c))]
    if sum(volumes) == 0 or min(volumes) < 0 < max(volumes):
        return None
    return np.abs(np.array(volumes, float)), np.zeros(3)


WEIGH = {1: weigh_point, 2: weigh_segment, 3: weigh_triangle, 4: weigh_tetrahedron}


def shifted_inside(clouds: list[np.ndarray], planes: np.ndarray, point: np.ndarray) -> np.ndarray | None:
    """The point itself if it is inside of all planes, or one minimal step away from it; None if no step helps."""
    on_boundary = 16 * 2.0**-53 * max(np.abs(cloud).max() for cloud in clouds)
    step = MINIMAL_STEP * min(np.ptp(cloud, axis=0).max() for cloud in clouds)
    for direction in [np.zeros(3), *SHIFTS]:
        shifted = point + step * direction
        if (planes @ np.append(shifted, 1)).max() < -on_boundary:
            return shifted
    return None


# Steps 3 to 5 without rounding


def dual(plane: list[float], point: np.ndarray) -> exact.Vector:
    *normal, offset = map(Fraction, plane)
    x, y, z = (n / -(offset + exact.dot(normal, exact.vector(point))) for n in normal)
    return x, y, z


def polar_vertices(duals) -> list[exact.Vector]:
    """The duals of the facets of the hull of dual points, which must have the origin inside."""
    planes = exact.hull(duals).planes
    if any(d >= 0 for *_, d in planes):
        raise ValueError("duals: the origin is not inside")
    return [(Fraction(a, -d), Fraction(b, -d), Fraction(c, -d)) for a, b, c, d in planes]


def volume_of_polar(duals) -> Fraction | None:
    try:
        return exact.hull(polar_vertices(duals)).volume
    except (ValueError, OverflowError):
        return None


def volume_of(vertices: np.ndarray) -> Fraction | None:
    """The volume of the second hull as the package builds it; None if it finds the vertices flat."""
    try:
        return Fraction(Hull(vertices).volume)
    except ValueError:
        return None


def snapped(vertices: np.ndarray) -> np.ndarray:
    """Each vertex moved to the first one that is the same but for rounding."""
    same = SAME_VERTEX * np.ptp(vertices, axis=0).max()
    return np.array([vertices[np.argmax(np.linalg.norm(vertices - v, axis=1) <= same)] for v in vertices])
