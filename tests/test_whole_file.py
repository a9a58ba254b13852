"""If any system call fails, the earlier file stays whole, and the error names the cause."""

import builtins
import errno
import io
import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from overlapper import Box, Hull, whole_file
from overlapper.polytopes.mesh_file import write_mesh
from overlapper.tables.still import Still
from overlapper.tables.table_file import TABLES, read_table
from overlapper.verdicts.expected import DRIFT, ROUNDING, Expected
from overlapper.viewer import Recording, picture
from overlapper.whole_file import beside, claim, settle, unfinished

CORNERS = np.random.default_rng(0).normal(size=(12, 3))
KEYS = [(0, -1, 0), (1, -1, 0)]
BOX = Box([0.5, 0.5, 0.5])
TWO = Still(
    KEYS,
    [BOX, BOX],
    np.array([[0.0, 0, 0], [0.75, 0, 0]]),
    np.array([[0.0, 0, 0, 1]] * 2),
    {(0, -1): "one", (1, -1): "two"},
    {0: "one", 1: "two"},
    dict.fromkeys([(0, -1), (1, -1)], (0.5, 0.5, 0.5, 1.0)),
)


def write_table(path):
    """Two steps; the rows of the first are kept if the second fails, as a run does it."""
    table = TABLES[path.suffix](path, {"tolerance": "0.001"})
    try:
        for step in (1, 2):
            table.write(TWO.rows(step, 1e-3))
    except BaseException:
        table.leave()
        raise
    table.close()


def write_page(path):
    recording = Recording()
    recording.add(TWO, TWO.contacts(1e-3), 0.0)
    recording.save(path)


def write_expected(path):
    Expected([1], 1e-3, ROUNDING | DRIFT, TWO.rows(1, 1e-3), {1: TWO}).write(path, {})


WRITERS = {
    "table.csv": write_table,
    "table.parquet": write_table,
    "table.sqlite": write_table,
    "page.html": write_page,
    "picture.png": lambda path: picture.save(path, TWO, TWO.contacts(1e-3)),
    "mesh.stl": lambda path: write_mesh(path, Hull(CORNERS)),
    "expected.csv": write_expected,
}


class Failing:
    """Makes the `number`-th system call that changes a folder fail, as on a full disk."""

    def __init__(self, monkeypatch, folder, number):
        self.calls, self.number, self.folder = 0, number, str(folder)
        for module, name in ((os, "open"), (os, "replace"), (os, "mkdir"), (os, "fsync"), (builtins, "open")):
            monkeypatch.setattr(module, name, self.counted(getattr(module, name)))
        monkeypatch.setattr(io, "open", builtins.open)

    def counted(self, call):
        def attempt(*arguments, **options):
            ours = isinstance(arguments[0], int) or str(arguments[0]).startswith(self.folder)
            if ours:
                self.calls += 1
                if self.calls == self.number:
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(arguments[0]))
            return call(*arguments, **options)

        return attempt


@pytest.mark.parametrize("name", WRITERS)
def test_the_nth_call_that_fails_costs_no_earlier_file(tmp_path, name):
    number = failed = 0
    while True:
        number += 1
        folder = tmp_path / str(number)
        folder.mkdir()
        path = folder / name
        path.write_bytes(b"earlier")
        with pytest.MonkeyPatch.context() as patch:
            system = Failing(patch, folder, number)
            try:
                WRITERS[name](path)
                words = None
            except OSError as error:
                words = str(error)
        left = {each.name for each in folder.iterdir()} - {name}
        if system.calls < number:
            assert words is None and left == set()
            assert path.read_bytes() != b"earlier"
            break
        beside_it = {f"table.unfinished{path.suffix.replace('parquet', 'csv')}"}
        if words is None:  # the file where its rows had been before could not be removed
            assert path.read_bytes() != b"earlier" and left <= beside_it
            continue
        failed += 1
        assert "No space left on device" in words and "\n" not in words
        assert path.read_bytes() == b"earlier"
        # Only the rows of a table are worth keeping beside it.
        assert left <= (beside_it if name.startswith("table") else set())
        for each in left:
            kept = read_table(folder / each)
            assert kept in (TWO.rows(1, 1e-3), [*TWO.rows(1, 1e-3), *TWO.rows(2, 1e-3)])
    assert failed >= 3


def test_an_exception_while_writing_leaves_all_files_as_they_were(tmp_path):
    (tmp_path / "a.txt").write_text("earlier")

    def interrupted():
        with beside(tmp_path / "a.txt") as path:
            path.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [(each.name, each.read_text()) for each in tmp_path.iterdir()] == [("a.txt", "earlier")]


def test_a_table_overwrites_no_existing_file(tmp_path):
    place = tmp_path / "a.csv"
    unfinished(place).write_text("thesis")
    path = claim(place)
    assert path == unfinished(place, 2) == tmp_path / "a.unfinished-2.csv"
    assert unfinished(place).read_text() == "thesis"


def left_by_a_killed_process(place):
    """The file that a process has begun beside `place`, and has half written when it is killed."""
    code = "import os, sys; from overlapper.whole_file import beside\n"
    code += "with beside(sys.argv[1]) as path: path.write_text('half'); os.kill(os.getpid(), 9)"
    assert subprocess.run([sys.executable, "-c", code, place], check=False).returncode == -signal.SIGKILL
    (left,) = place.parent.iterdir()
    return left


def test_a_file_that_a_killed_process_has_begun_is_taken_over(tmp_path):
    place = tmp_path / "a.txt"
    left = left_by_a_killed_process(place)
    assert left.read_text() == "half"
    with beside(place) as path:
        assert path == left and path.read_text() == ""
        path.write_text("new")
    assert [(each.name, each.read_text()) for each in tmp_path.iterdir()] == [("a.txt", "new")]


def test_two_runs_at_once_disturb_each_other_nowhere(tmp_path):
    place = tmp_path / "a.txt"
    with beside(place) as first:
        with beside(place) as second:
            assert first != second
            first.write_text("first")
            second.write_text("second")
        assert place.read_text() == "second"
    assert [(each.name, each.read_text()) for each in tmp_path.iterdir()] == [("a.txt", "first")]


@pytest.mark.parametrize("locks", [None, errno.ENOLCK, errno.ENOSYS])
def test_without_locks_a_file_is_still_whole_and_overwrites_no_other(tmp_path, monkeypatch, locks):
    def no_lock(*_):
        raise OSError(locks, os.strerror(locks))

    if locks is None:
        monkeypatch.setattr(whole_file, "fcntl", None)
    else:
        monkeypatch.setattr(whole_file.fcntl, "flock", no_lock)
    place = tmp_path / "a.txt"
    unfinished(place).write_text("thesis")
    with beside(place) as path:
        path.write_text("new")
    assert {each.name: each.read_text() for each in tmp_path.iterdir()} == {
        "a.txt": "new",
        "a.unfinished.txt": "thesis",
    }


def test_a_file_is_on_the_disk_before_it_takes_its_place(tmp_path, monkeypatch):
    order = []
    for name in ("fsync", "replace"):
        call = getattr(os, name)
        monkeypatch.setattr(os, name, lambda *what, name=name, call=call: (order.append(name), call(*what)))
    (tmp_path / "new").write_text("new")
    settle(tmp_path / "new", tmp_path / "old")
    assert order == ["fsync", "replace"]
