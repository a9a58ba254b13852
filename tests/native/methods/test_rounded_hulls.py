"""Volumes of a rounded hull in a half-space, a box or a hull, by their surfaces.

The references are Steiner's formula, sums over two parts of a body, sections of a rounded box in closed form, and
certificates.
"""

import math
from fractions import Fraction

import numpy as np
import pytest
from rounded_shapes import CUBE_CORNERS, FLAT_TO_ROUNDING, points

from overlapper import Box, Capsule, HalfSpace, Hull, Placed, RoundedHull, Sphere, overlap

TURNS = [(0, 0, 0, 1), (0, 0, 1, 1), (1, 1, 1, 1), (0.1, 0.2, 0.3, 0.4), (1e-9, 0, 0, 1)]
FAR = np.array([1e6, -2e6, 0.5e6])


def drawn(rng):
    return RoundedHull(points(rng, rng.choice([4, 8, 20, 60])), 10 ** rng.uniform(-4, -0.7))


def flat_body(rng, kind):
    if kind == "half-space":
        return Placed(HalfSpace(rng.normal(size=3), rng.normal() * 0.2), rng.normal(size=3) * 0.1, rng.normal(size=4))
    shape = Box(rng.uniform(0.25, 0.5, 3)) if kind == "box" else Hull(points(rng, 20))
    return Placed(shape, rng.normal(size=3) * 0.1, rng.normal(size=4))


def pair(rng, kind, depth=None, far=None):
    """An overlapping pair; pulled apart to the depth, if one is given."""
    while True:
        a = Placed(drawn(rng), rng.normal(size=3) * 0.3, rng.normal(size=4))
        b = flat_body(rng, kind)
        found = overlap(a, b)
        if found and depth is not None:
            a = Placed(a.shape, a.position + max(0.0, found.depth - depth) * found.normal, a.orientation)
            found = overlap(a, b)
        if found and far is not None:
            a, b = (Placed(body.shape, body.position + far, body.orientation) for body in (a, b))
            found = overlap(a, b)
        if found:
            return found


def section_integral(half, r, height):
    """m³ of a box of these half extents, rounded by r, below z = height: areas of its sections, integrated."""
    a, b, c = half

    def beyond(t):  # from the middle of the rounding down to t above it
        # Area at t: 4 a b + 4 (a + b) s + π s², with s² = r² - t².
        chord = (t * math.sqrt(r * r - t * t) + r * r * math.asin(t / r)) / 2
        return 4 * a * b * t + 4 * (a + b) * chord + math.pi * (r * r * t - t**3 / 3)

    full = 4 * a * b + 4 * (a + b) * r + math.pi * r * r
    low = beyond(min(max(height + c, -r), 0.0)) - beyond(-r)
    middle = full * (min(max(height, -c), c) + c)
    return low + middle + beyond(min(max(height - c, 0.0), r))


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("r", [1e-3, 0.0625, 0.25])
@pytest.mark.parametrize("far", [np.zeros(3), FAR])
def test_a_rounded_box_below_planes_along_its_faces_is_the_integral_of_its_sections(turn, r, far):
    half = np.array([0.5, 0.25, 0.125])
    body = Placed(RoundedHull(CUBE_CORNERS * half, r), far, turn)
    for height in (-0.125 - r / 2, -0.125, -0.125 + r / 3, 0.0, 0.1, 0.125, 0.125 + r / 2):
        found = overlap(body, Placed(HalfSpace([0, 0, 1], height), far, turn))
        expected = section_integral(half, r, height)
        assert found.way == "closed form"
        assert abs(found.volume - expected) <= found.volume_error + 1e-14 * expected


@pytest.mark.parametrize("depth", [1e-3, 1e-5, 1e-7])
def test_a_face_on_a_plane_keeps_its_digits_at_any_depth(depth):
    half, r = np.array([0.5, 0.25, 0.125]), 0.0625
    body = RoundedHull(CUBE_CORNERS * half, r)
    found = overlap(body, HalfSpace([0, 0, 1], -0.125 - r + depth))
    d = (-0.125 - r + depth) + (0.125 + r)  # the doubles' own depth
    s = r - d
    # Below t = -s of the rounding, from cap, side and face, without terms that cancel.
    angle = math.acos(s / r)
    chord = (r * r * angle - s * math.sqrt(d * (2 * r - d))) / 2
    expected = 4 * 0.5 * 0.25 * d + 4 * 0.75 * chord + math.pi * d * d * (r - d / 3)
    assert found.volume == pytest.approx(expected, rel=2e-9 if depth < 1e-6 else 1e-10)
    lower, upper = found.certificate().verify()
    assert float(lower) - found.volume_error <= found.volume <= float(upper) + found.volume_error


@pytest.mark.parametrize("kind", ["box", "hull"])
def test_a_body_wholly_inside_has_steiners_volume(kind):
    rng = np.random.default_rng(1)
    for _ in range(20):
        body = drawn(rng)
        shape = Box([2, 2, 2]) if kind == "box" else Hull(CUBE_CORNERS * 2)
        found = overlap(Placed(body, rng.normal(size=3) * 0.1, rng.normal(size=4)), Placed(shape, (0, 0, 0)))
        assert found.way == "closed form"
        assert found.volume == pytest.approx(body.volume, rel=1e-14)


def test_the_parts_on_both_sides_of_a_plane_add_up():
    rng = np.random.default_rng(2)
    for _ in range(200):
        body = Placed(drawn(rng), rng.normal(size=3), rng.normal(size=4))
        normal = rng.normal(size=3)
        offset = body.position @ normal + rng.normal() * 0.2 * np.linalg.norm(normal)
        sides = overlap(body, HalfSpace(normal, offset)), overlap(body, HalfSpace(-normal, -offset))
        total = sum(side.volume for side in sides)
        error = sum(side.volume_error for side in sides) + 1e-14 * body.shape.volume
        assert abs(total - body.shape.volume) <= error


@pytest.mark.parametrize("kind", ["box", "hull"])
def test_the_parts_of_a_cut_body_add_up(kind):
    rng = np.random.default_rng(3)
    ways = []
    for _ in range(60):
        body = Placed(drawn(rng), rng.normal(size=3) * 0.3, rng.normal(size=4))
        turn, at, half = rng.normal(size=4), rng.normal(size=3) * 0.1, rng.uniform(0.25, 0.5, 3)
        if kind == "box":
            cut = rng.uniform(-0.8, 0.8) * half[0]
            corners = CUBE_CORNERS * half
            parts = [corners.copy(), corners.copy()]
            for part, side in zip(parts, (1, -1)):
                part[CUBE_CORNERS[:, 0] == side, 0] = cut
            whole, halves = Box(half), [Hull(part) for part in parts]
        else:
            # A pyramid on each side of a rectangle.
            base = np.array([[-1, -1, 0], [-1, 1, 0], [1, -1, 0], [1, 1, 0]]) * half
            up, down = [0.1, 0.05, half[2]], [0.1, 0.05, -half[2]]
            halves = [Hull([*base, up]), Hull([*base, down])]
            whole = Hull([*base, up, down])
        found = [overlap(body, Placed(shape, at, turn)) for shape in (whole, *halves)]
        ways += [one.way for one in found if one]
        error = sum(one.volume_error for one in found) + 1e-14
        assert abs(found[0].volume - found[1].volume - found[2].volume) <= error
    assert ways.count("closed form") > len(ways) / 2


@pytest.mark.parametrize("kind", ["half-space", "box", "hull"])
@pytest.mark.parametrize("far", [None, FAR])
def test_stated_errors_hold_against_certificates(kind, far):
    rng = np.random.default_rng(4)
    for number in range(12):
        depth = None if number % 2 else 10 ** -rng.uniform(1, 6)
        found = pair(rng, kind, depth, far)
        lower, upper = found.certificate().verify()
        assert float(lower) - found.volume_error <= found.volume <= float(upper) + found.volume_error


def test_stated_errors_hold_below_a_plane_far_from_its_origin():
    rng = np.random.default_rng(8)
    for number in range(12):
        normal = np.array([3.0, 2.0, 1.0]) if number % 2 else rng.normal(size=3)
        body = Placed(drawn(rng), normal / np.linalg.norm(normal) * 1e6, rng.normal(size=4))
        offset = float(body.position @ normal) + 0.2 * rng.normal() * np.linalg.norm(normal)
        found = overlap(body, HalfSpace(normal, offset))
        if found:
            shallow = overlap(body, HalfSpace(normal, offset - (found.depth - 1e-4) * np.linalg.norm(normal)))
            for one in (found, shallow):
                lower, upper = one.certificate().verify()
                assert float(lower) - one.volume_error <= one.volume <= float(upper) + one.volume_error


@pytest.mark.parametrize("kind", ["half-space", "box", "hull"])
def test_deep_contacts_have_a_closed_form(kind):
    rng = np.random.default_rng(5)
    deep = [found for found in (pair(rng, kind) for _ in range(60)) if found.depth > 0.1]
    assert len(deep) > 20
    assert {found.way for found in deep} == {"closed form"}
    assert all(found.volume_error <= 1e-12 * found.volume for found in deep)


@pytest.mark.parametrize("kind", ["box", "hull"])
@pytest.mark.parametrize("depth", [1e-2, 1e-4, 1e-6])
def test_shallow_contacts_have_a_closed_form_that_certificates_prove(kind, depth):
    rng = np.random.default_rng(17)
    ways = []
    for _ in range(6):
        found = pair(rng, kind, depth)
        ways.append(found.way)
        least, most = found.certificate().verify()
        assert least - Fraction(found.volume_error) <= Fraction(found.volume) <= most + Fraction(found.volume_error)
    assert ways.count("closed form") >= 5


@pytest.mark.parametrize("kind", ["box", "hull"])
@pytest.mark.parametrize("depth", [1e-3, 1e-5])
def test_shallow_capsules_have_a_closed_form_that_certificates_prove(kind, depth):
    rng = np.random.default_rng(19)
    ways = []
    for _ in range(6):
        capsule = Capsule(rng.uniform(0.1, 0.4), rng.uniform(0.4, 1.0))
        a, b = Placed(capsule, rng.normal(size=3) * 0.3, rng.normal(size=4)), flat_body(rng, kind)
        found = overlap(a, b)
        if not found:
            continue
        found = overlap(Placed(capsule, a.position + (found.depth - depth) * found.normal, a.orientation), b)
        ways.append(found.way)
        least, most = found.certificate().verify()
        assert least - Fraction(found.volume_error) <= Fraction(found.volume) <= most + Fraction(found.volume_error)
    assert ways.count("closed form") >= len(ways) - 1 > 2


def test_a_huge_radius_around_a_small_core_agrees_with_the_certificate():
    """The apex is almost on the axis of a band, where the angle of its direction has few digits."""
    core = np.array([(0, 0, 3), (1, 0, 0), (0, 2, 0), (0, 0, -3), (0, -2, 0), (-1, 0, 0)])
    r, turn = 32889971.033252977, (-0.71390674604165949, 0.34653449558074734, 0.49169519125232752, 0.35845061058414091)
    found = overlap(Placed(RoundedHull(core, r), (0, 0, 0), turn), Box((r, r, r)))
    least, most = found.certificate().verify()
    assert least - Fraction(found.volume_error) <= Fraction(found.volume) <= most + Fraction(found.volume_error)


def test_aligned_and_flush_bodies_agree_with_certificates():
    r = 0.0625
    body = RoundedHull(CUBE_CORNERS * [0.5, 0.25, 0.125], r)
    for at in ([0, 0, 0.5], [0.5, 0.25, 0.125], [0.75, 0, 0], [0.5 + r, 0, 0], [0.3, 0.2, 0.1], [0, 0, 0]):
        for turn in TURNS:
            for box in (Box([0.5, 0.5, 0.5]), Box([0.5, 0.25, 0.3]), Box([0.5 + r, 0.25 + r, 0.125 + r])):
                found = overlap(Placed(body, at, turn), Placed(box, (0, 0, 0)))
                if not found:
                    continue
                lower, upper = found.certificate().verify()
                assert float(lower) - found.volume_error <= found.volume <= float(upper) + found.volume_error


def test_other_measures_agree_with_the_volume():
    rng = np.random.default_rng(6)
    for kind in ("half-space", "box", "hull"):
        first, then = (pair(np.random.default_rng(7), kind) for _ in range(2))
        volume = first.volume
        assert then.centroid.shape == (3,)
        assert (then.volume, then.volume_error, then.way) == (volume, first.volume_error, first.way)
        found = pair(rng, kind)
        assert found.errors.volume == found.volume_error


def test_points_far_from_the_origin_of_their_body_keep_their_digits():
    """The body's position takes its points back to the plane."""
    rng = np.random.default_rng(17)
    for _ in range(20):
        near = np.round(rng.normal(size=(8, 3)) * 2**20) / 2**20
        far = np.round(rng.normal(size=3) * 2**45) / 2**25
        plane = HalfSpace(rng.normal(size=3), 0.1)
        expected = overlap(RoundedHull(near, 0.125), plane)
        # Neither sum nor difference rounds. The origin of the hull's data plus the position does.
        found = overlap(Placed(RoundedHull(near + far, 0.125), -far), plane)
        assert abs(found.volume - expected.volume) <= found.volume_error + expected.volume_error


@pytest.mark.parametrize("thin", [1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("radius", [0.1, 0.5, 1.2])
@pytest.mark.parametrize(
    "other",
    [
        Placed(HalfSpace((0.98, 0.076, -0.18), 0.04)),
        Placed(Box((0.5, 0.6, 0.7)), (0.3, 0.4, 0.5), (0.1, 0.2, 0.3, 0.9)),
        Placed(Hull(points(np.random.default_rng(1), 12) * 3)),
    ],
    ids=["half-space", "box", "hull"],
)
def test_thin_cores_whose_normals_are_nearly_opposite(thin, radius, other):
    core = [[0, 1, 0], [0, 0, 1], [thin, 0, 0], [0, 0, 0]]
    found = overlap(RoundedHull(core, radius), other)
    lower, upper = found.certificate().verify()
    assert lower - found.volume_error <= found.volume <= upper + found.volume_error
    assert found.volume_error <= 1e-12 * found.volume


@pytest.mark.parametrize("seed", [1, 2, 8, 9, 38])
def test_thin_cores_across_thin_plates(seed):
    """Pieces at the edges of the core are needles, far from the axes of their cylinders relative to their width."""
    for found in (overlap(*crossing_plates(seed)), overlap(*crossing_plates(seed), Placed(Sphere(40)))):
        lower, upper = found.certificate().verify()
        assert lower - Fraction(found.volume_error) <= Fraction(found.volume) <= upper + Fraction(found.volume_error)
        assert found.volume_error <= 1e-11 * found.volume


@pytest.mark.parametrize("seed", [86, 135])
def test_a_body_around_thin_cores_across_thin_plates(seed):
    for around in (Placed(Sphere(40)), HalfSpace([0, 0, 1], 30)):
        pair, found = overlap(*crossing_plates(seed)), overlap(*crossing_plates(seed), around)
        assert abs(pair.volume - found.volume) <= pair.volume_error + found.volume_error


@pytest.mark.parametrize("seed", [52, 142, 167, 174, 256])
def test_ends_of_thin_rods_far_from_the_point_that_pieces_are_placed_about(seed):
    """Faces at the ends of pieces are no farther than these ends, but for the rounding of their places."""
    rng = np.random.default_rng(seed)
    turn = rng.normal(size=4)
    rod = Placed(RoundedHull(CUBE_CORNERS * [1, 3e-6, 5e-6], 2e-5), (0, 0, 0), turn)
    other = Placed(RoundedHull(CUBE_CORNERS * [1, 8e-4, 6e-5], 1e-7), 1e-6 * rng.normal(size=3), turn)
    found = overlap(rod, other)
    lower, upper = found.certificate().verify()
    assert lower - Fraction(found.volume_error) <= Fraction(found.volume) <= upper + Fraction(found.volume_error)


def crossing_plates(seed):
    rng = np.random.default_rng(seed)
    at = rng.normal(size=3)
    plate = rng.normal(size=(rng.integers(4, 9), 3)) * [1, 1, 10 ** rng.uniform(-8, -6)]
    core = rng.normal(size=(rng.integers(4, 9), 3)) * [1, 1, 10 ** rng.uniform(-6, -3)]
    turn = rng.normal(size=4)
    thin = Placed(RoundedHull(core, rng.uniform(0.2, 1)), at, turn)
    return thin, Placed(Hull(plate), at + 0.1 * rng.normal(size=3), turn + 0.1 * rng.normal(size=4))


def test_a_core_that_is_flat_to_rounding_keeps_corners_where_only_two_facets_meet():
    """Between top and bottom, such a corner may be far from the line of its neighbours."""
    assert len(Hull(FLAT_TO_ROUNDING).vertices) == 6
    found = overlap(RoundedHull(FLAT_TO_ROUNDING, 4.745431674454119), HalfSpace([0, 1, 0], -35.5782))
    lower, upper = found.certificate().verify()
    assert lower - Fraction(found.volume_error) <= Fraction(found.volume) <= upper + Fraction(found.volume_error)
