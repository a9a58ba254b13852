"""The cost of a sweep beside the runs themselves, and how much faster two cores are than one.

    python benchmarks sweep [ROUNDS]
    python benchmarks sweep 0 --empty 1000000 [--engine ray [--nodes 3]]

Overhead, by the processor's time, which is much the same when others are at work on the machine: in a worker, runs of a
scene of one ball and one step alternate with the same as tasks, and the median of their differences is told; in the
parent, all that it does for a task of a sweep; and by the clock, an item that needs no work.
Scaling: tasks of the grasp scene by one worker and by two, in turns, by the clock from the first tasks done on. Medians
of the rounds, the least and the largest.

With --empty, so many tasks that need no work are swept and summed up, once more, when nothing is left to do, and once
more, compared with themselves: the processor's time of the parent for each, and its largest memory. --nodes begins a
Ray cluster of so many nodes of one CPU each on this machine.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import ray_nodes

from harness.command import ROOT
from harness.timing import timed
from overlapper.jobs.cluster import Cluster
from overlapper.jobs.executor import Executor, Shared, outcomes
from overlapper.jobs.hand import Job
from overlapper.jobs.patience import Late
from overlapper.jobs.processes import Processes
from overlapper.scenes.run import run
from overlapper.sweep import page, tasks
from overlapper.sweep.comparison import Recorded
from overlapper.sweep.measures import Measures
from overlapper.sweep.points import Space
from overlapper.sweep.study import Study, Task
from overlapper.sweep.sweep import Progress, Sweep
from overlapper.sweep.tasks import prepared

EMPTY = '''"""One ball that nothing touches."""
import pybullet as p

STEPS = 1


def build(client, *, mass=1.0, seed=0):
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


gathered = tasks.gathered  # of the same module as the job


def empty(study: Study) -> Callable[[Task], dict[str, Any]]:
    """A job whose tasks take no time, and differ in what they came to."""
    row = Measures().row() | {"steps": 1, "time_s": 1 / 240}
    return lambda task: {"tasks": row | {"largest_volume_m3": 1e-9 * (task.number % 1013)}}


@dataclass
class OfNothing:
    """An executor whose tasks are empty, whatever they were."""

    engine: Executor
    workers: int = 1

    def shares(
        self, job: Job, items: Sequence[Any], limit: float | None = None, late: Late | None = None
    ) -> Generator[Shared, None, None]:
        return self.engine.shares(replace(job, module=__name__, prepare=empty.__name__), items, limit, late)


def driver(count: int, engine: Executor) -> None:
    """Tell what so many empty tasks cost the parent."""
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder, "empty.py")
        scene.write_text(EMPTY, encoding="utf-8")
        for words in ("swept", "nothing left to do", "compared with themselves"):
            before, clock = time.process_time(), time.perf_counter()
            there, asked = swept_empty(scene, count, OfNothing(engine), words.startswith("compared"))
            spent, passed = time.process_time() - before, time.perf_counter() - clock
            print(f"{words}: {there:,} of {asked:,} tasks, {1e6 * spent / asked:.0f} µs each in the parent,", end=" ")
            print(f"{passed:.0f} s in all, at most {most_memory():.0f} MB", flush=True)


def swept_empty(scene: Path, count: int, engine: Executor, compared: bool) -> tuple[int, int]:
    """How many tasks are done, and how many were asked for. What it needs is free again afterwards."""
    side = max(round(count**0.5), 1)
    runs = scene.parent / "runs"
    study = Study.of(scene, 1)
    space = Space(study.scene, study.loaded().parameters)
    sweep = Sweep(study, space.crossed([space.grid(f"mass=0.1:10:{side}"), space.seeds(count // side)]))
    recorded = Recorded(runs, scene.parent / "none", sweep) if compared else None
    with sweep.opened(runs) as store:
        reached = sweep.run(store, engine)
        page.write(sweep, store, "empty.py", comparison=recorded.compare(store) if recorded else None)
    return reached.before + reached.done, len(sweep)


@contextmanager
def nodes(count: int) -> Iterator[str]:
    """The address of a Ray cluster on this machine, which ends with the block."""
    command = [sys.executable, ray_nodes.__file__, str(count)]
    with subprocess.Popen(command, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as cluster:
        assert cluster.stdin and cluster.stdout
        yield cluster.stdout.readline().strip()
        cluster.stdin.close()


def most_memory() -> float:
    """MB that this process has had at most."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def there_and_back(count: int) -> float:
    """Seconds per item by the clock."""
    found = outcomes(Processes(1), Job(__name__, "nothing", None), range(count))
    next(found)
    return timed(lambda: list(found), time.perf_counter) / (count - 1)


def options(parser: ArgumentParser) -> None:
    parser.add_argument("rounds", nargs="?", type=int, default=5)
    parser.add_argument("--tasks", type=int, default=200, help="of the empty scene")
    parser.add_argument("--grasps", type=int, default=60, help="of the grasp scene")
    parser.add_argument("--empty", type=int, default=0, help="tasks that need no work")
    parser.add_argument("--engine", choices=("processes", "ray"), default="processes", help="of the empty tasks")
    parser.add_argument("--address", help="of the Ray cluster")
    parser.add_argument("--nodes", type=int, default=0, help="of a Ray cluster that is begun here")


def main(chosen: Namespace) -> None:
    if chosen.empty:
        # Processes of Ray must find this module, too.
        os.environ["PYTHONPATH"] = os.pathsep.join(map(os.path.abspath, sys.path))
        with nodes(chosen.nodes) if chosen.nodes else nullcontext(chosen.address) as address:
            driver(chosen.empty, Cluster(address) if chosen.engine == "ray" else Processes())
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
