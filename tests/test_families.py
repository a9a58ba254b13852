"""What holds for every pair and every group of bodies, however hard, against the exact truth."""

from fractions import Fraction
from functools import cache
from math import isqrt

import exact
import numpy as np
import pytest
from families import CORNERS, FAMILIES, Below, cases, icosphere, make

from overlapper import Hull, overlap

SEED = 2026
HALF_ULP = 2.0**-53
NEGLIGIBLE = 1e-12  # of the size of the smallest body: what is nearer or thinner may be called touching
AFFORDABLE = {  # seeds whose exact truth takes less than half a second
    "fine_round_hulls": (2026, 2027),
    "prisms": (2026, 2029, 2031, 2033, 2034, 2036, 2037),
}

every_family = pytest.mark.parametrize("family", FAMILIES)
exact_family = pytest.mark.parametrize("family", [name for name in FAMILIES if name != "lenses"])


@cache
def few(family):
    return [make(family, seed) for seed in AFFORDABLE.get(family, range(SEED, SEED + 5))]


@cache
def answered(family):
    """Cases of a family with the core's answers."""
    return [(case, answer(case.placed)) for case in few(family)]


def answer(bodies):
    return overlap(*bodies, tolerance=1e-2)


def holds_a_ball(case, radius):
    """Whether the common part surely holds a ball of that radius: a solid's inradius is at least volume / area."""
    return case.truth.dimension == 3 and float(case.truth.volume) > radius * case.truth.area


def apart_by(case, gap):
    """Whether no point is as near as `gap` to every body, seen by moving out all planes; by the distance for pairs."""
    planes = [plane for solid in case.solids for plane in solid.planes]
    planes += [exact.halfspace(*body) for body in case.bodies if isinstance(body, Below)]
    far = 4 * max(1.0, *(float(np.abs(box).max()) for box in case.boxes))
    part = exact.hull(CORNERS * far)
    for a, b, c, d in planes:
        length = isqrt(a * a + b * b + c * c) + 1
        moved = exact.halfspace((Fraction(a), Fraction(b), Fraction(c)), length * Fraction(gap) - d)
        part = exact.clipped(part, moved, 0)
        if part.dimension < 0:
            return True
    if len(case.solids) == len(case.bodies) == 2 and np.prod([len(s.vertices) for s in case.solids]) < 400:
        return exact.distance_squared(*case.solids) > Fraction(gap) ** 2
    return False


def conditioning(case):
    """Four times the relative change of the volume when all planes move by half an ulp of the extent."""
    return 4 * HALF_ULP * case.truth.area * case.extent / float(case.truth.volume)


def diameter(part):
    corners = np.array([exact.subtract(exact.coordinates(p), part.centroid) for p in part.vertices], float)
    return float(np.linalg.norm(corners.max(0) - corners.min(0)))


# The core


@every_family
def test_answers_are_finite_and_volumes_not_negative(family):
    for case, found in answered(family):
        figures = [found.volume, found.volume_error, found.area, *found.inertia.ravel(), *found.gradient.ravel()]
        if found:
            figures += [*found.centroid, *found.vertices.ravel(), *found.bounds.ravel()]
        if len(case.bodies) == 2:
            figures += [found.depth, found.distance, *found.normal]
        assert np.isfinite(figures).all(), case
        assert min(found.volume, found.volume_error, found.area) >= 0, case


@exact_family
def test_bodies_with_a_ball_in_common_overlap(family):
    for case, found in answered(family):
        if holds_a_ball(case, NEGLIGIBLE * case.size):
            assert found.status == "overlapping", case


@exact_family
def test_bodies_apart_are_separated(family):
    for case, found in answered(family):
        if case.truth.dimension < 0 and found.status != "separated":
            assert not apart_by(case, NEGLIGIBLE * case.size), case


@exact_family
def test_bodies_in_exact_contact_touch(family):
    for case, found in answered(family):
        if 0 <= case.truth.dimension < 3:
            assert found.status == "touching", case


@exact_family
def test_the_exact_volume_is_within_the_stated_error(family):
    for case, found in answered(family):
        exactly = case.truth.volume if case.truth.dimension == 3 else Fraction(0)
        assert abs(Fraction(found.volume) - exactly) <= Fraction(found.volume_error), case


@pytest.mark.parametrize("case", [make("lenses", SEED + i) for i in range(40)], ids=repr)
def test_the_closed_form_of_a_lens_is_within_the_stated_error(case):
    found = answer(case.placed)
    assert found.status == "overlapping"
    assert abs(found.volume - case.closed_form) <= found.volume_error + 4 * HALF_ULP * case.closed_form


@exact_family
def test_volume_and_centroid_are_as_right_as_their_conditioning_allows(family):
    for case, found in answered(family):
        if not found or case.truth.dimension < 3:
            continue
        allowed = max(1e-12, conditioning(case))
        assert abs(Fraction(found.volume) - case.truth.volume) <= Fraction(allowed) * case.truth.volume, case
        off = np.array([Fraction(x) - y for x, y in zip(found.centroid.tolist(), case.truth.centroid)], float)
        world = np.linalg.norm(np.spacing(np.abs(found.centroid)))
        assert np.linalg.norm(off) <= allowed * diameter(case.truth) + world, case


@pytest.mark.parametrize("family", [name for name in FAMILIES if name not in ("lenses", "posed", "half_spaces")])
def test_volumes_of_hulls_are_right_to_twelve_digits_however_thin(family):
    for case, found in answered(family):
        if found:
            assert abs(Fraction(found.volume) - case.truth.volume) <= Fraction(1e-12) * case.truth.volume, case


@every_family
def test_order_of_bodies_keeps_the_status_and_moves_the_volume_by_rounding(family):
    for case, found in answered(family):
        again = answer(case.placed[::-1])
        assert again.status == found.status, case
        assert abs(again.volume - found.volume) <= again.volume_error + found.volume_error, case


@every_family
def test_mirror_image_and_scale_by_a_power_of_two_keep_the_status(family):
    for case, found in answered(family):
        if all(isinstance(body, np.ndarray) for body in case.bodies):
            for change in ([-1, 1, 1], [2.0**-7] * 3):
                assert answer([points * change for points in case.bodies]).status == found.status, case


# The generator


def test_a_seed_gives_the_same_bodies_again_and_another_seed_others():
    for family in FAMILIES:
        one, again, other = make(family, 7), make(family, 7), make(family, 8)
        assert repr(one) == repr(again)
        assert [repr(body) for body in one.bodies] == [repr(body) for body in again.bodies]
        assert [repr(body) for body in one.bodies] != [repr(body) for body in other.bodies]


def test_any_count_of_cases_takes_the_families_in_turn():
    names = [case.family for case in cases(SEED, 2 * len(FAMILIES) + 3)]
    assert names == [*FAMILIES, *FAMILIES, *list(FAMILIES)[:3]]


@pytest.mark.parametrize(
    ("family", "dimensions"),
    [
        ("general", {3}),
        ("slivers", {3}),
        ("touching", {0, 1, 2}),
        ("nearly_touching", {-1, 3}),
        ("empty_triples", {-1, 0, 1, 3}),
        ("many_bodies", {-1, 3}),
        ("half_spaces", {-1, 3}),
    ],
)
def test_a_family_has_the_common_parts_it_is_named_for(family, dimensions):
    found = {make(family, SEED + i).truth.dimension for i in range(40)}
    assert found == dimensions if family in ("general", "slivers", "touching") else found >= dimensions


def test_slivers_reach_down_to_a_millionth_of_a_millionth():
    for i in range(20):
        case = make("slivers", SEED + i)
        assert case.truth.dimension == 3
        assert float(case.truth.volume) <= 10 * case.parameter * case.extent**2


def test_boxes_share_as_many_planes_as_stated():
    for i in range(20):
        case = make("shared_planes", SEED + i)
        if "turned" not in case.detail:
            a, b = case.solids
            assert len({*a.planes} & {*b.planes}) == case.parameter


def test_hulls_share_the_facets_that_are_stated():
    for i in range(20):
        case = make("shared_facets", SEED + i)
        a, b = case.solids
        assert len({*a.planes} & {*b.planes}) >= case.parameter


def test_empty_groups_have_something_in_common_without_any_one_of_them():
    for i in range(20):
        case = make("empty_triples", SEED + i)
        if case.parameter > 0 and "turned" not in case.detail:
            assert case.truth.dimension == -1
            for leaving in range(len(case.solids)):
                rest = case.solids[:leaving] + case.solids[leaving + 1 :]
                assert exact.common(*rest).volume > 0


@pytest.mark.parametrize("subdivisions", range(4))
def test_an_icosphere_has_four_times_as_many_triangles_at_each_step(subdivisions):
    assert len(Hull(icosphere(subdivisions)).facets) == 20 * 4**subdivisions


def test_far_bodies_are_as_far_as_stated():
    for i in range(10):
        case = make("far_away", SEED + i)
        assert np.linalg.norm(case.bodies[0].mean(0)) == pytest.approx(case.parameter, rel=0.1)
