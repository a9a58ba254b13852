"""Parameters of a scene: read from what build takes, set from outside, and said in the heading of every table."""

import json

import pytest
from command import overlapper

from overlapper.cli.options import given_parameters
from overlapper.cli.refusals import Refused
from overlapper.scenes.check import record
from overlapper.scenes.parameters import parameters_of, value_of, values_of
from overlapper.scenes.playback import play
from overlapper.scenes.run import run
from overlapper.scenes.scene import SceneError, load_scene
from overlapper.tables.table_file import read_metadata, read_table

BALLS = '''
"""Two balls, so far apart."""
import pybullet as p

STEPS = 2
PAIRS = "all"  # a filter keeps them where they are


def build(client, *, apart=0.15, count=2, name="ball", gravity=False, colours=(1, 2)):
    ball = p.createCollisionShape(p.GEOM_SPHERE, radius=0.1, physicsClientId=client)
    for k in range(count):
        p.createMultiBody(1, ball, basePosition=[apart * k, 0, 0], physicsClientId=client)
        NAMES[k] = f"{name}{k}"
    p.setCollisionFilterPair(0, 1, -1, -1, 0, physicsClientId=client)


NAMES = {}
'''


@pytest.fixture(autouse=True)
def balls(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "balls.py"
    path.write_text(BALLS)
    return path


def test_parameters_are_what_build_takes_with_a_default_that_is_a_number_a_text_or_a_truth(balls):
    assert load_scene(balls).parameters == {"apart": 0.15, "count": 2, "name": "ball", "gravity": False}
    assert parameters_of(lambda client, /, a=1, *more, b="x", c=None, **others: None) == {"a": 1, "b": "x"}
    assert parameters_of(dict) == {}


def test_a_value_has_the_kind_of_its_default(balls):
    given = {"apart": "1", "count": "3", "name": "7", "gravity": "yes"}
    scene = load_scene(balls, given)
    assert scene.parameters == {"apart": 1.0, "count": 3, "name": "7", "gravity": True}
    assert [type(value) for value in scene.parameters.values()] == [float, int, str, bool]
    assert scene.title == "balls (apart=1.0, count=3, name=7, gravity=True)"
    (frame,) = run(load_scene(balls, {"apart": "0.1", "name": "b"}), only=[1])
    assert frame.bodies.names == {(0, -1): "b0", (1, -1): "b1"}
    assert frame.contacts[0].overlap.depth == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("text", "default", "words"),
    [
        ("2.5", 1, "x must be a whole number of 64 bits like its default 1, not '2.5'"),
        ("nan", 1.0, "x must be a finite number like its default 1.0, not 'nan'"),
        ("inf", 1.0, "x must be a finite number like its default 1.0, not 'inf'"),
        ("", 1.0, "x must be a finite number like its default 1.0, not ''"),
        ("maybe", True, "x must be true or false like its default True, not 'maybe'"),
        (
            "9" * 19,
            1,
            f"x must be a whole number of 64 bits like its default 1, not '{'9' * 19}'",
        ),
    ],
)
def test_a_value_of_another_kind_is_refused_by_name(text, default, words):
    with pytest.raises(ValueError, match=r"^x must be") as refused:
        value_of("x", text, default)
    assert str(refused.value) == words


def test_an_unknown_parameter_is_refused_with_the_nearest_name(balls):
    with pytest.raises(SceneError, match=r"^the scene balls has no parameter 'apar'; the nearest is 'apart' \(it has"):
        load_scene(balls, {"apar": "1"})
    with pytest.raises(ValueError, match=r"^the scene plain has no parameter 'mass': it has no parameters$"):
        values_of({"mass": "1"}, {}, "plain")


@pytest.mark.parametrize("ending", ["csv", "parquet", "sqlite"])
def test_tables_say_the_parameters_and_are_shown_with_them(tmp_path, ending):
    table = f"run.{ending}"
    done = overlapper("run", "balls.py", "--set", "apart=0.1", "--set", "name=a=b", "--out", table, "--json")
    assert json.loads(done.stdout)["parameters"] == {"apart": 0.1, "count": 2, "name": "a=b", "gravity": False}
    heading = read_metadata(tmp_path / table)
    assert (heading["set apart"], heading["set name"], heading["set gravity"]) == ("0.1", "a=b", "False")
    assert {row["nameA"] for row in read_table(tmp_path / table)} == {"a=b0"}
    # Without the parameters of the table, another scene would be seen, and it would be said.
    playback = play(table, scene="balls.py")
    assert [frame.contacts[0].overlap.depth for frame in playback.views] == pytest.approx([0.1] * 2)
    assert playback.remarks == []


def test_a_table_for_people_says_the_parameters():
    said = overlapper("run", "balls.py", "--set", "apart=0.1", "--set", "name=[b]").stdout
    assert "Overlaps of balls (apart=0.1, count=2, name=[b], gravity=False) in 2 steps" in " ".join(said.split())


def test_a_page_is_of_the_scene_with_its_parameters():
    done = overlapper("view", "balls.py", "--set", "apart=0.05", "--html", "near.html")
    assert (done.returncode, done.stderr, done.stdout) == (0, "", "Written: near.html\n")
    assert play("balls.py", given={"apart": "0.05"}).name.startswith("balls (apart=0.05, ")


def test_an_expected_file_says_the_parameters_that_it_was_recorded_with(balls):
    scene = load_scene(balls)
    record(scene)
    assert "# set apart: 0.15\n# set count: 2\n" in scene.expected.read_text()
    assert overlapper("check", "balls.py").stdout == "balls.py: as recorded\n"


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        (["apart"], "--set must be NAME=VALUE, not 'apart'"),
        (["=1"], "--set must be NAME=VALUE, not '=1'"),
        (["apart=1", "apart=2"], "--set gives apart twice"),
    ],
)
def test_empty_and_repeated_settings_are_refused(settings, sentence):
    with pytest.raises(Refused, match=f"^{sentence}$"):
        given_parameters(settings)


def test_a_table_is_viewed_with_its_own_parameters():
    with pytest.raises(ValueError, match=r"^--set is for scenes, but t.csv is a table, which has its own parameters$"):
        play("t.csv", given={"count": "1"})


def test_invalid_settings_are_refused_in_one_sentence():
    done = overlapper("run", "balls.py", "--set", "count=1.5")
    sentence = "overlapper: count must be a whole number of 64 bits like its default 2, not '1.5'\n"
    assert (done.returncode, done.stdout, done.stderr) == (2, "", sentence)
