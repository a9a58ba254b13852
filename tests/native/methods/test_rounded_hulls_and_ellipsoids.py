"""Volumes of a rounded hull in an ellipsoid, by the surface of the rounded hull.

The references are caps in 40 digits, an ellipsoid and a capsule by code of its own, Steiner's formula, slices of the
same pairs, recorded before there was this way, and polytopes around and inside the common part.
"""

import csv
from pathlib import Path

import numpy as np
import pytest
from ellipsoid_and_tube_exact import Pair
from ellipsoid_and_tube_exact import volume as exact_volume
from mpmath import mp, mpf
from rounded_shapes import HALF, UNTURNED, points, rounded_box
from strategies import rotation

from overlapper import Box, Capsule, Ellipsoid, Placed, RoundedHull, overlap

SLICES = Path(__file__).with_name("rounded_hulls_and_ellipsoids.csv")
TURNS = [UNTURNED, (0, 0, 1, 1), (1, 1, 1, 1), (0, 0.6, 0, 0.8), (0, 0, 1, 0), (1, 0, 0, 1)]
FAR = np.array([2.0**20, -(2.0**21), 2.0**19])


@pytest.fixture(autouse=True)
def digits():
    with mp.workdps(40):
        yield


def turns(rng, count=2):
    return rng.normal(size=(count, 4))


# Pairs of which slices have been recorded, each kind with its own numbers.


def at_random(rng):
    corners, r = ((20, rng.uniform(0.02, 0.1)), (60, 1e-3), (4, rng.uniform(0.01, 0.3)))[rng.integers(3)]
    q = turns(rng)
    return Placed(Ellipsoid(rng.uniform(0.2, 0.6, 3)), rng.normal(size=3) * 0.3, q[0]), Placed(
        RoundedHull(points(rng, corners), r), (0, 0, 0), q[1]
    )


def aligned(rng):
    axes = rng.permutation([0.1, 0.2, 0.3, 0.4, 0.5, 0.25, 0.125])[:3]
    half = rng.choice([0.5, 0.25, 0.125, 0.4], 3)
    at = rng.choice([0, 1, -1, 0.5, 0.75, 1.1], 3) * half
    turn = TURNS[rng.integers(len(TURNS))]
    return Placed(Ellipsoid(axes), at, turn), rounded_box(rng.choice([1e-3, 0.03, 0.0625, 0.125, 0.25]), half=half)


def centre_on_the_surface(rng):
    r = rng.choice([0.01, 0.0625, 0.25])
    way = np.array([[0, 0, 1], [0, 0.6, 0.8], [2 / 7, 3 / 7, 6 / 7]][rng.integers(3)])
    at = np.where(way == 0, 0.3, 1) * HALF + r * way
    return Placed(Ellipsoid(rng.uniform(0.1, 0.5, 3)), at, turns(rng)[0]), rounded_box(r)


def of_revolution(rng):
    a, b = rng.uniform(0.1, 0.6, 2)
    q = turns(rng) if rng.random() < 0.5 else np.array([UNTURNED] * 2)
    axes = ((a, a, b), (a, b, a), (b, a, a))[rng.integers(3)]
    body = RoundedHull(points(rng, rng.choice([4, 8, 20])), 10 ** rng.uniform(-3, -0.5))
    return Placed(Ellipsoid(axes), rng.normal(size=3) * 0.3, q[0]), Placed(body, (0, 0, 0), q[1])


def nearly_equal_axes(rng):
    a = rng.uniform(0.2, 0.5)
    axes = a * (1 + 10 ** rng.uniform(-13, -2) * rng.normal(size=3))
    q = turns(rng)
    body = RoundedHull(points(rng, rng.choice([4, 8, 20])), 10 ** rng.uniform(-3, -0.5))
    return Placed(Ellipsoid(axes), rng.normal(size=3) * 0.3, q[0]), Placed(body, (0, 0, 0), q[1])


def slender(rng):
    q = turns(rng)
    body = RoundedHull(points(rng, rng.choice([4, 8, 20])), 10 ** rng.uniform(-3, -0.5))
    axes = 0.5 * 10 ** rng.uniform(-2, 0, 3)
    return Placed(Ellipsoid(axes), rng.normal(size=3) * 0.2, q[0]), Placed(body, (0, 0, 0), q[1])


def thin_core(rng):
    flat = np.array([(1, 1, 1e-3), (1, 1e-3, 1e-3), (1, 1, 1e-6), (1, 0.01, 1)][rng.integers(4)])
    q = turns(rng)
    body = RoundedHull(points(rng, rng.choice([4, 6, 12])) * flat, 10 ** rng.uniform(-3, -0.3))
    return Placed(Ellipsoid(rng.uniform(0.1, 0.6, 3)), rng.normal(size=3) * 0.2, q[0]), Placed(body, (0, 0, 0), q[1])


def tiny_margin(rng):
    q = turns(rng)
    body = RoundedHull(points(rng, rng.choice([4, 8, 20])), 10 ** rng.uniform(-7, -3))
    return Placed(Ellipsoid(rng.uniform(0.1, 0.6, 3)), rng.normal(size=3) * 0.3, q[0]), Placed(body, (0, 0, 0), q[1])


def large_margin(rng):
    r, way, q = 10 ** rng.uniform(-1, 1), rng.normal(size=3), turns(rng)
    at = way / np.linalg.norm(way) * (r + rng.uniform(-0.2, 0.3))
    body = RoundedHull(points(rng, rng.choice([4, 8, 20])) * 10 ** rng.uniform(-2, 0), r)
    return Placed(Ellipsoid(rng.uniform(0.1, 0.6, 3)), at, q[0]), Placed(body, (0, 0, 0), q[1])


def in_a_plane_of_symmetry(rng):
    at = np.array([(1, 1, 0), (1, 1, 1), (1, 0, 0)][rng.integers(3)]) * 0.25 * rng.uniform(0.5, 1.6)
    turn = (UNTURNED, (0, 0, np.sin(np.pi / 8), np.cos(np.pi / 8)))[rng.integers(2)]
    axes = [*rng.permutation([0.1, 0.2, 0.3])[:2], 0.15]
    return Placed(Ellipsoid(axes), at, turn), rounded_box(rng.choice([0.01, 0.05, 0.125]), half=np.full(3, 0.25))


def just_poking_out(rng):
    """Out of facets, edges or vertices, or just not."""
    r, more = rng.choice([0.01, 0.0625]), 1 + 10 ** rng.uniform(-7, -1) * rng.choice([1, -1])
    axes, at = (
        ((0.1, 0.08, (0.125 + r) * more), (0.02, 0.01, 0)),
        (np.array([0.1, 0.25 + 0.6 * r, 0.125 + 0.8 * r]) * more, (0, 0, 0)),
        ((HALF + r) * more, (0, 0, 0)),
    )[rng.integers(3)]
    return Placed(Ellipsoid(axes), at), rounded_box(r)


def shallow(rng):
    while True:
        a, b = at_random(rng)
        found = overlap(a, b)
        if found:
            moved = max(0.0, found.depth - 10 ** -rng.uniform(1, 7)) * found.normal
            a = Placed(a.shape, a.position + moved, a.orientation)
            if overlap(a, b):
                return a, b


KINDS = {
    make.__name__: make
    for make in (
        at_random,
        aligned,
        centre_on_the_surface,
        of_revolution,
        nearly_equal_axes,
        slender,
        thin_core,
        tiny_margin,
        large_margin,
        in_a_plane_of_symmetry,
        just_poking_out,
        shallow,
    )
}
ROWS = 40


def numbered(kind, number):
    return KINDS[kind](np.random.default_rng([list(KINDS).index(kind), number]))


def recorded():
    with SLICES.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            yield row["kind"], int(row["number"]), float(row["volume"]), float(row["error"])


@pytest.mark.parametrize("kind", KINDS)
def test_stated_errors_hold_against_recorded_slices(kind):
    rows = [row[1:] for row in recorded() if row[0] == kind]
    assert len(rows) >= ROWS / 2
    answered = 0
    for number, volume, error in rows:
        found = overlap(*numbered(kind, number))
        answered += found.way == "closed form"
        assert abs(found.volume - volume) <= found.volume_error + error, number
        assert found.way == "slicing" or found.volume_error <= 1e-12 * found.volume
    assert answered >= len(rows) / 3


# Margins, half sizes of boxes, half axes, turns of both, and volumes and errors by slices. Centres agree. Surfaces meet
# at small angles all along the line in which they cross.
NEARLY_TANGENT = [
    (0.5, (1, 1.2447906194840095e-06, 0.006862380488718443),
     (1.7983644964109975, 1.3913477526040021, 1.261338629814628),
     (0, 0.7071067811865475, 0, 0.7071067811865475), UNTURNED, 1.9453732133331003, 5.05e-13),
    (0.5, (1, 0.001157212636906448, 0.0001013653310226055), (2, 0.5, 0.5),
     (1, 1, 1, 1), (1, 1, 1, 1), 1.8621152443661588, 4.36e-13),
    (2775680.340818898, (0.5, 0.25, 0.5), (2775762.89000068, 2775691.9919824707, 2775642.751280174),
     UNTURNED, UNTURNED, 8.957663586408237e+19, 20300000),
    (519469.00795347814, (1, 0.003949530580834979, 0.0034799394292701195),
     (519355.8781106188, 519415.0034840787, 519520.6825446833),
     (0, 0.6, 0, 0.8), UNTURNED, 5.870265699230472e+17, 133000),
]  # fmt: skip


@pytest.mark.parametrize("case", NEARLY_TANGENT)
def test_where_surfaces_nearly_touch_all_along_a_line_errors_hold(case):
    r, half, axes, turn, turn_of_ellipsoid, volume, error = case
    found = overlap(rounded_box(r, turn=turn, half=half), Placed(Ellipsoid(axes), (0, 0, 0), turn_of_ellipsoid))
    assert abs(found.volume - volume) <= found.volume_error + error


@pytest.mark.parametrize("along", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("turn", TURNS)
def test_a_tip_on_the_axis_of_an_ellipsoid_of_revolution_crosses_in_a_circle(turn, along):
    """The circle around the tip lies in a plane across the axis."""
    tips = np.array([(0, 0, 3), (1, 0, 0), (0, 1, 0), (0, 0, -3), (-1, 0, 0), (0, -1, 0)], float)
    body, ellipsoid = RoundedHull(tips, 6.075), Ellipsoid([6.0377, 6.0377, 12.0754])
    found = overlap(Placed(body, (0, 0, 0), turn), Placed(ellipsoid, rotation(turn) @ [0, 0, along], turn))
    # Only spheres around both tips cross the ellipsoid: x² + y² by z, outside of each sphere.
    with mp.workdps(40):
        a, c, r = mpf(6.0377), mpf(12.0754), mpf(6.075)
        volume = 4 * mp.pi / 3 * a * a * c
        for tip in (3 - mpf(along), 3 + mpf(along)):
            # a² (1 − z²/c²) = r² − (z − tip)²
            p, q, s = 1 - a * a / (c * c), -2 * tip, a * a - r * r + tip * tip
            z = (-q + mp.sqrt(q * q - 4 * p * s)) / (2 * p)
            assert z > tip
            beyond = mp.quad(lambda x: a * a * (1 - x * x / (c * c)), [z, c])
            ball = mp.quad(lambda x, tip=tip: r * r - (x - tip) ** 2, [z, tip + r])
            volume -= mp.pi * (beyond - ball)
        assert abs(found.volume - volume) <= found.volume_error
    assert found.volume_error <= 1e-11 * found.volume


@pytest.mark.parametrize("kind", KINDS)
def test_volumes_lie_between_those_of_polytopes(kind):
    """With a third body around both, they are measured by planes."""
    for number in range(1000, 1004):
        a, b = numbered(kind, number)
        found = overlap(a, b)
        if found:
            rough = overlap(a, b, Box([100, 100, 100]), tolerance=1e-4)
            assert rough.way == "dual hull"
            assert abs(found.volume - rough.volume) <= found.volume_error + rough.volume_error, number


@pytest.mark.parametrize("far", [np.zeros(3), FAR])
@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("depth", [2.0**-4, 2.0**-8, 2.0**-12])
@pytest.mark.parametrize("r", [2.0**-10, 2.0**-4])
def test_over_a_face_there_is_a_cap(r, depth, turn, far):
    axes = [mpf(a) for a in (0.1875, 0.25, 0.15625)]
    x, y, z, w = (mpf(q) for q in turn)
    up = [2 * (x * z - y * w), 2 * (y * z + x * w), w * w + z * z - x * x - y * y]
    reach = mp.sqrt(sum((a * c) ** 2 for a, c in zip(axes, up))) / (x * x + y * y + z * z + w * w)
    at = np.array([0.0625, -0.03125, 0.125 + r + float(reach) - depth]) + far
    found = overlap(Placed(Ellipsoid([float(a) for a in axes]), at, turn), rounded_box(r, at=far))
    low = (0.125 + r - (mpf(at[2]) - mpf(far[2]) - reach)) / reach
    assert found.way == "closed form"
    if depth <= 2.0**-8:  # otherwise the ellipsoid reaches edges
        expected = axes[0] * axes[1] * axes[2] * mp.pi * low**2 * (3 - low) / 3
        assert abs(found.volume - expected) <= found.volume_error + 1e-14 * expected


@pytest.mark.parametrize("depth", [0.05, 0.01, 1e-3, 1e-4])
@pytest.mark.parametrize("seed", range(3))
def test_over_an_edge_and_its_ends_there_is_a_capsule(seed, depth):
    """A wedge whose facets are behind the capsule around its edge."""
    rng = np.random.default_rng([seed, round(-np.log10(depth))])
    r, length = 0.125, 0.25
    corners = [(0, 0, -length / 2), (0, 0, length / 2), (-1, 0.25, 0), (-1, -0.25, 0)]
    shape, turn = Ellipsoid(rng.uniform(0.1, 0.3, 3)), rng.normal(size=4)
    turn /= np.linalg.norm(turn)
    axes = rotation(turn)
    way = np.array([1, 0, rng.choice([0.0, 0.4])])
    way /= np.linalg.norm(way)
    own = shape.half_axes * (axes.T @ way)
    reach = axes @ (shape.half_axes * own) / np.linalg.norm(own)
    foot = np.array([0, 0, 0.03 if way[2] == 0 else length / 2])
    at = foot + (r - depth) * way + reach
    found = overlap(Placed(shape, at, turn), Placed(RoundedHull(corners, r)))
    exact = exact_volume(Pair(shape, at, turn, Capsule(r, length), np.zeros(3), UNTURNED), float(found.centroid[2]))
    assert abs(found.volume - exact) <= found.volume_error + 1e-15 * found.volume
    assert found.way == "closed form"


@pytest.mark.parametrize("far", [np.zeros(3), FAR])
def test_an_ellipsoid_inside_has_its_own_volume_and_a_hull_inside_has_steiners(far):
    rng = np.random.default_rng(1)
    for _ in range(20):
        body = RoundedHull(points(rng, 20), 10 ** rng.uniform(-3, -1))
        at, q = rng.normal(size=3) * 0.01, turns(rng)
        small = Ellipsoid([0.1, 0.08, 0.05])
        inside = overlap(Placed(small, at + far, q[0]), rounded_box(0.0625, at=far, turn=q[1]))
        assert inside.way == "closed form"
        assert inside.volume == pytest.approx(small.volume, rel=1e-14)
        around = overlap(Placed(Ellipsoid([1.5, 1.2, 1.3]), at + far, q[0]), Placed(body, far, q[1]))
        assert around.way == "closed form"
        assert around.volume == pytest.approx(body.volume, rel=1e-13)


@pytest.mark.parametrize("scale", [2.0**-30, 2.0**30])
def test_volumes_scale(scale):
    for kind in ("at_random", "slender"):
        for number in range(2000, 2010):
            a, b = numbered(kind, number)
            found = overlap(a, b)
            if not found:
                continue
            scaled = overlap(
                Placed(Ellipsoid(scale * a.shape.half_axes), scale * a.position, a.orientation),
                Placed(RoundedHull(scale * b.shape.core.vertices, scale * b.shape.radius), (0, 0, 0), b.orientation),
            )
            error = scaled.volume_error + scale**3 * found.volume_error
            assert abs(scaled.volume - scale**3 * found.volume) <= error, (kind, number)
            assert scaled.way == found.way, (kind, number)


def test_volumes_do_not_depend_on_the_order_of_bodies():
    for number in range(3000, 3020):
        a, b = numbered("at_random", number)
        assert overlap(a, b).volume == overlap(b, a).volume


def test_other_measures_agree_with_the_volume():
    first, then = (overlap(*numbered("at_random", 7)) for _ in range(2))
    volume = first.volume
    assert then.centroid.shape == (3,)
    assert (then.volume, then.volume_error, then.way) == (volume, first.volume_error, first.way)
