"""The largest depth and volume of motions: closed forms, sampled poses of pairs of shapes, and refused arguments."""

import numpy as np
import pytest

from motion import many
from overlapper import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Maximum,
    Placed,
    RoundedHull,
    Sphere,
    maximum_depth,
    maximum_volume,
    overlap,
)

STILL = (0, 0, 0)
CUBE = Box([0.5, 0.5, 0.5])
GROUND = HalfSpace([0, 0, 1], 0)

# A pass of 4 m: two bodies, velocity and spin of the first, largest depth, its time. None: it lasts for a while.
PASSES = {
    "balls": (Placed(Sphere(0.5), (-2, 0.75, 0)), Sphere(0.5), (4, 0, 0), (1, 2, 3), 0.25, 0.5),
    "cubes": (Placed(CUBE, (-2, 0, 0.875)), CUBE, (4, 0, 0), STILL, 0.125, None),
    "cubes, diagonal": (Placed(CUBE, (-2, -2, 0)), CUBE, (4, 4, 0), STILL, 1, 0.5),
    "ball and half-space": (Placed(Sphere(0.5), (0, 0, 2)), GROUND, (0, 0, -4), (1, 2, 3), 2.5, 1),
    "cube turned on a half-space": (
        Placed(CUBE, (0, 0, 0.5)),
        GROUND,
        STILL,
        (np.pi / 2, 0, 0),
        np.sqrt(0.5) - 0.5,
        0.5,
    ),
    "half-space that turns in its plane": (GROUND, Placed(CUBE, (0, 0, 0.5)), STILL, (0, 0, 3), 0, None),
}


@pytest.mark.parametrize("name", PASSES)
def test_depth_of_passes_with_closed_forms(name):
    a, b, velocity, spin, depth, time = PASSES[name]
    found = maximum_depth(a, b, (velocity, spin))
    assert isinstance(found, Maximum) and found.converged
    assert found.lower <= depth <= found.upper <= depth * (1 + 2e-6) + 1e-13
    if time is not None:
        assert found.time == pytest.approx(time, abs=1e-2)


def test_half_space_that_turns_into_a_cube():
    """At an angle x, the plane through (0, 0, -0.5) is as deep in the cube as its lowest corner is below the plane."""
    plane = Placed(HalfSpace([0, 0, 1], 0), (0, 0, -0.5))
    found = maximum_depth(CUBE, plane, None, (STILL, (0.5, 0, 0)))
    assert found.lower <= 0.5 * np.sin(0.5) <= found.upper and found.converged


def lens(distance, radius=0.5):
    """Common volume of two balls."""
    return np.pi / 12 * (4 * radius + distance) * (2 * radius - distance) ** 2


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-5])
def test_volume_of_passes_with_closed_forms(tolerance):
    balls = maximum_volume(Placed(Sphere(0.5), (-2, 0.75, 0)), Sphere(0.5), ((4, 0, 0), (3, 2, 1)), tolerance=tolerance)
    assert balls.lower <= lens(0.75) <= balls.upper and balls.converged
    cubes = maximum_volume(Placed(CUBE, (-2, 0.25, 0.5)), CUBE, ((4, 0, 0), STILL), tolerance=tolerance)
    assert cubes.lower <= 0.375 <= cubes.upper and cubes.converged and cubes.time == pytest.approx(0.5, abs=tolerance)
    for found in (balls, cubes):
        assert found.upper - found.lower <= 1.01 * tolerance * found.upper
        assert found.steps < 200


def test_volume_that_is_largest_in_between_two_poses_of_a_turn():
    """A bar that turns about its centre fills a slot best when both are parallel."""
    bar, slot = Box([1, 0.125, 0.25]), Placed(Box([1, 0.125, 0.25]), orientation=(0, 0, np.sin(0.2), np.cos(0.2)))
    found = maximum_volume(bar, slot, (STILL, (0, 0, 1)), duration=1.0)
    assert found.lower <= bar.volume <= found.upper and found.converged
    assert found.time == pytest.approx(0.4, abs=1e-3)


def test_separated_motion_has_no_depth_and_no_volume():
    far = Placed(Sphere(0.5), (-2, 1.5, 0))
    for find in (maximum_depth, maximum_volume):
        found = find(far, Sphere(0.5), ((4, 0, 0), STILL))
        assert (found.lower, found.upper, bool(found), found.converged) == (0, 0, False, True)
        assert found.time == pytest.approx(0.5)


def test_overlap_that_begins_at_the_end_of_the_motion():
    found = maximum_depth(Placed(CUBE, (3, 0, 0)), CUBE, ((-2 - 2**-30, 0, 0), STILL))
    assert found.lower <= 2**-30 <= found.upper <= 2**-30 + 1e-12
    assert found.time == pytest.approx(1)


def test_bodies_at_rest_have_their_depth_and_volume():
    a, b = Placed(CUBE, (0.75, 0, 0)), CUBE
    assert maximum_depth(a, b).upper == pytest.approx(0.25) and maximum_volume(a, b).upper == pytest.approx(0.25)


@pytest.mark.parametrize("find", [maximum_depth, maximum_volume])
@pytest.mark.parametrize("kind", ["random", "fast spins", "grazing passes", "gaps at the end"])
def test_no_sampled_pose_is_beyond_the_upper_bound(find, kind):
    rng = np.random.default_rng(11)
    positive = converged = 0
    for number, motion in enumerate(many.motions(kind, 7)):
        if number == 16:
            break
        found = find(motion.a, motion.b, motion.of_a, motion.of_b, tolerance=1e-2)
        positive += found.lower > 0
        converged += found.converged
        times = [*rng.uniform(0, 1, 60), *np.clip(found.time + 10 ** rng.uniform(-8, -2, 20), 0, 1), found.time]
        measured = [overlap(*motion.at(time)) for time in times]
        values = [each.depth if find is maximum_depth else each.volume - each.volume_error for each in measured]
        assert max(values) <= found.upper * (1 + 1e-9) + 1e-12, (number, motion, found)
        assert values[-1] >= found.lower * (1 - 2e-3) - 1e-11, (number, motion, found)
    assert positive > 3 and converged > 12


@pytest.mark.parametrize(
    ("shape", "by"),
    [
        (Box([0.5, 0.2, 0.3]), 0.1),
        (Sphere(0.5), 0.1),
        (Capsule(0.2, 0.5), 0.1),
        (Cylinder(0.2, 0.5), 0.1),
        (Ellipsoid([0.5, 0.1, 0.3]), 0.1),
        (Hull(np.random.default_rng(1).normal(size=(12, 3))), 0.1),
        (RoundedHull(np.random.default_rng(2).normal(size=(12, 3)), 0.1), 0.1),
        (HalfSpace([1, 2, 2], 0.5), 0.1),
    ],
    ids=lambda value: type(value).__name__,
)
def test_enlarged_bodies_contain_balls_about_their_points(shape, by):
    from overlapper.motion.maximum import _enlarged
    from overlapper.shapes.table import facts

    body = Placed(shape, (1, 2, 3), (1, 2, 3, 4))
    larger = _enlarged(body, by)
    rng = np.random.default_rng(3)
    for _ in range(60):
        n = rng.normal(size=3)
        # A ball of this radius that touches the body from outside lies in the larger body.
        outside = overlap(body, Placed(Sphere(1e-3), body.position + 5 * n / np.linalg.norm(n)))
        if outside.status == "separated":
            ball = Placed(Sphere(by / 2), outside.witness_a + outside.normal * -by / 2 * (1 - 1e-9))
            assert overlap(larger, ball).volume == pytest.approx(4 / 3 * np.pi * (by / 2) ** 3, rel=2e-3), n
    assert facts(larger.shape).name


@pytest.mark.parametrize("find", [maximum_depth, maximum_volume])
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"tolerance": 0}, "tolerance must be greater than 0 and less than 1"),
        ({"tolerance": 1}, "tolerance must be greater than 0 and less than 1"),
        ({"tolerance": "1e-3"}, "tolerance must be a number"),
        ({"duration": 0}, "duration must be greater than 0"),
        ({"motion_a": (1, 2, 3)}, "motion_a must be a pair"),
        ({"a": HalfSpace([0, 0, 1], 0), "b": HalfSpace([0, 0, -1], -1)}, "a and b must not both be half-spaces"),
    ],
)
def test_refused_arguments(find, arguments, words):
    with pytest.raises(ValueError, match=words):
        find(**{"a": Sphere(1), "b": Placed(Sphere(1), (3, 0, 0)), **arguments})
