"""A worker process: its replies come in order, and however it ends there is a reason."""

import errno
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import pybullet_data
import pytest

from overlapper import Placed, Sphere, overlap
from overlapper.jobs import worker
from overlapper.jobs.worker import Ended, NotStarted, Worker
from overlapper.polytopes import decomposition
from overlapper.reference import Fcl
from overlapper.simulation.bullet.inventory import inventory
from overlapper.simulation.bullet.model_file import NotRead
from overlapper.viewer import Viewer


def answers(request):
    match request:
        case int():
            print("what is printed does not mix with the replies", flush=True)
            yield from range(request)
        case "limits":
            import resource

            yield resource.getrlimit(resource.RLIMIT_CORE)
        case "path":
            yield sys.path
        case "hang":
            yield "soon"
            time.sleep(600)
        case "abort":
            os.write(2, b"terminate called\n  what():  no memory for it.\n")
            os.abort()
        case _:
            raise ValueError(f"no such request: {request}.")


def test_replies_come_in_order_whatever_is_printed():
    with Worker(answers) as worker:
        worker.send(3)
        worker.send(2)
        assert [worker.receive(10.0) for _ in range(5)] == [0, 1, 2, 0, 1]


def test_the_process_has_the_path_of_this_one_and_leaves_no_core():
    with Worker(answers) as worker:
        worker.send("path")
        worker.send("limits")
        assert worker.receive(10.0) == sys.path
        assert worker.receive(10.0) == (0, 0)


@pytest.mark.parametrize(
    ("request_", "code", "sentence"),
    [
        ("abort", -signal.SIGABRT, "ended with signal SIGABRT (no memory for it)"),
        ("nonsense", 1, "ended with exit code 1 (ValueError: no such request: nonsense)"),
    ],
)
def test_the_end_of_a_process_names_its_cause(request_, code, sentence):
    with Worker(answers) as worker:
        worker.send(request_)
        with pytest.raises(Ended) as ended:
            worker.receive(10.0)
        assert (str(ended.value), ended.value.code, ended.value.limit) == (sentence, code, None)
        assert sentence.partition("(")[2].rstrip(")") in ended.value.words
        assert not worker.alive()
        worker.send(1)  # to nobody
        with pytest.raises(Ended):
            worker.receive(0.1)


def test_a_process_that_hangs_is_killed_after_the_limit():
    with Worker(answers) as worker:
        worker.send("hang")
        assert worker.receive(10.0) == "soon"
        with pytest.raises(Ended, match=r"^gave no answer within 0\.2 s$") as ended:
            worker.receive(0.2)
        assert (ended.value.code, ended.value.limit) == (None, 0.2)
        assert not worker.alive()


def test_leaving_the_block_ends_the_process():
    with Worker(answers) as worker:
        worker.send("hang")
    assert not worker.alive()


def test_a_module_that_cannot_be_imported_there_ends_the_process_at_once(monkeypatch):
    monkeypatch.setattr(answers, "__module__", "no_such_module")
    with pytest.raises(Ended, match=r"exit code 1 \(ModuleNotFoundError: No module named 'no_such_module'\)"):
        Worker(answers)


class Failing:
    """Makes one call fail that starts a process, as on a system without free processes or files."""

    def __init__(self, monkeypatch, owner, name, error):
        self.started = []
        popen = subprocess.Popen
        monkeypatch.setattr(
            subprocess, "Popen", lambda *a, **k: self.started.append(popen(*a, **k)) or self.started[-1]
        )
        monkeypatch.setattr(owner, name, self.fail)
        self.error = error

    def fail(self, *_, **__):
        raise self.error


NO_MORE = OSError(errno.EAGAIN, os.strerror(errno.EAGAIN))

FAILURES = {
    "fork": (subprocess, "Popen", NO_MORE),
    "file": (tempfile, "TemporaryFile", OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))),
    "thread": (threading.Thread, "start", RuntimeError("can't start new thread")),
}


@pytest.fixture(params=FAILURES)
def failing(request, monkeypatch):
    return Failing(monkeypatch, *FAILURES[request.param])


def test_a_process_that_cannot_be_started_leaves_nothing_behind(failing):
    with pytest.raises(Ended, match=r"^could not be started \(.*(unavailable|No space|new thread).*\)$") as ended:
        Worker(answers)
    assert (ended.value.code, ended.value.limit, ended.value.words) == (None, None, "")
    for started in failing.started:
        assert started.poll() is not None and started.stdin.closed and started.stdout.closed


def test_commands_that_need_a_process_say_in_one_sentence_that_none_can_start(failing, tmp_path):
    (tmp_path / "box.bullet").write_text("")
    cube = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    asked = {
        "overlapper.reference cannot start FCL: its process": lambda: Fcl().compare(
            overlap(Sphere(1.0), Placed(Sphere(1.0), (1.5, 0, 0)))
        ),
        "box.bullet cannot be read: the process that reads it": lambda: inventory(tmp_path / "box.bullet"),
        "CoACD failed on the concave mesh: its process": lambda: decomposition._coacd(
            cube, np.array([[0, 1, 2]]), 0.05, 9.0
        ),
        "the live view has no server: its process": Viewer,
    }
    for sentence, ask in asked.items():
        with pytest.raises(Exception, match=rf"{sentence} could not be started \([^\n]*\)$") as refused:
            ask()
        assert isinstance(refused.value, (NotStarted, NotRead, decomposition.NotDecomposed))


def test_fcl_that_cannot_be_started_is_an_error_of_one_sentence(monkeypatch):
    monkeypatch.setattr(worker, "START_LIMIT", 0.0)
    cannot = r"^overlapper\.reference cannot start FCL: its process gave no answer within 0 s$"
    with Fcl() as fcl, pytest.raises(RuntimeError, match=cannot):
        fcl.compare(overlap(Sphere(1.0), Placed(Sphere(1.0), (1.5, 0, 0))))


def test_an_inventory_that_fails_says_what_went_wrong():
    with pytest.raises(RuntimeError, match=r"reads .*cube\.urdf ended with exit code 1 \(TypeError: .* dataclass"):
        inventory(Path(pybullet_data.getDataPath()) / "cube.urdf", modelling=None)
