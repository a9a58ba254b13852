"""Large hulls, whose common part is found by following the seam in which their surfaces cross: against the exact truth,
and against the same part grown plane by plane, as it is where a third body has it inside."""

from fractions import Fraction

import exact
import numpy as np
import pytest
from families import globe, icosphere, prism
from numpy.testing import assert_allclose, assert_array_equal

from overlapper import Box, Hull, Placed, overlap
from overlapper.proof.certificate import certificate

TURN = (0.3, -0.5, 0.2, 0.8)
OTHER_TURN = (-0.6, 0.1, 0.4, 0.7)
EVERYWHERE = Box((100, 100, 100))
AWAY = np.array([2.0, 3.0, 6.0]) / 7


def cloud(count, seed, stretch=(1, 1, 1)):
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return Hull(points / np.linalg.norm(points, axis=1)[:, None] * stretch)


BALL, FINE_BALL = Hull(icosphere(3)), Hull(icosphere(4))
DRUM = Hull(prism(256))

PAIRS = {
    "balls half in one another": (BALL, Placed(BALL, 0.5 * AWAY, TURN)),
    "balls of 5120 facets": (Placed(FINE_BALL, (1, 2, 3), OTHER_TURN), Placed(FINE_BALL, (1.3, 2.1, 2.8), TURN)),
    "balls that share a lens": (BALL, Placed(BALL, 1.9 * AWAY, TURN)),
    "fine balls that share a thin lens": (FINE_BALL, Placed(FINE_BALL, 1.98 * AWAY, TURN)),
    "a ball in another": (FINE_BALL, Placed(Hull(0.3 * icosphere(2)), (0.3, 0.2, 0.1), TURN)),
    "a ball around another": (Placed(Hull(0.9 * icosphere(2)), orientation=TURN), FINE_BALL),
    "a plate through a ball": (BALL, Placed(Box((2, 2, 0.1)), (0.1, 0.2, 0.3), TURN)),
    "a bar through a ball": (BALL, Placed(Box((0.1, 0.3, 2)), (0.1, 0.2, 0.3), TURN)),
    "a box that a ball bulges out of on six sides": (FINE_BALL, Placed(Box((0.8, 0.8, 0.8)), (0.01, 0, 0), TURN)),
    "a box that a ball only reaches into": (FINE_BALL, Placed(Box((5, 5, 5)), (5.9, 0.1, 0.2))),
    "a corner of a box in a ball": (FINE_BALL, Placed(Box((1, 1, 1)), (1.4, 1.3, 1.2), (0.01, 0.02, 0.03, 1))),
    "crossed drums": (DRUM, Placed(DRUM, (0.1, 0.2, 0.3), TURN)),
    "a drum whose lid dips into a ball": (Placed(DRUM, (0, 0, 1.4), (0.1, 0.05, 0, 1)), BALL),
    "globes at their poles": (
        Hull(globe(32, 24)),
        Placed(Hull(globe(32, 24)), (0.05, 0.02, 1.8), (0.02, 0.03, 0.5, 1)),
    ),
    "a needle through a plate": (cloud(300, 1, (0.1, 0.1, 3)), Placed(cloud(300, 2, (2, 2, 0.05)), (0.3, 0.2, 0.1))),
    "clouds": (cloud(500, 3), Placed(cloud(400, 4), 0.7 * AWAY, TURN)),
    "very unequal balls": (Placed(Hull(100 * icosphere(4)), (0, 0, -99)), Placed(BALL, (0.3, 0.2, 1), TURN)),
}


def lengths(patch):
    return sorted(np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1).sum() for loop in patch)


@pytest.mark.parametrize("pair", PAIRS.values(), ids=PAIRS)
def test_the_traced_polytope_is_the_grown_one(pair):
    traced, grown = overlap(*pair), overlap(*pair, Placed(EVERYWHERE))
    assert abs(traced.volume - grown.volume) <= traced.volume_error + grown.volume_error
    assert traced.volume_error <= 1e-12 * traced.volume
    assert_allclose(traced.centroid, grown.centroid, atol=1e-12)
    assert traced.area == pytest.approx(grown.area, rel=1e-11)
    # Among three bodies, either of the two has its own loops.
    assert_allclose(sorted(2 * lengths(traced.patch)), lengths(grown.patch), rtol=1e-11)
    assert_allclose(traced.gradient, grown.gradient[:2], atol=1e-11 * grown.area)
    assert_allclose(traced.inertia, grown.inertia, atol=1e-12 * np.trace(grown.inertia))
    assert len(traced.vertices) == len(grown.vertices)
    assert sorted(zip(traced.owner, map(len, traced.facets))) == sorted(zip(grown.owner, map(len, grown.facets)))


@pytest.mark.parametrize("pair", PAIRS.values(), ids=PAIRS)
def test_the_order_of_the_bodies_changes_no_bit(pair):
    one, other = overlap(*pair), overlap(*reversed(pair))
    assert (one.volume, one.volume_error, one.area) == (other.volume, other.volume_error, other.area)
    assert_array_equal(one.centroid, other.centroid)
    assert_array_equal(one.gradient, other.gradient[::-1])
    assert_array_equal(one.vertices, other.vertices)
    assert_array_equal(one.owner, 1 - other.owner)


EXACT = {
    "balls": (icosphere(1), icosphere(1), 0.5),
    "balls that share a lens": (icosphere(2), icosphere(2), 1.95),
    "a drum and a ball": (prism(32), icosphere(1), 1.2),
    "globes": (globe(16, 5), icosphere(1), 1.5),
}


@pytest.mark.parametrize(("a", "b", "apart"), EXACT.values(), ids=EXACT)
def test_volume_and_centroid_are_exact_to_twelve_digits(a, b, apart):
    position = apart * AWAY
    found = overlap(Hull(a), Placed(Hull(b), position, TURN))
    placed = Placed(Hull(b), position, TURN)
    truth = exact.common(exact.hull(a), exact.hull(exact.placed(b, placed.position, placed.given_orientation)))
    assert abs(Fraction(found.volume) - truth.volume) <= Fraction(found.volume_error) <= truth.volume / 10**12
    assert_allclose(found.centroid, np.array(truth.centroid, float), rtol=0, atol=1e-12)


def test_a_pair_far_from_the_origin_of_the_world_has_the_same_volume_to_the_last_bit():
    def volume(shift):
        return overlap(Placed(BALL, (shift, 0.5, 8)), Placed(BALL, (shift + 1.75, 0.5, 8), TURN)).volume

    assert volume(2.0**30) == volume(0) > 0


def test_hulls_that_coincide_are_left_to_exact_signs():
    found = overlap(BALL, Placed(BALL))
    assert abs(found.volume - BALL.volume) <= found.volume_error <= 1e-12 * BALL.volume


def test_hulls_that_share_a_flat_are_left_to_exact_signs():
    found = overlap(DRUM, Placed(DRUM, (0, 0, 0.75)))
    assert found.volume == pytest.approx(DRUM.volume / 4, rel=1e-12)


@pytest.mark.parametrize("apart", [2.001, 2.5, 1000])
def test_large_hulls_apart_are_separated(apart):
    found = overlap(FINE_BALL, Placed(FINE_BALL, apart * AWAY, TURN))
    assert found.status == "separated"
    assert found.volume == 0


def test_a_traced_overlap_is_proved():
    found = overlap(Hull(icosphere(1)), Placed(Hull(icosphere(1)), 1.5 * AWAY, TURN))
    lower, upper = certificate(found).verify()
    assert lower <= found.volume + found.volume_error
    assert found.volume - found.volume_error <= upper
    assert upper - lower <= 1e-12 * lower
