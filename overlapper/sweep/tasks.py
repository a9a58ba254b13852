"""A task done, in the process of a hand: the scene is run and its parts are made."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing

from overlapper.scenes.scene import engine_in
from overlapper.sweep.measures import Measures
from overlapper.sweep.part import STEPS, TASKS, part
from overlapper.sweep.study import Study, Task
from overlapper.tables.table import Row, rows
from overlapper.tables.table_file import origin

Parts = dict[str, bytes]


def prepared(study: Study) -> Callable[[Task], Parts]:
    """The function that runs the tasks of a study. ValueError where a package that measures is of another version."""
    here = origin(engine_in(study.source))
    if here != dict(study.versions):
        raise ValueError(f"the sweep is of {_said(study.versions)}, but here is {_said(here)}")
    heading = study.identity()

    def done(task: Task) -> Parts:
        measures = Measures()
        kept: list[Row] = []
        with closing(study.frames(task.parameters)) as frames:
            for frame in frames:
                measures.add(frame)
                if study.kept and frame.step % study.kept == 0:
                    kept += rows(frame.step, frame.time, frame.bodies, frame.contacts, forces=frame.forces)
        parts = {STEPS: part(STEPS, task.name, task.parameters, kept, heading)} if study.kept else {}
        return parts | {TASKS: part(TASKS, task.name, task.parameters, [measures.row()], heading)}

    return done


def _said(versions: Mapping[str, str]) -> str:
    return " and ".join(f"{name} {version}" for name, version in versions.items())
