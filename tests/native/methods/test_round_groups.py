"""Three and more bodies, some of them round: slices, beside formulas, sums of halves and proofs."""

from fractions import Fraction

import graded
import numpy as np
import pytest
from numpy.testing import assert_allclose
from rounded_shapes import FLAT_TO_ROUNDING
from strategies import directions

from overlapper import Box, Capsule, Cylinder, HalfSpace, Hull, Placed, RoundedHull, Sphere, overlap
from overlapper.proof.certificate import certificate

MIXES = [
    ("ball", "ball", "ball"),
    ("ball", "ball", "ball", "ball", "ball"),
    ("ball", "ball", "capsule"),
    ("ball", "ball", "rounded hull"),
    ("ball", "box", "capsule"),
    ("ball", "box", "cylinder", "flat"),
    ("ball", "capsule", "capsule"),
    ("ball", "capsule", "cylinder", "flat"),
    ("ball", "cylinder", "rounded hull"),
    ("ball", "hull", "rounded hull"),
    ("box", "box", "cylinder"),
    ("box", "capsule", "cylinder"),
    ("box", "hull", "rounded hull"),
    ("box", "rounded hull", "rounded hull"),
    ("capsule", "capsule", "flat"),
    ("capsule", "hull", "hull"),
    ("cylinder", "cylinder", "hull"),
    ("cylinder", "flat", "flat"),
]


def of_kind(kind, rng):
    corners = 0.5 * rng.normal(size=(12, 3))
    shapes = {
        "ball": lambda: Sphere(rng.uniform(0.4, 0.8)),
        "capsule": lambda: Capsule(rng.uniform(0.2, 0.5), rng.uniform(0.2, 0.9)),
        "cylinder": lambda: Cylinder(rng.uniform(0.3, 0.6), rng.uniform(0.4, 1.2)),
        "box": lambda: Box(rng.uniform(0.3, 0.8, 3)),
        "hull": lambda: Hull(corners),
        "rounded hull": lambda: RoundedHull(corners[:8], rng.uniform(0.02, 0.1)),
        "flat": lambda: HalfSpace(rng.normal(size=3), 0.1),
    }
    return shapes[kind]()


def group(kinds, seed):
    """Placed shapes that overlap, by the first seed from `seed` on."""
    while True:
        rng = np.random.default_rng(seed)
        bodies = [Placed(of_kind(kind, rng), 0.25 * rng.normal(size=3), rng.normal(size=4)) for kind in kinds]
        if overlap(*bodies):
            return bodies, rng
        seed += 1000


def common_volume_of_three_balls(centres, radii):
    """The formula of Gibson and Scheraga (1987), for spheres that meet in two points."""
    apart = [np.linalg.norm(centres[(i + 1) % 3] - centres[(i + 2) % 3]) for i in range(3)]
    a2, r2 = np.square(apart), np.square(radii)
    e = [(r2[(i + 1) % 3] - r2[(i + 2) % 3]) / a2[i] for i in range(3)]
    pairs = e[0] * e[1] + e[1] * e[2] + e[2] * e[0]
    w = np.sqrt(r2 @ a2 * a2.sum() - 2 * r2 @ a2**2 + a2.prod() * (pairs - 1))
    q = []
    for i in range(3):
        b2, c2 = a2[(i + 1) % 3], a2[(i + 2) % 3]
        q.append(apart[i] * (b2 + c2 - a2[i] + r2.sum() - 3 * r2[i] + e[i] * (b2 - c2)))
    volume = w / 6
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        volume -= apart[i] / 2 * (r2[j] + r2[k] - a2[i] * (1 / 6 - e[i] ** 2 / 2)) * np.arctan2(2 * w, q[i])
        turns = np.arctan2(apart[j] * w * (1 - e[j]), radii[i] * q[j])
        turns += np.arctan2(apart[k] * w * (1 + e[k]), radii[i] * q[k])
        volume += 2 / 3 * radii[i] ** 3 * turns
    return volume


@pytest.mark.parametrize("seed", range(20))
def test_three_balls_share_the_volume_of_the_formula(seed):
    rng = np.random.default_rng(seed)
    centres, radii = np.zeros((3, 3)), rng.uniform(0.7, 0.8, 3)
    centres[1, 0], centres[2, :2] = 0.5, rng.uniform(0.2, 0.5, 2)
    found = overlap(*(Placed(Sphere(radius), centre) for radius, centre in zip(radii, centres)))
    exact = common_volume_of_three_balls(centres, radii)
    assert found.way == "slicing"
    assert found.volume_error <= 1e-12 * exact
    assert found.volume == pytest.approx(exact, rel=1e-13)


@pytest.mark.parametrize("kinds", MIXES, ids=" ".join)
def test_halves_add_up_to_the_whole(kinds):
    for seed in range(3):
        bodies, rng = group(kinds, seed)
        whole = overlap(*bodies)
        across = rng.normal(size=3)
        across /= np.linalg.norm(across)
        offset = across @ whole.centroid
        halves = [overlap(*bodies, Placed(HalfSpace(side * across, side * offset))) for side in (1, -1)]
        assert {part.way for part in (whole, *halves)} == {"slicing"}
        volumes = np.array([half.volume for half in halves])
        error = whole.volume_error + sum(half.volume_error for half in halves)
        assert error <= 1e-10 * whole.volume
        assert abs(volumes.sum() - whole.volume) <= error
        first = sum(volume * half.centroid for volume, half in zip(volumes, halves))
        assert_allclose(first / whole.volume, whole.centroid, atol=1e-10)
        section = halves[0].gradient[-1, :3] @ across
        assert halves[0].area + halves[1].area == pytest.approx(whole.area + 2 * section, rel=1e-8)


@pytest.mark.parametrize("kinds", MIXES, ids=" ".join)
def test_the_gradient_is_the_slope_of_the_volume(kinds):
    bodies, rng = group(kinds, 0)
    slopes = overlap(*bodies).gradient
    assert_allclose(slopes[:, :3].sum(axis=0), 0, atol=1e-10)
    step = 1e-5 * rng.normal(size=3)
    for i, body in enumerate(bodies):
        ends = [
            overlap(*bodies[:i], Placed(body.shape, body.position + way * step, body.orientation), *bodies[i + 1 :])
            for way in (1, -1)
        ]
        assert (ends[0].volume - ends[1].volume) / 2 == pytest.approx(slopes[i, :3] @ step, abs=1e-12)


@pytest.mark.parametrize(
    "kinds", [("ball", "capsule"), ("cylinder", "cylinder"), ("rounded hull", "ball")], ids=" ".join
)
def test_a_body_around_a_pair_changes_nothing(kinds):
    bodies, _ = group(kinds, 3)
    pair = overlap(*bodies)
    for around in (Sphere(9), Capsule(9, 2), Cylinder(8, 16), Box([5, 5, 5])):
        group_of_three = overlap(*bodies, Placed(around, [0.1, 0.2, 0.3]))
        assert group_of_three.volume == pytest.approx(pair.volume, rel=1e-11)
        assert group_of_three.area == pytest.approx(pair.area, rel=1e-9)
        assert_allclose(group_of_three.inertia, pair.inertia, rtol=1e-9, atol=1e-13)
        assert_allclose(group_of_three.gradient[2], 0, atol=1e-12)


def flat_but_for_rounding(seed):
    """A rounded hull with a core that is flat but for rounding, a half-space through its middle, a ball around both."""
    rng = np.random.default_rng(seed)
    turned = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    at = 10 ** rng.uniform(0, 6) * rng.normal(size=3)
    size = 10 ** rng.uniform(-1, 3)
    core = size * rng.normal(size=(rng.integers(4, 12), 2)) @ turned[:2] + at
    body = RoundedHull(core, size * 10 ** rng.uniform(-3, 1))
    middle = core.mean(0)
    around = Placed(Sphere(12 * (size + body.radius)), middle)
    return Placed(body), Placed(HalfSpace(rng.normal(size=3), 0), middle), around


def test_balls_between_many_planes_through_one_line():
    """Rounding puts planes through a corner of a flat core in a wrong order, so that their polytope has a fold."""
    body, plane, around = flat_but_for_rounding(3004)
    pair, found = overlap(body, plane), overlap(body, plane, around)
    assert abs(pair.volume - found.volume) <= pair.volume_error + found.volume_error


@pytest.mark.parametrize("seed", [324, 3824, 4382])
def test_wedges_that_are_thinner_than_they_are_tilted(seed):
    body, plane, around = flat_but_for_rounding(seed)
    pair, found = overlap(body, plane), overlap(body, plane, around)
    assert abs(pair.volume - found.volume) <= pair.volume_error + found.volume_error


def test_errors_count_edges_that_rounding_has_turned_back():
    assert overlap(RoundedHull(FLAT_TO_ROUNDING, 4.745431674454119), HalfSpace([0, 1, 0], -35.6)).volume_error > 0


def test_parallel_cylinders_are_separated_by_a_plane():
    """A prism over the common part of three equal discs about the corners of a triangle (Reuleaux)."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0.5, np.sqrt(0.75), 0]])
    found = overlap(*(Placed(Cylinder(1, 0.5), corner) for corner in corners))
    assert found.way == "slicing"
    assert found.volume == pytest.approx(0.5 * (np.pi - np.sqrt(3)) / 2, rel=1e-13)


def test_three_cylinders_of_other_directions_keep_the_dual_hull():
    """Slices are parallel to at most two axes. Three that cross at right angles share 8 (2 - √2) r³."""
    x, y, z = (0, 0.5**0.5, 0, 0.5**0.5), (0.5**0.5, 0, 0, 0.5**0.5), (0, 0, 0, 1)
    found = overlap(*(Placed(Cylinder(1, 4), orientation=turn) for turn in (x, y, z)))
    assert found.way == "dual hull"
    assert abs(found.volume - 8 * (2 - np.sqrt(2))) <= found.volume_error


def test_a_face_that_appears_just_beside_the_end_of_a_cylinder_is_found():
    """The side of one cylinder and a plane meet the ball twice, 1e-4 from the end of the other cylinder."""
    bodies = [
        Placed(Sphere(0.6863707176296412), [0.14602833234482449, 0.07875155820874424, -0.03917311964229461]),
        Placed(
            Box([0.5560012123074406, 0.5278298689162679, 0.6965102046012711]),
            [-0.4911232797219399, 0.02192017610181506, 0.20237705198631983],
            [0.6448589427333066, -0.4895392956298111, -0.09745326538528032, 0.5788014193805131],
        ),
        Placed(
            Capsule(0.42410854209427873, 0.3253438146691693),
            [-0.5281842352587306, -0.13779246503223738, -0.2752538223615371],
            [-0.9677481734444755, -0.1000011750430113, -0.22925753768066032, 0.0300702378025004],
        ),
        Placed(
            Cylinder(0.5385617358073049, 0.8982648504880218),
            [-0.09420837439893465, 0.06921670313382965, -0.06609404622229653],
            [0.723508017842422, 0.519644490740589, -0.15090724508670847, -0.42864058923651127],
        ),
        Placed(HalfSpace([-0.61833872601345, -0.630491320432681, -0.46918857058875374], 0.10450746157652646)),
    ]
    found = overlap(*bodies)
    low, high = certificate(found).verify()
    assert low - Fraction(found.volume_error) <= Fraction(found.volume) <= high + Fraction(found.volume_error)
    assert found.volume == pytest.approx(float(high), rel=1e-14)


@pytest.mark.parametrize(
    ("kinds", "seed"),
    [("ball, capsule", 10093), ("capsule, cylinder", 10201), ("capsule, capsule", 10346), ("ball, cylinder", 10376)],
)
def test_stated_errors_hold_where_a_plane_cuts_a_thin_lens_aslant(kinds, seed):
    """Rounding of the corner between the plane and an arc moves the corner off the arc."""
    contact = graded.made(kinds, seed)
    whole = overlap(contact.a, contact.b)
    for normal in directions(np.random.default_rng(5), 60):
        offset = float(normal @ whole.centroid)
        halves = [overlap(contact.a, contact.b, HalfSpace(side * normal, side * offset)) for side in (1, -1)]
        stated = sum(each.volume_error for each in (whole, *halves))
        assert abs(sum(half.volume for half in halves) - whole.volume) <= stated


@pytest.mark.parametrize("normal", [[1, 0, 1e-9], [1, 1.6e-9, 7e-9], [1, 0, -1e-8]])
def test_a_half_space_nearly_along_an_axis_cuts_aslant(normal):
    """The first component of its unit normal is 1, but its tilt shifts the far end of a large body by a micrometre."""
    cube = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    body, cut = Placed(RoundedHull(cube, 271)), Placed(HalfSpace(normal, 0), (235.193, -133.452, -23.7707))
    pair = overlap(body, cut)
    for around in (Placed(Box([1e4, 1e4, 1e4])), HalfSpace([0.36, 0.48, 0.8], 4000)):
        group = overlap(body, cut, around)
        assert abs(group.volume - pair.volume) <= group.volume_error + pair.volume_error
        assert group.volume_error <= 1e-11 * group.volume
