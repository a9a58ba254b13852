"""Stated errors of the derivatives of the centroid hold: integers, closed forms, differences, and other places."""

from fractions import Fraction
from itertools import pairwise

import exact
import numpy as np
import pytest
from families import PosedBox, make
from numpy.testing import assert_allclose
from pairs_of_kinds import KINDS, PAIRS
from scipy.spatial.transform import Rotation
from strategies import quaternion

from overlapper import Box, Capsule, Cylinder, HalfSpace, Hull, Placed, Sphere, overlap, overlaps, random_polytope

FLAT = {"box", "half-space", "hull"}
FINE = 400  # bits behind the point: lengths are integers times 2^-400


def whole(vector):
    return [round(x * 2**FINE) for x in vector]


def exact_gradient(case, body):
    """V dC = ∫ x s dA over the facets of a body, by fans of triangles: (3, 6) by poses, and (3, 3) by half extents."""
    truth, given = case.truth, case.bodies[body]
    position = exact.vector(getattr(given, "position", (0, 0, 0)))
    lever = whole(exact.subtract(truth.centroid, position))
    pose, size = np.zeros((3, 6), object), np.zeros((3, 3))
    axes = Rotation.from_quat(given.orientation).as_matrix().T if isinstance(given, PosedBox) else np.eye(3)
    for facet in truth.facets:
        if body not in facet.owners:
            continue
        corners = [whole(exact.subtract(exact.coordinates(p), truth.centroid)) for p in facet.ring]
        first = np.zeros((3, 3), object)
        for q, r in pairwise(corners[1:]):
            p = corners[0]
            twice = exact.cross(exact.subtract(q, p), exact.subtract(r, p))
            total = exact.add(exact.add(p, q), r)
            for j in range(3):
                place = [sum(v[j] * v[k] for v in (p, q, r, total)) + 4 * lever[k] * total[j] for k in range(3)]
                first[j] += [total[j] * a for a in twice]
                pose[j, 3:] += list(exact.cross(place, twice))
        pose[:, :3] += first
        # The area vector of a side is along an axis of the box.
        by_axis = (
            np.array([[float(Fraction(x, 6 << (3 * FINE)) / truth.volume) for x in row] for row in first]) @ axes.T
        )
        axis = np.abs(by_axis).sum(0).argmax()
        size[:, axis] += by_axis[:, axis] * np.sign(float(exact.dot(exact.area_vector(facet), tuple(axes[axis]))))
    scales = [6 << (3 * FINE)] * 3 + [24 << (4 * FINE)] * 3
    rows = [[float(Fraction(x, scale) / truth.volume) for x, scale in zip(row, scales)] for row in pose]
    return np.array(rows), size


@pytest.mark.parametrize(
    ("family", "most"),
    [
        ("general", 1e-10),
        ("posed_boxes", 1e-10),
        ("posed", 1e-10),
        ("slivers", 1e-3),
        ("tilted_slivers", 1e-2),
        ("needles_and_plates", 1e-5),
        ("tiny_in_huge", 1e-10),
        ("far_away", 1e-10),
        ("half_spaces", 1e-10),
    ],
)
def test_errors_of_polyhedra_hold_against_integers(family, most):
    compared = 0
    for seed in range(8):
        case = make(family, seed)
        if case.truth.dimension < 3 or any(len(facet.owners) > 1 for facet in case.truth.facets):
            continue
        found = overlap(*case.placed)
        if not found:
            continue
        stated = found.errors.centroid_gradient
        for body in range(len(case.bodies)):
            pose, size = exact_gradient(case, body)
            off = np.abs(found.centroid_gradient[body] - pose)
            assert (off <= stated[body] + 4e-16 * np.abs(pose)).all(), case
            assert stated[body, :, :3].max() <= most * max(1.0, np.abs(pose[:, :3]).max()), case
            if isinstance(case.bodies[body], PosedBox):
                off = np.abs(found.centroid_shape_gradient[body] - size)
                assert (off <= found.errors.centroid_shape_gradient[body] + 1e-14 * np.abs(size).max()).all(), case
        compared += 1
    assert compared >= 3


@pytest.mark.parametrize("place", [0, 2**20])
@pytest.mark.parametrize("depth", [0.5, 1e-1, 1e-3, 1e-5, 1e-7, 1e-9])
def test_errors_of_a_ball_in_a_half_space_hold_against_the_closed_form(depth, place):
    rng, n, compared = np.random.default_rng(6), np.array([0, 0, 1.0]), 0
    for _ in range(5):
        radius = rng.uniform(0.3, 2)
        centre = np.round(rng.uniform(-1, 1, 3) * 1024) / 1024 + place
        offset = centre[2] - radius + depth
        found = overlap(Placed(Sphere(radius), centre), HalfSpace(n, offset))
        if not found or np.isnan(found.centroid_gradient).any():
            continue
        r = Fraction(radius)
        d = r + Fraction(offset) - Fraction(centre[2])
        # The centroid of a cap is h = 3 (2 r − d)² / (4 (3 r − d)) from the centre of the ball.
        a, b = 2 * r - d, 3 * r - d
        h, slope, by_radius = (
            float(x) * 3 / 4 for x in (a * a / b, (a * a - 2 * a * b) / b**2, (4 * a * b - 3 * a * a) / b**2)
        )
        truth, sizes = np.zeros((2, 3, 6)), np.zeros((2, 3, 3))
        truth[0, :, :3] = np.eye(3) + slope * np.outer(n, n)
        truth[1, :, :3] = -slope * np.outer(n, n)
        truth[1, :, 3:] = slope * np.outer(n, np.cross(n, centre)) - h * np.cross(np.eye(3), n).T
        sizes[0, :, 0], sizes[1, :, 0] = -(by_radius + slope) * n, -slope * n
        errors = found.errors
        far = 4e-16 * np.abs(truth)
        assert (np.abs(found.centroid_gradient - truth) <= errors.centroid_gradient + far).all()
        assert (np.abs(found.centroid_shape_gradient - sizes) <= errors.centroid_shape_gradient).all()
        if place == 0:
            assert errors.centroid_gradient.max() <= 1e-8 + 1e-11 / depth
        compared += 1
    assert compared >= 1 or place


def pair_at_depth(kinds, depth, seed):
    """Positions are multiples of 2^-30, so that they are exact 2^20 m away, too."""
    rng = np.random.default_rng(seed)
    turns = [quaternion(rng) for _ in kinds]
    ahead, low = rng.normal(size=3), 0.0
    ahead /= np.linalg.norm(ahead)
    if "half-space" in kinds:
        ahead, low = Rotation.from_quat(turns[kinds.index("half-space")]).apply([0.6, 0, 0.8]), -5.0
        ahead *= 1 if kinds[0] == "half-space" else -1
    numbers = [np.r_[KINDS[kind][1], np.zeros(6)] for kind in kinds]

    def bodies(places, numbers, far=0.0):
        placed = []
        for kind, place, turn, row in zip(kinds, places, turns, numbers):
            turned = (Rotation.from_rotvec(row[-3:]) * Rotation.from_quat(turn)).as_quat() if row[-3:].any() else turn
            placed.append(Placed(KINDS[kind][0](*row[:-6]), place + row[-6:-3] + far, turned))
        return placed

    def places(distance):
        return np.zeros(3), np.round(distance * ahead * 2.0**30) / 2.0**30

    high = 5.0
    for _ in range(50):
        middle = (low + high) / 2
        found = overlap(*bodies(places(middle), numbers))
        low, high = (middle, high) if found and found.depth > depth else (low, middle)
    return bodies, places(low), numbers


#: Weights of central differences of the eighth and the sixth order.
EIGHTH = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))
SIXTH = ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))


def slope_along(centroid_of, step):
    """The slope, and a bound of its error; None if a body leaves the other."""
    found, noise = {}, 0.0
    for k in (-4, -3, -2, -1, 1, 2, 3, 4):
        common = centroid_of(k * step)
        if not common:
            return None
        found[k], noise = common.centroid, max(noise, common.errors.centroid)
    slopes = [sum(w * (found[k] - found[-k]) for k, w in rule) / step for rule in (EIGHTH, SIXTH)]
    return slopes[0], 10 * np.abs(slopes[0] - slopes[1]).max() + 2 * noise / step


@pytest.mark.parametrize("depth", [1e-1, 1e-3, 1e-5, 1e-7])
@pytest.mark.parametrize("kinds", [kinds for kinds in PAIRS if not FLAT.issuperset(kinds)], ids=" and ".join)
def test_errors_of_round_pairs_hold_against_differences(kinds, depth):
    """Along a direction by chance in all numbers of both bodies."""
    bodies, places, numbers = pair_at_depth(kinds, depth, 3)
    rng = np.random.default_rng(4)
    ways = [rng.uniform(-1, 1, len(row)) for row in numbers]
    for kind, way in zip(kinds, ways):
        if kind == "hull":
            way[:-6] = 0
    found = overlap(*bodies(places, numbers))
    errors, slope, stated = found.errors, np.zeros(3), np.zeros(3)
    if np.isnan(found.centroid_gradient).any():
        assert depth < 1e-4 and np.isnan(errors.centroid_gradient).all()
        return
    for body, (kind, way) in enumerate(zip(kinds, ways)):
        count = 0 if kind == "hull" else len(way) - 6
        columns = np.hstack([found.centroid_shape_gradient[body, :, :count], found.centroid_gradient[body]])
        bounds = np.hstack([errors.centroid_shape_gradient[body, :, :count], errors.centroid_gradient[body]])
        slope += columns @ way[-count - 6 :]
        stated += bounds @ np.abs(way[-count - 6 :])
    tried = [
        slope_along(lambda t: overlap(*bodies(places, [r + t * w for r, w in zip(numbers, ways)])), share * depth)
        for share in (0.05, 0.01, 0.002)
    ]
    expected, unsure = min((each for each in tried if each), key=lambda each: each[1])
    assert (np.abs(slope - expected) <= stated + unsure).all()
    size = np.abs(found.centroid_gradient).max()
    assert unsure <= 2e-4 * size
    assert depth < 1e-2 or stated.max() <= 1e-5 * size


@pytest.mark.parametrize("depth", [1e-1, 1e-4, 1e-7])
@pytest.mark.parametrize("kinds", PAIRS, ids=" and ".join)
def test_errors_hold_the_difference_of_a_pair_a_thousand_kilometres_away(kinds, depth):
    for seed in (1, 2):
        bodies, places, numbers = pair_at_depth(kinds, depth, seed)
        if "half-space" in kinds:  # its position is not where it is
            continue
        near, far = (overlap(*bodies(places, numbers, at)) for at in (0.0, 2.0**20))
        assert near and far
        for name in ("centroid_gradient", "centroid_shape_gradient"):
            one, two = getattr(near, name), getattr(far, name)
            room = getattr(near.errors, name) + getattr(far.errors, name)
            known = np.isfinite(one) & np.isfinite(two)
            assert (np.abs(one - two)[known] <= room[known]).all()
            assert np.isfinite(room[known]).all()


@pytest.mark.parametrize("depth", [1e-2, 1e-4, 1e-6, 1e-8])
def test_a_capsule_touched_on_its_side_has_the_derivatives_of_a_cylinder(depth):
    rng = np.random.default_rng(9)
    for _ in range(10):
        turn, across = quaternion(rng), rng.normal(size=2)
        across *= (0.4 + 0.3 - depth) / np.linalg.norm(across)
        ball = Placed(Sphere(0.3), Rotation.from_quat(turn).apply([*across, rng.uniform(-0.2, 0.2)]))
        capsule, cylinder = (overlap(Placed(shape(0.4, 1.0), (0, 0, 0), turn), ball) for shape in (Capsule, Cylinder))
        if np.isnan(capsule.centroid_gradient).any() or np.isnan(cylinder.centroid_gradient).any():
            continue
        off = np.abs(capsule.centroid_shape_gradient - cylinder.centroid_shape_gradient)
        room = capsule.errors.centroid_shape_gradient + cylinder.errors.centroid_shape_gradient
        assert (off <= room).all()
        by_length = capsule.centroid_shape_gradient[0, :, 1]
        assert (np.abs(by_length) <= capsule.errors.centroid_shape_gradient[0, :, 1]).all()
        assert depth < 1e-6 or not by_length.any()


def test_errors_are_nan_where_there_is_no_derivative():
    cylinder = Cylinder(0.5, 2.0)
    for bodies in (
        (Sphere(1.0), Sphere(1.0)),
        (cylinder, Placed(cylinder, (0, 0, 0.5))),
        (Capsule(0.5, 0), Placed(Box((0.3, 0.3, 0.3)), (0.4, 0, 0))),
        (Hull(random_polytope(9, rng=1).vertices), Box((0.5, 0.5, 0.5))),
        (Box((1, 1, 1)), Sphere(1.0), Box((2, 1, 1))),
    ):
        found = overlap(*bodies)
        for name in ("centroid_gradient", "centroid_shape_gradient"):
            values, errors = getattr(found, name), getattr(found.errors, name)
            assert values.shape == errors.shape and np.array_equal(np.isnan(values), np.isnan(errors))
            assert (errors[~np.isnan(errors)] >= 0).all()


def test_errors_of_bodies_apart_are_zero_and_of_bodies_that_touch_infinite():
    box = Box((1, 1, 1))
    apart, touching = overlap(box, Placed(box, (3, 0, 0))), overlap(box, Placed(box, (2, 0, 0)))
    assert touching.status == "touching"
    assert apart.errors.centroid_gradient.shape == (2, 3, 6) and not apart.errors.centroid_gradient.any()
    assert apart.errors.centroid_shape_gradient.shape == (2, 3, 3) and not apart.errors.centroid_shape_gradient.any()
    assert np.isinf(touching.errors.centroid_gradient).all() and np.isinf(touching.errors.centroid_shape_gradient).all()


def test_errors_include_both_one_sided_derivatives_of_faces_in_one_plane():
    box = Box((1, 1, 1))
    found = overlap(box, Placed(box, (1, 0, 0)))
    # A body that moves along y takes the common set along, or cuts it.
    assert (found.errors.centroid_gradient[:, 1, 1] >= 0.5).all()
    assert np.isfinite(found.errors.centroid_gradient).all()


def test_errors_of_a_group_of_polyhedra_hold_against_integers():
    rng = np.random.default_rng(8)
    case = make("general", 3)
    case = type(case)("three", 0, (*case.bodies, random_polytope(12, rng=rng).vertices + 0.1))
    found = overlap(*case.placed)
    for body in range(3):
        off = np.abs(found.centroid_gradient[body] - exact_gradient(case, body)[0])
        assert (off <= found.errors.centroid_gradient[body]).all()
        assert found.errors.centroid_gradient[body].max() <= 1e-9


def test_errors_of_method_paper_hold_the_difference_from_auto():
    a, b = Hull(random_polytope(12, rng=1).vertices), Placed(Box((0.5, 0.5, 0.5)), (0.4, 0.3, 0.2), (1, 2, 3, 4))
    paper, auto = overlap(a, b, method="paper"), overlap(a, b)
    off = np.abs(paper.centroid_gradient - auto.centroid_gradient)
    assert (off <= paper.errors.centroid_gradient).all()
    assert_allclose(paper.errors.centroid_gradient, auto.errors.centroid_gradient + off, rtol=1e-6)


def test_rows_of_a_batch_have_the_errors_of_their_overlaps():
    rng = np.random.default_rng(4)
    shapes = [
        Box((1, 0.5, 0.7)),
        Hull(random_polytope(20, rng=rng).vertices),
        Sphere(0.8),
        Box((1, 1, 1)),
        Box((1, 1, 1)),
    ]
    positions = np.r_[rng.uniform(-0.3, 0.3, (3, 3)), [[9, 0, 0], [11, 0, 0]]]
    turns = np.r_[[quaternion(rng) for _ in range(3)], [[0, 0, 0, 1]] * 2]
    found = overlaps(shapes, positions, turns, pairs=[(0, 1), (0, 2), (3, 4), (0, 3)])
    assert [found[row].status for row in range(4)] == ["overlapping", "overlapping", "touching", "separated"]
    for name in ("gradient", "shape_gradient", "centroid_gradient", "centroid_shape_gradient"):
        column = getattr(found, name + "_error")
        assert column.shape == getattr(found, name).shape
        for row in range(4):
            assert np.array_equal(column[row], getattr(found[row].errors, name), equal_nan=True)
        assert np.array_equal(getattr(found[[1, 0]], name + "_error"), column[[1, 0]], equal_nan=True)
