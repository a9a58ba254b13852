"""The rational signed distance against the Minkowski difference, and against closed forms of round bodies."""

from fractions import Fraction

import exact
import numpy as np
import pytest
from exact_distance import core, of_cores, root, signed_distance
from families import CORNERS, FAMILIES, Below, make

from overlapper import Capsule, Cylinder, Placed, Sphere

SMALL = 300  # pairs of vertices of which the difference is made in a moment


def pairs_of_polytopes(seed):
    for family in FAMILIES:
        case = make(family, seed)
        bodies = () if case.round or any(isinstance(body, Below) for body in case.bodies) else case.bodies
        if len(bodies) == 2 and np.prod([len(solid.vertices) for solid in case.solids]) < SMALL:
            yield case


@pytest.mark.parametrize("seed", range(3))
def test_polytopes_of_every_family_are_as_deep_or_far_apart_as_the_origin_is_in_their_difference(seed):
    deep = apart = 0
    for case in pairs_of_polytopes(seed):
        found = signed_distance(*case.solids)
        by_difference = root(exact.distance_squared(*case.solids)) or -root(exact.depth_squared(*case.solids))
        assert abs(found - by_difference) <= abs(by_difference) / 10**45
        deep, apart = deep + (found < 0), apart + (found > 0)
    assert deep > 5 and apart > 0


def test_directions_upright_on_edges_that_are_almost_parallel_are_not_overlooked():
    roof = np.array([(x, y, -abs(y)) for x in (-1, 1) for y in (-1, 0, 1)], float)
    for angle in (2.0**-20, 2.0**-30, 2.0**-45):
        other = roof[:, [0, 1, 2]] * [1, 1, -1] + roof[:, [1, 0, 2]] * [-angle, angle, 0]
        other[:, 2] = np.abs(roof[:, 1]) - angle / 8
        a, b = exact.hull(roof), exact.hull(other)
        assert signed_distance(a, b) == -root(exact.depth_squared(a, b)) < 0


def test_a_square_root_has_its_digits_whatever_its_size():
    for square in (Fraction(2), Fraction(2, 10**60), Fraction(2 * 10**60), Fraction(2, 10**400)):
        assert abs(root(square) ** 2 - square) < square / 10**49
    assert root(Fraction(9, 4)) == Fraction(3, 2) and root(Fraction(0)) == 0


@pytest.mark.parametrize("distance", [3.0, 2.0, 1.25, 0.0])
def test_balls_are_as_far_apart_as_their_centres_less_their_radii(distance):
    assert signed_distance(Placed(Sphere(1.5)), Placed(Sphere(0.5), (0, distance, 0))) == Fraction(distance) - 2


def test_capsules_that_cross_are_as_deep_as_both_radii_and_others_as_near_as_their_segments():
    upright = Placed(Capsule(0.25, 2))
    lying = Placed(Capsule(0.5, 2), (0.5, 0, 0), (0, 1, 0, 1))
    assert signed_distance(upright, lying) == -Fraction(3, 4)
    assert signed_distance(upright, Placed(Capsule(0.5, 2), (3, 4, 1))) == 5 - Fraction(3, 4)
    assert signed_distance(upright, Placed(Capsule(0.5, 2), (0, 0, 5))) == 3 - Fraction(3, 4)


def test_a_ball_leaves_a_cube_by_the_nearest_face_and_is_as_far_from_its_corner_as_its_centre():
    cube = exact.hull(CORNERS)
    assert signed_distance(Placed(Sphere(0.5), (0.25, 0, 0)), cube) == -Fraction(5, 4)
    assert signed_distance(cube, Placed(Sphere(0.5), (2, 3, 3))) == Fraction(5, 2)


@pytest.mark.parametrize("height", [1.75, 1.5, 2.0, 3.0])
def test_a_cylinder_is_over_a_face_by_its_bottom_or_by_the_lowest_point_of_its_rim(height):
    cube = exact.hull(CORNERS * [2, 2, 1])
    assert signed_distance(Placed(Cylinder(0.5, 1), (0, 0, height)), cube) == Fraction(height) - Fraction(3, 2)
    tilted = Placed(Cylinder(0.5, 1), (0.25, 0, height), (1, 0, 0, 2))  # its axis by the cosine 3/5
    assert signed_distance(cube, tilted) == pytest.approx(height - 1 - 0.7, abs=1e-15)


def test_a_cylinder_beside_an_edge_is_not_known_and_neither_is_one_beside_a_ball():
    beside = Placed(Cylinder(0.5, 1), (1.25, 1.25, 0))
    assert signed_distance(beside, exact.hull(CORNERS)) is None
    assert signed_distance(beside, Placed(Sphere(1))) is None


def test_flat_and_thin_cores_have_no_inside():
    segments = [core(Placed(Capsule(0.5, 2), at)) for at in ((0, 0, 0), (0, 0, 1))]
    assert of_cores(*segments) == -1
    assert of_cores(core(Placed(Sphere(1))), segments[0]) == -Fraction(3, 2)


def test_round_contacts_are_as_deep_or_far_apart_as_stated():
    """To the rounding of their places, which grows with the distance from the origin."""
    met = set()
    for seed in range(60):
        case = make("round_contacts", seed)
        found = signed_distance(*(body if isinstance(body, Placed) else exact.hull(body) for body in case.bodies))
        if found is None:
            assert case.detail.startswith("cylinder")
            continue
        noise = 16 * 2.0**-53 * max(float(np.abs(box).max()) for box in reaches(case))
        if "capsule" not in case.detail or case.detail.endswith("facet"):
            assert float(found) == pytest.approx(-case.parameter, abs=noise)
        else:
            assert float(found) >= -case.parameter - noise
        met.add(case.detail)
    assert len(met) > 8


def reaches(case):
    return [body.bounds if isinstance(body, Placed) else body for body in case.bodies]
