"""Measures from closed forms are right to rounding at any tolerance."""

from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import partial
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from strategies import quaternions, reach

from overlapper import Box, Capsule, Cylinder, HalfSpace, Hull, Placed, Sphere, overlap

ROUNDING = 1e-13
share = st.floats(-1, 1)
size = st.floats(0.05, 2)
SOLIDS = {
    "ball": lambda r, h: Sphere(r),
    "capsule": lambda r, h: Capsule(r, 2 * h),
    "cylinder": lambda r, h: Cylinder(r, 2 * h),
}


@st.composite
def cut_solids(draw):
    """A solid about the origin and a plane (normal, offset) through it: upright, level, nearly so, or anyhow."""
    solid = SOLIDS[draw(st.sampled_from(sorted(SOLIDS)))](draw(size), draw(size))
    tilt = draw(st.sampled_from([0, 1e-12, 1e-6, 1e-3, 0.1, 0.7, np.pi / 2 - 1e-9, np.pi / 2]))
    around = draw(st.floats(0, 2 * np.pi))
    normal = np.array([np.sin(tilt) * np.cos(around), np.sin(tilt) * np.sin(around), np.cos(tilt)])
    return solid, normal, draw(share) * reach(Placed(solid), normal)


@given(cut_solids())
def test_two_parts_make_the_whole(case):
    solid, normal, offset = case
    below, above = overlap(solid, HalfSpace(normal, offset)), overlap(solid, HalfSpace(-normal, -offset))
    assume(below and above)
    assert below.volume + above.volume == pytest.approx(solid.volume, rel=ROUNDING)
    moments = below.volume * below.centroid + above.volume * above.centroid
    assert_allclose(moments, 0, atol=ROUNDING * solid.volume * (solid.radius + np.max(np.abs(moments))))
    assert below.volume_error + above.volume_error <= 1e-12 * (solid.volume + below.area + above.area)


@given(cut_solids())
def test_volume_grows_by_the_area_of_the_cut(case):
    solid, normal, offset = case
    whole, step = reach(Placed(solid), normal), 1e-4 * solid.radius
    assume(abs(offset) < whole - 10 * step)
    volumes = [overlap(solid, HalfSpace(normal, offset + k * step)).volume for k in (-1, 0, 1)]
    here = overlap(solid, HalfSpace(normal, offset))
    slope = (volumes[2] - volumes[0]) / (2 * step)
    # The area of a section may have a kink, where the plane passes an end; it moves by less than this in a step.
    kink = 8 * step * (solid.radius + getattr(solid, "length", 0)) / max(0.02, np.sqrt(1 - (offset / whole) ** 2))
    if not isinstance(solid, Cylinder):
        assert here.gradient[1, :3] @ normal == pytest.approx(slope, abs=kink)
    assert_allclose(here.gradient[0] + here.gradient[1], 0, atol=1e-9 * (1 + np.abs(here.gradient).max()))


@given(cut_solids(), quaternions())
def test_a_closed_form_lies_within_the_bounds_of_a_polytope(case, turn):
    solid, normal, offset = case
    placed, plane = Placed(solid), HalfSpace(normal, offset)
    exact = overlap(placed, plane)
    assume(exact.volume > 1e-9 * solid.volume)
    # A box around everything makes three bodies of them, for which there is no closed form.
    around = Box([4 * (solid.radius + getattr(solid, "length", 0))] * 3)
    polytope = overlap(placed, plane, around, tolerance=1e-2)
    assert abs(exact.volume - polytope.volume) <= exact.volume_error + polytope.volume_error
    assert_allclose(exact.centroid, polytope.centroid, atol=0.1 * (solid.radius + getattr(solid, "length", 0)))
    moved = overlap(Placed(solid, (3, -2, 1), turn), Placed(plane, (3, -2, 1), turn))
    assert moved.volume == pytest.approx(exact.volume, rel=1e-9, abs=1e-12)


@given(size, size, st.floats(0, 1))
def test_lens_is_the_closed_form_at_any_tolerance(r, s, share_of_depth):
    distance = abs(r - s) + share_of_depth * (r + s - abs(r - s))
    lens = overlap(Sphere(r), Placed(Sphere(s), (0, distance, 0)), tolerance=0.5)
    assume(lens and distance > 1e-3)
    truth = np.pi * (r + s - distance) ** 2 * (distance**2 + 2 * distance * (r + s) - 3 * (r - s) ** 2)
    assert lens.volume == pytest.approx(truth / (12 * distance), rel=1e-9, abs=1e-12)
    assert lens.volume_error <= 1e-12 * (lens.volume + lens.area)


def test_ball_on_a_face_is_a_cap_and_on_an_edge_is_less():
    box = Box([1, 1, 1])
    on_face = overlap(Placed(Sphere(0.5), (0.2, -0.1, 1.4)), box)
    assert on_face.volume == pytest.approx(np.pi * 0.1**2 * (1.5 - 0.1) / 3, rel=1e-12)
    assert on_face.volume_error < 1e-14
    on_edge = overlap(Placed(Sphere(0.5), (0.9, 0, 1.4)), box)
    assert (on_face.way, on_edge.way) == ("closed form", "closed form")
    assert on_edge.volume < on_face.volume


def test_ends_of_two_capsules_share_a_lens_and_their_sides_do_not():
    end_on = overlap(Capsule(0.5, 1), Placed(Capsule(0.4, 1), (0.05, 0, 1.8)))
    distance = np.hypot(0.05, 0.8)
    lens = np.pi * (0.9 - distance) ** 2 * (distance**2 + 2 * distance * 0.9 - 3 * 0.1**2) / (12 * distance)
    assert end_on.volume == pytest.approx(lens, rel=1e-11)
    assert end_on.way == "closed form"
    assert overlap(Capsule(0.5, 1), Placed(Capsule(0.4, 1), (0.8, 0, 0))).way == "slicing"


def test_solid_inside_the_other_is_whole():
    for solid in (Sphere(0.5), Capsule(0.2, 0.4), Cylinder(0.3, 0.5)):
        inside = overlap(Placed(solid, (0.1, 0, 0)), Box([1, 1, 1]))
        assert inside.volume == pytest.approx(solid.volume, rel=1e-14)
        assert_allclose(inside.centroid, [0.1, 0, 0], atol=1e-15)
        assert_allclose(inside.gradient, 0, atol=1e-15)


def test_inertia_of_a_closed_form_is_that_of_the_round_shapes():
    ball = overlap(Sphere(1), HalfSpace([0, 0, 1], 2), tolerance=1e-3)
    assert ball.way == "closed form"
    assert_allclose(ball.inertia, 8 / 15 * np.pi * np.eye(3), rtol=1e-14, atol=1e-14)
    assert np.abs(ball.inertia - 8 / 15 * np.pi * np.eye(3)).max() <= ball.errors.inertia <= 1e-11 * ball.volume
    half = overlap(Sphere(1), HalfSpace([0, 0, 1], 0))
    # About the centre of the ball, half of its own.
    shift = half.volume * (9 / 64) * np.diag([1, 1, 0])
    assert_allclose(half.inertia + shift, 4 / 15 * np.pi * np.eye(3), rtol=1e-14, atol=1e-14)


def test_a_tolerance_that_no_polytope_reaches_leaves_the_closed_form_in_force():
    ball, ground = Placed(Sphere(0.5), (0, 0, 0.3)), HalfSpace((0, 0, 1), 0)
    usual, finest = (overlap(ball, ground, tolerance=tolerance) for tolerance in (1e-3, 1e-14))
    assert finest.facets_touched == 1
    assert (finest.volume, finest.volume_error) == (usual.volume, usual.volume_error)
    assert finest.volume_error > 1e-14 * finest.volume


@pytest.mark.parametrize("shape", [Cylinder, Capsule])
@pytest.mark.parametrize("sides", [(1, 1), (2, 1), (0.8, 2), (0.9, 1)])
def test_ends_in_the_plane_of_a_face_are_counted_once(shape, sides):
    rng = np.random.default_rng(4)
    for _ in range(60):
        (r, h), turn = rng.uniform(0.1, 2, 2), rng.integers(-4, 5, 4) / 2 + 0.25
        box = Placed(Box([sides[0] * r, sides[1] * r, h / 2]), (0, 0, 0), turn)
        answer = overlap(Placed(shape(r, h), (0, 0, 0), turn), box)
        cut = sum(np.arccos(side) - side * np.sqrt(1 - side**2) for side in sides if side < 1)
        truth = (np.pi - 2 * cut) * r**2 * h
        assert abs(answer.volume - truth) <= answer.volume_error + 1e-13 * truth


# Shallow contacts, where the terms of most formulas cancel. The truth is in sixty digits, by integrals over discs or
# rectangles. Numbers are such that doubles hold them: halves, quarters, and rotations whose quaternions are short.

DEPTHS = [10.0**-k for k in range(1, 11)]
mp: Any = mpmath.mp


def exactly(x: float) -> Any:
    return mpmath.mpf(x)


def cap(r: Any, h: Any) -> Any:
    return mp.pi * h * h * (3 * r - h) / 3


def lens(r: Any, s: Any, distance: Any) -> Any:
    return mp.pi * (r + s - distance) ** 2 * (distance**2 + 2 * distance * (r + s) - 3 * (r - s) ** 2) / (12 * distance)


def quadrant_of_disc(rho2: Any, p: Any, q: Any) -> Any:
    """The area of x >= p >= 0, y >= q >= 0 within a disc about the origin."""
    if p * p + q * q >= rho2:
        return mpmath.mpf(0)
    end = mp.sqrt(rho2 - q * q)
    rise = (end * q - p * mp.sqrt(rho2 - p * p)) / 2
    return rise + rho2 * (mp.asin(end / mp.sqrt(rho2)) - mp.asin(p / mp.sqrt(rho2))) / 2 - q * (end - p)


def over_edge(r: Any, p: Any, q: Any, low: Any = None) -> Any:
    """A ball whose centre is p and q away from two planes across each other, and `low` from a third, if any."""
    high = mp.sqrt(r * r - p * p - q * q)
    return mp.quad(lambda z: quadrant_of_disc(r * r - z * z, p, q), [-high if low is None else low, high])


def tilted_solid(r: Any, h: Any, sine: Any, cosine: Any, depth: Any, flat: bool) -> Any:
    """So much of a cylinder or a capsule is below a plane, its axis rising by `sine`, by slices along the axis."""
    lowest = (r * cosine if flat else r) + h * sine - depth  # of the centre over the plane

    def slice_at(x: Any) -> Any:
        across2 = r * r if abs(x) <= h else r * r - (abs(x) - h) ** 2
        rho, line = mp.sqrt(max(across2, mpmath.mpf(0))), (lowest + x * sine) / cosine
        if line >= rho:
            return mpmath.mpf(0)
        return rho * rho * mp.acos(line / rho) - line * mp.sqrt(rho * rho - line * line)

    if flat:
        last = min(h, (r * cosine - lowest) / sine) if sine else h
        return mp.quad(slice_at, [-h, last])
    # Beyond an end, slices are met between where the plane passes the ball's section by the plane of the axis.
    stops = {-h, h}
    for end in (-h, h):
        over = lowest + end * sine  # of the ball's centre
        if over < r:
            half = mp.sqrt(r * r - over * over)
            stops |= {end + side * half * cosine - over * sine for side in (-1, 1)}
    if sine and abs((r * cosine - lowest) / sine) < h:
        stops.add((r * cosine - lowest) / sine)
    return mp.quad(slice_at, [-h - r, *sorted(stops), h + r])


def shallow_pairs(depth: float) -> Iterator[tuple[str, Placed, Placed, Callable[[], Any]]]:
    box, half, ball = Placed(Box([1, 1, 1])), exactly(0.5), Sphere(0.5)
    place = 1.5 - depth
    deep = exactly(1.5) - exactly(place)
    yield "ball on ground", Placed(ball, (4, 2, place - 1)), HalfSpace([0, 0, 1], 0), lambda: cap(half, deep)
    yield "ball on face", Placed(ball, (0.25, place, 0.125)), box, lambda: cap(half, deep)
    yield "two balls", Placed(ball, (place, 0, 0)), Placed(Sphere(1)), lambda: lens(half, exactly(1), exactly(place))
    beside, edge, corner = 1 + depth / 4, 1 + (0.5 - depth) / 2**0.5, 1 + (0.5 - depth) / 3**0.5
    for name, (x, y) in {"on": (edge, edge), "beside": (beside, place)}.items():
        truth = partial(over_edge, half, exactly(x) - 1, exactly(y) - 1)
        yield f"ball {name} edge", Placed(ball, (x, 0.0625, y)), box, truth
    truth = partial(over_edge, half, *[exactly(corner) - 1] * 3)
    yield "ball on corner", Placed(ball, (corner, corner, corner)), box, truth
    for name, solid in {"capsule": Capsule(0.5, 2), "cylinder": Cylinder(0.5, 2)}.items():
        for tilt in (0.0, 2.0**-40, 2.0**-20, 2.0**-10, 2.0**-4, 0.5):
            yield f"{name} tilted by {tilt}", *tilted(solid, tilt, depth)


def tilted(solid: Any, tilt: float, depth: float) -> tuple[Placed, HalfSpace, Callable[[], Any]]:
    """On the ground, its axis along x but for a tilt: of a quarter turn, the tangent of its half is 1."""
    half, t = exactly(0.5), exactly(tilt / 2)
    sine, cosine = 2 * t / (1 + t * t), (1 - t * t) / (1 + t * t)
    down = sine + (half * cosine if isinstance(solid, Cylinder) else half)
    height = float(down - exactly(depth))
    placed = Placed(solid, (0, 0, height), (0, 1 - tilt / 2, 0, 1 + tilt / 2))
    truth = partial(tilted_solid, half, exactly(1), sine, cosine, down - exactly(height), isinstance(solid, Cylinder))
    return placed, HalfSpace([0, 0, 1], 0), truth


@pytest.mark.parametrize("depth", DEPTHS)
def test_shallow_contacts_keep_every_digit_of_a_closed_form(depth):
    wrong = []
    with mpmath.workdps(60):
        for name, a, b, truth_of in shallow_pairs(depth):
            answer, truth = overlap(a, b), truth_of()
            off = abs(exactly(answer.volume) - truth)
            if not (answer.way == "closed form" and off <= min(answer.volume_error, 1e-13 * truth)):
                wrong.append(f"{name}: {answer.way}, off by {float(off / truth):.1e}")
            if not answer.volume_error <= 1e-12 * truth:
                wrong.append(f"{name}: said {float(answer.volume_error / truth):.1e}")
    assert not wrong, wrong


def ball_at_side(r: Any, s: Any, distance: Any) -> Any:
    """Measures of the part common to a ball of radius s and a cylinder about z. Each slice is a lens of two discs."""

    def slice_at(z: Any) -> Any:
        q = mp.sqrt(s * s - z * z)
        x = (distance**2 + r * r - q * q) / (2 * distance)
        half = mp.sqrt(max(r * r - x * x, mpmath.mpf(0)))
        return r * r * mp.atan2(half, x) + q * q * mp.atan2(half, distance - x) - distance * half

    reach = mp.sqrt(s * s - (distance - r) ** 2)
    return 2 * mp.quad(slice_at, [0, reach])


def cylinders_crossing(r: Any, s: Any, distance: Any, sine: Any) -> Any:
    def slice_at(t: Any) -> Any:
        return 4 * mp.sqrt(max((r * r - t * t) * (s * s - (distance - t) ** 2), mpmath.mpf(0))) / sine

    return mp.quad(slice_at, [distance - s, r])


@pytest.mark.parametrize("depth", DEPTHS)
def test_shallow_contacts_at_sides_keep_every_digit(depth):
    radii, place = (0.5, 0.75), 1.25 - depth
    with mpmath.workdps(60):
        r, s, distance = exactly(0.5), exactly(0.75), exactly(place)
        ball = ball_at_side(r, s, distance), Placed(Sphere(0.75), (place, 0, 0.25))
        # The quaternion (3, 0, 0, 4) turns by twice the angle whose cotangent is 3 / 4: its sine is 24 / 25.
        other = [Placed(solid, (place, 0.125, 0.25), (3, 0, 0, 4)) for solid in (Capsule(0.75, 6), Cylinder(0.75, 6))]
        crossing = cylinders_crossing(r, s, distance, exactly(24) / 25)
        for solid in (Capsule(radii[0], 8), Cylinder(radii[0], 8)):
            for truth, placed in (ball, *((crossing, each) for each in other)):
                for answer in (overlap(solid, placed), overlap(placed, solid)):
                    off = abs(exactly(answer.volume) - truth)
                    assert off <= min(answer.volume_error, 1e-13 * truth), (solid, placed)
                    assert answer.volume_error <= 1e-12 * truth
                    # Towards each other they share more, as fast in either direction; across, nothing changes at first.
                    assert_allclose(answer.gradient[:, 1:3], 0, atol=1e-13)
                    assert_allclose(answer.gradient[0, :3] + answer.gradient[1, :3], 0, atol=1e-15)
            # The end of a capsule, whose axis is along x, is a ball.
            end = Placed(Capsule(0.75, 6), (place + 3, 0, 0.25), (0, 1, 0, 1))
            truth = ball_at_side(r, s, exactly(place + 3) - 3)
            for answer in (overlap(solid, end), overlap(end, solid)):
                assert abs(exactly(answer.volume) - truth) <= min(answer.volume_error, 1e-13 * truth)
                assert answer.volume_error <= 1e-12 * truth


@pytest.mark.parametrize("beside", [0, 1e-3, -1e-9])
@pytest.mark.parametrize("solid", [Capsule(0.3, 0.8), Cylinder(0.3, 0.8)])
def test_sections_of_a_ball_and_a_long_body_are_proved_where_they_touch_from_inside(solid, beside):
    """The section of one is within that of the other but for `beside`, at the end of the axis and far from it."""
    for radius, distance in ((0.5 + beside, 0.2), (0.2, 0.1 + beside), (0.35, 0.3 + beside), (0.3 + beside, 0.05)):
        for level in (0.1, 0.4 + beside):
            found = overlap(solid, Placed(Sphere(radius), (distance * 0.6, distance * 0.8, level)))
            lower, upper = found.certificate().verify()
            middle = (lower + upper) / 2
            assert found.way == "slicing"
            assert abs(middle - Fraction(found.volume)) <= found.volume_error <= 1e-12 * found.volume


@pytest.mark.parametrize("solid", [Sphere(0.75), Capsule(0.75, 6), Cylinder(0.75, 6)])
def test_gradients_at_sides_are_differences(solid):
    fixed, step = Cylinder(0.5, 8), 1e-5

    def at(out: float, angle: float = 0.7) -> Any:
        return overlap(fixed, Placed(solid, (out, 0.1, 0.2), (np.sin(angle / 2), 0, 0, np.cos(angle / 2))))

    here = at(1.2)
    slope = (at(1.2 + step).volume - at(1.2 - step).volume) / (2 * step)
    assert here.gradient[1, 0] == pytest.approx(slope, rel=1e-6)
    turned = (at(1.2, 0.7 + step).volume - at(1.2, 0.7 - step).volume) / (2 * step)
    assert here.gradient[1, 3] == pytest.approx(turned, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("solid", [Sphere(20), Capsule(20, 3), Cylinder(20, 30)])
@pytest.mark.parametrize("seed", range(6))
def test_a_needle_inside_a_round_body_has_its_own_volume(solid, seed):
    """Areas of a needle's faces cancel in all but their last digits, and their planes are high over the centre."""
    rng = np.random.default_rng(seed)
    needle = rng.normal(size=(4, 3)) * [1, 1e-5, 1e-6] @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    away = rng.normal(size=3) * [1, 1, 0.1]
    found = overlap(solid, Placed(Hull(needle), away / np.linalg.norm(away) * 14))
    a, b, c = ([Fraction(x) - Fraction(y) for x, y in zip(row, needle[0], strict=True)] for row in needle[1:])
    six_volumes = sum(a[i] * (b[i - 2] * c[i - 1] - b[i - 1] * c[i - 2]) for i in range(3))
    assert abs(abs(six_volumes) / 6 - Fraction(found.volume)) <= found.volume_error <= 1e-11 * found.volume
