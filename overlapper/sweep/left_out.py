"""The tasks of a sweep that are done, and in which something was not looked at."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from overlapper.scenes.parameters import Parameter, described
from overlapper.sweep.sweep import Sweep


@dataclass(slots=True)
class LeftOut:
    """Counts the tasks with shapes that were not modelled and those with a body that had no finite pose.

    Rows of tasks are taken in one by one. Of each kind, the first is kept.
    """

    tasks: int = 0
    skipped: int = 0
    diverged: int = 0
    _first: dict[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, sweep: Sweep, rows: Iterable[Mapping[str, Any]]) -> LeftOut:
        """Those of a sweep, among the rows of tasks."""
        counted = cls()
        for row in rows:
            if task := sweep.tasks.get(row["task"]):
                counted.add(row, task.parameters)
        return counted

    def add(self, row: Mapping[str, Any], parameters: Mapping[str, Parameter]) -> None:
        """Take in the row of a task."""
        self.tasks += 1
        task = described(parameters) or "the scene"
        if row["skipped"]:
            self.skipped += 1
            self._first.setdefault("skipped", f"{row['first_skipped']} of {task}")
        if row["diverged"]:
            self.diverged += 1
            where = f"{row['first_diverged']} of {task}, in step {row['diverged_step']}"
            self._first.setdefault("diverged", where)

    def __bool__(self) -> bool:
        return bool(self.skipped or self.diverged)

    def lines(self) -> Iterable[str]:
        """A sentence for each kind, if there is any."""
        if self.diverged:
            counted = f"{self.diverged:,} of {self.tasks:,} tasks have diverged"
            yield f"{counted}: a body had no finite pose, and was left out. The first is {self._first['diverged']}."
        if self.skipped:
            counted = f"{self.skipped:,} of {self.tasks:,} tasks have shapes that are not modelled"
            yield f"{counted}. The first is {self._first['skipped']}."
