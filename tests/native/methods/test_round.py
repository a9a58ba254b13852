"""Round bodies are measured to a trillionth at any depth: closed forms, rays, cuts that add up, differences."""

from itertools import combinations_with_replacement

import numpy as np
import pytest
from families import make
from flint import arb
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from round_exact import exactly
from round_truth import dot, number, truth, vector
from rules import a_turn_keeps_the_measures_of_round_bodies
from strategies import product, quaternion, rotation

from overlapper import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, Placed, RoundedHull, Sphere, overlap

EXACT = 1e-12
DEPTHS = [10.0**-k for k in range(1, 11)]
SHAPES = {
    "sphere": lambda rng: Sphere(rng.uniform(0.2, 0.8)),
    "capsule": lambda rng: Capsule(rng.uniform(0.2, 0.6), rng.uniform(0.2, 1.5)),
    "cylinder": lambda rng: Cylinder(rng.uniform(0.2, 0.6), rng.uniform(0.2, 1.5)),
    "rounded": lambda rng: RoundedHull(rng.normal(size=(6, 3)) * 0.4, rng.uniform(0.05, 0.3)),
    "box": lambda rng: Box(rng.uniform(0.2, 0.8, 3)),
    "hull": lambda rng: Hull(rng.normal(size=(8, 3)) * 0.5),
    "half-space": lambda rng: HalfSpace(rng.normal(size=3), rng.normal() * 0.3),
}
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
ROUND = ["sphere", "capsule", "cylinder", "rounded"]


def somewhere(rng, name):
    return Placed(SHAPES[name](rng), rng.normal(size=3) * 0.3, quaternion(rng))


def moved(body, shift):
    return Placed(body.shape, np.array(body.position) + shift, body.orientation)


def sink(a, b, depth):
    """Two bodies moved along their normal until they are `depth` deep in one another, but for rounding."""
    found = overlap(a, b)
    return moved(a, (found.depth - depth if found else -found.distance - depth) * np.array(found.normal)), b


def sunk(rng, first, second, depth):
    return sink(somewhere(rng, first), somewhere(rng, second), depth)


def lens(a, b):
    """The volume that two balls share, to sixty digits."""
    (ra, rb), between = (
        (number(body.shape.radius) for body in (a, b)),
        [p - q for p, q in zip(vector(a.position), vector(b.position))],
    )
    d = dot(tuple(between), tuple(between)).sqrt()
    return arb.pi() * (ra + rb - d) ** 2 * (d * d + 2 * d * (ra + rb) - 3 * (ra - rb) ** 2) / (12 * d)


def assert_is(found, volume, error=EXACT):
    off = float(abs(number(found.volume) - volume))
    assert off <= error * float(volume)
    assert off <= found.volume_error <= 1e-11 * float(volume)


def assert_all_is_exact(a, b, found, far=0.0):
    """Every measure, where the round body is the first and where it lies is known to the digits that `far` has."""
    true = exactly(a, b)
    assert abs(found.volume - true.volume) <= found.volume_error <= 1e-8 * true.volume
    assert found.volume == pytest.approx(true.volume, rel=EXACT)
    assert found.area == pytest.approx(true.area, rel=1e-10)
    size = np.sqrt(np.trace(true.inertia) / true.volume)
    assert_allclose(found.centroid, true.centroid, rtol=0, atol=1e-10 * size + 4e-16 * (1 + far))
    assert_allclose(found.inertia, true.inertia, rtol=0, atol=1e-10 * np.trace(true.inertia))
    force = np.linalg.norm(true.gradient[:3])
    arm = size + np.linalg.norm(true.centroid - a.position) + far
    assert_allclose(found.gradient[0, :3], true.gradient[:3], rtol=0, atol=1e-10 * force)
    assert_allclose(found.gradient[0, 3:], true.gradient[3:], rtol=0, atol=1e-10 * force * arm)
    assert_allclose(found.gradient[1, :3], -true.gradient[:3], rtol=0, atol=1e-10 * force)
    # The stated errors hold. The truth is rounded to doubles, too.
    errors, last = found.errors, 4e-16
    assert abs(found.area - true.area) <= errors.area + last * true.area
    assert np.linalg.norm(found.centroid - true.centroid) <= errors.centroid
    assert np.abs(found.inertia - true.inertia).max() <= errors.inertia + last * np.trace(true.inertia)
    off = np.abs(found.gradient[0] - true.gradient)
    assert (off <= errors.gradient[0] + last * force * np.array([1, 1, 1, arm, arm, arm])).all()


@pytest.mark.parametrize("first", ["sphere", "capsule", "cylinder"])
@pytest.mark.parametrize("second", ["box", "hull", "half-space"])
def test_all_measures_of_a_round_body_and_a_polyhedron_are_exact_at_any_depth(first, second):
    rng = np.random.default_rng(1)
    for depth in DEPTHS:
        a, b = sunk(rng, first, second, depth)
        found = overlap(a, b)
        if not found:
            continue
        assert found.way in ("slicing", "closed form")
        assert_all_is_exact(a, b, found)


# Which way a round body turns, in its own coordinates, and which way a box does.
TURNED = {"cap": (0, 0, 1), "side": (1, 0, 0), "rim": (1, 0, 1), "nearly the side": (1, 0, 1e-9), "seam": (1, 0, 1e-4)}
FEATURES = {"face": (0, 0, 1), "edge": (0, 1, 1), "corner": (1, 1, 1), "nearly a face": (1e-9, 0, 1)}


def turning(u, v):
    """A quaternion that turns one unit vector into another, not its opposite."""
    turn = np.append(np.cross(u, v), 1 + u @ v)
    return turn / np.linalg.norm(turn)


def set_on(shape, turned, half, feature, depth, at):
    """A round body whose point in one direction is so deep below the point of a box in another."""
    out = np.array(feature) / np.linalg.norm(feature)
    turn = turning(np.array(turned) / np.linalg.norm(turned), -out + 1e-12)
    axis = 2 * np.array([turn[0] * turn[2] + turn[1] * turn[3], turn[1] * turn[2] - turn[0] * turn[3], 0.5])
    axis[2] -= 2 * (turn[0] ** 2 + turn[1] ** 2)
    along = axis @ out
    lowest = -np.sign(along) * getattr(shape, "length", 0) / 2 * axis if abs(along) > 1e-8 else np.zeros(3)
    side = out - along * axis if isinstance(shape, Cylinder) else out
    lowest = lowest - shape.radius * side / np.linalg.norm(side) if np.linalg.norm(side) > 1e-8 else lowest
    corner = half * np.where(np.abs(feature) > np.array(1e-3), np.sign(feature), 0)
    return Placed(shape, at + corner - lowest - depth * out, turn), Placed(Box(half), at)


@pytest.mark.parametrize("turned", TURNED)
@pytest.mark.parametrize("feature", FEATURES)
@pytest.mark.parametrize(("size", "ratio", "far"), [(1, 1, 0), (1e-3, 1e3, 0), (1e3, 1, 1e3)])
def test_all_measures_are_exact_on_a_face_an_edge_and_a_corner(turned, feature, size, ratio, far):
    for shape in (Sphere(0.5 * size), Capsule(0.4 * size, 0.9 * size), Cylinder(0.4 * size, 0.9 * size)):
        for places in (1, 7):
            half = np.array([0.5, 0.6, 0.7]) * size * ratio
            at = np.array([0.3, -0.9, 0.4]) * far
            a, b = set_on(shape, TURNED[turned], half, FEATURES[feature], size * 10.0**-places, at)
            found = overlap(a, b)
            assert found.way in ("slicing", "closed form")
            assert_all_is_exact(a, b, found, far + size * ratio)


# From a place on a box, or from one so many radii off it in a direction, to the centre of a round body; over an edge, a
# corner or a face, through the middle or as tangents.
PLACES = {
    "centre at a corner": ((1, 1, 1), (0, 0, 0)),
    "centre on an edge": ((0.3, 1, 1), (0, 0, 0)),
    "centre on a face": ((0.3, -0.8, 1), (0, 0, 0)),
    "corner on the surface": ((1, 1, 1), (0.6, 0, -0.8)),
    "corner on the axis": ((1, 1, 1), (0, 0, -0.4)),
    "edge along the surface": ((0.3, 1, 1), (0, -0.6, -0.8)),
    "edge along the surface beside": ((0.3, 1, 1), (0, -0.6, 0.8)),
    "face along the surface": ((0.9, 0.9, 1), (0, 0, -1)),
    "edge through the surface": ((0.3, 1, 1), (0, -0.6, -0.3)),
    "anywhere": ((0.7, 0.8, 0.9), (0.1, 0.2, 0.3)),
}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("off", [0, 1e-15])
def test_all_measures_are_exact_where_surfaces_pass_through_middles_or_along_each_other(place, off):
    rng = np.random.default_rng(3)
    on_box, away = np.array(PLACES[place])
    half = np.array([0.5, 0.6, 0.7])
    for turn in ((0, 0, 0, 1), (0.5, 0.5, 0.5, 0.5), quaternion(rng)):
        box = Placed(Box(half), rng.normal(size=3), turn)
        centre = on_box * half + 0.45 * away + off * rng.normal(size=3)
        a = Placed(Sphere(0.45), box.position + rotation(turn) @ centre, turn)
        found = overlap(a, box)
        assert found.way in ("slicing", "closed form")
        assert_all_is_exact(a, box, found, 2)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("off", [0, 1e-15, 1e-6])
def test_parts_of_a_box_add_up_where_surfaces_pass_through_axes_or_along_each_other(place, off):
    rng = np.random.default_rng(4)
    on_box, away = np.array(PLACES[place])
    half = np.array([0.5, 0.6, 0.7])
    for shape in (Sphere(0.45), Capsule(0.45, 0.3), Cylinder(0.45, 0.7)):
        for turn in ((0, 0, 0, 1), (0.5, 0.5, 0.5, 0.5), quaternion(rng)):
            # In coordinates of the box, whose planes are then the same for all parts.
            a = Placed(shape, on_box * half + 0.45 * away + off * rng.normal(size=3), turn)
            whole = overlap(a, Box(half))
            parts = [overlap(a, Hull(CORNERS * [0.5, 0.6, 0.35] + [0, 0, z])) for z in (-0.35, 0.35)]
            assert abs(whole.volume - sum(p.volume for p in parts)) <= sum(p.volume_error for p in (whole, *parts))
            if whole:
                moments = sum(p.volume * p.centroid for p in parts if p)
                assert_allclose(whole.volume * whole.centroid, moments, atol=1e-12 * whole.volume)
                # A strip between a plane and a cylinder that it touches is as wide as the root of how deep it is.
                open_ = 1e-8 if place == "face along the surface" else 1e-11
                # Either of two coplanar faces may own the facet. The stated error includes this.
                open_ += sum(p.errors.gradient[0].max() for p in (whole, *parts) if p)
                assert_allclose(whole.gradient[0], sum(p.gradient[0] for p in parts), atol=open_)


@pytest.mark.parametrize("first", ["sphere", "capsule", "cylinder"])
@pytest.mark.parametrize("second", ["box", "hull"])
def test_nearly_all_random_poses_of_a_round_body_and_a_polyhedron_have_a_formula(first, second):
    rng = np.random.default_rng(2)
    found = [overlap(somewhere(rng, first), somewhere(rng, second)) for _ in range(200)]
    ways = [o.way for o in found if o]
    assert ways.count("closed form") > 0.8 * len(ways)


@pytest.mark.parametrize("depth", DEPTHS)
@pytest.mark.parametrize("far", [0, 1e3])
def test_two_balls_share_a_lens(depth, far):
    a, b = Placed(Sphere(0.5), (far, 0.1, 0)), Placed(Capsule(0.25, 0), np.array([far, 0.1, 0]) + [0.45, 0.6, 0])
    b = moved(b, (0.75 - depth) * np.array([0.6, 0.8, 0]) - np.array([0.45, 0.6, 0]))
    assert_is(overlap(a, b), lens(a, b))


@pytest.mark.parametrize("depth", DEPTHS[:-1])
def test_a_cylinder_lying_on_the_ground_shares_a_segment(depth):
    ground = HalfSpace([0, 0, 1], 0)
    turn = (0, np.sin(np.pi / 4), 0, np.sin(np.pi / 4))
    cylinder = Placed(Cylinder(0.5, 2), (0, 0, 0.5 - depth), turn)
    half_angle = (number(float(cylinder.position[2])) / number(0.5)).acos()
    segment = (half_angle - half_angle.sin() * half_angle.cos()) / 4
    assert_is(overlap(cylinder, ground), 2 * segment)


@pytest.mark.parametrize("radius", [1e-3, 0.5, 1e3])
def test_crossing_cylinders_share_the_bicylinder(radius):
    turn = (np.sin(np.pi / 4), 0, 0, np.sin(np.pi / 4))
    found = overlap(Cylinder(radius, 4 * radius), Placed(Cylinder(radius, 5 * radius), orientation=turn))
    assert found.way == "slicing"
    assert_is(found, 16 * number(radius) ** 3 / 3)
    assert found.area == pytest.approx(16 * radius**2, rel=1e-12)


@pytest.mark.parametrize("tilt", [0, 1e-9, 0.02, 0.3])
@pytest.mark.parametrize(
    "other", [Cylinder(0.6, 9), Capsule(0.6, 0.3), Sphere(0.6)], ids=["cylinder", "capsule", "ball"]
)
def test_a_cap_however_small_is_subtracted(tilt, other):
    turn = (np.sin(tilt / 2), 0, 0, np.cos(tilt / 2))
    axis = np.array([0, -np.sin(tilt), np.cos(tilt)])
    a, b = sink(Placed(other, (0.9, 0.2, 0.1)), Placed(Cylinder(0.4, 8), (0, 0, 0), turn), 0.03)
    whole = overlap(a, b).volume

    def beyond(cut, side):
        return overlap(a, Placed(Cylinder(0.4, 4 - side * cut), (4 * side + cut) / 2 * axis, turn))

    inside, tip = 0.0, 3.0
    while tip - inside > 1e-9:
        middle = (inside + tip) / 2
        inside, tip = (middle, tip) if beyond(middle, 1) else (inside, middle)
    for cut in tip - np.geomspace(1e-6, 0.3, 61):
        assert sum(beyond(cut, side).volume for side in (1, -1)) == pytest.approx(whole, rel=3e-12)


@pytest.mark.parametrize(
    ("position", "orientation", "other_orientation"),
    [
        # Between two lines that cross near the circle is an arc of next to nothing, and not all of it.
        (
            [-0.43436357378896684, -0.38434965235243074, 0.09831378035535544],
            [-0.54631616, -0.39484729, 0.692984, 0.25574879],
            [-0.39641784, 0.88297753, 0.13829544, 0.20994749],
        ),
        # At an end of three intervals, what a slice holds has another outline than in the middle.
        (
            [0.2771765996888893, 0.24184267666737802, 0.2647599087503266],
            [0.5446746741351163, -0.5425123049067997, -1.2720372718127473, 1.5949979667062097],
            [-0.4977982044604572, -0.5080083919002721, 0.03924345808050567, -0.6536796272177162],
        ),
    ],
)
def test_rounded_tetrahedra_deep_in_each_other_share_what_is_proved(position, orientation, other_orientation):
    rounded = RoundedHull(0.3 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]), 0.2)
    answer = overlap(Placed(rounded, position, orientation), Placed(rounded, (0, 0, 0), other_orientation))
    assert answer.way in ("closed form", "slicing")
    lower, upper = answer.certificate().verify()
    assert float(lower) == pytest.approx(answer.volume, rel=1e-13) == float(upper)
    assert answer.volume_error < 1e-11 * answer.volume


def test_a_ball_over_the_corner_of_a_box_is_an_eighth_of_it():
    found = overlap(Placed(Sphere(0.5), (1, 1, 1)), Box([1, 1, 1]))
    assert_is(found, arb.pi() / 48)
    assert_allclose(found.gradient[0, :3], -np.pi / 16, rtol=1e-12)


def test_a_rounded_hull_inside_a_box_has_the_volume_of_steiner():
    rounded = RoundedHull(np.random.default_rng(3).normal(size=(9, 3)), 0.3)
    found = overlap(rounded, Box([9, 9, 9]))
    assert found.way == "closed form"
    assert found.volume == pytest.approx(rounded.volume, rel=EXACT)
    assert_allclose(found.centroid, rounded.centroid, atol=1e-12)


def test_halves_of_a_rounded_hull_of_a_thousand_corners_have_the_volume_of_steiner():
    corners = np.random.default_rng(3).normal(size=(1000, 3))
    rounded = RoundedHull(corners / np.linalg.norm(corners, axis=1, keepdims=True), 0.05)
    halves = [overlap(rounded, Placed(Box([2, 2, 2]), (side * 2 + 0.1, 0, 0))) for side in (-1, 1)]
    assert [half.way for half in halves] == ["closed form", "closed form"]
    assert sum(half.volume for half in halves) == pytest.approx(rounded.volume, rel=EXACT)


@pytest.mark.parametrize("slivers", [90, 300, 3000])
def test_a_ball_meets_a_rounded_cone_of_many_slivers_at_its_rim(slivers):
    turns = 2 * np.pi * (np.arange(slivers) + 0.5) / slivers
    rim = np.column_stack([np.cos(turns), np.sin(turns), 0 * turns])
    cone = RoundedHull(np.vstack([rim, [[0, 0, 1]]]), 0.02)
    ball = Placed(Sphere(0.3), (1.3, 0.1, 0.05))
    found = overlap(cone, ball)
    # The same of no more than the slivers that are near, and one corner far from them.
    near = RoundedHull(np.vstack([rim[rim[:, 0] > 0.9], [[0, 0, 1], [0, 0, 0]]]), 0.02)
    assert found.way == overlap(near, ball).way == "closed form"
    assert found.volume == pytest.approx(overlap(near, ball).volume, rel=EXACT)
    # All other measures are those of slices.
    assert_allclose(found.centroid, overlap(near, ball).centroid, atol=1e-12)


@pytest.mark.parametrize(
    ("first", "second", "seed", "way"),
    [("sphere", "box", 1, "closed form"), ("capsule", "cylinder", 4, "slicing")],
)
def test_measures_are_those_that_rays_find(first, second, seed, way):
    a, b = sunk(np.random.default_rng(seed), first, second, 1e-2)
    found = overlap(a, b)
    true = truth(a, b, found)
    assert found.way == way
    assert found.volume == pytest.approx(true.volume, rel=EXACT)
    assert true.error < EXACT
    size = np.sqrt(np.trace(true.inertia) / true.volume)
    assert_allclose(found.centroid, true.centroid, atol=1e-10 * size)
    assert_allclose(found.inertia, true.inertia, atol=1e-10 * np.abs(true.inertia).max())
    # Where the surface changes, what rays miss is of first order for areas.
    assert found.area == pytest.approx(true.area, rel=1e-5)
    assert_allclose(found.gradient, true.pull, atol=1e-5 * np.abs(true.pull).max())


@pytest.mark.parametrize(("first", "second"), [*combinations_with_replacement(("sphere", "capsule", "cylinder"), 2)])
def test_every_pair_of_round_bodies_deep_in_each_other_is_measured_to_ten_digits(first, second):
    rng = np.random.default_rng(2)
    for _ in range(200):
        shapes = [
            {"sphere": Sphere(r), "capsule": Capsule(r, length), "cylinder": Cylinder(r, length)}[kind]
            for kind, r, length in zip((first, second), rng.uniform(0.2, 0.8, 2), rng.uniform(0.3, 1.5, 2), strict=True)
        ]
        found = overlap(
            Placed(shapes[0], orientation=quaternion(rng)), Placed(shapes[1], 0.3 * rng.normal(size=3), quaternion(rng))
        )
        assert found.volume_error <= 1.2e-11 * found.volume


def measured_as_round(found):
    return found.way in ("slicing", "closed form") and found.volume_error <= 1e-11 * found.volume


@pytest.mark.parametrize("first", ROUND)
@pytest.mark.parametrize("second", sorted(SHAPES))
def test_nearly_all_contacts_of_round_bodies_are_measured_exactly(first, second):
    rng = np.random.default_rng(8)
    contacts = [overlap(*sunk(rng, first, second, 10.0 ** -(1 + k % 9))) for k in range(27)]
    assert sum(measured_as_round(found) for found in contacts if found.volume) >= 24


@settings(deadline=None)
@given(st.sampled_from(ROUND), st.integers(0, 2**32 - 1), st.integers(1, 10))
def test_parts_of_a_box_add_up(kind, seed, places):
    rng = np.random.default_rng(seed)
    a, box = sunk(rng, kind, "box", 10.0**-places)
    half = np.array(box.shape.half_extents)
    whole = overlap(a, box)
    assume(whole)
    # In coordinates of the box, whose planes are then the same for all parts.
    cut = 0.5
    lower, upper = (Hull(CORNERS * half * [1, 1, cut] + [0, 0, s * half[2] * cut]) for s in (-1, 1))
    parts = [overlap(a, Placed(part, box.position, box.orientation)) for part in (lower, upper)]
    total, error = sum(p.volume for p in parts), sum(p.volume_error for p in (whole, *parts))
    assert abs(total - whole.volume) <= error + EXACT * whole.volume


@settings(deadline=None)
@given(st.sampled_from(ROUND), st.sampled_from(sorted(SHAPES)), st.integers(0, 2**32 - 1), st.integers(1, 10))
def test_bits_do_not_depend_on_the_order(first, second, seed, places):
    a, b = sunk(np.random.default_rng(seed), first, second, 10.0**-places)
    one, other = overlap(a, b), overlap(b, a)
    assert (one.volume, one.volume_error, one.area) == (other.volume, other.volume_error, other.area)
    assert one.way == other.way
    if one:
        assert np.array_equal(one.centroid, other.centroid)
        assert np.array_equal(one.gradient, other.gradient[::-1])
        assert one.volume > 0


@pytest.mark.parametrize("first", ROUND)
@pytest.mark.parametrize("second", sorted(SHAPES))
def test_the_gradient_is_that_of_the_volume(first, second):
    rng = np.random.default_rng(5)
    a, b = sunk(rng, first, second, 0.1)
    found = overlap(a, b)
    step = 1e-4
    for k in range(3):
        shifted = [overlap(moved(a, n * step * np.eye(3)[k]), b) for n in (-2, -1, 1, 2)]
        if not all(measured_as_round(o) for o in (found, *shifted)):
            continue
        low, less, more, high = (o.volume for o in shifted)
        slope = (8 * (more - less) - (high - low)) / (12 * step)
        # A volume is smooth but where features appear.
        assert found.gradient[0, k] == pytest.approx(slope, abs=1e-6 * max(found.area, 1e-3))


def test_coinciding_shapes_are_measured_correctly():
    s = np.sqrt(0.5)
    crossing = (0, s, 0, s)
    pairs = [
        (Placed(Capsule(1, 1)), Placed(Capsule(1, 1), orientation=crossing)),
        (Placed(Capsule(1, 1)), Placed(Capsule(1, 1), (0, 0, 1), crossing)),
        (Placed(Capsule(1, 1)), Placed(Cylinder(1, 1), orientation=crossing)),
        (Placed(Cylinder(1, 1)), Placed(Cylinder(1, 1), orientation=crossing)),
        (Placed(Capsule(1, 1)), Placed(Sphere(1), (0.5, 0, 0.5))),
        (Placed(Capsule(1, 1)), Placed(Cylinder(1, 3))),
        (Placed(Capsule(1, 1)), Placed(Capsule(1, 1))),
    ]
    for a, b in pairs:
        exactly, nearly = overlap(a, b), overlap(a, moved(b, (1e-9, 2e-9, -1e-9)))
        error = exactly.volume_error + nearly.volume_error + 3e-9 * (exactly.area + nearly.area)
        assert abs(exactly.volume - nearly.volume) <= error


def test_a_vertex_with_many_facets_on_one_side_shares_with_a_box_what_its_halves_do():
    # One facet's normal is more than a right angle away from the mean of all.
    fan = [(np.cos(t), np.sin(t), -0.7963531344922321) for t in np.linspace(-0.7286, 0.7286, 19)]
    rounded = Placed(RoundedHull(np.array([(0, 0, 0), *fan, (-0.18071397380646537, 0, -1.45838456543)]) / 2, 0.0467))
    turned = np.array([1.46387087, 1.25255986, -0.50703985, -1.34518593])
    for centre, size in (
        ((-0.00916795, 0.04061619, -0.01420654), 0.04656708),
        ((-0.00333569, 0.0161665, -0.0094886), 0.0418),
    ):
        along = rotation(turned) @ [0, 0, size / 2]
        halves = [
            overlap(rounded, Placed(Box([size, size, size / 2]), centre + side * along, turned)) for side in (-1, 1)
        ]
        whole = overlap(rounded, Placed(Box([size] * 3), centre, turned))
        assert whole.volume == pytest.approx(sum(half.volume for half in halves), rel=EXACT)


@pytest.mark.parametrize("depth", [0.3, 1e-2, 1e-4, 1e-7])
@pytest.mark.parametrize("margin", [0.5, 1e-3])
def test_a_rounded_hull_of_many_facets_shares_with_a_box_what_its_halves_do(depth, margin):
    rng = np.random.default_rng(5)
    rounded = Placed(RoundedHull(rng.normal(size=(40, 3)), margin), rng.normal(size=3), quaternion(rng))
    for _ in range(4):
        box = Placed(Box([3, 2, 1]), (8, 0, 0), quaternion(rng))
        a, b = sink(rounded, box, depth)
        (x, y, z, w), size = b.orientation, np.dot(b.orientation, b.orientation)
        along = np.array([1 - 2 * (y * y + z * z) / size, 2 * (x * y + w * z) / size, 2 * (x * z - w * y) / size])
        whole = overlap(a, b)
        halves = [
            overlap(a, Placed(Box([1.5, 2, 1]), b.position + side * 1.5 * along, b.orientation)) for side in (-1, 1)
        ]
        assert whole.way in ("closed form", "slicing") and whole.volume_error <= 1e-11 * whole.volume
        rounding = 1e-15 * 8 * whole.area  # of where the halves are
        assert whole.volume == pytest.approx(sum(half.volume for half in halves), rel=EXACT, abs=rounding)


def test_meshes_that_meet_within_their_margins_are_measured_to_eleven_digits():
    rng = np.random.default_rng(0)
    for _ in range(10):
        one, other = (Placed(RoundedHull(rng.normal(size=(30, 3)) * 0.05, 1e-3), (x, 0, 0)) for x in (0, 0.5))
        found = overlap(*sink(one, other, 2e-4))
        assert found.way in ("closed form", "slicing") and found.volume_error <= 1e-11 * found.volume


@pytest.mark.parametrize("first_seed", range(0, 200, 100))
def test_surfaces_separated_only_by_rounding_are_measured_correctly(first_seed):
    for seed in range(first_seed, first_seed + 100):
        case, rng = make("flush_round", seed), np.random.default_rng(seed)
        a, b = case.bodies
        shift, turn = 10.0 ** rng.uniform(-19, -9, 2) * rng.integers(0, 2, 2)
        shift, turn = shift * rng.normal(size=3) * rng.integers(0, 2, 3), turn * rng.normal(size=4)
        turned = Placed(b.shape, b.position + shift, np.array(b.given_orientation) + turn)
        found = overlap(a, turned, tolerance=1e-2)
        sizes = [np.linalg.norm(np.ptp(body.bounds, axis=0)) for body in (a, b) if np.isfinite(body.bounds).all()]
        way = np.linalg.norm(turned.position - b.position) + 4 * min(sizes) * np.linalg.norm(turn)
        moved_by = found.volume_error + (way + 1e-15 * min(sizes)) * 6 * min(sizes) ** 2
        assert found
        assert abs(found.volume - case.closed_form) <= moved_by, (seed, a, turned)


def carried(body, turn, shift):
    """The body turned about the origin, then moved by the shift."""
    return Placed(body.shape, rotation(turn) @ body.position + shift, product(turn, body.given_orientation))


SILENT = [
    # A plane that is passed in the middle of slices, with samples of it equal on either side.
    (
        Placed(Capsule(1.0001, 0)),
        Placed(Cylinder(np.sqrt(0.5), 2), (-0.5000000000000001, -0.5, -9.999999999998899e-05)),
    ),
    (
        Placed(Cylinder(1.3167934511803734, 1)),
        Placed(
            RoundedHull([[0.1, -1.50015, -0.7], [-0.1, 1.50015, -0.7], [0.1, 1.50015, 0.7], [-0.1, -1.50015, 0.7]], 2),
            (1.1403765802591874, -2.8417532744098137, 0),
            (0, 5e-10, 0, 1),
        ),
    ),
    # A corner of a piece beside the point inside, by rounding.
    (
        Placed(
            RoundedHull(CORNERS * [1.6818166319403705, 0.7, 0.2745640207051316], np.sqrt(0.5)),
            (0, 0, 0),
            (1.0098975874475677, -0.11852107588046074, -1.1350723657897133, 1.2380751038421196),
        ),
        Placed(
            RoundedHull([[-1.5, -0.5, 1 / 3], [1.5, -0.5, -1 / 3], [1.5, 0.5, 1 / 3], [-1.5, 0.5, -1 / 3]], 2),
            (-3.0400468580066917, 0.3617815906925984, -1.2132326299823868),
            (-1.3529902503654923e-16, -0.27059805007309845, -0.2705980500730989, 0.9238795325112866),
        ),
    ),
]


def assert_motion_changes_nothing(a, b, rng):
    found, turn, shift = overlap(a, b), quaternion(rng), rng.normal(size=3)
    again = overlap(*(carried(body, turn, shift) for body in (a, b)))
    boxes = [body.bounds for body in (a, b) if np.isfinite(body.bounds).all()]
    rounding = 4e-15 * (sum(float(np.abs(box).max()) for box in boxes) + np.abs(shift).max() + np.abs(b.position).max())
    allowed = found.volume_error + again.volume_error + rounding * (found.area + again.area)
    assert abs(found.volume - again.volume) <= allowed, (a, b)
    return found


@pytest.mark.parametrize(("points", "margin"), [(250, 0.05), (500, 0.05), (500, 0)])
def test_meshes_of_many_facets_deep_in_each_other_are_measured_of_their_round_shapes(points, margin):
    """The hulls have more walls than a slice has lines. Pieces have few walls and lie far from the deepest point."""
    clouds = [np.random.default_rng(seed).normal(size=(points, 3)) for seed in (0, 1)]
    one, other = (cloud / np.linalg.norm(cloud, axis=1)[:, None] for cloud in clouds)
    second = RoundedHull(other, margin) if margin else Hull(other)
    pair = Placed(RoundedHull(one, 0.05)), Placed(second, (0.3, 0.2, 0.4), (0.1, 0.2, 0.3, 0.9))
    found = assert_motion_changes_nothing(*pair, np.random.default_rng(0))
    assert found.way in ("closed form", "slicing") and found.volume_error <= 1e-10 * found.volume


@pytest.mark.parametrize("first_seed", range(0, 60, 20))
def test_round_bodies_deep_in_meshes_with_margins_are_measured_of_their_round_shapes(first_seed):
    for seed in range(first_seed, first_seed + 20):
        found = assert_motion_changes_nothing(*make("rounded_meshes", seed).bodies, np.random.default_rng(seed))
        assert found.way in ("closed form", "slicing") and found.volume_error <= 1e-11 * found.volume


@pytest.mark.parametrize("first_seed", range(0, 300, 100))
def test_rounded_hulls_with_facets_nearly_in_one_plane_are_measured_of_their_round_shapes(first_seed):
    for seed in range(first_seed, first_seed + 100):
        found = assert_motion_changes_nothing(*make("folded_hulls", seed).bodies, np.random.default_rng(seed))
        assert not found or ("dual" not in found.way and found.volume_error <= 1e-11 * found.volume)


@pytest.mark.parametrize("shape", [Sphere(0.3), Capsule(0.2, 0.5), Cylinder(0.2, 0.5), Box([0.2, 0.3, 0.4])], ids=repr)
def test_the_tip_of_a_rounded_cone_of_many_slivers_is_measured_correctly(shape):
    """No plane cuts the fan of facets, nor that of the tip's seams, into smaller ones."""
    turns = 2 * np.pi * np.arange(60) / 60
    cone = RoundedHull(np.vstack([np.c_[np.cos(turns), np.sin(turns), 0 * turns] / 2, [[0, 0, 1]]]), 0.1)
    for seed in range(8):
        rng = np.random.default_rng(seed)
        at = [0, 0, 0.9] + 0.1 * rng.normal(size=3)
        found = assert_motion_changes_nothing(Placed(cone), Placed(shape, at, quaternion(rng)), rng)
        assert found.way in ("closed form", "slicing") and found.volume_error <= 1e-11 * found.volume


# Beside the point inside, the middle of what encloses a piece may be far from all that it has.
@pytest.mark.parametrize("seed", [156, 246, 314, 328, 353, 507, *range(20)])
def test_shallow_contacts_of_rounded_hulls_are_measured_to_eleven_digits(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(20, 3))
    points *= rng.uniform(0.3, 0.6, 3) / np.linalg.norm(points, axis=1)[:, None]
    hull = Placed(RoundedHull(points, rng.uniform(0.02, 0.1)), 0.4 * rng.normal(size=3), quaternion(rng))
    found = overlap(*sink(hull, Placed(Capsule(0.3, 0.7), (0, 0, 0), quaternion(rng)), 10.0 ** -rng.uniform(4, 6)))
    assert found.way in ("closed form", "slicing") and found.volume_error <= 1e-11 * found.volume


def test_rounded_boxes_that_are_nearly_parallel_are_measured_of_their_round_shapes():
    """Slices of two cylinders may not be turned: planes nearly parallel to them rush across, in a billionth of all."""
    found = []
    for seed in range(200):
        found.append(assert_motion_changes_nothing(*make("tilted_round", seed).bodies, np.random.default_rng(seed)))
    overlapping = [one for one in found if one]
    assert len(overlapping) > 180
    assert {one.way for one in overlapping} <= {"closed form", "slicing"}
    assert sum(one.volume_error > 1e-11 * one.volume for one in overlapping) <= 0.2 * len(overlapping)


@pytest.mark.parametrize("which", range(len(SILENT)))
def test_a_plane_or_a_piece_that_slices_have_missed_is_found(which):
    for seed in range(10):
        found = assert_motion_changes_nothing(*SILENT[which], np.random.default_rng(seed))
        assert found.volume_error <= 1e-11 * found.volume


@pytest.mark.parametrize("first_seed", range(0, 600, 300))
def test_special_poses_are_measured_correctly_far_from_the_origin_too(first_seed):
    """Most overlapping pairs are sliced. Pairs left to polytopes and pairs with a wide error bound are counted."""
    found = []
    for seed in range(first_seed, first_seed + 300):
        a, b = make("special_poses", seed).bodies
        found.append(assert_motion_changes_nothing(a, b, np.random.default_rng(seed)))
    overlapping = [one for one in found if one]
    assert len(overlapping) > 200
    assert sum(one.volume_error > 1e-11 * one.volume for one in overlapping) <= 0.02 * len(overlapping)
    assert not any("dual" in one.way for one in overlapping)


def test_a_formula_that_is_not_sure_is_not_believed_where_slices_give_up():
    """A corner of a hull beside the rim of a cylinder, 5e-8 deep in it."""
    found = overlap(*make("special_poses", 3000455).placed)
    lower, upper = found.certificate().verify()
    assert found.volume - found.volume_error <= lower and upper <= found.volume + found.volume_error


# About a point at an end of such a long wedge, its other end had lost nine digits.
@pytest.mark.parametrize("depth", DEPTHS[2:])
def test_a_flat_cap_on_an_edge_that_is_parallel_to_it_shares_a_wedge(depth):
    r, turn = 0.3, [np.sin(np.pi / 8), 0, 0, np.cos(np.pi / 8)]
    for seed in range(5):
        rng = np.random.default_rng(seed)
        q, beside = quaternion(rng), rng.uniform(-0.2, 0.2)
        at = rotation(q) @ [0.1, beside, 0.5**0.5 + 0.4 - depth]
        found = overlap(Placed(Cylinder(r, 0.8), at, q), Placed(Box([0.5, 0.5, 0.5]), (0, 0, 0), product(q, turn)))
        assert found.way in ("slicing", "closed form")
        assert found.volume_error <= 1e-11 * found.volume
        lower, upper = found.certificate().verify()
        assert found.volume - found.volume_error <= upper and lower <= found.volume + found.volume_error


@pytest.mark.parametrize("seed", range(12))
def test_an_ellipsoid_and_a_plate_that_is_thin_by_a_hundred_million_share_what_is_proved(seed):
    rng = np.random.default_rng(seed)
    thin = rng.permutation([1e-8, 1.0, 1.0]) * rng.uniform(0.4, 1, 3)
    plate = Box(thin) if seed % 2 else Hull(rng.normal(size=(8, 3)) * thin)
    body = Placed(Ellipsoid(rng.uniform(0.5, 1, 3)), rng.normal(size=3) * 0.1, quaternion(rng))
    found = overlap(body, Placed(plate, (0, 0, 0), quaternion(rng)))
    assert found.way == "slicing"
    assert found.volume_error <= 1e-11 * found.volume
    lower, upper = found.certificate().verify()
    assert found.volume - found.volume_error <= upper and lower <= found.volume + found.volume_error


@pytest.mark.parametrize("margin", [1.0, 0.05, 1e-3])
@pytest.mark.parametrize("wide", [False, True])
def test_a_face_in_the_plane_of_a_seam_bounds_all_that_it_should(margin, wide):
    """A rounded cube, up to the plane in which one of its faces' cylinders and balls begin."""
    half, side = 0.5, 1.0
    beyond = side**2 * margin + np.pi * margin**2 * side + 2 / 3 * np.pi * margin**3
    curved = side**2 + 2 * np.pi * margin * side + 2 * np.pi * margin**2
    section = side**2 + 4 * side * margin + np.pi * margin**2
    cube = Placed(RoundedHull(CORNERS * half, margin))
    for seed in range(5):
        turn = quaternion(np.random.default_rng(seed)) if seed else np.array([0.0, 0, 0, 1])
        normal = rotation(turn) @ [0, 0, 1]
        other = Box([half + margin, half + margin, 2]) if wide else HalfSpace([0, 0, 1], 0)
        at = normal * (half - 2 if wide else half)
        found = overlap(Placed(cube.shape, (0, 0, 0), turn), Placed(other, at, turn))
        assert "dual" not in found.way
        assert found.volume == pytest.approx(cube.volume - beyond, rel=1e-12)
        area = 6 * side**2 + 6 * np.pi * margin * side + 4 * np.pi * margin**2
        assert found.area == pytest.approx(area - curved + section, rel=1e-11)
        if not wide:
            assert found.gradient[1, :3] == pytest.approx(section * normal, abs=1e-11 * area)
        assert found.volume_error <= 1e-11 * found.volume


def test_a_face_within_rounding_of_a_core_corner_is_measured_correctly():
    for seed in range(40):
        rng = np.random.default_rng(seed)
        points, turn, half = 0.5 * rng.normal(size=(8, 3)), quaternion(rng), np.array([2, 0.25, 1])
        hull = RoundedHull(points, 0.5)
        corner = hull.core.vertices[int(rng.integers(len(hull.core.vertices)))]
        at = corner - rotation(turn) @ (half * [rng.uniform(-0.5, 0.5), 1, rng.uniform(-0.5, 0.5)])
        found = assert_motion_changes_nothing(Placed(hull), Placed(Box(half), at, turn), rng)
        assert "dual" not in found.way
        assert found.volume_error <= 1e-11 * found.volume


def test_pieces_of_a_rounded_hull_with_twin_corners_state_the_gaps_between_them():
    """Two corners lie 4e-13 apart on two facets with a fourth corner 1e-16 off the plane of the others. The short edge
    is tilted out of both planes by 3e-4, so the wedges of balls at its ends share 1e-10 of the volume."""
    corners = [
        (-0.0003662109375, -3, 3.0000000000002274),
        (0.0014648437500000002, 3.0000000000000004, 3),
        (-0.0003662109375, 2.9999999999999996, 4.4408920985006262e-16),
        (0.0014648437499999998, 2.2204460492503131e-16, 8.7311491370201111e-11),
        (-0.00036621093750006408, -3.0000000000001315, 2.9999999999998685),
        (-0.00146484375, -0.75, -0.75),
        (0.0014648437499621041, 3.8805329320249861e-11, 9.7012768189112388e-12),
        (-0.00048828124999999978, -3, 0),
        (-2.8720525379199709e-05, 2, -0.18431372549021741),
    ]
    hull, rng = RoundedHull(corners, 0.375), np.random.default_rng(1)
    for _ in range(20):
        normal, level = rng.normal(size=3), rng.uniform(-0.3, 0.3)
        parts = [overlap(Placed(hull), HalfSpace(side * normal, side * level)) for side in (1, -1)]
        off = abs(sum(part.volume for part in parts) - hull.volume)
        assert off <= sum(part.volume_error for part in parts)
        assert all(part.volume_error < 1e-7 * hull.volume for part in parts)


def test_a_pair_split_by_two_planes_within_rounding_is_sliced():
    # The plane in which a capsule becomes a half ball lies in a face, turned by the rounding of a quaternion.
    capsule = Placed(Capsule(2, 1))
    box = Placed(Box([0.25, 0.5, 0.5]), (0.5000000005, 1.5, 0.25), (-0.5, -0.5, -0.5, 0.5000000000000001))
    # Beside the middle of its flat end, a cylinder ends in a slice as wide as the root of rounding.
    flat = Placed(Cylinder(0.1, 1.9998))
    wide = Placed(
        Cylinder(333.3333333333333, 0.2),
        (0.09999999450049986, -0.4499500009999998, -0.4499499999890011),
        (-1, 5e-9, 1, 5e-9),
    )
    # Two cylinders end in the plane of a wall, one rounding beyond where the last outline begins.
    rounded = Placed(RoundedHull(CORNERS * [0.7, 1, 0.7], 0.5**0.5))
    across = Placed(
        Cylinder(0.999999999999, 2), (-0.007106781185840516, -1.0000000000000002, -0.007106781185840294), (1, 0, 0, 1)
    )
    for a, b in ((capsule, box), (flat, wide), (rounded, across)):
        found = assert_motion_changes_nothing(a, b, np.random.default_rng(0))
        assert "dual" not in found.way
        assert found.volume_error <= 1e-11 * found.volume


# In the first, corners of cuts meet outside of the ball, and a face between them is nothing but rounding.
@pytest.mark.parametrize("seed", [248, *range(4)])
def test_a_ball_and_a_mesh_with_a_margin_share_what_is_proved(seed):
    rng = np.random.default_rng(seed)
    mesh = RoundedHull(rng.normal(size=(2, 30, 3))[1] * 0.3, 0.01)
    placed = [
        Placed(shape, rng.normal(size=3) * spread, rng.normal(size=4))
        for shape, spread in ((Sphere(0.3), 0.1), (mesh, 0.3))
    ]
    found = overlap(*placed)
    assert found.way == "closed form"
    assert found.volume_error <= 1e-11 * found.volume
    lower, upper = found.certificate().verify()
    assert found.volume - found.volume_error <= lower <= upper <= found.volume + found.volume_error


# Thin wedges of margins, far from the point that coordinates count from: what rounding makes of their ends is no slice.
@pytest.mark.parametrize("seed", [1987, 2558, 2647, 3027, *range(8)])
def test_meshes_with_margins_deep_in_each_other_are_measured_of_their_round_shapes(seed):
    rng = np.random.default_rng(seed)
    meshes = [RoundedHull(points * 0.3, 0.01) for points in rng.normal(size=(2, 30, 3))]
    first = [Sphere(0.3), Capsule(0.2, 0.5), Cylinder(0.2, 0.5), meshes[0]][seed % 4]
    a = Placed(first, rng.normal(size=3) * 0.1, rng.normal(size=4))
    b = Placed(meshes[1], rng.normal(size=3) * 0.3, rng.normal(size=4))
    found = overlap(a, b)
    ways = ("closed form",) if isinstance(first, Sphere) else ("closed form", "slicing")
    assert not found or (found.way in ways and found.volume_error <= 1e-11 * found.volume)


def test_a_wedge_shorter_than_its_radius_by_millions_is_not_lost():
    """The heights of the cylinder's ends are known to a rounding error of the radius."""
    plate = RoundedHull(CORNERS * [2.5e-7, 0.025, 0.25], 1 / 3)
    around = RoundedHull([[2, 0, 0], [0, 2, 0], [0, 0, 2], [0, 0, 0]], 0.5**0.5)
    place = (0.7203718892643154, -0.29703967267297204, -0.6220036169108314)
    found = overlap(Placed(plate), Placed(around, place, (1, -1, 1, 1)))
    lower, upper = found.certificate().verify()
    assert found.volume_error <= 1e-11 * found.volume
    assert found.volume - found.volume_error <= lower <= upper <= found.volume + found.volume_error


@pytest.mark.parametrize("seed", [13, 16, 17, 26, 32, 44, 49, 57])
def test_a_ball_on_a_ridge_that_is_all_but_flat(seed):
    # Corners far from the origin lie off their facet's plane by their rounding, so that the facet is two, by an
    # angle of 1e-14 ... 1e-10: where slices cross the ridge, both lines have to go through one point.
    rng = np.random.default_rng(seed)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    middle, radius = rng.normal(size=3) * 10.0 ** rng.uniform(3, 6), 1.125
    slab = Hull(middle + CORNERS * [1, 1, 0.5] @ turn.T)
    depth = 10.0 ** -rng.uniform(6, 8)
    across = rng.uniform(-0.3, 0.3, 2) * (2 * radius * depth) ** 0.5
    found = overlap(Placed(Sphere(radius), middle + turn @ [*across, 0.5 + radius - depth]), Placed(slab))
    lower, upper = found.certificate().verify()
    assert max(abs(found.volume - lower), abs(found.volume - upper)) <= found.volume_error <= 1e-11 * found.volume


@pytest.mark.parametrize("margin", [2.0**-10, 2.0**-16, 2.0**-22])
@pytest.mark.parametrize("turn", [(1, 2, 2, 0), (2, -1, 0, 2), (0, 1, 2, -2)])
def test_needles_between_a_thin_plate_and_a_thin_margin_have_all_their_digits(margin, turn):
    """The plate leaves a slice of the cube's edge: the prisms on two facets are needles, turned to no axis."""
    plate, ninth = margin / 4, np.round(np.array([0, 0.75, 0.5]) / 9 * 2.0**40) / 2.0**40
    low = 9 * ninth[1:] - 1
    found = overlap(
        Placed(RoundedHull(CORNERS / 2, margin), (0, 0, 0), turn),
        Placed(Box([plate, 1, 1]), np.rint(9 * rotation(turn)) @ ninth, turn),
    )
    wide, high = 0.5 - low
    exact = 2 * plate * (wide * high + margin * (wide + high) + np.pi / 4 * margin**2)
    assert abs(found.volume - exact) <= found.volume_error + 1e-15 * exact
    assert found.volume_error <= 1e-12 * exact


@pytest.mark.parametrize("digits", [4, 5])
def test_no_slice_is_missed_where_a_wall_goes_through_the_point_inside(digits):
    """Where one of the planes that a corner lies on has no terms but rounding, the corner still counts."""
    turns = (-0.30017150, 0.20430073, -0.02528523, -0.02503337), (1.46507563, -0.92387953, 0.38268343, 0.92387953)
    place = np.round([-0.40088835, 0.97411165, -1.39904852], digits)
    found = overlap(
        Placed(Capsule(round(1.42968083, digits), 0.5), (0, 0, 0), np.round(turns[0], digits)),
        Placed(RoundedHull(CORNERS * [1.5, 0.5, 0.25], 0.25), place, np.round(turns[1], digits)),
    )
    lower, upper = found.certificate().verify()
    assert found.volume - found.volume_error <= lower <= upper <= found.volume + found.volume_error


@pytest.mark.parametrize(("sides", "sure"), [(4, 1e-11), (12, 1e-11), (30, 1e-11), (80, 1e-3)])
def test_lids_that_are_flat_but_for_rounding_are_as_many_planes_as_they_have_triangles(sides, sure):
    # If a lid has more planes than a slice has lines, one plane stands for all. The error bound includes that.
    rng = np.random.default_rng(sides)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    angles = 2 * np.pi * np.arange(sides) / sides
    rim = np.stack([np.cos(angles), np.sin(angles)], 1)
    prism = Hull(np.vstack([np.column_stack([rim, np.full(sides, height)]) for height in (-0.5, 0.5)]) @ turn.T)
    found = overlap(Placed(Cylinder(0.5, 0.25), turn @ [0.1, 0, 0.75], rng.normal(size=4)), Placed(prism))
    by = found.depth - 1e-8
    a, b = found.shapes
    found = overlap(moved(a, by * np.array(found.normal)), b)
    lower, upper = found.certificate().verify()
    assert max(abs(found.volume - lower), abs(found.volume - upper)) <= found.volume_error <= sure * found.volume


@pytest.mark.parametrize("seed", [421, 693, 2590, 3551])
def test_the_nearer_of_two_parallel_planes_bounds_a_slice(seed):
    """Two triangles of a facet differ there by less than the corners far outside are right to."""
    case = make("round_contacts", seed)
    assert not a_turn_keeps_the_measures_of_round_bodies(case, overlap(*case.placed))


@pytest.mark.parametrize("seed", [3000461, 2000219])
def test_the_fold_of_a_facet_bent_by_rounding_is_known_beyond_double_precision(seed):
    """In caps 1e-12 deep, an angle of 1e-16 between two triangles changes the volume by a trillionth."""
    found = overlap(*make("round_contacts", seed).placed)
    lower, upper = found.certificate().verify()
    assert max(abs(found.volume - lower), abs(found.volume - upper)) <= found.volume_error <= 1e-13 * found.volume


def test_a_corner_far_along_a_slice_lies_on_the_line_that_is_near():
    # Along the capsule's side, the shallow wedge between an edge's planes is a million times as long as thick.
    quaternions = (
        (-0.5313145913072558, 0.5970141033675275, 0, 0.3989351404014111),
        (1.6266727903151692, 1.008756250097606, -0.19070143169002304, 1.1952774054593656),
    )
    capsule = Capsule(1.7147773662353345, 0.5468782601593691)
    box = Box([0.792969742836171, 0.3970358065590349, 0.6134672871300209])
    found = overlap(
        Placed(capsule, (-13636.426426100701, 8080.76746871306, 8716.486692016246), quaternions[0]),
        Placed(box, (-13638.381416296654, 8081.188494593891, 8715.509426177532), quaternions[1]),
    )
    lower, upper = found.certificate().verify()
    assert max(abs(found.volume - lower), abs(found.volume - upper)) <= found.volume_error <= 1e-12 * found.volume


@pytest.mark.parametrize("out", [1e-5, 1e-6])
def test_a_rim_that_just_leaves_the_end_of_a_capsule_is_cut_as_by_a_ball(out):
    """The corner of a slice is outside the ball between two samples, one of which is nearly on the ball."""
    capsule, ball = Placed(Capsule(0.4, 0.9), (0, 0, -0.45)), Sphere(0.4)
    for seed in (56, 57, 105, 172, 196, 204, 557, 599, 773):
        rng = np.random.default_rng(seed)
        quaternion = rng.normal(size=4)
        turn = rotation(quaternion / np.linalg.norm(quaternion))
        angle, slope = rng.uniform(0, 2 * np.pi), rng.uniform(0.2, 1.4)
        ahead = np.cos(angle) * turn[:, 0] + np.sin(angle) * turn[:, 1]
        tip = (0.4 + out) * (np.cos(slope) * ahead + np.sin(slope) * turn[:, 2])
        cylinder = Placed(Cylinder(0.12, 0.04), tip - 0.12 * ahead - 0.02 * turn[:, 2], quaternion)
        found, truth = overlap(capsule, cylinder), overlap(ball, cylinder)
        assert truth.volume < (1 - out**2 / 10) * cylinder.shape.volume
        assert abs(found.volume - truth.volume) <= found.volume_error + truth.volume_error, seed
