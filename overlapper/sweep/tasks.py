"""Runs tasks in worker processes, and turns their rows into parts there, before they are sent or written."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from overlapper.jobs.hand import Done, Outcome
from overlapper.scenes.scene import engine_in
from overlapper.sweep.measures import Measures
from overlapper.sweep.part import FAILURES, STEPS, TASKS, arrow, filled, parts
from overlapper.sweep.study import Study, Task
from overlapper.tables.table import Row, rows
from overlapper.tables.table_file import origin


@dataclass(frozen=True, slots=True)
class Piece:
    """Some tasks of a part, as a Parquet file per table, with the numbers of tasks that are done and that failed."""

    part: int
    done: int
    failed: int
    tables: Mapping[str, bytes]


def prepared(study: Study) -> Callable[[Task], dict[str, Any]]:
    """The function that runs the tasks of a study. ValueError if a package that measures has another version here.

    The function returns the row of the task, and the table of the rows of its steps, if steps are kept.
    """
    here = origin(engine_in(Path(study.path), study.source))
    if here != dict(study.versions):
        raise ValueError(f"the sweep began with {_said(study.versions)}, but this machine has {_said(here)}")
    heading = study.identity()

    def done(task: Task) -> dict[str, Any]:
        measures = Measures()
        kept: list[Row] = []
        with closing(study.frames(task.parameters)) as frames:
            for frame in frames:
                measures.add(frame)
                if study.kept and frame.step % study.kept == 0:
                    kept += rows(frame.step, frame.time, frame.bodies, frame.contacts, forces=frame.forces)
        steps = {STEPS: filled(STEPS, [(task, kept)], heading)} if study.kept else {}
        return {TASKS: measures.row(), **steps}

    return done


def gathered(study: Study, found: Sequence[tuple[Task, Outcome]]) -> list[Piece]:
    """The pieces of some tasks: one for each part to which any of the tasks belongs."""
    heading = study.identity()
    pieces = []
    for number, group in groupby(sorted(found, key=lambda each: each[0].number), lambda each: each[0].part):
        done, failed, steps = [], [], []
        for task, outcome in group:
            if isinstance(outcome, Done):
                done.append((task, [outcome.value[TASKS]]))
                steps += [outcome.value[STEPS]] if STEPS in outcome.value else []
            else:
                row = {name: getattr(outcome, name) for name in ("what", "sentence", "traceback")}
                failed.append((task, [row]))
        tables = {name: filled(name, of, heading) for name, of in ((TASKS, done), (FAILURES, failed)) if of}
        if steps:
            tables[STEPS] = arrow().concat_tables(steps)
        pieces.append(Piece(number, len(done), len(failed), parts(tables)))
    return pieces


def _said(versions: Mapping[str, str]) -> str:
    return " and ".join(f"{name} {version}" for name, version in versions.items())
