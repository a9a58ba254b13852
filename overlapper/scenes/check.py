"""The check of a scene against its expected file, shared by the command line and pytest."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from overlapper.scenes.parameters import heading_of
from overlapper.scenes.run import stills
from overlapper.scenes.scene import Scene, SceneError, load_scene
from overlapper.tables.table_file import origin
from overlapper.verdicts import replay
from overlapper.verdicts.expected import Expected, read_expected
from overlapper.verdicts.verdict import Verdict, examine, left_out


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of checking a scene. `lines` say more. `causes` has a word each for geometry, shapes and dynamics.

    "new": there was no expected file, and one was written. "recorded": the scene was recorded on request.
    """

    name: str
    word: Literal["as recorded", "moved", "new", "recorded"]
    lines: list[str] = field(default_factory=list)
    causes: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    page: Path | None = None

    @property
    def passed(self) -> bool:
        return self.word in ("as recorded", "recorded")


def pages_of(scenes: Sequence[Path], folder: Path) -> dict[Path, Path]:
    """The page of each scene file in a folder. Its name is the stem, with parent folders if stems are equal."""
    parts = {scene: scene.resolve().with_suffix("").parts[1:] for scene in scenes}
    depth = dict.fromkeys(scenes, 1)
    while True:
        names = {scene: "-".join(parts[scene][-depth[scene] :]) for scene in scenes}
        alike = Counter(names.values())
        deeper = [scene for scene in scenes if alike[names[scene]] > 1 and depth[scene] < len(parts[scene])]
        if not deeper:
            return {scene: folder / f"{name}.moved.html" for scene, name in names.items()}
        for scene in deeper:
            depth[scene] += 1


def hold(path: Path, page: Path, anew: bool = False) -> Outcome:
    """Run a scene and compare it with its expected file. The file is written if it is missing, or with `anew`.

    If something has moved, `page` shows before and after. SceneError if the scene or its expected file cannot be used,
    or if the scene is to be recorded and has diverged.
    """
    scene = load_scene(path)
    try:
        if anew or not scene.expected.is_file():
            notes = record(scene)
            written = f"written: {scene.expected}"
            page.unlink(missing_ok=True)  # of an earlier run
            if anew:
                return Outcome(scene.name, "recorded", [written, *notes])
            look = "look at the file and commit it: later runs are compared with it"
            return Outcome(scene.name, "new", [written, *notes, look])
        verdict = examined(scene, read_expected(scene.expected))
    except ValueError as error:
        raise SceneError(str(error)) from error
    causes = {cause: "moved" if moves else "as recorded" for cause, moves in verdict.causes.items()}
    if not verdict.moves:
        page.unlink(missing_ok=True)  # of an earlier run
        return Outcome(scene.name, "as recorded", verdict.lines(), causes, verdict.notes)
    shown, remark = _page(verdict, scene.name, page)
    return Outcome(scene.name, "moved", [*verdict.lines(), remark], causes, verdict.notes, shown)


def record(scene: Scene) -> list[str]:
    """Run the scene and write its expected file anew. Returns sentences on the shapes that are not modelled.

    The steps, the tolerance and the budgets of an old file are kept. A new file has four steps. Its budgets are five
    times the rounding errors of its measures when everything is moved by less than a metre.
    """
    try:
        made = _observed(scene, read_expected(scene.expected))
    except FileNotFoundError:
        made = replay.fitted(_observed(scene, replay.wanted(scene.steps, scene.contact == "volumetric")))
    for step, still in made.stills.items():
        for each in still.skipped:
            if each.diverged:
                raise SceneError(f"{scene.path} is not recorded, because {each.name} diverged in step {step}")
    made.write(scene.expected, origin(scene.engine) | heading_of(scene.parameters))
    return left_out(made.stills)


def _observed(scene: Scene, wanted: Expected) -> Expected:
    return replay.observed(wanted, stills(scene, wanted.steps))


def examined(scene: Scene, expected: Expected) -> Verdict:
    """Run the scene and compare it with the expected file. SceneError if the scene fails."""
    return examine(expected, stills(scene, expected.steps), scene.steps)


def _page(verdict: Verdict, name: str, path: Path) -> tuple[Path | None, str]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # from meshcat's imports: the user cannot mend them
            from overlapper.verdicts import before_after
    except ImportError as error:
        return None, f"no page of before and after: {error}"
    return before_after.save(verdict, name, path), f"before and after: {path}"
