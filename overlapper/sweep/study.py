"""The settings that all tasks of a sweep share, and the name of a task."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from overlapper.scenes.parameters import Parameter
from overlapper.scenes.run import run
from overlapper.scenes.scene import ContactModel, Scene, engine_in, scene_of
from overlapper.simulation.bodies import AnyBodies
from overlapper.simulation.settings import Asking, Modelling, settings_of
from overlapper.tables.frame import Frame
from overlapper.tables.table_file import origin


@dataclass(frozen=True, slots=True)
class Study:
    """A scene as its file was read, and how it is run: for `steps` steps, as `scenes.run.run` takes the rest.

    The rows of every step that `kept` divides are kept, of none if it is 0. `versions` are those of the packages that
    measure: other versions may find other bits.
    """

    scene: str
    path: str
    source: bytes
    steps: int
    contact: ContactModel
    asking: Asking
    modelling: Modelling
    kept: int
    versions: Mapping[str, str]

    @classmethod
    def of(
        cls,
        path: Path,
        steps: int,
        contact: ContactModel | None = None,
        asking: Asking = Asking(),  # noqa: B008
        modelling: Modelling = Modelling(),  # noqa: B008
        kept: int = 0,
    ) -> Study:
        """The study of the file as it is now."""
        source = path.read_bytes()
        engine: Any = engine_in(path, source)
        return cls(path.stem, str(path), source, steps, contact or engine, asking, modelling, kept, origin(engine))

    @property
    def settings(self) -> dict[str, Any]:
        """How the scene is run, by the names of options."""
        return {"steps": self.steps, **settings_of(self.asking, self.modelling), "contact": self.contact}

    def loaded(self, parameters: Mapping[str, Parameter] | None = None) -> Scene:
        """The scene, with its defaults if not with other parameters. SceneError says what is wrong with it.

        It is as new: what runs of it have left in its module is gone.
        """
        scene = scene_of(Path(self.path), self.source)
        return scene if parameters is None else replace(scene, parameters=dict(parameters))

    def frames(self, parameters: Mapping[str, Parameter]) -> Generator[Frame[AnyBodies], None, None]:
        """The frames of a run with these parameters."""
        return run(self.loaded(parameters), self.steps, self.asking, self.modelling, self.contact)

    def identity(self) -> dict[str, str]:
        """All that tells this study from another, by name, as text."""
        told = {**self.settings, "steps kept": self.kept}
        digest = hashlib.sha256(self.source).hexdigest()
        return {"scene": self.scene, "scene file": digest} | {k: str(v) for k, v in told.items()} | dict(self.versions)

    def digests(self) -> Callable[[Mapping[str, Parameter]], bytes]:
        """The function that digests parameters, in 16 bytes; they are others where anything is another."""
        encode = json.JSONEncoder(sort_keys=True).encode
        study = hashlib.sha256(encode(self.identity()).encode())

        def digest(parameters: Mapping[str, Parameter]) -> bytes:
            of_task = study.copy()
            of_task.update(encode(parameters).encode())
            return of_task.digest()[:16]

        return digest


@dataclass(frozen=True, slots=True)
class Task:
    """A point of a sweep: its digest as 32 hexadecimal digits, its number, and that of the part in which its row is."""

    name: str
    parameters: Mapping[str, Parameter]
    number: int = 0
    part: int = 0
