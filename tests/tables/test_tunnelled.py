"""Pairs that pass through each other within a step: rows of tables, summaries, pages and commands."""

import json
import subprocess
import sys
from contextlib import closing

import pybullet as p
import pytest
from simulated import body

import overlapper
from overlapper import Log
from overlapper.scenes.run import run
from overlapper.scenes.scene import load_scene
from overlapper.simulation import Bodies
from overlapper.simulation.first_overlaps import FirstOverlaps
from overlapper.tables.summary import Summary
from overlapper.tables.table_file import read_metadata, read_table
from overlapper.verdicts.comparison import compare_measures

SCENE = '''
"""A bullet flies through a sheet, in step 3, and comes to rest within a block, in step 4."""
import pybullet as p
STEPS = 4
NAMES = {}
def build(client):
    sheet = p.createCollisionShape(p.GEOM_BOX, halfExtents=[1, 1, 0.0005], physicsClientId=client)
    block = p.createCollisionShape(p.GEOM_BOX, halfExtents=[1, 1, 0.2], physicsClientId=client)
    ball = p.createCollisionShape(p.GEOM_SPHERE, radius=0.01, physicsClientId=client)
    NAMES[p.createMultiBody(0, sheet, physicsClientId=client)] = "sheet"
    NAMES[p.createMultiBody(0, block, basePosition=[0, 0, -0.7], physicsClientId=client)] = "block"
    bullet = p.createMultiBody(0.01, ball, basePosition=[0.25, 0, 0.9], physicsClientId=client)
    NAMES[bullet] = "bullet"
    p.changeDynamics(bullet, -1, linearDamping=0, physicsClientId=client)
    p.resetBaseVelocity(bullet, [0, 0, -84], physicsClientId=client)  # 0.35 m in a step
'''
FALL = 84 / 240
FRACTION = (0.9 - 2 * FALL - 0.01 - 0.0005) / FALL


@pytest.fixture
def scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "bullet.py"
    path.write_text(SCENE)
    return path


def command(*arguments):
    done = subprocess.run([sys.executable, "-m", "overlapper", *arguments], capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stderr
    return done


@pytest.mark.parametrize("ending", ["csv", "parquet", "sqlite"])
@pytest.mark.parametrize("per", ["shape", "link"])
def test_run_between_writes_rows_of_what_passed_through(scene, ending, per):
    done = command("run", "bullet.py", "--between", "--per", per, "--out", f"t.{ending}", "--html", "page.html")
    through, met = read_table(scene.with_name(f"t.{ending}"))
    assert (through["step"], through["nameA"], through["nameB"]) == (3, "sheet", "bullet")
    assert (through["status"], through["volume_m3"], through["depth_m"]) == ("tunnelled", 0, 0)
    assert through["centroid_x_m"] is None and (through["normal_x"], through["normal_z"]) == (0, -1)
    assert through["impact_fraction"] == pytest.approx(FRACTION, abs=1e-6)
    assert [through[f"impact_{axis}_m"] for axis in "xyz"] == pytest.approx([0.25, 0, 0.0005], abs=1e-6)
    assert (met["step"], met["nameA"], met["nameB"], met["status"]) == (4, "block", "bullet", "overlapping")
    assert met["impact_fraction"] == pytest.approx((0.9 - 3 * FALL + 0.49) / FALL, abs=1e-3)
    assert "Tunnelled: one pair of links" in done.stdout and "step 3, sheet – bullet" in done.stdout
    assert (scene.parent / "page.html").exists()


def test_without_between_nothing_is_said_of_it(scene):
    command("run", "bullet.py", "--out", "t.csv")
    (met,) = read_table(scene.with_name("t.csv"))
    assert met["step"] == 4 and "impact_fraction" not in met
    assert "tunnelled" not in json.loads(command("run", "bullet.py", "--json").stdout)


def test_watch_between_finds_the_bullet(scene):
    script = scene.with_name("script.py")
    script.write_text(f"{SCENE}\nclient = p.connect(p.DIRECT)\nbuild(client)\nfor _ in range(4): p.stepSimulation()\n")
    told = json.loads(command("watch", "--between", "--json", "--out", "w.csv", "script.py").stderr.splitlines()[-1])
    (found,) = told["simulations"][0]["tunnelled"]
    assert found["step"] == 3 and found["fraction"] == pytest.approx(FRACTION, abs=1e-6)
    assert [row["status"] for row in read_table(scene.with_name("w.csv"))] == ["tunnelled", "overlapping"]
    refused = subprocess.run(
        [sys.executable, "-m", "overlapper", "watch", "--between", "--every", "2", "script.py"],
        capture_output=True,
        text=True,
    )
    assert refused.returncode == 2
    assert "--between needs every step, so it does not go with --every" in refused.stderr


def test_a_watch_of_mujoco_finds_the_bullet(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option timestep="0.004" gravity="0 0 0"/><worldbody>
        <geom name="sheet" type="box" size="1 1 .0005"/>
        <body name="bullet" pos="0 0 1"><freejoint/><geom type="sphere" size=".01"/></body></worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    data.qvel[2] = -100
    with overlapper.watch(data, tmp_path / "m.csv", between=True) as watch:
        for _ in range(6):
            mujoco.mj_step(model, data)
    (row,) = read_table(tmp_path / "m.csv")
    assert (row["status"], row["step"]) == ("tunnelled", 4)
    assert row["impact_fraction"] == pytest.approx((0.2 - 0.0105) / 0.4, abs=1e-6)
    assert [each.step for each in watch.summary.tunnelled] == [4]
    with pytest.raises(ValueError, match=r"^between needs every step, so every must be 1, not 2$"):
        overlapper.watch(data, between=True, every=2)


def test_log_takes_first_overlaps(client, tmp_path):
    sheet = body(client, p.GEOM_BOX, halfExtents=[1, 1, 0.0005], mass=0)
    bullet = body(client, p.GEOM_SPHERE, radius=0.01, position=[0, 0, 1])
    bodies = Bodies(client)
    with Log(tmp_path / "own.csv", bodies, between=True) as log:
        log.add(bodies.overlaps(), first=FirstOverlaps())
        p.resetBasePositionAndOrientation(bullet, [0, 0, -1], [0, 0, 0, 1], physicsClientId=client)
        bodies.update()
        first = bodies.first_overlaps()
        log.add(bodies.overlaps(), first=first)
        with pytest.raises(TypeError, match=r"^first must be what Bodies.first_overlaps\(\) returns, not 3$"):
            log.add(bodies.overlaps(), first=3)
    (row,) = read_table(tmp_path / "own.csv")
    assert (row["step"], row["bodyA"], row["bodyB"], row["status"]) == (2, sheet, bullet, "tunnelled")
    with (
        Log(tmp_path / "other.csv", bodies) as log,
        pytest.raises(ValueError, match=r"^this Log has no columns for first overlaps: make it with"),
    ):
        log.add(bodies.overlaps(), first=first)
    assert "rows" in read_metadata(tmp_path / "own.csv")


def test_a_table_with_tunnelled_rows_agrees_with_the_same_run_without_them(scene):
    tables = []
    for name, options in (("with.csv", ["--between"]), ("without.csv", [])):
        command("run", "bullet.py", "--out", name, *options)
        tables.append(read_table(scene.with_name(name)))
    assert [len(table) for table in tables] == [2, 1]
    assert compare_measures(*tables, {}).moves == []


def test_a_summary_counts_what_is_undecided(scene):
    summary = Summary("bullet")
    with closing(run(load_scene(str(scene)), between=True)) as frames:
        for frame in frames:
            for each in frame.first:
                object.__setattr__(each, "status", "open")
            summary.add(frame)
    assert (summary.undecided, summary.tunnelled) == (2, [])
    assert summary.as_dict()["undecided"] == 2


@pytest.mark.parametrize("reset", ["pose", "simulation", "state"])
def test_a_watch_sees_no_motion_in_a_reset(client, reset):
    def build():
        sheet = body(client, p.GEOM_BOX, halfExtents=[1, 1, 0.0005], mass=0)
        ball = body(client, p.GEOM_SPHERE, radius=0.01, mass=1, position=[0, 0, 0.5])
        return sheet, ball

    _, ball = build()
    state = p.saveState(physicsClientId=client)
    watch = overlapper.watch(client, between=True)
    p.stepSimulation(client)
    p.resetBaseVelocity(ball, [0, 0, -84], physicsClientId=client)
    for _ in range(2):
        p.stepSimulation(client)
    assert len(watch.summary.tunnelled) == 1  # and now it is below the sheet
    if reset == "pose":
        p.resetBasePositionAndOrientation(ball, [0, 0, 0.5], [0, 0, 0, 1], physicsClientId=client)
    elif reset == "simulation":
        p.resetSimulation(physicsClientId=client)
        build()
    else:
        p.restoreState(state, physicsClientId=client)
    p.stepSimulation(client)
    watch.close()
    assert len(watch.summary.tunnelled) == 1 and watch.measured == 4


def test_a_watch_of_mujoco_sees_no_motion_in_a_reset():
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><option gravity="0 0 0"/><worldbody><geom type="box" size="1 1 .0005"/><body pos="0 0 .5"><freejoint/>'
        '<geom type="sphere" size=".01"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    with overlapper.watch(data, between=True) as watch:
        mujoco.mj_step(model, data)
        data.qvel[2] = -300
        for _ in range(3):  # 0.6 m in a step
            mujoco.mj_step(model, data)
        assert len(watch.summary.tunnelled) == 1
        mujoco.mj_resetData(model, data)
        for _ in range(2):
            mujoco.mj_step(model, data)
        assert len(watch.summary.tunnelled) == 1 and watch.measured == 6


def test_a_scene_that_puts_a_body_elsewhere_has_no_tunnelled_row(scene):
    scene.write_text(
        SCENE
        + """
    def put(i):
        p.resetBasePositionAndOrientation(bullet, [0, 0, 0.5 - i % 2], [0, 0, 0, 1], physicsClientId=client)
        p.resetBaseVelocity(bullet, [0, 0, 0], physicsClientId=client)
    return put
"""
    )
    with closing(run(load_scene(scene), between=True)) as frames:
        assert [frame.first for frame in frames] == [[]] * 4
