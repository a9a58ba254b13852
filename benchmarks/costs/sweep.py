"""The cost of a sweep beside the runs themselves, and how much faster two cores are than one.

    python benchmarks sweep [ROUNDS]

Overhead, by the processor's time, which is much the same when others are at work on the machine: in a worker, runs of a
scene of one ball and one step alternate with the same as tasks, and the median of their differences is told; in the
parent, all that it does for a task of a sweep; and by the clock, an item that needs no work.
Scaling: tasks of the grasp scene by one worker and by two, in turns, by the clock from the first tasks done on. Medians
of the rounds, the least and the largest.
"""

from __future__ import annotations

import resource
import tempfile
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from statistics import median
from typing import NamedTuple

from harness.command import ROOT
from harness.timing import timed
from overlapper.jobs.hand import Job
from overlapper.jobs.processes import Processes
from overlapper.scenes.run import run
from overlapper.sweep.points import Space
from overlapper.sweep.study import Study, Task
from overlapper.sweep.sweep import Progress, Sweep
from overlapper.sweep.tasks import prepared

EMPTY = '''"""One ball that nothing touches."""
import pybullet as p

STEPS = 1


def build(client, *, seed=0):
    ball = p.createCollisionShape(p.GEOM_SPHERE, radius=0.1, physicsClientId=client)
    p.createMultiBody(1, ball, physicsClientId=client)
'''


GRASP_STEPS = 130


class Cost(NamedTuple):
    """Seconds: per task by the clock, from the first that are done on; of the processor, for all processes from their
    start, and for the parent per task, from the first that are done on."""

    clock: float
    processor: float
    parent: float


def swept(scene: Path, steps: int, seeds: str, workers: int) -> Cost:
    """The cost of a whole sweep."""
    study = Study.of(scene, steps)
    space = Space(study.scene, study.loaded().parameters)
    sweep = Sweep(study, space.crossed([space.grid(seeds)]))
    heard: list[tuple[float, float]] = []

    def listen(progress: Progress) -> None:
        heard.append((time.perf_counter(), time.process_time()))

    before = spent()
    with tempfile.TemporaryDirectory() as folder, sweep.opened(Path(folder)) as store:
        sweep.run(store, Processes(workers), heard=listen)
    first = 1 + workers  # while the processes start, one of them may be alone
    clock, own = ((last - begun) / (len(heard) - 1 - first) for last, begun in zip(heard[-1], heard[first]))
    return Cost(clock, spent() - before, own)


def spent() -> float:
    """Seconds of the processor, of this process and of those that have ended."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def in_a_worker(scene: Path, steps: int, count: int) -> tuple[float, float]:
    """Seconds of the processor for a run, and for what a task takes beyond it."""
    study = Study.of(scene, steps)
    loaded, do = study.loaded(), prepared(study)
    task = Task("0" * 32, loaded.parameters)

    def alone() -> None:
        with closing(run(loaded, steps)) as frames:
            for _ in frames:
                pass

    taken = [(timed(alone), timed(lambda: do(task))) for _ in range(count)]
    return median(one for one, _ in taken), median(other - one for one, other in taken)


def nothing(setup: None) -> Callable[[int], int]:
    """A job that gives back what it is given."""
    return lambda item: item


def there_and_back(count: int) -> float:
    """Seconds per item by the clock."""
    found = Processes(1).outcomes(Job(__name__, "nothing", None), range(count))
    next(found)
    return timed(lambda: list(found), time.perf_counter) / (count - 1)


def options(parser: ArgumentParser) -> None:
    parser.add_argument("rounds", nargs="?", type=int, default=5)
    parser.add_argument("--tasks", type=int, default=200, help="of the empty scene")
    parser.add_argument("--grasps", type=int, default=60, help="of the grasp scene")


def main(chosen: Namespace) -> None:
    grasp = ROOT / "scenes" / "franka_grasp.py"
    with tempfile.TemporaryDirectory() as folder:
        empty = Path(folder, "empty.py")
        empty.write_text(EMPTY, encoding="utf-8")
        beside = []
        for _ in range(chosen.rounds):
            alone, worker = in_a_worker(empty, 1, chosen.tasks)
            parent = swept(empty, 1, f"seed=1:{chosen.tasks}:{chosen.tasks}", 1).parent
            back = there_and_back(25 * chosen.tasks)
            beside.append([1e3 * each for each in (alone, worker, parent, back, worker + parent + back)])
        words = ("a run", "more in the worker", "in the parent", "there and back", "overhead per task")
        for word, figures in zip(words, zip(*beside)):
            tell(word, figures, "ms")
    ratios, work = [], []
    for _ in range(chosen.rounds if chosen.grasps else 0):
        masses = f"mass=0.05:5:{chosen.grasps}:log"
        one, two = (swept(grasp, GRASP_STEPS, masses, workers) for workers in (1, 2))
        ratios.append(one.clock / two.clock)
        work.append(1e3 * one.processor / chosen.grasps)
    for word, figures, unit in (
        ("a grasp", work, "ms"),
        ("grasps, 2 to 1", ratios, "times"),
    ):
        if figures:
            tell(word, figures, unit)


def tell(word: str, figures: Sequence[float], unit: str) -> None:
    print(f"{word:20}{median(figures):7.2f} {unit} ({min(figures):.2f} … {max(figures):.2f})", flush=True)
