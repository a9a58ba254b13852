"""A scene, or the table of one, played back step by step.

An expected file has the shapes and poses of its steps, and is shown without the scene. Any other table has overlaps
alone: its scene is run again with the table's settings, and held against the table.
"""

from __future__ import annotations

import re
from collections.abc import Generator, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from overlapper.scenes.comparison import compare_measures
from overlapper.scenes.expected import HUNDREDTHS, read_expected
from overlapper.scenes.run import Frame, run
from overlapper.scenes.scene import Scene, SceneError, load_scene
from overlapper.scenes.still import Still
from overlapper.scenes.table import Row, link_rows, rows
from overlapper.scenes.table_file import TABLES, read_metadata, read_table
from overlapper.simulation import Bodies
from overlapper.simulation.links import link_contacts

STEP = 1 / 240  # s, what pybullet takes for a step; an expected file says nothing of time

View = Frame[Bodies] | Frame[Still]


@dataclass
class Playback:
    """What there is to see: `views`, as many as `total`; when they are through, `remarks` has what is to be said.

    `sparse` views are few steps of many, each worth a look.
    """

    name: str
    total: int
    views: Generator[View, None, None]
    sparse: bool = False
    remarks: list[str] = field(default_factory=list)


def play(source: str, steps: int | None = None) -> Playback:
    """The playback of a scene, by name or path, or of a table; of a scene, `steps` of it.

    SceneError if a scene cannot be found or run, ValueError or OSError if a table cannot be read.
    """
    path = Path(source)
    if path.suffix not in TABLES:
        scene = load_scene(source)
        return Playback(scene.name, steps or scene.steps, _run(scene, steps or scene.steps, {}))
    settings = read_metadata(path)
    if path.suffix == ".csv" and re.search(r"^# shapes ", path.read_text(encoding="utf-8"), re.MULTILINE):
        expected = read_expected(path)
        stills = {step: Still.recorded(recorded, expected.shapes[step]) for step, recorded in expected.rows_by_step()}
        return Playback(path.stem, len(stills), _stills(stills, expected.tolerance), sparse=True)
    playback = Playback(path.stem, int(settings.get("steps", 0)), _nothing())
    playback.views = _held_against(path, _scene_of(path, settings), settings, playback)
    return playback


def _nothing() -> Generator[View, None, None]:
    yield from ()


def _scene_of(path: Path, settings: dict[str, str]) -> Scene:
    """The scene that a table is of: one known by name, or one whose file is here or beside the table."""
    name = settings.get("scene")
    if name is None or not settings.get("steps", "").isdigit():
        raise ValueError(f"{path} does not say which scene it is of, nor has it shapes to show")
    for folder in (Path(), path.parent):
        if (folder / f"{name}.py").is_file():
            return load_scene(folder / f"{name}.py")
    try:
        return load_scene(name)
    except SceneError as error:
        raise ValueError(
            f"{path} has no shapes to show, and its scene {name}.py, to be run again, is neither here nor beside it"
        ) from error


def _run(scene: Scene, steps: int, settings: dict[str, Any]) -> Generator[View, None, None]:
    yield from run(scene, steps, **settings)


def _stills(stills: dict[int, Still], tolerance: float) -> Generator[View, None, None]:
    for step, still in stills.items():
        yield Frame(step, step * STEP, still, still.contacts(tolerance))


def _held_against(
    path: Path, scene: Scene, settings: dict[str, str], playback: Playback
) -> Generator[View, None, None]:
    recorded = read_table(path)
    steps = max((int(row["step"] or 0) for row in recorded), default=playback.total)
    playback.total = steps
    kinds = {
        "tolerance": float,
        "method": str,
        "surface": str,
        "concave": str,
        "concave_threshold": float,
        "pairs": str,
    }
    known = {name: kind(settings[name]) for name, kind in kinds.items() if settings.get(name, "None") != "None"}
    found: list[Row] = []
    for frame in run(scene, steps, **known):
        where = frame.step, frame.time, frame.bodies
        if settings.get("per") == "link":
            found += link_rows(*where, link_contacts(frame.contacts))
        else:
            found += rows(*where, frame.contacts)
        yield frame
    moves = compare_measures(recorded, found, HUNDREDTHS).moves
    if moves:
        first = min(moves, key=lambda move: move.step)
        playback.remarks.append(f"what is seen is not what {path} has, as the simulation has changed: {first}")


def largest(views: Iterator[View]) -> Frame[Still]:
    """The view in which most is shared, kept apart from the simulation; the last one if nothing ever is."""
    best, most = None, -1.0
    for view in views:
        volume = sum(contact.overlap.volume for contact in view.contacts)
        if volume > most or volume == 0 == most:
            best, most = view.kept(), volume
    if best is None:
        raise ValueError("there is nothing to see: no step was simulated or recorded")
    return best


def at_step(views: Iterator[View], step: int) -> Frame[Still]:
    """The view after that many steps."""
    for view in views:
        if view.step == step:
            return view.kept()
    raise ValueError(f"there is no step {step} to see")
