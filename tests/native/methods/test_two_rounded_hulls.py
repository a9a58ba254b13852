"""Volumes of two rounded hulls, and of a rounded hull and a capsule, by both surfaces.

The references are caps, lenses and crossing cylinders in 40 digits, Steiner's formula, slices of the pair with a third
body around both, and certificates.
"""

import numpy as np
import pytest
from mpmath import mp, mpf
from rounded_shapes import CUBE_CORNERS, HALF, agree, cap, lens, points, rounded_box, within

from overlapper import Capsule, Cylinder, Placed, RoundedHull, overlap

OCTAHEDRON = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)
PRISM = np.array([[0.4 * np.cos(t), 0.4 * np.sin(t), z] for t in np.arange(12) * np.pi / 6 for z in (-0.2, 0.2)])
CORES = [
    CUBE_CORNERS * [0.5, 0.25, 0.125], CUBE_CORNERS * 0.3, TETRAHEDRON * 0.4, OCTAHEDRON * 0.5, PRISM,
    CUBE_CORNERS * [0.5, 0.5, 1e-3], CUBE_CORNERS * [0.5, 1e-3, 1e-3], OCTAHEDRON * [0.5, 0.5, 1e-4],
]  # fmt: skip
RADII = [1e-4, 1e-3, 0.0625, 0.25, 1.0, 10.0]
TURNS = [
    (0, 0, 0, 1),
    (0, 0, 1, 1),
    (1, 1, 1, 1),
    (0, 1, 0, 0),
    (1e-9, 0, 0, 1),
    (1e-5, 2e-5, 0, 1),
    (0.1, 0.2, 0.3, 0.4),
]
PLACES = [0, 0, 0, 0.0625, 0.125, 0.25, 0.3, 0.5, -0.25, -0.5, 1e-3, 0.4]
FAR = np.array([2.0**20, -(2.0**21), 2.0**19])
DEPTHS = [2.0**-5, 2.0**-8, 2.0**-12, 2.0**-16]


@pytest.fixture(autouse=True)
def digits():
    with mp.workdps(40):
        yield


def crossing_cylinders(a, b, apart, sine):
    """Slices across the common normal of the axes are parallelograms."""

    def area(z):
        return 4 * mp.sqrt(abs(a**2 - z**2)) * mp.sqrt(abs(b**2 - (apart - z) ** 2)) / sine

    return mp.quad(area, [apart - b, (apart - b + a) / 2, a])


@pytest.mark.parametrize("depth", DEPTHS)
@pytest.mark.parametrize("r", [2.0**-6, 2.0**-3])
@pytest.mark.parametrize("far", [np.zeros(3), FAR])
def test_a_corner_over_a_face_is_a_cap(depth, r, far):
    at = np.array([0.03125, -0.015625, 0.125 + 2.0**-4 + 0.5 + r - depth])
    a = Placed(RoundedHull(OCTAHEDRON * 0.5, r), at + far, (0, 0, 1, 1))
    found = overlap(a, rounded_box(2.0**-4, far))
    lost = mpf(0.125) + mpf(2) ** -4 + mpf(0.5) + mpf(r) - (mpf(a.position[2]) - mpf(far[2]))
    assert found.way == "closed form"
    if depth < r / 4:  # otherwise the bands reach the face, too
        assert within(found, cap(mpf(r), lost))


@pytest.mark.parametrize("depth", DEPTHS)
@pytest.mark.parametrize("radii", [(2.0**-4, 2.0**-4), (2.0**-4, 2.0**-2), (1.0, 2.0**-3)])
@pytest.mark.parametrize("turn", [(0, 0, 0, 1), (1, 1, 1, 1)])
def test_two_corners_are_a_lens_of_two_balls(depth, radii, turn):
    r, s = radii
    depth = min(depth, r / 8, s / 8)
    way = np.array([6.0, 6.0, 7.0]) / 11
    # The turn leads the corner to itself.
    a = rounded_box(r, -HALF)
    b = Placed(RoundedHull((CUBE_CORNERS + 1) * 0.3, s), way * (r + s - depth), turn)
    apart = mp.sqrt(sum(mpf(x) ** 2 for x in b.position))
    assert within(overlap(a, b), lens(mpf(r), mpf(s), apart))


@pytest.mark.parametrize("depth", [2.0**-20, 2.0**-28, 2.0**-36])
@pytest.mark.parametrize("radii", [(2.0**-4, 2.0**-4), (2.0**-4, 64.0), (2.0**12, 2.0**12)])
@pytest.mark.parametrize("far", [np.zeros(3), FAR])
def test_shallow_lenses_of_corners_on_one_diagonal_keep_their_digits(depth, radii, far):
    """The line of both vertices passes the contact, so that the centre of the circle is in no certain direction."""
    r, s = radii
    a = rounded_box(r, far - HALF)
    b = Placed(RoundedHull((CUBE_CORNERS + 1) * 0.3, s), far + np.full(3, (r + s - depth) / np.sqrt(3.0)))
    apart = mp.sqrt(sum((mpf(x) - mpf(y)) ** 2 for x, y in zip(b.position, far)))
    found = overlap(a, b)
    rounding = 1e-14 * max(np.abs(b.position).max(), r + s)
    if apart < r + s - rounding:
        assert found.way == "closed form"
        assert within(found, lens(mpf(r), mpf(s), apart), beside=0)


@pytest.mark.parametrize("depth", [2.0**-16, 2.0**-24, 2.0**-32])
@pytest.mark.parametrize("s", [2.0**-3, 2.0**3])
def test_a_half_ball_of_a_capsule_keeps_its_digits_near_its_rim(depth, s):
    r, way = 2.0**-3, np.array([0.8, 0.6, 0.05])
    end = way / np.linalg.norm(way) * (r + s - depth)
    a, b = rounded_box(r, -HALF), Placed(Capsule(s, 0.5), end + [0, 0, 0.25])
    apart = mp.sqrt(mpf(end[0]) ** 2 + mpf(end[1]) ** 2 + (mpf(b.position[2]) - mpf(0.25)) ** 2)
    found = overlap(a, b)
    assert found.way == "closed form"
    assert within(found, lens(mpf(r), mpf(s), apart), beside=0)


@pytest.mark.parametrize("depth", DEPTHS)
@pytest.mark.parametrize("radii", [(2.0**-4, 2.0**-4), (2.0**-3, 2.0**-2)])
@pytest.mark.parametrize("quaternion", [(0, 0, 1, 1), (0, 0, 1, 2), (0, 0, 1, 3)])
def test_two_edges_are_crossing_cylinders(depth, radii, quaternion):
    # Bars with a square section on edge: their edges at the top and at the bottom are along x, one turned about z.
    r, s = radii
    depth = min(depth, r / 8)
    bar = np.array([[x, y, z] for x in (-1, 1) for y, z in [(0.25, 0), (-0.25, 0), (0, 0.25), (0, -0.25)]], float)
    a = Placed(RoundedHull(bar, r))
    b = Placed(RoundedHull(bar, s), (0, 0, 0.5 + r + s - depth), quaternion)
    apart = mpf(b.position[2]) - mpf(0.5)
    z, w = mpf(quaternion[2]), mpf(quaternion[3])
    found = overlap(a, b)
    assert found.way == "closed form"
    assert within(found, crossing_cylinders(mpf(r), mpf(s), apart, 2 * z * w / (z * z + w * w)))


@pytest.mark.parametrize("depth", DEPTHS)
def test_an_edge_and_a_capsule_are_crossing_cylinders(depth):
    r, s = 2.0**-4, 2.0**-2
    depth = min(depth, r / 8)
    bar = np.array([[x, y, z] for x in (-1, 1) for y, z in [(0.25, 0), (-0.25, 0), (0, 0.25), (0, -0.25)]], float)
    capsule = Placed(Capsule(s, 2.0), (0.125, -0.0625, 0.25 + r + s - depth), (1, 0, 0, 1))
    found = overlap(Placed(RoundedHull(bar, r)), capsule)
    assert found.way == "closed form"
    assert within(found, crossing_cylinders(mpf(r), mpf(s), mpf(capsule.position[2]) - mpf(0.25), mpf(1)))


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("far", [np.zeros(3), FAR])
def test_a_body_inside_the_other_one_has_its_whole_volume(turn, far):
    small = [
        RoundedHull(OCTAHEDRON * [0.5, 0.5, 1e-4], 1e-4),
        RoundedHull(CUBE_CORNERS * 0.3, 0.0625),
        Capsule(0.0625, 0.5),
    ]
    large = [RoundedHull(CUBE_CORNERS * [0.5, 1e-3, 1e-3], 10.0), RoundedHull(CUBE_CORNERS, 0.25)]
    for inner in small:
        for outer in large:
            a, b = Placed(inner, np.array([0.0, 1e-3, 0.25]) + far, turn), Placed(outer, far, turn)
            found = overlap(a, b)
            assert abs(found.volume - inner.volume) <= found.volume_error
            assert found.volume_error <= 1e-13 * found.volume
            assert found.volume == overlap(b, a).volume


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("depth", [None, 1e-2, 1e-4, 1e-6])
def test_random_pairs_agree_with_slices(seed, depth):
    rng = np.random.default_rng([seed, 1])
    closed = 0
    for _ in range(12):
        found = None
        while not found:
            shape = RoundedHull(points(rng, rng.choice([4, 8, 20, 60])), 10 ** rng.uniform(-3.5, 0))
            other = RoundedHull(points(rng, 20), 10 ** rng.uniform(-3, -0.7))
            if rng.random() < 0.3:
                other = Capsule(rng.uniform(0.02, 0.4), rng.uniform(0.1, 1))
            a = Placed(shape, rng.normal(size=3) * 0.4, rng.normal(size=4))
            b = Placed(other, (0, 0, 0), rng.normal(size=4))
            found = overlap(a, b)
            if found and depth is not None:
                a = Placed(a.shape, a.position + max(0.0, found.depth - depth) * found.normal, a.orientation)
                found = overlap(a, b)
        closed += found.way == "closed form"
        assert agree(a, b)
    assert closed >= 10


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("depth", [None, 1e-1, 1e-3, 1e-5])
@pytest.mark.parametrize("far", [0.0, 1e3])
def test_aligned_thin_and_far_pairs_agree_with_slices(seed, depth, far):
    rng = np.random.default_rng([seed, 2])
    for _ in range(12):
        found = None
        while not found:
            shapes = [RoundedHull(CORES[rng.integers(len(CORES))], rng.choice(RADII)) for _ in range(2)]
            if rng.random() < 0.3:
                shapes[1] = shapes[0]
            elif rng.random() < 0.4:
                shapes[1] = Capsule(rng.choice(RADII), rng.choice([0.1, 0.5, 1.0, 4.0]))
            turn = TURNS[rng.integers(len(TURNS))]
            other = turn if rng.random() < 0.4 else TURNS[rng.integers(len(TURNS))]
            a, b = Placed(shapes[0], rng.choice(PLACES, 3) + far, turn), Placed(shapes[1], np.full(3, far), other)
            found = overlap(a, b)
            if found and depth is not None:
                a = Placed(a.shape, a.position + max(0.0, found.depth - depth) * found.normal, a.orientation)
                found = overlap(a, b)
        if found.way == "closed form":
            assert agree(a, b)


@pytest.mark.parametrize("way", [(1, 0, 0), (1, 1, 0), (0.6, 0.5, 0.1)])
@pytest.mark.parametrize("depth", [1e-2, 1e-4])
def test_features_with_tiny_angles_keep_their_digits(way, depth):
    """The facets of the flat octahedron are nearly in one plane, and its rim is nearly a half circle."""
    flat = RoundedHull(OCTAHEDRON * [0.5, 0.5, 1e-4], 0.25)
    for turn in [(1, 1, 1, 1), (0, 0, 1, 1), (0.1, 0.2, 0.3, 0.4)]:
        a, b = Placed(flat, 0.7 * np.array(way), turn), Placed(flat)
        found = overlap(a, b)
        a = Placed(flat, a.position + (found.depth - depth) * found.normal, turn)
        assert agree(a, b)


@pytest.mark.parametrize("shape", [Capsule(0.25, 0.5), Cylinder(0.25, 0.5)])
@pytest.mark.parametrize("seed", range(3))
def test_certificates_agree(seed, shape):
    rng = np.random.default_rng([seed, 3])
    a = Placed(RoundedHull(points(rng, 5), 0.0625), (0.45, 0.05, 0.1), rng.normal(size=4))
    b = Placed(shape, (0, 0, 0), rng.normal(size=4))
    found = overlap(a, b)
    assert found.way == "closed form"
    lower, upper = found.certificate().verify()
    assert float(lower) - found.volume_error <= found.volume <= float(upper) + found.volume_error


@pytest.mark.parametrize("shape", [Capsule(0.00634, 0.58), Cylinder(0.00634, 0.58)])
@pytest.mark.parametrize("beside", [0, 1e-16, 1e-14, 1e-12, 1e-11, 1e-10, 1e-8, 1e-6])
def test_an_axis_beside_a_corner_has_a_direction_that_is_orthogonal_to_it(shape, beside):
    """The direction from the axis to the corner is a short difference of long vectors."""
    cube, outwards = RoundedHull(CUBE_CORNERS * 0.5, 0.0638), -np.array([0.447, 0.775, 0.447])
    axis = outwards / np.linalg.norm(outwards)
    across = np.cross(axis, [0, 0, 1]) / np.linalg.norm(np.cross(axis, [0, 0, 1]))
    at = cube.core.vertices.min(axis=0) + cube.radius * axis + beside * across
    rod = Placed(shape, at, (-axis[1], axis[0], 0, 1 + axis[2]))  # turns the z axis to the corner's normal
    found = overlap(Placed(cube), rod)
    assert found.way == "closed form"
    assert agree(Placed(cube), rod)
