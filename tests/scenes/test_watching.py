"""A client is watched from inside a script or a notebook. Any step is noticed."""

import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pybullet as p
import pytest
from matplotlib import pyplot
from numpy.testing import assert_allclose
from simulated import box

import overlapper
from overlapper.scenes import watching
from overlapper.simulation import Bodies, Recorder, VolumetricContact
from overlapper.tables import log
from overlapper.tables.table import rows
from overlapper.tables.table_file import read_metadata, read_table


@pytest.fixture(autouse=True)
def empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def pile(client):
    """Two boxes. One falls into the other."""
    p.setGravity(0, 0, -9.8, physicsClientId=client)
    box(client, mass=0)
    box(client, position=[0.1, 0, 0.9])
    return client


def test_a_watch_gives_the_answers_of_bodies(pile):
    step = p.stepSimulation
    expected = []
    with overlapper.watch(pile, "own.sqlite", "own.html", every=2, pairs="all", name="a pile") as watch:
        bodies = Bodies(pile)
        for number in range(1, 8):
            p.stepSimulation(pile)
            bodies.update()
            if number % 2 == 0:
                expected += rows(number, number / 240, bodies, bodies.overlaps(pairs="all"))
    assert p.stepSimulation is step
    found = read_table(Path("own.sqlite"))
    assert [row["step"] for row in found] == [2, 4, 6]
    assert found == [{**row, "fcl": None, "fcl_explanation": None} for row in expected]
    assert (watch.steps, watch.measured, watch.time, watch.open) == (7, 3, 7 / 240, False)
    assert watch.written == [Path("own.sqlite"), Path("own.html")]
    (pair,) = watch.summary.as_dict()["pairs"]
    assert pair["steps_overlapping"] == 3
    said = read_metadata(Path("own.sqlite"))
    assert said.items() >= {"simulation": "a pile", "every": "2", "pairs": "all", "surface": "nominal"}.items()
    p.stepSimulation(pile)
    assert watch.steps == 7


def test_a_simulation_goes_on_as_if_nobody_watched(client):
    poses = []
    for watched in (False, True):
        p.resetSimulation(physicsClientId=client)
        p.setGravity(0, 0, -9.8, physicsClientId=client)
        box(client, mass=0)
        for x in (0.0, 0.3, 0.7):
            box(client, position=[x, 0.1, 0.99 + x])
        watch = overlapper.watch(client) if watched else None
        for _ in range(100):
            p.stepSimulation(client)
        poses.append([p.getBasePositionAndOrientation(each, client) for each in range(4)])
        assert not watch or watch.measured == 100
        if watch:
            watch.close()
    assert poses[0] == poses[1]


def test_a_client_that_disconnects_ends_its_watch(pile):
    watch = overlapper.watch(pile, "own.csv")
    p.stepSimulation(pile)
    p.disconnect(pile)
    assert not watch.open and watch.written == [Path("own.csv")] and Path("own.csv").is_file()
    watch.close()


def test_two_watches_of_one_client_and_a_recorder_of_the_users(pile):
    with Recorder(pile) as recorder:
        p.setCollisionFilterPair(0, 1, -1, -1, 0, physicsClientId=pile)
        with overlapper.watch(pile, recorder=recorder) as told, overlapper.watch(pile) as untold:
            p.stepSimulation(pile)
        p.setCollisionFilterPair(0, 1, -1, -1, 1, physicsClientId=pile)
        assert recorder.changes == 2
    assert not told.summary.pairs and len(untold.summary.pairs) == 1


@pytest.mark.parametrize(
    ("error", "place"), [(ValueError, "own.unfinished.csv"), (KeyboardInterrupt, "own.csv"), (SystemExit, "own.csv")]
)
def test_only_an_error_keeps_the_table_from_its_place(pile, error, place):
    watch = overlapper.watch(pile, "own.csv")

    def interrupted():
        with watch:
            p.stepSimulation(pile)
            raise error

    with pytest.raises(error):
        interrupted()
    assert watch.written == [Path(place)] == list(Path().iterdir())


def test_mujoco_is_not_asked_about_a_simulation_of_pybullet(pile):
    words = "^check='mujoco' needs a simulation of MuJoCo, but pybullet runs this one$"
    with pytest.raises(ValueError, match=words):
        overlapper.watch(pile, "own.csv", check="mujoco")
    p.stepSimulation(pile)  # nobody watches
    assert not [*Path().iterdir()]


def test_a_watch_draws_the_rows_of_its_table_while_it_goes_on_and_after_its_end(pile):
    pyplot.switch_backend("Agg")
    with overlapper.watch(pile, "own.parquet", every=2) as watch:
        with pytest.raises(ValueError, match=r"^this watch has measured no step to draw$"):
            watch.plot()
        for _ in range(4):
            p.stepSimulation(pile)
        meanwhile = [line.get_xydata() for line in watch.plot()[1].lines]
    afterwards = [line.get_xydata() for line in watch.plot(most=1)[1].lines]
    table = pyarrow.parquet.read_table("own.parquet").to_pydict()
    assert {*table["step"]} == {2, 4} and len(meanwhile) == len({*zip(table["bodyA"], table["bodyB"])})
    for times, _ in (line.T for line in meanwhile + afterwards):
        assert_allclose(times, np.unique(table["time_s"]))
    assert_allclose(afterwards[0], meanwhile[0])
    pyplot.close("all")


def test_a_watch_without_a_table_says_that_a_plot_needs_one(pile):
    with overlapper.watch(pile) as watch:
        p.stepSimulation(pile)
        with pytest.raises(ValueError, match=r"^this watch writes no table to draw: name one, as in overlapper\.watch"):
            watch.plot()


def test_a_missing_body_raises_in_the_call_of_the_step(pile):
    watch = overlapper.watch(pile, pairs=[(0, 7)])
    with pytest.raises(ValueError, match="pairs names body 7, which is not in the simulation"):
        p.stepSimulation(pile)
    assert not watch.open
    p.stepSimulation(pile)
    assert watch.steps == 1


@pytest.mark.parametrize(
    ("options", "kind", "words"),
    [
        ({"every": 0}, ValueError, "every must be a number of steps from 1, not 0"),
        ({"rate": 0}, ValueError, "rate must be a number of measurements a second above 0, not 0"),
        ({"rate": "60"}, ValueError, "rate must be a number of measurements a second above 0, not '60'"),
        ({"check": "gut"}, ValueError, "check must be 'fcl', 'mujoco' or None, not 'gut'"),
        ({"per": "body"}, ValueError, "per must be 'shape' or 'link', not 'body'"),
        ({"surface": "rough"}, ValueError, "surface must be"),
        ({"out": "own.txt"}, ValueError, "the name of a table must end in .csv, .parquet, .sqlite, not 'own.txt'"),
        ({"html": "."}, OSError, "Is a directory"),
        ({"physicsClientId": 17}, ValueError, "physicsClientId 17 is not connected to a physics server"),
    ],
)
def test_a_bad_option_is_refused_at_once(client, options, kind, words):
    step = p.stepSimulation
    with pytest.raises(kind, match=re.escape(words)):
        overlapper.watch(**{"physicsClientId": client, **options})
    assert p.stepSimulation is step and list(Path().iterdir()) == []


def test_ctrl_c_waits_for_what_is_being_written():
    log = []

    def press(word):
        with watching.interrupted_later():
            signal.raise_signal(signal.SIGINT)
            log.append(word)

    with pytest.raises(KeyboardInterrupt):
        press("written")
    thread = threading.Thread(target=lambda: log.append(signal.getsignal(signal.SIGINT)))
    with watching.interrupted_later():
        thread.start(), thread.join()
    assert log[0] == "written" and log[1] is not signal.getsignal(signal.SIGINT)


def test_an_interruption_in_the_middle_of_reading_costs_no_later_step(pile, monkeypatch):
    with overlapper.watch(pile, "own.csv") as watch:
        p.stepSimulation(pile)
        with monkeypatch.context() as patched:
            patched.setattr(Bodies, "update", lambda self: signal.raise_signal(signal.SIGINT))
            with pytest.raises(KeyboardInterrupt):
                p.stepSimulation(pile)
        p.stepSimulation(pile)
    assert [row["step"] for row in read_table(Path("own.csv"))] == [1, 3] and watch.steps == 3


def test_the_package_exports_the_names():
    assert overlapper.Log is log.Log
    assert overlapper.watch is overlapper.watch


def test_the_loop_of_the_documents_is_watched():
    text = (Path(__file__).parents[2] / "docs" / "watch.md").read_text(encoding="utf-8")
    (loop,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    done = subprocess.run([sys.executable, "-c", loop], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == 4  # wheels on the ground
    assert {row["step"] % 4 for row in read_table(Path("r2d2.csv"))} == {0}


def test_a_step_that_fails_in_real_time_ends_the_watch():
    """A sample must not wait for the call that ends the watch."""
    script = """
import faulthandler, threading, time
import pybullet as p
import overlapper
faulthandler.dump_traceback_later(60, exit=True)
c = p.connect(p.SHARED_MEMORY_SERVER)
watch = overlapper.watch(c, rate=1000)
def fail(frame):
    if threading.current_thread() is threading.main_thread():
        time.sleep(0.2)  # until a sample is due
        raise OSError("the disk is full")
watch._take = fail
p.setRealTimeSimulation(1, c)
try:
    p.stepSimulation(c)
except OSError as error:
    print(error, watch.open)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "the disk is full False\n" in done.stdout


def test_a_step_of_volumetric_contact_is_one_step(client):
    p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE, physicsClientId=client), physicsClientId=client)
    box = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05] * 3, physicsClientId=client)
    p.createMultiBody(1, box, -1, [0, 0, 0.0499], physicsClientId=client)
    p.setGravity(0, 0, -9.81, physicsClientId=client)
    with overlapper.watch(client) as watch, VolumetricContact(Bodies(client), substeps=4) as contact:
        for _ in range(20):
            contact.step()
    assert (watch.steps, watch.measured, watch.time) == (20, 20, pytest.approx(20 / 240))
    assert watch.summary.pairs[0, -1, 1, -1].steps == 20
