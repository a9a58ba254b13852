"""Volumes by slices bounded by arcs are proved: ellipsoids with round bodies, and groups of many quadrics."""

import itertools
import pickle
from dataclasses import fields
from fractions import Fraction

import numpy as np
import pytest
from flint import arb, ctx, fmpq
from round_truth import number

from overlapper import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Placed, RoundedHull, Sphere, overlap
from overlapper.proof import volume
from overlapper.proof.arc_slices import ByArcs
from overlapper.proof.certificate import certificate
from overlapper.proof.claims import Bracketed, CertificateError
from overlapper.proof.corners import below
from overlapper.proof.round_frame import constraint
from overlapper.proof.volume import Common, finite, proved_bounds

NARROW = Fraction(1, 10**12)
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
SHAPES = {
    "ellipsoid": lambda rng: Ellipsoid(np.exp(rng.uniform(-1.5, 0.0, 3))),
    "sphere": lambda rng: Sphere(rng.uniform(0.2, 0.8)),
    "capsule": lambda rng: Capsule(rng.uniform(0.2, 0.6), rng.uniform(0.2, 1.5)),
    "cylinder": lambda rng: Cylinder(rng.uniform(0.2, 0.6), rng.uniform(0.2, 1.5)),
    "rounded": lambda rng: RoundedHull(rng.normal(size=(4, 3)) * 0.4, rng.uniform(0.05, 0.3)),
    "rounded box": lambda rng: RoundedHull(CORNERS * rng.uniform(0.2, 0.6, 3), rng.uniform(0.02, 0.3)),
    "box": lambda rng: Box(rng.uniform(0.2, 0.8, 3)),
    "half-space": lambda rng: HalfSpace(rng.normal(size=3), rng.normal() * 0.1),
}
THIN = Ellipsoid([1.0, 0.1, 0.01])
EGG = Ellipsoid([0.25, 0.5, 1.0])
TURN = (0.1, -0.2, 0.3, 0.9)


def bounds(*bodies):
    return proved_bounds(bodies, lambda found: found[1] - found[0] <= found[0] * NARROW)


def holds(found, truth):
    lower, upper = (number(bound) for bound in found)
    return not (truth < lower or truth > upper)


def placed(rng, name):
    return Placed(SHAPES[name](rng), rng.normal(size=3) * 0.2, rng.normal(size=4))


def sunk(rng, first, second, depth):
    """Two bodies that overlap by a depth in m."""
    a, b = placed(rng, first), placed(rng, second)
    found = overlap(a, b, tolerance=0.3)
    way = (found.depth if found else -found.distance) - depth
    return Placed(a.shape, np.array(a.position) + way * np.array(found.normal), a.orientation), b


def exact(x):
    return fmpq(*float(x).as_integer_ratio())


def coaxial(r, h, s, k, d):
    """Ellipsoids with half axes (r, r, h) and (s, s, k), the second at d along z: slices are concentric discs."""
    r, h, s, k, d = map(exact, (r, h, s, k, d))
    one = [arb(r * r), arb(0), arb(-r * r / (h * h))]
    other = [arb(s * s * (1 - d * d / (k * k))), arb(2 * s * s * d / (k * k)), arb(-s * s / (k * k))]
    low, high = arb(max(-h, d - k)), arb(min(h, d + k))
    a, b, c = (x - y for x, y in zip(one, other))
    marks, square = [low, high], b * b - 4 * a * c
    if square > 0:
        marks += [z for z in ((-b - square.sqrt()) / (2 * c), (-b + square.sqrt()) / (2 * c)) if low < z < high]
    marks.sort(key=float)
    total = arb(0)
    for start, end in itertools.pairwise(marks):
        middle = (start + end) / 2
        x, y, z = min((one, other), key=lambda p: float(p[0] + p[1] * middle + p[2] * middle**2))
        total += x * (end - start) + y * (end**2 - start**2) / 2 + z * (end**3 - start**3) / 3
    return arb.pi() * total


@pytest.mark.parametrize("depth", [0.1, 1e-4, 1e-7, 1e-10])
@pytest.mark.parametrize("aspect", [1.0, 10.0, 100.0])
def test_coaxial_ellipsoids_of_revolution_have_the_volume_of_their_discs(depth, aspect):
    rng = np.random.default_rng([1, int(aspect), int(1e11 * depth)])
    r, h, s, k = (0.5 * np.exp(x * np.log(aspect + 0.5) / 2) for x in rng.uniform(-1, 1, 4))
    d = h + k - depth * min(h, k)
    found = bounds(Placed(Ellipsoid([r, r, h])), Placed(Ellipsoid([s, s, k]), (0, 0, d)))
    with ctx.workdps(60):
        assert holds(found, coaxial(r, h, s, k, d))


def test_homothetic_ellipsoids_are_images_of_balls():
    """Balls of radius 1, whose centres are 1 apart, share 5 π / 12."""
    half_axes = np.array([0.25, 0.5, 1.0])
    for shift in ((0.25, 0, 0), (0, 0.5, 0), (0, 0, 1.0)):
        found = bounds(Placed(Ellipsoid(half_axes)), Placed(Ellipsoid(half_axes), shift))
        with ctx.workdps(60):
            assert holds(found, arb.pi() * 5 / 12 / 8)
    assert not any(isinstance(each, ByArcs) for each in Common(Placed(EGG), Placed(Ellipsoid([0.5, 1, 2])))._summands)


@pytest.mark.parametrize(
    ("inner", "outer", "truth"),
    [
        (EGG, Sphere(1.25), lambda: arb.pi() / 6),
        (Sphere(0.2), EGG, lambda: arb.pi() * 4 / 3 * arb(exact(0.2)) ** 3),
        (THIN, Ellipsoid([1.25, 1.5, 1.375]), lambda: arb.pi() * 4 / 3 * arb(exact(0.1) * exact(0.01))),
        (Ellipsoid([0.25, 0.375, 0.5]), Cylinder(1.0, 2.0), lambda: arb.pi() / 16),
        (Ellipsoid([0.25, 0.375, 0.5]), RoundedHull(CORNERS, 0.25), lambda: arb.pi() / 16),
        (Capsule(0.25, 0.5), Ellipsoid([0.75, 0.75, 2.0]), lambda: arb.pi() * 5 / 96),
        (Cylinder(0.25, 0.5), Ellipsoid([0.75, 1.0, 2.0]), lambda: arb.pi() / 32),
        (RoundedHull(CORNERS / 4, 0.125), Ellipsoid([0.75, 1.0, 2.0]), lambda: arb(5) / 16 + 5 * arb.pi() / 192),
    ],
)
def test_a_body_inside_of_another_has_its_own_volume(inner, outer, truth):
    found = bounds(Placed(inner, (0.03, 0.02, 0.01), TURN), Placed(outer, (0.02, 0.03, 0.0)))
    with ctx.workdps(60):
        assert holds(found, truth())


def test_pieces_within_an_ellipsoid_are_proved_without_arcs():
    rounded = Placed(RoundedHull(CORNERS / 4, 0.125), (0.3, 0.2, 0.1), TURN)
    arcs = [
        sum(isinstance(each, ByArcs) for each in Common(rounded, Placed(Ellipsoid(half)))._summands)
        for half in ([0.7, 0.8, 0.9], [1.5, 1.2, 2.0])
    ]
    assert 0 < arcs[0] < 20 and arcs[1] == 0


def test_a_ball_that_touches_an_ellipsoid_from_inside_is_inside():
    found = bounds(Placed(Ellipsoid([0.5, 1.0, 2.0])), Placed(Sphere(0.5)))
    with ctx.workdps(60):
        assert holds(found, arb.pi() / 6)


# A rounded hull of many pieces takes long in a shallow contact, and a rounded box has the same kinds of pieces.
@pytest.mark.parametrize(
    ("second", "depth"),
    [
        *itertools.product(["sphere", "ellipsoid", "capsule", "cylinder", "rounded box"], [1e-1, 1e-10]),
        ("rounded", 1e-1),
    ],
)
def test_the_core_states_intervals_that_hold_the_proved_bounds(second, depth):
    rng = np.random.default_rng([3, *map(ord, second), int(1e11 * depth)])
    a, b = sunk(rng, "ellipsoid", second, depth)
    found = overlap(a, b, tolerance=1e-2)
    lower, upper = certificate(found).verify()
    error = Fraction(found.volume_error)
    assert upper - lower <= lower * NARROW
    assert Fraction(found.volume) - error <= lower <= upper <= Fraction(found.volume) + error


@pytest.mark.parametrize("second", ["sphere", "ellipsoid", "cylinder"])
def test_both_sides_of_a_plane_add_up(second):
    """A group of three, whose third body is a half-space or the rest of space."""
    rng = np.random.default_rng([4, *map(ord, second)])
    a, b = placed(rng, "ellipsoid"), placed(rng, second)
    normal, offset = rng.normal(size=3), 0.05
    whole = bounds(a, b)
    parts = [bounds(a, b, Placed(HalfSpace(side * normal, side * offset))) for side in (1, -1)]
    lower, upper = (sum(part[k] for part in parts) for k in (0, 1))
    assert 0 < lower <= whole[1] and whole[0] <= upper


def test_thin_ellipsoids_are_proved():
    rng = np.random.default_rng(5)
    for depth in (1e-2, 1e-6, 1e-10):
        a, b = Placed(THIN, rng.normal(size=3), rng.normal(size=4)), Placed(THIN, (0, 0, 0), rng.normal(size=4))
        apart = overlap(a, b, tolerance=0.5)
        way = (apart.depth if apart else -apart.distance) - depth * 0.01
        a = Placed(THIN, np.array(a.position) + way * np.array(apart.normal), a.orientation)
        lower, upper = bounds(a, b)
        assert 0 < lower <= upper <= lower * (1 + NARROW)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("sphere", "capsule"),
        ("sphere", "rounded"),
        ("capsule", "cylinder"),
        ("cylinder", "cylinder"),
        ("rounded box", "capsule"),
        ("rounded box", "cylinder"),
    ],
)
def test_slices_bounded_by_arcs_agree_with_closed_forms_and_with_slices_along_axes(first, second, monkeypatch):
    """All that has another way is computed in both: balls and cylinders with planes."""
    rng = np.random.default_rng([6, *map(ord, first + second)])
    usual, count = volume._of_different, 0

    def both(quadrics, planes, around):
        nonlocal count
        found = usual(quadrics, planes, around)
        polytope = below(planes, around)
        if quadrics and found and polytope is not None:
            given = {id(plane) for plane in planes}
            kept = [facet.plane for facet in polytope.facets if id(facet.plane) in given]
            by_arcs = ByArcs([constraint(side) for side in (*quadrics, *kept)], around)(128)
            with ctx.workprec(192):
                assert by_arcs.overlaps(sum((finite(each(192)) for each in found), arb(0)))
            count += by_arcs.rad() <= 1e-12 * by_arcs.mid()
        return found

    monkeypatch.setattr(volume, "_of_different", both)
    Common(*sunk(rng, first, second, 1e-2))
    assert count > 0


@pytest.mark.parametrize(
    "names",
    [
        ("sphere", "capsule", "cylinder"),
        ("box", "ellipsoid", "rounded"),
        ("cylinder", "ellipsoid", "half-space"),
    ],
)
def test_groups_are_proved_in_any_order(names):
    rng = np.random.default_rng([7, *map(ord, "".join(names))])
    bodies = [Placed(SHAPES[name](rng), rng.normal(size=3) * 0.05, rng.normal(size=4)) for name in names]
    found = overlap(*bodies, tolerance=1e-2)
    lower, upper = certificate(found).verify()
    assert upper - lower <= lower * NARROW
    assert Fraction(found.volume) - Fraction(found.volume_error) <= lower
    assert upper <= Fraction(found.volume) + Fraction(found.volume_error)
    low, high = bounds(*reversed(bodies))
    assert lower <= high and low <= upper


def test_a_group_of_balls_is_a_closed_form():
    """Each ball bounds where its power is the greatest, so that no slice is needed."""
    rng = np.random.default_rng(8)
    balls = [Placed(Sphere(1.0), rng.normal(size=3) * 0.3) for _ in range(6)]
    assert not any(isinstance(each, ByArcs) for each in Common(*balls)._summands)
    lower, upper = bounds(*balls)
    assert upper - lower <= lower / 10**25
    low, high = bounds(*balls[:2], Placed(Sphere(3.0), (0.1, 0, 0)))
    less, more = bounds(*balls[:2])
    assert low <= more and less <= high


def test_more_bits_give_narrower_bounds():
    bodies = Placed(EGG), Placed(Sphere(0.5), (0.3, 0.2, 0.8))
    few, many = (Common(*bodies).bounds(bits) for bits in (128, 192))
    assert few[0] <= many[1] and many[0] <= few[1]
    assert many[1] - many[0] < (few[1] - few[0]) / 1000


@pytest.mark.parametrize("other", [Sphere(0.5), EGG])
def test_a_lie_about_an_ellipsoid_is_found(other):
    shapes = Placed(EGG), Placed(other, (0.2, 0.1, 0.5), TURN)
    lower, upper = certificate(overlap(*shapes, tolerance=0.1)).verify()
    step = lower / 10**9
    assert Bracketed(shapes, lower - step, upper + step).verify() == (lower - step, upper + step)
    for low, high in ((upper + step, upper + 2 * step), (lower - 2 * step, lower - step)):
        with pytest.raises(CertificateError, match="the common volume must lie between"):
            Bracketed(shapes, low, high).verify()


def test_bodies_apart_share_nothing():
    for other in (Sphere(0.5), EGG, Capsule(0.25, 0.5), RoundedHull(CORNERS * 0.25, 0.125)):
        assert bounds(Placed(EGG), Placed(other, (2.0, 1.0, 0.5), TURN)) == (0, 0)
        lower, upper = Common(Placed(EGG), Placed(other, (1.0, 0.5, 0.75), TURN)).bounds(128)
        assert lower == 0 and upper < 1e-20


def test_a_certificate_is_read_from_a_file_of_an_older_version():
    """Bodies and bounds are all that a file has, whichever way the volume is proved."""
    assert [field.name for field in fields(Bracketed)] == ["shapes", "lower", "upper"]
    for bodies in ((Placed(EGG), Placed(Sphere(0.5), (0.3, 0.2, 0.8))), (Placed(EGG), Placed(Box([1, 1, 1])))):
        claim = certificate(overlap(*bodies, tolerance=0.1))
        again = pickle.loads(pickle.dumps(claim))
        assert again.verify() == (claim.lower, claim.upper)
