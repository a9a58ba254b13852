"""An ellipsoid with a capsule, a cylinder or a rounded hull: lenses of discs that planes cut, beside exact measures."""

import numpy as np
import pytest
from ellipsoid_and_tube_exact import Pair, volume
from strategies import rotation

from overlapper import Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, Placed, RoundedHull, Sphere, overlap

DEPTHS = [1.0, 1e-1, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10]
CUBE = np.array([[x, y, z] for x in (-0.3, 0.3) for y in (-0.2, 0.2) for z in (-0.25, 0.25)])


def farthest(shape, turn, way):
    """The point of a shape about its centre that lies farthest along a direction."""
    own = turn.T @ way
    if isinstance(shape, Ellipsoid):
        scaled = shape.half_axes * own
        return turn @ (shape.half_axes * scaled) / np.linalg.norm(scaled)
    end = np.array([0, 0, np.sign(own[2]) * shape.length / 2])
    if isinstance(shape, Capsule):
        return turn @ (end + shape.radius * own)
    side = np.array([own[0], own[1], 0])
    return turn @ (end + shape.radius * side / np.linalg.norm(side))


def pair(kind, seed, depth):
    """Bodies of any orientation that share a part of that depth, in units of the shortest size."""
    rng = np.random.default_rng([seed, round(-np.log10(depth)), kind is Capsule])
    ellipsoid = Ellipsoid(10 ** rng.uniform(-0.5, 0.5, 3))
    tube = kind(10 ** rng.uniform(-0.5, 0.5), 10 ** rng.uniform(-0.5, 0.5))
    # A Placed rounds quaternions to length 1, and these lengths are 1 but for rounding.
    quaternions = np.array([q / np.linalg.norm(q) for q in rng.normal(size=(2, 4))])
    turns = [rotation(q) for q in quaternions]
    way = rng.normal(size=3)
    if seed % 2 == 0:  # the side of the tube
        way -= turns[1][:, 2] * (turns[1][:, 2] @ way)
        way += 1e-3 * turns[1][:, 2]
    way /= np.linalg.norm(way)
    between = farthest(ellipsoid, turns[0], way) - farthest(tube, turns[1], -way)
    between -= depth * min(*ellipsoid.half_axes, tube.radius) * way
    position = rng.normal(size=3)
    return Placed(ellipsoid, position, quaternions[0]), Placed(tube, position + between, quaternions[1])


def exact_volume(a, b, found):
    axis = rotation(b.orientation)[:, 2]
    exact = Pair(a.shape, a.position, a.orientation, b.shape, b.position, b.orientation)
    return volume(exact, float((found.centroid - b.position) @ axis))


@pytest.mark.parametrize("kind", [Capsule, Cylinder])
@pytest.mark.parametrize("depth", DEPTHS)
def test_volumes_are_those_of_slices_across_the_axis(kind, depth):
    for seed in range(2):
        a, b = pair(kind, seed, depth)
        found = overlap(a, b)
        truth = exact_volume(a, b, found)
        assert found.way == "slicing"
        assert abs(found.volume - truth) <= found.volume_error, seed
        assert found.volume == pytest.approx(truth, rel=1e-12, abs=0), (seed, found.volume_error)


@pytest.mark.parametrize("depth", [1e-3, 1e-4, 1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize("seed", range(6))
def test_a_rim_of_a_cylinder_states_an_error_of_a_trillionth(depth, seed):
    """The common part is a sliver along the rim, a hundred thousand times as long as wide."""
    a, b = pair(Cylinder, 2 * seed + 1, depth)
    found = overlap(a, b)
    assert found.way == "slicing" and found.volume_error <= 2e-12 * found.volume
    if depth in (1e-4, 1e-8):
        truth = exact_volume(a, b, found)
        assert abs(found.volume - truth) <= max(found.volume_error, 1e-12 * truth)


@pytest.mark.parametrize("depth", [1e-3, 1e-5, 1e-7, 1e-10])
@pytest.mark.parametrize("shape", [Cylinder(0.6, 2), RoundedHull(CUBE, 0.0625)], ids=["cylinder", "rounded hull"])
def test_a_flat_face_cuts_the_same_cap_as_a_half_space(shape, depth):
    rng = np.random.default_rng(round(-np.log10(depth)))
    for _ in range(4):
        ellipsoid, quaternion = Ellipsoid(10 ** rng.uniform(-0.5, 0.5, 3)), rng.normal(size=4)
        face = 1.0 if isinstance(shape, Cylinder) else 0.3125  # of the exact sizes
        low = farthest(ellipsoid, rotation(quaternion / np.linalg.norm(quaternion)), np.array([0, 0, -1.0]))
        a = Placed(ellipsoid, np.array([0, 0, face - depth]) - low, quaternion)
        found, cap = overlap(a, Placed(shape)), overlap(a, HalfSpace([0, 0, 1], face))
        assert abs(found.volume - cap.volume) <= found.volume_error + cap.volume_error
        assert found.volume_error <= (1e-13 if isinstance(shape, Cylinder) else 1e-12) * found.volume
        assert (np.abs(found.gradient - cap.gradient) <= found.errors.gradient + cap.errors.gradient).all()
        assert found.area == pytest.approx(cap.area, rel=1e-9, abs=0)
        assert np.allclose(found.centroid, cap.centroid, atol=1e-14)


@pytest.mark.parametrize("depth", DEPTHS)
def test_the_end_of_a_capsule_is_a_ball(depth):
    rng = np.random.default_rng(round(-np.log10(depth)))
    ellipsoid, quaternion = Ellipsoid([0.7, 0.4, 1.1]), rng.normal(size=4)
    way = np.array([0.5, -0.3, 0.8]) / np.linalg.norm([0.5, -0.3, 0.8])
    at = farthest(ellipsoid, rotation(quaternion), -way)
    a = Placed(ellipsoid, 0.5 * way - at - 0.3 * depth * way, quaternion)
    ball, capsule = overlap(a, Placed(Sphere(0.5))), overlap(a, Placed(Capsule(0.5, 4), (0, 0, -2)))
    assert capsule.volume == pytest.approx(ball.volume, rel=1e-12)
    assert capsule.area == pytest.approx(ball.area, rel=1e-9)
    assert np.allclose(capsule.gradient[0], ball.gradient[0], rtol=1e-10, atol=1e-10 * np.abs(ball.gradient[0]).max())


@pytest.mark.parametrize("cut", [0.3, 1e-3, 1e-8, 0.0])
def test_halves_of_a_cylinder_add_up_to_the_whole(cut):
    a = Placed(Ellipsoid([0.9, 0.5, 0.7]), (0.4, 0.3, cut), (1, 2, 3, 4))
    whole = overlap(a, Placed(Cylinder(0.6, 4)))
    halves = [overlap(a, Placed(Cylinder(0.6, 2), (0, 0, side))) for side in (-1, 1)]
    assert [h.way for h in halves] == ["slicing"] * 2
    assert sum(h.volume for h in halves) == pytest.approx(whole.volume, rel=1e-13)
    assert np.allclose(sum(h.volume * h.centroid for h in halves), whole.volume * whole.centroid, atol=1e-13)
    assert np.allclose(sum(h.gradient[0] for h in halves), whole.gradient[0], atol=1e-11)


@pytest.mark.parametrize("tilt", [0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3])
def test_a_spheroid_on_the_axis_of_a_cylinder_is_cut_by_its_ends(tilt):
    across, along, radius, half = 0.9, 1.3, 0.6, 0.8
    found = overlap(
        Placed(Ellipsoid([across, across, along])), Placed(Cylinder(radius, 2 * half), (0, 0, 0), (tilt / 2, 0, 0, 1))
    )
    assert radius**2 < across**2 * (1 - half**2 / along**2)  # only the cylinder's ends are outside
    inside = np.pi * radius**2 * 2 * half
    assert found.volume == pytest.approx(inside, rel=1e-12)
    lower = overlap(
        Placed(Ellipsoid([across, across, along])), Placed(Cylinder(2, 2 * half), (0, 0, 0), (tilt / 2, 0, 0, 1))
    )
    slab = np.pi * across**2 * (2 * half - 2 * half**3 / (3 * along**2))
    assert abs(lower.volume - slab) <= lower.volume_error + 2 * tilt**2 * slab
    ends = 2 * np.pi * across**2 * (1 - half**2 / along**2)
    force = np.abs(lower.gradient[0][:3]).max()
    assert force <= 1e-9
    assert 0 < ends < lower.area


@pytest.mark.parametrize("name", ["capsule", "cylinder", "rounded hull"])
def test_gradients_are_the_differences_of_volumes(name):
    shape = {"capsule": Capsule(0.4, 0.9), "cylinder": Cylinder(0.4, 0.9), "rounded hull": RoundedHull(CUBE, 0.1)}[name]
    a = Placed(Ellipsoid([0.5, 0.8, 0.6]), (0.5, 0.2, 0.4), (1, 2, -1, 2))
    b = Placed(shape, (0, 0, 0), (0.3, 0.1, 0.2, 1))
    found = overlap(a, b)
    assert found.way == ("closed form" if name == "rounded hull" else "slicing")
    step = 1e-3

    def by(body, way):
        shift = way * step

        def at(times):
            moved = [Placed(p.shape, p.position + (times * shift if p is body else 0), p.orientation) for p in (a, b)]
            return overlap(*moved).volume

        return (8 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12 * step)

    for i, body in enumerate((a, b)):
        differences = [by(body, way) for way in np.eye(3)]
        assert np.allclose(found.gradient[i][:3], differences, atol=3e-9)
    assert np.allclose(found.gradient[0][:3], -found.gradient[1][:3], atol=1e-15)


@pytest.mark.parametrize("name", ["capsule", "cylinder", "rounded hull"])
def test_all_measures_of_an_almost_round_ellipsoid_are_those_of_a_ball(name):
    shape = {"capsule": Capsule(0.4, 0.9), "cylinder": Cylinder(0.4, 0.9), "rounded hull": RoundedHull(CUBE, 0.1)}[name]
    b = Placed(shape, (0.1, 0.3, -0.2), (0.3, 0.1, 0.2, 1))
    for off in (1e-9,) if name == "rounded hull" else (2**-52, 1e-12):
        almost = overlap(Placed(Ellipsoid([0.5, 0.5, 0.5 * (1 + off)]), (0.4, 0.2, 0.4)), b)
        ball = overlap(Placed(Sphere(0.5), (0.4, 0.2, 0.4)), b)
        assert almost.way == ("closed form" if name == "rounded hull" else "slicing")
        assert almost.volume == pytest.approx(ball.volume, rel=10 * off + 1e-12)
        assert almost.area == pytest.approx(ball.area, rel=10 * off + 1e-10)
        assert np.allclose(almost.centroid, ball.centroid, atol=10 * off + 1e-11)
        assert np.allclose(almost.inertia, ball.inertia, atol=10 * off + 1e-12)
        assert np.allclose(almost.gradient, ball.gradient, atol=10 * off + 1e-10)
        assert almost.patch_area == pytest.approx(ball.patch_area, rel=1e-8)
        assert np.allclose(almost.patch_centre, ball.patch_centre, atol=1e-8)
        assert np.allclose(almost.patch_moments, ball.patch_moments, atol=1e-8)


def test_the_derivative_by_a_radius_is_the_area_of_the_round_surface():
    a = Placed(Ellipsoid([0.5, 0.8, 0.6]), (0.5, 0.2, 0.4), (1, 2, -1, 2))
    step = 1e-3
    for shape in (Capsule, lambda r, _: RoundedHull(CUBE, r)):

        def at(radius, shape=shape):
            return overlap(a, Placed(shape(radius, 0.9), (0, 0, 0), (0.3, 0.1, 0.2, 1)))

        volumes = {k: at(0.3 + k * step).volume for k in (-2, -1, 1, 2)}
        slope = (8 * (volumes[1] - volumes[-1]) - (volumes[2] - volumes[-2])) / (12 * step)
        assert at(0.3).shape_gradient[1][0] == pytest.approx(slope, rel=1e-8)


def test_a_rounded_hull_lies_between_its_core_and_a_larger_hull():
    rng = np.random.default_rng(1)
    for seed in range(6):
        points = rng.normal(size=(12, 3)) * 0.4
        a = Placed(Ellipsoid(rng.uniform(0.3, 0.9, 3)), (0, 0, 0), rng.normal(size=4))
        position, quaternion = rng.normal(size=3) * 0.2, rng.normal(size=4)
        found = [overlap(a, Placed(RoundedHull(points, r), position, quaternion)) for r in (1e-3, 0.05, 0.051)]
        core = overlap(a, Placed(Hull(points), position, quaternion))
        assert [f.way for f in found] == ["closed form"] * 3, seed
        assert found[0].volume - core.volume == pytest.approx(1e-3 * (found[0].area + core.area) / 2, rel=1)
        assert core.volume < found[0].volume < found[1].volume < found[2].volume


def test_a_core_whose_faces_touch_the_ellipsoid_takes_no_longer():
    a = Placed(Ellipsoid([0.5, 1, 0.25]), (0, 0, 0), (5e-14, -2e-13, -3e-14, 1))
    cube = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    found = overlap(a, Placed(RoundedHull(cube, 0.1), (0.25, 0, 0.25), (1, 1, 1, 1)))
    assert found.volume == pytest.approx(a.shape.volume, rel=1e-12)
    assert found.area == pytest.approx(overlap(a, Placed(Hull(3 * cube))).area, rel=1e-9)


def test_one_inside_the_other_is_the_whole_inner_one():
    big, small = (
        Placed(Ellipsoid([3, 4, 5]), (1, 1, 1), (1, 2, 3, 4)),
        Placed(Ellipsoid([0.1, 0.2, 0.15]), (0.1, 0, 0.2)),
    )
    for shape in (Capsule(0.5, 1), Cylinder(0.5, 1), RoundedHull(CUBE, 0.4)):
        assert overlap(big, Placed(shape, (1.2, 0.9, 1))).volume == pytest.approx(shape.volume, rel=1e-13)
        assert overlap(small, Placed(shape)).volume == pytest.approx(small.shape.volume, rel=1e-13)


def test_answers_do_not_depend_on_the_order():
    for kind in (Capsule, Cylinder):
        a, b = pair(kind, 1, 0.1)
        one, other = overlap(a, b), overlap(b, a)
        assert one.volume == other.volume
        assert np.array_equal(one.gradient[0], other.gradient[1])


@pytest.mark.parametrize("away", [0.0, 0.15, 0.45])
def test_meshes_of_more_facets_than_a_slice_can_have_are_cut_in_parts(away):
    rng = np.random.default_rng(5)
    points = rng.normal(size=(90, 3))
    points *= np.array([0.5, 0.4, 0.6]) / np.linalg.norm(points, axis=1)[:, None]
    for core in (Hull(points), Hull(points + [9e-3, 0, 0])):
        assert len(core.facets) > 68
        body = Placed(RoundedHull(core.vertices, 1e-3), (0.1, 0.2, 0.3), (1, 2, 3, 4))
        at = body.position + away * np.array([0.6, 0, 0.8])
        almost = Ellipsoid([0.45, 0.45, 0.45 * (1 + 4e-16)])  # measured as an ellipsoid, though it is a ball
        found, truth = overlap(body, Placed(almost, at)), overlap(body, Placed(Sphere(0.45), at))
        assert abs(found.volume - truth.volume) <= found.volume_error + truth.volume_error + 1e-15
        assert found.volume_error <= 1e-11 * found.volume
        assert np.allclose(found.centroid, truth.centroid, atol=1e-12)
        assert found.area == pytest.approx(truth.area, rel=1e-9)
        assert np.allclose(found.gradient, truth.gradient, atol=1e-10)


def test_a_thin_ellipsoid_and_a_hull_of_many_facets_are_sliced_in_parts():
    """The closed form loses digits there, and the slices of the whole would have too many walls."""
    rng = np.random.default_rng(6)
    points = rng.normal(size=(120, 3))
    hull = Hull(points / np.linalg.norm(points, axis=1)[:, None])
    inside = Placed(Ellipsoid([0.6, 0.5, 1e-9]), (0.01, 0.02, 0.03), (1, 2, 3, 4))
    found = overlap(hull, inside)
    assert found.volume == pytest.approx(4 / 3 * np.pi * 0.3e-9, rel=1e-12)
    cut = overlap(hull, Placed(Ellipsoid([1.2, 1.3, 1e-8]), (0.1, 0.2, 0.3), (1, 2, 3, 4)))
    assert "dual" not in cut.way and cut.volume_error <= 1e-11 * cut.volume


def test_a_corner_of_many_facets_is_sliced():
    """Any three walls at the tip of a pyramid meet there: more changes of outlines than a list holds."""
    sides = 24
    ring = np.array([[np.cos(at), np.sin(at), -0.3] for at in 2 * np.pi * np.arange(sides) / sides])
    pyramid = Placed(RoundedHull(np.vstack([ring, [0, 0, 0.3]]), 1e-3), (0, 0, 0), (1, 2, 3, 4))
    ellipsoid = Placed(Ellipsoid([0.3, 0.5, 0.4]), 0.3 * rotation(pyramid.orientation)[:, 2], (0.3, 0.1, -0.2, 1))
    found = overlap(pyramid, ellipsoid)
    assert found.errors.area <= 1e-8 * found.area
    assert found.way == "closed form" and found.volume_error <= 1e-12 * found.volume
