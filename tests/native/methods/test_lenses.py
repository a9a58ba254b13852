"""An ellipsoid with a ball or an ellipsoid, by slices in which both are discs, beside exact measures."""

import numpy as np
import pytest
from ellipsoid_exact import Given, common, exact
from strategies import rotation

from overlapper import Ellipsoid, Placed, Sphere, overlap

DEPTHS = [1.0, 0.3, 1e-1, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10]


def farthest(turn, half_axes, direction):
    own = half_axes * (turn.T @ direction)
    return turn @ (half_axes * own) / np.linalg.norm(own)


def axes(rng, kind, aspect):
    """Half axes up to `aspect` times as long as another."""
    made = aspect ** rng.uniform(-0.5, 0.5, 3)
    if kind == "of revolution":
        made[1] = made[0]
    elif kind == "nearly round":
        made = np.array([1, 1 + 1e-12, 1 + 1e-9 * rng.normal()])
    return made


def pair(seed, depth, inner=False):
    """Bodies that share a lens of that depth, in shortest half axes. With `inner`, one is that far out of the other."""
    rng = np.random.default_rng([seed, round(-np.log10(depth) * 10), inner])
    kinds = ["any", "of revolution", "nearly round", "ball"]
    kind_a, kind_b = rng.choice(kinds[:3]), rng.choice(kinds)
    half_a, half_b = (axes(rng, kind, 10 ** rng.uniform(0, 2)) for kind in (kind_a, kind_b))
    if kind_b == "ball":
        half_b[:] = half_b[0]
    quaternions = rng.normal(size=(2, 4))
    turns = [rotation(q) for q in quaternions]
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    if inner:  # touches from inside, or nearly
        half_b *= 0.4 * half_a.min() ** 2 / half_a.max() / half_b.max()
        between = farthest(turns[0], half_a, way) - farthest(turns[1], half_b, way)
        between += (depth if rng.random() < 0.5 else -depth) * half_b.min() * way
    else:
        between = farthest(turns[0], half_a, way) + farthest(turns[1], half_b, way)
        between -= depth * min(half_a.min(), half_b.min()) * way
    position = rng.normal(size=3) * 10 ** rng.uniform(-1, 1)
    shape_b = Sphere(half_b[0]) if kind_b == "ball" else Ellipsoid(half_b)
    bodies = Given(Ellipsoid(half_a), position, quaternions[0]), Given(shape_b, position + between, quaternions[1])
    return bodies if rng.random() < 0.5 else bodies[::-1]


@pytest.mark.parametrize("inner", [False, True])
@pytest.mark.parametrize("depth", DEPTHS)
def test_volumes_are_right_to_a_trillionth_at_any_depth(depth, inner):
    for seed in range(6):
        a, b = pair(seed, depth, inner)
        found = overlap(a.placed, b.placed)
        truth = common(a, b).volume
        assert found.way in ("slicing", "closed form"), seed  # a ball in an ellipsoid is a ball
        error = abs(float(exact(found.volume) - truth))
        assert error <= found.volume_error and error <= 1e-12 * float(truth), seed
        assert found.volume_error <= 1e-11 * float(truth), seed


def floats(vector):
    return np.array([float(x) for x in vector])


@pytest.mark.parametrize("depth", DEPTHS[::2])
def test_all_measures_are_within_their_errors(depth):
    for seed in range(10, 12):
        a, b = pair(seed, depth)
        found, truth = overlap(a.placed, b.placed), common(a, b, with_area=True)
        errors, force = found.errors, floats(truth.force)
        assert np.linalg.norm(found.centroid - floats(truth.centroid)) <= errors.centroid
        assert abs(found.area - float(truth.area)) <= errors.area <= 1e-7 * found.area
        assert np.abs(found.inertia - np.array([floats(row) for row in truth.inertia])).max() <= errors.inertia
        for side, moment, row, error in zip((1, -1), truth.moments, found.gradient, errors.gradient):
            assert np.linalg.norm(row[:3] - side * force) <= error[0]
            assert np.linalg.norm(row[3:] - floats(moment)) <= error[1]
        assert np.linalg.norm(found.patch_area + force) <= sum(error[0] for error in errors.gradient)
        size = np.sqrt(np.linalg.norm(force))
        assert np.linalg.norm(force) == pytest.approx(np.linalg.norm(found.patch_area), rel=1e-9)
        assert np.linalg.norm(found.patch_centre - found.centroid) < 2 * size * max(1, 1 / size)


@pytest.mark.parametrize("ratio", [0.25, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("depth", [0.5, 1e-3, 1e-6, 1e-9])
def test_parallel_ellipsoids_of_one_shape_share_the_image_of_a_lens_of_balls(ratio, depth):
    half_axes = np.array([2.0, 0.5, 0.125])  # so that nothing is rounded
    at = 1 + ratio - depth
    balls = overlap(Sphere(1), Placed(Sphere(ratio), (at, 0, 0)))
    stretched = overlap(Ellipsoid(half_axes), Placed(Ellipsoid(ratio * half_axes), (at * half_axes[0], 0, 0)))
    assert stretched.volume == pytest.approx(balls.volume * half_axes.prod(), rel=1e-13)
    assert stretched.volume_error <= 1e-12 * stretched.volume


def test_one_inside_the_other_is_the_whole_inner_one():
    outer, inner = Ellipsoid([3, 2, 1]), Ellipsoid([0.3, 0.5, 0.4])
    for q in np.random.default_rng(1).normal(size=(5, 4)):
        found = overlap(outer, Placed(inner, (0.2, 0.1, -0.1), q))
        assert found.volume == pytest.approx(4 / 3 * np.pi * 0.06, rel=1e-14)
        assert found.area == pytest.approx(overlap(inner, Ellipsoid([9, 9, 9.5])).area, rel=1e-9)
        np.testing.assert_allclose(found.gradient, 0, atol=1e-12)


def test_answers_do_not_depend_on_the_order_nor_on_the_tolerance():
    a, b = (each.placed for each in pair(3, 1e-2))
    first, second, loose = overlap(a, b), overlap(b, a), overlap(a, b, tolerance=0.1)
    assert first.volume == second.volume == loose.volume and first.area == second.area
    np.testing.assert_array_equal(first.gradient, second.gradient[::-1])
    assert first.converged


@pytest.mark.parametrize("seed", range(8))
def test_a_square_root_just_outside_an_interval_is_noticed(seed):
    """Bodies that nearly touch from inside, at places where outlines change twice within little."""
    rng = np.random.default_rng([4, seed])
    half_a, half_b = rng.uniform(0.6, 1.3, 3), rng.uniform(0.6, 1.3, 3)
    q = rng.normal(size=(2, 4))
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    between = farthest(rotation(q[0]), half_a, way) - farthest(rotation(q[1]), half_b, way) * rng.uniform(0.9, 1)
    a, b = Given(Ellipsoid(half_a), np.zeros(3), q[0]), Given(Ellipsoid(half_b), between, q[1])
    found, truth = overlap(a.placed, b.placed), common(a, b).volume
    assert abs(float(exact(found.volume) - truth)) <= min(found.volume_error, 1e-12 * float(truth))
