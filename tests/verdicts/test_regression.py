"""Scenes are found and run, and an expected file notices what has changed since it was written."""

import math
import re

import numpy as np
import pytest

from overlapper import Box, Capsule, Cylinder, HalfSpace, Hull, Sphere
from overlapper.polytopes.shape_text import alike, shape_of, text_of
from overlapper.scenes.check import examined, record
from overlapper.scenes.run import run
from overlapper.scenes.scene import SceneError, load_scene
from overlapper.tables.table import COLUMNS, POSE
from overlapper.verdicts.comparison import compare_measures, compare_poses, loose_budgets
from overlapper.verdicts.expected import DRIFT, Budget, read_expected
from overlapper.verdicts.replay import replay

TWO_CUBES = '''
"""Two unit cubes. The second one slides over the first by a centimetre a step."""
import pybullet as p

STEPS = 6
PAIRS = "all"  # a filter keeps them where they are


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
        ("STEPS = 0\ndef build(client): pass", "a whole number from 1, not 0"),
        ("STEPS = 5", r"must have a function build\(client\)"),
        (
            "STEPS = 5\nPAIRS = 'some'\ndef build(client): pass",
            "PAIRS = 'some', which must be 'simulated', 'all' or a list",
        ),
        ("STEPS = 5\nNAMES = ['duck']\ndef build(client): pass", r"NAMES = \['duck'\], which must be a dictionary"),
        (
            "STEPS = 5\nNAMES = {}\ndef build(client): NAMES['duck'] = 1",
            r"has invalid NAMES: names must be a dictionary of names by the numbers of bodies, such as .*: 1",
        ),
        ("STEPS = 5\ndef build(client:", "cannot be loaded at line 2: SyntaxError"),
        (
            "STEPS = 5\nimport nothing_like_it",
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


def edited(scene_file, old, new):
    text = scene_file.read_text()
    assert old in text
    scene_file.write_text(text.replace(old, new))
    scene = load_scene(scene_file)
    return examined(scene, read_expected(scene.expected))


def test_a_recorded_scene_passes(recorded):
    expected = read_expected(recorded.expected)
    assert [row["step"] for row in expected.rows if row["status"] == "overlapping"] == [1, 3, 4, 6]
    assert [row["bodyA"] for row in expected.rows if row["status"] == "alone"] == [2] * 4
    verdict = examined(recorded, expected)
    assert verdict.moves == []
    assert verdict.notes == []
    assert [line.split("(")[0].split() for line in verdict.lines()] == [
        [cause, "as", "recorded"] for cause in ("geometry", "shapes", "dynamics")
    ]


def test_a_scene_that_is_moved_is_the_same_to_rounding(recorded):
    expected = read_expected(recorded.expected)
    differences = compare_measures(expected.rows, replay(expected, moved_by=(3.0, 0.1, -0.2)), expected.budgets)
    assert max(differences.spent.values()) > 0
    assert [move for move in differences.moves if move.part > 50] == []


def test_a_first_recording_has_budgets_of_five_times_what_rounding_needs(recorded):
    text = recorded.expected.read_text()
    assert "# budget volume: relative " in text
    assert examined(recorded, read_expected(recorded.expected)).notes == []
    recorded.expected.write_text(text.replace("# budget volume: relative ", "# budget volume: relative 1"))
    (note,) = examined(recorded, read_expected(recorded.expected)).notes
    assert "the budget of volume is " in note and "times as large as needed" in note
    expected = read_expected(recorded.expected)
    expected.budgets["volume"] = Budget(1e-20, 0.0)
    verdict = examined(recorded, expected)
    assert verdict.moves == []
    assert any("budget of volume is too narrow" in note for note in verdict.notes)


def test_recording_again_keeps_the_first_lines(recorded):
    lines = recorded.expected.read_text().splitlines(keepends=True)
    lines[0] = "# steps: 3 6\n"
    lines[2] = "# budget volume: relative 0.5 absolute 0.25\n"
    recorded.expected.write_text("".join(lines))
    record(recorded)
    expected = read_expected(recorded.expected)
    assert expected.steps == [3, 6]
    assert expected.budgets["volume"] == Budget(0.5, 0.25)
    assert {row["step"] for row in expected.rows} == {3, 6}


def test_a_scene_of_one_step_is_recorded_at_it(scene_file):
    scene_file.write_text(TWO_CUBES.replace("STEPS = 6", "STEPS = 1"))
    record(load_scene(scene_file))
    assert read_expected(load_scene(scene_file).expected).steps == [1]


def test_an_empty_scene_is_as_recorded(scene_file):
    scene_file.write_text("STEPS = 2\ndef build(client): pass")
    scene = load_scene(scene_file)
    record(scene)
    assert examined(scene, read_expected(scene.expected)).moves == []


def test_a_failing_recording_leaves_what_was_expected(recorded, scene_file):
    before = recorded.expected.read_text()
    scene_file.write_text(TWO_CUBES.replace("    return step", "    return lambda i: 1 / (i - 4)"))
    with pytest.raises(SceneError, match="fails before step 5"):
        record(load_scene(scene_file))
    assert recorded.expected.read_text() == before


def without_rows(text, kept):
    """The text of an expected file with only the first `kept` rows."""
    lines = text.splitlines(keepends=True)
    rows = [line for line in lines if line[0].isdigit()]
    return "".join(line for line in lines if line not in rows[kept:])


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda text: without_rows(text, 5), r"it has 5 of its 8 rows"),
        (lambda text: text[:-40], r"a line has changed"),
        (lambda text: text.replace(",overlapping,0", ",overlapping,9"), r"a line has changed"),
        (lambda text: text.replace('["Box", [0.5', '["Box", [0.6'), r"a line has changed"),
        (lambda text: without_rows(text, 0).partition("step,")[0], r"it has 0 of its 8 rows"),
    ],
)
def test_an_expected_file_that_was_cut_or_changed_is_refused(recorded, change, sentence):
    text = recorded.expected.read_text()
    assert change(text) != text
    recorded.expected.write_text(change(text))
    with pytest.raises(
        ValueError, match=rf"two_cubes\.csv has changed since it was written: {sentence} \(to accept the change"
    ):
        read_expected(recorded.expected)


def test_an_expected_file_without_a_count_is_read_and_one_with_other_line_ends_is_the_same(recorded):
    before = read_expected(recorded.expected)
    text = recorded.expected.read_text()
    recorded.expected.write_bytes(text.replace("\n", "\r\n").encode())
    assert read_expected(recorded.expected).rows == before.rows
    uncounted = re.sub(r"^# rows: .*\n", "", text, flags=re.MULTILINE)
    assert uncounted != text
    recorded.expected.write_text(without_rows(uncounted, 5))
    assert read_expected(recorded.expected).rows == before.rows[:5]


def test_changed_dynamics_are_distinguished_from_changed_geometry_and_shapes(recorded, scene_file):
    verdict = edited(scene_file, "0.9 + 0.01 * i", "0.9 + 0.02 * i")
    assert [bool(moves) for moves in verdict.causes.values()] == [False, False, True]
    assert [(move.step, move.quantity) for move in verdict.dynamics] == [(step, "position_m") for step in (3, 4, 6)]
    assert [move.difference for move in verdict.dynamics] == pytest.approx([0.02, 0.03, 0.05])
    assert verdict.worst_step == 6
    assert "off by 0.05 where 0.0001 is allowed, 500 times its budget" in "\n".join(verdict.lines())
    volumes = {move.step: (move.recorded, move.found) for move in verdict.overlaps if move.quantity == "volume_m3"}
    assert volumes == {3: ("0.08", "0.06"), 4: ("0.07", "0.04")}  # and in step 6 they touch
    assert [(move.step, move.found) for move in verdict.overlaps if move.quantity == "status"] == [(6, "touching")]


def test_a_changed_shape_is_distinguished_from_changed_geometry_and_dynamics(recorded, scene_file):
    verdict = edited(scene_file, "halfExtents=[0.5] * 3", "halfExtents=[0.5, 0.5, 0.4]")
    assert [bool(moves) for moves in verdict.causes.values()] == [False, True, False]
    assert [(move.step, move.recorded) for move in verdict.shapes] == [(1, "Box(half_extents=(0.5, 0.5, 0.5))")] * 3


def test_bodies_that_came_or_went_are_named(recorded, scene_file):
    verdict = edited(scene_file, "p.createMultiBody(0, cube", "p.createMultiBody(0, -1")
    assert [(move.who[-8:], move.found) for move in verdict.shapes] == [("(0/-1/0)", "not there")]
    again = edited(scene_file, "p.createMultiBody(0, -1", "p.createMultiBody(0, cube")
    assert not again.moves
    more = edited(scene_file, "    def step", "    p.createMultiBody(0, cube, physicsClientId=client)\n\n    def step")
    assert [(move.who[-8:], move.recorded) for move in more.shapes] == [("(3/-1/0)", "not there")]


def test_changed_geometry_is_distinguished_from_changed_shapes_and_dynamics(recorded):
    expected = read_expected(recorded.expected)
    expected.rows[0]["volume_m3"] *= 1.01
    verdict = examined(recorded, expected)
    assert [bool(moves) for moves in verdict.causes.values()] == [True, False, False]
    assert [(move.step, move.quantity) for move in verdict.geometry] == [(1, "volume_m3")]


def test_a_scene_shorter_than_its_recording_is_reported(recorded, scene_file):
    (move,) = edited(scene_file, "STEPS = 6", "STEPS = 5").moves
    assert str(move) == "step 6, the scene: last step is 5, recorded as 6"


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("# steps", "# stages", "must say `# steps: <numbers>`"),
        ("# steps: 1 3", "# steps: a b", "must say `# steps: <numbers>`"),
        ("# tolerance: 0.001", "# tolerance: 1e", "could not convert"),
        ("# tolerance: 0.001", "# tolerance: 1e9", "its tolerance must lie between 0 and 1, not 1000000000.0"),
        ("# budget volume", "# budget weight", "has a budget for 'weight'"),
        ("absolute 0.0001\n", "absolute -1\n", "must have two numbers from 0 as budget of position, not 0.0 and -1"),
        ("absolute 0.0001\n", "absolute wide\n", "two numbers from 0 as budget of position, not 0.0 and wide"),
        ("# shapes 0/-1/0", "# shapes 0/-1/one", "'0/-1/one' must be body/link/shape, such as 0/-1/0"),
        ("# shapes", "# forms", "no line `# shapes` has the shape"),
        ('["Box"', '["Bax"', "is not a shape"),
        (",overlapping,", ",overlapping,many", "cannot be read"),
    ],
)
def test_an_expected_file_that_cannot_be_read_is_named(recorded, old, new, sentence):
    text = recorded.expected.read_text()
    assert old in text
    # Or the line says that another has changed since it was written.
    text = re.sub(r"^# rows: .*\n", "", text, flags=re.MULTILINE)
    recorded.expected.write_text(text.replace(old, new))
    with pytest.raises(ValueError, match=sentence) as refusal:
        read_expected(recorded.expected)
    assert "two_cubes.csv" in str(refusal.value)


SHAPES = [
    Box([0.1, 0.2, 0.3]),
    Sphere(1 / 3),
    Capsule(0.1, 0.2),
    Cylinder(0.1, 0.2),
    HalfSpace([0.6, 0, 0.8], -1),
    Hull(np.random.default_rng(3).normal(size=(40, 3))),
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_a_shape_comes_back_from_its_text(shape):
    back = shape_of(text_of(shape))
    assert alike(back, shape)
    assert text_of(back) == text_of(shape)


def test_shapes_are_equal_only_if_all_their_numbers_are_equal():
    hull = np.random.default_rng(3).normal(size=(40, 3))
    others = [
        Box([0.1, 0.2, 0.3001]),
        Sphere(0.333),
        Capsule(0.1, 0.21),
        HalfSpace([0.6, 0, 0.8], -1.001),
        Hull(hull[1:]),
    ]
    for a in SHAPES:
        for b in [*SHAPES, *others]:
            assert alike(a, b) == (a is b)
    assert alike(Hull(hull), Hull(hull[::-1]))


def pair(step=1, status="overlapping", **measures):
    row = dict.fromkeys(COLUMNS, 1.0) | {"step": step, "status": status, "bodyA": 0, "linkA": -1, "shapeA": 0}
    return row | {"bodyB": 1, "linkB": -1, "shapeB": 0, "volume_error_m3": 1e-12} | measures


BUDGETS = {"volume": Budget(1e-9, 0.0), "normal": Budget(0.0, 1e-6), "position": Budget(0.0, 1e-3)}


def failures(old, new):
    return [str(move) for move in compare_measures(old, new, BUDGETS).moves]


def test_a_pair_that_is_missing_is_a_failure():
    assert failures([pair(1), pair(2)], [pair(1)]) == [
        "step 2, 0/-1/0 and 1/-1/0: status is not there, recorded as overlapping"
    ]


def test_a_new_pair_is_a_failure():
    assert failures([pair(1)], [pair(1), pair(1, bodyB=3)]) == [
        "step 1, 0/-1/0 and 3/-1/0: status is overlapping, recorded as not there"
    ]


def test_another_status_is_a_failure():
    (failure,) = failures([pair()], [pair(status="touching")])
    assert failure.endswith("is touching, recorded as overlapping")


def test_measures_may_differ_by_their_budget_and_no_more():
    assert failures([pair()], [pair(volume_m3=1 + 0.9e-9, normal_z=1 - 0.9e-6)]) == []
    (volume,) = failures([pair()], [pair(volume_m3=1 + 1.1e-9)])
    assert "volume_m3 is 1.0000000011, recorded as 1: off by 1.1e-09 where 1e-09 is allowed, 1.1 times its" in volume
    (normal,) = failures([pair()], [pair(normal_y=1 - 2e-6)])
    assert "normal_y" in normal


def test_a_measure_that_is_not_a_number_is_a_failure():
    assert failures([pair()], [pair(volume_m3=math.nan)]) != []


def test_nan_differs_from_numbers_and_not_from_nan():
    nowhere = pair(volume_m3=math.nan, positionA_x_m=math.nan, orientationB_w=math.nan, depth_m=math.inf)
    assert failures([nowhere], [nowhere]) == []
    assert compare_poses([nowhere], [dict(nowhere)], BUDGETS | DRIFT).moves == []
    (move,) = compare_poses([nowhere], [nowhere | {"positionA_x_m": 0.0}], BUDGETS).moves
    assert move.quantity == "position_m"
    placeless = pair(**dict.fromkeys([part.format(side) for side in "AB" for part in POSE]))
    assert compare_poses([placeless], [dict(placeless)], BUDGETS | DRIFT).moves == []


def test_pairs_of_links_and_pairs_of_shapes_are_told_apart():
    assert failures([pair(shapeA=None, shapeB=None)], [pair()]) == [
        "step 1, 0/-1/None and 1/-1/None: status is not there, recorded as overlapping",
        "step 1, 0/-1/0 and 1/-1/0: status is overlapping, recorded as not there",
    ]


def test_a_certified_error_ten_times_larger_and_beyond_the_budget_of_the_volume_is_a_failure():
    assert failures([pair(volume_error_m3=1e-9)], [pair(volume_error_m3=9e-9)]) == []
    assert failures([pair(volume_error_m3=1e-12)], [pair(volume_error_m3=9e-10)]) == []
    (failure,) = failures([pair(volume_error_m3=1e-9)], [pair(volume_error_m3=1.1e-8)])
    assert "volume_error_m3 is 1.1e-08, recorded as 1e-09" in failure


def loose(old, new):
    return loose_budgets(compare_measures(old, new, BUDGETS))


def test_a_budget_ten_times_too_wide_is_reported():
    assert loose([pair()], [pair(volume_m3=1 + 2e-10)]) == []
    assert loose([pair()], [pair(volume_m3=1 + 5e-11)]) == ["the budget of volume is 20 times as large as needed"]


def test_no_difference_says_nothing_about_a_budget():
    assert loose([pair()], [pair()]) == []


def test_certified_errors_ten_times_smaller_are_reported():
    assert loose([pair()], [pair(volume_error_m3=1e-14)]) == [
        "the certified errors of the volumes are 0.01 of those recorded"
    ]


def test_poses_are_compared_by_distance_and_angle():
    turned = {f"orientationB_{part}": value for part, value in zip("xyzw", (0, 0, -math.sin(0.05), -math.cos(0.05)))}
    upright = {f"orientation{side}_{part}": float(part == "w") for side in "AB" for part in "xyzw"}
    old, new = pair(**upright), pair(**upright | turned, positionA_x_m=1.003, positionA_y_m=1.004)
    (move,) = compare_poses([old], [new], BUDGETS).moves
    assert (move.who, move.quantity, move.difference) == ("0/-1/0", "position_m", pytest.approx(0.005))
    angle = compare_poses([old], [new], BUDGETS | {"orientation": Budget(0.0, 0.05)}).moves[-1]
    assert (angle.who, angle.difference, angle.part) == ("1/-1/0", pytest.approx(0.1), pytest.approx(2.0))
