"""The cost of being watched: processor time per step of a pybullet loop, plain and under `overlapper watch`.

    python benchmarks watch [ROUNDS]

Every way runs once in each round, one after the other; a figure is the median of the rounds. The script itself tells
how long its loop took, the first steps left out, in which shapes are read.
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

SCRIPT = """
import sys, time
import pybullet as p
import pybullet_data

p.connect(p.DIRECT)
p.setAdditionalSearchPath(pybullet_data.getDataPath())
p.setGravity(0, 0, -9.8)
p.loadURDF("plane.urdf")
if sys.argv[1] == "r2d2":
    p.loadURDF("r2d2.urdf", [0, 0, 0.5])
else:
    cube = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05] * 3)
    for number in range(200):
        p.createMultiBody(1, cube, basePosition=[number % 5 * 0.11, number // 5 % 5 * 0.11, 0.06 + number // 25 * 0.11])
for _ in range(100):
    p.stepSimulation()
start = time.process_time()
for _ in range(int(sys.argv[2])):
    p.stepSimulation()
print((time.process_time() - start) / int(sys.argv[2]) * 1e6)
"""

START = "import pybullet; pybullet.connect(pybullet.DIRECT); pybullet.stepSimulation()"

SCENES = ("r2d2", "200 boxes")

WAYS = {
    "without us": None,
    "noticed, none measured": ["--every", "1000000"],
    "every 10th step": ["--every", "10"],
    "every step": [],
    "every step, --out .csv": ["--out", "run.csv"],
    "every step, --out .parquet": ["--out", "run.parquet"],
    "every step, --html": ["--html", "run.html"],
}


def options(parser: ArgumentParser) -> None:
    parser.add_argument("rounds", nargs="?", type=int, default=5)
    parser.add_argument("--steps", type=int, default=500, help="of a script that are timed")
    parser.add_argument("--scene", action="append", choices=SCENES, help="only this one; may be repeated")
    parser.add_argument("--way", action="append", choices=WAYS, help="beside the plain script, only this one")


def main(chosen: Namespace) -> None:
    ways = ["without us", *(chosen.way or [way for way in WAYS if WAYS[way] is not None])]
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "script.py").write_text(SCRIPT, encoding="utf-8")
        Path(folder, "start.py").write_text(START, encoding="utf-8")
        for scene in chosen.scene or SCENES:
            taken: dict[str, list[float]] = {way: [] for way in ways}
            for _ in range(chosen.rounds):
                for way in ways:
                    taken[way].append(float(said(folder, WAYS[way], "script.py", scene, str(chosen.steps))))
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


def said(folder: str, options: list[str] | None, *script: str) -> str:
    """The output of a script, plain or watched with these options."""
    watch = [] if options is None else ["-m", "overlapper", "watch", *options]
    command = [sys.executable, *watch, *script]
    return subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout
