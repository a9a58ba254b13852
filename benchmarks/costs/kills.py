"""A sweep of the grasp scene under `kill -9`: of its parent, of its workers and of a node of its cluster.

    python benchmarks kills [TASKS] [STEPS] [--kills 3] [--ray] [--scene SCENE] [--seed 0]

The same tasks are swept twice with two processes, once undisturbed. The second time, the parent is killed so many
times, and started again, and as many times a worker, each at a random moment. The parts of both must be the same files
to the last bit. With --ray they are swept once more on a cluster of two nodes of one CPU each. One node is
killed at a random moment, and that so many times.
"""

from __future__ import annotations

import random
import subprocess
import sys
import tempfile
import time
from argparse import ArgumentParser, Namespace
from pathlib import Path

import psutil

from harness.command import ROOT

SWEEP = (sys.executable, "-m", "overlapper", "sweep")
NODES = ROOT / "tests" / "support" / "ray_nodes.py"


def options(parser: ArgumentParser) -> None:
    parser.add_argument("tasks", nargs="?", type=int, default=10_000)
    parser.add_argument("steps", nargs="?", type=int, default=5)
    parser.add_argument("--kills", type=int, default=3)
    parser.add_argument("--ray", action="store_true")
    parser.add_argument("--scene", default=ROOT / "scenes" / "franka_grasp.py", help="any with mass and friction")
    parser.add_argument("--seed", type=int, default=0)


def main(asked: Namespace) -> None:
    chance = random.Random(asked.seed)
    frictions = min(asked.tasks, 100)
    masses = max(asked.tasks // frictions, 1)
    command = [*SWEEP, str(asked.scene)]
    command += [f"--grid=mass=0.05:5:{masses}:log", f"--grid=friction=0.1:1:{frictions}", f"--steps={asked.steps}"]
    total = masses * frictions
    with tempfile.TemporaryDirectory() as folder:
        whole, broken, spread = (Path(folder, name) for name in ("whole", "broken", "spread"))
        begin = time.perf_counter()
        subprocess.run([*command, "--workers=2", "--out", whole], check=True)
        print(f"undisturbed: {total:,} tasks in {time.perf_counter() - begin:.0f} s", flush=True)
        begin = time.perf_counter()
        disturb([*command, "--workers=2", "--out", str(broken)], broken, total, asked.kills, chance)
        compare(whole, broken, total)
        print(f"killed {2 * asked.kills} times: the same in {time.perf_counter() - begin:.0f} s", flush=True)
        if asked.ray:
            for number in range(asked.kills):
                place = Path(f"{spread}{number}")
                lose_a_node([*command, "--engine=ray", "--out", str(place)], place, total, chance)
                compare(whole, place, total)
                print(f"a node killed, {number + 1}: the same", flush=True)


def parts(folder: Path) -> list[Path]:
    return sorted((folder / "tasks.parquet").glob("*.parquet"))


def wait_for(process: subprocess.Popen[bytes], folder: Path, count: int) -> None:
    """Until so many tasks are done."""
    while process.poll() is None and len(parts(folder)) < count:
        time.sleep(0.05)


def disturb(command: list[str], folder: Path, total: int, kills: int, chance: random.Random) -> None:
    """Run the sweep to its end, killing at moments that are spread over it."""
    victims = ["parent", "worker"] * kills
    chance.shuffle(victims)
    moments = sorted(chance.randrange(1, max(total * 9 // 10, 2)) for _ in victims)
    process = subprocess.Popen(command)
    for victim, moment in zip(victims, moments):
        wait_for(process, folder, moment)
        time.sleep(chance.uniform(0, 0.2))
        while not (workers := psutil.Process(process.pid).children()):
            time.sleep(0.05)
        if victim == "worker":
            chance.choice(workers).kill()
        else:
            process.kill()
            process.wait()
            process = subprocess.Popen(command)
        print(f"  {victim} killed when {len(parts(folder)):,} tasks were done", flush=True)
    if process.wait():
        sys.exit(f"the sweep ended with {process.returncode}")


def lose_a_node(command: list[str], folder: Path, total: int, chance: random.Random) -> None:
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen([sys.executable, str(NODES)], text=True, **pipes) as cluster:
        assert cluster.stdin and cluster.stdout
        address = cluster.stdout.readline().strip()
        process = subprocess.Popen([*command, f"--address={address}"])
        wait_for(process, folder, chance.randrange(1, max(total * 9 // 10, 2)))
        cluster.stdin.write("kill\n")
        cluster.stdin.flush()
        cluster.stdout.readline()
        print(f"  node killed when {len(parts(folder)):,} tasks were done", flush=True)
        if process.wait():
            sys.exit(f"the sweep ended with {process.returncode}")
        cluster.stdin.close()


def compare(whole: Path, other: Path, total: int) -> None:
    """The same files with the same bits, one for each task, and no failures; or the end."""
    found = [part.name for part in parts(other)]
    if len(found) != total or found != [part.name for part in parts(whole)]:
        sys.exit(f"{len(found):,} of {total:,} tasks are there")
    different = sum(a.read_bytes() != b.read_bytes() for a, b in zip(parts(whole), parts(other)))
    if different or (other / "failures.parquet").exists():
        sys.exit(f"{different:,} tasks have other bits")
