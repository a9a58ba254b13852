"""The patch within the line where the surfaces of two bodies cross: its area vector, centre, second moments and mean
distance from the centroid."""

import operator

import exact
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import quad
from strategies import directions, overlapping_points, quaternion, rotation

from overlapper import Batch, Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, Placed, RoundedHull, Sphere, overlap

FLOOR = HalfSpace([0, 0, 1], 0)
CUBE = Box([0.5, 0.5, 0.5])
TETRA = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)
SHAPES = {
    "sphere": Sphere(0.5),
    "capsule": Capsule(0.3, 0.8),
    "cylinder": Cylinder(0.4, 0.9),
    "box": CUBE,
    "ellipsoid": Ellipsoid([0.3, 0.45, 0.6]),
    "hull": Hull(TETRA * 0.6),
    "rounded hull": RoundedHull(TETRA * 0.3, 0.2),
}
# An ellipsoid and a long round body are enclosed by a polytope, whose patch is another.
PAIRS = [
    (first, second)
    for first in SHAPES
    for second in SHAPES
    if "ellipsoid" not in (first, second) or not {"capsule", "cylinder", "rounded hull"} & {first, second}
]
STEP = 1e-4
TO_X = (0, np.sqrt(0.5), 0, np.sqrt(0.5))


def disc(radius, normal):
    across = np.eye(3) - np.outer(normal, normal)
    return np.pi * radius**2 * np.array(normal, float), np.pi * radius**4 / 4 * across


@pytest.mark.parametrize(
    ("a", "b", "patch"),
    [
        (Placed(CUBE, (1, 2, 0.4)), FLOOR, ([0, 0, 1], np.diag([1 / 12, 1 / 12, 0]))),
        (Placed(CUBE, (0.6, 0, 0)), Box([0.5, 2, 1]), ([1, 0, 0], np.diag([0, 1 / 12, 1 / 12]))),
        (Placed(Sphere(0.5), (1, 2, 0.4)), FLOOR, disc(0.3, (0, 0, 1))),
        (Placed(Sphere(0.5), (0.6, 0, 0)), Sphere(0.5), disc(0.4, (1, 0, 0))),
        (Placed(Capsule(0.5, 1), (0, 0, 0.9)), FLOOR, disc(0.3, (0, 0, 1))),
        (Placed(Cylinder(0.5, 2), (1, 2, 0.9)), FLOOR, disc(0.5, (0, 0, 1))),
        (Placed(Cylinder(0.5, 2), (0, 0, 0.4), TO_X), FLOOR, ([0, 0, 1.2], np.diag([0.4, 0.036, 0]))),
    ],
)
def test_patches_of_simple_bodies(a, b, patch):
    answer, (area, moments) = overlap(a, b), patch
    assert_allclose(answer.patch_area, area, atol=1e-12)
    assert_allclose(answer.patch_moments, moments, atol=1e-12)
    assert_allclose(answer.patch_centre, answer.centroid, atol=1e-12)


def test_the_patch_of_a_pierced_plate_is_the_difference_of_two_discs():
    answer = overlap(Placed(Sphere(0.5), (1, 2, 0.4)), Box([9, 9, 1e-3]))
    assert len(answer.patch) == 2
    assert answer.patch_area == pytest.approx([0, 0, np.pi * (0.401**2 - 0.399**2)], abs=1e-12)


def test_the_patch_is_that_of_the_exact_polytope():
    for seed in range(20):
        p, q = overlapping_points(np.random.default_rng(seed), low=4, high=10)
        answer, truth = overlap(p, q), exact.common(exact.hull(p), exact.hull(q))
        if answer.patch_centre is None:
            assert len({facet.owners for facet in truth.facets}) == 1
            continue
        area, centre, moments, distance = truth_of_patch(truth)
        assert_allclose(answer.patch_area, area, atol=1e-12)
        assert_allclose(answer.patch_centre, centre, atol=1e-12)
        assert_allclose(answer.patch_moments, moments, atol=1e-12)
        assert answer.patch_distance == pytest.approx(max(distance, 0), rel=1e-3)


def truth_of_patch(truth):
    """By triangles of the second body's facets, seen along their area vector, about the centroid; the mean distance by
    points in the middle of 10,000 parts of each."""
    about = np.array(truth.centroid, float)
    triangles, areas = [], []
    for facet in truth.facets:
        if facet.owners != (1,):
            continue
        corners = np.array([exact.coordinates(corner) for corner in facet.ring], float) - about
        for i in range(1, len(corners) - 1):
            triangle = corners[[0, i, i + 1]]
            area = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0]) / 2
            triangles.append(triangle), areas.append(area)
    triangles, areas = np.array(triangles), np.array(areas)
    area = areas.sum(axis=0)
    normal = area / np.linalg.norm(area)
    seen = triangles @ (np.eye(3) - np.outer(normal, normal))
    weights, sums = areas @ normal, seen.sum(axis=1)
    centre = (weights / 3) @ sums / weights.sum()
    second = np.einsum("t,tki,tkj->ij", weights / 12, seen, seen) + np.einsum("t,ti,tj->ij", weights / 12, sums, sums)
    far = np.linalg.norm(parts_of_triangle(100) @ seen, axis=2).mean(axis=1) @ weights / weights.sum()
    return area, about + centre, second - weights.sum() * np.outer(centre, centre), far


def parts_of_triangle(count):
    """The middles of count² triangles that are alike, as weights of the corners."""
    i, j = np.divmod(np.arange(count**2), count)
    turned = i + j >= count
    i, j = np.where(turned, count - 1 - i, i) + (1 + turned) / 3, np.where(turned, count - 1 - j, j) + (1 + turned) / 3
    return np.stack([i, j, count - i - j], axis=1) / count


SQUARE = (np.sqrt(2) + np.arcsinh(1)) / 6  # of side 1: the mean distance from the middle


@pytest.mark.parametrize(
    ("a", "b", "distance"),
    [
        (Placed(CUBE, (1, 2, 0.4)), FLOOR, SQUARE),
        (Placed(CUBE, (1, 2, 0.5 - 1e-9)), FLOOR, SQUARE),
        (Placed(CUBE, (0.6, 0, 0)), Box([0.5, 2, 1]), SQUARE),
        (Placed(Sphere(0.5), (1, 2, 0.4)), FLOOR, 0.2),
        (Placed(Sphere(0.5), (0.6, 0, 0)), Sphere(0.5), 0.8 / 3),
        (Placed(Cylinder(0.5, 2), (1, 2, 0.9)), FLOOR, 1 / 3),
        (Placed(Ellipsoid([0.5, 0.5, 0.2]), (1, 2, 0.16)), FLOOR, 0.2),
    ],
)
def test_mean_distances_of_squares_and_discs_have_all_digits(a, b, distance):
    assert overlap(a, b).patch_distance == pytest.approx(distance, rel=1e-7 if a.position[2] > 0.49 else 1e-13)


def beyond_box(half_extents):
    return lambda x: np.linalg.norm(np.maximum(np.abs(x) - half_extents, 0), axis=1)


def beyond_axis(length):
    return lambda x: np.linalg.norm(x - [0, 0, 1] * np.clip(x[:, 2:], -length / 2, length / 2), axis=1)


ON_FLOOR = {  # what a point must be to be inside, and how far from the truth the mean distance may be
    "ball": (Sphere(0.5), lambda x: np.linalg.norm(x, axis=1) <= 0.5, 4e-3),
    "ellipsoid": (Ellipsoid([0.3, 0.2, 0.6]), lambda x: np.linalg.norm(x / [0.3, 0.2, 0.6], axis=1) <= 1, 4e-3),
    "box": (Box([0.5, 0.2, 0.3]), lambda x: beyond_box([0.5, 0.2, 0.3])(x) == 0, 4e-3),
    "long box": (Box([0.8, 0.05, 0.3]), lambda x: beyond_box([0.8, 0.05, 0.3])(x) == 0, 3e-3),
    "capsule": (Capsule(0.3, 0.8), lambda x: beyond_axis(0.8)(x) <= 0.3, 0.02),
    "cylinder": (
        Cylinder(0.3, 0.9), lambda x: (np.hypot(x[:, 0], x[:, 1]) <= 0.3) & (np.abs(x[:, 2]) <= 0.45), 0.025
    ),
    "box with margin": (
        RoundedHull(np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * [0.5, 0.2, 0.3], 0.02),
        lambda x: beyond_box([0.5, 0.2, 0.3])(x) <= 0.02, 0.04,
    ),
}  # fmt: skip


@pytest.mark.parametrize("body", ON_FLOOR)
def test_mean_distances_are_those_of_points_of_the_floor_inside_the_body(body):
    """Tilted, so that the centroid is not over the centre; flat, and on a side, too."""
    shape, inside, off = ON_FLOOR[body]
    rng = np.random.default_rng(len(body))
    for turned in ((0, 0, 0, 1), TO_X, *(quaternion(rng) for _ in range(4))):
        reach = overlap(Placed(shape, (0, 0, 0), turned), FLOOR).depth
        for sunk in (0.1, 0.6):
            height = reach * (1 - sunk)
            answer = overlap(Placed(shape, (1, 2, height), turned), FLOOR)
            centroid = answer.centroid[:2] - [1, 2]
            grid = np.stack(np.meshgrid(*2 * [(np.arange(800) + 0.5) / 400 - 1], [-height]), axis=-1).reshape(-1, 3)
            points = grid[inside(grid @ rotation(turned))][:, :2]
            truth = np.linalg.norm(points - centroid, axis=1).mean()
            assert answer.patch_distance == pytest.approx(truth, rel=off)
            spread = np.cov(points.T, bias=True) * np.linalg.norm(answer.patch_area)
            assert_allclose(answer.patch_moments[:2, :2], spread, atol=5e-3 * np.trace(spread))
            assert_allclose(answer.patch_centre[:2] - [1, 2], points.mean(axis=0), atol=2e-3)
            swapped = overlap(FLOOR, Placed(shape, (1, 2, height), turned))
            assert_allclose(swapped.patch_moments, answer.patch_moments, atol=1e-14)
            assert swapped.patch_distance == pytest.approx(answer.patch_distance, abs=1e-14)


@pytest.mark.parametrize("seed", range(12))
def test_the_mean_distance_in_the_patch_of_a_tilted_ellipsoid_is_that_in_an_ellipse(seed):
    """The patch is an ellipse, and the centroid is not over its centre. In polar coordinates about the centroid, the
    integral of the distance is a third of that of the cube of the border's distance."""
    rng = np.random.default_rng(seed)
    shape, turned = Ellipsoid(rng.uniform(0.2, 0.8, 3)), quaternion(rng)
    height = overlap(Placed(shape, (0, 0, 0), turned), FLOOR).depth * rng.uniform(-0.6, 0.8)
    answer = overlap(Placed(shape, (1, 2, height), turned), FLOOR)
    area, centre = answer.patch_area[2], (answer.patch_centre - answer.centroid)[:2]
    inverse = np.linalg.inv(4 * answer.patch_moments[:2, :2] / area)
    assert np.linalg.norm(centre) > 0.01 * np.sqrt(area)

    def cube_of_border(angle):
        to = np.array([np.cos(angle), np.sin(angle)])
        a, b, c = to @ inverse @ to, to @ inverse @ centre, centre @ inverse @ centre - 1
        return ((b + np.sqrt(b * b - a * c)) / a) ** 3

    truth = quad(cube_of_border, 0, 2 * np.pi, epsrel=1e-10, limit=200)[0] / 3 / area
    assert answer.patch_distance == pytest.approx(truth, rel=1e-5)


@pytest.mark.parametrize("depth", [1e-2, 1e-5, 1e-8])
def test_the_patch_of_a_tilted_capsule_on_the_floor_is_a_disc_however_shallow(depth):
    tilt = (0, np.sin(0.3), 0, np.cos(0.3))
    answer = overlap(Placed(Capsule(0.3, 0.8), (0, 0, 0.3 - depth + 0.4 * np.cos(0.6)), tilt), FLOOR)
    area, moments = disc(np.sqrt(depth * (0.6 - depth)), (0, 0, 1))
    assert answer.way == "closed form"
    assert_allclose(answer.patch_moments, moments, atol=1e-7 * np.trace(moments))
    assert answer.patch_distance == pytest.approx(2 / 3 * np.sqrt(area[2] / np.pi), rel=1e-7)
    assert_allclose(answer.patch_centre[:2], [-0.4 * np.sin(0.6), 0], atol=1e-12)


def test_round_bodies_under_the_floor_have_no_patch():
    for shape in (Sphere(0.5), Capsule(0.3, 0.8), Cylinder(0.4, 0.9)):
        for turned in ((0, 0, 0, 1), TO_X, (0.1, 0.2, 0.3, 1)):
            answer = overlap(Placed(shape, (0, 0, -2), turned), FLOOR)
            assert answer.volume == pytest.approx(shape.volume)
            assert not answer.patch_area.any()
            assert answer.patch_distance is None


def second_moments(answer, about):
    """∫ x xᵀ dV about a point."""
    inertia, arm = answer.inertia, answer.centroid - about
    return np.trace(inertia) / 2 * np.eye(3) - inertia + answer.volume * np.outer(arm, arm)


def pushed(shape, position, turned, other):
    """The overlap, that of the shape pushed a step in against the patch's normal, and that of it pulled out."""
    answer = overlap(Placed(shape, position, turned), other)
    step = STEP * answer.patch_area / np.linalg.norm(answer.patch_area)
    return answer, *(overlap(Placed(shape, position + by, turned), other) for by in (-step, step))


@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_moments_of_the_patch_are_slopes_of_those_of_the_volume(first, second):
    """As a moves against the normal by a length, its surface inside b sweeps the patch, seen along the normal."""
    rng = np.random.default_rng([ord(first[-1]), ord(second[-1]), len(first), len(second)])
    for _ in range(3):
        b = Placed(SHAPES[second], (0, 0, 0), quaternion(rng))
        away, turned = directions(rng, 1)[0], quaternion(rng)
        reach = overlap(Placed(SHAPES[first], 1e-9 * away, turned), b)
        answer, nearer, farther = pushed(SHAPES[first], away * 0.7 * reach.depth, turned, b)
        size = np.linalg.norm(answer.patch_area)
        normal = answer.patch_area / size
        about = answer.patch_centre
        slope = (second_moments(nearer, about) - second_moments(farther, about)) / (2 * STEP)
        across = np.eye(3) - np.outer(normal, normal)
        assert_allclose(across @ slope @ across, answer.patch_moments, atol=3e-6 * size**2)
        slope = (nearer.volume * nearer.centroid - farther.volume * farther.centroid) / (2 * STEP)
        assert_allclose(across @ slope / size, across @ answer.patch_centre, atol=3e-6)
        assert_array_equal(answer.patch_area, answer.gradient[1, :3])


@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_the_patch_turns_with_the_bodies_and_knows_no_order(first, second):
    rng = np.random.default_rng(len(first) + len(second))
    a, b = Placed(SHAPES[first], (0.4, 0.3, 0.2), quaternion(rng)), Placed(SHAPES[second], (0, 0, 0), quaternion(rng))
    answer, swapped = overlap(a, b), overlap(b, a)
    assert answer
    assert_allclose(swapped.patch_area, -answer.patch_area, atol=1e-12)
    assert_allclose(swapped.patch_centre, answer.patch_centre, atol=1e-12)
    assert_allclose(swapped.patch_moments, answer.patch_moments, atol=1e-12)
    assert swapped.patch_distance == pytest.approx(answer.patch_distance, abs=1e-12)
    far = Placed(a.shape, np.add(a.position, 64), a.orientation), Placed(b.shape, (64, 64, 64), b.orientation)
    assert_allclose(overlap(*far).patch_moments, answer.patch_moments, atol=1e-11)
    assert_allclose(overlap(*far).patch_centre - 64, answer.patch_centre, atol=1e-11)
    assert overlap(*far).patch_distance == pytest.approx(answer.patch_distance, abs=1e-11)


def test_a_round_body_inside_another_has_no_patch_but_rounding():
    corners = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    tetrahedron = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
    inner = [RoundedHull(np.array(c) * 0.2, 0.1) for c in (corners, tetrahedron)] + [Capsule(0.1, 0.3), Sphere(0.2)]
    outer = [RoundedHull(np.array(corners) * 0.8, 0.3), Capsule(1, 1), Box([1, 1, 1])]
    for seed in range(5):
        rng = np.random.default_rng(seed)
        for a in inner:
            for b in outer:
                found = overlap(
                    Placed(a, 0.05 * rng.normal(size=3), quaternion(rng)), Placed(b, (0, 0, 0), rng.normal(size=4))
                )
                assert found.volume == pytest.approx(a.volume, rel=1e-12)
                assert_array_equal(found.patch_area, np.zeros(3))
                assert found.patch_centre is found.patch_distance is None


def test_bodies_apart_inside_each_other_or_three_have_no_patch():
    apart, inside = overlap(CUBE, Placed(CUBE, (3, 0, 0))), overlap(Placed(Sphere(0.1), (0.1, 0, 0)), CUBE)
    for answer in (apart, inside):
        assert_array_equal(answer.patch_area, np.zeros(3))
        assert answer.patch_centre is answer.patch_distance is None
        assert_array_equal(answer.patch_moments, np.zeros((3, 3)))
    three = overlap(CUBE, CUBE, Sphere(0.2))
    assert three.patch_area is three.patch_centre is three.patch_moments is three.patch_distance is None


def test_patches_of_a_batch_are_those_of_its_pairs():
    rng = np.random.default_rng(1)
    shapes = [*SHAPES.values(), FLOOR, Hull(rng.normal(size=(200, 3)) * 0.3)]
    positions = rng.uniform(-0.3, 0.3, (len(shapes), 3))
    found = Batch(shapes).overlaps(positions, np.array([quaternion(rng) for _ in shapes]), separated=True)
    assert found.patch_area.shape == found.patch_centre.shape == (len(found), 3)
    columns = found.patch_area, found.patch_centre, found.patch_moments, found.patch_distance
    for row, area, centre, moments, distance in zip(found, *columns):
        assert_array_equal(area, row.patch_area)
        assert_array_equal(centre, np.full(3, np.nan) if row.patch_centre is None else row.patch_centre)
        assert_array_equal(moments, row.patch_moments)
        assert_array_equal(distance, np.nan if row.patch_distance is None else row.patch_distance)
    few = found[found.volume > np.median(found.volume)]
    assert_array_equal(few.patch_moments, found.patch_moments[found.volume > np.median(found.volume)])
    nothing = found[:0]
    assert (nothing.patch_area.shape, nothing.patch_moments.shape) == ((0, 3), (0, 3, 3))
    assert nothing.patch_distance.shape == (0,)


def test_patches_of_a_batch_have_the_bits_of_single_answers_by_every_way():
    """Rows that their batch remembers, rows of a batch that is gone, and selected rows."""
    rng = np.random.default_rng(3)
    shapes, pairs = [FLOOR], []
    bodies = [(make, depth) for make in SHAPES for depth in (0.3, 1e-2, 1e-5)]
    positions, orientations = [np.zeros(3)], [np.array([0, 0, 0, 1.0])]
    for make, depth in bodies:
        for other in (FLOOR, CUBE):
            turned, at = quaternion(rng), (0, 0, 0.4)
            reach = overlap(Placed(SHAPES[make], at, turned), Placed(other))
            position = at + max(0, reach.depth - depth) * reach.normal
            for shape, where, how in ((SHAPES[make], position, turned), (other, np.zeros(3), (0, 0, 0, 1))):
                shapes.append(shape), positions.append(where), orientations.append(how)
            pairs.append((len(shapes) - 2, len(shapes) - 1))
    shapes += [Cylinder(0.5, 1.0), Cylinder(0.4, 1.2)]
    positions += [np.zeros(3), np.array([0.3, 0.2, 0.1])]
    orientations += [quaternion(rng), quaternion(rng)]
    pairs.append((len(shapes) - 2, len(shapes) - 1))
    batch = Batch(shapes)
    found = batch.overlaps(positions, orientations, pairs)
    assert {"clipping", "wide clipping", "closed form", "slicing"} <= {found.WAYS[way] for way in found.way}
    remembered = [column(found) for column in COLUMNS]
    again = batch.overlaps(positions, orientations, pairs)
    del batch
    for kept, column in zip(remembered, COLUMNS):
        assert_array_equal(kept, column(Batch(shapes).overlaps(positions, orientations, pairs)))
        assert_array_equal(kept[::7], column(again[::7]))
    for k, (i, j) in enumerate(pairs):
        single = overlap(*(Placed(shapes[n], positions[n], orientations[n]) for n in (i, j)))
        for kept, column in zip(remembered, COLUMNS):
            assert_array_equal(kept[k], column(single))


COLUMNS = [operator.attrgetter(name) for name in ("patch_area", "patch_centre", "patch_moments", "patch_distance")]


def test_the_patch_of_the_articles_method_is_that_of_its_polytope():
    a, b = Placed(CUBE, (0.1, 0.2, 0.8), rotation_of(3)), Placed(CUBE, (0, 0, 0), rotation_of(4))
    paper, auto = overlap(a, b, method="paper"), overlap(a, b)
    assert_allclose(paper.patch_moments, auto.patch_moments, atol=1e-9)
    assert paper.patch_distance == pytest.approx(auto.patch_distance, abs=1e-9)


def rotation_of(seed):
    return quaternion(np.random.default_rng(seed))
