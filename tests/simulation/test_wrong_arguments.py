"""A wrong argument of a public class gets one sentence that names the argument, and never an answer."""

import re

import pytest

import overlapper
from overlapper import Log
from overlapper.simulation import (
    Bodies,
    Recorder,
    UnknownBodyWarning,
    VolumetricContact,
    link_contacts,
)
from overlapper.viewer import Recording


@pytest.fixture
def bodies(client):
    with Bodies(client) as made:
        yield made


@pytest.mark.parametrize(
    ("wrong", "error", "sentence"),
    [
        (lambda b: VolumetricContact(b).on(99), ValueError, "there is no body 99 in the simulation"),
        (lambda b: VolumetricContact(b).forces().on(99), ValueError, "there is no body 99 in the simulation"),
        (lambda b: VolumetricContact(b).mean().on("x"), ValueError, "there is no body x in the simulation"),
        (lambda b: VolumetricContact(0), TypeError, "bodies must be the Bodies of a simulation, not 0"),
        (
            lambda b: VolumetricContact(b, friction="x"),
            ValueError,
            "friction must be a number 0 or greater, or 'distributed', not 'x'",
        ),
        (lambda b: Bodies("x"), TypeError, "physicsClientId must be what pybullet.connect() returned, not 'x'"),
        (lambda b: Bodies(99), ValueError, "physicsClientId 99 is not connected to a physics server"),
        (lambda b: Bodies(b.physicsClientId, recorder=3), TypeError, "recorder must be a Recorder, not 3"),
        (
            lambda b: Bodies(b.physicsClientId, concave_threshold="x"),
            ValueError,
            "the concavity threshold must lie between 0.01 and 1, not 'x'",
        ),
        (lambda b: Recorder("x"), TypeError, "physicsClientId must be what pybullet.connect() returned, not 'x'"),
        (lambda b: link_contacts(3), TypeError, "contacts must be what Bodies.overlaps() returns, not 3"),
        (lambda b: link_contacts([3]), TypeError, "contacts must be what Bodies.overlaps() returns, not 3 among them"),
        (lambda b: Recording().add(0, [], 0.0), TypeError, "bodies must be the Bodies of a simulation, not 0"),
        (lambda b: Recording().add(b, 3, 0.0), TypeError, "contacts must be what Bodies.overlaps() returns, not 3"),
        (
            lambda b: overlapper.watch("x"),
            TypeError,
            "physicsClientId must be what pybullet.connect() returned, not 'x'",
        ),
        (lambda b: overlapper.watch(b.physicsClientId, every="x"), TypeError, "every must be a whole number, not 'x'"),
        (lambda b: overlapper.watch(b.physicsClientId, every=1.5), TypeError, "every must be a whole number, not 1.5"),
    ],
)
def test_a_wrong_argument_is_named(wrong, error, sentence, bodies):
    with pytest.raises(error, match=f"^{re.escape(sentence)}$"):
        wrong(bodies)


@pytest.mark.parametrize(
    ("given", "error", "sentence"),
    [
        ({"contacts": 3}, TypeError, "contacts must be what Bodies.overlaps() returns, not 3"),
        ({"step": "x"}, TypeError, "step must be a whole number, not 'x'"),
        ({"step": 1.5}, TypeError, "step must be a whole number, not 1.5"),
        ({"time": "x"}, ValueError, "time must be a finite number of seconds, not 'x'"),
        ({"forces": 3}, TypeError, "forces must be what VolumetricContact.mean() returns, not 3"),
    ],
)
def test_a_wrong_argument_of_a_log_is_named_and_nothing_is_written(given, error, sentence, bodies, tmp_path):
    with Log(tmp_path / "run.csv", bodies, forces=True) as log:
        with pytest.raises(error, match=f"^{re.escape(sentence)}$"):
            log.add(**{"contacts": bodies.overlaps(), **given})
        assert log.steps == 0


def test_a_log_needs_the_name_of_a_file(bodies):
    with pytest.raises(TypeError, match=r"^path must be the name of a file, not 3$"):
        Log(3, bodies)


def test_a_name_of_a_body_that_is_not_there_gives_a_warning(client):
    sentence = r"^names has bodies that are not in the simulation: 99: 'duck'$"
    with pytest.warns(UnknownBodyWarning, match=sentence), Bodies(client, names={99: "duck"}) as bodies:
        assert bodies.names == {}
