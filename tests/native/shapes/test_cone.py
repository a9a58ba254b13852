"""A shape that joins the core by one header, cone.h, is measured by the general ways. The sanitized build has it."""

import copy
import pickle

import numpy as np
import pytest
import rules
from families import Case
from strategies import quaternion, rotation

from overlapper import (
    Batch,
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Placed,
    RoundedHull,
    Sphere,
    _core,
    distance,
    overlap,
    penetration_depth,
)

Cone = _core.Cone
# A body around the cone is so deep that only half of the digits of the depth are known.
RULES = [rule for rule in rules.UNPROVED if rule is not rules.errors_of_depth_and_distance_are_small]
TOLERANCE = 1e-4
CORNERS = 720


def pyramid(cone, corners=CORNERS, around=False):
    """A hull inside the cone, or one around it, off by 1.3e-5 of the volume."""
    angles = 2 * np.pi * np.arange(corners) / corners
    radius = cone.radius / np.cos(np.pi / corners) if around else cone.radius
    base = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(corners, -cone.length / 2)])
    return Hull(np.vstack([base, [0, 0, cone.length / 2]]))


def others(rng):
    points = rng.normal(size=(12, 3)) * 0.5
    size, length, axes = rng.uniform(0.2, 0.8, 3)
    return [
        Box(rng.uniform(0.2, 0.8, 3)),
        Sphere(size),
        Capsule(size, length),
        Cylinder(size, length),
        Ellipsoid([size, length, axes]),
        Hull(points),
        RoundedHull(points, 0.2),
        HalfSpace(rng.normal(size=3), 0.1),
        Cone(size, length),
    ]


def somewhere(rng, cone, other, spread=0.5):
    return Placed(cone, spread * rng.normal(size=3), quaternion(rng)), Placed(
        other, spread * rng.normal(size=3), quaternion(rng)
    )


def test_its_class_is_made_from_its_name_and_fields():
    cone = Cone(radius=0.5, length=2)
    assert repr(cone) == "Cone(radius=0.5, length=2)"
    assert (cone.radius, cone.length) == (0.5, 2)
    assert repr(pickle.loads(pickle.dumps(cone))) == repr(cone)
    assert copy.copy(cone) is cone
    assert cone.volume == pytest.approx(np.pi * 0.25 * 2 / 3, rel=1e-15)
    assert cone.centroid.tolist() == [0, 0, -0.5]
    assert np.array_equal(cone.bounds, [[-0.5, -0.5, -1], [0.5, 0.5, 1]])
    for arguments, message in [((0, 1), "radius must be greater than 0"), ((1, np.nan), "length must be finite")]:
        with pytest.raises(ValueError, match=message):
            Cone(*arguments)


@pytest.mark.parametrize("share", [0.05, 0.3, 0.5, 0.9])
def test_a_half_space_across_the_axis_leaves_a_smaller_cone(share):
    cone = Cone(0.7, 2)
    found = overlap(cone, HalfSpace([0, 0, -1], -(1 - 2 * share)), tolerance=TOLERANCE)
    truth = cone.volume * share**3
    assert abs(found.volume - truth) <= min(found.volume_error, TOLERANCE * truth)
    assert found.depth == pytest.approx(2 * share, rel=1e-12)


@pytest.mark.parametrize(
    "body", [Box([1, 1, 1.5]), Sphere(1.5), Cylinder(1, 2.5), Capsule(1, 2.5), Ellipsoid([1, 1.2, 2.5])]
)
def test_a_body_around_it_leaves_it_whole(body):
    cone = Cone(0.5, 2)
    case = Case("whole", 0, (Placed(cone), Placed(body)), closed_form=cone.volume)
    found = overlap(*case.placed, tolerance=TOLERANCE)
    assert found.converged
    assert abs(found.volume - cone.volume) <= found.volume_error
    assert not list(rules.complaints(case, rules.answer(case.placed), RULES))


def test_a_ball_inside_it_stays_whole():
    found = overlap(Cone(1, 3), Placed(Sphere(0.3), (0, 0, -0.9)), tolerance=TOLERANCE)
    assert abs(found.volume - Sphere(0.3).volume) <= found.volume_error <= TOLERANCE * found.volume


@pytest.mark.parametrize("seed", range(4))
def test_volumes_lie_between_those_of_hulls_inside_and_around_it(seed):
    rng = np.random.default_rng(seed)
    cone = Cone(*rng.uniform(0.3, 1, 2))
    for other in others(rng):
        a, b = somewhere(rng, cone, other)
        found = overlap(a, b, tolerance=TOLERANCE)
        inner = overlap(Placed(pyramid(cone), a.position, a.orientation), b, tolerance=TOLERANCE)
        outer = overlap(Placed(pyramid(cone, around=True), a.position, a.orientation), b, tolerance=TOLERANCE)
        assert inner.volume - inner.volume_error <= found.volume + found.volume_error
        assert found.volume - found.volume_error <= outer.volume + outer.volume_error
        assert found.converged
        assert found.volume_error <= TOLERANCE * found.volume


@pytest.mark.parametrize("seed", range(4))
def test_depth_distance_and_normal_are_those_of_fine_hulls(seed):
    rng = np.random.default_rng(100 + seed)
    cone = Cone(*rng.uniform(0.3, 1, 2))
    short = cone.radius * (1 - np.cos(np.pi / CORNERS))
    for other in others(rng):
        a, b = somewhere(rng, cone, other)
        found, hull = overlap(a, b), overlap(Placed(pyramid(cone), a.position, a.orientation), b)
        assert found.depth == pytest.approx(hull.depth, abs=2 * short)
        assert found.distance == pytest.approx(hull.distance, abs=2 * short)
        assert distance(a, b) == pytest.approx(found.distance, abs=1e-12)
        assert penetration_depth(a, b) == pytest.approx(found.depth, abs=1e-12)
        assert found.errors.depth <= 1e-9
        assert found.errors.distance <= 1e-9
        if found.status == "separated" and found.distance > 0.05:
            assert found.normal @ hull.normal > 1 - 4 * short / found.distance


@pytest.mark.parametrize("angle", [0.0, 0.5, np.arctan2(2, 1), 2.0, np.pi])
def test_depth_in_a_half_space_is_by_its_support(angle):
    cone, normal, offset = Cone(1, 2), np.array([np.sin(angle), 0, np.cos(angle)]), 0.25
    reach = max(normal[2] * cone.length / 2, normal[0] * cone.radius - normal[2] * cone.length / 2)
    assert overlap(cone, HalfSpace(-normal, offset)).depth == pytest.approx(offset + reach, rel=1e-12)


def test_a_turn_keeps_its_measures():
    rng = np.random.default_rng(5)
    cone, box = Placed(Cone(0.6, 1.2)), Placed(Box([0.4, 0.5, 0.6]), (0.3, 0.2, 0.1))
    turn = quaternion(rng)
    matrix = rotation(turn)
    before = overlap(cone, box, tolerance=TOLERANCE)
    after = overlap(*(Placed(body.shape, matrix @ body.position, turn) for body in (cone, box)), tolerance=TOLERANCE)
    assert abs(after.volume - before.volume) <= after.volume_error + before.volume_error
    assert after.depth == pytest.approx(before.depth, rel=1e-12)
    assert np.allclose(after.normal, matrix @ before.normal, atol=1e-9)


def test_a_batch_answers_as_single_calls_do():
    rng = np.random.default_rng(6)
    shapes = [Cone(0.5, 1), *others(rng)]
    positions, orientations = (
        0.6 * rng.normal(size=(len(shapes), 3)),
        np.array([quaternion(rng) for _ in shapes], float),
    )
    found = Batch(shapes).overlaps(positions, orientations, [(0, j) for j in range(1, len(shapes))])
    for j, volume in enumerate(found.volume, start=1):
        single = overlap(*(Placed(shapes[k], positions[k], orientations[k]) for k in (0, j)))
        assert volume == single.volume


def test_method_paper_takes_a_hull_inside_it():
    cone, box = Placed(Cone(0.6, 1.2)), Placed(Box([0.4, 0.5, 0.6]), (0.3, 0.2, 0.1))
    assert overlap(cone, box, method="paper").volume == pytest.approx(overlap(cone, box).volume, rel=2e-3)
