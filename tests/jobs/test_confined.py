"""A function in a process of its own returns, raises, or is told of in a sentence, and leaves no process behind."""

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import time

import numpy as np
import psutil
import pytest

from overlapper.jobs import confined
from overlapper.jobs.confined import Confined, Unanswered

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="only Linux keeps to a limit of memory")


@pytest.fixture(scope="module")
def confine():
    confine = Confined(25.0, 256)
    yield confine
    confine.close()


def place():
    return os.getpid()


def fail(words):
    raise ValueError(words)


class OfTwo(Exception):
    def __init__(self, one, two):
        super().__init__(f"{one} and {two}")


def fail_in_a_way_of_its_own():
    raise OfTwo("a", "b")


def allocate(megabytes):
    return np.ones(megabytes << 17).sum()


def abort_for_memory():
    os.write(2, b"terminate called after throwing an instance of 'std::bad_alloc'\n  what():  std::bad_alloc\n")
    os.abort()


def exit_with_7():
    os._exit(7)


def hang_in_c():
    ctypes.PyDLL(None).sleep(600)  # which gives no other thread of Python a turn


def be_idle_for_one_second_at_most():
    confined.IDLE = 1
    return os.getpid()


def leave_a_child(file, how):
    """A child that holds the pipe of the replies and never ends; then this process ends, hangs or answers."""
    child = os.fork()
    if not child:
        if how == "escapes":
            os.setsid()
        time.sleep(60)
        os._exit(0)
    file.write_text(str(child))
    if how == "hangs":
        time.sleep(600)
    if how in ("dies", "escapes"):
        os.kill(os.getpid(), signal.SIGKILL)


def test_calls_share_a_process_which_is_not_this_one(confine):
    assert confine(place) == confine(place) != os.getpid()


def test_errors_are_raised_here_and_cost_no_process(confine):
    before = confine(place)
    with pytest.raises(ValueError, match=r"^no\nmore$"):
        confine(fail, "no\nmore")
    with pytest.raises(RuntimeError, match=r"^OfTwo: a and b$"):
        confine(fail_in_a_way_of_its_own)
    assert confine(place) == before


@pytest.mark.parametrize(
    ("function", "sentence", "name"),
    [
        (os.abort, "ended its process with signal SIGABRT", "SIGABRT"),
        (abort_for_memory, "needed more than 256 MB", ""),
        (exit_with_7, "ended its process with exit code 7", ""),
    ],
)
def test_a_call_without_an_answer_is_a_sentence_and_the_next_call_is_answered(confine, function, sentence, name):
    with pytest.raises(Unanswered) as unanswered:
        confine(function)
    assert (str(unanswered.value), unanswered.value.signal) == (sentence, name)
    assert confine(place) != os.getpid()


def test_a_function_that_hangs_is_given_up_after_the_limit(confine, monkeypatch):
    confine(place)  # so that the limit is not for the start
    with monkeypatch.context() as brief:
        brief.setattr(confine, "seconds", 2.0)
        with pytest.raises(Unanswered, match=r"^took longer than 2 s$"):
            confine(hang_in_c)
    assert confine(place) != os.getpid()


def test_a_function_that_cannot_be_sent_is_an_error_and_the_next_call_is_answered(confine):
    with pytest.raises(Exception, match="pickle"):
        confine(lambda: None)
    assert confine(place) != os.getpid()


@LINUX
def test_a_limit_of_memory_is_kept(confine):
    assert confine(allocate, 100) == 100 << 17
    with pytest.raises(Unanswered, match=r"^needed more than 256 MB$"):
        confine(allocate, 300)
    assert confine(allocate, 100) == 100 << 17


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no process groups")
@pytest.mark.parametrize(
    ("how", "sentence"),
    [("dies", "ended its process with signal SIGKILL"), ("hangs", "took longer than 2 s"), ("answers", "")],
)
def test_children_that_hold_a_pipe_end_with_the_process(confine, tmp_path, monkeypatch, how, sentence):
    confine(place)
    if how == "hangs":
        monkeypatch.setattr(confine, "seconds", 2.0)
    file, start = tmp_path / "child", time.monotonic()
    if sentence:
        with pytest.raises(Unanswered, match=sentence):
            confine(leave_a_child, file, how)
    else:
        confine(leave_a_child, file, how)
        confine.close()
    assert time.monotonic() - start < 30  # and not the minute of the child
    assert ended(int(file.read_text()))


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no process groups")
def test_a_child_that_has_left_the_group_delays_nothing_and_ends_on_linux(confine, tmp_path):
    file, start = tmp_path / "child", time.monotonic()
    with pytest.raises(Unanswered, match="ended its process with signal SIGKILL"):
        confine(leave_a_child, file, "escapes")
    assert time.monotonic() - start < 30  # and not the minute of the child
    if sys.platform == "linux":
        assert ended(int(file.read_text()))
    else:
        os.kill(int(file.read_text()), signal.SIGKILL)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no alarm")
def test_a_process_that_nobody_calls_ends_and_the_next_call_starts_another(confine):
    first = confine(be_idle_for_one_second_at_most)
    assert ended(first)
    assert confine(place) != first


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no fork")
def test_a_fork_calls_a_process_of_its_own_and_ends_no_other(confine):
    before = confine(place)
    read, write = os.pipe()
    child = os.fork()
    if not child:
        os.write(write, str(confine(place)).encode())
        confine.close()
        os._exit(0)
    os.waitpid(child, 0)
    assert int(os.read(read, 99)) != before
    assert confine(place) == before


def test_nothing_is_left_when_python_exits():
    code = (
        "import os; from overlapper.jobs.confined import Confined; c = Confined(5.0, 256)\n"
        "print(c(os.getpid), flush=True)"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert said.returncode == 0 and not said.stderr
    assert ended(int(said.stdout))


def ended(pid):
    """Whether a process ends soon."""
    until = time.monotonic() + 20
    with contextlib.suppress(psutil.NoSuchProcess):
        while psutil.Process(pid).status() != psutil.STATUS_ZOMBIE:
            if time.monotonic() > until:
                return False
            time.sleep(0.02)
    return True
