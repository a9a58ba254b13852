"""A scene held against what was recorded of it: what the command line and pytest have in common."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from overlapper.scenes.record import record
from overlapper.scenes.scene import SceneError, load_scene
from overlapper.scenes.verdict import Verdict, examine
from overlapper.verdicts.expected import read_expected


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a scene; `lines` say more, `causes` has a word for each of geometry, shapes and dynamics.

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
        verdict = examine(scene, read_expected(scene.expected))
    except ValueError as error:
        raise SceneError(str(error)) from error
    causes = {cause: "moved" if moves else "as recorded" for cause, moves in verdict.causes.items()}
    if not verdict.moves:
        page.unlink(missing_ok=True)  # of an earlier run
        return Outcome(scene.name, "as recorded", verdict.lines(), causes, verdict.notes)
    shown, remark = _page(verdict, scene.name, page)
    return Outcome(scene.name, "moved", [*verdict.lines(), remark], causes, verdict.notes, shown)


def _page(verdict: Verdict, name: str, path: Path) -> tuple[Path | None, str]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of meshcat's imports, and no business of the user's
            from overlapper.scenes import before_after
    except ImportError as error:
        return None, f"no page of before and after: {error}"
    return before_after.save(verdict, name, path), f"before and after: {path}"
