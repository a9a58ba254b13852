"""The settings that all tasks of a sweep share, and the names of tasks."""

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
    """A scene as its file was read, and the settings of its runs: `steps` steps, and the arguments of `scenes.run.run`.

    The rows of every `kept`-th step are kept, or no rows if `kept` is 0. `versions` are the versions of the packages
    that measure, because other versions may give other bits.
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
        """The study of the scene file in its present state."""
        source = path.read_bytes()
        engine: Any = engine_in(path, source)
        return cls(path.stem, str(path), source, steps, contact or engine, asking, modelling, kept, origin(engine))

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of the run, by the names of the options."""
        return {"steps": self.steps, **settings_of(self.asking, self.modelling), "contact": self.contact}

    def loaded(self, parameters: Mapping[str, Parameter] | None = None) -> Scene:
        """The scene, with the given parameters or its defaults. SceneError says what is wrong with the scene.

        Its module is loaded anew, so earlier runs have no effect.
        """
        scene = scene_of(Path(self.path), self.source)
        return scene if parameters is None else replace(scene, parameters=dict(parameters))

    def frames(self, parameters: Mapping[str, Parameter]) -> Generator[Frame[AnyBodies], None, None]:
        """The frames of a run with these parameters."""
        return run(self.loaded(parameters), self.steps, self.asking, self.modelling, self.contact)

    def identity(self) -> dict[str, str]:
        """Everything that distinguishes this study from others, by name, as text."""
        told = {**self.settings, "steps kept": self.kept}
        digest = hashlib.sha256(self.source).hexdigest()
        return {"scene": self.scene, "scene file": digest} | {k: str(v) for k, v in told.items()} | dict(self.versions)

    def digests(self) -> Callable[[Mapping[str, Parameter]], bytes]:
        """The function that digests parameters to 16 bytes. Any change of study or parameters changes the digest."""
        encode = json.JSONEncoder(sort_keys=True).encode
        study = hashlib.sha256(encode(self.identity()).encode())

        def digest(parameters: Mapping[str, Parameter]) -> bytes:
            of_task = study.copy()
            of_task.update(encode(parameters).encode())
            return of_task.digest()[:16]

        return digest


@dataclass(frozen=True, slots=True)
class Task:
    """A point of a sweep: its digest as 32 hexadecimal digits, its number, and the number of the part with its row."""

    name: str
    parameters: Mapping[str, Parameter]
    number: int = 0
    part: int = 0
