"""Volumes of a rounded hull and a cylinder by both surfaces.

The references are closed forms in 40 digits, the same bodies cut in two, slices of the pair with a third body around
both, and certificates.
"""

import numpy as np
import pytest
from mpmath import mp, mpf
from rounded_shapes import CUBE_CORNERS, agree, points, rounded_box, within

from overlapper import Cylinder, Placed, RoundedHull, overlap

OCTAHEDRON = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
CORES = [
    CUBE_CORNERS * [0.5, 0.25, 0.125], CUBE_CORNERS * 0.3, OCTAHEDRON * 0.5,
    CUBE_CORNERS * [0.5, 0.5, 1e-3], CUBE_CORNERS * [0.5, 1e-3, 1e-3], OCTAHEDRON * [0.5, 0.5, 1e-4],
]  # fmt: skip
RADII = [1e-3, 0.0625, 0.25, 1.0, 10.0]
TURNS = [(0, 0, 0, 1), (0, 0, 1, 1), (1, 1, 1, 1), (1e-9, 0, 0, 1), (1e-5, 2e-5, 0, 1), (0.1, 0.2, 0.3, 0.4)]
PLACES = [0, 0, 0, 0.0625, 0.125, 0.25, 0.3, 0.5, -0.25, -0.5, 1e-3, 0.4]
FAR = np.array([2.0**20, -(2.0**21), 2.0**19])


@pytest.fixture(autouse=True)
def digits():
    with mp.workdps(40):
        yield


@pytest.mark.parametrize("depth", [2.0**-3, 2.0**-5, 2.0**-8])
@pytest.mark.parametrize("aside", [0, 0.125, 0.875])
def test_a_corner_in_a_disc_is_a_part_of_a_ball(depth, aside):
    """The tip of a needle. Its bands are farther than the cap from the pole of its ball."""
    r = mpf(0.25)
    needle = RoundedHull(OCTAHEDRON * [0.01, 0.01, 2.0], float(r))
    found = overlap(Placed(needle, (aside, 0, 2 + 0.5 + float(r) - depth)), Placed(Cylinder(1.0, 1.0)))

    def area(z):
        """Of a disc of the ball in the cylinder."""
        radius = mp.sqrt(r**2 - z**2)
        if radius + aside <= 1:
            return mp.pi * radius**2
        chord = (1 + mpf(aside) ** 2 - radius**2) / (2 * mpf(aside))
        of_cylinder = mp.acos(chord) - chord * mp.sqrt(1 - chord**2)
        rest = (mpf(aside) - chord) / radius
        return of_cylinder + radius**2 * (mp.acos(rest) - rest * mp.sqrt(1 - rest**2))

    begin = r - mpf(depth)
    rim = mp.sqrt(r**2 - (1 - mpf(aside)) ** 2) if aside > 0.75 else begin
    assert found.way == "closed form"
    assert within(found, mp.quad(area, [begin, max(begin, rim), r]))


# In the first turn, the axis is parallel to the face. In the next two, it is nearly so.
@pytest.mark.parametrize(
    "turn",
    [(0, 1, 0, 1), (0, 1 + 1e-9, 0, 1), (0, 1 + 1e-5, 0, 1), (0, 0, 0, 1), (0.3, 0, 0, 1), (0.1, 0.2, 0.3, 0.4)],
)
@pytest.mark.parametrize("far", [np.zeros(3), FAR])
def test_a_plane_through_its_centre_halves_a_cylinder(turn, far):
    cylinder = Cylinder(0.125, 0.5)
    found = overlap(
        Placed(cylinder, far + [0.0625, -0.03125, 0.625], turn), rounded_box(0.125, far, half=[0.5, 0.5, 0.5])
    )
    assert found.way == "closed form"
    assert abs(found.volume - cylinder.volume / 2) <= found.volume_error + 2e-15 * found.volume


@pytest.mark.parametrize("depth", [2.0**-3, 2.0**-5, 2.0**-7])
@pytest.mark.parametrize("turn", [(0, 0, 0, 1), (0, 0, 1, 3), (1, 0, 0, 0)])
def test_a_cylinder_that_stands_on_a_face(depth, turn):
    """Its disc is parallel to the face."""
    place = np.array([0.0625, -0.03125, 0.625 + 0.25 - depth])
    found = overlap(Placed(Cylinder(0.25, 0.5), place, turn), rounded_box(0.125, half=[0.5, 0.5, 0.5]))
    assert found.way == "closed form"
    assert within(found, mp.pi * mpf(0.25) ** 2 * mpf(depth))


@pytest.mark.parametrize("depth", [2.0**-3, 2.0**-5])
@pytest.mark.parametrize("across", [False, True])
def test_a_cylinder_that_lies_on_a_face(depth, across):
    """Its axis is parallel to the face and to edges."""
    r, length = 0.25, 0.5
    place = np.array([0.0625, -0.03125, 0.625 + r - depth])
    turn = (1, 0, 0, 1) if across else (0, 1, 0, 1)
    found = overlap(Placed(Cylinder(r, length), place, turn), rounded_box(0.125, half=[0.5, 0.5, 0.5]))
    level = mpf(r) - mpf(depth)
    segment = mpf(r) ** 2 * mp.acos(level / r) - level * mp.sqrt(mpf(r) ** 2 - level**2)
    assert found.way == "closed form"
    assert within(found, length * segment)


@pytest.mark.parametrize("turn", [(0, 0, 0, 1), (0, 0, 1, 3)])
@pytest.mark.parametrize("place", [(0.625, 0), (0.5, 0.46875), (0.625, 0.59375), (0.6875, 0.125)])
def test_a_cylinder_that_stands_over_edges_is_the_sum_of_its_parts(place, turn):
    """Bands and the disc are parallel. A band across is parallel to the axis."""
    box = rounded_box(0.125, half=[0.5, 0.5, 0.5])
    whole = overlap(Placed(Cylinder(0.25, 0.5), (*place, 0.5), turn), box)
    parts = [
        overlap(Placed(Cylinder(0.25, 0.3125), (*place, 0.40625), turn), box),
        overlap(Placed(Cylinder(0.25, 0.1875), (*place, 0.65625), turn), box),
    ]
    assert whole.way == "closed form"
    assert abs(whole.volume - sum(part.volume for part in parts)) <= 2 * sum(p.volume_error for p in [whole, *parts])
    assert agree(Placed(Cylinder(0.25, 0.5), (*place, 0.5), turn), box)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("depth", [None, 1e-1, 1e-2, 1e-4])
def test_random_pairs_agree_with_slices(seed, depth):
    rng = np.random.default_rng([seed, 1])
    closed = 0
    for _ in range(12):
        found = None
        while not found:
            shape = RoundedHull(points(rng, rng.choice([4, 8, 20, 60])), 10 ** rng.uniform(-3.5, 0))
            a = Placed(shape, rng.normal(size=3) * 0.4, rng.normal(size=4))
            b = Placed(Cylinder(rng.uniform(0.02, 0.5), rng.uniform(0.02, 1.2)), (0, 0, 0), rng.normal(size=4))
            found = overlap(a, b)
            if found and depth is not None:
                a = Placed(a.shape, a.position + max(0.0, found.depth - depth) * found.normal, a.orientation)
                found = overlap(a, b)
        closed += found.way == "closed form"
        assert agree(a, b)
    assert closed >= {None: 10, 1e-1: 9, 1e-2: 2}.get(depth, 0)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("depth", [None, 1e-1, 1e-3])
@pytest.mark.parametrize("far", [0.0, 1e3])
def test_aligned_thin_and_far_pairs_agree_with_slices(seed, depth, far):
    rng = np.random.default_rng([seed, 2])
    for _ in range(12):
        found = None
        while not found:
            shape = RoundedHull(CORES[rng.integers(len(CORES))], rng.choice(RADII))
            cylinder = Cylinder(rng.choice([*RADII, 0.5]), rng.choice([1e-3, 0.1, 0.5, 1.0, 4.0]))
            turn = TURNS[rng.integers(len(TURNS))]
            other = turn if rng.random() < 0.6 else TURNS[rng.integers(len(TURNS))]
            a, b = Placed(shape, rng.choice(PLACES, 3) + far, turn), Placed(cylinder, np.full(3, far), other)
            found = overlap(a, b)
            if found and depth is not None:
                a = Placed(a.shape, a.position + max(0.0, found.depth - depth) * found.normal, a.orientation)
                found = overlap(a, b)
        if found.way == "closed form":
            assert agree(a, b)


def test_a_gap_in_the_border_of_a_large_ball_counts_by_its_distance_from_the_centre():
    """A tip of 4 m on a cylinder of 17 cm: its normals are far from the direction to the contact."""
    angles = np.arange(32) * np.pi / 16
    cone = np.vstack([np.column_stack([np.cos(angles), np.sin(angles), 0 * angles]), [0, 0, 2.28]])
    tip = Placed(RoundedHull(cone, 4.32), (0, 0, 0), (0, 1, 0, 1))
    for shift in np.arange(8) * 1e-3:
        cylinder = Placed(Cylinder(0.173349, 0.828509), (3.689 + shift, -2.8046, 2.80815), (0, 1, 0, 1))
        assert agree(tip, cylinder)


@pytest.mark.parametrize("turn", [(0, 0, 0, 1), (0, 0, 1, 1), (1, 1, 1, 1)])
@pytest.mark.parametrize("far", [np.zeros(3), FAR])
def test_a_body_inside_the_other_one_has_its_whole_volume(turn, far):
    inner = Cylinder(0.0625, 0.5)
    for outer in [RoundedHull(CUBE_CORNERS * [0.5, 1e-3, 1e-3], 10.0), RoundedHull(CUBE_CORNERS, 0.25)]:
        found = overlap(Placed(inner, np.array([0.0, 1e-3, 0.25]) + far, turn), Placed(outer, far, turn))
        assert found.way == "closed form"
        assert abs(found.volume - inner.volume) <= found.volume_error <= 1e-13 * found.volume
    hull = RoundedHull(OCTAHEDRON * 0.5, 0.125)
    found = overlap(Placed(Cylinder(1.0, 4.0), far, turn), Placed(hull, far + [0, 0.125, 0.25], turn))
    assert found.way == "closed form"
    assert abs(found.volume - hull.volume) <= found.volume_error <= 1e-13 * found.volume
