"""Common scenes at the first try: how an end is judged, and that runs which fail are told."""

import pytest

from forces import firsttry
from forces import page as forces_page
from forces.common_scenes import SCENES, Scene, Script, floor, joints_of, new_world
from harness import command, results

RESTS = {"finite": "1", "heights": "0 0.5", "moved": "0 0.001", "lifted": "", "driven": ""}


def cube(world):
    floor(world)
    return Script(lifted=world.loadURDF("cube_small.urdf", [0, 0, 0.024]))


@pytest.mark.parametrize(
    ("bullet", "ours", "expected"),
    [
        ({}, {}, firsttry.SAME),
        ({}, {"heights": "0 0.46"}, firsttry.SAME),
        ({}, {"heights": "0 0.44"}, "a body is 0.06 m lower"),
        ({"moved": "0 1"}, {"heights": "0 0.44", "moved": "0 1"}, firsttry.SAME),
        ({}, {"moved": "0 0.006"}, "1 of 2 bodies rest"),
        ({}, {"finite": "0"}, "not finite"),
        ({"finite": "0"}, {}, "no reference"),
        ({"lifted": "0.2"}, {"lifted": "0.11"}, firsttry.SAME),
        ({"lifted": "0.2"}, {"lifted": "0.09"}, "the body is lifted by 0.09 m"),
        ({"lifted": "0.05"}, {"lifted": "0"}, firsttry.SAME),
        ({"driven": "2"}, {"driven": "1.7"}, firsttry.SAME),
        ({"driven": "2"}, {"driven": "2.5"}, "the body goes 2.5 m, not 2 m"),
    ],
)
def test_an_end_is_judged_by_what_differs(bullet, ours, expected):
    assert firsttry.verdict(RESTS | bullet, RESTS | ours) == expected


def test_a_body_that_is_not_finite_is_told():
    def diverging(world):
        script = cube(world)
        return Script(lambda time: world.resetBaseVelocity(script.lifted, [float("nan")] * 3), script.lifted)

    assert firsttry.ends(Scene(diverging, 0.1), "bullet")["finite"] == 0


@pytest.mark.parametrize("law", firsttry.LAWS)
def test_a_scene_ends_with_its_figures(law):
    found = firsttry.ends(Scene(cube, 0.6), law)
    assert found["finite"] == 1 and abs(found["lifted"]) < 2e-3 and found["driven"] == ""
    assert found["heights"].startswith("0.0000 0.02") and len(found["moved"].split()) == 2


def test_a_run_that_fails_or_takes_too_long_is_not_finite(monkeypatch):
    failed = firsttry.in_a_process("no_scene", "bullet")
    assert failed == {"finite": 0, "warnings": "KeyError: 'no_scene'"}
    monkeypatch.setattr(firsttry, "LIMIT", 0.01)
    assert firsttry.in_a_process("cube_drop", "bullet") == {"finite": 0, "warnings": "more than 0.01 s"}


def test_results_and_page_have_every_scene(tmp_path, monkeypatch):
    ended = {name: RESTS | {"ms": 1} for name in SCENES}
    ended["a1_stand"] = {"finite": 0}
    monkeypatch.setattr(firsttry, "in_a_process", lambda name, law: ended[name])
    assert command.main(["firsttry", f"--out={tmp_path}"]) == 0
    rows = results.read(tmp_path / "firsttry.csv")[1]
    assert [(row["scene"], row["law"]) for row in rows] == [(name, law) for name in SCENES for law in firsttry.LAWS]
    said = (tmp_path / "forces.md").read_text(encoding="utf-8")
    assert f"**{len(SCENES) - 1} of {len(SCENES)}** scenes" in said
    assert "| a1 stand | no reference |" in said and "| go1 stand | as Bullet | 2 | 2 |" in said


def test_results_of_the_checkout_have_every_scene_with_both_laws():
    rows = results.read(firsttry.RESULTS)[1]
    assert {(row["scene"], row["law"]) for row in rows} == {(name, law) for name in SCENES for law in firsttry.LAWS}
    assert "$" not in forces_page.firsttry_parts(firsttry.RESULTS)["firsttry"]


@pytest.mark.parametrize("name", ["minitaur_stand", "go1_stand", "panda_cube", "domino_row"])
def test_scenes_are_built(name):
    world = new_world()
    script = SCENES[name].build(world)
    assert world.getNumBodies() >= 2
    for time in (0, 1.2, 2):
        if script.command:
            script.command(time)
    world.stepSimulation()
    assert script.lifted is None or not joints_of(world, script.lifted, 0)
