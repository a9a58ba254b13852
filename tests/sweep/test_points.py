"""Points of a sweep: grids, seeds, tables and samples, crossed, each point once."""

import math

import numpy as np
import pytest

from overlapper.sweep import points
from overlapper.sweep.points import Space

SPACE = Space("grasp", {"mass": 1.0, "count": 3, "seed": 0, "kind": "box", "soft": False})


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("mass=0.1:10:3:log", [0.1, 1.0, 10.0]),
        ("mass=0:1:5", [0.0, 0.25, 0.5, 0.75, 1.0]),
        ("mass=2:2:1", [2.0]),
        ("mass=0.3,5e-1", [0.3, 0.5]),
        ("mass=7", [7.0]),
        ("count=1:9:3", [1, 5, 9]),
        ("count=4,2", [4, 2]),
        ("kind=box,a:b", ["box", "a:b"]),
        ("soft=yes,false", [True, False]),
    ],
)
def test_a_grid_is_a_list_of_values_or_a_count_between_two_numbers(text, values):
    name = text.partition("=")[0]
    found = [point[name] for point in SPACE.grid(text)]
    assert found == pytest.approx(values) if name == "mass" else found == values
    assert {type(value) for value in found} == {type(SPACE.defaults[name])}


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("mass", "--grid must be NAME=VALUES, not 'mass'"),
        ("mass=", "--grid must be NAME=VALUES, not 'mass='"),
        ("mas=1", "the scene grasp has no parameter 'mas'; the nearest is 'mass' (it has mass=1.0, count=3, seed=0, "),
        ("mass=1:2", "--grid mass=1:2 must be mass=FROM:TO:COUNT, mass=FROM:TO:COUNT:log or mass=A,B,..."),
        ("mass=1:2:3:4", "--grid mass=1:2:3:4 must be mass=FROM:TO:COUNT, mass=FROM:TO:COUNT:log or mass=A,B,..."),
        ("mass=a:2:3", "--grid mass=a:2:3: mass must be a finite number like its default 1.0, not 'a'"),
        ("mass=2:1:3", "--grid mass=2:1:3 must go from a number to a larger one, not from 2 to 1"),
        ("mass=0:1:3:log", "--grid mass=0:1:3:log must go from a number above 0 to a larger one, not from 0 to 1"),
        ("mass=1:2:0", "--grid mass=1:2:0: the count must be a whole number from 1 to 10,000,000, not '0'"),
        ("mass=1:2:1e9", "--grid mass=1:2:1e9: the count must be a whole number from 1 to 10,000,000, not '1e9'"),
        ("soft=0:1:2", "soft must be true or false like its default False, not '0:1:2'"),
    ],
)
def test_an_invalid_grid_is_refused_in_one_sentence(text, sentence):
    with pytest.raises(ValueError, match=r"^.*$") as refused:
        SPACE.grid(text)
    assert str(refused.value).startswith(sentence)


def test_axes_are_crossed_and_no_point_is_there_twice():
    axes = [SPACE.grid("mass=1,2,1.0"), SPACE.seeds(2)]
    found = SPACE.crossed(axes)
    assert [(point["mass"], point["seed"]) for point in found] == [(1.0, 0), (1.0, 1), (2.0, 0), (2.0, 1)]
    assert all(list(point) == list(SPACE.defaults) and point["count"] == 3 for point in found)
    assert [*SPACE.crossed([])] == [SPACE.defaults]


def test_a_parameter_is_on_one_axis_only():
    words = r"^mass is given by two of --set, --grid, --seeds, --points and --range$"
    with pytest.raises(ValueError, match=words):
        SPACE.crossed([SPACE.grid("mass=1,2"), SPACE.grid("mass=3")])
    with pytest.raises(ValueError, match=words):
        Space("grasp", SPACE.defaults, {"mass"}).crossed([SPACE.grid("mass=1,2")])


def test_too_many_tasks_are_refused(monkeypatch):
    monkeypatch.setattr(points, "MOST", 5)
    with pytest.raises(ValueError, match=r"^that would be 6 tasks, more than 5$"):
        SPACE.crossed([SPACE.grid("mass=1,2"), SPACE.seeds(3)])


def test_seeds_are_for_scenes_that_have_one():
    with pytest.raises(ValueError, match=r"^--seeds needs a scene with a parameter `seed`, a whole number; bare has"):
        Space("bare", {"seed": 1.0}).seeds(3)


def test_a_sample_is_a_latin_hypercube_of_its_ranges_and_the_same_again():
    ranges = ["mass=0.1:10:log", "count=1:4"]
    found = SPACE.samples(40, ranges, 0)
    assert [*found] == [*SPACE.samples(40, ranges, 0)] != [*SPACE.samples(40, ranges, 1)]
    # One point in each fortieth of each range.
    tenths = np.log([point["mass"] / 0.1 for point in found]) / math.log(100) * 40
    assert sorted(int(part) for part in tenths) == list(range(40))
    assert np.bincount([point["count"] for point in found]).tolist() == [0, 10, 10, 10, 10]
    assert {point["count"] for point in SPACE.samples(300, ["count=1:9:log"], 0)} == set(range(1, 10))


@pytest.mark.parametrize(
    ("ranges", "sentence"),
    [
        ([], "--sample needs a --range NAME=FROM:TO for each parameter that it draws"),
        (["mass=1:2", "mass=1:3"], "--range gives mass twice"),
        (["mass=1:2:3"], "--range mass=1:2:3 must be mass=FROM:TO or mass=FROM:TO:log, with two numbers"),
        (["kind=a:b"], "--range kind=a:b must be kind=FROM:TO or kind=FROM:TO:log, with two numbers"),
        (["mass=2:1"], "--range mass=2:1 must go from a number to a larger one, not from 2 to 1"),
    ],
)
def test_an_invalid_range_is_refused_in_one_sentence(ranges, sentence):
    with pytest.raises(ValueError, match=r"^--") as refused:
        SPACE.samples(3, ranges, 0)
    assert str(refused.value) == sentence


def test_a_table_has_a_column_for_each_parameter(tmp_path):
    table = tmp_path / "points.csv"
    table.write_text('# from a paper\nmass, kind\n1.5,"a, b"\n\n2,box\n')
    assert [*SPACE.read(table)] == [{"mass": 1.5, "kind": "a, b"}, {"mass": 2.0, "kind": "box"}]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", " must have the names of the parameters, each once, in its first line"),
        ("mass,mass\n1,2\n", " must have the names of the parameters, each once, in its first line"),
        ("mass\n", " has no points"),
        ("# why\nmass\n1,2\n", ", line 3: it has 2 cells, not 1"),
        ("mass\nheavy\n", ", line 2: mass must be a finite number like its default 1.0, not 'heavy'"),
        ("colour\n1\n", "the scene grasp has no parameter 'colour'"),
    ],
)
def test_an_invalid_table_is_refused_in_one_sentence(tmp_path, text, sentence):
    table = tmp_path / "points.csv"
    table.write_text(text)
    with pytest.raises(ValueError, match=r"^.*$") as refused:
        SPACE.read(table)
    assert str(refused.value).removeprefix(str(table)).startswith(sentence)


def test_samples_name_what_is_to_be_installed(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "scipy.stats", None)
    with pytest.raises(ImportError, match=r"^--sample needs scipy: pip install scipy$"):
        SPACE.samples(3, ["mass=1:2"], 0)
