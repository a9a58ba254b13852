"""A sweep: the tasks that are missing are done, and what becomes of each is kept."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from overlapper.jobs.executor import Executor
from overlapper.jobs.hand import Done, Failed, Job
from overlapper.scenes.parameters import Parameter
from overlapper.sweep import tasks
from overlapper.sweep.part import FAILURES, arrow, part
from overlapper.sweep.store import Store
from overlapper.sweep.study import Study, Task


@dataclass(slots=True)
class Progress:
    """How far a sweep is: of `total` tasks, how many were there before, are done since, and have failed since."""

    total: int
    before: int = 0
    done: int = 0
    failed: int = 0
    failed_before: int = 0

    @property
    def missing(self) -> int:
        """Tasks that are neither done nor have failed."""
        return self.total - self.before - self.done - self.failed - self.failed_before


@dataclass(slots=True)
class Sweep:
    """The tasks of a study, one for each point."""

    study: Study
    points: Sequence[Mapping[str, Parameter]]
    tasks: dict[str, Task] = field(init=False)

    def __post_init__(self) -> None:
        made = (Task(self.study.digest(point), point) for point in self.points)
        self.tasks = {task.name: task for task in made}

    def opened(self, folder: Path) -> Store:
        """The folder in which it is or will be. See Store."""
        arrow()
        return Store(folder, self.study.identity())

    def run(
        self,
        store: Store,
        engine: Executor,
        limit: float | None = None,
        retry: bool = False,
        heard: Callable[[Progress], object] = lambda progress: None,
        megabytes: int | None = None,
    ) -> Progress:
        """Do what is missing in the store, and with `retry` what has failed; `heard` is told of every task.

        Tasks fail that raise, take longer than `limit` seconds, take more memory than `megabytes`, or end their
        process. They stop no other. NotStarted if no task can be run, OSError if a part cannot be written.
        """
        progress = Progress(len(self.tasks), before=len(self.tasks.keys() & store.done))
        missing = [task for name, task in self.tasks.items() if name not in store.done]
        if not retry:
            progress.failed_before = sum(task.name in store.failed for task in missing)
            missing = [task for task in missing if task.name not in store.failed]
        heard(progress)
        if not missing:
            return progress
        job = Job(tasks.__name__, tasks.prepared.__name__, self.study, megabytes=megabytes)
        with closing(engine.outcomes(job, missing, limit)) as outcomes:
            for number, outcome in outcomes:
                task = missing[number]
                if isinstance(outcome, Done):
                    store.keep(task.name, outcome.value)
                    progress.done += 1
                else:
                    store.keep(task.name, {FAILURES: self._failure(task, outcome)})
                    progress.failed += 1
                heard(progress)
        return progress

    def _failure(self, task: Task, failed: Failed) -> bytes:
        row: dict[str, Any] = {
            "what": failed.what,
            "sentence": failed.sentence,
            "traceback": failed.traceback,
        }
        return part(FAILURES, task.name, task.parameters, [row], self.study.identity())
