"""Volumes of pairs with round bodies are proved to a trillionth at any depth, by another route than the core's."""

import sys
from fractions import Fraction
from itertools import combinations_with_replacement

import families
import numpy as np
import pytest
from flint import arb, ctx
from round_exact import exactly
from round_truth import number

from overlapper import Box, Capsule, Cylinder, HalfSpace, Hull, Overlap, Placed, RoundedHull, Sphere, overlap
from overlapper.proof.certificate import certificate
from overlapper.proof.claims import Bracketed, CertificateError
from overlapper.proof.rational_body import RationalBody
from overlapper.proof.volume import Common, proved_bounds
from overlapper.quaternion import composed

NARROW = Fraction(1, 10**13)
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
CUBE = RoundedHull(CORNERS / 2, 0.125)
QUARTER = (1.0, 0.0, 0.0, 1.0)
SHAPES = {
    "sphere": lambda rng: Sphere(rng.uniform(0.2, 0.8)),
    "capsule": lambda rng: Capsule(rng.uniform(0.2, 0.6), rng.uniform(0.2, 1.5)),
    "cylinder": lambda rng: Cylinder(rng.uniform(0.2, 0.6), rng.uniform(0.2, 1.5)),
    "rounded": lambda rng: RoundedHull(rng.normal(size=(5, 3)) * 0.4, rng.uniform(0.05, 0.3)),
    "rounded box": lambda rng: RoundedHull(CORNERS * rng.uniform(0.2, 0.6, 3), rng.uniform(0.02, 0.3)),
    "box": lambda rng: Box(rng.uniform(0.2, 0.8, 3)),
    "hull": lambda rng: Hull(rng.normal(size=(8, 3)) * 0.5),
    "half-space": lambda rng: HalfSpace(rng.normal(size=3), rng.normal() * 0.3),
}
ROUND = ["sphere", "capsule", "cylinder", "rounded", "rounded box"]
PAIRS = [(a, b) for i, a in enumerate(SHAPES) for b in [*SHAPES][i:] if a in ROUND]
# Poses of two bodies in which many numbers are equal, or next to it.
TURNS = {
    "general": lambda rng: rng.normal(size=4),
    "aligned": lambda rng: np.array([0.0, 0.0, 0.0, 1.0]),
    "crossed": lambda rng: np.eye(4)[rng.integers(3)] + np.eye(4)[3],
    "nearly aligned": lambda rng: np.array([0.0, 0.0, 0.0, 1.0]) + rng.normal(size=4) * 10.0 ** -rng.integers(4, 12),
}


def bounds(a, b):
    return proved_bounds((a, b), lambda found: found[1] - found[0] <= found[0] * NARROW)


def holds(found, truth):
    """Whether the bounds hold a number that is known to sixty digits."""
    lower, upper = (number(bound) for bound in found)
    return not (truth < lower or truth > upper)


def precisely(value):
    with ctx.workdps(60):
        return value()


CLOSED_FORMS = {
    "lens": (Placed(Sphere(1.0)), Placed(Sphere(1.0), (1.0, 0, 0)), lambda: arb.pi() * 5 / 12),
    "cap": (Placed(Sphere(2.0)), Placed(HalfSpace((0, 0, 1), -1.0)), lambda: arb.pi() * 5 / 3),
    "corner of a box": (Placed(Sphere(1.0)), Placed(Box([1, 1, 1]), (1, 1, 1)), lambda: arb.pi() / 6),
    "ball": (Placed(Sphere(0.5), (0.1, 0.2, 0)), Placed(Cylinder(1.0, 4.0)), lambda: arb.pi() / 6),
    "ball in a cylinder as wide": (Placed(Sphere(0.5)), Placed(Cylinder(0.5, 2.0)), lambda: arb.pi() / 6),
    "ball of a capsule": (Placed(Sphere(0.5)), Placed(Capsule(0.5, 2.0)), lambda: arb.pi() / 6),
    "the same capsule": (Placed(Capsule(0.5, 1.0)), Placed(Capsule(0.5, 1.0)), lambda: arb.pi() * 5 / 12),
    "Viviani": (Placed(Sphere(2.0)), Placed(Cylinder(1.0, 9.0), (1.0, 0, 0)), lambda: arb(16) / 9 * (3 * arb.pi() - 4)),
    "bicylinder": (Placed(Cylinder(1.0, 9.0)), Placed(Cylinder(1.0, 9.0), (0, 0, 0), QUARTER), lambda: arb(16) / 3),
    "cylinder through a ball": (Placed(Sphere(5.0)), Placed(Cylinder(3.0, 8.0)), lambda: 72 * arb.pi()),
    "parallel cylinders": (
        Placed(Cylinder(1.0, 2.0)),
        Placed(Cylinder(1.0, 2.0), (1.0, 0, 1.0)),
        lambda: 2 * arb.pi() / 3 - arb(3).sqrt() / 2,
    ),
    "Steiner": (
        Placed(CUBE),
        Placed(RoundedHull(CORNERS / 2, 0.25)),
        lambda: 1 + arb(6) / 8 + arb.pi() * 3 / 64 + arb.pi() / 6 / 64,
    ),
    "rounded cubes side by side": (
        Placed(CUBE),
        Placed(CUBE, (1.0, 0, 0)),
        lambda: arb(1) / 4 + arb.pi() / 32 + arb.pi() / 384,
    ),
}


@pytest.mark.parametrize("name", CLOSED_FORMS)
def test_bounds_hold_the_closed_form(name):
    a, b, truth = CLOSED_FORMS[name]
    assert holds(bounds(a, b), precisely(truth))
    assert holds(bounds(b, a), precisely(truth))


def test_a_rounded_hull_is_the_sum_of_its_pieces_by_steiner():
    """Steiner's formula uses volume, area and mean width of the core. Area comes from facets, mean width from edges."""
    rng = np.random.default_rng(3)
    around = Placed(Box([9, 9, 9]), (0.1, 0.2, 0.3), rng.normal(size=4))
    for _ in range(5):
        radius, points = 0.25, rng.normal(size=(9, 3))
        core = Hull(points)
        normals = core.halfspaces[:, :3]
        volume = core.volume + 4 / 3 * np.pi * radius**3
        edges: dict[frozenset, list] = {}
        for k, ring in enumerate(core.facets):
            corners = core.vertices[ring]
            volume += radius * np.linalg.norm(sum(np.cross(p, q) for p, q in zip(corners, np.roll(corners, -1, 0)))) / 2
            for p, q in zip(ring, np.roll(ring, -1)):
                edges.setdefault(frozenset((int(p), int(q))), []).append(k)
        for (p, q), (i, j) in edges.items():
            bend = np.arccos(np.clip(normals[i] @ normals[j], -1, 1))
            volume += radius**2 / 2 * bend * np.linalg.norm(core.vertices[p] - core.vertices[q])
        lower, upper = bounds(Placed(RoundedHull(points, radius), (1, 2, 3), rng.normal(size=4)), around)
        assert float(lower) == pytest.approx(volume, rel=1e-13)
        assert upper <= lower * (1 + NARROW)


@pytest.mark.parametrize("first", ["sphere", "capsule", "cylinder"])
@pytest.mark.parametrize("second", ["box", "hull", "half-space"])
def test_bounds_are_where_integrals_along_the_axis_are(first, second):
    rng = np.random.default_rng([7, len(first), len(second)])
    a, b = (Placed(SHAPES[name](rng), rng.normal(size=3) * 0.2, rng.normal(size=4)) for name in (first, second))
    lower, upper = bounds(a, b)
    truth = exactly(a, b).volume
    assert abs(float((lower + upper) / 2) - truth) <= 4e-16 * truth


def enlarged(shape, by):
    match shape:
        case Sphere():
            return Sphere(by * shape.radius)
        case Capsule() | Cylinder():
            return type(shape)(by * shape.radius, by * shape.length)
        case RoundedHull():
            return RoundedHull(by * shape.core.vertices, by * shape.radius)
        case Box():
            return Box(by * shape.half_extents)
        case Hull():
            return Hull(by * shape.vertices)
        case _:
            return shape


def sunk(rng, first, second, turns, larger=1.0, away=0.0):
    """Two bodies that overlap by a random depth, from 1e-1 to 1e-10 m or any depth."""
    places = [rng.normal(size=3) * 0.3 for _ in range(2)]
    if turns != "general" and rng.random() < 0.5:
        places = [np.round(8 * place * (rng.random(3) < 0.5)) / 8 for place in places]
    a, b = (
        Placed(enlarged(SHAPES[name](rng), by), place + away, TURNS[turns](rng))
        for name, place, by in zip((first, second), places, (1.0, larger))
    )
    if turns != "general" and first == second and rng.random() < 0.3:
        b = Placed(a.shape, b.position, b.orientation)
    if rng.random() < 0.7:
        found, depth = overlap(a, b), 10.0 ** -rng.integers(1, 11)
        way = (found.depth if found else -found.distance) - depth
        a = Placed(a.shape, np.array(a.position) + way * np.array(found.normal), a.orientation)
    return a, b


class Planted:
    """An overlap that tells of other bodies than it was found of."""

    def __init__(self, found, shapes):
        self.status, self.shapes = found.status, shapes


def disagreement(found: Overlap) -> str:
    lower, upper = certificate(found).verify()
    volume, error = Fraction(found.volume), Fraction(found.volume_error)
    if upper > lower * (1 + NARROW):
        return f"bounds are {float(upper / lower - 1):.1e} apart"
    if volume - error <= lower and upper <= volume + error:
        return ""
    return f"{float((volume - lower) / lower):.1e} off, where {float(error / volume):.1e} are stated"


@pytest.mark.parametrize("turns", TURNS)
@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_measured_intervals_contain_the_proved_bounds(first, second, turns):
    rng = np.random.default_rng([11, *map(ord, first + second + turns)])
    wrong = {}
    for _ in range(2):
        a, b = sunk(rng, first, second, turns)
        found = overlap(a, b)
        if found:
            wrong[a, b] = disagreement(found)
    assert not any(wrong.values()), wrong


@pytest.mark.parametrize("first", ROUND)
@pytest.mark.parametrize("larger", [1e-3, 1e3])
def test_neither_size_nor_place_costs_digits(first, larger):
    rng = np.random.default_rng([13, *map(ord, first), int(larger)])
    wrong = {}
    for second in SHAPES:
        a, b = sunk(rng, first, second, "general", larger, rng.normal(size=3) * rng.choice([0, 1e4]))
        found = overlap(a, b)
        if found:
            wrong[a, b] = disagreement(found)
    assert not any(wrong.values()), wrong


# A turn of a cube that leaves a facet, an edge or a corner for its lowest part.
LOWEST = {
    "facet": (0.0, 0.0, 0.0, 1.0),
    "edge": (np.sin(np.pi / 8), 0.0, 0.0, np.cos(np.pi / 8)),
    "corner": (0.8, -0.8, 0.0, 1.5),
}


@pytest.mark.parametrize("depth", [0.2, 1e-3, 1e-8])
@pytest.mark.parametrize(("lower", "upper"), [*combinations_with_replacement(LOWEST, 2)])
def test_rounded_bodies_meet_at_facets_edges_and_corners(lower, upper, depth):
    rng = np.random.default_rng([17, *map(ord, lower + upper)])
    shapes = CUBE, RoundedHull(CORNERS * (0.4, 0.3, 0.5), 0.05)
    for tilt in (0.0, 1e-3, 0.1):
        yaw = [0, 0, *rng.normal(size=2)]
        turns = [
            composed(tilted(rng, tilt), composed(np.array(yaw), np.array(LOWEST[name]))) for name in (lower, upper)
        ]
        a, b = Placed(shapes[0], (0, 0, 0), turns[0]), Placed(shapes[1], (0.02, -0.03, 1.0), turns[1])
        for _ in range(2):
            found = overlap(a, b)
            way = (found.depth if found else -found.distance) - depth
            b = Placed(b.shape, np.array(b.position) - way * np.array(found.normal), b.orientation)
        found = overlap(a, b)
        assert found and not disagreement(found), (a, b)
        assert found.volume_error <= 1e-12 * found.volume, (a, b)


def tilted(rng, angle):
    return np.array([*rng.normal(size=3) * angle / 2, 1.0])


def test_pieces_of_a_body_share_no_volume_and_leave_none_out():
    """The common volume with a ball equals the sum over the pieces of a body, and an estimate by random points."""
    rng = np.random.default_rng(2)
    a, b = Placed(CUBE, (0, 0, 0), rng.normal(size=4)), Placed(Sphere(0.5), (0.5, 0.4, 0.3))
    lower, _ = bounds(a, b)
    points = rng.uniform(-0.5, 0.5, (200_000, 3)) + b.position
    points = points[np.linalg.norm(points - b.position, axis=1) <= 0.5]
    axes = RationalBody(a).axes.astype(float)
    outside = np.maximum(abs(points @ axes) - 0.5, 0)
    count = (np.linalg.norm(outside, axis=1) <= 0.125).sum()
    assert float(lower) == pytest.approx(count / 200_000, abs=6 * np.sqrt(count) / 200_000)


def test_far_from_the_origin_and_of_any_size_nothing_is_lost():
    rng = np.random.default_rng(4)
    for size in (1e-6, 1.0, 1e6):
        for away in (0.0, 1e3 * size, 1e9 * size):
            place = away * np.array([1.0, -2.0, 0.5])
            a = Placed(Capsule(0.5 * size, size), place, rng.normal(size=4))
            b = Placed(Cylinder(0.25 * size, 2 * size), place + size * np.array([0.25, 0.5, 0]), rng.normal(size=4))
            lower, upper = bounds(a, b)
            assert 0 < lower <= upper <= lower * (1 + NARROW)


def test_the_plane_of_an_end_may_halve_a_ball():
    long = Placed(Cylinder(1.0, 4.0))
    for place, radius in [((0.5, 0, 0), 0.5**0.5), ((0.75, 0.25, 0), 0.5), ((-0.125, 0, 0), 1.0)]:
        lower, upper = bounds(long, Placed(Sphere(radius), place))
        low, high = bounds(Placed(Cylinder(1.0, 4.0), (0, 0, 2)), Placed(Sphere(radius), place))
        assert 2 * low <= upper and lower <= 2 * high


def test_a_proof_does_not_ask_for_the_order_of_bodies():
    rng = np.random.default_rng(6)
    for first, second in PAIRS:
        a, b = (Placed(SHAPES[name](rng), rng.normal(size=3) * 0.2, rng.normal(size=4)) for name in (first, second))
        if overlap(a, b):
            (lower, upper), (low, high) = bounds(a, b), bounds(b, a)
            assert lower <= high and low <= upper


def test_bodies_that_share_nothing_have_no_bounds_of_a_volume():
    assert bounds(Placed(Sphere(1.0)), Placed(Cylinder(1.0, 2.0), (3.0, 0, 0))) == (0, 0)
    apart = Planted(overlap(Sphere(1.0), Sphere(1.0)), (Placed(Sphere(1.0)), Placed(Sphere(1.0), (3.0, 0, 0))))
    with pytest.raises(CertificateError, match="the bodies share no volume"):
        certificate(apart)
    with pytest.raises(CertificateError, match="one of the bodies must be bounded"):
        Common(Placed(HalfSpace((0, 0, 1), 0.0)), Placed(HalfSpace((0, 0, -1), 0.0)))


def test_a_lie_in_the_last_digit_is_found():
    a, b = Placed(Capsule(0.5, 1.0)), Placed(Cylinder(0.25, 2.0), (0.25, 0.5, 0), (0.1, 0.2, 0.3, 0.9))
    lower, upper = bounds(a, b)
    step = lower / 10**12
    assert Bracketed((a, b), lower - step, upper + step).verify() == (lower - step, upper + step)
    both = proved_bounds((a, b), lambda found: found[1] - found[0] <= found[0] / 10**60)
    assert lower <= both[0] <= both[1] <= upper
    assert Bracketed((a, b), *both).verify() == both
    for low, high in ((upper, upper + step), (lower - step, lower), (lower - 2 * step, lower - step)):
        with pytest.raises(CertificateError, match="the common volume must lie between"):
            Bracketed((a, b), low, high).verify()


def test_a_side_of_slices_may_go_through_the_pole_of_a_ball():
    case = families.make("special_poses", 4002152)
    found = overlap(*case.placed)
    lower, upper = bounds(*case.placed)
    assert found.volume - found.volume_error <= lower <= upper <= found.volume + found.volume_error


def test_bodies_that_only_touch_are_not_proved_to_share_anything():
    a, b = Placed(Sphere(1.0)), Placed(Sphere(1.0), (2.0, 0, 0))
    with pytest.raises(CertificateError, match=r"^the common volume could not be bounded: the bodies may only touch$"):
        proved_bounds((a, b), lambda found: found[0] > 0)


def test_without_its_library_a_certificate_says_what_to_install(monkeypatch):
    found = overlap(Placed(Sphere(1.0)), Placed(Sphere(1.0), (1.0, 0, 0)))
    claim = certificate(found)
    for name in [
        name for name in sys.modules if name.partition(".")[0] == "flint" or name == "overlapper.proof.volume"
    ]:
        monkeypatch.setitem(sys.modules, name, None)
    for ask in (claim.verify, lambda: certificate(found)):
        with pytest.raises(ImportError, match="needs python-flint: pip install python-flint"):
            ask()


def test_a_certificate_is_short_in_words():
    cube = Box([0.5, 0.5, 0.5])
    three = Placed(cube), Placed(Sphere(0.6), (0.2, 0, 0)), Placed(Capsule(0.3, 0.5), (0.3, 0.1, 0))
    pairs = (
        (Placed(Sphere(1.0)), Placed(Sphere(1.0), (1.0, 0, 0))),
        (Placed(cube), Placed(cube, (0.5, 0, 0), (0.1, 0.2, 0.3, 0.9))),
        (Placed(cube), Placed(cube, (1.0, 0, 0))),
        (Placed(cube), Placed(cube, (1.5, 0, 0))),
    )
    claims = [certificate(overlap(*bodies, tolerance=0.1)) for bodies in (*pairs, three)]
    for claim in (*claims, claims[1].planes[0]):
        assert str(claim) == repr(claim)
        assert repr(claim).startswith(type(claim).__name__)
        assert len(repr(claim)) < 300
    assert repr(claims[0]) == "Bracketed(2 shapes, lower=1.30899693900, upper=1.30899693900)"
