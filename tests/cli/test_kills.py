"""A command that is killed at any moment leaves each of its files as it was before or as it is at the end.

`OVERLAPPER_KILLS=100 pytest tests/cli/test_kills.py` kills each command so many times.
"""

import os
import random
import sqlite3
import subprocess
import sys
import time
from contextlib import closing

import cubes
import psutil
import pytest
import trimesh
from robots import turntable

from overlapper.tables.table_file import read_table

KILLS = int(os.environ.get("OVERLAPPER_KILLS", "2"))
SCENE = cubes.SCENE.replace("STEPS = 20", "STEPS = 60")
SCRIPT = (
    SCENE
    + """
client = p.connect(p.DIRECT)
build(client)
for _ in range(STEPS):
    p.stepSimulation(client)
"""
)
# The arguments of each command, and the files that it writes.
COMMANDS = {
    "run": ("run scene.py --out out.csv --html out.html", ["out.csv", "out.html"]),
    "watch": ("watch --out out.sqlite --html out.html script.py", ["out.sqlite", "out.html"]),
    "check": ("check scene.py --record", ["expected/scene.csv"]),
    "audit": (
        "audit table.urdf --configurations 3000 --workers 2 --out out.csv --srdf out.srdf --html out.html",
        ["out.csv", "out.srdf", "out.html"],
    ),
    "clashes": ("clashes parts --out out.csv --html out.html", ["out.csv", "out.html"]),
}
EARLIER = b"earlier"
EARLIER_SRDF = b'<robot name="made" />'  # an audit extends an SRDF file, and refuses any other


def prepared(folder):
    """A folder with the files that the commands read."""
    folder.mkdir()
    (folder / "scene.py").write_text(SCENE)
    (folder / "script.py").write_text(SCRIPT)
    turntable(folder / "table.urdf")
    (folder / "parts").mkdir()
    for number in range(12):
        ball = trimesh.creation.icosphere(subdivisions=2, radius=0.1)
        ball.apply_translation([0.15 * number, 0, 0])
        ball.export(folder / "parts" / f"{number}.stl")
    return folder


def started(command, folder):
    return subprocess.Popen(
        [sys.executable, "-m", "overlapper", *COMMANDS[command][0].split()],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


def finish(process):
    _, said = process.communicate(timeout=300)
    assert process.returncode in (0, 1), said  # 1: there are findings
    return process.returncode


def kill(process, after):
    """SIGKILL to the command alone. The processes that it has started must end by themselves."""
    time.sleep(after)
    try:
        others = psutil.Process(process.pid).children(recursive=True)
    except psutil.NoSuchProcess:
        others = []
    process.kill()
    process.communicate()
    assert not psutil.wait_procs(others, timeout=60)[1], "a process has outlived its command"


def content(path):
    return path.read_bytes() if path.exists() else None


def same(name, one, other):
    """Tables have the same bytes on every run. Pages have names of parts that differ, so head, end and size count."""
    if not name.endswith(".html") or one is None:
        return one == other
    near = abs(len(one) - len(other)) < 0.01 * len(other)
    return near and one[:1000] == other[:1000] and one[-1000:] == other[-1000:]


def files_of(folder):
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def begun(table):
    """Whether the file has more than its name: a run may be killed between the two."""
    if table.suffix != ".sqlite":
        return table.stat().st_size > 0
    with closing(sqlite3.connect(table)) as connection:
        return connection.execute("SELECT count(*) FROM sqlite_master").fetchone() != (0,)


@pytest.mark.parametrize("command", COMMANDS)
def test_a_killed_command_leaves_whole_files_and_runs_again(command, tmp_path):
    names = COMMANDS[command][1]
    folder = prepared(tmp_path / "work")
    begin = time.perf_counter()
    code = finish(started(command, folder))
    seconds = time.perf_counter() - begin
    whole = {name: (folder / name).read_bytes() for name in names}
    known = files_of(folder)
    chance = random.Random(command)
    for _ in range(KILLS):
        for name in names:
            if command == "check":  # it compares with an earlier recording
                (folder / name).unlink(missing_ok=True)
            else:
                (folder / name).write_bytes(EARLIER_SRDF if name.endswith(".srdf") else EARLIER)
        earlier = {name: content(folder / name) for name in names}
        kill(started(command, folder), chance.uniform(0.3, 1.05) * seconds)
        for name in names:
            left = content(folder / name)
            assert left == earlier[name] or same(name, left, whole[name]), name
    assert finish(started(command, folder)) == code
    for name in names:
        assert same(name, content(folder / name), whole[name]), name
    # The rows that a killed run had finished are kept. Nothing else is left.
    for name in files_of(folder) - known:
        assert ".unfinished" in name, name
        if command in ("run", "watch") and not name.endswith(("-journal", "-wal", "-shm")) and begun(folder / name):
            assert isinstance(read_table(folder / name), list)
