"""A scene held against what was recorded of it: what the command line and pytest have in common."""

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
    """The result of checking a scene. `lines` say more; `causes` has a word for each of geometry, shapes and dynamics.

    "new": there was nothing recorded, now there is. "recorded": it was recorded because that was asked for.
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
    """The page of each scene file, in a folder: named by its stem, and by folders above it if others have that stem."""
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
    """Run the scene of a file and compare it with its expected file, which is written if there is none, or `anew`.

    If something has moved, `page` shows before and after. SceneError if the scene or its expected file is not to be
    used, or if the scene has diverged and is to be recorded.
    """
    scene = load_scene(path)
    try:
        if anew or not scene.expected.is_file():
            notes = record(scene)
            written = f"written: {scene.expected}"
            page.unlink(missing_ok=True)  # of an earlier run
            if anew:
                return Outcome(scene.name, "recorded", [written, *notes])
            look = "look at it, commit it, and the scene is guarded from now on"
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
    """Run the scene and write its expected file anew; returns a sentence for all that is not modelled.

    The steps, the tolerance and the budgets of an old file stay in force. A new file has four steps and budgets of five
    times what rounding does to its measures when all is moved by less than a metre.
    """
    try:
        made = _observed(scene, read_expected(scene.expected))
    except FileNotFoundError:
        made = replay.fitted(_observed(scene, replay.wanted(scene.steps, scene.contact == "volumetric")))
    for step, still in made.stills.items():
        for each in still.skipped:
            if each.diverged:
                raise SceneError(f"{scene.path} is not recorded: {each.name} has diverged in step {step}")
    made.write(scene.expected, origin(scene.engine) | heading_of(scene.parameters))
    return left_out(made.stills)


def _observed(scene: Scene, wanted: Expected) -> Expected:
    return replay.observed(wanted, stills(scene, wanted.steps))


def examined(scene: Scene, expected: Expected) -> Verdict:
    """Run the scene and compare it with what was recorded. SceneError if it fails."""
    return examine(expected, stills(scene, expected.steps), scene.steps)


def _page(verdict: Verdict, name: str, path: Path) -> tuple[Path | None, str]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of meshcat's imports, and no business of the user's
            from overlapper.verdicts import before_after
    except ImportError as error:
        return None, f"no page of before and after: {error}"
    return before_after.save(verdict, name, path), f"before and after: {path}"
