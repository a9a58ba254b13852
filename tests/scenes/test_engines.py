"""An engine without pybullet, whose bodies only move by script: scenes, loops, watches, pages, verdicts, sweeps."""

import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
from scripted_engine import World

import overlapper
from overlapper import Box, Log, Placed, Sphere, overlap
from overlapper.scenes.check import hold
from overlapper.scenes.run import run
from overlapper.scenes.scene import SceneError, load_scene, scenes_in
from overlapper.simulation import link_contacts
from overlapper.simulation.bodies import AnyBodies
from overlapper.simulation.cautions import SkippedShapeWarning
from overlapper.simulation.engine import ENGINES
from overlapper.simulation.forces.contact import VolumetricContact
from overlapper.sweep.study import Study, Task
from overlapper.sweep.tasks import prepared
from overlapper.tables.table_file import read_metadata, read_table

SCENE = '''
"""A ball sinks into a cube."""
from overlapper import Box, Sphere
ENGINE = "scripted"
STEPS = 8
def build(world, *, sinks=0.02):
    world.add("cube", Box([0.1] * 3), (0, 0, 0))
    ball = world.add("ball", Sphere(0.05), (0, 0, 0.2))
    return lambda i: world.move(ball, (0, 0, 0.2 - sinks * (i + 1)))
'''


@pytest.fixture(autouse=True)
def scripted(monkeypatch, tmp_path):
    monkeypatch.setitem(ENGINES, "scripted", "scripted_engine")
    monkeypatch.chdir(tmp_path)
    Path("sinking.py").write_text(SCENE)


def sunk(step):
    """The overlap of the ball and the cube after `step` steps of the scene."""
    return overlap(Box([0.1] * 3), Placed(Sphere(0.05), (0, 0, 0.2 - 0.02 * step)))


def test_a_scene_is_run():
    assert scenes_in(Path()) == [Path("sinking.py")]
    scene = load_scene("sinking.py")
    with closing(run(scene)) as frames:
        found = {frame.step: (frame.time, [each.overlap.volume for each in frame.contacts]) for frame in frames}
    assert [*found] == [*range(1, 9)] and found[8][0] == pytest.approx(0.08)
    assert found[1][1] == found[2][1] == []
    assert found[5][1] == [sunk(5).volume] and found[8][1] == [sunk(8).volume]
    (deeper,) = run(load_scene("sinking.py", {"sinks": "0.03"}), only={5})
    assert deeper.contacts[0].overlap.volume > sunk(5).volume
    assert deeper.bodies.names == {(0, -1): "cube", (1, -1): "ball"}
    assert link_contacts(deeper.contacts)[0].volume == deeper.contacts[0].overlap.volume


def test_a_loop_is_logged():
    world = World()
    ball = world.add("ball", Sphere(0.1), (0, 0, 0))
    world.add("cube", Box([0.1] * 3), (0, 0, 0.1))
    bodies = AnyBodies(world)
    assert bodies.engine == "scripted"
    with Log("own.csv", bodies) as log:
        for step in range(1, 4):
            world.move(ball, (0, 0, 0.01 * step))
            bodies.update()
            log.add(bodies.overlaps())
    rows = read_table(Path("own.csv"))
    assert [(row["step"], row["time_s"], row["nameA"]) for row in rows] == [
        (step, pytest.approx(0.01 * step), "ball") for step in range(1, 4)
    ]
    assert rows[0]["volume_m3"] < rows[2]["volume_m3"]
    assert "pybullet" not in read_metadata(Path("own.csv"))


def test_steps_of_others_are_watched():
    world = World()
    ball = world.add("ball", Sphere(0.1), (0, 0, 1))
    world.add("cube", Box([0.1] * 3), (0, 0, 0))
    with overlapper.watch(world, "run.csv", "run.html", engine="scripted") as watch:
        for step in range(20):
            World().step()  # which nobody watches
            world.move(ball, (0, 0, 1 - step / 20))
            world.step()
    world.step()
    assert (watch.steps, watch.measured, watch.time) == (20, 20, pytest.approx(0.2))
    assert watch.written == [Path("run.csv"), Path("run.html")]
    assert "pybullet" not in read_metadata(Path("run.csv"))
    assert {row["nameB"] for row in read_table(Path("run.csv"))} == {"cube"}
    assert "cube" in Path("run.html").read_text()
    (pair,) = watch.summary.pairs.values()
    assert pair.volume == pytest.approx(overlap(Sphere(0.1), Placed(Box([0.1] * 3), (0, 0, -0.05))).volume)


def test_a_scene_is_held_against_its_expected_file():
    path = Path("sinking.py")
    assert hold(path, Path("out/sinking.moved.html")).word == "new"
    assert "pybullet" not in read_metadata(Path("expected/sinking.csv"))
    assert hold(path, Path("out/sinking.moved.html")).word == "as recorded"
    path.write_text(SCENE.replace("sinks=0.02", "sinks=0.021"))
    outcome = hold(path, Path("out/sinking.moved.html"))
    assert (outcome.word, outcome.causes["geometry"], outcome.causes["dynamics"]) == ("moved", "as recorded", "moved")
    assert outcome.page.is_file()


def test_a_task_of_a_sweep_is_done():
    study = Study.of(Path("sinking.py"), 8)
    assert [*study.versions] == ["overlapper"]
    (row,) = prepared(study)(Task("one", {"sinks": 0.02})).values()
    assert max(sunk(step).volume for step in range(1, 9)) in row.values()


def test_new_bodies_and_bodies_without_a_pose_are_noticed():
    world = World()
    world.add("ball", Sphere(0.1), (0, 0, 0))
    bodies = AnyBodies(world)
    assert len(bodies.overlaps()) == 0
    cube = world.add("cube", Box([0.1] * 3), (0, 0, 0.1))
    bodies.update()
    assert len(bodies.overlaps()) == 1 and bodies.partners() == {(0, -1): [(1, -1)], (1, -1): [(0, -1)]}
    world.move(cube, (0, 0, float("nan")))
    with pytest.warns(SkippedShapeWarning, match=r"cube \(body 1, link -1\) is left out") as told:
        bodies.update()
    assert told[0].filename == __file__
    assert len(bodies.overlaps()) == 0 and [each.body for each in bodies.skipped] == [1]


def test_a_simulator_without_forces_says_so():
    with pytest.raises(ValueError, match="accepts no forces"):
        VolumetricContact(AnyBodies(World()))
    with pytest.raises(SceneError, match=r"has an invalid CONTACT: .*accepts no forces"):
        next(run(load_scene("sinking.py"), contact="volumetric"))


def test_an_unknown_engine_is_named():
    Path("sinking.py").write_text(SCENE.replace("scripted", "newton"))
    with pytest.raises(SceneError, match=r"ENGINE = 'newton', which must be one of 'bullet'"):
        load_scene("sinking.py")
    with pytest.raises(ValueError, match=r"the engine must be one of 'bullet', .*, not 'newton'"):
        overlapper.watch(World(), engine="newton")


@pytest.mark.parametrize("options", [["run"], ["view"], ["check"], ["sweep", "--seeds", "2", "--out", "runs"]])
def test_a_command_refuses_an_unknown_engine_in_one_sentence(options):
    Path("sinking.py").write_text(SCENE.replace("scripted", "newton"))
    done = subprocess.run([sys.executable, "-m", "overlapper", *options, "sinking.py"], capture_output=True, text=True)
    told = "overlapper: sinking.py has ENGINE = 'newton', which must be one of 'bullet', 'mujoco'\n"
    assert (done.returncode, done.stdout, done.stderr) == (2, "", told)


def test_pybullet_is_not_needed():
    """These tests pass where it cannot be imported. Tests of commands are left out: a command is a process that can."""
    others = "not pybullet_is_not_needed and not command"
    code = f"""
import sys
sys.modules["pybullet"] = None
import pyarrow
import pyarrow.parquet
import pytest
sys.exit(pytest.main(["-q", "-p", "no:cacheprovider", "-k", {others!r}, {str(Path(__file__))!r}]))
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=Path(__file__).parents[2], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
