"""The scenes: what they promise is what happens. That they are as recorded is tested by `pytest scenes`."""

from functools import lru_cache
from pathlib import Path

import pytest

from overlapper.reference import Fcl
from overlapper.scenes.comparison import compare_measures
from overlapper.scenes.expected import read_expected
from overlapper.scenes.record import replay
from overlapper.scenes.run import run
from overlapper.scenes.scene import load_scene

SCENES = Path(__file__).parents[2] / "scenes"
NAMES = sorted(path.stem for path in SCENES.glob("*.py"))


@lru_cache
def scene(name):
    return load_scene(SCENES / f"{name}.py")


def overlapping_at_the_end(name):
    """The links that overlap in the last step recorded, and how many pairs of their shapes do."""
    rows = read_expected(scene(name).expected).rows
    pairs = [
        ((row["bodyA"], row["linkA"]), (row["bodyB"], row["linkB"]))
        for row in rows
        if row["step"] == rows[-1]["step"] and row["status"] == "overlapping"
    ]
    return {pair: pairs.count(pair) for pair in pairs}


@pytest.mark.parametrize("name", NAMES)
def test_measures_stay_within_their_budgets_when_a_scene_is_moved(name):
    expected = read_expected(scene(name).expected)
    spent = compare_measures(expected.rows, replay(expected, moved_by=(0.4, -0.1, 0.8)), expected.budgets).spent
    assert all(part <= 1 for part in spent.values()), spent


@pytest.mark.parametrize("name", NAMES)
def test_fcl_is_never_nearer_to_the_truth(name):
    (frame,) = run(scene(name), only=[scene(name).steps])
    with Fcl() as fcl:
        opinions = fcl.compare_many(contact.overlap for contact in frame.contacts)
    assert opinions
    for opinion in opinions:
        assert opinion.verdict == "agree" or opinion.nearer == "ours", opinion.explanation


@pytest.mark.parametrize("name", NAMES)
def test_a_scene_says_what_is_hard_about_it(name):
    assert "\n\nHard: " in scene(name).difficulty
    assert 100 <= scene(name).steps <= 300


def test_the_fingers_hold_the_duck_in_the_air_in_the_end():
    duck, arm, left, right = 1, 2, 9, 10
    assert set(overlapping_at_the_end("franka_grasp")) == {((duck, -1), (arm, left)), ((duck, -1), (arm, right))}


def test_the_laikago_stands_on_its_four_toes_and_nothing_else():
    assert set(overlapping_at_the_end("laikago_stand")) == {((0, -1), (1, toe)) for toe in (3, 7, 11, 15)}


def test_the_peg_meets_all_eight_walls_of_the_hole():
    assert overlapping_at_the_end("peg_in_hole") == {((0, -1), (1, -1)): 8}


def test_the_jenga_tower_stands_at_first_and_has_fallen_in_the_end():
    rows = read_expected(scene("kuka_jenga").expected).rows
    top = 45  # the last block of the top layer

    def height(step):
        return next(row["positionB_z_m"] for row in rows if row["step"] == step and row["bodyB"] == top)

    assert height(rows[0]["step"]) == pytest.approx(0.435, abs=0.005)
    assert height(rows[-1]["step"]) < 0.3


def test_expected_files_are_small_enough_to_be_kept_in_git():
    sizes = [path.stat().st_size for path in (SCENES / "expected").glob("*.csv")]
    assert max(sizes) <= 400_000
    assert sum(sizes) <= 2_000_000
