"""A scene whose tasks misbehave, each in a way of its own, and what a sweep must say of each."""

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from busy import slowness
from sweeping import rows

LIMIT = 4  # s, on an idle machine, where no other task takes half a second

SCENE = '''
"""Two boxes, one in the other, built by somebody who misbehaves."""
import ctypes, multiprocessing, os, pathlib, resource, signal, subprocess, sys, tempfile, threading, time, warnings
import pybullet as p

STEPS = 2
FOLDER = os.getcwd()


class Unprintable(Exception):
    def __str__(self):
        raise ValueError("no words")


class Unpicklable(Exception):
    def __reduce__(self):
        raise TypeError("no pickle")


class OfItsOwn(BaseException):
    pass


def fork_and(end):
    multiprocessing.get_context("fork").Process(target=time.sleep, args=(600,), daemon=True).start()
    end()


def note(process):
    """Leave the number of a process where the test finds it."""
    pathlib.Path(FOLDER, "left", str(process.pid)).touch()


def close_all():
    os.closerange(0, 1000)


def memory():
    kept = []
    while True:
        kept.append(bytearray(1 << 24))


def recursion():
    recursion()


def loop():
    while True:
        pass


def deaf_loop():
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    loop()


def alarm():
    signal.signal(signal.SIGUSR1, lambda *_: os.abort())
    signal.alarm(5)


def deletes():
    for path in pathlib.Path(FOLDER, "runs").glob(".*"):
        path.unlink()


def raises(error):
    raise error


def surroundings():
    """The state of the process, which a task before this one may have changed."""
    assert os.getcwd() == FOLDER and "MISDEED" not in os.environ
    assert signal.getsignal(signal.SIGTERM) == signal.getsignal(signal.SIGUSR1) == signal.SIG_DFL
    assert resource.getrlimit(resource.RLIMIT_NOFILE)[0] > 3
    print("a scene may talk", flush=True)
    print("and complain", file=sys.stderr, flush=True)
    with warnings.catch_warnings(record=True) as told:
        warnings.warn("and warn")
    assert not told


DEEDS = {
    "nothing": lambda: None,
    "fork and die": lambda: fork_and(os.abort),
    "fork and exit": lambda: fork_and(lambda: os._exit(3)),
    "exit": sys.exit,
    "exit with words": lambda: sys.exit("so be it"),
    "exit of C": lambda: os._exit(0),
    "abort": os.abort,
    "segmentation fault": lambda: ctypes.string_at(0),
    "kill": lambda: os.kill(os.getpid(), signal.SIGKILL),
    "signal of real time": lambda: os.kill(os.getpid(), 40),
    "stop": lambda: os.kill(os.getpid(), signal.SIGSTOP),
    "close the streams": lambda: (sys.stdout.close(), sys.stderr.close()),
    "close the files of the streams": lambda: (os.close(1), os.close(2)),
    "close all files": close_all,
    "lose the streams": lambda: (setattr(sys, "stdout", None), setattr(sys, "stderr", None)),
    "print megabytes": lambda: print("x" * 10_000_000),
    "print garbage": lambda: os.write(2, bytes(range(256)) * 1000),
    "ask": input,
    "read": lambda: sys.stdin.buffer.read(),
    "loop": loop,
    "deaf loop": deaf_loop,
    "sleep in C": lambda: ctypes.PyDLL(None).sleep(600),
    "memory": memory,
    "thread": lambda: threading.Thread(target=time.sleep, args=(600,)).start(),
    "child": lambda: note(subprocess.Popen(["sleep", "600"])),
    "child of its own session": lambda: note(subprocess.Popen(["sleep", "600"], start_new_session=True)),
    "bytes that are no text": lambda: raises(ValueError("no mesh " + os.fsdecode(b"mesh\\xff.obj"))),
    "long words": lambda: raises(ValueError("x" * 5_000_000)),
    "no words": lambda: raises(Unprintable()),
    "no pickle": lambda: raises(Unpicklable("as it is")),
    "many lines": lambda: raises(ValueError("one\\ntwo\\x1b[31m")),
    "recursion": recursion,
    "other folder": lambda: os.chdir("/"),
    "other environment": lambda: os.environ.update(MISDEED="1"),
    "deletes": deletes,
    "warnings as errors": lambda: warnings.simplefilter("error"),
    "handlers": alarm,
    "no more files": lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (3, 3)),
    "interruption": lambda: raises(KeyboardInterrupt()),
    "stop of an iterator": lambda: raises(StopIteration()),
    "end of a generator": lambda: raises(GeneratorExit()),
    "of its own": lambda: raises(OfItsOwn("a word")),
}


def build(client, *, deed="nothing", again=0):
    if deed == "nothing":
        surroundings()
    box = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.1] * 3, physicsClientId=client)
    for x in (0, 0.15):
        p.createMultiBody(x and 1, box, basePosition=[x, 0.01, 0.02], physicsClientId=client)
    DEEDS.get(deed, lambda: None)()
    if deed == "no number":
        p.resetBasePositionAndOrientation(1, [float("nan")] * 3, [0, 0, 0, 1], physicsClientId=client)
    if deed == "huge number":
        p.resetBasePositionAndOrientation(1, [1e300] * 3, [0, 0, 0, 1], physicsClientId=client)
    if deed == "no time":
        p.setTimeStep(float("nan"), physicsClientId=client)
    if deed == "disconnect":
        p.disconnect(client)
    return (lambda i: p.disconnect(client)) if deed == "disconnect later" else None
'''

DONE = "done", ""

# The words that a sweep must say: done, or how the task failed, and a pattern of the sentence.
MUST_SAY = {
    "fork and die": ("died", r"its process ended with signal SIGABRT"),
    "fork and exit": ("died", r"its process ended with exit code 3"),
    "exit": ("raised", r"SystemExit: .*"),
    "exit with words": ("raised", r"SystemExit: so be it"),
    "exit of C": ("died", r"its process ended with exit code 0"),
    "abort": ("died", r"its process ended with signal SIGABRT"),
    "segmentation fault": ("died", r"its process ended with signal SIGSEGV"),
    "kill": ("died", r"its process ended with signal SIGKILL"),
    "signal of real time": ("died", r"its process ended with signal 40"),
    "stop": ("hung", r"it took longer than [\d.]+ s"),
    "close all files": ("died", r"its process .*"),
    "ask": ("raised", r"SceneError: .* EOFError.*"),
    "loop": ("hung", r"it took longer than [\d.]+ s"),
    "deaf loop": ("hung", r"it took longer than [\d.]+ s"),
    "sleep in C": ("hung", r"it took longer than [\d.]+ s"),
    "memory": ("raised", r"SceneError: .* MemoryError"),
    "bytes that are no text": ("raised", r"SceneError: .* no mesh mesh\\udcff\.obj"),
    "long words": ("raised", r"SceneError: .* x+ \.\.\. \(4,99\d,\d{3} characters left out\) \.\.\. x+"),
    "no words": ("raised", r"SceneError: .* Unprintable"),
    "no pickle": ("raised", r"SceneError: .* Unpicklable: as it is"),
    "many lines": ("raised", r"SceneError: .* ValueError: one"),
    "recursion": ("raised", r"SceneError: .* RecursionError: .*"),
    "interruption": ("raised", r"KeyboardInterrupt.*"),
    "stop of an iterator": ("raised", r"SceneError: .* StopIteration.*"),
    "end of a generator": ("raised", r"GeneratorExit.*"),
    "of its own": ("raised", r"OfItsOwn: a word"),
    "disconnect": ("raised", r".*connected.*"),
    "disconnect later": ("raised", r".*connected.*"),
    "no more files": ("raised", r".*"),
}
MUST_SAY |= dict.fromkeys(
    [
        *("nothing", "close the streams", "close the files of the streams", "lose the streams", "print megabytes"),
        *("print garbage", "read", "thread", "child", "child of its own session", "other folder", "other environment"),
        *("deletes", "warnings as errors", "handlers", "no number", "huge number", "no time"),
    ],
    DONE,
)


def sweep_of_misdeeds(engine):
    """A sweep in the current folder, and what it must say."""
    Path("scene.py").write_text(SCENE)
    # A good task comes behind each, in the same process as a rule.
    Path("points.csv").write_text(
        "deed,again\n" + "".join(f"{deed},0\nnothing,{k}\n" for k, deed in enumerate(MUST_SAY))
    )
    Path("left").mkdir()
    words = ["--points", "points.csv", "--limit", str(LIMIT * slowness()), "--memory", "400", "--out", "runs", "--json"]
    command = [sys.executable, "-m", "overlapper", "sweep", "scene.py", *words, "--engine", engine, "--workers", "2"]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=1200)
    told = json.loads(done.stdout)
    assert (done.returncode, told["missing"], told["finished"]) == (1, 0, True), done.stderr
    found = {(row["deed"], row["again"]): ("done", "") for row in rows("runs")}
    found |= {(row["deed"], row["again"]): (row["what"], row["sentence"]) for row in rows("runs", "failures")}
    for deed, (what, sentence) in MUST_SAY.items():
        assert found[deed, 0][0] == what and re.fullmatch(sentence, found[deed, 0][1]), (deed, found[deed, 0])
    others = {key: outcome for key, outcome in found.items() if key[1]}
    assert set(others.values()) == {("done", "")}, others
    lost = {row["deed"]: row["diverged"] for row in rows("runs") if row["diverged"]}
    assert lost == {"no number": 1, "huge number": 1, "no time": 2} and told["diverged"] == 3
    assert all(len(row["traceback"]) < 25_000 for row in rows("runs", "failures"))
    # Nothing of it outlives the sweep by more than moments, not even a process that has left its group.
    left = os.listdir("left")
    assert len(left) >= 2
    for _ in range(100):
        if not any(psutil.pid_exists(int(each)) for each in left):
            return
        time.sleep(0.1)
    pytest.fail(f"of the processes {left} some are there still")
