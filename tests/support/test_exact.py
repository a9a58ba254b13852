"""The rational truth against the definition, itself and closed forms, all without rounding."""

from fractions import Fraction
from itertools import combinations

import exact
import numpy as np
import pytest
from scipy.spatial import ConvexHull

CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
TETRA = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)


def random_hulls(seed, count, low=4, high=10):
    rng = np.random.default_rng(seed)
    return [exact.hull(rng.normal(size=(rng.integers(low, high + 1), 3))) for _ in range(count)]


def lattice_hulls(seed, count):
    """Solids on a tiny lattice, where faces are coplanar, edges cross and corners coincide."""
    rng = np.random.default_rng(seed)
    found = []
    while len(found) < count:
        points = rng.integers(-2, 3, size=(rng.integers(4, 9), 3)) + rng.integers(-1, 2, size=3)
        if np.linalg.matrix_rank(points[1:] - points[0]) == 3:
            found.append(exact.hull(points.astype(float)))
    return found


def same(p, q):
    def facets(body):
        return {f.plane: (frozenset(f.ring), frozenset(f.owners)) for f in body.facets}

    return p.dimension == q.dimension and set(p.vertices) == set(q.vertices) and facets(p) == facets(q)


def planes_by_definition(points):
    """Every plane through three points that leaves none outside."""
    found = set()
    for three in combinations([exact.point(p) for p in points], 3):
        for p, q, r in (three, three[::-1]):
            plane = exact.plane_through(p, q, r)
            if plane and all(exact.side(plane, exact.point(s)) <= 0 for s in points):
                found.add(plane)
    return found


@pytest.mark.parametrize("seed", range(8))
def test_hull_has_the_planes_of_the_definition(seed):
    points = np.random.default_rng(seed).normal(size=(12, 3))
    body = exact.hull(points)
    assert set(body.planes) == planes_by_definition(points)
    assert float(body.volume) == pytest.approx(ConvexHull(points).volume, rel=1e-13)


@pytest.mark.parametrize("seed", range(20))
def test_hull_of_lattice_points_has_the_planes_of_the_definition(seed):
    points = np.random.default_rng(seed).integers(-1, 2, size=(14, 3)).astype(float)
    body = exact.hull(points)
    assert set(body.planes) == planes_by_definition(points)
    corners, edges = len(body.vertices), sum(len(f.ring) for f in body.facets) // 2
    assert corners - edges + len(body.facets) == 2


def test_points_on_faces_edges_and_inside_leave_a_cube_a_cube():
    rng = np.random.default_rng(5)
    extra = rng.integers(0, 5, size=(60, 3)) / 4
    cube = exact.hull(np.vstack([extra, CUBE, CUBE]))
    assert len(cube.facets) == 6 and len(cube.vertices) == 8
    assert all(len(f.ring) == 4 for f in cube.facets)
    assert cube.volume == 1 and cube.area == 6


@pytest.mark.parametrize("points", [CUBE[:3], CUBE[:4], [[i, 2 * i, 3 * i] for i in range(5)], [[1, 1, 1]] * 5])
def test_flat_points_have_no_hull(points):
    with pytest.raises(ValueError, match="plane"):
        exact.hull(points)


def test_centroid_and_inertia_of_a_box_have_their_closed_forms():
    box = exact.hull(CUBE * [2, 3, 5] + [7, 11, 13])
    assert box.volume == 30
    assert box.centroid == (8, Fraction(25, 2), Fraction(31, 2))
    assert box.inertia == [
        [Fraction(30 * (9 + 25), 12), 0, 0],
        [0, Fraction(30 * 29, 12), 0],
        [0, 0, Fraction(30 * 13, 12)],
    ]


def test_measures_add_up_over_the_two_sides_of_a_plane():
    rng = np.random.default_rng(3)
    for body in random_hulls(7, 5):
        plane = exact.halfspace(rng.normal(size=3), 0.1)
        low = exact.clipped(body, plane, 1)
        high = exact.clipped(body, tuple(-c for c in plane), 1)
        assert low.volume > 0 and high.volume > 0
        assert low.volume + high.volume == body.volume
        for i in range(3):
            assert low.volume * low.centroid[i] + high.volume * high.centroid[i] == body.volume * body.centroid[i]
        assert low.pull(1) == tuple(-c for c in high.pull(1))


def test_volume_scales_with_the_cube_of_the_size():
    for points in np.random.default_rng(1).normal(size=(5, 8, 3)):
        assert exact.hull(points * 2.0**-400).volume == exact.hull(points).volume / 2**1200


def test_clipping_and_enumeration_agree_in_general_position():
    dimensions = set()
    for a, b in zip(random_hulls(1, 20), random_hulls(2, 20), strict=True):
        part = exact.common(a, b)
        dimensions.add(part.dimension)
        assert same(part, exact.common_by_enumeration(a, b))
        assert part.volume == exact.common_by_enumeration(a, b).volume
    assert 3 in dimensions


def test_clipping_and_enumeration_agree_on_a_lattice():
    dimensions = set()
    for a, b in zip(lattice_hulls(1, 120), lattice_hulls(2, 120), strict=True):
        part = exact.common(a, b)
        dimensions.add(part.dimension)
        assert same(part, exact.common_by_enumeration(a, b))
    assert dimensions == {-1, 0, 1, 2, 3}


def test_clipping_and_enumeration_agree_for_three_bodies():
    for bodies in zip(lattice_hulls(3, 15), lattice_hulls(4, 15), lattice_hulls(5, 15), strict=True):
        assert same(exact.common(*bodies), exact.common_by_enumeration(*bodies))


def test_common_part_is_its_own_hull_and_inside_every_body():
    for a, b in zip(random_hulls(11, 10), random_hulls(12, 10), strict=True):
        part = exact.common(a, b)
        if part.dimension == 3:
            corners = [exact.coordinates(p) for p in part.vertices]
            again = exact.hull(corners)
            assert set(again.planes) == set(part.planes) and again.volume == part.volume
            assert all(a.contains(p) and b.contains(p) for p in corners)


def test_area_vectors_sum_to_zero_and_order_changes_only_names():
    for seed in range(4):
        a, b, c = random_hulls(seed, 3, low=12, high=15)
        part = exact.common(a, b, c)
        assert part.volume > 0
        total = [sum(exact.area_vector(f)[i] for f in part.facets) for i in range(3)]
        assert total == [0, 0, 0]
        swapped = exact.common(c, a, b)
        assert swapped.volume == part.volume
        assert [swapped.pull(i) for i in (1, 2, 0)] == [part.pull(i) for i in range(3)]


@pytest.mark.parametrize(
    ("shift", "dimension"),
    [((1, 0, 0), 2), ((1, 0.5, 0.25), 2), ((1, 1, 0), 1), ((1, -1, 0.5), 1), ((1, 1, 1), 0), ((2, 0, 0), -1)],
)
def test_cubes_meet_in_a_face_an_edge_a_corner_or_not_at_all(shift, dimension):
    part = exact.common(exact.hull(CUBE), exact.hull(CUBE + shift))
    assert part.dimension == dimension and part.volume == 0
    assert same(part, exact.common_by_enumeration(exact.hull(CUBE), exact.hull(CUBE + shift)))


def test_one_unit_in_the_last_place_decides():
    one = exact.hull(CUBE)
    assert exact.common(one, exact.hull(CUBE + (np.nextafter(1, 2), 0, 0))).dimension == -1
    sliver = exact.common(one, exact.hull(exact.placed(CUBE, (np.nextafter(1, 0), 0, 0))))
    assert sliver.volume == Fraction(1, 2**53)


def test_stella_octangula_holds_an_octahedron():
    part = exact.common(exact.hull(TETRA), exact.hull(-TETRA))
    assert part.volume == Fraction(4, 3)
    assert {exact.coordinates(p) for p in part.vertices} == {tuple(s * e) for s in (1, -1) for e in np.eye(3)}
    assert part.inertia[0][0] == Fraction(4, 3) * Fraction(1, 5)
    assert [len(f.ring) for f in part.facets] == [3] * 8
    assert sorted(f.owners for f in part.facets) == [(0,)] * 4 + [(1,)] * 4


def test_coplanar_facets_have_both_owners():
    part = exact.common(exact.hull(CUBE), exact.hull(CUBE * [1, 1, 2] - [0, 0, 0.5]))
    assert sorted(f.owners for f in part.facets) == [(0,), (0,)] + [(0, 1)] * 4


def test_half_turn_and_translation_are_exact():
    assert exact.placed([[1, 2, 3]], (10, 0, 0.5), (0, 0, 4, 0)) == [(9, -2, Fraction(7, 2))]
    assert exact.placed([[1, 0, 0]], orientation=(0, 0, 0.5, 0.5)) == [(0, 1, 0)]


def test_rigid_motion_by_a_rational_quaternion_keeps_the_volume_of_the_common_part():
    pose = {"position": (0.3, -7.25, 1e5), "orientation": (1, 2, -3, 5)}
    (a,), (b,) = random_hulls(31, 1), random_hulls(32, 1)
    turned = [exact.hull(exact.placed(map(exact.coordinates, body.vertices), **pose)) for body in (a, b)]
    assert exact.common(*turned).volume == exact.common(a, b).volume > 0
    assert exact.depth_squared(*turned) == exact.depth_squared(a, b) > 0


@pytest.mark.parametrize(
    ("shift", "distance_squared", "depth_squared"),
    [
        ((0, 0, 0), 0, 1),
        ((0.75, 0.5, 0), 0, Fraction(1, 16)),
        ((1, 0, 0), 0, 0),
        ((3, 0.5, 0), 4, 0),
        ((3, 4, 0.5), 13, 0),
        ((2, 3, -4), 1 + 4 + 9, 0),
    ],
)
def test_distance_and_depth_of_cubes(shift, distance_squared, depth_squared):
    a, b = exact.hull(CUBE), exact.hull(CUBE + shift)
    assert exact.distance_squared(a, b) == exact.distance_squared(b, a) == distance_squared
    assert exact.depth_squared(a, b) == exact.depth_squared(b, a) == depth_squared


def test_distance_of_a_point_like_corner_to_a_slanted_facet():
    wedge = exact.hull([[0, 0, 0], [3, 0, 0], [0, 3, 0], [0, 0, 3]])
    cube = exact.hull(CUBE + (2, 2, 2))
    assert exact.distance_squared(wedge, cube) == 3


def test_depth_is_the_least_extent_over_all_directions():
    rng = np.random.default_rng(8)
    for a, b in zip(random_hulls(41, 5), random_hulls(42, 5), strict=True):
        part, depth = exact.common(a, b), float(exact.depth_squared(a, b)) ** 0.5
        assert (part.volume > 0) == (depth > 0)
        u = rng.normal(size=(500, 3))
        u /= np.linalg.norm(u, axis=1, keepdims=True)
        p, q = (np.array([[float(c) for c in exact.coordinates(v)] for v in body.vertices]) for body in (a, b))
        assert np.all(depth <= (q @ u.T).max(0) - (p @ u.T).min(0) + 1e-12)


def test_volume_by_facets_equals_volume_by_tetrahedra():
    """A solid is made of pyramids, too: one over each facet, with the tip in the origin."""
    for a, b in zip(random_hulls(51, 10), random_hulls(52, 10), strict=True):
        for body in (a, exact.common(a, b)):
            pyramids = [
                exact.dot(exact.coordinates(facet.ring[0]), exact.area_vector(facet)) / 3 for facet in body.facets
            ]
            assert body.volume == sum(pyramids)


def test_a_sum_is_the_same_in_whatever_order_it_is_taken():
    rng = np.random.default_rng(9)
    for count in (0, 1, 2, 3, 7, 64, 65):
        terms = [Fraction(int(n), int(d)) for n, d in rng.integers(1, 1000, (count, 2))]
        assert exact.total(terms) == sum(terms, Fraction(0)) == exact.total(terms[::-1])
