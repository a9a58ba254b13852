"""A scene held against what was recorded of it: what the command line and pytest have in common."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from overlapper.scenes.parameters import heading_of
from overlapper.scenes.run import stills
from overlapper.scenes.scene import Scene, SceneError, load_scene
from overlapper.tables.table_file import origin
from overlapper.verdicts import replay
from overlapper.verdicts.expected import Expected, read_expected
from overlapper.verdicts.verdict import Verdict, examine


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


def hold(path: Path, pages: Path, anew: bool = False) -> Outcome:
    """Run the scene of a file and compare it with its expected file, which is written if there is none, or `anew`.

    If something has moved, the page with before and after goes to `<pages>/<scene>.moved.html`. SceneError if the scene
    or its expected file is not to be used.
    """
    scene = load_scene(path)
    page = pages / f"{scene.name}.moved.html"
    try:
        if anew or not scene.expected.is_file():
            record(scene)
            written = f"written: {scene.expected}"
            page.unlink(missing_ok=True)  # of an earlier run
            if anew:
                return Outcome(scene.name, "recorded", [written])
            return Outcome(scene.name, "new", [written, "look at it, commit it, and the scene is guarded from now on"])
        verdict = examined(scene, read_expected(scene.expected))
    except ValueError as error:
        raise SceneError(str(error)) from error
    causes = {cause: "moved" if moves else "as recorded" for cause, moves in verdict.causes.items()}
    if not verdict.moves:
        page.unlink(missing_ok=True)  # of an earlier run
        return Outcome(scene.name, "as recorded", verdict.lines(), causes, verdict.notes)
    shown, remark = _page(verdict, scene.name, page)
    return Outcome(scene.name, "moved", [*verdict.lines(), remark], causes, verdict.notes, shown)


def record(scene: Scene) -> None:
    """Run the scene and write its expected file anew.

    The steps, the tolerance and the budgets of an old file stay in force. A new file has four steps and budgets of five
    times what rounding does to its measures when all is moved by less than a metre.
    """
    try:
        made = _observed(scene, read_expected(scene.expected))
    except FileNotFoundError:
        made = replay.fitted(_observed(scene, replay.wanted(scene.steps, scene.contact == "volumetric")))
    made.write(scene.expected, origin(scene.engine) | heading_of(scene.parameters))


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
