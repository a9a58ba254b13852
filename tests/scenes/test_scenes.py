"""The scenes do what their docstrings promise. `pytest scenes` tests that they are as recorded."""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pybullet as p
import pytest

from overlapper.reference import Fcl
from overlapper.scenes import scene as scene_module
from overlapper.scenes.run import run
from overlapper.scenes.scene import load_scene
from overlapper.verdicts.comparison import compare_measures
from overlapper.verdicts.expected import read_expected
from overlapper.verdicts.replay import replay

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
def test_fcl_is_never_more_accurate(name):
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


def bodies_of(frame):
    """Position and velocity of each body, (n, 3) and (n, 6)."""
    client = frame.bodies.physicsClientId
    ids = sorted({body for body, _, _ in frame.bodies.keys})
    where = [p.getBasePositionAndOrientation(body, client)[0] for body in ids]
    velocity = [np.concatenate(p.getBaseVelocity(body, client)) for body in ids]
    return np.array(where), np.array(velocity)


def test_friction_alone_holds_the_duck_in_the_air_for_five_seconds():
    duck, arm, left, right, lifted = 1, 2, 9, 10, 480
    frames = run(scene("franka_lift"), lifted + 1200, only=range(lifted, lifted + 1201, 240))
    places = []
    for frame in frames:
        (*_, place), velocity = (each[: duck + 1] for each in bodies_of(frame))
        places.append(place)
        weight = 9.81 * p.getDynamicsInfo(duck, -1, frame.bodies.physicsClientId)[0]
    assert len(places) == 6 and places[0][2] > 0.15
    assert np.ptp(places, axis=0).max() < 1e-4
    assert np.abs(velocity[duck, :3]).max() < 1e-5
    assert np.abs(velocity[duck, 3:]).max() < 2e-4
    assert {body for row in frame.forces.pairs[:, [0, 3]].tolist() for body in row} == {duck, arm}
    grips = [np.linalg.norm(frame.forces.on(arm, finger)[0]) for finger in (left, right)]
    assert grips == pytest.approx([20, 20], rel=0.03)
    assert frame.forces.on(duck)[0] == pytest.approx([0, 0, weight], abs=1e-3 * weight)


def test_rolling_bodies_keep_their_energy_and_accelerate_down_a_slope_by_their_inertia():
    first, *_, last = (bodies_of(frame) for frame in run(scene("rolling"), contact="volumetric"))
    (there, before), (here, after) = first, last
    level, sloping = [2, 4, 6], [3, 5, 7]
    # On the level, speed and spin are the same to the last digits, and so is the height.
    assert after[level] == pytest.approx(before[level], abs=1e-11)
    assert here[level, 2] == pytest.approx(there[level, 2], abs=1e-11)
    assert np.linalg.norm(after[level, :3], axis=1) == pytest.approx(1, rel=1e-3)
    # Down the slope: g sin(slope) / (1 + I / m r²), with the radius at which each stands.
    gained = np.linalg.norm(after[sloping, :3], axis=1) - np.linalg.norm(before[sloping, :3], axis=1)
    expected = 239 / 240 * 9.81 * np.sin(np.radians(10)) / (1 + np.array([2 / 5, 1 / 2, 2 / 3]))
    assert gained == pytest.approx(expected, rel=3e-3)


def test_a_cube_that_rattles_on_contact_points_rests_on_what_it_shares():
    *_, (_, volumetric) = (bodies_of(frame) for frame in run(scene("rattling"), 720))
    *_, (_, points) = (bodies_of(frame) for frame in run(scene("rattling"), 720, contact="bullet"))
    assert np.abs(volumetric[1]).max() < 1e-9 < 1e-6 < np.abs(points[1]).max()


def test_a_peg_that_leans_is_pushed_back_by_every_wall():
    *_, frame = run(
        replace(scene("peg_in_hole"), volumetric={"stiffness": 1e7, "dissipation": 1e-3}), contact="volumetric"
    )
    assert len(frame.forces) == 8
    pushed = np.linalg.norm(frame.forces.force, axis=1)
    assert 0.01 < pushed.min() < pushed.max() < 5  # N: two tenths of a millimetre on a few square centimetres
    # It leans about x, towards what is across.
    across, along, _ = np.abs(frame.forces.force.sum(axis=0))
    assert across < 1e-5 < 0.5 * pushed.sum() < along


def test_the_sample_scenes_of_an_installed_package_are_found(tmp_path, monkeypatch):
    installed = tmp_path / "site-packages/overlapper"
    samples = installed / "samples/scenes"
    samples.mkdir(parents=True)
    for name in ("stack", "ramp"):
        (samples / f"{name}.py").write_text('"""A sample."""')
    (tmp_path / "scenes").mkdir()
    (tmp_path / "scenes/ramp.py").write_text('"""Our own."""')
    monkeypatch.setattr(scene_module, "__file__", str(installed / "scenes/scene.py"))
    monkeypatch.chdir(tmp_path)
    assert scene_module.scene_paths() == {"ramp": Path("scenes/ramp.py"), "stack": samples / "stack.py"}
