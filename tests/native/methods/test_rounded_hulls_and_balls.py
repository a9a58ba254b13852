"""Volumes of a rounded hull in a ball, by the surface of the rounded hull.

The references are caps and lenses in 40 digits, sections integrated in 40 digits, Steiner's formula, slices of the pair
with a third body around both, and certificates.
"""

from fractions import Fraction

import numpy as np
import pytest
from mpmath import mp, mpf
from rounded_shapes import CUBE_CORNERS, HALF, cap, lens, points, rounded_box, within

from overlapper import HalfSpace, Placed, RoundedHull, Sphere, overlap

TURNS = [(0, 0, 0, 1), (0, 0, 1, 1), (1, 1, 1, 1), (0, 0.6, 0, 0.8)]
FAR = np.array([2.0**20, -(2.0**21), 2.0**19])
DEPTHS = [2.0**-4, 2.0**-8, 2.0**-16, 2.0**-24]
BALL = 0.375


@pytest.fixture(autouse=True)
def digits():
    with mp.workdps(40):
        yield


def pair(rng, depth=None, far=0.0):
    """A rounded hull and a ball that overlap; pulled apart to the depth, if one is given."""
    while True:
        body = RoundedHull(points(rng, rng.choice([4, 8, 20, 60])), 10 ** rng.uniform(-4, -0.7))
        a = Placed(Sphere(rng.uniform(0.2, 0.7)), rng.normal(size=3) * 0.4)
        b = Placed(body, (0, 0, 0), rng.normal(size=4))
        found = overlap(a, b)
        if found and depth is not None:
            a = Placed(a.shape, a.position + max(0.0, found.depth - depth) * found.normal)
            found = overlap(a, b)
        if found:
            return Placed(a.shape, a.position + far), Placed(body, b.position + far, b.orientation)


def common_disc(a, b, apart):
    """m² of two discs."""
    if apart >= a + b:
        return mpf(0)
    if apart <= abs(a - b):
        return mp.pi * min(a, b) ** 2
    x = (apart**2 + a**2 - b**2) / (2 * apart)
    return (
        a**2 * mp.acos(x / a) - x * mp.sqrt(a**2 - x**2) + b**2 * mp.acos((apart - x) / b)
        - (apart - x) * mp.sqrt(b**2 - (apart - x) ** 2)
    )  # fmt: skip


@pytest.mark.parametrize("depth", DEPTHS)
@pytest.mark.parametrize("r", [2.0**-10, 2.0**-4])
@pytest.mark.parametrize("far", [np.zeros(3), FAR])
def test_over_a_face_there_is_a_cap(depth, r, far):
    at = np.array([0.0625, -0.03125, 0.125 + r + BALL - depth])
    found = overlap(Placed(Sphere(BALL), at + far), rounded_box(r, far))
    lost = 0.125 + r + mpf(BALL) - (mpf((at + far)[2]) - mpf(far[2]))
    assert found.way == "closed form"
    if depth < 2.0**-5:  # otherwise the ball reaches edges
        assert within(found, cap(mpf(BALL), lost))
    assert found.volume_error <= 1e-12 * found.volume


@pytest.mark.parametrize("depth", DEPTHS[1:])
@pytest.mark.parametrize("turn", TURNS)
def test_over_a_corner_there_is_a_lens_of_two_balls(depth, turn):
    r = 2.0**-4
    at = HALF + np.array([6, 6, 7]) / 11 * (r + BALL - depth)
    found = overlap(Placed(Sphere(BALL), at), rounded_box(r))
    apart = mp.sqrt(sum((mpf(x) - mpf(y)) ** 2 for x, y in zip(at, HALF)))
    assert found.way == "closed form"
    assert within(found, lens(mpf(BALL), mpf(r), apart))
    # Turned about the corner, nothing changes but rounding.
    turned = Placed(RoundedHull((CUBE_CORNERS - 1) * HALF, r), (0, 0, 0), turn)
    axis, w = np.array(turn[:3]) / np.linalg.norm(turn), turn[3] / np.linalg.norm(turn)
    direction = np.array([6, 6, 7]) / 11
    direction = direction + 2 * np.cross(axis, np.cross(axis, direction) + w * direction)
    ball = Placed(Sphere(BALL), direction * (r + BALL - depth))
    found = overlap(ball, turned)
    apart = mp.sqrt(sum(mpf(x) ** 2 for x in ball.position))
    assert found.way == "closed form"
    assert within(found, lens(mpf(BALL), mpf(r), apart))


@pytest.mark.parametrize("depth", DEPTHS[1:])
def test_over_an_edge_sections_are_common_parts_of_two_discs(depth):
    r = 2.0**-4
    at = np.array([0.0625, 0.25, 0.125]) + np.array([0, 3, 4]) / 5 * (r + BALL - depth)
    found = overlap(Placed(Sphere(BALL), at), rounded_box(r))
    apart = mp.sqrt((mpf(at[1]) - 0.25) ** 2 + (mpf(at[2]) - 0.125) ** 2)
    reach = mp.sqrt(mpf(BALL) ** 2 - (apart - r) ** 2)

    def section(angle):
        t = reach * mp.sin(angle)
        return common_disc(mp.sqrt(mpf(BALL) ** 2 - t**2), mpf(r), apart) * reach * mp.cos(angle)

    assert found.way == "closed form"
    assert within(found, 2 * mp.quad(section, [0, mp.pi / 4, mp.pi / 2]))


@pytest.mark.parametrize("depth", DEPTHS[1:])
@pytest.mark.parametrize("share", [0.9, 0.25, 0.0, -0.25])
def test_over_a_face_and_an_edge_sections_are_segments(depth, share):
    """The foot of the centre is inside the face, by that share of the cap's radius, or outside."""
    r = 2.0**-4
    ball = mpf(BALL)
    at = np.array([0.0625, 0.25 - share * np.sqrt(2 * BALL * depth), 0.125 + r + BALL - depth])
    found = overlap(Placed(Sphere(BALL), at), rounded_box(r))
    inwards, height = mpf(0.25) - mpf(at[1]), mpf(at[2]) - 0.125 - r

    def surface(u):  # of the rounded hull, at u from the edge into the face
        return mpf(0) if u >= 0 else -mpf(r) + mp.sqrt(max(mpf(0), mpf(r) ** 2 - u**2))

    def section(u):
        square = ball**2 - (u - inwards) ** 2
        if square <= 0:
            return mpf(0)
        over = height - surface(u)
        return (
            square * mp.acos(over / mp.sqrt(square)) - over * mp.sqrt(square - over**2) if square > over**2 else mpf(0)
        )

    def end(side, low, high):  # where the section vanishes, by bisection
        for _ in range(140):
            middle = (low + high) / 2
            gone = ball**2 - (middle - inwards) ** 2 <= (height - surface(middle)) ** 2
            low, high = (low, middle) if gone == (side > 0) else (middle, high)
        return middle

    deepest = max((mpf(0), inwards) if inwards > 0 else (inwards * r / (r + ball),), key=section)
    low = end(-1, -mpf(r), min(deepest, mpf(0)))
    high = end(1, max(deepest, mpf(0)), inwards + ball) if section(mpf(0)) > 0 else end(1, deepest, mpf(0))

    def part(a, b):
        def f(angle):
            return section((a + b) / 2 - (b - a) / 2 * mp.cos(angle)) * (b - a) / 2 * mp.sin(angle)

        return mp.quad(f, [0, mp.pi / 4, mp.pi / 2, 3 * mp.pi / 4, mp.pi])

    expected = part(low, mpf(0)) + part(mpf(0), high) if high > 0 else part(low, high)
    assert within(found, expected)


@pytest.mark.parametrize("far", [np.zeros(3), FAR])
def test_a_ball_inside_has_its_own_volume_and_a_hull_inside_has_steiners(far):
    rng = np.random.default_rng(1)
    for _ in range(20):
        body = RoundedHull(points(rng, 20), 10 ** rng.uniform(-3, -1))
        turn, at = rng.normal(size=4), rng.normal(size=3) * 0.01
        small = overlap(Placed(Sphere(0.1), at + far), rounded_box(0.0625, far, turn))
        assert small.way == "closed form"
        assert small.volume == pytest.approx(4 / 3 * np.pi * 0.1**3, rel=1e-14)
        large = overlap(Placed(Sphere(1.5), at + far), Placed(body, far, turn))
        assert large.way == "closed form"
        assert large.volume == pytest.approx(body.volume, rel=1e-14)


@pytest.mark.parametrize("beyond", [0.0, 2.0**-30, -(2.0**-30)])
def test_a_ball_that_touches_the_surface_from_inside_has_its_own_volume(beyond):
    r, ball = 2.0**-4, 0.1875 - 2.0**-6
    for at in ([0, 0, 0.125 + r - ball + beyond], [0.5 + r - ball + beyond, 0.0625, 0]):
        found = overlap(Placed(Sphere(ball), at), rounded_box(r))
        outside = cap(mpf(ball), mpf(max(beyond, 0.0)))
        assert within(found, 4 * mp.pi * mpf(ball) ** 3 / 3 - outside)


@pytest.mark.parametrize("far", [np.zeros(3), FAR])
def test_stated_errors_hold_against_slices_of_the_pair_with_a_body_around_both(far):
    rng = np.random.default_rng(2)
    for number in range(60):
        a, b = pair(rng, 10 ** -rng.uniform(1, 6) if number % 2 else None, far)
        found, sliced = overlap(a, b), overlap(a, b, Placed(HalfSpace([0, 0, 1], 10), far))
        assert sliced.way == "slicing"
        assert abs(found.volume - sliced.volume) <= found.volume_error + sliced.volume_error


@pytest.mark.parametrize("far", [np.zeros(3), FAR])
def test_stated_errors_hold_against_certificates(far):
    rng = np.random.default_rng(3)
    for number in range(10):
        found = overlap(*pair(rng, 10 ** -rng.uniform(1, 6) if number % 2 else None, far))
        lower, upper = found.certificate().verify()
        assert float(lower) - found.volume_error <= found.volume <= float(upper) + found.volume_error


def test_nearly_all_contacts_have_a_closed_form():
    rng = np.random.default_rng(4)
    found = [overlap(*pair(rng, 10 ** -rng.uniform(1, 6) if number % 2 else None)) for number in range(200)]
    assert sum(one.way == "closed form" for one in found) >= 190
    assert all(one.volume_error <= 1e-12 * one.volume for one in found if one.way == "closed form")


def test_aligned_places_agree_with_slices():
    r = 0.0625
    for at in (
        [0, 0, 0],
        [0, 0, 0.125],
        [0, 0, 0.1875],
        [0.5, 0.25, 0.125],
        [0.5, 0.25, 0.25],
        [0.5, 0, 0],
        [0, 0.3, 0.2],
    ):
        for ball in (0.03125, 0.1875, 0.25, 0.5):
            for turn in TURNS:
                a, b = Placed(Sphere(ball), at), rounded_box(r, turn=turn)
                found = overlap(a, b)
                if found:
                    sliced = overlap(a, b, HalfSpace([0, 0, 1], 10))
                    assert abs(found.volume - sliced.volume) <= found.volume_error + sliced.volume_error


def test_other_measures_agree_with_the_volume():
    first, then = (overlap(*pair(np.random.default_rng(5))) for _ in range(2))
    volume = first.volume
    assert then.centroid.shape == (3,)
    assert (then.volume, then.volume_error, then.way) == (volume, first.volume_error, first.way)


AROUND = HalfSpace([0.36, 0.48, 0.8], 100)  # holds all bodies: with it, a pair is sliced


def rotated(turn, point):
    axis, w = np.array(turn[:3], float), turn[3]
    twice = 2 * np.cross(axis, point)
    return point + (w * twice + np.cross(axis, twice)) / (axis @ axis + w * w)


def agrees_with_slices(body, ball, around=AROUND):
    found, sliced = overlap(body, ball), overlap(body, ball, around)
    assert abs(found.volume - sliced.volume) <= found.volume_error + sliced.volume_error


@pytest.mark.parametrize(
    "centre",
    [
        (0.0, 0.25, 0.0),  # in the plane of a face
        (0.1, 0.25, 0.125),  # on an edge
        (0.75, 0.25, 0.125),  # on the line of an edge
        (0.5, 0.25, 0.125),  # at a corner
        (0.5 + 2.0**-53, 0.25 - 2.0**-54, 0.125),
        (0.5 + 1e-13, 0.25, 0.125 - 1e-13),
        (0.0, 0.25 + 2.0**-4, 0.0),  # on the surface
        (0.0, 0.0, 0.125 + 2.0**-4),
    ],
)
@pytest.mark.parametrize("radius", [2.0**-7, 0.2, 0.3, 0.7])
@pytest.mark.parametrize("turn", TURNS)
def test_centres_on_planes_edges_and_corners(centre, radius, turn):
    agrees_with_slices(rounded_box(2.0**-4, turn=turn), Placed(Sphere(radius), rotated(turn, np.array(centre))))


@pytest.mark.parametrize("radius", [0.6283786413514381, 1.25])
@pytest.mark.parametrize("centre", [(0, 0.7567572827028762, 0), (0, 1.5, 0), (1.25, 0, 0), (0, 0, -0.4)])
def test_centres_on_lines_of_edges_of_a_simplex(radius, centre):
    simplex = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]]
    agrees_with_slices(Placed(RoundedHull(simplex, 0.5)), Placed(Sphere(radius), centre))


@pytest.mark.parametrize("radius", [2.0**-4, 2.0, 52.0])
@pytest.mark.parametrize("above", [1e-14, 1e-12, 1e-10])
def test_facets_that_are_nearly_one_plane(radius, above):
    corners = np.vstack([CUBE_CORNERS, CUBE_CORNERS * [0.5, 0.5, 1 + above]])
    for centre in [(0, 0, 1.0), (0.5, 0.5, 1.25), (0.25, 1, 1), (1, 1, 1), (0.1, 0.2, 1 + radius)]:
        agrees_with_slices(Placed(RoundedHull(corners, 0.25)), Placed(Sphere(radius), centre))


@pytest.mark.parametrize("seed", range(20))
def test_centres_far_along_a_normal_of_a_small_core(seed):
    """The directions from its corners to the centre are nearly the normal of a facet."""
    rng = np.random.default_rng(seed)
    body = RoundedHull(points(rng, 30), 1e7)
    ring = np.array(body.core.vertices)[list(body.core.facets[seed])]
    normal = np.cross(ring[1] - ring[0], ring[2] - ring[0])
    centre = ring.mean(0) + 0.1 * rng.normal(size=3) + 6e7 * normal / np.linalg.norm(normal)
    agrees_with_slices(body, Placed(Sphere(6e7), centre), HalfSpace([0, 0, 1], 1e9))


@pytest.mark.parametrize("far", [0.0, 1e6, 1e9])
@pytest.mark.parametrize("origin", [0.0, 1e6])
@pytest.mark.parametrize("seed", range(4))
def test_slices_of_a_ball_on_a_core_that_is_far_from_its_origin(far, origin, seed):
    """The ball touches the core, so that the surface is nearer to the ball's far side than its place is known."""
    rng = np.random.default_rng(seed)
    turned = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    away, foot = np.round(origin * rng.normal(size=3), 3), np.array([0.3, -0.2, 1.0])
    body = Placed(RoundedHull(CUBE_CORNERS @ turned + away, 0.43), np.round(far * rng.normal(size=3)))
    ball = Placed(Sphere(0.223), np.array(body.position) + away + (foot + [0, 0, 0.223]) @ turned)
    agrees_with_slices(body, ball, HalfSpace([0, 0, 1], 1e11))
    assert np.linalg.norm(overlap(body, ball).gradient[0]) > 0


def closed_form_agrees_with_a_certificate(body, ball):
    found = overlap(body, ball)
    lower, upper = found.certificate().verify()
    assert found.way == "closed form"
    assert found.volume_error <= 1e-12 * found.volume
    assert lower - Fraction(found.volume_error) <= Fraction(found.volume) <= upper + Fraction(found.volume_error)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("thin", [1e-6, 1e-3])
@pytest.mark.parametrize("beside", [1e-12, 1e-9])
def test_centres_beside_a_corner_of_a_core(seed, thin, beside):
    """With equal radii, the sphere around the corner and the ball cross in a great circle, nearly."""
    rng = np.random.default_rng(seed)
    corners = CUBE_CORNERS * [1, 1, thin]
    ball = Placed(Sphere(1.5), corners[seed] + beside * rng.normal(size=3))
    closed_form_agrees_with_a_certificate(Placed(RoundedHull(corners, 1.5)), ball)


@pytest.mark.parametrize("turn", TURNS[1:3])
@pytest.mark.parametrize("radius", [1e-9, 1e-6])
@pytest.mark.parametrize("at", [(0.3, 1, 1), (1, 1, 1)])
def test_tiny_balls_and_margins_at_a_large_core(turn, radius, at):
    """The centre is near an edge or a corner, far from the ends of the edges relative to the radii."""
    rng = np.random.default_rng(8)
    for _ in range(3):
        centre = at + radius * rng.uniform(-0.5, 0.5, 3)
        ball = Placed(Sphere(radius * rng.uniform(0.5, 1)), rotated(turn, centre))
        closed_form_agrees_with_a_certificate(Placed(RoundedHull(CUBE_CORNERS, radius), (0, 0, 0), turn), ball)


@pytest.mark.parametrize("depth", [1e-5, 1e-9])
@pytest.mark.parametrize(("margin", "radius"), [(1e-7, 2.5), (1e-3, 2.5), (1e-3, 250.0)])
def test_shallow_contacts_at_the_border_of_a_facet(depth, margin, radius):
    """The side of the facet passes the foot of the centre at a distance that is small relative to the ball."""
    rng = np.random.default_rng(9)
    body = RoundedHull(CUBE_CORNERS, margin)
    for _ in range(3):
        beside = rng.uniform(-1, 1) * np.sqrt(min(margin, radius) * depth)
        ball = Placed(Sphere(radius), (1 + beside, 0.3, 1 + margin + radius - depth))
        closed_form_agrees_with_a_certificate(Placed(body), ball)
