"""The cost of being watched: processor time per step of a pybullet loop, plain and under `overlapper watch`.

    python benchmarks watch [ROUNDS]
    python benchmarks watch --long 100000
    python benchmarks watch --log 1000000

Every way runs once in each round, one after the other; a figure is the median of the rounds. The script itself tells
how long its loop took, the first steps left out, in which shapes are read. With --long, ten boxes on a plane that
tilts are watched for so many steps, and the script tells after each tenth of them how long a step took and how much
memory the process has. With --log, a Log of a loop of one's own writes so many rows of a pile in each format: the
processor's time for a row in the loop and at the end, and by how much the process grows.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from argparse import ArgumentParser, Namespace
from pathlib import Path
from statistics import median

from harness.timing import timed
from overlapper.tables.table_file import read_metadata

SCRIPT = """
import math, sys, time
import psutil
import pybullet as p
import pybullet_data

p.connect(p.DIRECT)
p.setAdditionalSearchPath(pybullet_data.getDataPath())
p.setGravity(0, 0, -9.8)
p.loadURDF("plane.urdf")
scene, steps, parts = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
if scene == "r2d2":
    p.loadURDF("r2d2.urdf", [0, 0, 0.5])
else:
    cube = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05] * 3)
    for number in range(int(scene.split()[0])):
        p.createMultiBody(1, cube, basePosition=[number % 5 * 0.11, number // 5 % 5 * 0.11, 0.06 + number // 25 * 0.11])
for _ in range(100):
    p.stepSimulation()
for part in range(parts):
    start = time.process_time()
    for step in range(steps // parts):
        if parts > 1:  # so that nothing ever rests
            p.setGravity(math.cos(step / 40), math.sin(step / 40), -9.8)
        p.stepSimulation()
    taken = (time.process_time() - start) / (steps // parts) * 1e6
    print(taken, psutil.Process().memory_info().rss / 1e6 if parts > 1 else "")
"""

LOG = """
import resource, sys, time
import psutil
import pybullet as p
import pybullet_data
from overlapper import Log
from overlapper.simulation import Bodies

path, rows = sys.argv[1], int(sys.argv[2])
client = p.connect(p.DIRECT)
p.setAdditionalSearchPath(pybullet_data.getDataPath())
p.setGravity(0, 0, -9.8)
p.loadURDF("plane.urdf")
cube = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05] * 3)
for number in range(25):
    p.createMultiBody(1, cube, basePosition=[number % 5 * 0.1, number // 5 * 0.1, 0.05])
for _ in range(100):
    p.stepSimulation()
bodies = Bodies(client)
size, steps, count, spent = psutil.Process().memory_info, 0, 0, 0.0
before = size().rss
with Log(path, bodies) as log:
    while count < rows:
        p.stepSimulation()
        bodies.update()
        found = bodies.overlaps()
        count, steps = count + len(found), steps + 1
        start = time.process_time()
        log.add(found)
        spent += time.process_time() - start
        if steps == 100:
            before = size().rss
    grown, start = size().rss - before, time.process_time()
closing = time.process_time() - start
most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 - before
print(count, count / steps, spent / count * 1e6, closing, grown / 1e6, most / 1e6)
"""

START = "import pybullet; pybullet.connect(pybullet.DIRECT); pybullet.stepSimulation()"

SCENES = ("r2d2", "200 boxes")
LONG = "10 boxes"
FORMATS = ("csv", "parquet", "sqlite")

WAYS = {
    "without us": None,
    "noticed, none measured": ["--every", "1000000"],
    "every 10th step": ["--every", "10"],
    "every step": [],
    "every step, --out .csv": ["--out", "run.csv"],
    "every step, --out .parquet": ["--out", "run.parquet"],
    "every step, --out .sqlite": ["--out", "run.sqlite"],
    "every step, --html": ["--html", "run.html"],
}


def options(parser: ArgumentParser) -> None:
    parser.add_argument("rounds", nargs="?", type=int, default=5)
    parser.add_argument("--steps", type=int, default=500, help="of a script that are timed")
    parser.add_argument("--long", type=int, help="watch ten boxes for so many steps, and tell of the memory")
    parser.add_argument("--log", type=int, help="write so many rows of a Log in each format")
    parser.add_argument("--scene", action="append", choices=SCENES, help="only this one; may be repeated")
    parser.add_argument("--way", action="append", choices=WAYS, help="beside the plain script, only this one")


def main(chosen: Namespace) -> None:
    if chosen.long:
        watch_long(chosen.long, chosen.way or [way for way in WAYS if "--out" in way])
        return
    if chosen.log:
        long_logs(chosen.log)
        return
    ways = ["without us", *(chosen.way or [way for way in WAYS if WAYS[way] is not None])]
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "script.py").write_text(SCRIPT, encoding="utf-8")
        Path(folder, "start.py").write_text(START, encoding="utf-8")
        for scene in chosen.scene or SCENES:
            taken: dict[str, list[float]] = {way: [] for way in ways}
            for _ in range(chosen.rounds):
                for way in ways:
                    taken[way].append(float(said(folder, WAYS[way], "script.py", scene, str(chosen.steps), "1")))
            print(f"{scene}: µs per step, and over that without us (median of {chosen.rounds}, from least to most)")
            plain = median(taken["without us"])
            for way, figures in taken.items():
                middle = median(figures)
                print(f"  {way:28}{middle:8.0f}{middle - plain:8.0f}   {min(figures):.0f} … {max(figures):.0f}")
        # The least of so many runs of a script that makes one step of nothing.
        plain, watched = (
            min(timed(lambda: said(folder, options, "start.py"), time.perf_counter) for _ in range(chosen.rounds))  # noqa: B023
            for options in (None, [])
        )
    print(f"start: {watched - plain:.2f} s more before the script begins")


def watch_long(steps: int, ways: list[str]) -> None:
    for way in ways:
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "script.py").write_text(SCRIPT, encoding="utf-8")
            lines = said(folder, WAYS[way], "script.py", LONG, str(steps), "10").splitlines()
            (table,) = Path(folder).glob("run.*")
            size, rows = table.stat().st_size / 1e6, rows_in(table)
        print(f"{way}: {steps:,} steps, {rows:,} rows, a file of {size:.1f} MB; after each tenth, µs per step and MB")
        for taken, memory in (map(float, line.split()) for line in lines):
            print(f"  {taken:8.0f}{memory:10.1f}", flush=True)


def rows_in(table: Path) -> int:
    """The number of rows of a table, which may be too many to be read."""
    if table.suffix == ".csv":
        with table.open(encoding="utf-8") as lines:
            return sum(not line.startswith("#") for line in lines) - 1
    return int(read_metadata(table)["rows"].partition(", sha256")[0].replace(",", ""))


def long_logs(rows: int) -> None:
    for ending in FORMATS:
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "log.py").write_text(LOG, encoding="utf-8")
            words = said(folder, None, "log.py", f"log.{ending}", str(rows)).split()
        count, each, spent, closing, grown, most = map(float, words)
        times = f"{spent:.1f} µs each in the loop, {closing:.2f} s at the end"
        print(f"{ending}: {count:,.0f} rows, {each:.0f} a step, {times};", end=" ")
        print(f"the process has grown by {grown:.1f} MB in the loop, and by {most:.1f} MB at most", flush=True)


def said(folder: str, options: list[str] | None, *script: str) -> str:
    """The output of a script, plain or watched with these options."""
    watch = [] if options is None else ["-m", "overlapper", "watch", *options]
    command = [sys.executable, *watch, *script]
    return subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout
