"""Pairs of bodies for which plain doubles prove neither separation nor overlap."""

from fractions import Fraction
from itertools import permutations

import exact
import numpy as np
import pytest
from families import make
from rules import UNPROVED, answer, complaints, figures_are_finite

from overlapper import Cylinder, Ellipsoid, Hull, Placed, Sphere, overlap, overlaps


def slender_and_apart():
    """Two needles a million metres long, 7e-10 of their length apart."""
    a = [
        [383966.01013600134, 296873.16133966245, -105.57723506212646],
        [539988.519389721, 220791.3055238375, -95530.88264135156],
        [696556.8236020578, 194977.85125129693, -132547.23338568074],
        [999629.5060642164, 306484.77128635324, -16498.082151140457],
    ]
    b = [
        [325930.17475401016, 268835.88209492044, -30098.42744062636],
        [442001.8443896581, 324910.4407504286, 29887.273214012523],
        [-153497.48169407077, 334115.40600048995, 67249.86480939043],
        [-476568.317923407, 299697.4726410567, 41706.469215356345],
    ]
    return np.array(a), np.array(b)


def slender_around_a_solid():
    """Three bodies, 5e4 m long, whose common part holds a ball of 3e-9 of that."""
    a = [
        [-9798.594681002243, 3964.455889924569, -20193.020454865455],
        [-10161.764098134123, 37732.211189870046, 1245.4278559956808],
        [-9796.137908257238, -2810.3780634471073, -24448.37976619393],
        [-10159.307325389116, 30957.377236498363, -3009.9314553327936],
        [-9834.697841234223, 7341.051992455073, -18048.88908710902],
        [-10197.867258366105, 41108.80729240054, 3389.5592237521173],
        [-9832.24106848922, 566.2180390833918, -22304.248398437492],
        [-10195.410485621098, 34333.97333902887, -865.8000875763587],
    ]
    b = [
        [-9725.178332842488, -6173.618139526841, -26607.358860444772],
        [-10088.347749974368, 27594.13716041863, -5168.910549583634],
        [-9869.590973770411, 7332.766270595171, -18030.83338941903],
        [-10232.760390902291, 41100.52157054064, 3407.614921442109],
        [-9724.564139656235, -7867.326627869762, -27671.19868827689],
        [-10087.733556788116, 25900.42867207571, -6232.750377415754],
        [-9868.97678058416, 5639.05778225225, -19094.673217251147],
        [-10232.14619771604, 39406.813082197725, 2343.77509360999],
    ]
    c = [
        [-9723.967690953508, -9560.193672405589, -28734.498370339046],
        [-10087.137108085388, 24207.561627539886, -7296.0500594779105],
        [-9870.837104626436, 10721.024691088105, -15902.613587984828],
        [-10234.006521758316, 44488.77999103358, 5535.834722876311],
        [-9687.864530721527, -12936.789774936095, -30878.629738095482],
        [-10051.033947853406, 20830.965525009382, -9440.181427234347],
        [-9834.733944394457, 7344.428588557602, -18046.744955741266],
        [-10197.903361526334, 41112.18388850307, 3391.703355119873],
    ]
    return np.array(a), np.array(b), np.array(c)


@pytest.mark.parametrize("mirror", [(1, 1, 1), (-1, 1, 1), (1, -1, 1)])
def test_slender_bodies_apart_are_separated_by_their_distance(mirror):
    found = overlap(*(points * mirror for points in slender_and_apart()))
    assert found.status == "separated"
    assert found.distance == pytest.approx(4.452831e-4, rel=1e-6)


@pytest.mark.parametrize("order", [*permutations(range(3))])
def test_slender_bodies_with_a_solid_in_common_overlap(order):
    bodies = slender_around_a_solid()
    exactly = exact.common(*map(exact.hull, bodies)).volume
    found = overlap(*(bodies[i] for i in order))
    assert found.status == "overlapping"
    assert abs(Fraction(found.volume) - exactly) <= min(Fraction(found.volume_error), exactly * Fraction(1e-12))


@pytest.mark.parametrize("seed", range(8))
def test_features_in_exact_contact_still_touch(seed):
    assert overlap(*make("touching", seed).placed).status == "touching"


@pytest.mark.parametrize(
    ("family", "seed"),
    [
        ("tiny_in_huge", 16),
        ("tiny_in_huge", 10005),
        ("combined", 10095),
        ("combined", 10118),
        ("slender_groups", 2),
        ("slender_groups", 10033),
        ("slender_groups", 10046),
        ("parallel_edges", 10130),
        ("scaled", 10127),
        ("shared_facets", 60190),
    ],
)
def test_the_thinnest_cases_keep_the_rules(family, seed):
    case = make(family, seed)
    assert not [*complaints(case, answer(case.placed), UNPROVED)]


def test_a_hull_at_the_edge_of_one_1e15_times_as_large_has_its_volume():
    tiny = np.array([[5.74e-10, -7.55e-11, 3.15e-10], [-6.6e-10, 1.06e-10, 1.31e-11], [-5.76e-10, 1.75e-10, 2.92e-10]])
    tiny = np.vstack([tiny, [-1.18e-10, 8.99e-10, -1.19e-11]])
    huge = [
        [0, 0, 0],
        [-154091.0, -583472.0, 793339.0],
        [-279018.0, -339652.0, 735711.0],
        [592518.0, 232501.0, 777584.0],
    ]
    exactly = exact.common(exact.hull(tiny), exact.hull(np.array(huge))).volume
    found = overlap(tiny, huge)
    assert found.status == "overlapping" and found.widened
    assert abs(Fraction(found.volume) - exactly) <= min(Fraction(found.volume_error), exactly * Fraction(1e-12))


def test_a_ball_of_a_nanometre_on_one_of_a_thousand_kilometres_overlaps_it():
    for depth, status in ((5e-10, "overlapping"), (-5e-10, "separated")):
        found = overlap(Placed(Sphere(1e6), (-1e6, 0, 0)), Placed(Sphere(1e-9), (1e-9 - depth, 0, 0)), tolerance=0.01)
        assert found.status == status
        cap = np.pi * depth**2 * (3e-9 - depth) / 3 if depth > 0 else 0
        assert abs(found.volume - cap) <= found.volume_error <= 0.02 * cap


def test_hulls_of_hundreds_of_facets_have_all_their_figures():
    case = make("pole_slivers", 70000)
    assert not figures_are_finite(case, answer(case.placed))


@pytest.mark.parametrize("depth", [1e-6, 1e-7, 1e-8])
def test_a_cylinder_overlaps_the_tip_of_a_needle_that_it_holds(depth):
    """The largest ball in the tip is smaller than rounding. The vertex is in the cylinder beyond all rounding."""
    width = 1e-7
    needle = Hull([[1 - depth, 0, 0.1], [2, width, 0.1], [2, -width, 0.1], [2, 0, 0.1 + width]])
    found = overlap(Cylinder(1, 2), needle)
    assert found.status == "overlapping"
    lower, upper = found.certificate().verify()
    assert lower <= Fraction(found.volume) <= upper
    assert found.volume == pytest.approx(depth**3 * width**2 / 3, rel=1e-5)


@pytest.mark.parametrize("second", [Cylinder(0.3, 0.8), Ellipsoid([0.3, 0.4, 0.5])], ids=str)
@pytest.mark.parametrize("first", [Cylinder(0.4, 1), Ellipsoid([0.5, 0.3, 0.4])], ids=str)
def test_no_search_for_a_ball_precedes_slices_of_deep_bodies(first, second):
    """Such a search looks at many planes of each body."""
    found = overlaps(
        [first, second], [(0.1, 0.2, 0.05), (0, 0, 0)], [(0.1, 0.2, 0.3, 0.9), (0, 0, 0, 1)], pairs=[(0, 1)]
    )
    assert found.volume[0] > 0
    assert found.planes_asked <= 2
