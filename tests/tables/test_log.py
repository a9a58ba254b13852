"""`Log` writes a user's own loop as the table that `overlapper run` writes."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pybullet as p
import pytest
from simulated import body, box

from overlapper import Log
from overlapper.scenes.run import run
from overlapper.scenes.scene import load_scene
from overlapper.simulation import Bodies, VolumetricContact, link_contacts
from overlapper.tables.table import link_rows, rows
from overlapper.tables.table_file import read_metadata, read_table

ENDINGS = ["csv", "parquet", "sqlite"]

SCENE = '''
"""Two cubes fall on a third, and stay 2 cm deep in each other."""
import pybullet as p
STEPS = 12
PAIRS = "all"
def build(client):
    p.setGravity(0, 0, -9.8, physicsClientId=client)
    cube = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05] * 3, physicsClientId=client)
    for x, z in ((0, 0), (0.02, 0.1), (0.1, 0.099)):
        p.createMultiBody(z and 1, cube, basePosition=[x, 0, z], physicsClientId=client)
'''


def test_the_folder_of_a_log_is_made(client, tmp_path):
    with Log(tmp_path / "new" / "folder" / "own.csv", Bodies(client)) as log:
        assert log.steps == 0
    assert [each.name for each in (tmp_path / "new" / "folder").iterdir()] == ["own.csv"]


@pytest.mark.parametrize("ending", ENDINGS)
def test_what_was_left_out_is_in_the_metadata_finished_or_not(client, tmp_path, ending):
    for x in (0.0, 0.9):
        box(client, position=[x, 0, 0])
    bodies = Bodies(client)
    place = tmp_path / f"own.{ending}"

    def logged(error=None):
        with Log(place, bodies) as log:
            log.add(bodies.overlaps())
            p.resetBasePositionAndOrientation(1, [float("nan")] * 3, [0, 0, 0, 1], physicsClientId=client)
            with pytest.warns(UserWarning, match="box#1"):
                bodies.update()
            log.add(bodies.overlaps())
            if error:
                log.add(bodies.overlaps(), step=1)

    logged()
    metadata = read_metadata(place)
    assert (
        metadata["left out 1"].startswith("box#1 from step 2 on, it has no finite pose")
        and "left out 2" not in metadata
    )
    assert [row["step"] for row in read_table(place)] == [1]
    p.resetBasePositionAndOrientation(1, [0.9, 0, 0], [0, 0, 0, 1], physicsClientId=client)
    bodies.update()
    with pytest.raises(ValueError, match="step must be larger"):
        logged("a step of the past")
    (unfinished,) = tmp_path.glob("*.unfinished.*")
    assert read_metadata(unfinished)["left out 1"] == metadata["left out 1"]


@pytest.fixture
def two_boxes(client):
    """Bodies that share 0.1 m in x."""
    for x in (0.0, 0.9):
        box(client, position=[x, 0, 0])
    return Bodies(client)


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("per", ["shape", "link"])
def test_a_log_writes_the_table_of_a_run(client, tmp_path, ending, per):
    path = tmp_path / "scene.py"
    path.write_text(SCENE)
    scene = load_scene(path)
    scene.build(client)
    bodies = Bodies(client)
    with Log(tmp_path / f"own.{ending}", bodies, per=per, friction=0.5) as log:
        for _ in range(scene.steps):
            p.stepSimulation(client)
            bodies.update()
            log.add(bodies.overlaps(pairs="all"))
    expected = []
    for frame in run(scene):
        where = frame.step, frame.time, frame.bodies
        expected += rows(*where, frame.contacts) if per == "shape" else link_rows(*where, link_contacts(frame.contacts))
    found = read_table(tmp_path / f"own.{ending}")
    assert len(found) > scene.steps
    assert [{name: value for name, value in row.items() if value is not None} for row in found] == [
        {name: value for name, value in row.items() if value is not None} for row in expected
    ]
    said = read_metadata(tmp_path / f"own.{ending}")
    settings = {"per": per, "surface": "nominal", "concave": "decompose", "concave_threshold": "0.05"}
    assert said.items() >= {**settings, "friction": "0.5"}.items()
    assert re.fullmatch(r"\d+\.\d+\.\d+", said["overlapper"]) and said["pybullet"]


def test_steps_and_times_are_counted_or_given(two_boxes, tmp_path):
    with Log(tmp_path / "own.csv", two_boxes) as log:
        log.add(two_boxes.overlaps())
        log.add(two_boxes.overlaps(), step=10)
        log.add(two_boxes.overlaps())
        log.add(two_boxes.overlaps(), time=2.5)
        with pytest.raises(ValueError, match=r"^step must be larger from one add\(\) to the next: 12 came after 12$"):
            log.add(two_boxes.overlaps(), step=12)
        with pytest.raises(ValueError, match=r"^time must be a finite number of seconds, not nan$"):
            log.add(two_boxes.overlaps(), time=float("nan"))
    found = [(row["step"], row["time_s"]) for row in read_table(tmp_path / "own.csv")]
    assert found == [(1, 1 / 240), (10, 10 / 240), (11, 11 / 240), (12, 2.5)]
    assert log.steps == 12
    log.close()
    with pytest.raises(
        ValueError, match=r"^this Log is closed, so Contacts\(1, 1 of them overlapping\) cannot be added$"
    ):
        log.add(two_boxes.overlaps())


def test_contacts_of_other_bodies_are_refused(two_boxes, client, tmp_path):
    contacts = two_boxes.overlaps()
    p.removeBody(1, client)
    two_boxes.update()
    with Log(tmp_path / "own.csv", two_boxes) as log:
        words = "^contacts has shape 0 of link -1 of body 1, which is not among the bodies$"
        with pytest.raises(ValueError, match=words):
            log.add(contacts)


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("own.txt", {}, "the name of a table must end in .csv, .parquet, .sqlite, not 'own.txt'"),
        ("own.csv", {"per": "body"}, "per must be 'shape' or 'link', not 'body'"),
    ],
)
def test_a_log_of_another_kind_is_refused_at_once(two_boxes, tmp_path, name, options, words):
    with pytest.raises(ValueError, match=re.escape(words)):
        Log(tmp_path / name, two_boxes, **options)
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_bodies_is_refused_at_once(tmp_path):
    with pytest.raises(TypeError, match=r"^bodies must be the Bodies of a simulation, not None$"):
        Log(tmp_path / "own.csv", None)
    assert list(tmp_path.iterdir()) == []


def test_arguments_of_another_kind_are_named(two_boxes, tmp_path):
    contacts = r"^contacts must be what Bodies\.overlaps\(\) returns, not 3$"
    with Log(tmp_path / "own.csv", two_boxes) as log, pytest.raises(TypeError, match=contacts):
        log.add(3)
    with pytest.raises(TypeError, match=contacts):
        link_contacts(3)
    with pytest.raises(TypeError, match=r"^bodies must be the Bodies of a simulation, not 0$"):
        VolumetricContact(0)


def ended_by(error, log, steps):
    with log:
        for contacts in steps:
            log.add(contacts)
        raise error


@pytest.mark.parametrize("ending", ENDINGS)
def test_after_an_error_the_rows_are_in_a_file_beside_the_table(two_boxes, tmp_path, ending):
    place = tmp_path / f"own.{ending}"
    place.write_text("of yesterday")
    log = Log(place, two_boxes)
    with pytest.raises(ZeroDivisionError):
        ended_by(ZeroDivisionError, log, [two_boxes.overlaps()])
    assert place.read_text() == "of yesterday"
    assert log.unfinished == tmp_path / f"own.unfinished.{ending.replace('parquet', 'csv')}"
    assert len(read_table(log.unfinished)) == 1


@pytest.mark.parametrize("ends", [KeyboardInterrupt, SystemExit])
def test_leaving_the_loop_without_an_error_writes_the_table(two_boxes, tmp_path, ends):
    place = tmp_path / "own.csv"
    for count in (0, 1):
        with pytest.raises(ends):
            ended_by(ends, Log(place, two_boxes), [two_boxes.overlaps()] * count)
        assert place.exists() == (count > 0)
    assert len(read_table(place)) == 1
    assert list(tmp_path.iterdir()) == [place]


KILLED = """
import os, signal, sys
import pybullet as p
from overlapper import Log
from overlapper.simulation import Bodies
client = p.connect(p.DIRECT)
cube = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.5] * 3)
for x in (0, 0.9):
    p.createMultiBody(1, cube, basePosition=[x, 0, 0])
bodies = Bodies(client)
with Log(sys.argv[1], bodies) as log:
    for _ in range(3):
        log.add(bodies.overlaps())
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_loop_that_is_killed_leaves_a_table(tmp_path, ending):
    done = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path / f"own.{ending}")], capture_output=True)
    assert done.returncode == -signal.SIGKILL
    assert [row["step"] for row in read_table(tmp_path / f"own.unfinished.{ending.replace('parquet', 'csv')}")] == [
        1,
        2,
        3,
    ]


def test_a_log_of_nothing_is_a_table_without_rows(client, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    body(client, p.GEOM_SPHERE, radius=0.1)
    bodies = Bodies(client, surface="margin")
    with Log("own.csv", bodies) as log:
        log.add(bodies.overlaps())
    assert read_table(Path("own.csv")) == [] and read_metadata(Path("own.csv"))["surface"] == "margin"
    assert os.listdir() == ["own.csv"]


def test_the_loop_of_the_documents_writes_its_table(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (Path(__file__).parents[2] / "docs" / "results.md").read_text(encoding="utf-8")
    (loop,) = [block for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL) if "Log(" in block]
    done = subprocess.run([sys.executable, "-c", loop], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = read_table(Path("r2d2.csv"))
    assert len({row["nameB"] for row in found}) == 4  # wheels
    assert read_metadata(Path("r2d2.csv"))["floor"] == "plane.urdf"


def test_a_log_has_the_forces_of_volumetric_contact_if_it_is_to_have_any(two_boxes, tmp_path):
    with (
        VolumetricContact(two_boxes) as contact,
        Log(tmp_path / "run.csv", two_boxes, forces=True) as log,
        Log(tmp_path / "without.csv", two_boxes) as without,
    ):
        seen, contacts = contact.forces(), two_boxes.overlaps()
        log.add(contacts, forces=seen)
        log.add(contacts)
        without.add(contacts)
        with pytest.raises(
            ValueError, match=r"^this Log has no columns for forces: make it with Log\(\.\.\., forces=True\)$"
        ):
            without.add(contacts, forces=seen)
    first, second = read_table(tmp_path / "run.csv")
    assert [first[f"force_{axis}_n"] for axis in "xyz"] == seen.force[0].tolist() and seen.force[0].any()
    assert second["energy_j"] is None
    assert "energy_j" not in read_table(tmp_path / "without.csv")[0]
