"""The derivative of the volume by sizes: against areas in rational arithmetic, and differences of exact volumes."""

from fractions import Fraction

import exact
import numpy as np
import pytest
from families import make
from numpy.testing import assert_allclose
from strategies import quaternion

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
    arrays,
    overlap,
    overlaps,
    random_polytope,
)

PAIRS = [make("posed_boxes", seed) for seed in range(40)]


def areas_of_sides(case, body):
    """Exact but for the last rounding: area vectors are seen along the exact axes of the box."""
    x, y, z, w = (Fraction(float(c)) for c in case.bodies[body].orientation)
    axes = (
        (w * w + x * x - y * y - z * z, 2 * (x * y + z * w), 2 * (x * z - y * w)),
        (2 * (x * y - z * w), w * w - x * x + y * y - z * z, 2 * (y * z + x * w)),
        (2 * (x * z + y * w), 2 * (y * z - x * w), w * w - x * x - y * y + z * z),
    )
    length = x * x + y * y + z * z + w * w
    areas = [Fraction(0)] * 3
    for facet in case.truth.facets:
        if body in facet.owners:
            along = [abs(exact.dot(exact.area_vector(facet), axis)) / length for axis in axes]
            areas[along.index(max(along))] += max(along)
    return areas


@pytest.mark.parametrize("case", PAIRS, ids=repr)
def test_half_extents_of_boxes_against_areas_in_rational_arithmetic(case):
    found = overlap(*case.placed)
    if case.truth.dimension < 3:
        assert not found.shape_gradient.any()
        return
    for body in (0, 1):
        exactly = np.array(areas_of_sides(case, body), float)
        assert_allclose(found.shape_gradient[body], exactly, rtol=0, atol=1e-12 * case.truth.area)


@pytest.mark.parametrize("case", [case for case in PAIRS if case.truth.dimension == 3][:8], ids=repr)
def test_half_extents_of_boxes_against_differences_of_exact_volumes(case):
    found = overlap(*case.placed)
    step = 2.0**-20 * float(min(case.bodies[0].half_extents))
    for axis in range(3):
        volumes = []
        for side in (-1, 1):
            half = case.bodies[0].half_extents.copy()
            half[axis] += side * step
            moved = type(case)("moved", 0, (case.bodies[0]._replace(half_extents=half), case.bodies[1]))
            volumes.append(moved.truth.volume)
        slope = float((volumes[1] - volumes[0]) / Fraction(2 * step))
        assert found.shape_gradient[0, axis] == pytest.approx(slope, abs=1e-5 * case.truth.area)


def test_euler_holds_for_boxes_of_any_way():
    # The volume has the degree 3 in all sizes and in the distance.
    rng = np.random.default_rng(1)
    for offset in (1.0, 1e-2, 1e-6, 1e-10):
        for _ in range(10):
            half, position, turn = rng.uniform(0.5, 1, 3), rng.uniform(-0.5, 0.5, 3), quaternion(rng)
            near = half * np.exp(offset * rng.normal(size=3)), position + offset * rng.normal(size=3) * 0.2
            a, b = Placed(Box(half), position, turn), Placed(Box(near[0]), near[1], turn + offset * rng.normal(size=4))
            found = overlap(a, b)
            sizes = found.shape_gradient[0] @ half + found.shape_gradient[1] @ near[0]
            assert sizes + found.gradient[0, :3] @ (position - near[1]) == pytest.approx(3 * found.volume, rel=1e-9)


def test_half_spaces_and_numbers_without_a_derivative():
    box, water = Placed(Box((1, 2, 3)), (0, 0, 0.5)), HalfSpace((0, 0, 1), 1.0)
    assert_allclose(overlap(box, water).shape_gradient, [[2 * 4 * 3.5, 2 * 2 * 3.5, 8], [8, 0, 0]], rtol=1e-15)
    hull = overlap(Hull(random_polytope(20, rng=1).vertices), Box((0.3, 0.3, 0.3))).shape_gradient
    assert np.isnan(hull[0]).all() and np.isfinite(hull[1]).all()
    apart = overlap(Box((1, 1, 1)), Placed(Box((1, 1, 1)), (5, 0, 0)))
    assert not apart.shape_gradient.any()


def test_radii_of_spheres_against_the_areas_of_caps():
    # The radical plane of two spheres cuts off the caps; a cap of height h has the area 2 pi r h.
    for r, s, d in ((1.0, 1.0, 1.5), (1.0, 0.5, 1.2), (1.0, 1e-3, 1.0), (1.0, 0.7, 1.7 - 1e-6)):
        x = (d * d + r * r - s * s) / (2 * d)
        found = overlap(Sphere(r), Placed(Sphere(s), (0, d, 0))).shape_gradient
        caps = [2 * np.pi * r * (r - x), 2 * np.pi * s * (s - (d - x))]
        assert_allclose(found, [[caps[0], 0, 0], [caps[1], 0, 0]], rtol=1e-8)
    water = overlap(Sphere(2.0), HalfSpace((0, 0, 1), 1.0)).shape_gradient
    assert_allclose(water, [[2 * np.pi * 2 * 3, 0, 0], [3 * np.pi, 0, 0]], rtol=1e-12)


ROUND = {
    "sphere": (Sphere, (0.5,)),
    "capsule": (Capsule, (0.5, 0.8)),
    "cylinder": (Cylinder, (0.5, 0.8)),
    "box": (lambda *half: Box(half), (0.5, 0.4, 0.6)),
    "rounded hull": (lambda r: RoundedHull(random_polytope(8, rng=3).vertices * 0.4, r), (0.3,)),
}
OTHERS = [Sphere(0.83), Capsule(0.4, 0.5), Cylinder(0.5, 0.9), Box((0.5, 0.6, 0.7)), HalfSpace((1, 2, 3), 0.2)]


@pytest.mark.parametrize("kind", ROUND)
@pytest.mark.parametrize("other", OTHERS, ids=lambda shape: type(shape).__name__)
def test_numbers_of_round_pairs_against_differences_of_volumes(kind, other):
    make, numbers = ROUND[kind]
    body = Placed(other, (0.4, 0.3, -0.2), (0.3, -0.2, 0.5, 0.7))
    found, step = overlap(make(*numbers), body).shape_gradient[0], 1e-4
    for k in range(len(numbers)):
        volumes = []
        for side in (-1, 1):
            moved = [n + side * step * (i == k) for i, n in enumerate(numbers)]
            volumes.append(overlap(make(*moved), body, tolerance=1e-6).volume)
        assert found[k] == pytest.approx((volumes[1] - volumes[0]) / (2 * step), rel=1e-5, abs=1e-7)
    assert not found[len(numbers) :].any()


@pytest.mark.parametrize("kind", ["sphere", "capsule", "cylinder", "box"])
def test_euler_holds_for_round_pairs(kind):
    # The volume has the degree 3 in all sizes and in the distance.
    rng = np.random.default_rng(3)
    make, numbers = ROUND[kind]
    for other, sizes in ((Sphere, (0.8,)), (Capsule, (0.4, 0.5)), (Cylinder, (0.5, 0.9))):
        for _ in range(3):
            position = rng.uniform(-0.4, 0.4, 3)
            found = overlap(make(*numbers), Placed(other(*sizes), position, quaternion(rng)))
            of_sizes = found.shape_gradient[0, : len(numbers)] @ numbers + found.shape_gradient[1, : len(sizes)] @ sizes
            assert of_sizes - found.gradient[0, :3] @ position == pytest.approx(3 * found.volume, rel=1e-9)


def test_a_capsule_of_length_0_has_no_derivative_by_the_length():
    assert np.isnan(overlap(Capsule(0.5, 0), Box((0.3, 0.3, 0.3))).shape_gradient[0, 1])
    found = overlap(Capsule(0.5, 0), Placed(Ellipsoid((0.3, 0.4, 0.5)), (0.5, 0, 0)))
    assert np.isnan(found.shape_gradient[0, 1]) and np.isnan(found.errors.shape_gradient[0, 1])
    assert np.isfinite(found.shape_gradient[1]).all()


HALF_AXES = np.array([0.7, 0.4, 0.5])
BESIDE_ELLIPSOIDS = {
    **ROUND,
    "ellipsoid": (lambda *half: Ellipsoid(half), (0.5, 0.3, 0.4)),
    "ball": (lambda *half: Ellipsoid(half), (0.5, 0.5, 0.5)),
    "half-space": (lambda offset: HalfSpace((0.6, 0, 0.8), offset), (0.3,)),
    "hull": (lambda: Hull(random_polytope(20, rng=1).vertices * 0.6), ()),
}


@pytest.mark.parametrize("kind", BESIDE_ELLIPSOIDS)
@pytest.mark.parametrize("half_axes", [HALF_AXES, np.full(3, 0.5)], ids=["ellipsoid", "ball"])
def test_numbers_of_pairs_with_an_ellipsoid_against_differences_of_volumes(kind, half_axes):
    make, numbers = BESIDE_ELLIPSOIDS[kind]
    rng = np.random.default_rng(11)
    step, compared = 1e-5, 0
    for _ in range(4):
        pose = rng.normal(size=3) * 0.3, quaternion(rng)

        def volume(half, sizes, pose=pose):
            return overlap(Ellipsoid(half), Placed(make(*sizes), *pose), tolerance=1e-9).volume

        pair = overlap(Ellipsoid(half_axes), Placed(make(*numbers), *pose))
        if pair.status != "overlapping":
            continue
        found, stated = pair.shape_gradient, pair.errors.shape_gradient
        for k in range(3):
            by = step * np.eye(3)[k]
            slope = (volume(half_axes + by, numbers) - volume(half_axes - by, numbers)) / (2 * step)
            assert found[0, k] == pytest.approx(slope, abs=5e-9)
        for k in range(len(numbers)):
            by = step * np.eye(len(numbers))[k]
            slope = (volume(half_axes, numbers + by) - volume(half_axes, numbers - by)) / (2 * step)
            assert found[1, k] == pytest.approx(slope, abs=5e-9)
        if kind != "hull":
            assert not found[1, len(numbers) :].any() and not stated[1, len(numbers) :].any()
            assert (stated[1, : len(numbers)] > 0).all()
        assert (stated[0] > 0).all() and np.nanmax(stated) <= 1e-8 * pair.area
        compared += 1
    assert compared >= 2


@pytest.mark.parametrize("depth", [1.0, 0.1, 1e-3, 1e-6, 1e-9])
def test_half_axes_against_the_closed_form_of_a_cap(depth):
    # Stretched to the unit ball, the ellipsoid has a cap. If the plane is at d, V = abc π (2/3 + d − d³/3).
    rng = np.random.default_rng(2)
    for _ in range(5):
        h, n = rng.uniform(0.1, 1, 3), rng.normal(size=3)
        n /= np.linalg.norm(n)
        reach = np.linalg.norm(h * n)
        offset = reach * (depth - 1)
        found = overlap(Ellipsoid(h), HalfSpace(n, offset))
        d = offset / np.linalg.norm(h * n)
        cap = np.pi * (1 + d) ** 2 * (2 - d) / 3
        area = np.pi * (1 - d) * (1 + d)
        expected = h.prod() * (cap / h - area * d * h * n**2 / reach**2)
        off = np.abs(found.shape_gradient[0] - expected)
        rounding = 4e-16 * h.prod() * 2 * np.pi / h.min()  # of d, and so of the area, for doubles as given
        assert (off <= found.errors.shape_gradient[0] + rounding).all()
        assert off.max() <= 1e-10 * found.area + rounding
        assert found.shape_gradient[1, 0] == pytest.approx(h.prod() * area / reach, rel=1e-6, abs=rounding)


@pytest.mark.parametrize("distance", [0.05, 0.2, 0.7, 0.9999])
def test_an_ellipsoid_that_is_a_ball_has_the_derivative_of_the_ball(distance):
    rng = np.random.default_rng(3)
    for other in (Sphere(0.5), Box((0.4, 0.5, 0.6)), Capsule(0.4, 0.3), Cylinder(0.4, 0.6)):
        for axes in ((0.5, 0.5, 0.5), (0.5, 0.5, 0.5 + 1e-13)):
            body = Placed(other, distance * np.array([0.6, 0.0, 0.8]), quaternion(rng))
            ball, found = overlap(Sphere(0.5), body), overlap(Ellipsoid(axes), body)
            assert found.shape_gradient[0].sum() == pytest.approx(ball.shape_gradient[0, 0], rel=1e-7, abs=1e-11)


def test_two_balls_against_the_integral_over_a_cap():
    # Over a cap beyond the cosine c about e, the mean of n nᵀ along e is (1 + c + c²) / 3.
    r, s, d = 0.5, 0.6, 0.8
    c = (d * d + r * r - s * s) / (2 * d * r)
    area = 2 * np.pi * r * r * (1 - c)
    ahead = area * (1 + c + c * c) / 3
    found = overlap(Ellipsoid((r, r, r)), Placed(Sphere(s), (0, d, 0))).shape_gradient
    assert_allclose(found[0], [(area - ahead) / 2, ahead, (area - ahead) / 2], rtol=1e-12)


@pytest.mark.parametrize("kind", ["capsule", "cylinder", "box", "ellipsoid"])
def test_euler_holds_for_pairs_with_an_ellipsoid_at_any_depth(kind):
    rng = np.random.default_rng(4)
    make, numbers = BESIDE_ELLIPSOIDS[kind]
    for depth in (0.3, 1e-2, 1e-5, 1e-8):
        ahead, turn = rng.normal(size=3), quaternion(rng)
        ahead /= np.linalg.norm(ahead)
        low, high = 0.0, 5.0
        for _ in range(50):
            middle = (low + high) / 2
            one = overlap(Ellipsoid(HALF_AXES), Placed(make(*numbers), middle * ahead, turn))
            low, high = (middle, high) if one and one.depth > depth else (low, middle)
        found = overlap(Ellipsoid(HALF_AXES), Placed(make(*numbers), low * ahead, turn))
        stated = found.errors.shape_gradient
        sizes = found.shape_gradient[0] @ HALF_AXES + found.shape_gradient[1, : len(numbers)] @ numbers
        off = abs(sizes + found.gradient[0, :3] @ (-low * ahead) - 3 * found.volume)
        bound = stated[0] @ HALF_AXES + stated[1, : len(numbers)] @ numbers + 3 * found.volume_error
        assert off <= bound + low * found.errors.gradient[0, 0]
        assert off <= 1e-7 * found.area


def test_an_ellipsoid_around_the_others_of_a_group_bounds_nothing():
    assert not overlap(Ellipsoid((1, 1, 2)), Sphere(0.9), Box((0.8, 1, 1))).shape_gradient[0].any()


@pytest.mark.parametrize("case", [case for case in PAIRS if case.truth.dimension == 3], ids=repr)
def test_stated_errors_of_boxes_hold(case):
    found = overlap(*case.placed)
    for body in (0, 1):
        off = np.abs(found.shape_gradient[body] - np.array(areas_of_sides(case, body), float))
        assert (off <= found.errors.shape_gradient[body]).all()


@pytest.mark.parametrize("kind", ROUND)
def test_stated_errors_of_round_pairs_hold(kind):
    # Euler: the volume has the degree 3 in all lengths.
    rng = np.random.default_rng(8)
    make, numbers = ROUND[kind]
    for other, sizes in ((Sphere, (0.8,)), (Cylinder, (0.5, 0.9)), (lambda *half: Box(half), (0.5, 0.6, 0.7))):
        found = overlap(make(*numbers), Placed(other(*sizes), rng.uniform(-0.4, 0.4, 3), quaternion(rng)))
        stated = found.errors.shape_gradient
        assert (stated[0, len(numbers) :] == 0).all() and (stated[0, : len(numbers)] > 0).all()
        assert stated.max() <= 1e-8 * found.area
        if kind != "rounded hull":
            position = found.shapes[1].position
            of_sizes = found.shape_gradient[0, : len(numbers)] @ numbers
            of_sizes += found.shape_gradient[1, : len(sizes)] @ sizes
            off = abs(of_sizes - found.gradient[0, :3] @ position - 3 * found.volume)
            bound = stated[0, : len(numbers)] @ numbers + stated[1, : len(sizes)] @ sizes
            assert off <= bound + 3 * found.volume_error + 3 * found.errors.gradient[0, 0] * np.linalg.norm(position)


def test_groups_with_round_bodies_have_those_of_a_polytope():
    rng = np.random.default_rng(9)
    kinds = {**ROUND, "half-space": (lambda offset: HalfSpace((0, 0, 1), offset), (0.2,))}
    others = [Placed(Box((0.7, 0.6, 0.5)), (0.1, 0, 0.1), quaternion(rng)), Placed(Sphere(0.7), (0.2, 0.1, 0))]
    for made, numbers in kinds.values():
        body = Placed(made(*numbers), (0.05, -0.1, 0), (0, 0, 0, 1))
        found, step = overlap(body, *others, tolerance=1e-4), 1e-3
        stated = found.errors.shape_gradient
        assert np.isfinite(found.shape_gradient).all() and np.isfinite(stated).all()
        for k in range(len(numbers)):
            volumes = []
            for side in (-1, 1):
                moved = Placed(made(*(n + side * step * (i == k) for i, n in enumerate(numbers))), (0.05, -0.1, 0))
                volumes.append(overlap(moved, *others, tolerance=1e-6).volume)
            slope = (volumes[1] - volumes[0]) / (2 * step)
            assert found.shape_gradient[0, k] == pytest.approx(slope, rel=5e-3, abs=1e-4)
            assert abs(found.shape_gradient[0, k] - slope) <= stated[0, k] + 1e-4
        assert not found.shape_gradient[0, len(numbers) :].any() and not stated[0, len(numbers) :].any()


def test_rows_of_a_batch_have_those_of_their_overlaps():
    rng = np.random.default_rng(4)
    shapes = [Box((1, 0.5, 0.7)), HalfSpace((0, 0, 1), 0.1), Sphere(0.6), Box((0.6, 0.6, 0.6))]
    positions = np.r_[rng.uniform(-0.3, 0.3, (3, 3)), [[9, 0, 0]]]
    turns = np.array([quaternion(rng) for _ in shapes])
    found = overlaps(shapes, positions, turns, pairs=[(0, 1), (0, 2), (1, 2), (0, 3)])
    assert found.shape_gradient.shape == (4, 2, 3)
    for row in range(4):
        assert np.array_equal(found.shape_gradient[row], found[row].shape_gradient)
    assert found.shape_gradient[:3].any(axis=2).all() and not found.shape_gradient[3].any()
    assert np.array_equal(found[[2, 0]].shape_gradient, found.shape_gradient[[2, 0]])


def test_three_boxes():
    boxes = [Box((1, 1, 1)), Placed(Box((1, 1, 1)), (0.5, 0.25, 0)), Placed(Box((2, 2, 0.5)), orientation=(1, 1, 1, 7))]
    found, step = overlap(*boxes), 1e-6
    for k, half in enumerate(([1, 1, 1], [1, 1, 1], [2, 2, 0.5])):
        for axis in range(3):
            volumes = []
            for side in (-1, 1):
                sizes = np.array(half, float)
                sizes[axis] += side * step
                body = boxes[k] if isinstance(boxes[k], Placed) else Placed(boxes[k])
                moved = Placed(Box(sizes), body.position, body.orientation)
                volumes.append(overlap(*boxes[:k], moved, *boxes[k + 1 :]).volume)
            slope = (volumes[1] - volumes[0]) / (2 * step)
            one_sided = k < 2 and axis == 2  # two boxes share the planes z = -1 and 1
            assert one_sided or found.shape_gradient[k, axis] == pytest.approx(slope, abs=1e-7)


@pytest.mark.parametrize("aligned", [True, False])
def test_gradients_of_arrays_are_sums_of_those_of_overlaps(aligned):
    rng = np.random.default_rng(6)
    a, b = (
        arrays.boxes(rng.uniform(0.5, 2, (9, 3)), rng.uniform(-1, 1, (9, 3)), rng.normal(size=(9, 4))) for _ in range(2)
    )
    weights = rng.normal(size=9 if aligned else (9, 9))
    found = arrays.volume_gradient(a, b, weights, aligned=aligned)
    assert all(
        np.array_equal(one, two)
        for row, other in zip(found, arrays.volume_gradient(a, b, weights, aligned=aligned, threads=3))
        for one, two in zip(row, other)
    )
    sums = np.zeros((2, 9, 9))
    for i in range(9):
        for j in [i] if aligned else range(9):
            each = overlap(a[i], b[j])
            row = np.c_[each.shape_gradient / 2, each.gradient] * (weights[i] if aligned else weights[i, j])
            sums[0, i] += row[0]
            sums[1, j] += row[1]
    for body in (0, 1):
        assert_allclose(np.hstack(found[body]), sums[body], rtol=1e-12, atol=1e-12)


def test_gradients_of_rectangles_against_differences():
    rng = np.random.default_rng(7)
    rows = np.c_[rng.uniform(-0.5, 0.5, (2, 20, 2)), rng.uniform(0.5, 2, (2, 20, 2)), rng.uniform(-3, 3, (2, 20, 1))]
    of_a, of_b = arrays.volume_gradient(*rows, aligned=True)
    for body, found in enumerate((of_a, of_b)):
        assert found.sizes.shape == found.positions.shape == (20, 2) and found.rotations.shape == (20, 1)
        for k, column in enumerate(np.hstack([found.positions, found.sizes, found.rotations]).T):
            step = np.zeros_like(rows)
            step[body, :, k] = 1e-6
            slope = (arrays.volume(*(rows + step), aligned=True) - arrays.volume(*(rows - step), aligned=True)) / 2e-6
            assert_allclose(column, slope, atol=1e-7)


def test_gradients_of_arrays_of_round_shapes():
    balls, tubes = arrays.spheres([1, 2], [[0.5, 0, 0], [9, 0, 0]]), arrays.cylinders([0.5], [1])
    of_balls, of_tubes = arrays.volume_gradient(balls, tubes)
    alone = overlap(balls[0], tubes[0])
    assert of_balls.sizes.tolist() == [[alone.shape_gradient[0, 0]], [0]]
    assert of_tubes.sizes.tolist() == [alone.shape_gradient[1, :2].tolist()]
    assert of_balls.positions.tolist() == [alone.gradient[0, :3].tolist(), [0, 0, 0]]


def test_weights_that_do_not_fit_are_refused():
    box = arrays.boxes([[1, 1, 1]])
    with pytest.raises(
        ValueError, match=r"^weights must be an array of numbers, one for each pair, not of shape \(2,\)"
    ):
        arrays.volume_gradient(box, box, [1, 2])


def test_half_axes_in_groups_against_differences_of_volumes():
    # The group is measured by enclosing polytopes.
    step, tolerance = 1e-3, 1e-5
    rest = Placed(Box((0.5, 0.4, 0.6)), (0.3, 0.1, -0.2), (0.3, -0.2, 0.5, 0.7)), Placed(Sphere(0.6), (0.1, -0.2, 0.1))
    found = overlap(Ellipsoid(HALF_AXES), *rest, tolerance=tolerance)
    by = np.array([0.5, -0.7, 1.0])  # all axes at once, since such a group takes seconds
    volumes = [overlap(Ellipsoid(HALF_AXES + s * step * by), *rest, tolerance=tolerance).volume for s in (-1, 1)]
    slope, stated = (volumes[1] - volumes[0]) / (2 * step), found.errors.shape_gradient[0] @ abs(by)
    assert found.shape_gradient[0] @ by == pytest.approx(slope, abs=1e-4)
    assert abs(found.shape_gradient[0] @ by - slope) <= stated + 1e-4
    assert found.errors.shape_gradient[0].min() > 0 and found.errors.shape_gradient[0].max() < found.area
