"""Clients and servers: several at once, remote, disconnected, and unable to write their files."""

import os
import signal
import subprocess
import sys
import threading

import pybullet as p
import pytest
from simulated import body, box

from overlapper import Box, Sphere
from overlapper.simulation import Bodies, Recorder
from overlapper.simulation.bullet import calls


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no fork")
def test_a_forked_process_does_not_wait_for_a_thread_of_its_parent(client):
    held, done = threading.Event(), threading.Event()

    def hold():
        with calls.busy:
            held.set()
            done.wait()

    with Recorder(client):
        thread = threading.Thread(target=hold)
        thread.start()
        held.wait()
        child = os.fork()
        if child == 0:
            signal.alarm(20)  # ends it if it waits
            p.stepSimulation(client)
            os._exit(0)
        done.set()
        assert os.waitpid(child, 0)[1] == 0
        thread.join()


def test_two_clients_are_independent(client):
    other = p.connect(p.DIRECT)
    box(client, position=[1, 0, 0])
    body(other, p.GEOM_SPHERE, radius=0.3, position=[2, 0, 0])
    ours, theirs = Bodies(client), Bodies(other)
    assert [type(shape) for shape in ours.shapes + theirs.shapes] == [Box, Sphere]
    p.resetBasePositionAndOrientation(0, [9, 0, 0], [0, 0, 0, 1], physicsClientId=other)
    ours.update(), theirs.update()
    assert ours.positions.tolist() == [[1, 0, 0]] and theirs.positions.tolist() == [[9, 0, 0]]
    p.disconnect(other)
    ours.update()
    with pytest.raises(ValueError, match=f"physicsClientId {other} is not connected"):
        theirs.update()


def test_a_client_that_was_never_connected_is_named():
    with pytest.raises(ValueError, match="physicsClientId 17 is not connected"):
        Bodies(17)


def test_what_is_no_client_is_refused_and_leaves_nothing_behind():
    program = "from overlapper.simulation import Bodies\ntry: Bodies('x')\nexcept TypeError as error: print(error)\n"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout == "physicsClientId must be what pybullet.connect() returned, not 'x'\n"
    assert "ignored" not in done.stderr


def test_a_client_that_takes_over_an_id_is_read_afresh(client):
    box(client)
    bodies = Bodies(client)
    p.disconnect(client)
    assert p.connect(p.DIRECT) == client
    body(client, p.GEOM_SPHERE, radius=0.3)
    bodies.update()
    assert [type(shape) for shape in bodies.shapes] == [Sphere]


SERVER = """
import sys
import pybullet as p
server = p.connect(p.SHARED_MEMORY_SERVER, key=int(sys.argv[1]))
for half in (0.1, 0.2):
    p.createMultiBody(1, p.createCollisionShape(p.GEOM_BOX, halfExtents=[half] * 3), basePosition=[1, 2, 3])
print("ready", flush=True)
sys.stdin.read()
"""


def test_a_simulation_in_another_process_is_read():
    key = 20000 + os.getpid() % 10000
    command = [sys.executable, "-c", SERVER, str(key)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as server:
        assert any("ready" in line for line in server.stdout)
        client = p.connect(p.SHARED_MEMORY, key)
        bodies = Bodies(client)
        assert [shape.half_extents[0] for shape in bodies.shapes] == [0.1, 0.2]
        assert bodies.positions.tolist() == [[1, 2, 3]] * 2
        with Recorder(client) as recorder:
            watched = Bodies(client, recorder=recorder)
            assert len(watched.overlaps()) == 1
            p.setCollisionFilterPair(0, 1, -1, -1, 0, physicsClientId=client)
            watched.update()
            assert watched.overlaps() == []
            p.removeBody(1, physicsClientId=client)
            assert body(client, p.GEOM_SPHERE, radius=0.3) == 1
            watched.update()
            assert [type(shape) for shape in watched.shapes] == [Box, Sphere]
        p.disconnect(client)
        server.stdin.close()


def test_a_server_that_writes_elsewhere_is_an_error_of_one_sentence(client, monkeypatch):
    box(client)
    monkeypatch.setattr(p, "saveBullet", lambda *args, **kwargs: None)
    with pytest.raises(RuntimeError, match=f"physicsClientId {client} could not write its shapes"):
        Bodies(client)


def test_a_server_that_cannot_write_is_an_error_of_one_sentence(client, monkeypatch):
    box(client)

    def refuse(*args, **kwargs):
        raise p.error("no")

    monkeypatch.setattr(p, "saveBullet", refuse)
    with pytest.raises(RuntimeError, match=f"physicsClientId {client} could not write its shapes") as caught:
        Bodies(client)
    assert isinstance(caught.value.__cause__, p.error)


def test_a_file_that_is_cut_as_on_a_full_disk_is_an_error_of_one_sentence(client, monkeypatch):
    box(client)
    save = p.saveBullet

    def cut(name, **options):
        save(name, **options)
        os.truncate(name, os.path.getsize(name) // 2)

    monkeypatch.setattr(p, "saveBullet", cut)
    with pytest.raises(RuntimeError, match=r"and have room on the disk \(path is a [^\n]*\)$"):
        Bodies(client)


def test_without_a_temporary_folder_the_error_is_one_sentence(client, monkeypatch):
    box(client)
    monkeypatch.setattr("tempfile.tempdir", "/no/such/folder")
    with pytest.raises(
        RuntimeError, match=r"cannot hand over its shapes, because no temporary file can be made: No such"
    ):
        Bodies(client)


def test_no_file_is_left_behind(client, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    box(client)
    Bodies(client)
    monkeypatch.setattr(p, "saveBullet", lambda *args, **kwargs: None)
    with pytest.raises(RuntimeError, match="could not write its shapes"):
        Bodies(client)
    assert list(tmp_path.iterdir()) == []


MISSING = "overlapper.simulation needs pybullet: pip install pybullet, or conda install -c conda-forge pybullet"


@pytest.mark.parametrize(
    ("system", "said"),
    {
        "linux-x86_64": MISSING,
        "macosx-11.0-arm64": f"{MISSING} (pip has wheels for CPython 3.10 and 3.11 on Linux x86-64, "
        "and compiles it elsewhere)",
    }.items(),
)
def test_a_missing_pybullet_is_one_clear_sentence(system, said):
    code = f"""
import sys, sysconfig
sys.modules["pybullet"], sysconfig.get_platform = None, lambda: "{system}"
from overlapper.simulation import Bodies
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.stderr.strip().splitlines()[-1] == f"ImportError: {said}"
