"""What it costs a script to be watched: processor time per step of a pybullet loop, plain and under `overlapper watch`.

python benchmarks/watch_overhead.py [ROUNDS]

Every way runs once in each round, one after the other; a figure is the median of the rounds. The script itself tells
how long its loop took, the first steps left out, in which shapes are read.
"""

import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

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
for _ in range(500):
    p.stepSimulation()
print((time.process_time() - start) / 500 * 1e6)
"""

WAYS = {
    "without us": None,
    "noticed, none measured": ["--every", "1000000"],
    "every 10th step": ["--every", "10"],
    "every step": [],
    "every step, --out .csv": ["--out", "run.csv"],
    "every step, --out .parquet": ["--out", "run.parquet"],
    "every step, --html": ["--html", "run.html"],
}


def main() -> None:
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "script.py").write_text(SCRIPT, encoding="utf-8")
        for scene in ("r2d2", "200 boxes"):
            taken = {way: [] for way in WAYS}
            for _ in range(rounds):
                for way, options in WAYS.items():
                    watch = [] if options is None else ["-m", "overlapper", "watch", *options]
                    command = [sys.executable, *watch, "script.py", scene]
                    done = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
                    taken[way].append(float(done.stdout))
            print(f"{scene}: µs per step, and over that without us (median of {rounds}, from least to most)")
            plain = statistics.median(taken["without us"])
            for way, figures in taken.items():
                middle = statistics.median(figures)
                print(f"  {way:28}{middle:8.0f}{middle - plain:8.0f}   {min(figures):.0f} … {max(figures):.0f}")
    print(f"start: {_start() - _start(watched=False):.2f} s more before the script begins")


def _start(watched: bool = True) -> float:
    """Seconds for a script that only imports pybullet; the least of five."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "script.py").write_text("import pybullet", encoding="utf-8")
        taken = []
        for _ in range(5):
            start = time.perf_counter()
            watch = ["-m", "overlapper", "watch"] if watched else []
            subprocess.run([sys.executable, *watch, "script.py"], cwd=folder, check=True, capture_output=True)
            taken.append(time.perf_counter() - start)
    return min(taken)


if __name__ == "__main__":
    main()
