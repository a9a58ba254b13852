"""Scenes are found and run, and an expected file notices what has changed since it was written."""

import math

import pytest

from overlapper.regression import (
    Budget,
    Expected,
    SceneError,
    compare,
    load_scene,
    loose_budgets,
    read_expected,
    record,
    replay,
    run,
)
from overlapper.table import COLUMNS

TWO_CUBES = '''
"""Two unit cubes, the second of which slides over the first by a centimetre a step."""
import pybullet as p

STEPS = 6


def build(client):
    cube = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.5] * 3, physicsClientId=client)
    p.createMultiBody(0, cube, physicsClientId=client)
    slider = p.createMultiBody(1, cube, basePosition=[0.9, 0, 0], physicsClientId=client)
    p.createMultiBody(1, cube, basePosition=[0, 0, 9], physicsClientId=client)
    p.setCollisionFilterPair(0, slider, -1, -1, 0, physicsClientId=client)

    def step(i):
        p.resetBasePositionAndOrientation(slider, [0.9 + 0.01 * i, 0, 0], [0, 0, 0, 1], physicsClientId=client)

    return step
'''


@pytest.fixture
def scene_file(tmp_path):
    path = tmp_path / "two_cubes.py"
    path.write_text(TWO_CUBES)
    return path


@pytest.fixture
def recorded(scene_file):
    scene = load_scene(scene_file)
    record(scene)
    return scene


def test_a_frame_follows_every_step(scene_file):
    frames = [(frame.step, frame.time, frame.contacts[0].overlap.volume) for frame in run(load_scene(scene_file))]
    assert [step for step, _, _ in frames] == [1, 2, 3, 4, 5, 6]
    assert [time for _, time, _ in frames] == pytest.approx([step / 240 for step, _, _ in frames])
    assert [volume for _, _, volume in frames] == pytest.approx([0.1, 0.09, 0.08, 0.07, 0.06, 0.05])


def test_a_run_can_be_shorter_than_the_scene_or_show_some_steps_of_it(scene_file):
    assert [frame.step for frame in run(load_scene(scene_file), steps=2)] == [1, 2]
    frames = run(load_scene(scene_file), only=[3, 6])
    assert [(frame.step, frame.contacts[0].overlap.volume) for frame in frames] == [
        (3, pytest.approx(0.08)),
        (6, pytest.approx(0.05)),
    ]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("STEPS = 0\ndef build(client): pass", "STEPS is 0"),
        ("STEPS = 5", r"must have a function build\(client\)"),
        ("STEPS = 5\ndef build(client:", "cannot be loaded at line 2: SyntaxError"),
        (
            "\nimport nothing_like_it",
            "cannot be loaded at line 2: ModuleNotFoundError: No module named 'nothing_like_it'",
        ),
        ("STEPS = 5\ndef build(client):\n  1 / 0", "cannot be built at line 3: ZeroDivisionError"),
        ("STEPS = 5\ndef build(client): return 7", r"must return None or a function step\(i\), not 7"),
        ("STEPS = 5\ndef build(client): return lambda i: [1][i]", "fails before step 2 at line 2: IndexError"),
    ],
)
def test_a_broken_scene_is_told_in_a_sentence_with_its_line(tmp_path, text, sentence):
    path = tmp_path / "broken.py"
    path.write_text(text)
    with pytest.raises(SceneError, match=sentence):
        list(run(load_scene(path)))


def test_an_unknown_scene_is_answered_with_the_nearest_and_all_that_are_known():
    with pytest.raises(SceneError, match=r"no scene 'franka_graps'; the nearest is 'franka_grasp' .*box_pile, "):
        load_scene("franka_graps")


def test_a_scene_of_the_folder_here_is_found_by_name(tmp_path, monkeypatch):
    (tmp_path / "scenes").mkdir()
    (tmp_path / "scenes" / "two_cubes.py").write_text(TWO_CUBES)
    monkeypatch.chdir(tmp_path)
    assert load_scene("two_cubes").steps == 6


def test_what_was_recorded_is_found_again(recorded):
    expected = read_expected(recorded.expected)
    assert [row["step"] for row in expected.rows if row["status"] == "overlapping"] == [1, 3, 4, 6]
    assert [row["bodyA"] for row in expected.rows if row["status"] == "alone"] == [2] * 4
    assert compare(expected, replay(recorded, expected)).failures == []


def test_a_scene_that_is_moved_is_the_same_to_rounding(recorded):
    expected = read_expected(recorded.expected)
    differences = compare(expected, replay(recorded, expected, moved_by=(3.0, 0.1, -0.2)))
    assert differences.failures == []
    assert max(differences.spent.values()) > 0


def test_recording_again_keeps_the_first_lines(recorded):
    lines = recorded.expected.read_text().splitlines(keepends=True)
    lines[0] = "# steps 3 6\n"
    lines[2] = "# budget volume: relative 0.5 absolute 0.25\n"
    recorded.expected.write_text("".join(lines))
    record(recorded)
    expected = read_expected(recorded.expected)
    assert expected.steps == [3, 6]
    assert expected.budgets["volume"] == Budget(0.5, 0.25)
    assert {row["step"] for row in expected.rows} == {3, 6}


def test_shapes_that_a_scene_no_longer_has_ask_for_a_new_recording(recorded, scene_file):
    expected = read_expected(recorded.expected)
    scene_file.write_text(TWO_CUBES.replace("p.createMultiBody(0, cube", "p.createMultiBody(0, -1"))
    with pytest.raises(ValueError, match="record it again"):
        replay(load_scene(scene_file), expected)


def pair(step=1, status="overlapping", **measures):
    row = dict.fromkeys(COLUMNS, 1.0) | {"step": step, "status": status, "bodyA": 0, "linkA": -1, "shapeA": 0}
    return row | {"bodyB": 1, "linkB": -1, "shapeB": 0, "volume_error_m3": 1e-12} | measures


def expected_of(*rows, **budgets):
    return Expected([1], 1e-3, {"volume": Budget(1e-9, 0.0), "normal": Budget(0.0, 1e-6), **budgets}, list(rows))


def failures(old, new):
    return compare(expected_of(*old), new).failures


def test_a_pair_that_is_missing_is_a_failure():
    assert failures([pair(1), pair(2)], [pair(1)]) == [
        "step 2, body/link/shape 0/-1/0 and 1/-1/0 is recorded as overlapping, not found"
    ]


def test_a_pair_out_of_nothing_is_a_failure():
    assert failures([pair(1)], [pair(1), pair(1, bodyB=3)]) == [
        "step 1, body/link/shape 0/-1/0 and 3/-1/0 is overlapping, not recorded"
    ]


def test_another_status_is_a_failure():
    (failure,) = failures([pair()], [pair(status="touching")])
    assert failure.endswith("is touching, recorded as overlapping")


def test_measures_may_differ_by_their_budget_and_no_more():
    assert failures([pair()], [pair(volume_m3=1 + 0.9e-9, normal_z=1 - 0.9e-6)]) == []
    (volume,) = failures([pair()], [pair(volume_m3=1 + 1.1e-9)])
    assert "volume_m3 is 1.0000000011, recorded as 1.0, 1.1 times its budget" in volume
    (normal,) = failures([pair()], [pair(normal_y=1 - 2e-6)])
    assert "normal_y" in normal


def test_a_measure_that_is_not_a_number_is_a_failure():
    assert failures([pair()], [pair(volume_m3=math.nan)]) != []


def test_a_certified_error_ten_times_larger_is_a_failure():
    assert failures([pair()], [pair(volume_error_m3=9e-12)]) == []
    (failure,) = failures([pair()], [pair(volume_error_m3=11e-12)])
    assert failure.endswith("volume_error_m3 is 1.1e-11, was 1e-12")


def loose(old, new):
    return loose_budgets(compare(expected_of(*old), new))


def test_a_budget_ten_times_too_wide_is_reported():
    assert loose([pair()], [pair(volume_m3=1 + 2e-10)]) == []
    assert loose([pair()], [pair(volume_m3=1 + 5e-11)]) == ["the budget of volume is 20 times what is needed"]


def test_no_difference_says_nothing_about_a_budget():
    assert loose([pair()], [pair()]) == []


def test_certified_errors_ten_times_smaller_are_reported():
    assert loose([pair()], [pair(volume_error_m3=1e-14)]) == [
        "the certified errors of the volumes are 0.01 of those recorded"
    ]
