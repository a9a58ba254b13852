"""A kind of shape joins Python by one file and a line in the table: a cone, for which the core needs no class here."""

import math
from dataclasses import dataclass
from fractions import Fraction
from types import SimpleNamespace

import fcl
import numpy as np
import pytest
from cone import ConeFacts
from strategies import quaternion

from overlapper import Box, Sphere
from overlapper.polytopes.shape_text import alike, shape_of, text_of
from overlapper.proof.rational_body import RationalBody
from overlapper.proof.refusal import CertificateError
from overlapper.proof.signed_distance import signed_distance_bounds
from overlapper.proof.volume import proved_bounds
from overlapper.rational import exact
from overlapper.shapes.facts import Facts
from overlapper.shapes.table import KINDS, facts
from overlapper.viewer.tessellation import tessellation


@dataclass
class Cone:
    radius: float
    length: float


CONE = Cone(0.5, 1.3)


@pytest.fixture(autouse=True)
def line_in_the_table(monkeypatch):
    monkeypatch.setitem(KINDS, Cone, ConeFacts)


def placed(shape, position=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0, 1.0)):
    where = {"position": np.array(position), "given_orientation": np.array(turn)}
    return SimpleNamespace(shape=shape, **where)


def test_every_question_is_answered():
    asked = {each for each in {*vars(Facts), *Facts.__annotations__} if not each.startswith("_")}
    assert asked - set(dir(facts(CONE))) == set()


def test_a_cone_is_written_read_and_named():
    assert text_of(CONE) == '["Cone", 0.5, 1.3]'
    assert alike(shape_of(text_of(CONE)), CONE)
    assert not alike(Cone(0.5, 1.31), CONE)
    assert facts(CONE).words() == ("cone", "radius 0.5, length 1.3", 0)


def test_a_cone_is_drawn():
    drawn = tessellation(CONE)
    assert [drawn.vertices.min(axis=0), drawn.vertices.max(axis=0)] == pytest.approx(
        np.array([[-0.5, -0.5, -0.65], [0.5, 0.5, 0.65]])
    )
    volume = np.linalg.det(drawn.vertices[drawn.faces]).sum() / 6
    assert volume == pytest.approx(math.pi * 0.5**2 * 1.3 / 3, rel=0.01)
    assert np.linalg.norm(drawn.normals, axis=1) == pytest.approx(np.ones(len(drawn.vertices)))


def test_exact_answers_of_a_cone_agree_with_each_other():
    body = RationalBody(placed(CONE, (0.3, -0.2, 0.1), (0.1, 0.2, 0.3, 0.9)))
    axes = body.axes.astype(float)
    centre = body.position - body.axes[:, 2] * Fraction(1, 3)
    for direction in map(exact, np.random.default_rng(0).normal(size=(30, 3))):
        flat, square = body.support(direction)
        reach = float(flat) + math.sqrt(float(square))
        tip = axes @ facts(CONE).core_tip(axes.T @ direction.astype(float)) + body.position.astype(float)
        assert tip @ direction.astype(float) == pytest.approx(reach, abs=1e-12)
        beyond = centre + direction * Fraction(1.001 * (reach - float(direction @ centre))) / (direction @ direction)
        (share,) = body.exits(centre, (beyond - centre)[None], 64)
        shares = np.array([Fraction(share, 1 << 64), Fraction(share, 1 << 64) + Fraction(1, 1 << 40), Fraction(1)])
        points = centre + shares[:, None] * (beyond - centre)
        assert body.contains(points).tolist() == [True, False, False]
        outside = centre + 4 * direction
        flat, square = body.support(body.tightest(outside))
        assert float(body.tightest(outside) @ outside) > float(flat) + math.sqrt(float(square))


def test_a_ball_is_held_where_it_fits():
    """The inscribed ball touches the disc and the side."""
    body, slant = RationalBody(placed(CONE)), math.hypot(0.5, 1.3)
    radius = 0.5 * 1.3 / (0.5 + slant)
    centre = exact(np.array([[0.0, 0.0, radius - 0.65]]))
    assert body.contains(centre, Fraction(radius * (1 - 1e-12)))[0]
    assert not body.contains(centre, Fraction(radius * (1 + 1e-12)))[0]


@pytest.mark.parametrize("other", [Sphere(0.4), Box([0.3, 0.4, 0.5])], ids=repr)
def test_fcl_supports_cones_and_agrees_with_the_arbiter(other):
    rng = np.random.default_rng(1)
    for _ in range(4):
        pair = placed(CONE), placed(other, rng.uniform(-1.5, 1.5, 3), quaternion(rng))
        objects = []
        for each in pair:
            name, values = facts(each.shape).fcl()
            pose = fcl.Transform(np.roll(each.given_orientation, 1), each.position)
            objects.append(fcl.CollisionObject(getattr(fcl, name)(*values), pose))
        theirs = fcl.distance(*objects, fcl.DistanceRequest(enable_signed_distance=True))
        lower, upper = signed_distance_bounds(*pair)
        assert upper - lower < 1e-8
        assert lower - 1e-3 < theirs < upper + 1e-3


def test_no_volume_is_proved_by_pieces():
    with pytest.raises(CertificateError, match=r"^a cone has no certificate, because it is not made of balls and"):
        proved_bounds((placed(CONE), placed(Box([1, 1, 1]))), lambda bounds: True)
