"""The bound of a gap over a box of joint positions is below the exact gap of every configuration in the box.

The interval arithmetic that checks such bounds finds room only where no configuration of the box overlaps.
"""

from dataclasses import replace

import mpmath
import numpy as np
import pytest

from overlapper import Box, Capsule, Cylinder, Ellipsoid, Hull, Placed, RoundedHull, Sphere, distance
from overlapper.audit.prove import matrices
from overlapper.proof.chain import Ball, Body, Chain, ChainJoint, ball, centres, cross, outer
from overlapper.proof.interval_chain import IntervalChain
from overlapper.proof.rational_body import RationalBody
from overlapper.rational import exact

POINTS = np.random.default_rng(5).uniform(-0.3, 0.3, (9, 3))
SHAPES = [
    Sphere(0.2),
    Box((0.1, 0.2, 0.3)),
    Capsule(0.1, 0.5),
    Cylinder(0.2, 0.4),
    Ellipsoid((0.1, 0.2, 0.3)),
    Hull(POINTS),
    RoundedHull(POINTS, 0.05),
]


def unit(rng, n):
    found = rng.normal(size=n)
    return found / np.linalg.norm(found)


def body(rng, shape, columns, kinds):
    """A shape behind joints of random frames, with the columns that drive them."""
    joints = tuple(
        ChainJoint(
            kind, rng.uniform(-1, 1, 3), unit(rng, 4), unit(rng, 3), rng.uniform(-0.5, 0.5, 3), column, factor, 0.1
        )
        for kind, column, factor in zip(kinds, columns, (1.0, -0.7, 0.3))
    )
    return Body(*outer(shape), rng.uniform(-0.2, 0.2, 3), unit(rng, 4), joints)


def chain(seed):
    """Bodies behind two joints and three joints. Column 1 drives a joint on either side."""
    rng = np.random.default_rng(seed)
    one, two = rng.choice(len(SHAPES), 2)
    kinds = rng.choice(["revolute", "revolute", "prismatic"], 5)
    a = body(rng, SHAPES[one], (0, 1), kinds[:2])
    b = body(rng, SHAPES[two], (1, -1 if seed % 5 == 0 else 2, 3), kinds[2:])
    return Chain(a, b), (SHAPES[one], SHAPES[two]), rng


def exact_turn(quaternion):
    x, y, z, w = map(mpmath.mpf, quaternion.tolist())
    s = x * x + y * y + z * z + w * w
    return (
        mpmath.matrix(
            [
                [s - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), s - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), s - 2 * (x * x + y * y)],
            ]
        )
        / s
    )


def exact_points(body, values):
    """The points of a body at a configuration, with 40 digits: poses as homogeneous matrices, from the tip inwards."""
    points = [mpmath.matrix(each) for each in body.points.tolist()]

    def move(turn, shift):
        return [turn * each + shift for each in points]

    points = move(exact_turn(body.orientation), mpmath.matrix(body.position.tolist()))
    for joint in reversed(body.joints):
        value = mpmath.mpf(joint.shift)
        if joint.column >= 0:
            value += mpmath.mpf(joint.multiplier) * mpmath.mpf(values[joint.column])
        axis = mpmath.matrix(joint.axis.tolist())
        points = move(mpmath.eye(3), mpmath.matrix(joint.offset.tolist()))
        if joint.kind == "revolute":
            half = axis / mpmath.norm(axis) * mpmath.sin(value / 2)
            w = mpmath.cos(value / 2)
            x, y, z = half
            turn = mpmath.matrix(
                [
                    [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                    [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                    [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
                ]
            )
            points = move(turn, mpmath.zeros(3, 1))
        else:
            points = move(mpmath.eye(3), axis * value)
        points = move(exact_turn(joint.orientation), mpmath.matrix(joint.position.tolist()))
    return points


def exact_room(chain, values, axis):
    """The room between two bodies along an axis, times the length of the axis."""
    n = mpmath.matrix(axis.tolist())
    low = min(mpmath.fdot(n, each) for each in exact_points(chain.a, values))
    high = max(mpmath.fdot(n, each) for each in exact_points(chain.b, values))
    return low - high - (mpmath.mpf(chain.a.radius) + mpmath.mpf(chain.b.radius)) * mpmath.norm(n)


def exact_nearest(chain, values):
    """An upper bound of the distance: that of the nearest points, less the radii."""
    a, b = exact_points(chain.a, values), exact_points(chain.b, values)
    return min(mpmath.norm(p - q) for p in a for q in b) - chain.a.radius - chain.b.radius


def distances(chain, shapes, values):
    """The distances of two shapes by the core."""
    a, b = (matrices(each.turn.middle, each.position.middle) for each in chain.placed(values))
    return [distance(Placed(shapes[0], p), Placed(shapes[1], q)) for p, q in zip(a, b)]


@pytest.fixture(autouse=True)
def digits():
    with mpmath.workdps(40):
        yield


@pytest.mark.parametrize("seed", range(12))
def test_the_bound_of_a_box_without_width_is_the_exact_gap(seed):
    made, _, rng = chain(seed)
    values = rng.uniform(-2, 2, len(made.columns))
    axis = unit(rng, 3)
    (bound,), _ = made.margins(values[None], values[None], axis[None])
    room = exact_room(made, dict(zip(made.columns, values)), axis)
    assert room - 1e-12 < bound <= room


@pytest.mark.parametrize("seed", range(25))
def test_no_configuration_of_a_box_is_nearer_than_the_bound(seed):
    made, shapes, rng = chain(seed)
    n = len(made.columns)
    for width in (0.01, 0.2, 1.0):
        middle = rng.uniform(-2, 2, n)
        widths = width * rng.uniform(0, 1, n)
        lower, upper = middle - widths, middle + widths
        placed = made.placed(centres(lower[None], upper[None]))
        axis = (placed[0].position.middle - placed[1].position.middle)[0, :, 0]
        axis /= np.linalg.norm(axis)
        (bound,), (shares,) = made.margins(lower[None], upper[None], axis[None])
        assert (shares >= 0).all() and shares.shape == (n,)
        values = np.where(rng.integers(0, 2, (100, n)), lower, upper)
        values[::2] = rng.uniform(lower, upper, (50, n))
        assert bound <= exact_nearest(made, dict(zip(made.columns, values[0])))
        assert bound <= min(distances(made, shapes, values)) + 1e-12


def test_the_bound_is_tight_where_one_joint_swings_a_point():
    # The gap along x is 2 - cos q - 0.2. It is 0.8 at q = 0.
    made = arm_beside_a_ball(2.0)
    for half in (0.1, 0.01):
        (bound,), _ = made.margins(np.array([[-half]]), np.array([[half]]), np.array([[1.0, 0, 0]]))
        assert 0.8 - 0.51 * half**2 < bound < 0.8


@pytest.mark.parametrize("seed", range(12))
def test_intervals_find_room_at_a_configuration_where_the_exact_gap_is_positive(seed):
    made, _, rng = chain(seed)
    values = rng.uniform(-2, 2, len(made.columns))
    axis = unit(rng, 3)
    room = float(exact_room(made, dict(zip(made.columns, values)), axis))
    for gap in (1e-12, -1e-12):
        one = Chain(replace(made.a, radius=made.a.radius + room - gap), made.b)
        assert IntervalChain(one).has_room(values, values, axis) == (gap > 0)


@pytest.mark.parametrize("seed", range(12))
def test_no_configuration_overlaps_in_the_widest_box_where_intervals_find_room(seed, monkeypatch):
    monkeypatch.setattr("overlapper.proof.interval_chain.PIECES", 8)
    made, shapes, rng = chain(seed)
    n, gap = len(made.columns), 0.0
    while gap < 0.05:
        middle = rng.uniform(-2, 2, n)
        (gap,) = distances(made, shapes, middle[None])
    placed = made.placed(middle[None])
    axis = (placed[0].position.middle - placed[1].position.middle)[0, :, 0]
    widths = rng.uniform(0.5, 1, n)
    intervals, low, high = IntervalChain(made), 0.0, 2.0
    for _ in range(6):
        share = (low + high) / 2
        lower, upper = middle - share * widths, middle + share * widths
        (bound,), _ = made.margins(lower[None], upper[None], axis[None])
        found = intervals.has_room(lower, upper, axis)
        assert found or bound <= 0
        low, high = (share, high) if found else (low, share)
    values = middle + low * widths * np.vstack([rng.choice([-1.0, 1.0], (40, n)), rng.uniform(-1, 1, (20, n))])
    assert low == 0 or min(distances(made, shapes, values)) > 0


STILL = np.array([0, 0, 0, 1.0])


def arm(column=0):
    """A joint that turns about z, at the end of an arm of 1 m along x from the joint before. The first is at 0."""
    along = np.array([1.0 if column else 0, 0, 0])
    return ChainJoint("revolute", along, STILL, np.array([0, 0, 1.0]), np.zeros(3), column, 1.0, 0.0)


def arm_beside_a_ball(place):
    """A ball on an arm of 1 m, which turns about z, and a ball at x = `place`. Both have a radius of 0.1 m."""
    fixed = Body(np.zeros((1, 3)), 0.1, np.array([place, 0, 0]), STILL, ())
    return Chain(fixed, Body(np.zeros((1, 3)), 0.1, np.array([1.0, 0, 0]), STILL, (arm(),)))


def test_intervals_find_no_room_in_more_than_a_full_turn_that_passes_a_ball():
    made = IntervalChain(arm_beside_a_ball(1.199))
    for half in (1.4, 1.6, 3.1, 4.0):
        assert not made.has_room(np.array([1 - half]), np.array([1 + half]), np.array([1.0, 0, 0]))


def test_intervals_find_room_below_a_bar_only_where_two_joints_together_do_not_lift_a_point_to_it():
    # The point is at y = sin p + sin(p + q). Both first derivatives are 0 at p = pi / 2, q = pi.
    lower, upper = np.array([np.pi / 2, np.pi]) - 0.3, np.array([np.pi / 2, np.pi]) + 0.3
    highest = np.cos(0.3) - np.cos(0.6)
    for gap in (0.02, -0.001):
        bar = Body(np.array([[-1.0, 0, 0], [1.0, 0, 0]]), 0.0, np.array([0, highest + gap, 0]), STILL, ())
        tip = Body(np.zeros((1, 3)), 0.0, np.array([1.0, 0, 0]), STILL, (arm(), arm(1)))
        assert IntervalChain(Chain(bar, tip)).has_room(lower, upper, np.array([0, 1.0, 0])) == (gap > 0)


@pytest.mark.parametrize("halved", [True, False])
def test_intervals_halve_a_box_that_is_too_wide(monkeypatch, halved):
    # The gap along x is 1.3 - cos q - 0.2. It is least at q = 0, where it is 0.1.
    if not halved:
        monkeypatch.setattr("overlapper.proof.interval_chain.PIECES", 1)
    made = IntervalChain(arm_beside_a_ball(1.3))
    lower, upper, axis = np.array([-0.2]), np.array([2.2]), np.array([1.0, 0, 0])
    assert made.has_room(lower, upper, axis) == halved
    assert not IntervalChain(arm_beside_a_ball(1.199)).has_room(lower, upper, axis)


@pytest.mark.parametrize("axis", [(0, 0, 0), (np.nan, 0, 0), (1, np.nan, 0), (np.inf, 0, 0), (-1, 0, 0)])
def test_intervals_find_no_room_along_an_axis_that_is_none(axis):
    at = np.array([1.0])
    assert not IntervalChain(arm_beside_a_ball(1.3)).has_room(at, at, np.array(axis, dtype=float))


@pytest.mark.parametrize("shape", SHAPES, ids=lambda each: type(each).__name__)
def test_a_body_contains_its_shape(shape):
    rng = np.random.default_rng(3)
    points, radius = outer(shape)
    rational = RationalBody(Placed(shape))
    made = Body(points, radius, np.zeros(3), np.array([0, 0, 0, 1.0]), ())
    centre, radii = made.levers
    for _ in range(50):
        normal = unit(rng, 3)
        flat, square = rational.support(exact(normal))
        assert float(flat) + float(square) ** 0.5 <= (points @ normal).max() + radius + 1e-15
        assert (points @ normal).max() <= (centre @ normal + radii).max()


def test_balls_contain_exact_results():
    rng = np.random.default_rng(8)
    a, b = rng.normal(size=(2, 40, 3, 3))
    product = ball(a) @ ball(b)
    u, v = ball(a[:, :, :1]), ball(b[:, :, :1])
    crossed = cross(u, v)
    for k in range(40):
        true = mpmath.matrix(a[k].tolist()) * mpmath.matrix(b[k].tolist())
        for i in range(3):
            for j in range(3):
                assert abs(true[i, j] - product.middle[k, i, j]) <= product.radius[k, i, j] < 1e-14
        p, q = ([mpmath.mpf(x) for x in each[k, :, 0].tolist()] for each in (a, b))
        for i in range(3):
            exact_part = p[(i + 1) % 3] * q[(i + 2) % 3] - p[(i + 2) % 3] * q[(i + 1) % 3]
            assert abs(exact_part - crossed.middle[k, i, 0]) <= crossed.radius[k, i, 0] < 1e-14
    wide = Ball(np.ones((1, 3, 1)), np.full((1, 3, 1), 0.5))
    assert wide.most[0] >= 1.5 * 3**0.5
