"""The arbiter's bounds hold the exact signed distance, and meet: closed forms, sampled directions, the last bit."""

import itertools

import numpy as np
import pytest
from strategies import directions, hull_points, moved, quaternion, reach

from overlapper import Box, Capsule, Cylinder, HalfSpace, Hull, Placed, Sphere, overlap
from overlapper.proof.signed_distance import signed_distance_bounds

CUBE = Box([0.5, 0.5, 0.5])

CLOSED_FORMS = {
    "cubes_face_to_face": (Placed(CUBE), Placed(CUBE, (0.75, 0.1, 0.2)), -0.25),
    "cubes_corner_to_corner": (Placed(CUBE), Placed(CUBE, (1.75, 1.75, 1.75)), 0.75 * np.sqrt(3)),
    "one_cube_inside_another": (Placed(CUBE), Placed(Box([0.1, 0.1, 0.1]), (0.3, 0.0, 0.0)), -0.3),
    "balls_apart": (Placed(Sphere(1.0)), Placed(Sphere(0.5), (3.0, 4.0, 0.0)), 3.5),
    "balls_overlapping": (Placed(Sphere(1.0)), Placed(Sphere(0.5), (0.6, 0.8, 0.0)), -0.5),
    "crossed_capsules": (Placed(Capsule(0.3, 2.0)), Placed(Capsule(0.2, 2.0), (0.4, 0, 0), (1, 0, 0, 1)), -0.1),
    "coaxial_cylinders": (Placed(Cylinder(0.3, 1.0)), Placed(Cylinder(0.2, 1.0), (0.0, 0.0, 1.5)), 0.5),
    "ball_over_a_floor": (Placed(Sphere(0.5), (0, 0, 2)), Placed(HalfSpace((0, 0, 2), 1)), 1.0),
    "ball_over_a_slope": (Placed(Sphere(0.5), (2, 4, 6)), Placed(HalfSpace((1, 2, 3), 14)), np.sqrt(14) - 0.5),
    "cylinder_on_its_rim_in_a_floor": (
        Placed(HalfSpace((0, 0, 1), 0.0)),
        Placed(Cylinder(0.3, 0.8), (0, 0, 0.4), (np.sin(np.pi / 8), 0, 0, np.cos(np.pi / 8))),
        0.4 - 0.7 * np.sqrt(0.5),
    ),
    "tetrahedra_corner_to_corner": (
        Placed(Hull([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])),
        Placed(Hull([(0, 0, 0), (-1, 0, 0), (0, -1, 0), (0, 0, -1)]), (-0.3, -0.4, -0.0)),
        0.5,
    ),
}


def shapes(rng):
    return [
        Box(rng.uniform(0.2, 1.0, 3)),
        Sphere(rng.uniform(0.2, 1.0)),
        Capsule(*rng.uniform(0.2, 1.0, 2)),
        Cylinder(*rng.uniform(0.2, 1.0, 2)),
        Hull(hull_points(rng, 20)),
    ]


def random_pairs(rng):
    for a, b in itertools.combinations_with_replacement(range(5), 2):
        yield tuple(Placed(shapes(rng)[i], rng.uniform(-1, 1, 3), quaternion(rng)) for i in (a, b))


@pytest.mark.parametrize("name", CLOSED_FORMS)
def test_bounds_hold_the_closed_form_and_meet(name):
    a, b, truth = CLOSED_FORMS[name]
    for pair in ((a, b), (b, a)):
        lower, upper = signed_distance_bounds(*pair)
        assert lower <= truth + 1e-15 and truth - 1e-15 <= upper
        assert upper - lower < 1e-8


def test_polyhedra_are_settled_to_rounding():
    rng = np.random.default_rng(1)
    for _ in range(10):
        a, b = (Placed(Hull(hull_points(rng, 15)), rng.uniform(-1, 1, 3), quaternion(rng)) for _ in range(2))
        lower, upper = signed_distance_bounds(a, b)
        assert 0.0 <= upper - lower < 1e-13


def test_no_direction_sees_more_than_the_upper_bound():
    rng = np.random.default_rng(2)
    for a, b in random_pairs(rng):
        lower, upper = signed_distance_bounds(a, b)
        best = max(-reach(a, u) - reach(b, -u) for u in directions(rng, 400))
        assert best <= upper + 1e-14
        assert lower <= upper


def test_rigid_motion_leaves_the_bounds():
    rng = np.random.default_rng(3)
    q = quaternion(rng)
    for a, b in random_pairs(rng):
        expected = signed_distance_bounds(a, b)
        found = signed_distance_bounds(moved(a, (1, 2, 3), q), moved(b, (1, 2, 3), q))
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7)


@pytest.mark.parametrize("corner", [(0.3, 0.2), (1.0, 0.25), (1.0, 1.0)], ids=["face", "edge", "vertex"])
def test_one_ulp_decides_on_which_side_of_touching_cubes_are(corner):
    def bounds(x):
        return signed_distance_bounds(Placed(CUBE), Placed(CUBE, (x, *corner)))

    assert bounds(np.nextafter(1.0, 2.0))[0] > 0.0
    lower, upper = bounds(1.0)
    assert lower <= 0.0 <= upper < 1e-15
    if corner == (0.3, 0.2):
        assert bounds(np.nextafter(1.0, 0.0))[1] < 0.0


def test_hulls_shifted_until_they_touch_are_settled_to_rounding():
    rng = np.random.default_rng(5)
    for _ in range(20):
        a, b = (Placed(Hull(hull_points(rng, 15)), rng.uniform(-1, 1, 3), quaternion(rng)) for _ in range(2))
        pair = overlap(a, b)
        shift = pair.normal * (pair.depth if pair else -pair.distance)
        lower, upper = signed_distance_bounds(moved(a, shift), b)
        assert -1e-13 < lower <= upper < 1e-13


def test_a_gap_of_two_nanometres_ten_thousand_kilometres_away_is_seen():
    far = np.array([1e7, 1e7, 0.0])
    lower, upper = signed_distance_bounds(Placed(CUBE, far), Placed(CUBE, far + (1.0 + 2.0**-29, 0.0, 0.0)))
    assert 2.0**-29 * (1 - 1e-12) <= lower <= upper <= 2.0**-29 * (1 + 1e-12)


def test_a_plate_whose_faces_no_first_direction_meets_is_settled():
    rng = np.random.default_rng(4)
    plate = Hull([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0.3, 0.3, 1e-9)])
    q = quaternion(rng)
    lower, upper = signed_distance_bounds(Placed(plate, orientation=q), Placed(plate, orientation=q))
    assert lower <= -1e-9 * (1 - 1e-6) and -1e-9 * (1 + 1e-6) <= upper < 0.0


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(("shift", "distance"), [((0, 0, 0), 0.0), ((0, 0, 0.3), 0.3), ((3, 0, 4), np.hypot(1, 4))])
def test_plates_as_thin_as_rounding_are_treated_as_flat(shift, distance, turned):
    q = quaternion(np.random.default_rng(6)) if turned else (0, 0, 0, 1)
    plate = moved(Placed(Box([1.0, 1.0, 1.1e-15])), orientation=q)
    lower, upper = signed_distance_bounds(plate, moved(moved(Placed(plate.shape), shift), orientation=q))
    assert distance - 1e-14 < lower <= upper < distance + 1e-14


@pytest.mark.parametrize(
    ("shape", "depth"),
    [(Sphere(0.5), 1.5), (Capsule(0.5, 1.0), 1.5), (Box([0.1, 0.2, 0.3]), 1.1), (Cylinder(0.5, 2.0), 1.5)],
    ids=["ball", "capsule", "box", "cylinder"],
)
def test_a_ball_about_the_centre_of_another_body_is_settled(shape, depth):
    """Nearly every direction is as deep as the deepest."""
    lower, upper = signed_distance_bounds(Placed(Sphere(1.0)), Placed(shape))
    assert -depth - 1e-14 < lower <= -depth <= upper < -depth + (0.02 if isinstance(shape, Cylinder) else 1e-14)


def test_the_search_stops_at_the_resolution_asked_for():
    a, b = Placed(Cylinder(0.5, 1.0)), Placed(Cylinder(0.5, 1.0), (0.6, 0.5, 0.1), (1, 2, 3, 4))
    coarse, fine = (np.ptp(signed_distance_bounds(a, b, resolution=r)) for r in (1e-2, 1e-6))
    assert fine <= 1e-6 < coarse <= 1e-2
