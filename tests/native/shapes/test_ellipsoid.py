"""An ellipsoid is the ball that it is an image of: by closed forms, that ball, cuts that add up, and directions."""

import pickle

import mpmath
import numpy as np
import pytest
from families import make
from flint import arb
from numpy.testing import assert_allclose, assert_array_equal
from round_exact import Cut, Piece
from round_truth import Solid, axes_of, dot, number, vector
from scipy.optimize import minimize
from strategies import quaternion, reach, rotation

from overlapper import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Placed,
    RoundedHull,
    Sphere,
    distance,
    overlap,
    penetration_depth,
)
from overlapper.polytopes.shape_text import alike, shape_of, text_of
from overlapper.reference import Fcl, fcl
from overlapper.simulation.bullet.inventory import _listed
from overlapper.viewer.tessellation import tessellation

EXACT = 1e-12
DEPTHS = [10.0**-k for k in range(1, 11)]
OTHERS = {
    "sphere": lambda rng: Sphere(rng.uniform(0.2, 1)),
    "capsule": lambda rng: Capsule(rng.uniform(0.2, 0.6), rng.uniform(0.2, 1.5)),
    "cylinder": lambda rng: Cylinder(rng.uniform(0.2, 0.6), rng.uniform(0.2, 1.5)),
    "box": lambda rng: Box(rng.uniform(0.2, 0.8, 3)),
    "hull": lambda rng: Hull(rng.normal(size=(9, 3)) * 0.5),
    "rounded hull": lambda rng: RoundedHull(rng.normal(size=(6, 3)) * 0.4, rng.uniform(0.05, 0.3)),
    "ellipsoid": lambda rng: slender(rng, 10),
    "half-space": lambda rng: HalfSpace(rng.normal(size=3), rng.normal() * 0.3),
}
FLAT = ("box", "hull", "half-space")


def slender(rng, most):
    """Up to so many times as long as thick."""
    return Ellipsoid(np.exp(rng.uniform(-1, 1, 3) * np.log(most) / 2) * 0.5)


def somewhere(rng, shape, far=0.3):
    return Placed(shape, rng.normal(size=3) * far, quaternion(rng))


def moved(body, shift):
    return Placed(body.shape, body.position + shift, body.given_orientation)


def sink(a, b, depth):
    """Two bodies moved along their normal until they are `depth` deep in one another, but for rounding."""
    found = overlap(a, b)
    return moved(a, (found.depth - depth if found else -found.distance - depth) * found.normal), b


def surface(half_axes):
    """By Carlson's symmetric integral."""
    a, b, c = (mpmath.mpf(float(h)) for h in half_axes)
    return float(4 * mpmath.pi * mpmath.elliprg(a * a * b * b, a * a * c * c, b * b * c * c))


def turned_about(body, vector_of_turn):
    """The body turned about its own position by a small rotation vector, in sixty digits: axes for `of_the_ball`."""
    x, y, z = (number(float(v)) / 2 for v in vector_of_turn)
    n = 1 + x * x + y * y + z * z
    rows = (
        ((1 + x * x - y * y - z * z) / n, 2 * (x * y - z) / n, 2 * (x * z + y) / n),
        (2 * (x * y + z) / n, (1 - x * x + y * y - z * z) / n, 2 * (y * z - x) / n),
        (2 * (x * z - y) / n, 2 * (y * z + x) / n, (1 - x * x - y * y + z * z) / n),
    )
    return tuple(tuple(dot(row, axis) for row in rows) for axis in axes_of(body))


def of_the_ball(ellipsoid, polyhedron, axes=None, shift=(0, 0, 0)):
    """Volume, first and second moments about the ellipsoid's centre along its axes, to twenty digits: those of the
    ball that it is an image of, by the route of round_exact."""
    half = vector(ellipsoid.shape.half_axes)
    centre = tuple(c + number(float(s)) for c, s in zip(vector(ellipsoid.position), shift))
    cuts = []
    for normal, offset, _ in Solid(polyhedron).pieces[0].planes:
        own = [h * dot(normal, axis) for h, axis in zip(half, axes or axes_of(ellipsoid))]
        length = sum((c * c for c in own), arb(0)).sqrt()
        cuts.append(([c / length for c in own], (offset - dot(normal, centre)) / length))
    slanted = axes_of(Placed(Sphere(1), orientation=(0.31, -0.47, 0.59, 0.58)))  # slices parallel to no face
    cuts = [Cut(tuple(dot(normal, axis) for axis in slanted), offset, True) for normal, offset in cuts]
    sums = Piece(True, arb(1), arb(-1), arb(1), cuts).integrals()
    det = half[0] * half[1] * half[2]
    back = [[axis[i] for axis in slanted] for i in range(3)]
    first = [half[i] * det * dot(back[i], sums[2:5]) for i in range(3)]
    xx, yy, zz, yz, zx, xy = sums[5:11]
    matrix = [[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]
    second = [
        [half[i] * half[j] * det * dot(back[i], [dot(row, back[j]) for row in matrix]) for j in range(3)]
        for i in range(3)
    ]
    return det * sums[0], first, second


def in_doubles(x):
    return np.array([[float(v.mid()) for v in row] for row in x])


def assert_is_exact(a, b, found):
    """Volume, centroid and inertia of an ellipsoid, the first, and a polyhedron."""
    volume, first, second = of_the_ball(a, b)
    off = float(abs(number(found.volume) - volume))
    assert off <= EXACT * found.volume
    assert off <= found.volume_error <= 1e-11 * found.volume
    middle = [m / volume for m in first]
    matrix = rotation(a.given_orientation)
    centroid = a.position + matrix @ in_doubles([middle])[0]
    central = (
        matrix
        @ in_doubles([[second[i][j] - volume * middle[i] * middle[j] for j in range(3)] for i in range(3)])
        @ matrix.T
    )
    inertia = np.trace(central) * np.eye(3) - central
    last = 4e-16 * np.abs(a.bounds).max()
    assert np.linalg.norm(found.centroid - centroid) <= found.errors.centroid + last
    assert found.errors.centroid <= 1e-9 * np.ptp(a.bounds, axis=0).max() + last
    assert_allclose(found.inertia, inertia, rtol=0, atol=1e-10 * np.trace(inertia))
    assert np.abs(found.inertia - inertia).max() <= found.errors.inertia + 1e-15 * np.trace(inertia)


# ------------------------------------------------------------------------------------------------------------ the shape


def test_an_ellipsoid_describes_itself():
    shape = Ellipsoid((1, 2, 3))
    assert repr(shape) == "Ellipsoid(half_axes=(1, 2, 3))"
    assert_array_equal(shape.half_axes, [1, 2, 3])
    assert shape.volume == pytest.approx(8 * np.pi, rel=1e-15)
    assert_array_equal(shape.centroid, [0, 0, 0])
    assert_array_equal(shape.bounds, [[-1, -2, -3], [1, 2, 3]])
    again = pickle.loads(pickle.dumps(shape))
    assert type(again) is Ellipsoid and repr(again) == repr(shape)
    assert_array_equal(again.half_axes, shape.half_axes)
    turned = Placed(shape, (1, 0, 0), (0, 0, 1, 1))
    assert_allclose(turned.bounds, [[-1, -1, -3], [3, 1, 3]], rtol=0, atol=1e-15)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize(
    ("value", "message"),
    [
        (0.0, "half_axes must be greater than 0, not 0.0"),
        (-1.0, "half_axes must be greater than 0, not -1.0"),
        (np.nan, "half_axes must be finite"),
        (np.inf, "half_axes must be finite"),
        (1e-25, "half_axes must be between 1e-25 and 1e25 m"),
        (1e25, "half_axes must be between 1e-25 and 1e25 m"),
    ],
)
def test_invalid_half_axes_are_refused(axis, value, message):
    half_axes = np.ones(3)
    half_axes[axis] = value
    with pytest.raises(ValueError, match=message):
        Ellipsoid(half_axes)


def test_arguments_of_another_kind_are_refused():
    for wrong in (1.0, [1, 2], "abc", None, [[1, 2, 3]]):
        with pytest.raises((TypeError, ValueError), match="half_axes"):
            Ellipsoid(wrong)


def test_an_ellipsoid_is_read_and_written_and_listed():
    shape = Ellipsoid([0.1, 0.2, 1 / 3])
    assert text_of(shape) == f'["Ellipsoid", [0.1, 0.2, {1 / 3!r}]]'
    assert_array_equal(shape_of(text_of(shape)).half_axes, shape.half_axes)
    assert alike(shape, Ellipsoid([0.1, 0.2, 1 / 3 + 1e-11])) and not alike(shape, Ellipsoid([0.1, 0.2, 0.3334]))
    with pytest.raises(ValueError, match="half_axes must be greater than 0"):
        shape_of('["Ellipsoid", [0.1, 0.2, -1]]')
    listed = _listed(Placed(shape))
    assert (listed.kind, listed.size) == ("ellipsoid", "half axes 0.1 × 0.2 × 0.3333")


def test_an_ellipsoid_is_drawn_on_its_surface():
    half_axes = np.array([0.1, 0.2, 0.9])
    drawn = tessellation(Ellipsoid(half_axes))
    assert_allclose(np.linalg.norm(drawn.vertices / half_axes, axis=1), 1, rtol=1e-12)
    assert_allclose(np.linalg.norm(drawn.normals, axis=1), 1, rtol=1e-12)
    assert ((drawn.normals * drawn.vertices / half_axes**2).sum(axis=1) > 0).all()
    a, b, c = np.moveaxis(drawn.vertices[drawn.faces], 1, 0)
    assert np.einsum("ki,ki->", a, np.cross(b, c)) / 6 == pytest.approx(Ellipsoid(half_axes).volume, rel=0.01)


def test_an_ellipsoid_has_no_referee_and_says_so():
    pair = Placed(Ellipsoid([1, 2, 3])), Box([1, 1, 1])
    if fcl is not None:
        with Fcl() as referee:
            assert referee.compare(overlap(*pair)).explanation.startswith("FCL is not asked about ellipsoids")


def test_method_paper_stretches_a_ball():
    ellipsoid, box = Placed(Ellipsoid([0.5, 1, 2]), (0.1, 0, 0), (1, 2, 3, 4)), Placed(Box([1, 1, 1]))
    found = overlap(ellipsoid, box, method="paper", tolerance=1e-3)
    assert found.volume == pytest.approx(overlap(ellipsoid, box).volume, rel=2e-3)
    assert abs(found.volume - overlap(ellipsoid, box).volume) <= found.volume_error


# --------------------------------------------------------------------------------------------------- equal axes: a ball


@pytest.mark.parametrize("kind", OTHERS)
def test_an_ellipsoid_with_equal_axes_answers_as_a_sphere(kind):
    rng = np.random.default_rng(5)
    for depth in (0.3, 1e-3, 1e-8, -0.2):
        radius = rng.uniform(0.2, 0.8)
        ball, other = sink(somewhere(rng, Sphere(radius)), somewhere(rng, OTHERS[kind](rng)), depth)
        same = Placed(Ellipsoid([radius] * 3), ball.position, ball.given_orientation)
        found, expected = overlap(same, other), overlap(ball, other)
        assert (found.status, found.way) == (expected.status, expected.way)
        if kind == "ellipsoid":  # enclosed, from the one that comes first
            assert abs(found.volume - expected.volume) <= found.volume_error + expected.volume_error
            continue
        assert found.volume == pytest.approx(expected.volume, rel=1e-12)
        assert found.area == pytest.approx(expected.area, rel=1e-12)
        assert found.depth == pytest.approx(expected.depth, rel=0, abs=1e-14)
        assert found.distance == pytest.approx(expected.distance, rel=0, abs=1e-14)
        assert_allclose(found.gradient, expected.gradient, rtol=0, atol=1e-12 * np.abs(expected.gradient).max())


# ---------------------------------------------------------------------------------------------------- beside polyhedra


@pytest.mark.parametrize("kind", FLAT)
@pytest.mark.parametrize("most", [3, 1000])
def test_volume_centroid_and_inertia_are_those_of_the_ball_at_any_depth(kind, most):
    rng = np.random.default_rng(11)
    for depth in DEPTHS:
        a, b = sink(somewhere(rng, slender(rng, most)), somewhere(rng, OTHERS[kind](rng)), depth)
        found = overlap(a, b)
        assert found and found.way in ("slicing", "closed form")
        assert_is_exact(a, b, found)


@pytest.mark.parametrize(("size", "far"), [(1e-3, 0), (1, 1e3), (1e3, 0), (1e-3, 1e3)])
def test_extreme_sizes_and_far_places_keep_the_digits(size, far):
    rng = np.random.default_rng(4)
    for kind in FLAT[:2]:
        for depth in (0.2, 1e-4):
            a = Placed(Ellipsoid(size * slender(rng, 30).half_axes), rng.normal(size=3), quaternion(rng))
            half = size * rng.uniform(0.3, 0.9, 3)
            b = Box(half) if kind == "box" else Hull(rng.normal(size=(8, 3)) * half)
            a, b = sink(a, Placed(b, np.array([far, -far, far / 2]), quaternion(rng)), depth * size)
            assert_is_exact(a, b, overlap(a, b))


@pytest.mark.parametrize("seed", range(3))
def test_the_gradient_is_the_difference_of_volumes_in_sixty_digits(seed):
    rng = np.random.default_rng([31, seed])
    a, b = sink(somewhere(rng, slender(rng, 5)), somewhere(rng, OTHERS[FLAT[seed]](rng)), 0.1)
    found, step = overlap(a, b), 1e-9
    for k in range(6):
        way = step * np.eye(6)[k]
        ahead, behind = (of_the_ball(a, b, axes=turned_about(a, s * way[3:]), shift=s * way[:3])[0] for s in (1, -1))
        slope = float((ahead - behind).mid()) / (2 * step)
        error = found.errors.gradient[0][k // 3] + 1e-12 * np.abs(found.gradient).max()
        assert abs(found.gradient[0, k] - slope) <= error
    assert_allclose(found.gradient[1, :3], -found.gradient[0, :3], rtol=0, atol=1e-14)


@pytest.mark.parametrize("most", [2, 30, 1000])
def test_octants_add_up_to_the_ellipsoid(most):
    """Volume, first moment and area, whose parts count what they share twice."""
    rng = np.random.default_rng(7)
    for _ in range(6):
        shape = slender(rng, most)
        body, side = Placed(shape, (0, 0, 0), quaternion(rng)), 2.0**8
        corner = np.round(rng.uniform(-0.4, 0.4, 3) * shape.half_axes.min() * 2.0**12) / 2.0**12
        signs = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
        parts = [overlap(body, Placed(Box([side] * 3), corner + side * np.array(s))) for s in signs]
        assert {part.way for part in parts} <= {"slicing", "closed form"}
        volume = sum(part.volume for part in parts)
        assert volume == pytest.approx(shape.volume, rel=EXACT)
        assert abs(volume - shape.volume) <= sum(part.volume_error for part in parts)
        first = sum(part.volume * part.centroid for part in parts)
        assert np.linalg.norm(first) <= 1e-12 * volume * shape.half_axes.max()
        area = sum(part.area - np.abs(part.gradient[1, :3]).sum() for part in parts)
        assert area == pytest.approx(surface(shape.half_axes), rel=1e-11)
        assert abs(area - surface(shape.half_axes)) <= sum(part.errors.area for part in parts)
        assert max(part.errors.area / part.area for part in parts) < 1e-9


@pytest.mark.parametrize("half_axes", [(1, 2, 3), (0.001, 0.5, 1), (1e-3, 2e-3, 1), (1, 1, 1.0001)])
def test_the_whole_ellipsoid_has_carlsons_area(half_axes):
    body = Placed(Ellipsoid(half_axes), (0.1, 0.2, 0.3), (1, 2, 3, 4))
    found = overlap(body, Box([9, 9, 9]))
    assert found.area == pytest.approx(surface(half_axes), rel=1e-13)
    assert found.volume == pytest.approx(body.volume, rel=1e-15)
    assert_allclose(found.gradient, 0, atol=0)


@pytest.mark.parametrize("half_axes", [(1, 1, 0.25), (0.5, 0.5, 1.5)])
@pytest.mark.parametrize("level", [-0.9, -0.1, 0.0, 0.6])
def test_a_spheroid_cut_across_its_axis_has_the_area_of_a_surface_of_revolution(half_axes, level):
    a, c = mpmath.mpf(half_axes[0]), mpmath.mpf(half_axes[2])
    height = level * half_axes[2]
    found = overlap(Placed(Ellipsoid(half_axes)), HalfSpace((0, 0, 1), height))
    # r = a √(1 − z²/c²), and r √(1 + r'²) = a √(1 + (a² − c²) z² / c⁴).
    side = 2 * mpmath.pi * a * mpmath.quad(lambda z: mpmath.sqrt(1 + (a * a - c * c) * z * z / c**4), [-c, height])
    lid = mpmath.pi * a * a * (1 - mpmath.mpf(height) ** 2 / c**2)
    assert found.area == pytest.approx(float(side + lid), rel=1e-12)
    assert abs(found.area - float(side + lid)) <= found.errors.area


@pytest.mark.parametrize("seed", range(40))
def test_stretched_caps_and_octants_have_closed_forms(seed):
    case = make("ellipsoids", seed)
    found = overlap(*case.placed)
    assert found.volume == pytest.approx(case.closed_form, rel=EXACT)


def test_the_common_part_of_nested_bodies_is_the_smaller_body():
    big = Placed(Ellipsoid([2, 3, 4]), (1, 1, 1), (1, 2, 3, 4))
    for small in (Box([0.5, 0.6, 0.7]), Hull(np.random.default_rng(0).uniform(-0.8, 0.8, (12, 3)))):
        found = overlap(big, Placed(small, (1.2, 0.9, 1)))
        assert found.volume == pytest.approx(small.volume, rel=EXACT)
    for small in (Sphere(0.8), Capsule(0.3, 0.8), Ellipsoid([0.3, 0.5, 0.9])):
        found = overlap(big, Placed(small, (1.2, 0.9, 1)))
        assert abs(found.volume - small.volume) <= found.volume_error <= 2e-3 * small.volume


# ------------------------------------------------------------------------------------------- depth, distance, witnesses


def least_width(a, b, stated, rng):
    """The least of how far a reaches along a direction and b against it, minus the distance if they are apart, by
    looking at many directions and going on from the best of them."""

    def width(n):
        n = n / np.linalg.norm(n)
        return reach(a, n) + reach(b, -n)

    directions = np.vstack([rng.normal(size=(1500, 3)), stated])
    values = np.array([width(n) for n in directions])
    best = min(values)
    for i in np.argsort(values)[:4]:
        best = min(best, minimize(width, directions[i], method="Nelder-Mead", options={"xatol": 1e-13}).fun)
    return best


@pytest.mark.parametrize("kind", list(OTHERS)[:-1])
@pytest.mark.parametrize("most", [5, 100])
def test_depth_and_distance_are_the_least_width_over_all_directions(kind, most):
    rng = np.random.default_rng(8)
    for _ in range(3):
        a = somewhere(rng, slender(rng, most), rng.choice([0.1, 0.6, 1.5]))
        b = somewhere(rng, OTHERS[kind](rng))
        found = overlap(a, b)
        stated = found.depth if found else -found.distance
        size = max(np.ptp(a.bounds, axis=0).max(), np.ptp(b.bounds, axis=0).max())
        least = least_width(a, b, -found.normal, rng)
        assert abs(reach(a, -found.normal) + reach(b, found.normal) - stated) <= 1e-13 * size
        assert -1e-9 * size <= least - stated + 1e-14 * size  # no direction is shorter
        assert stated <= least + 1e-13 * size
        assert max(found.errors.depth, found.errors.distance) <= 1e-12 * size
        if not found:
            assert found.errors.witnesses <= 1e-12 * size
            apart = found.witness_a - found.witness_b
            assert np.linalg.norm(apart) == pytest.approx(found.distance, rel=0, abs=1e-13 * size)
        assert distance(a, b) == pytest.approx(found.distance, rel=0, abs=1e-13 * size)
        assert penetration_depth(a, b) == pytest.approx(found.depth, rel=0, abs=1e-13 * size)


@pytest.mark.parametrize("kind", list(OTHERS))
@pytest.mark.parametrize("depth", [*DEPTHS, *(-d for d in DEPTHS[::3])])
def test_the_status_is_right_at_any_depth(kind, depth):
    rng = np.random.default_rng(12)
    a, b = sink(somewhere(rng, slender(rng, 20)), somewhere(rng, OTHERS[kind](rng)), depth)
    found = overlap(a, b)
    assert found.status == ("overlapping" if depth > 0 else "separated")
    assert found.depth - found.distance == pytest.approx(depth, rel=0, abs=1e-12)


def test_a_flat_ellipsoid_is_left_along_its_shortest_axis_even_past_its_middle():
    """A corner above the middle of a plate is nearest to the top, but the box is in the way there."""
    plate = Placed(Ellipsoid([4, 3, 0.5]))
    below = Placed(Hull([(0, 0, 0.1), (-9, -9, -9), (9, -9, -9), (0, 9, -9)]), (0, 0, 0))
    found = overlap(plate, below)
    assert_allclose(found.normal, [0, 0, 1], atol=1e-3)
    assert found.depth == pytest.approx(0.6, rel=0.01)
    for shift in (0.999, 1.001):
        apart = overlap(moved(plate, shift * found.depth * found.normal), below)
        assert apart.status == ("overlapping" if shift < 1 else "separated")


def test_the_shortest_way_out_of_a_halfspace_is_straight_up():
    body = Placed(Ellipsoid([1, 2, 3]), (0, 0, 0.5), (1, 1, 0, 2))
    found = overlap(body, HalfSpace((0, 0, 1), 0))
    assert found.depth == pytest.approx(-body.bounds[0, 2], rel=1e-15)
    assert_array_equal(found.normal, [0, 0, 1])


@pytest.mark.parametrize("seed", [4300658, 4301494, 4301676])
def test_octants_of_a_needle_have_the_area_that_is_stated(seed):
    """As given, and turned so that the slices lie across other axes."""
    case = make("ellipsoids", seed)
    body, box = sorted(case.placed, key=lambda placed: isinstance(placed.shape, Box))
    a, b, c = body.shape.half_axes
    cut = box.position != body.position
    flat = np.pi * np.array([b * c, c * a, a * b])[cut].sum() / 2 ** (cut.sum() - 1)
    truth = surface(body.shape.half_axes) / 2 ** cut.sum() + flat
    rng = np.random.default_rng(seed)
    for q in ([0.0, 0.0, 0.0, 1.0], *rng.normal(size=(4, 4))):
        at = rotation(q) @ (box.position - body.position)
        found = overlap(Placed(body.shape, orientation=q), Placed(box.shape, at, q))
        assert abs(found.area - truth) <= found.errors.area + 1e-15 * truth
        assert found.errors.area <= 1e-10 * truth
