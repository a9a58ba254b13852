"""The cone of the core: its Python facts hold the rules of all kinds, and its answers are proved and compared."""

import numpy as np
import pytest
import test_facts
from cone import ConeFacts

from overlapper import Box, Capsule, HalfSpace, Hull, Placed, RoundedHull, Sphere, _core, overlap
from overlapper.proof.certificate import certificate
from overlapper.proof.claims import CertificateError
from overlapper.rational import rotation
from overlapper.reference import Fcl
from overlapper.shapes.table import KINDS

Cone = _core.Cone
CONE = Cone(0.5, 1.3)
CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.7, 0.7, 0.7]]
OTHERS = [Box([0.3, 0.4, 0.5]), Sphere(0.4), Capsule(0.2, 0.5), Hull(CORNERS), CONE]
PLACES = [(0.1, 0.2, 0.3), (0.4, -0.2, -0.4), (1.5, 0.2, 1.0)]
RULES = {name: rule for name, rule in vars(test_facts).items() if name.startswith("test_") and "table" not in name}


def kind(shape):
    return type(shape).__name__


@pytest.fixture(autouse=True)
def line_in_the_table(monkeypatch):
    monkeypatch.setitem(KINDS, Cone, ConeFacts)


@pytest.mark.parametrize("rule", RULES.values(), ids=RULES.keys())
def test_a_rule_of_all_kinds_holds(rule):
    rule(CONE)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("other", [*OTHERS, HalfSpace((0.1, 0.2, 1.0), -0.2)], ids=kind)
def test_an_answer_is_proved_between_planes(other, place):
    common = overlap(Placed(CONE), Placed(other, place, (0.1, 0.2, 0.3, 0.9)), tolerance=0.1)
    lower, upper = certificate(common).verify()
    assert 0 <= lower <= upper
    assert float(lower) - common.volume_error <= common.volume <= float(upper) + common.volume_error


def test_a_cone_with_a_rounded_hull_has_no_certificate():
    common = overlap(Placed(CONE), Placed(RoundedHull(CORNERS, 0.1)))
    with pytest.raises(CertificateError, match=r"^a rounded hull that overlaps with a cone has no certificate$"):
        certificate(common)


def test_fcl_is_asked():
    pairs = [overlap(Placed(CONE), Placed(other, place)) for other in OTHERS for place in PLACES]
    with Fcl() as fcl:
        compared = fcl.compare_many(pairs)
    assert {each.verdict for each in compared} <= {"agree", "disagree"}
    assert all(each.nearer == "ours" for each in compared if each.verdict == "disagree")


def test_its_support_is_that_of_the_core():
    for turn in np.random.default_rng(0).normal(size=(50, 4)):
        up = rotation(turn).astype(float)[2]
        top = Placed(CONE, (0, 0, 0), turn).bounds[1][2]
        assert ConeFacts(CONE).core_tip(up) @ up == pytest.approx(top, abs=1e-12)
