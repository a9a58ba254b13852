"""The common part of bodies: closed forms, regular compounds, exact arithmetic, invariants and finite differences."""

from fractions import Fraction
from itertools import permutations

import exact
import numpy as np
import pytest
from families import icosphere
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from strategies import (
    directions,
    hull_points,
    in_general_position,
    lattice_points,
    moved,
    overlapping_points,
    placed,
    placed_points,
    polyhedra,
    quaternion,
    quaternions,
    reach,
    rotation,
    solids,
    turn,
    vectors,
)

from overlapper import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Placed,
    Sphere,
    distance,
    overlap,
    penetration_depth,
)

AXES = np.eye(3)
CUBE = Box([1, 1, 1])
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
TETRA = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)
TO_X = (0, np.sqrt(0.5), 0, np.sqrt(0.5))
TO_Y = (np.sqrt(0.5), 0, 0, np.sqrt(0.5))
TILT = (0.1, 0.2, 0.3, 0.4)
GOLDEN = (1 + np.sqrt(5)) / 2
EPS = np.finfo(float).eps


def assert_holds(answer, volume):
    """The certificate: the true volume is within volume_error of the estimate."""
    assert answer.status == "overlapping"
    assert abs(answer.volume - volume) <= answer.volume_error


def edges_with_owners(answer):
    """Each edge of the common part, as (u, v) with u < v, and the owners of its two facets."""
    owners = {}
    for ring, owner in zip(answer.facets, answer.owner, strict=True):
        for u, v in zip(ring, np.roll(ring, -1), strict=True):
            owners.setdefault((min(u, v), max(u, v)), []).append(int(owner))
    return owners


def assert_is_a_closed_polytope(answer):
    """Euler's formula, every edge in two facets, area vectors that cancel, triangles and facets of one surface."""
    edges = edges_with_owners(answer)
    assert all(len(owners) == 2 for owners in edges.values())
    assert len(answer.vertices) - len(edges) + len(answer.facets) == 2
    assert len(answer.faces) == 2 * len(answer.vertices) - 4
    assert len(answer.owner) == len(answer.facets) == len(answer.halfspaces)
    corners = answer.vertices[answer.faces]
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert_allclose(doubled.sum(0), 0, atol=1e-14 * np.abs(doubled).sum())
    smooth = any(isinstance(body.shape, Sphere | Capsule | Cylinder | Ellipsoid) for body in answer.shapes)
    # The area is that of the polytope around a smooth part, or of the part itself.
    rel = 3 * answer.tolerance if smooth else 1e-12
    assert np.linalg.norm(doubled, axis=1).sum() / 2 == pytest.approx(answer.area, rel=rel)
    assert_array_equal(answer.bounds, [answer.vertices.min(0), answer.vertices.max(0)])


# Closed forms


def lens(*radii_and_distance):
    r, s, d = map(Fraction, radii_and_distance)
    return np.pi * float((r + s - d) ** 2 * (d * d + 2 * d * (r + s) - 3 * (r - s) ** 2) / (12 * d))


def segment(r, h):
    """Area of the part of a disc of radius r below the height h over its lowest point."""
    return r * r * np.arccos((r - h) / r) - (r - h) * np.sqrt(h * (2 * r - h))


def cap(r, h):
    return np.pi * h * h * (3 * r - h) / 3


SMOOTH = [
    ("lens of two unit spheres", [Sphere(1), Placed(Sphere(1), (1, 0, 0))], lens(1, 1, 1)),
    ("thin lens", [Sphere(1), Placed(Sphere(0.5), (0, 1.49, 0))], lens(1, 0.5, 1.49)),
    ("lens of very unequal spheres", [Sphere(10), Placed(Sphere(0.1), (0, 0, 10.05))], lens(10, 0.1, 10.05)),
    ("half of a ball", [Sphere(2), HalfSpace([1, 2, 3], 0)], 16 * np.pi / 3),
    ("cap of a ball", [Sphere(1), HalfSpace([0, 0, 1], -0.75)], cap(1, 0.25)),
    ("thin cap of a ball", [Placed(Sphere(1), (5, 6, 0.999)), HalfSpace([0, 0, 1], 0)], cap(1, 0.001)),
    ("ball below ground", [Placed(Sphere(1), (5, 6, -7)), HalfSpace([0, 0, 1], 0)], 4 * np.pi / 3),
    ("ball in a box", [Sphere(1), Box([2, 3, 4])], 4 * np.pi / 3),
    ("ball touching the walls of its box from inside", [Sphere(1), CUBE], 4 * np.pi / 3),
    ("ball in a ball", [Sphere(1), Placed(Sphere(3), (0.5, 0, 0))], 4 * np.pi / 3),
    ("ball with itself", [Sphere(1), Sphere(1)], 4 * np.pi / 3),
    ("box in a ball", [Sphere(4), Placed(Box([1, 2, 3]), (0.1, 0, 0), TILT)], 48),
    ("an eighth of a ball", [Sphere(1), *[HalfSpace(-axis, 0) for axis in AXES]], np.pi / 6),
    ("corner of a box at the centre of a ball", [Sphere(1), Placed(CUBE, (1, 1, 1))], np.pi / 6),
    ("two crossing cylinders", [Cylinder(1, 4), Placed(Cylinder(1, 4), orientation=TO_X)], 16 / 3),
    (
        "three crossing cylinders",
        [Cylinder(0.5, 4), Placed(Cylinder(0.5, 4), orientation=TO_X), Placed(Cylinder(0.5, 4), orientation=TO_Y)],
        8 * (2 - np.sqrt(2)) / 8,
    ),
    (
        "standing cylinder cut level",
        [Placed(Cylinder(0.5, 2), (3, 2, 0.25)), HalfSpace([0, 0, 1], 0)],
        0.75 * np.pi / 4,
    ),
    ("cylinder cut through its centre", [Cylinder(0.5, 2), HalfSpace([1, 0, 3], 0)], np.pi / 4),
    ("lying cylinder", [Placed(Cylinder(1, 3), (0, 0, 0.5), TO_X), HalfSpace([0, 0, 1], 0)], 3 * segment(1, 0.5)),
    ("hoof of a cylinder", [Placed(Cylinder(1, 4), (0, 0, 2)), HalfSpace([-1.5, 0, 1], 0)], 2 / 3 * 1.5),
    ("coaxial cylinders", [Cylinder(1, 3), Placed(Cylinder(0.5, 3), (0, 0, 1))], 2 * np.pi / 4),
    ("ball through a wider cylinder", [Sphere(1), Placed(Cylinder(2, 1), (0, 0, 0))], 4 * np.pi / 3 - 2 * cap(1, 0.5)),
    ("standing capsule", [Capsule(0.5, 2), HalfSpace([0, 0, 1], 0.5)], np.pi * (1 / 12 + 1.5 / 4)),
    ("cap of a standing capsule", [Capsule(0.5, 2), HalfSpace([0, 0, 1], -1.25)], cap(0.5, 0.25)),
    (
        "lying capsule",
        [Placed(Capsule(1, 3), (0, 0, 0.5), TO_X), HalfSpace([0, 0, 1], 0)],
        3 * segment(1, 0.5) + cap(1, 0.5),
    ),
    ("capsule in its own cylinder", [Capsule(0.5, 2), Cylinder(0.5, 2)], np.pi / 2),
    ("lens of two balls as capsules", [Capsule(1, 0), Placed(Capsule(1, 0), (1, 0, 0), TILT)], lens(1, 1, 1)),
    ("lens of the ends of two capsules", [Capsule(1, 2), Placed(Capsule(1, 2), (0, 0, 3))], lens(1, 1, 1)),
]


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3])
@pytest.mark.parametrize(("shapes", "volume"), [case[1:] for case in SMOOTH], ids=[case[0] for case in SMOOTH])
def test_smooth_closed_forms_lie_within_the_error_bound(shapes, volume, tolerance):
    answer = overlap(*shapes, tolerance=tolerance)
    assert_holds(answer, volume)
    # A polytope that need shrink by no more than the tolerance has a volume within three times the tolerance.
    assert answer.volume_error <= 3 * tolerance * (answer.volume + answer.volume_error)
    assert_is_a_closed_polytope(answer)


@pytest.mark.parametrize(("shapes", "volume"), [case[1:] for case in SMOOTH], ids=[case[0] for case in SMOOTH])
def test_smooth_closed_forms_hold_wherever_the_scene_stands(shapes, volume):
    bodies = [body if isinstance(body, Placed) else Placed(body) for body in shapes]
    turned = [moved(body, (100, -200, 50), turn([1.0, -2.0, 0.5])) for body in bodies]
    for found in (overlap(*turned), overlap(*turned[::-1])):
        # Where bodies are moved to is rounded.
        moving = 4 * EPS * 200 * found.area
        assert abs(found.volume - volume) <= found.volume_error + moving


def test_error_narrows_with_the_tolerance_where_there_is_no_closed_form():
    cylinders = (Cylinder(1, 4), Placed(Cylinder(1, 4), (0, 0, 0), (np.sqrt(0.5), 0, 0, np.sqrt(0.5))))
    errors = []
    for tolerance in (1e-1, 1e-2, 1e-3, 1e-4):
        answer = overlap(*cylinders, tolerance=tolerance)
        assert_holds(answer, 16 / 3)
        errors.append(answer.volume_error)
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] <= 3e-4 * 16 / 3


def test_lens_has_its_depth_normal_and_centre():
    answer = overlap(Sphere(1), Placed(Sphere(1), (1, 0, 0)))
    assert answer.depth == pytest.approx(1, rel=1e-9)
    assert_allclose(answer.normal, [-1, 0, 0], atol=1e-4)
    # The polytope has too much by at most 3 tolerances of its volume, and no farther away than its diameter.
    assert_allclose(answer.centroid, [0.5, 0, 0], atol=3e-3 * np.sqrt(3))


def test_centroid_of_a_cap_is_the_closed_form():
    h, tolerance = 0.25, 1e-4
    answer = overlap(Sphere(1), HalfSpace([0, 0, 1], -1 + h), tolerance=tolerance)
    assert_allclose(answer.centroid, [0, 0, -3 * (2 - h) ** 2 / (4 * (3 - h))], atol=3 * tolerance * 1.4)


def test_area_of_a_smooth_part_is_that_of_its_surface():
    answer = overlap(Sphere(1), Placed(Sphere(1), (1, 0, 0)), tolerance=1e-4)
    # The polytope holds the part and, shrunk by the tolerance, fits inside: so do their areas (convex bodies).
    assert 2 * np.pi * (1 - 1e-13) <= answer.area <= 2 * np.pi / (1 - 1e-4) ** 2


POLYHEDRAL = [
    ("box in a box", [Box([1, 2, 3]), Box([2, 3, 4])], 48),
    ("box with itself", [CUBE, CUBE], 8),
    ("tilted box with itself", [Placed(CUBE, (1, 2, 3), TILT), Placed(CUBE, (1, 2, 3), TILT)], 8),
    ("box in the corner of a box", [CUBE, Placed(CUBE, (1.5, 1.25, -1))], 0.375),
    ("box on the ground", [Placed(CUBE, (7, 8, 0.75)), HalfSpace([0, 0, 1], 0)], 1),
    ("tilted box cut through its centre", [Placed(Box([1, 2, 3]), orientation=TILT), HalfSpace([3, -1, 2], 0)], 24),
    ("corner of a box below the ground", [Placed(CUBE, (1, 1, 1)), HalfSpace([1, 1, 1], 1)], 1 / 6),
    ("six half-spaces", [HalfSpace(s * axis, 0.5) for axis in AXES for s in (2, -2)], 1 / 8),
    ("three planes and a slanted one", [*[HalfSpace(-axis, 0) for axis in AXES], HalfSpace([1, 1, 1], 1)], 1 / 6),
    ("octagon prism", [Placed(CUBE, orientation=turn([0, 0, np.pi / 4])), CUBE], 16 * (np.sqrt(2) - 1)),
    ("two wedges", [Hull(TETRA), Hull(-TETRA)], 4 / 3),
]


@pytest.mark.parametrize(("shapes", "volume"), [case[1:] for case in POLYHEDRAL], ids=[case[0] for case in POLYHEDRAL])
def test_polyhedral_closed_forms_are_exact_to_rounding(shapes, volume):
    for bodies in (shapes, shapes[::-1]):
        answer = overlap(*bodies)
        assert_holds(answer, volume)
        assert answer.volume == pytest.approx(volume, rel=1e-14)
        assert answer.volume_error <= 1e-11 * volume
        assert_is_a_closed_polytope(answer)


def test_box_in_a_box_has_the_measures_of_a_box():
    answer = overlap(Placed(CUBE, (1, 0, 0)), Placed(Box([1, 2, 3]), (0, 1, 2)))
    assert answer.volume == pytest.approx(4, rel=1e-14)
    assert_allclose(answer.centroid, [0.5, 0, 0], atol=1e-14)
    assert answer.area == pytest.approx(2 * (1 * 2 + 2 * 2 + 2 * 1), rel=1e-14)
    assert_allclose(answer.inertia, np.diag([4 * 8 / 12, 4 * 5 / 12, 4 * 5 / 12]), atol=1e-13)
    assert_allclose(answer.bounds, [[0, -1, -1], [1, 1, 1]], atol=1e-14)
    assert (len(answer.vertices), len(answer.facets)) == (8, 6)


def test_inertia_turns_with_the_bodies():
    a, b = Placed(Box([1, 2, 3]), (0.5, 0, 0)), Box([1, 3, 4])
    q = (0.3, -0.1, 0.7, 0.2)
    turned = overlap(moved(a, (1, 2, 3), q), moved(Placed(b), (1, 2, 3), q))
    assert_allclose(turned.inertia, rotation(q) @ overlap(a, b).inertia @ rotation(q).T, atol=1e-12)


# Regular compounds


def test_stella_octangula_holds_an_octahedron():
    answer = overlap(TETRA, -TETRA)
    assert (len(answer.facets), len(answer.vertices), len(edges_with_owners(answer))) == (8, 6, 12)
    assert sorted(answer.owner) == [0] * 4 + [1] * 4
    assert answer.volume == pytest.approx(4 / 3, rel=1e-14)
    assert_allclose(answer.inertia, np.eye(3) * 4 / 15, atol=1e-14)
    assert_is_a_closed_polytope(answer)


def turned_five_times(shape):
    """Five copies about a fivefold axis of the dodecahedron whose corners include those of the cube."""
    axis = np.array([0, 1, GOLDEN]) / np.hypot(1, GOLDEN)
    return [Placed(shape, orientation=turn(2 * np.pi * k / 5 * axis)) for k in range(5)]


def test_five_cubes_hold_a_rhombic_triacontahedron():
    answer = overlap(*turned_five_times(CUBE))
    assert (len(answer.facets), len(answer.vertices), len(edges_with_owners(answer))) == (30, 32, 60)
    assert [len(facet) for facet in answer.facets] == [4] * 30
    assert_array_equal(np.bincount(answer.owner), [6] * 5)
    edge = np.sqrt(1 + GOLDEN**2) / GOLDEN**2
    assert answer.volume == pytest.approx(4 * np.sqrt(5 + 2 * np.sqrt(5)) * edge**3, rel=1e-14)
    assert answer.area == pytest.approx(12 * np.sqrt(5) * edge**2, rel=1e-14)
    assert_is_a_closed_polytope(answer)


def test_five_tetrahedra_hold_an_icosahedron():
    answer = overlap(*turned_five_times(Hull(TETRA)))
    assert (len(answer.facets), len(answer.vertices), len(edges_with_owners(answer))) == (20, 12, 30)
    assert_array_equal(np.bincount(answer.owner), [4] * 5)
    edge = 2 / GOLDEN**2
    assert answer.volume == pytest.approx(5 / 12 * (3 + np.sqrt(5)) * edge**3, rel=1e-14)
    assert_is_a_closed_polytope(answer)


# The exact truth


@pytest.mark.parametrize("seed", range(40))
def test_measures_of_hulls_are_the_exact_ones(seed):
    p, q = overlapping_points(np.random.default_rng(seed), low=4, high=14)
    a, b = exact.hull(p), exact.hull(q)
    truth, answer = exact.common(a, b), overlap(p, q)
    volume, size = float(truth.volume), np.ptp(p)
    assert_holds(answer, volume)
    assert answer.volume == pytest.approx(volume, rel=1e-12)
    assert_allclose(answer.centroid, [float(c) for c in truth.centroid], atol=1e-13 * size)
    assert answer.area == pytest.approx(truth.area, rel=1e-12)
    assert (len(answer.vertices), len(answer.facets)) == (len(truth.vertices), len(truth.facets))
    assert sorted(answer.owner) == sorted(facet.owners[0] for facet in truth.facets)
    for body in (0, 1):
        assert_allclose(answer.gradient[body, :3], [float(c) for c in truth.pull(body)], atol=1e-12 * truth.area)


def test_inertia_of_hulls_is_the_exact_one():
    for seed in range(3):
        p, q = overlapping_points(np.random.default_rng(seed), low=4, high=8)
        truth = np.array(exact.common(exact.hull(p), exact.hull(q)).inertia, float)
        assert_allclose(overlap(p, q).inertia, truth, atol=1e-13 * np.trace(truth))


def test_sums_over_many_facets_are_rounded_no_more_than_those_over_few():
    below = Placed(HalfSpace(directions(np.random.default_rng(0), 1)[0], 0.1))
    answer = overlap(icosphere(5), below)
    corners = answer.vertices[answer.faces].astype(np.longdouble) - answer.vertices.mean(axis=0)
    sixth = np.linalg.det(corners.astype(float)).astype(np.longdouble) / 6
    weighted = np.concatenate([corners, corners.sum(axis=1, keepdims=True)], axis=1)
    first = (sixth[:, None] * corners.sum(axis=1)).sum(axis=0) / 4
    second = np.einsum("f,fki,fkj->ij", sixth / 20, weighted, weighted) - np.outer(first, first) / sixth.sum()
    assert answer.volume == pytest.approx(float(sixth.sum()), rel=1e-14)
    inertia = (np.trace(second) * np.eye(3) - second).astype(float)
    assert_allclose(answer.inertia, inertia, atol=2e-14 * np.trace(inertia))


@pytest.mark.parametrize("count", [3, 4, 6, 10])
def test_many_hulls_have_the_exact_volume(count):
    for seed in range(3):
        clouds = overlapping_points(np.random.default_rng([count, seed]), count, low=6, high=12)
        truth, answer = exact.common(*map(exact.hull, clouds)), overlap(*clouds)
        assert_holds(answer, float(truth.volume))
        assert answer.volume == pytest.approx(float(truth.volume), rel=1e-12)
        assert_array_equal(
            np.bincount(answer.owner, minlength=count),
            np.bincount([facet.owners[0] for facet in truth.facets], minlength=count),
        )


@given(lattice_points(), lattice_points(), vectors())
def test_degenerate_hulls_have_the_exact_answer(p, q, shift):
    q = q + np.round(shift * 2)
    truth, answer = exact.common(exact.hull(p), exact.hull(q)), overlap(p, q)
    expected = {3: "overlapping", 2: "touching", 1: "touching", 0: "touching", -1: "separated"}[truth.dimension]
    assert answer.status == expected
    assert abs(answer.volume - float(truth.volume)) <= answer.volume_error
    assert answer.volume == pytest.approx(float(truth.volume), rel=1e-12)
    if truth.dimension == 3:
        assert (len(answer.vertices), len(answer.facets)) == (len(truth.vertices), len(truth.facets))
        assert_is_a_closed_polytope(answer)


@pytest.mark.parametrize("power", range(1, 17))
def test_error_bound_holds_for_slivers_of_any_thickness(power):
    thickness = 10.0**-power
    a, b = CORNERS, CORNERS * 0.5 + (0.25, 0.125, 1.5 - thickness)
    truth = exact.common(exact.hull(a), exact.hull(b))
    answer = overlap(a, b)
    assert abs(answer.volume - float(truth.volume)) <= answer.volume_error
    assert answer.status == "overlapping" or power > 14
    # Coordinates of size 2 are known to 2 EPS each: that much of the thickness is rounding.
    assert answer.volume == pytest.approx(float(truth.volume), abs=8 * EPS)


@pytest.mark.parametrize("power", range(1, 13))
def test_error_bound_holds_for_a_tilted_sliver(power):
    rng = np.random.default_rng(power)
    p, q = (hull_points(rng, 12) for _ in range(2))
    u = directions(rng, 1)[0]
    q += u * ((p @ u).max() - (q @ u).min() - 10.0**-power)
    truth = exact.common(exact.hull(p), exact.hull(q))
    answer = overlap(p, q)
    assert abs(answer.volume - float(truth.volume)) <= answer.volume_error
    assert (answer.status == "overlapping") == (truth.dimension == 3)


# Invariants


@given(placed(solids), placed(solids))
def test_nothing_is_raised_and_no_measure_is_negative(a, b):
    answer = overlap(a, b, tolerance=1e-2)
    assert answer.status in ("separated", "touching", "overlapping")
    assert bool(answer) == (answer.status == "overlapping") == (answer.volume > 0)
    assert min(answer.volume, answer.volume_error, answer.area, answer.depth, answer.distance) >= 0
    assert answer.volume - answer.volume_error <= min(a.volume, b.volume) * (1 + 1e-12)
    if answer:
        assert_is_a_closed_polytope(answer)
    else:
        assert answer.centroid is None
        assert answer.bounds is None
        assert not answer.gradient.any()
        assert not answer.inertia.any()
        assert answer.patch == []


@given(st.lists(placed(solids), min_size=2, max_size=4), st.randoms(use_true_random=False))
def test_order_of_bodies_changes_their_names_and_no_bit(bodies, random):
    # Either of two bodies that coincide may be the first.
    assume(len({(repr(b.shape), *b.position.tolist(), *b.orientation.tolist()) for b in bodies}) == len(bodies))
    order = random.sample(range(len(bodies)), len(bodies))
    first = overlap(*bodies, tolerance=1e-2)
    answer = overlap(*[bodies[i] for i in order], tolerance=1e-2)
    assert (answer.status, answer.volume, answer.volume_error, answer.area) == (
        first.status, first.volume, first.volume_error, first.area
    )  # fmt: skip
    assert_array_equal(answer.vertices, first.vertices)
    assert_array_equal(answer.inertia, first.inertia)
    assert_array_equal(answer.gradient, first.gradient[order])
    assert_array_equal(np.array(order, int)[answer.owner], first.owner)
    if first:
        assert_array_equal(answer.centroid, first.centroid)
    if len(bodies) == 2 and order == [1, 0]:
        assert (answer.depth, answer.distance) == (first.depth, first.distance)
        assert distance(*bodies) == distance(*bodies[::-1])
        assert penetration_depth(*bodies) == penetration_depth(*bodies[::-1])
        assert_array_equal(answer.normal, -first.normal)


@given(in_general_position(polyhedra, 2, 2), vectors(100), quaternions())
def test_rigid_motion_moves_the_answer_along(bodies, translation, q):
    a, b = bodies
    here, there = overlap(a, b), overlap(moved(a, translation, q), moved(b, translation, q))
    assert there.volume == pytest.approx(here.volume, rel=1e-9, abs=1e-12)
    assume(here.volume > 1e-6)
    assert there.area == pytest.approx(here.area, rel=1e-9)
    assert there.depth == pytest.approx(here.depth, rel=1e-9)
    assert_allclose(there.centroid, rotation(q) @ here.centroid + translation, atol=1e-9)
    assert_allclose(there.gradient[:, :3], here.gradient[:, :3] @ rotation(q).T, atol=1e-9)


def scaled(body, size):
    shape = body.shape
    larger = Box(shape.half_extents * size) if isinstance(shape, Box) else Hull(shape.vertices * size)
    return Placed(larger, body.position * size, body.given_orientation)


@pytest.mark.parametrize("size", [1e-3, 2.0**-3, 1e3])
@given(a=placed(polyhedra), b=placed(polyhedra))
def test_every_measure_has_its_power_of_the_scale(size, a, b):
    one, other = overlap(a, b), overlap(scaled(a, size), scaled(b, size))
    assume(one.volume > 1e-6)
    assert other.volume == pytest.approx(one.volume * size**3, rel=1e-9)
    assert other.area == pytest.approx(one.area * size**2, rel=1e-9)
    assert other.depth == pytest.approx(one.depth * size, rel=1e-9)
    assert_allclose(other.inertia, one.inertia * size**5, rtol=1e-8, atol=1e-9 * np.trace(one.inertia) * size**5)
    if size == 2.0**-3:  # nothing is rounded
        assert len(other.facets) == len(one.facets)


@pytest.mark.parametrize("size", [2.0**-20, 2.0**20])
@pytest.mark.parametrize("count", [2, 3, 5])
def test_a_power_of_two_scales_the_error_and_leaves_the_way_as_it_is(size, count):
    """No bound has a length of its own: nothing is rounded by such a scale, whatever the way."""
    rng = np.random.default_rng(count)
    ways = set()
    for _ in range(20):
        bodies = [
            Placed(Box(rng.uniform(0.5, 1, 3)), rng.normal(size=3) * 0.3, rng.normal(size=4)) for _ in range(count)
        ]
        one, other = overlap(*bodies), overlap(*(scaled(body, size) for body in bodies))
        ways.add(one.way)
        assert (other.way, other.volume, other.volume_error) == (
            one.way, one.volume * size**3, one.volume_error * size**3
        )  # fmt: skip
    assert "clipping" in ways


@given(st.lists(placed(polyhedra), min_size=2, max_size=5))
def test_vertices_lie_in_every_body_and_facets_on_their_owner(bodies):
    answer = overlap(*bodies)
    assume(answer)
    planes = [Hull(placed_points(body)).halfspaces for body in bodies]
    for halfspaces in planes:
        assert (answer.vertices @ halfspaces[:, :3].T + halfspaces[:, 3]).max() <= 1e-13
    for ring, owner, (*normal, offset) in zip(answer.facets, answer.owner, answer.halfspaces, strict=True):
        assert_allclose(answer.vertices[ring] @ normal + offset, 0, atol=1e-13)
        assert np.abs(planes[owner] - [*normal, offset]).max(1).min() < 1e-12


@given(placed(solids), placed(solids))
def test_every_vertex_and_the_centroid_are_within_tolerance_of_both_bodies(a, b):
    tolerance = 1e-2
    answer = overlap(a, b, tolerance=tolerance)
    assume(answer)
    u = directions(np.random.default_rng(1), 100)
    size = np.ptp(answer.vertices, axis=0).max() * np.sqrt(3)
    for body in (a, b):
        beyond = answer.vertices @ u.T - [reach(body, direction) for direction in u]
        assert beyond.max() <= tolerance * size + 1e-12
        assert (u @ answer.centroid <= [reach(body, direction) + tolerance * size for direction in u]).all()


@given(placed(polyhedra), placed(polyhedra), placed(polyhedra))
def test_volume_shrinks_with_every_further_body(a, b, c):
    two, three = overlap(a, b), overlap(a, b, c)
    assert three.volume <= two.volume * (1 + 1e-12)
    assert two.volume <= min(a.volume, b.volume) * (1 + 1e-12)


@given(placed(solids), placed(solids))
def test_forces_on_all_bodies_cancel(a, b):
    answer = overlap(a, b, tolerance=1e-2)
    assume(answer)
    force, moment = answer.gradient[:, :3], answer.gradient[:, 3:]
    assert_allclose(force.sum(0), 0, atol=1e-12 * answer.area)
    about_origin = moment + np.cross([a.position, b.position], force)
    assert_allclose(about_origin.sum(0), 0, atol=1e-11 * answer.area)


# Patch


@given(in_general_position(polyhedra, 2, 4))
def test_patch_is_the_closed_border_between_owners(bodies):
    answer = overlap(*bodies)
    assume(answer)
    borders = {edge for edge, owners in edges_with_owners(answer).items() if owners[0] != owners[1]}
    index = {tuple(v): i for i, v in enumerate(answer.vertices)}
    walked = []
    for loop in answer.patch:
        assert loop.shape[1:] == (3,)
        assert len(loop) >= 3
        ring = [index[tuple(v)] for v in loop]
        walked += [(min(u, v), max(u, v)) for u, v in zip(ring, np.roll(ring, -1), strict=True)]
    # A pair has one loop around the facets of the first body. Three or more bodies have a loop around those of each.
    assert sorted(walked) == sorted([*borders] if len(bodies) == 2 else [*borders, *borders])


@given(placed(polyhedra), placed(polyhedra))
def test_patch_lies_on_the_surfaces_of_both_bodies(a, b):
    answer = overlap(a, b)
    assume(answer)
    for body in (a, b):
        halfspaces = Hull(placed_points(body)).halfspaces
        for loop in answer.patch:
            assert_allclose((loop @ halfspaces[:, :3].T + halfspaces[:, 3]).max(1), 0, atol=1e-12)


def test_patch_of_a_box_through_a_plate_is_two_loops():
    answer = overlap(Box([0.5, 0.5, 2]), Box([2, 2, 0.25]))
    assert sorted(len(loop) for loop in answer.patch) == [4, 4]
    assert_allclose(sorted(loop[:, 2].tolist() for loop in answer.patch), [[-0.25] * 4, [0.25] * 4], rtol=4 * EPS)


def test_patch_of_a_body_inside_another_is_empty():
    assert overlap(CUBE, Placed(Box([3, 3, 3]), orientation=TILT)).patch == []


def test_patch_of_a_lens_is_its_circle():
    (loop,) = overlap(Sphere(1), Placed(Sphere(1), (1, 0, 0)), tolerance=1e-3).patch
    assert_allclose(loop[:, 0], 0.5, atol=3e-3)
    assert_allclose(np.hypot(loop[:, 1], loop[:, 2]), np.sqrt(0.75), atol=5e-3)
    angles = np.unwrap(np.arctan2(loop[:, 2], loop[:, 1]))
    assert abs(angles[-1] - angles[0]) == pytest.approx(2 * np.pi, abs=0.7)


# Gradient


def slopes(bodies, which, tolerance=1e-3, step=1e-5):
    """Central differences of the volume by the translation and rotation of one body about its own position."""
    body, found = bodies[which], []

    def volume(pose):
        others = [pose if i == which else other for i, other in enumerate(bodies)]
        return overlap(*others, tolerance=tolerance).volume

    for axis in step * AXES:
        ahead, back = moved(body, axis), moved(body, -axis)
        found.append((volume(ahead) - volume(back)) / (2 * step))
    for axis in step * AXES:
        ahead, back = (
            Placed(body.shape, body.position, moved(body, (0, 0, 0), turn(s * axis)).orientation) for s in (1, -1)
        )
        found.append((volume(ahead) - volume(back)) / (2 * step))
    return np.array(found)


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("seed", range(6))
def test_gradient_is_the_slope_of_the_volume(seed, count):
    rng = np.random.default_rng([seed, count])
    bodies = [Placed(Hull(p), rng.normal(size=3) * 0.1, quaternion(rng)) for p in overlapping_points(rng, count)]
    gradient = overlap(*bodies).gradient
    assert gradient.shape == (count, 6)
    for i in range(count):
        # The step squared times the third derivative, and rounding over the step: both far below 1e-7.
        assert_allclose(gradient[i], slopes(bodies, i), atol=1e-7)


def test_gradient_of_a_box_sunk_in_the_ground_is_its_waterline():
    floating = Placed(Box([1, 2, 3]), (5, 6, 2.5))
    answer = overlap(floating, HalfSpace([0, 0, 1], 0))
    assert_allclose(answer.gradient[0, :3], [0, 0, -8], atol=1e-12)
    assert_allclose(answer.gradient[1, :3], [0, 0, 8], atol=1e-12)
    assert_allclose(answer.gradient[0, 3:], 0, atol=1e-11)


def test_gradient_of_a_lens_is_the_slope_of_its_closed_form():
    answer = overlap(Sphere(1), Placed(Sphere(1), (1, 0, 0)), tolerance=1e-4)
    slope = (lens(1, 1, 1 + 1e-5) - lens(1, 1, 1 - 1e-5)) / 2e-5
    assert_allclose(answer.gradient[1], [slope, 0, 0, 0, 0, 0], atol=3e-4 * abs(slope))
    assert_allclose(answer.gradient[0, :3], [-slope, 0, 0], atol=3e-4 * abs(slope))


def test_gradient_by_turning_a_ball_is_zero():
    answer = overlap(Sphere(1), Placed(Box([1, 1, 1]), (1.2, 0.3, 0.1), TILT))
    assert_allclose(answer.gradient[0, 3:], 0, atol=3e-3 * answer.area)


# Three or more


def around(distance):
    """Three poses about the z axis, each at the given distance and turned to face the axis."""
    angles = 2 * np.pi * np.arange(3) / 3
    return [(distance * np.array([np.sin(t), -np.cos(t), 0]), turn([0, 0, t])) for t in angles]


@pytest.mark.parametrize(
    "bodies",
    [
        [Placed(Box([1.2, 0.1, 0.5]), *pose) for pose in around(0.5)],
        [Placed(Sphere(1), *pose) for pose in around(1.1)],
        [Placed(Cylinder(1, 3), *pose) for pose in around(1.1)],
    ],
    ids=["a triangle of rods", "balls around a hole", "pipes around a hole"],
)
def test_three_bodies_that_only_meet_in_pairs_are_separated(bodies):
    for a, b in permutations(bodies, 2):
        assert overlap(a, b).status == "overlapping"
    for order in permutations(bodies):
        answer = overlap(*order)
        assert answer.status == "separated"
        assert not answer
        assert answer.volume == answer.volume_error == 0


@given(st.lists(placed(polyhedra, spread=0.4), min_size=3, max_size=10))
def test_common_part_of_many_is_that_of_their_hulls_exactly(bodies):
    clouds = [placed_points(body) for body in bodies]
    truth, answer = exact.common(*map(exact.hull, clouds)), overlap(*clouds)
    assert abs(answer.volume - float(truth.volume)) <= answer.volume_error
    assert answer.volume == pytest.approx(float(truth.volume), rel=1e-9, abs=1e-15)
    assert (answer.normal, answer.depth, answer.distance, answer.separating_plane) == (None, None, None, None)
    assert (answer.witness_a, answer.witness_b) == (None, None)


def test_three_boxes_that_share_a_corner_touch():
    boxes = [Placed(CUBE, position) for position in ((-1, -1, -1), (1, 1, -1), (1, -1, 1))]
    assert overlap(*boxes).status == "touching"


# The answer as a value


def test_answer_keeps_what_it_was_asked():
    a, b = Placed(CUBE, (1, 0, 0)), Sphere(1)
    answer = overlap(a, b, tolerance=0.01)
    assert [type(body) for body in answer.shapes] == [Placed, Placed]
    assert_array_equal(answer.shapes[0].position, [1, 0, 0])
    assert answer.shapes[1].shape.radius == 1
    assert (answer.tolerance, answer.method) == (0.01, "auto")


def test_answer_cannot_be_changed():
    answer = overlap(CUBE, Placed(CUBE, (1, 0, 0)))
    for name in (name for name in dir(answer) if not name.startswith("_")):
        with pytest.raises(AttributeError):
            setattr(answer, name, None)
        value = getattr(answer, name)
        if isinstance(value, np.ndarray) and value.flags.writeable:
            before = value.copy()
            value += 1
            assert_array_equal(getattr(answer, name), before)


def test_answer_prints_its_status_and_measures():
    text = repr(overlap(CUBE, Placed(CUBE, (1.5, 0, 0))))
    assert all(part in text for part in ("Overlap", "overlapping", "volume")), text
    apart = repr(overlap(CUBE, Placed(CUBE, (2.5, 0, 0))))
    assert all(part in apart for part in ("separated", "distance", "0.5")), apart
    assert "touching" in repr(overlap(CUBE, Placed(CUBE, (2, 0, 0))))


def test_arrays_have_the_documented_types():
    answer = overlap(CUBE, Placed(CUBE, (1, 0.5, 0.25), TILT))
    assert answer.vertices.dtype == answer.halfspaces.dtype == answer.gradient.dtype == np.float64
    assert answer.faces.dtype == answer.owner.dtype == answer.facets[0].dtype == np.int32
    assert answer.vertices.shape[1:] == answer.faces.shape[1:] == (3,)
    assert answer.halfspaces.shape == (len(answer.facets), 4)
    assert answer.facets_touched >= len({0, 1} & set(answer.owner))


@pytest.mark.parametrize("bodies", [(), (CUBE,)])
def test_fewer_than_two_bodies_are_a_value_error(bodies):
    with pytest.raises(ValueError, match="shapes"):
        overlap(*bodies)


def test_same_question_has_the_same_bits():
    rng = np.random.default_rng(3)
    p, q = overlapping_points(rng)
    first, second = overlap(p, q), overlap(p, q)
    assert first.volume == second.volume
    assert_array_equal(first.vertices, second.vertices)
    assert_array_equal(first.gradient, second.gradient)


# Coordinates that are tiny but not zero would make products that underflow, were they not taken for rounding.
TINY = [0.0, 1e-20, 6.847828877979682e-28, 1e-45, 3.9066743815899546e-97, 1e-150, 1e-244, 1e-300]


@pytest.mark.parametrize("tiny", TINY)
@pytest.mark.parametrize("size", [1.0, 1e3])
def test_noise_far_below_rounding_changes_nothing(tiny, size):
    shape = Box(size * np.array([0.5, 1, 0.5]))
    a = Placed(shape, (0, 0, size))
    b = Placed(shape, (0, size, size), (0, -0.031234752377721213, 0.9995120760870788, tiny))
    truth = exact.common(exact.hull(placed_points(a)), exact.hull(placed_points(b)))
    assert overlap(a, b).volume == pytest.approx(float(truth.volume), rel=1e-14)


@pytest.mark.parametrize("tiny", TINY)
def test_ball_with_itself_turned_by_noise_is_the_ball(tiny):
    ball = Sphere(0.5454022162416995)
    turned = Placed(ball, (0, 0, 0), (-0.8970927660887382, 0, tiny, -0.44184224450730886))
    answer = overlap(Placed(ball, (0, 0, 0), (1, 0, 0, 1)), turned, tolerance=1e-2)
    assert abs(answer.volume - ball.volume) <= answer.volume_error


@pytest.mark.parametrize("power", range(1, 13))
@pytest.mark.parametrize("kind", ["turned", "vertex first", "wedge", "far away"])
def test_thin_overlaps_are_right_to_twelve_digits(kind, power):
    """Where doubles cannot place the volume, it is computed in wider arithmetic from the corners as given."""
    rng = np.random.default_rng(power)
    turned = rotation(quaternion(rng))
    p, q = CORNERS @ turned.T, (CORNERS * 0.75 + (1.75 - 10.0**-power, 0.3, 0.2)) @ turned.T
    if kind == "wedge":
        q = q @ rotation([0, 0, 0.3 * 10.0**-power, 1]).T
    if kind == "vertex first":
        p, q = hull_points(rng, 8), hull_points(rng, 8)
        deep = overlap(p, q)
        p = p + deep.normal * deep.depth * (1 - 10.0**-power)
    if kind == "far away":
        p, q = p + [3e5, -2e6, 7e4], q + [3e5, -2e6, 7e4]
    truth = exact.common(exact.hull(p), exact.hull(q))
    answer = overlap(p, q)
    if truth.volume:
        assert answer.volume == pytest.approx(float(truth.volume), rel=1e-12)
        assert abs(answer.volume - float(truth.volume)) <= answer.volume_error <= 1e-12 * answer.volume
        assert answer.widened or power < 4
    else:
        assert answer.status == "separated"


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"tolerance": "fine"}, "tolerance must be a number"),
        ({"tolerance": None}, "tolerance must be a number"),
        *(({"tolerance": each}, "tolerance must be greater than 0 and less than 1") for each in (0, -1, float("nan"))),
        ({"method": 3}, "method must be 'auto' or 'paper'"),
        ({"method": "best"}, "method must be 'auto' or 'paper', not 'best'"),
    ],
)
def test_settings_that_make_no_sense_are_named_in_one_sentence(settings, message):
    with pytest.raises((TypeError, ValueError)) as refused:
        overlap(Sphere(1), Sphere(1), **settings)
    assert str(refused.value) == message


@pytest.mark.parametrize("radius", [1e-4, 2.0**-27, 1e-12])
@pytest.mark.parametrize("turn", [(0, 0, 0, 1), (0, 0, 0.00097656203433904576, 0.99999952316318286)])
def test_thin_wires_side_by_side_share_a_lens_all_along(radius, turn):
    apart = radius / 8
    wires = Placed(Capsule(radius, 1)), Placed(Capsule(radius, 1), (-apart, 0, 0), turn)
    found = overlap(*wires, tolerance=0.0125)
    across = 2 * radius**2 * np.arccos(1 / 16) - apart / 2 * np.sqrt(4 * radius**2 - apart**2)
    assert abs(found.volume - across) <= found.volume_error + 2 * np.pi * radius**3
    assert found.volume_error <= 0.0125 * across
    assert found.area == pytest.approx(4 * radius * np.arccos(1 / 16), rel=0.01)


@pytest.mark.parametrize("tolerance", [0.05, 0.02, 0.01, 0.002, 0.001])
def test_a_capsule_and_a_cylinder_share_a_sliver_along_both(tolerance):
    # Where rays leave the capsule near the beginning of an end, a tangent must not be that of its ball's other side.
    capsule = Placed(
        Capsule(0.408941156187604, 0.4905299775363593), (-0.35265713922716, 0.7632413550700711, -0.6488068416050803)
    )
    cylinder = Placed(
        Cylinder(0.20263550328296642, 0.5140302035720937),
        (-0.877223937261219, 0.44882811615307255, -0.6488068416050803),
    )
    found = overlap(capsule, cylinder, tolerance=tolerance)
    depth = found.depth
    assert depth == pytest.approx(2.6157e-12, rel=1e-4)
    chord = 2 * np.sqrt(2 * depth / (1 / capsule.shape.radius + 1 / cylinder.shape.radius))
    assert found.volume == pytest.approx(2 / 3 * depth * chord * capsule.shape.length, rel=3 * tolerance + 1e-2)


def test_corners_of_facets_at_small_angles_lie_in_their_planes():
    points = [[-22, 39, 7], [-5, 41, -13], [-51, -17, 18], [-11, -25, 36], [-31, -6, 39], [-15, -22, 37], [6, -26, -36]]
    points += [[15, -39, 14], [43, 31, 5], [42, -7, -32], [-1, -36, 24], [41, -16, -29], [-54, 20, -6], [-5, 42, -2]]
    found = overlap(Box([1, 1, 1]), np.array([*points, [-11, 17, 41]]) / 64)
    for facet, (*normal, offset) in zip(found.facets, found.halfspaces):
        assert_allclose(found.vertices[facet] @ normal, -offset, atol=1e-14)


@pytest.mark.parametrize("far", [2.0**20, 2.0**30])
@pytest.mark.parametrize(
    ("shapes", "way"),
    [
        ([Box([1, 1, 1]), Box([1, 0.5, 1])], "clipping"),
        ([Box([1, 1, 1]), Box([1, 0.5, 1]), Box([0.5, 1, 1])], "clipping"),
        ([Sphere(1), Sphere(0.75)], "closed form"),
        ([Box([1, 1, 1]), Cylinder(0.75, 1)], "closed form"),
        ([Cylinder(1.5, 1), Cylinder(0.75, 2)], "slicing"),
    ],
)
def test_gradients_are_as_good_far_from_the_origin_as_near(shapes, way, far):
    scale, turn = 2.0**-10, (0.1, 0.2, 0.3, 0.9)
    small = [
        Box(scale * each.half_extents)
        if isinstance(each, Box)
        else Sphere(scale * each.radius)
        if isinstance(each, Sphere)
        else Cylinder(scale * each.radius, scale * each.length)
        for each in shapes
    ]
    steps = scale * np.array([[0, 0, 0], [1.25, 0.25, 0.5], [0.5, 0.25, -0.25]])

    def found(at):
        return overlap(*(Placed(each, at + step, turn) for each, step in zip(small, steps)))

    near = found(np.zeros(3))
    assert near.way == way
    off = np.abs(found(np.full(3, far)).gradient - near.gradient).max(axis=0) / np.abs(near.gradient).max()
    assert off[:3].max() < 1e-11
    assert off[3:].max() < 1e-11 * scale


def test_a_capsule_of_length_0_shares_what_a_ball_shares():
    box, turn = Box([0.5, 0.5, 0.5]), (0.1, 0.2, 0.3, 0.9)
    for position in [(0.7, 0.6, 0.8), (0.9, 0.2, 0.1)]:
        capsule, ball = (overlap(box, Placed(each, position, turn)) for each in (Capsule(0.5, 0), Sphere(0.5)))
        assert abs(capsule.volume - ball.volume) <= capsule.volume_error + ball.volume_error < 3e-3 * ball.volume
