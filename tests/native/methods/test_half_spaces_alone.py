"""Half-spaces without a bounded body: their status is exact, whatever the tilt between their planes."""

from fractions import Fraction
from itertools import combinations, product

import numpy as np
import pytest
from strategies import quaternion

from overlapper import Box, HalfSpace, Placed, distance, overlap

TILTS = [1e-300, 1e-32, *(10.0**-k for k in range(17, 2, -1))]
OPEN = "shapes must have a bounded common set"
FAR = "shapes must meet near their planes"


def dot(u, v):
    return sum((x * y for x, y in zip(u, v)), Fraction(0))


def cross(u, v):
    return (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])


def plane(body):
    """Normal and offset in the world, the normal of some length."""
    x, y, z, w = map(Fraction, map(float, body.orientation))
    rows = (
        (w * w + x * x - y * y - z * z, 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), w * w - x * x + y * y - z * z, 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), w * w - x * x - y * y + z * z),
    )
    given = [Fraction(float(c)) for c in body.shape.given_normal]
    normal = tuple(dot(row, given) for row in rows)
    at = [Fraction(float(c)) for c in body.position]
    return normal, Fraction(body.shape.given_offset) * (x * x + y * y + z * z + w * w) + dot(normal, at)


def has_common_point(bodies):
    """A set of half-spaces that is not empty has a point where the planes of a largest independent subset meet."""
    planes = [plane(body) for body in bodies]
    return any(feasible(point, planes) for point in candidates(planes))


def candidates(planes):
    for rank in (3, 2, 1):
        found = [point for some in combinations(planes, rank) if (point := meeting(some)) is not None]
        yield from found
        if found:
            return


def meeting(planes):
    """The point nearest to the origin on all of at most three planes; nothing if these are not independent."""
    count = len(planes)
    normals = [n for n, _ in planes]
    rows = [[dot(p, q) for q in normals] + [d] for p, (_, d) in zip(normals, planes)]
    for k in range(count):
        pivot = next((i for i in range(k, count) if rows[i][k] != 0), None)
        if pivot is None:
            return None
        rows[k], rows[pivot] = rows[pivot], rows[k]
        for i in range(count):
            if i != k:
                rows[i] = [x - rows[i][k] / rows[k][k] * y for x, y in zip(rows[i], rows[k])]
    weights = [rows[k][count] / rows[k][k] for k in range(count)]
    return tuple(sum((w * n[i] for w, n in zip(weights, normals)), Fraction(0)) for i in range(3))


def feasible(point, planes):
    return all(dot(n, point) <= d for n, d in planes)


def turned(normal, offset, q, place=(0, 0, 0)):
    return Placed(HalfSpace(normal, offset), place, q)


@pytest.mark.parametrize("tilt", TILTS)
@pytest.mark.parametrize("seed", range(3))
def test_a_pair_that_is_opposite_but_for_a_tilt_is_refused(tilt, seed):
    rng = np.random.default_rng(seed)
    q = quaternion(rng) if seed else np.array([0, 0, 0, 1.0])
    pair = turned([0, 0, 1], 0, q), turned([tilt, 0, -1], -1, q, rng.normal(size=3) * 1e-3)
    with pytest.raises(ValueError, match=OPEN):
        overlap(*pair)
    assert distance(*pair) == 0


@pytest.mark.parametrize("seed", range(40))
def test_a_pair_that_is_opposite_is_as_far_apart_as_its_planes(seed):
    """Normals of any length, and of one orientation. Unit normals round, and need not be opposite."""
    rng = np.random.default_rng(seed)
    normal, q = rng.integers(-9, 10, 3) + [0.0, 0, 0.5], quaternion(rng)
    first = turned(normal, rng.normal(), q, rng.normal(size=3) * 10.0 ** rng.integers(-3, 7))
    other = turned(-3 * normal, rng.normal(), q, first.position + rng.normal(size=3) * 10.0 ** rng.integers(-12, 2))
    (n, d), (m, e) = plane(first), plane(other)
    axis = next(i for i in range(3) if n[i] != 0)
    gap = float(-e * abs(n[axis] / m[axis]) - d) / float(dot(n, n)) ** 0.5
    if gap <= 0:
        with pytest.raises(ValueError, match=OPEN):
            overlap(first, other)
        assert distance(first, other) == 0
        return
    found = overlap(first, other)
    assert found.status == "separated"
    assert abs(found.distance - gap) <= found.errors.distance + 1e-13 * gap
    assert distance(first, other) == found.distance
    between = found.witness_a - found.witness_b
    assert np.linalg.norm(between) == pytest.approx(gap, abs=2 * found.errors.witnesses + 1e-13 * gap)
    assert found.normal @ between == pytest.approx(gap, abs=2 * found.errors.witnesses + 1e-13 * gap)


def groups(rng):
    """Half-spaces, some of which sum to zero but for a tilt: two of a slab, three of a prism, four of a simplex."""
    tilt = float(rng.choice([0, 0, *TILTS]))
    u, v, w = rng.integers(-4, 5, (3, 3)) + [[0.5, 0, 0], [0, 0.5, 0], [0, 0, 0.5]]
    last = {2: -u, 3: -(u + v), 4: -(u + v + w)}
    count = int(rng.integers(2, 5))
    normals = [u, v, w][: count - 1] + [last[count] + tilt * rng.integers(-2, 3, 3)]
    normals += list(rng.integers(-4, 5, (int(rng.integers(0, 3)), 3)) + [0.5, 0, 0])
    offsets = rng.integers(-4, 5, len(normals)) / 4
    q = quaternion(rng) if rng.random() < 0.5 else [0, 0, 0, 1.0]
    bodies = [turned(n, float(d), q) for n, d in zip(normals, offsets)]
    return [bodies[i] for i in rng.permutation(len(bodies))]


def status_of(bodies):
    try:
        return overlap(*bodies).status
    except ValueError as refusal:
        return "refused" if str(refusal).startswith((OPEN, FAR)) else str(refusal)


@pytest.mark.parametrize("first_seed", range(0, 400, 100))
def test_groups_are_separated_exactly_if_they_have_no_common_point(first_seed):
    seen = set()
    for seed in range(first_seed, first_seed + 100):
        bodies = groups(np.random.default_rng(seed))
        common = has_common_point(bodies)
        status = status_of(bodies)
        assert (status == "separated") == (not common), (seed, status)
        seen.add(status)
    assert {"separated", "refused"} <= seen


def test_half_spaces_that_meet_a_million_times_as_far_away_are_refused():
    walls = [HalfSpace([0, s, 0], 1) for s in (-1.0, 1.0)]
    wedge = [HalfSpace([0, 0, 1], -1), HalfSpace([1e-9, 0, -1], 0), HalfSpace([-1e-9, 0, -1], 5)]
    with pytest.raises(ValueError, match=FAR):
        overlap(*walls, *wedge)
    assert overlap(*walls, *wedge, HalfSpace([-1, 0, 0], 10)).status == "separated"


def test_three_walls_of_a_prism_and_a_lid_leave_it_open_however_they_are_rounded():
    a, b = np.array([1, 2, 3.0]), np.array([-3, 1, 5.0])
    for lid in product((-1.0, 1.0), repeat=2):
        prism = [HalfSpace(n, 1) for n in (a, b, -(a + b))]
        with pytest.raises(ValueError, match=OPEN):
            overlap(*prism, HalfSpace(lid[0] * np.cross(a, b), lid[1]))


def test_the_article_has_no_polytope_of_a_body_as_thin_as_rounding():
    plate = Box([1, 1.1e-15, 1])
    assert overlap(plate, Box([1, 1, 1]), method="paper").status == "touching"
    assert overlap(plate, Placed(Box([1, 1, 1]), (0, 3, 0)), method="paper").status == "separated"
