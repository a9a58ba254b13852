"""A sweep: does the tasks that are missing, and stores their results and failures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overlapper.jobs.executor import Executor
from overlapper.jobs.hand import Job
from overlapper.sweep import tasks
from overlapper.sweep.part import arrow
from overlapper.sweep.points import Points
from overlapper.sweep.store import Names, Store, text_of
from overlapper.sweep.study import Study, Task

# A sweep has about PARTS parts, or one for each task if there are fewer. A part has at most ROWS rows, or one task.
PARTS, ROWS = 1_000, 10_000

Numbers = NDArray[np.intp]


@dataclass(slots=True)
class Progress:
    """The progress of a sweep: how many of `total` tasks were done `before`, and how many are done or failed since."""

    total: int
    before: int = 0
    done: int = 0
    failed: int = 0
    failed_before: int = 0

    @property
    def missing(self) -> int:
        """The number of tasks that are neither done nor failed."""
        return self.total - self.before - self.done - self.failed - self.failed_before


@dataclass(slots=True)
class Sweep:
    """The tasks of a study, one for each point. A task has the number of its point. Consecutive tasks form a part."""

    study: Study
    points: Points
    names: Names = field(init=False)
    size: int = field(init=False)
    _order: Numbers = field(init=False)

    def __post_init__(self) -> None:
        digest = self.study.digests()
        self.names = np.fromiter(map(digest, self.points), "S16", len(self.points))
        self._order = np.argsort(self.names)
        kept = self.study.steps // self.study.kept if self.study.kept else 1
        self.size = max(min(len(self) // PARTS, ROWS // max(kept, 1)), 1)

    def __len__(self) -> int:
        return len(self.points)

    def numbers(self, names: Names) -> Numbers:
        """The number of each task by its name; -1 for those of other sweeps."""
        found = self._order[np.minimum(np.searchsorted(self.names, names, sorter=self._order), len(self) - 1)]
        return np.where(self.names[found] == names, found, -1)

    def task(self, number: int) -> Task:
        """The task of a point."""
        return Task(text_of(self.names[number]), self.points[number], number, number // self.size)

    def opened(self, folder: Path) -> Store:
        """The store of this sweep in a folder, which is made if it does not exist. See Store."""
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
        late: Callable[[Task, int, float], object] | None = None,
    ) -> Progress:
        """Do the tasks that are missing in the store, and with `retry` the failed ones.

        `heard` is called with the progress. A task fails if it raises, takes longer than `limit` seconds, takes more
        memory than `megabytes`, or ends its process. Other tasks go on. `late(task, count, seconds)` is called if one
        of `count` tasks from `task` on, which are done together, takes very long. NotStarted if no task can be run,
        OSError if a part cannot be written.
        """
        state, pieces = self._found(store)
        progress = Progress(len(self), before=int((state == DONE).sum()))
        missing = np.flatnonzero((state != DONE) if retry else (state == MISSING))
        progress.failed_before = len(self) - progress.before - len(missing)
        heard(progress)
        left = np.bincount(missing // self.size, minlength=1)
        for part in [part for part in pieces if part >= len(left) or not left[part]]:
            store.assemble(self, pieces.pop(part))
        gather = tasks.gathered.__name__
        job = Job(tasks.__name__, tasks.prepared.__name__, self.study, gather, megabytes=megabytes)

        def tell(numbers: Sequence[int], seconds: float) -> None:
            if late:
                late(self.task(int(missing[numbers[0]])), len(numbers), seconds)

        with closing(engine.shares(job, _Tasks(self, missing), limit, tell if late else None)) as shares:
            for piece in (piece for _, gathered in shares for piece in gathered):
                left[piece.part] -= piece.done + piece.failed
                if piece.part not in pieces and not left[piece.part]:
                    store.keep(piece.tables)
                else:
                    pieces.setdefault(piece.part, []).extend(store.keep_piece(piece.tables))
                    if not left[piece.part]:
                        store.assemble(self, pieces.pop(piece.part))
                progress.done += piece.done
                progress.failed += piece.failed
                heard(progress)
        if retry:
            store.settle()
        return progress

    def _found(self, store: Store) -> tuple[NDArray[np.uint8], dict[int, list[Path]]]:
        """The state of each task, and the pieces of unfinished parts."""
        state = np.zeros(len(self), np.uint8)
        pieces: dict[int, list[Path]] = {}
        for names, said in ((store.failed, FAILED), (store.done, DONE)):
            state[_known(self.numbers(names))] = said
        for path, names in store.pieces.items():
            numbers = self.numbers(names)
            if len(of := np.unique(numbers // self.size)) == 1 and of[0] >= 0:
                pieces.setdefault(int(of[0]), []).append(path)
            else:  # the piece is of another sweep, or of parts of another size
                store.assemble(self, [path])
            known = _known(numbers)
            state[known] = np.maximum(state[known], DONE if store.is_done(path) else FAILED)
        return state, pieces


MISSING, FAILED, DONE = range(3)


def _known(numbers: Numbers) -> Numbers:
    return numbers[numbers >= 0]


@dataclass(frozen=True, slots=True)
class _Tasks(Sequence[Task]):
    """Some tasks of a sweep, made on access."""

    sweep: Sweep
    chosen: Numbers

    def __len__(self) -> int:
        return len(self.chosen)

    def __getitem__(self, number: Any) -> Any:
        return self.sweep.task(int(self.chosen[number]))
