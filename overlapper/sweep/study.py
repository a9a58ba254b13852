"""What all tasks of a sweep have in common, and what a task is called."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from overlapper.scenes.parameters import Parameter
from overlapper.scenes.scene import Scene, scene_of
from overlapper.tables.table_file import origin


@dataclass(frozen=True, slots=True)
class Study:
    """A scene as its file was read, with the settings of every run of it.

    `settings` are `steps` and those of `scenes.run.run`; `kept` is the number of steps from one whose rows are kept to
    the next, 0 for none. `versions` are those of what measures: other ones may find other bits.
    """

    scene: str
    path: str
    source: bytes
    settings: Mapping[str, Any]
    kept: int
    versions: Mapping[str, str]

    @classmethod
    def of(cls, path: Path, settings: Mapping[str, Any], kept: int = 0) -> Study:
        """Of the file as it is now."""
        return cls(path.stem, str(path), path.read_bytes(), dict(settings), kept, origin())

    def loaded(self, parameters: Mapping[str, Parameter] | None = None) -> Scene:
        """The scene, with its defaults if not with other parameters. SceneError says what is wrong with it.

        It is as new: what runs of it have left in its module is gone.
        """
        scene = scene_of(Path(self.path), self.source)
        return scene if parameters is None else replace(scene, parameters=dict(parameters))

    def identity(self) -> dict[str, str]:
        """All that tells this study from another, by name, as text."""
        told = {**self.settings, "steps kept": self.kept}
        digest = hashlib.sha256(self.source).hexdigest()
        return {"scene": self.scene, "scene file": digest} | {k: str(v) for k, v in told.items()} | dict(self.versions)

    def digest(self, parameters: Mapping[str, Parameter]) -> str:
        """The name of the task with these parameters, 32 hexadecimal digits; another where anything is another."""
        told = json.dumps([self.identity(), dict(parameters)], sort_keys=True)
        return hashlib.sha256(told.encode()).hexdigest()[:32]


@dataclass(frozen=True, slots=True)
class Task:
    """A point, and what it is called."""

    name: str
    parameters: Mapping[str, Parameter]
