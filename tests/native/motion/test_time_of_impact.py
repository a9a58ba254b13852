"""Times of impact against rational arithmetic, closed forms in many digits, and overlaps of sampled poses."""

from itertools import product

import numpy as np
import pytest
from first_touch import exact_first_touch
from mpmath import mp, mpf
from strategies import hull_points, quaternion, turn
from strategies import product as turned_by

from overlapper import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Placed,
    RoundedHull,
    Sphere,
    distance,
    overlap,
    time_of_impact,
)

STILL = ((0, 0, 0), (0, 0, 0))
KINDS = {
    "box": lambda rng: Box(rng.uniform(0.2, 0.8, 3)),
    "plate": lambda rng: Box([0.8, 0.8, 1e-4]),
    "sphere": lambda rng: Sphere(rng.uniform(0.2, 0.8)),
    "capsule": lambda rng: Capsule(*rng.uniform(0.2, 0.8, 2)),
    "cylinder": lambda rng: Cylinder(*rng.uniform(0.2, 0.8, 2)),
    "ellipsoid": lambda rng: Ellipsoid(rng.uniform(0.2, 0.8, 3)),
    "hull": lambda rng: Hull(hull_points(rng, 12) / 2),
    "rounded hull": lambda rng: RoundedHull(hull_points(rng, 8) / 3, 0.1),
    "half-space": lambda rng: HalfSpace(rng.normal(size=3), -0.5),
}
PAIRS = [pair for pair in product(KINDS, repeat=2) if pair != ("half-space", "half-space")]


def test_translated_boxes_in_rational_arithmetic():
    rng = np.random.default_rng(5)
    hits = 0
    for _ in range(150):
        a, b = (
            Placed(Box(rng.integers(1, 1024, 3) / 512), position, rng.integers(-9, 10, 4) + (0, 0, 0, 0.5))
            for position in (rng.integers(-4096, 4096, 3) / 512, (0, 0, 0))
        )
        velocity = -a.position * rng.integers(1, 64) / 16 + rng.integers(-64, 64, 3) / 64
        truth = exact_first_touch(a, b, velocity)
        found = time_of_impact(a, b, (velocity, (0, 0, 0)))
        if truth is None or truth > 1:
            assert found.status == "separated", (a, b, velocity)
        elif truth == 0:
            assert found.status == "overlapping"
        else:
            hits += 1
            assert found.status == "impact" and found.converged
            assert found.time <= truth <= found.time_upper <= found.time + 1.001e-9
            assert abs(np.linalg.norm(found.normal) - 1) < 1e-12
    assert hits > 40


def test_moving_both_bodies_is_moving_one_of_them():
    rng = np.random.default_rng(6)
    for _ in range(50):
        a, b = (Placed(Box(rng.integers(1, 1024, 3) / 1024), p, rng.integers(1, 9, 4)) for p in ((4, 0, 0), (0, 0, 0)))
        u, v = rng.integers(-64, 64, (2, 3)) / 16 - ((4, 0, 0), (0, 0, 0))
        truth = exact_first_touch(a, b, u - v)
        found = time_of_impact(a, b, (u, (0, 0, 0)), (v, (0, 0, 0)), duration=2)
        assert bool(found) == (truth is not None and truth <= 2)
        if found:
            assert found.time <= truth <= found.time_upper


@pytest.mark.parametrize("rate", [0.3, 2, 50, 1000])
def test_spinning_bar_hits_ball(rate):
    bar, ball, arm, angle = Box([1, 0.125, 0.25]), Sphere(0.0625), 0.75, 1.0
    found = time_of_impact(
        Placed(bar, orientation=turn([0, 0, angle])), Placed(ball, (arm, 0, 0)), ((0, 0, 0), (0, 0, -rate)), None, 4
    )
    with mp.workdps(40):
        truth = (2 * mp.atan2(*map(mpf, turn([0, 0, angle])[2:].tolist())) - mp.asin(mpf("0.1875") / arm)) / rate
        assert found.status == "impact" and found.converged
        assert found.time <= truth <= found.time_upper
    moved = rate * (found.time_upper - found.time)
    expected = [arm - 0.0625 * 0.25, 0.0625 * np.sqrt(1 - 0.25**2), 0]
    assert found.point == pytest.approx(expected, abs=moved + 1e-9)


@pytest.mark.parametrize("plane_first", [False, True])
def test_turning_half_space_hits_moving_ball(plane_first):
    ball, plane = Placed(Sphere(0.25), (0, 1, 1)), HalfSpace([0, 0, 1], 0)
    fall, tilt = ((0, 0, -0.125), (5, 6, 7)), ((0, 0, 0), (0.75, 0, 0))
    found = time_of_impact(plane, ball, tilt, fall) if plane_first else time_of_impact(ball, plane, fall, tilt)

    def height(t):
        return -mp.sin(0.75 * t) + mp.cos(0.75 * t) * (1 - t / 8) - mpf("0.25")

    with mp.workdps(40):
        truth = mp.findroot(height, (mpf("0.5"), mpf("0.9")), solver="anderson")
        assert found.status == "impact" and found.time <= truth <= found.time_upper


def at(body, motion, t):
    linear, angular = map(np.asarray, motion)
    speed = np.linalg.norm(angular)
    orientation = turned_by(turn(angular * t), body.orientation) if speed else body.orientation
    return Placed(body.shape, body.position + t * linear, orientation)


@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_random_motions_of_all_pairs_of_shapes(first, second):
    rng = np.random.default_rng([PAIRS.index((first, second)), 7])
    seen = set()
    for spin in [0.5, 0.5, 0.5, 3, 3, 20]:
        start = rng.normal(size=3)
        start *= 3 / np.linalg.norm(start)
        a, b = Placed(KINDS[first](rng), start, quaternion(rng)), Placed(KINDS[second](rng), (0, 0, 0), quaternion(rng))
        motion_a = (-start * rng.uniform(0.5, 1.5) + rng.normal(size=3) * 0.5, rng.normal(size=3) * spin)
        motion_b = (rng.normal(size=3) * 0.2, rng.normal(size=3) * spin)
        found = time_of_impact(a, b, motion_a, motion_b)
        seen.add(found.status)
        if found.status == "overlapping":
            assert overlap(a, b).status == "overlapping"
            continue
        end = 1.0 if found.status == "separated" else found.time
        for t in [*np.linspace(0, end, 120), end - 1e-8, end * (1 - 1e-6)]:
            t = min(max(t, 0), end)
            both = overlap(at(a, motion_a, t), at(b, motion_b, t))
            assert both.status != "overlapping" or both.depth < 1e-12, (t, found)
        if found.status == "impact":
            assert found.converged
            both = at(a, motion_a, found.time_upper), at(b, motion_b, found.time_upper)
            assert overlap(*both).status == "overlapping"
            assert distance(at(a, motion_a, found.time), at(b, motion_b, found.time)) < 1e-7
    assert seen <= {"separated", "impact", "overlapping"}


def test_time_of_fast_spins_is_not_late():
    """A time that is late by a tenth of the tolerance has a depth of 1e-9 m here."""
    rng = np.random.default_rng(8)
    names = ["box", "plate", "sphere", "capsule", "hull"]
    hits = 0
    for _ in range(1200):
        a, b = (KINDS[name](rng) for name in rng.choice(names, 2))
        start = rng.normal(size=3)
        start *= 3 / np.linalg.norm(start)
        a, b = Placed(a, start, quaternion(rng)), Placed(b, (0, 0, 0), quaternion(rng))
        motion_a, motion_b = (-start, rng.normal(size=3) * 20), ((0, 0, 0), rng.normal(size=3) * 20)
        found = time_of_impact(a, b, motion_a, motion_b)
        if found.status == "impact":
            hits += 1
            both = overlap(at(a, motion_a, found.time), at(b, motion_b, found.time))
            assert both.status != "overlapping" or both.depth < 1e-11, found
    assert hits > 500


@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("kind", ["balls", "cubes", "edges"])
def test_grazing_pass(kind, gap):
    """The gap of a pass is the least distance of the motion; the same overlap instead of a gap is an impact."""
    shape, half = {
        "balls": (Sphere(0.5), 1.0),
        "cubes": (Box([0.5, 0.5, 0.5]), 1.0),
        "edges": (Box([0.5, 0.5, 0.5]), np.sqrt(2)),
    }[kind]
    orientation = turn([0, 0, np.pi / 4]) if kind == "edges" else (0, 0, 0, 1)
    b = Placed(shape, orientation=orientation)
    motion = ((5, 0, 0), (0, 0, 0))
    apart = time_of_impact(Placed(shape, (-2.5, half + gap, 0), orientation), b, motion)
    assert apart.status == "separated" and apart.converged
    assert apart.distance >= gap * 0.9999 - 1e-15
    into = time_of_impact(Placed(shape, (-2.5, half - gap, 0), orientation), b, motion)
    # Edges at right angles overlap for a time of 2 gap / 5, which may be shorter than the tolerance.
    assert into.status == "impact" or (into.status == "touching" and (gap < 1e-10 or (kind, gap) == ("edges", 1e-9)))


def test_exact_graze_of_balls_is_touching():
    found = time_of_impact(Placed(Sphere(0.5), (-2.5, 1, 0)), Sphere(0.5), ((5, 0, 0), (0, 0, 0)))
    assert found.status == "touching" and found
    assert found.time <= 0.5 <= found.time_upper < 0.50001
    assert found.distance < 1e-12 and found.distance_time == pytest.approx(0.5, abs=1e-5)


@pytest.mark.parametrize("gap", [1e-6, 1e-9, 1e-12])
def test_gap_at_the_end_of_the_motion(gap):
    cube = Box([0.5, 0.5, 0.5])
    short = time_of_impact(Placed(cube, (3, 0, 0)), cube, ((-2 + gap, 0, 0), (0, 0, 0)))
    assert short.status == "separated" and short.time is short.normal is short.point is short.time_upper is None
    assert time_of_impact(Placed(cube, (3, 0, 0)), cube, ((-2 - gap, 0, 0), (0, 0, 0))).status == "impact"


def test_bullet_through_thin_sheet_between_two_poses():
    sheet = Box([1, 1, 1e-6])
    before, after = Placed(Sphere(0.001), (0.2, 0, 1)), Placed(Sphere(0.001), (0.2, 0, -3))
    found = time_of_impact(before, sheet, after, duration=0.01)
    assert found.time == pytest.approx(0.01 * (1 - 0.001 - 1e-6) / 4, abs=1e-11)
    assert found.normal == pytest.approx([0, 0, 1])
    assert repr(found) == "TimeOfImpact(impact, time=0.0024975 s)"


def test_two_poses_turn_the_shorter_way():
    bar = Box([1, 0.1, 0.1])
    for sign in (1, -1):  # both signs of a quaternion are one orientation
        end = Placed(bar, orientation=sign * turn([0, 0, 0.5]))
        assert not time_of_impact(bar, Placed(Sphere(0.1), (0, 0.9, 0)), end)
        assert time_of_impact(bar, Placed(Sphere(0.1), (0.8, 0.35, 0)), end).status == "impact"


def test_start_that_overlaps_or_touches():
    cube = Box([0.5, 0.5, 0.5])
    inside = time_of_impact(Placed(cube, (0.5, 0, 0)), cube, ((1, 0, 0), (0, 0, 0)))
    assert (inside.status, inside.time, inside.time_upper, inside.distance) == ("overlapping", 0, 0, 0)
    assert inside.normal == pytest.approx([1, 0, 0]) and inside.point == pytest.approx([0.25, 0, 0])
    beside = time_of_impact(Placed(cube, (1, 0, 0)), cube)
    assert (beside.status, beside.time) == ("touching", 0)


def test_bodies_at_rest_stay_separated():
    found = time_of_impact(Placed(Sphere(0.5), (1.5, 0, 0)), Sphere(0.5))
    assert (found.status, found.distance, bool(found)) == ("separated", 0.5, False)


def test_few_distances_are_computed():
    """The direction turns with the facet or the edges that will meet."""
    rng = np.random.default_rng(9)
    steps = []
    for _ in range(100):
        a, b = (Placed(Box(rng.uniform(0.2, 1, 3)), p, quaternion(rng)) for p in ((4, 0, 0), (0, 0, 0)))
        spins = rng.normal(size=(2, 3)) * 0.6
        steps.append(time_of_impact(a, b, ((-4, 0, 0), spins[0]), ((0, 0, 0), spins[1])).steps)
    assert np.median(steps) <= 4 and max(steps) <= 12


def test_spinning_ball_costs_no_more_steps_than_a_still_one():
    fast = time_of_impact(Placed(Sphere(0.5), (3, 0, 0)), Sphere(0.5), ((-4, 0, 0), (300, 400, 500)))
    assert fast.steps == time_of_impact(Placed(Sphere(0.5), (3, 0, 0)), Sphere(0.5), ((-4, 0, 0), (0, 0, 0))).steps


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"duration": 0}, "duration must be greater than 0"),
        ({"duration": float("nan")}, "duration must be greater than 0"),
        ({"tolerance": 1}, "tolerance must be greater than 0 and less than 1"),
        ({"motion_a": (1, 2, 3)}, "motion_a must be a pair"),
        ({"motion_b": ((0, 0, float("inf")), (0, 0, 0))}, "motion_b must be finite"),
        ({"motion_b": ((0, 0), (0, 0, 0))}, r"motion_b\[0\] must be three numbers"),
        ({"a": HalfSpace([0, 0, 1], 0), "b": HalfSpace([0, 0, -1], -1)}, "a and b must not both be half-spaces"),
    ],
)
def test_refused_arguments(arguments, words):
    with pytest.raises(ValueError, match=words):
        time_of_impact(**{"a": Sphere(1), "b": Placed(Sphere(1), (3, 0, 0)), **arguments})
