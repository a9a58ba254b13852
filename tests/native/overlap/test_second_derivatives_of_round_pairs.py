"""Second derivatives of the volume of pairs with a round body: closed forms, and differences of gradients."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pairs_of_kinds import PAIRS, PairOfKinds
from scipy.spatial.transform import Rotation

from overlapper import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Placed,
    RoundedHull,
    Sphere,
    overlap,
    overlaps,
    random_polytope,
)


def moved(body, step):
    """The body after a translation and a turn by a rotation vector about its position."""
    turn = Rotation.from_rotvec(step[3:]) * Rotation.from_quat(body.orientation)
    return Placed(body.shape, body.position + step[:3], turn.as_quat())


def differences(bodies, step=1e-5):
    """Central differences of gradients of the fourth order, as second derivatives by rotation vectors."""
    found, gradient = np.empty((12, 12)), overlap(*bodies).gradient
    for k in range(12):
        column = np.zeros(12)
        for side, weight in ((1, 8), (-1, -8), (2, -1), (-2, 1)):
            by = np.zeros(12)
            by[k] = side * step
            there = overlap(*(moved(body, each) for body, each in zip(bodies, by.reshape(2, 6))))
            column += weight * there.gradient.ravel()
        found[:, k] = column / (12 * step)
        if k % 6 >= 3:  # the gradient's axes stay, and a rotation vector's do not
            body = k // 6
            found[6 * body + 3 : 6 * body + 6, k] -= np.cross(np.eye(3)[k % 6 - 3], gradient[body, 3:]) / 2
    return found


def common_motions(bodies, about):
    """(12, 6) how the numbers of both bodies change if both move together: translations, and turns about a point."""
    return np.vstack(
        [
            np.block(
                [
                    [np.eye(3), -np.array([np.cross(body.position - about, axis) for axis in np.eye(3)]).T],
                    [np.zeros((3, 3)), np.eye(3)],
                ]
            )
            for body in bodies
        ]
    )


def check_common_motion(bodies, found):
    """The gradient of a pair that moves as one body only turns."""
    motions = common_motions(bodies, bodies[0].position)
    expected = np.zeros((12, 6))
    for k in range(3):
        axis = np.eye(3)[k]
        for body in range(2):
            force, moment = found.gradient[body, :3], found.gradient[body, 3:]
            expected[6 * body : 6 * body + 3, 3 + k] = np.cross(axis, force)
            expected[6 * body + 3 : 6 * body + 6, 3 + k] = np.cross(axis, moment) / 2
    assert_allclose(found.hessian @ motions, expected, rtol=0, atol=1e-10 * np.abs(found.hessian).max())


@pytest.mark.parametrize("kinds", PAIRS, ids=" and ".join)
def test_every_two_kinds_of_shapes_against_differences_of_gradients(kinds):
    for seed in (1, 2):
        bodies = PairOfKinds(kinds, seed).bodies()
        found = overlap(*bodies)
        hessian = found.hessian
        assert hessian.any()
        assert_allclose(hessian, hessian.T, rtol=0, atol=1e-15 * np.abs(hessian).max())
        assert_allclose(hessian, differences(bodies), rtol=0, atol=2e-7 * np.abs(hessian).max())
        check_common_motion(bodies, found)


def test_two_balls_have_a_closed_form():
    a, b, distance = 0.7, 0.5, 0.9
    found = overlap(Sphere(a), Placed(Sphere(b), (0, 0, distance))).hessian
    # The volume is π (a + b − d)² (d² + 2 d (a + b) − 3 (a − b)²) / (12 d). Its slope is minus the area of the section.
    section = np.pi * (a**2 - ((distance**2 + a**2 - b**2) / (2 * distance)) ** 2)
    along = np.pi * (distance**2 + a**2 - b**2) / (2 * distance) * (1 - (a**2 - b**2) / distance**2)
    across = -section / distance
    block = np.diag([across, across, along])
    assert_allclose(found[:3, :3], block, atol=1e-13)
    assert_allclose(found[:3, 6:9], -block, atol=1e-13)
    assert_allclose(found[[3, 4, 5, 9, 10, 11]], 0, atol=1e-13)


@pytest.mark.parametrize("depth", [1e-9, 1e-4, 0.3, 1.7])
def test_a_ball_in_a_half_space_has_a_closed_form(depth):
    found = overlap(Placed(Sphere(1.0), (3, -2, 1 - depth)), HalfSpace((0, 0, 1), 0.0))
    hessian = found.hessian
    volume = np.pi * depth**2 * (1 - depth / 3)
    assert_allclose(found.volume, volume, rtol=1e-7)
    assert_allclose(hessian[2, 2], np.pi * (2 - 2 * depth), rtol=1e-9)
    assert_allclose(hessian[:2, :6], 0, atol=1e-13)
    assert_allclose(hessian[3:6, 3:6], 0, atol=1e-13)


def test_shallow_sections_of_a_ball_keep_their_digits_in_any_direction():
    rng, radius, depth = np.random.default_rng(1), 0.6, 1e-6
    for turn in rng.normal(size=(40, 4)):
        plane = Placed(HalfSpace((0.6, 0, 0.8), 0.1), (0, 0, 0), turn)
        n = Rotation.from_quat(turn).apply([0.6, 0, 0.8])
        hessian = overlap(Placed(Sphere(radius), n * (0.1 + radius - depth)), plane).hessian
        assert_allclose(n @ hessian[:3, :3] @ n, 2 * np.pi * (radius - depth), rtol=1e-9)


@pytest.mark.parametrize("tilt", [0, 1e-12, 1e-9, 1e-6, 1e-3])
def test_a_cylinder_on_a_half_space_has_its_section_as_stiffness(tilt):
    radius, length, depth = 0.5, 2.0, 0.1
    turn = (Rotation.from_euler("y", tilt) * Rotation.from_euler("y", np.pi / 2)).as_quat()
    found = overlap(Placed(Cylinder(radius, length), (0, 0, radius - depth), turn), HalfSpace((0, 0, 1), 0.0)).hessian
    chord = 2 * np.sqrt(radius**2 - (radius - depth) ** 2)
    # d²V/dz² is the sum of length / tan of the angle at both sides.
    stiffness = 2 * length * (radius - depth) / (chord / 2)
    assert_allclose(found[2, 2], stiffness, rtol=1e-7 + 100 * tilt)


def test_bodies_on_one_axis():
    """The seam lies in planes across the axis, where slices, corners and cuts between pieces coincide."""
    shapes = [
        Sphere(0.6),
        Capsule(0.45, 0.8),
        Cylinder(0.5, 1.1),
        Ellipsoid((0.55, 0.55, 0.8)),
        Ellipsoid((0.4, 0.7, 0.5)),
    ]
    shapes += [
        RoundedHull(random_polytope(9, rng=3).vertices * 0.5, 0.2),
        Box((0.5, 0.4, 0.6)),
        HalfSpace((0, 0, 1), 0.25),
    ]
    compared = 0
    for i, one in enumerate(shapes):
        for two in shapes[i:]:
            bodies = Placed(one), Placed(two, (0, 0, 0.3))
            if not isinstance(one, HalfSpace) and not (isinstance(one, Box) and isinstance(two, (Box, HalfSpace))):
                hessian = overlap(*bodies).hessian
                if np.isnan(hessian).any():
                    continue
                expected = differences(bodies)
                assert_allclose(hessian, expected, rtol=0, atol=1e-6 * np.abs(hessian).max(), err_msg=f"{one} {two}")
                compared += 1
    assert compared >= 25


def test_surfaces_that_coincide_or_touch_along_a_line_have_none():
    cylinder = Cylinder(0.5, 2.0)
    for a, b in (
        (Sphere(1.0), Sphere(1.0)),
        (Ellipsoid((1, 2, 3)), Ellipsoid((1, 2, 3))),
        (cylinder, Placed(cylinder, (0, 0, 0.5))),
        (Capsule(0.5, 1), Placed(cylinder, (0, 0, 0.3))),
        (cylinder, Placed(Box((1, 1, 1)), (0.5, 0, 0))),  # the ends of both are in one plane
        (Placed(cylinder), Placed(Box((0.5, 2, 0.25)))),  # a line of the cylinder is in a face
        (Placed(cylinder), Placed(Sphere(0.5), (0, 0, 0.2))),  # along a circle
        (Ellipsoid((0.5, 0.5, 0.8)), Placed(Ellipsoid((0.4, 0.7, 0.5)), (0, 0, 0.3))),  # the seam crosses itself
    ):
        assert np.isnan(overlap(a, b).hessian).all(), (a, b)


def test_a_ball_within_a_box_has_zeros():
    assert not overlap(Box((1, 1, 1)), Placed(Sphere(0.5), (0.1, 0.2, 0.3))).hessian.any()


def test_groups_with_a_round_body_are_refused_in_one_sentence():
    sentence = "^hessian exists for every pair, but for three or more bodies only if none is round$"
    with pytest.raises(ValueError, match=sentence):
        _ = overlap(Box((1, 1, 1)), Sphere(1.0), Box((2, 1, 1))).hessian


def test_rows_of_a_batch_have_those_of_their_overlaps():
    shapes = [Box((1, 0.5, 0.7)), Sphere(0.6), Ellipsoid((0.4, 0.5, 0.6)), Sphere(0.1)]
    positions = [[0, 0, 0], [0.8, 0.1, 0.2], [0.5, 0.6, 0.1], [9, 0, 0]]
    found = overlaps(shapes, positions, np.tile([0.1, 0.2, 0.3, 1], (4, 1)), pairs=[(0, 1), (1, 2), (0, 3)])
    assert np.array_equal(found.hessian[0], found[0].hessian) and found.hessian[0].any()
    assert np.array_equal(found.hessian[1], found[1].hessian) and np.isfinite(found.hessian[1]).all()
    assert not found.hessian[2].any()
