"""A lie in any field of any claim is found: of the wrong kind, of the wrong size, or false."""

from __future__ import annotations

from dataclasses import fields, replace
from fractions import Fraction

import families
import numpy as np
import pytest

from overlapper import Box, HalfSpace, Placed, Sphere, overlap
from overlapper.proof.certificate import certificate
from overlapper.proof.claims import Bracketed, CertificateError, Overlapping, OwnedPlane, Separated, Touching

CUBE = Box([0.5, 0.5, 0.5])
TRUE = {
    Separated: (Placed(CUBE), Placed(CUBE, (1.5, 0.2, 0.1))),
    Touching: (Placed(CUBE), Placed(CUBE, (1.0, 0.2, 0.1))),
    Overlapping: (Placed(CUBE), Placed(CUBE, (0.5, 0.2, 0.1), (0.1, -0.2, 0.3, 0.9))),
    Bracketed: (Placed(CUBE), Placed(Sphere(0.5), (0.5, 0.2, 0.1))),
}


class AlwaysRight(Fraction):
    """A fraction that every comparison finds in order."""

    def _yes(self, other):
        return True

    __le__ = __ge__ = __lt__ = __gt__ = __eq__ = _yes
    __hash__ = Fraction.__hash__

    def _same(self, *other):
        return self

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __pow__ = _same


class Elsewhere(Placed):
    """A body that tells of another place than it has."""

    @property
    def position(self):
        return np.array([100.0, 0.0, 0.0])


class Vanishing(np.ndarray):
    """An array whose products are zero."""

    def __matmul__(self, other):
        return Fraction(0)


def negative_under():
    lie = Fraction(1, 2)
    lie._denominator = -2
    return lie


NUMBERS = (AlwaysRight(0), 0.5, float("nan"), float("inf"), None, True, np.int64(1), "1", negative_under())


def numbers_in(array):
    """The array with a lie for its first number, of other shapes, or of another kind."""
    for lie in NUMBERS:
        changed = array.copy()
        changed[(0,) * array.ndim] = lie
        yield changed
    yield from (
        None,
        array.tolist(),
        array[:0],
        array[:-1],
        array[..., None],
        array.view(Vanishing),
        array.astype(float),
    )


def indices_in(array):
    yield from (None, array.tolist(), array.astype(float), array[:, None], array - array.max() - 1, array + 10**6)


def planes_with(change):
    def lies(claim):
        first, *others = claim.planes
        return [(replace(first, **each), *others) for each in change(first)]

    return lies


OF_PLANES = {
    "normal": planes_with(lambda p: [{"normal": each} for each in (*numbers_in(p.normal), 0 * p.normal, -p.normal)]),
    "offset": planes_with(lambda p: [{"offset": each} for each in (*NUMBERS, p.offset - Fraction(1, 10**9))]),
    "owner": planes_with(
        lambda p: [{"owner": each} for each in (-1, 2, 1 - p.owner, None, True, 0.0, np.int64(p.owner))]
    ),
}


def false_bodies(claim):
    a, b = claim.shapes
    other = Placed(a.shape, (0.25, 3, 0))
    return [None, [a, b], (a,), (), (a, other), (other, b), (a, b.shape), (Elsewhere(a.shape), b)]


def false_planes(claim):
    return [None, list(claim.planes), (), claim.planes[:1], (None, *claim.planes[1:])]


LIES = {
    OwnedPlane: OF_PLANES,
    Separated: {"shapes": false_bodies, "planes": false_planes},
    Touching: {
        "shapes": false_bodies,
        "planes": false_planes,
        "inradius": lambda c: [*NUMBERS, c.inradius - Fraction(1, 10**9)],
        "point": lambda c: [*numbers_in(c.point), c.point + Fraction(1, 10**3)],
        "nearest": lambda c: [*numbers_in(c.nearest), c.nearest + Fraction(1), c.nearest[[0, 1, 1]]],
        "miss": lambda c: [*NUMBERS, Fraction(-3)],
    },
    Overlapping: {
        "shapes": false_bodies,
        "planes": false_planes,
        "vertices": lambda c: [*numbers_in(c.vertices), 2 * c.vertices, c.vertices[::-1].copy()],
        "rings": lambda c: [
            None,
            list(c.rings),
            (),
            c.rings[1:],
            *((lie, *c.rings[1:]) for lie in indices_in(c.rings[0])),
            (c.rings[0][:2], *c.rings[1:]),
            tuple(ring[::-1] for ring in c.rings),
            c.rings * 2,
        ],
        "facet": lambda c: [*indices_in(c.facet), c.facet[1:], np.zeros_like(c.facet)],
        "point": lambda c: [*numbers_in(c.point), c.point + Fraction(1)],
        "margin": lambda c: [*NUMBERS, Fraction(0), -c.margin, 100 * c.margin],
        "pull": lambda c: [*numbers_in(c.pull), 0 * c.pull, -c.pull, 2 * c.pull],
    },
    Bracketed: {
        "shapes": lambda c: [*false_bodies(c), (*c.shapes, Placed(CUBE, (0.75, 0, 0)))],
        "lower": lambda c: [*NUMBERS, Fraction(0), -c.lower, c.upper, c.upper + Fraction(1, 10**20), 2 * c.upper],
        "upper": lambda c: [*NUMBERS, Fraction(0), -c.upper, c.lower, c.lower - Fraction(1, 10**20), c.lower / 2],
    },
}


@pytest.mark.parametrize(
    ("kind", "field"), [(kind, field.name) for kind in (*TRUE, OwnedPlane) for field in fields(kind)]
)
def test_every_field_of_every_claim_is_checked(kind, field):
    for of in (Separated, Touching, Overlapping) if kind is OwnedPlane else (kind,):
        claim = certificate(overlap(*TRUE[of]))
        assert type(claim) is of
        claim.verify()
        name = "planes" if kind is OwnedPlane else field
        for lie in LIES[kind][field](claim):
            with pytest.raises(CertificateError):
                replace(claim, **{name: lie}).verify()


def test_planes_without_a_direction_leave_room():
    zero = np.array([Fraction(0)] * 3, object)
    bodies = Placed(Box([1, 1, 1])), Placed(Box([1, 1, 1]), (0.5, 0, 0))
    claim = Touching(
        bodies, (OwnedPlane(zero, Fraction(0), 0),), Fraction(0), zero, np.array([zero, zero]), Fraction(0)
    )
    with pytest.raises(CertificateError, match="a normal that is not zero"):
        claim.verify()


def changed_by_chance(rng, claim):
    """The claim with one number of one field moved by a random share of itself, or replaced."""
    names = [field.name for field in fields(claim) if field.name not in ("shapes", "rings", "facet")]
    name = names[rng.integers(len(names))]
    value = getattr(claim, name)

    def moved(x):
        step = Fraction(int(rng.integers(-9, 10))) * Fraction(2) ** int(rng.integers(-90, 3))
        return x + step * (abs(x) if rng.random() < 0.5 else 1)

    if name == "planes":
        which = int(rng.integers(len(value)))
        plane = value[which]
        if rng.random() < 0.5:
            plane = replace(plane, offset=moved(plane.offset))
        else:
            normal = plane.normal.copy()
            normal[rng.integers(3)] = moved(normal[0])
            plane = replace(plane, normal=normal)
        value = (*value[:which], plane, *value[which + 1 :])
    elif isinstance(value, np.ndarray):
        value = value.copy()
        place = tuple(int(rng.integers(n)) for n in value.shape)
        value[place] = moved(value[place])
    else:
        value = moved(value)
    return replace(claim, **{name: value})


@pytest.mark.parametrize("family", ["general", "posed", "levers", "touching", "nearly_touching", "slivers"])
def test_a_claim_changed_by_chance_is_refused_unless_it_is_true(family):
    rng = np.random.default_rng(5)
    for seed in range(4):
        case = families.make(family, seed)
        claim = certificate(overlap(*case.placed))
        truth = case.truth.volume if case.truth.dimension == 3 else 0
        for _ in range(25):
            try:
                lower, upper = changed_by_chance(rng, claim).verify()
            except CertificateError:
                continue
            assert lower <= truth <= upper, case


def test_a_ball_on_a_slope_is_proved_for_the_quaternion_as_given():
    for length in (1.0, 1e-200, 3.7e150):
        slope = Placed(HalfSpace((0, 0, 1), 0.0), (0, 0, 0), np.array([1, 1, 1, 5]) * length)
        lower, upper = certificate(overlap(Placed(Sphere(1.0)), slope)).verify()
        assert lower < Fraction(2, 3) * Fraction("3.14159265358979323846264338327950288") < upper
