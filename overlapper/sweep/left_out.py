"""The finished tasks of a sweep in which shapes or bodies were left out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from overlapper.scenes.parameters import described
from overlapper.sweep.part import TASKS
from overlapper.sweep.store import Store
from overlapper.sweep.sweep import Sweep


@dataclass(frozen=True, slots=True)
class LeftOut:
    """Counts the tasks with shapes that were not modelled, and the tasks with a body that had no finite pose.

    The first task of each kind is described.
    """

    tasks: int
    skipped: int = 0
    diverged: int = 0
    first_skipped: str = ""
    first_diverged: str = ""

    @classmethod
    def of(cls, sweep: Sweep, store: Store) -> LeftOut:
        """The counts for a sweep."""
        numbers, columns = store.columns(TASKS, sweep, ["skipped", "diverged"])
        told: dict[str, int | str] = {}
        for kind, counts in columns.items():
            if counts.any():
                number = int(numbers[counts > 0][0])
                (row,) = store.rows_of(TASKS, sweep, [number])
                step = f", in step {row['diverged_step']}" if kind == "diverged" else ""
                task = described(sweep.points[number]) or "the scene"
                told |= {kind: int((counts > 0).sum()), f"first_{kind}": f"{row[f'first_{kind}']} of {task}{step}"}
        return cls(len(numbers), **told)  # type: ignore[arg-type]

    def __bool__(self) -> bool:
        return bool(self.skipped or self.diverged)

    def lines(self) -> Iterator[str]:
        """A sentence for each kind of which there is a task."""
        if self.diverged:
            counted = f"{self.diverged:,} of {self.tasks:,} tasks have diverged"
            yield f"{counted}: a body had no finite pose, and was left out. The first is {self.first_diverged}."
        if self.skipped:
            counted = f"{self.skipped:,} of {self.tasks:,} tasks have shapes that are not modelled"
            yield f"{counted}. The first is {self.first_skipped}."
