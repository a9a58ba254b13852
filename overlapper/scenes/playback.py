"""Playback of a scene, or of the table of a scene, step by step.

An expected file has the shapes and poses of its steps, and is shown without the scene. Any other table has only
overlaps. Its scene is run again with the table's settings, and compared with the table.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from overlapper.printable import printable
from overlapper.scenes.parameters import read_heading
from overlapper.scenes.run import run
from overlapper.scenes.scene import ContactModel, Scene, load_scene
from overlapper.simulation.bodies import AnyBodies
from overlapper.simulation.links import link_contacts
from overlapper.simulation.model import Skipped
from overlapper.simulation.settings import Asking, Modelling, read_settings
from overlapper.tables.frame import Frame
from overlapper.tables.still import Still
from overlapper.tables.summary import note_skipped
from overlapper.tables.table import Row, link_rows, rows
from overlapper.tables.table_file import TABLES, read_content
from overlapper.verdicts.comparison import compare_measures
from overlapper.verdicts.expected import HUNDREDTHS, Expected, expected_in, has_shapes

STEP = 1 / 240  # s, pybullet's default time step; an expected file has no time

View = Frame[AnyBodies] | Frame[Still]


@dataclass
class Playback:
    """The frames to show: `views`, `total` in number. After the last view, `remarks` has the closing remarks.

    `sparse` views are a few selected steps. `skipped` has the shapes left out of the views so far, with the first step
    of each.
    """

    name: str
    total: int
    views: Generator[View, None, None]
    sparse: bool = False
    remarks: list[str] = field(default_factory=list)
    skipped: dict[Skipped, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.views = self._noted(self.views)

    def _noted(self, views: Generator[View, None, None]) -> Generator[View, None, None]:
        with closing(views):
            for view in views:
                note_skipped(self.skipped, view)
                yield view


def play(
    source: str,
    steps: int | None = None,
    scene: str | None = None,
    given: Mapping[str, str] | None = None,
    contact: ContactModel | None = None,
) -> Playback:
    """The playback of a scene, by name or path, or of a table. By default, the scene sets `steps`, the parameters
    `given` and `contact`.

    A table without shapes needs the `scene`. The scene that a table names is not run, as tables may come from anywhere.
    A scene is never run longer than its own number of steps, or `steps`, even if the table has more steps.

    SceneError if a scene cannot be found or run, ValueError or OSError if a table cannot be read.
    """
    path = Path(source)
    if path.suffix not in TABLES:
        if scene is not None:
            raise ValueError(f"--scene is for tables, but {source} is not a table")
        chosen = load_scene(source, given)
        return Playback(chosen.title, steps or chosen.steps, run(chosen, steps, contact=contact))
    if given:
        raise ValueError(f"--set is for scenes, but {source} is a table, which has its own parameters")
    if contact:
        raise ValueError(f"--contact is for scenes, but {source} is a table, which has its own contact model")
    table = read_content(path)
    if has_shapes(table):
        expected = expected_in(table, path)
        return Playback(path.stem, len(expected.stills), _views(expected), sparse=True)
    if scene is None:
        said = table.metadata.get("scene")
        named = f" (it says {printable(said)!r})" if said else ""
        raise ValueError(f"{path} has no shapes to show: give its scene with --scene{named}")
    recorded, chosen = table.rows, load_scene(scene, read_heading(table.metadata))
    last = max((int(row["step"] or 0) for row in recorded), default=1)
    playback = Playback(path.stem, min(last, steps or chosen.steps), _nothing())
    if playback.total < last:
        playback.remarks.append(f"{path} has {last:,} steps: --steps {last} shows all of them")
        recorded = [row for row in recorded if int(row["step"] or 0) <= playback.total]
    playback.views = playback._noted(_held_against(path, chosen, table.metadata, recorded, playback))
    return playback


def _nothing() -> Generator[View, None, None]:
    yield from ()


def _views(expected: Expected) -> Generator[View, None, None]:
    for step, still in expected.stills.items():
        yield Frame(step, step * STEP, still, still.contacts(expected.tolerance))


def _held_against(
    path: Path, scene: Scene, metadata: dict[str, str], recorded: list[Row], playback: Playback
) -> Generator[View, None, None]:
    found: list[Row] = []
    try:
        asking, modelling = read_settings(Asking, metadata), read_settings(Modelling, metadata)
    except ValueError as error:
        raise ValueError(f"{path} has an invalid setting: {error}") from error
    contact: Any = metadata.get("contact")
    for frame in run(scene, playback.total, asking, modelling, None if contact == "None" else contact):
        where = frame.step, frame.time, frame.bodies
        if metadata.get("per") == "link":
            found += link_rows(*where, link_contacts(frame.contacts))
        else:
            found += rows(*where, frame.contacts)
        yield frame
    moves = compare_measures(recorded, found, HUNDREDTHS).moves
    if moves:
        first = min(moves, key=lambda move: move.step)
        playback.remarks.append(f"the steps shown differ from {path}, because the simulation has changed: {first}")


def largest(views: Iterator[View]) -> Frame[Still]:
    """A copy of the view with the largest shared volume; the last view if there is none."""
    best, most = None, -1.0
    for view in views:
        volume = sum(contact.overlap.volume for contact in view.contacts)
        if volume > most or volume == 0 == most:
            best, most = view.kept(), volume
    if best is None:
        raise ValueError("there is nothing to show: no step was simulated or recorded")
    return best


def at_step(views: Iterator[View], step: int) -> Frame[Still]:
    """The view after that many steps."""
    for view in views:
        if view.step == step:
            return view.kept()
    raise ValueError(f"there is no step {step} to show")
