"""Second derivatives of the volume by poses: rational arithmetic, differences of exact volumes and of gradients."""

from fractions import Fraction

import exact
import numpy as np
import pytest
from families import make, points_of
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from strategies import quaternion

from overlapper import Box, HalfSpace, Hull, Placed, Sphere, overlap, overlaps, random_polytope

FAMILIES = ("posed_boxes", "posed", "general")
PAIRS = [case for name in FAMILIES for case in (make(name, seed) for seed in range(6)) if case.truth.dimension == 3]


def shares_a_plane(case):
    return any(len(facet.owners) > 1 for facet in case.truth.facets)


def position_of(body):
    return exact.vector(getattr(body, "position", (0, 0, 0)))


def wrench(normal, point, about):
    return (*normal, *exact.cross(exact.subtract(point, about), normal))


def exact_block(case):
    """The (6, 6) derivatives by the numbers of the first body, then of the second, without rounding.

    At an edge of the seam, normals of any length have the factor of the edge's length over the length of their cross
    product. The edge is parallel to that, so the factor is rational. Simpson's rule is exact for the products.
    """
    about = [position_of(body) for body in case.bodies]
    sums = [[Fraction(0)] * 6 for _ in range(6)]
    of_edge = {edge: facet for facet in case.truth.facets for edge in exact.edges_of(facet.ring)}
    for (u, v), facet in of_edge.items():
        other = of_edge[v, u]
        if facet.owners[0] != 0 or other.owners[0] != 1:
            continue
        n, m = (tuple(map(Fraction, each.plane[:3])) for each in (facet, other))
        p, q = exact.coordinates(u), exact.coordinates(v)
        across, along = exact.cross(n, m), exact.subtract(q, p)
        k = max(range(3), key=lambda i: abs(across[i]))
        middle = tuple((s + t) / 2 for s, t in zip(p, q))
        for x, weight in ((p, Fraction(1, 6)), (middle, Fraction(2, 3)), (q, Fraction(1, 6))):
            first, second = wrench(n, x, about[0]), wrench(m, x, about[1])
            for i in range(6):
                for j in range(6):
                    sums[i][j] += weight * abs(along[k] / across[k]) * first[i] * second[j]
    return np.array([[float(each) for each in row] for row in sums])


@pytest.mark.parametrize("case", [case for case in PAIRS if not shares_a_plane(case)], ids=repr)
def test_both_bodies_against_rational_arithmetic(case):
    found, truth = overlap(*case.placed).hessian, exact_block(case)
    assert np.array_equal(found, found.T)
    scale = np.abs(truth).max()
    assert_allclose(found[:6, 6:], truth, rtol=0, atol=1e-9 * scale)
    # A translation of one body is the opposite one of the other.
    assert_allclose(found[:3, :3], -truth[:3, :3], rtol=0, atol=1e-9 * scale)


@pytest.mark.parametrize("name", FAMILIES)
def test_translations_against_differences_of_exact_volumes(name):
    # Along a translation, the volume is a cubic polynomial until the next corner passes a plane.
    step, compared = Fraction(1, 2**80), 0
    for seed in range(6):
        case = make(name, seed)
        if case.truth.dimension < 3 or shares_a_plane(case):
            continue
        first, points = case.solids[0], [exact.vector(p) for p in points_of(case.bodies[1])]

        def volume(*move, first=first, points=points):
            return exact.common(first, exact.hull([exact.add(p, move) for p in points])).volume

        def along(*axes, volume=volume):
            return volume(*(step * axes.count(k) for k in range(3)))

        truth = np.empty((3, 3))
        for i in range(3):
            for j in range(i, 3):
                mixed = along(i, j) - along(i) - along(j) + along()
                truth[i, j] = truth[j, i] = float(mixed / step**2)
        found = overlap(*case.placed).hessian
        assert_allclose(found[6:9, 6:9], truth, rtol=0, atol=1e-9 * np.abs(found[:3, :3]).max())
        compared += 1
    assert compared >= 3


def moved(body, step):
    """The body after a translation and a turn by a rotation vector about its position."""
    turn = Rotation.from_rotvec(step[3:]) * Rotation.from_quat(body.orientation)
    return Placed(body.shape, body.position + step[:3], turn.as_quat())


def checked(bodies, found, rtol=1e-6):
    """Central differences of gradients, which are derivatives by rotation vectors about the turned body."""
    size, step = 6 * len(bodies), 1e-6
    expected = np.empty((size, size))
    gradient = overlap(*bodies).gradient
    for k in range(size):
        sides = []
        for side in (-1, 1):
            by = np.zeros(size)
            by[k] = side * step
            sides.append(overlap(*(moved(body, each) for body, each in zip(bodies, by.reshape(-1, 6)))).gradient)
        expected[:, k] = ((sides[1] - sides[0]) / (2 * step)).ravel()
        if k % 6 >= 3:  # the gradient's axes stay, and a rotation vector's do not
            body = k // 6
            expected[6 * body + 3 : 6 * body + 6, k] -= np.cross(np.eye(3)[k % 6 - 3], gradient[body, 3:]) / 2
    assert_allclose(found, expected, rtol=0, atol=rtol * np.abs(found).max())


def test_all_numbers_against_differences_of_gradients():
    rng = np.random.default_rng(1)
    for _ in range(8):
        box = Placed(Box(rng.uniform(0.5, 1, 3)), rng.uniform(-0.5, 0.5, 3), quaternion(rng))
        hull = Placed(Hull(random_polytope(12, rng=rng).vertices), rng.uniform(-0.5, 0.5, 3), quaternion(rng))
        checked((box, hull), overlap(box, hull).hessian)
        water = Placed(HalfSpace(rng.normal(size=3), 0.1))
        checked((box, water), overlap(box, water).hessian)
        group = (box, hull, Placed(Box((0.4, 0.6, 0.5)), rng.uniform(-0.2, 0.2, 3), quaternion(rng)))
        checked(group, overlap(*group).hessian)


def test_a_newton_step_predicts_the_volume():
    rng = np.random.default_rng(2)
    bodies = [Placed(Box(rng.uniform(0.5, 1, 3)), rng.uniform(-0.3, 0.3, 3), quaternion(rng)) for _ in range(2)]
    here = overlap(*bodies)
    errors = []
    for size in (1e-2, 1e-3):
        steps = size * np.random.default_rng(3).normal(size=(2, 6))
        there = overlap(*(moved(body, step) for body, step in zip(bodies, steps)))
        x = steps.ravel()
        errors.append(abs(there.volume - here.volume - here.gradient.ravel() @ x - x @ here.hessian @ x / 2))
    assert errors[1] < 2e-3 * errors[0]  # the third power


def test_a_box_in_water_has_the_section_as_stiffness():
    box, water = Placed(Box((1, 2, 3)), (0, 0, 0.5)), HalfSpace((0, 0, 1), 1.0)
    found = overlap(box, water).hessian
    # Upright walls: the volume is linear in the height, and 24 + 8 * 0.5 / cos(tilt) about a horizontal axis.
    assert_allclose(found[:3, :6], 0, atol=1e-13)
    assert_allclose(found[3:6, 3:6], np.diag([4, 4, 0]), atol=1e-13)


def test_a_face_in_the_plane_of_a_face_has_no_second_derivative():
    box = Box((1, 1, 1))
    assert np.isnan(overlap(box, Placed(box, (0.5, 0, 0))).hessian).all()
    assert np.isnan(overlap(box, box).hessian).all()
    beside = overlap(box, Placed(box, (0.5, 0.25, 0.25))).hessian
    assert np.isfinite(beside).all() and beside.any()
    nearly = overlap(box, Placed(box, (0.5, 0, 0), (0, 0, 1e-6, 1))).hessian
    assert np.isnan(nearly).all() or np.abs(nearly).max() > 1e5  # the tops are in one plane


def test_bodies_that_are_apart_have_zeros():
    box = Box((1, 1, 1))
    assert not overlap(box, Placed(box, (3, 0, 0))).hessian.any()
    assert not overlap(box, Placed(box, (2, 0, 0))).hessian.any()


def test_rows_of_a_batch_have_those_of_their_overlaps():
    rng = np.random.default_rng(4)
    shapes = [Box((1, 0.5, 0.7)), Hull(random_polytope(20, rng=rng).vertices), Sphere(0.6), Box((0.6, 0.6, 0.6))]
    positions = np.r_[rng.uniform(-0.3, 0.3, (3, 3)), [[9, 0, 0]]]
    turns = np.array([quaternion(rng) for _ in shapes])
    found = overlaps(shapes, positions, turns, pairs=[(0, 1), (0, 2), (1, 3), (1, 2)])
    assert found.hessian.shape == (4, 12, 12)
    assert np.array_equal(found.hessian[0], found[0].hessian) and found.hessian[0].any()
    assert np.array_equal(found.hessian[1], found[1].hessian) and not found.hessian[2].any()
    assert np.array_equal(found[[2, 0]].hessian, found.hessian[[2, 0]])
    assert len(overlaps(shapes, positions, turns, pairs=np.empty((0, 2), int)).hessian) == 0
