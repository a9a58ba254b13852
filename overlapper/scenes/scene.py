"""Scenes, and how they are found by name or by path.

A scene is a Python file with a docstring that says what is hard about it, `STEPS`, and `build(client)`. `build` fills
the pybullet client and may return `step(i)`, which is called before every stepSimulation. The other arguments of
`build`, as in `build(client, *, mass=1.0, seed=0)`, are the scene's parameters. A scene may have four more names:

- `PAIRS` chooses the pairs, as in `simulation.Bodies.pairs`: "all" if a filter stops overlapping bodies from colliding.
- `CONTACT` chooses the contact forces: the name of the engine (the default), "volumetric" for
  `simulation.VolumetricContact`, or a dictionary of arguments of `VolumetricContact`, such as {"stiffness": 1e8}.
- `NAMES` is a dictionary that `build` fills with names of bodies by their numbers, as in `simulation.Bodies`.
- `ENGINE` names the simulator, "bullet" by default. With "mujoco", `build(*, mass=1.0)` returns (model, data) or
  (model, data, step).

An MJCF file, .xml, is a scene, too: one second of its model.
"""

from __future__ import annotations

import ast
import difflib
import re
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, Literal

from overlapper.printable import LONGEST, first_line
from overlapper.scenes.parameters import Parameter, described, parameters_of, values_of
from overlapper.simulation.engine import ENGINES, FILES, RETURNED

Step = Callable[[int], object]
ContactModel = Literal["bullet", "mujoco", "volumetric"]
"""The forces that push bodies apart: those of the scene's engine, or of volumetric contact."""

# The arguments that a scene may give simulation.VolumetricContact.
TOLD = frozenset({"stiffness", "dissipation", "friction", "substeps", "restitution", "rolling", "hardening"})


class SceneError(Exception):
    """A scene cannot be found, loaded or run. The message is one sentence for the author of the scene."""


@dataclass(frozen=True, slots=True)
class Scene:
    """A simulation that can be built repeatedly, with its number of steps.

    `parameters` are the arguments of `build` other than the client. `volumetric` are arguments of `VolumetricContact`.
    """

    name: str
    path: Path
    difficulty: str
    steps: int
    build: Callable[..., Step | None]
    pairs: Any = "simulated"
    names: dict[int, str] = field(default_factory=dict)
    parameters: dict[str, Parameter] = field(default_factory=dict)
    contact: ContactModel = "bullet"
    volumetric: dict[str, Any] = field(default_factory=dict)
    engine: str = "bullet"

    @property
    def expected(self) -> Path:
        """The path of its expected file, which may not exist yet."""
        return self.path.parent / "expected" / f"{self.name}.csv"

    @property
    def title(self) -> str:
        """Its name, with its parameters if it has any."""
        return f"{self.name} ({described(self.parameters)})" if self.parameters else self.name


def scene_paths() -> dict[str, Path]:
    """The scenes that can be run by name: of the folder `scenes` here, and the sample scenes with other names."""
    paths = {path.stem: path for folder in [_samples(), Path("scenes")] for path in folder.glob("[!_]*.py")}
    return dict(sorted(paths.items()))


def _samples() -> Path:
    """The folder of the sample scenes: that of a checkout, or the copy that the build puts into the wheel."""
    package = Path(__file__).parents[1]
    checkout = package.parent
    return checkout / "scenes" if (checkout / "pyproject.toml").is_file() else package / "samples/scenes"


def is_scene(path: Path) -> bool:
    """True for a Python file with a docstring, STEPS and build(client), or build() and ENGINE. The file is not run.

    A file with STEPS and build that is not valid Python counts as a scene, so that it is refused and not overlooked.
    """
    source = path.read_bytes()
    # Most files are not scenes, and need not be parsed.
    patterns = rb"^STEPS\b", rb"^def build\(\s*client\b|^ENGINE\b"
    if not all(re.search(pattern, source, re.MULTILINE) for pattern in patterns):
        return False
    try:
        module = ast.parse(source)
    except (SyntaxError, ValueError):
        return True
    # The lines that were found may be within a string.
    names = {node.name for node in module.body if isinstance(node, ast.FunctionDef)}
    for node in module.body:
        targets = getattr(node, "targets", [getattr(node, "target", None)])
        names |= {target.id for target in targets if isinstance(target, ast.Name)}
    return {"STEPS", "build"} <= names and ast.get_docstring(module) is not None


def scenes_in(path: Path) -> list[Path]:
    """The scene files in a folder and its subfolders, sorted by path; or the one file. SceneError if there is none."""
    paths = [path] if path.is_file() else sorted(filter(is_scene, path.rglob("*.py")))
    if not paths:
        raise SceneError(f"the folder {path} has no scene" if path.is_dir() else f"there is no scene file {path}")
    return paths


def headline(path: Path) -> str:
    """The first line of a scene's docstring. The scene is not run."""
    try:
        docstring = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))
    except SyntaxError:
        return "(not a Python file)"
    return (docstring or "").partition("\n")[0]


def load_scene(name_or_path: str | Path, given: Mapping[str, str] | None = None) -> Scene:
    """The scene with this name, or of this file (a path ends in .py), with the parameters `given` as text.

    SceneError says what is wrong with the scene or with a parameter.
    """
    path = find_scene(name_or_path)
    scene = scene_of(path, path.read_bytes())
    try:
        return replace(scene, parameters=values_of(given or {}, scene.parameters, scene.name))
    except ValueError as error:
        raise SceneError(str(error)) from error


def scene_of(path: Path, source: bytes) -> Scene:
    """The scene of a file with this text. SceneError says what is wrong with it."""
    if path.suffix in FILES:
        return _scene_of_model(path)
    if not re.search(rb"\bSTEPS\b|\bimport \*", source):  # not run: a script may do anything, or never end
        raise SceneError(f"{path} is not a scene, because it has no STEPS: overlapper watch {path} runs it as a script")
    module = _imported(path, source)
    steps, build = getattr(module, "STEPS", None), getattr(module, "build", None)
    if not isinstance(steps, int) or steps < 1:
        raise SceneError(f"{path} must have STEPS, the number of steps, a whole number from 1, not {steps!r}")
    if not callable(build):
        raise SceneError(f"{path} must have a function build(client)")
    pairs = getattr(module, "PAIRS", "simulated")
    if isinstance(pairs, str) and pairs not in ("simulated", "all"):
        raise SceneError(f"{path} has PAIRS = {pairs!r}, which must be 'simulated', 'all' or a list of pairs")
    named = getattr(module, "ENGINE", "bullet")
    if named not in ENGINES:
        known = ", ".join(map(repr, ENGINES))
        raise SceneError(f"{path} has ENGINE = {named!r}, which must be one of {known}")
    contact: Any = getattr(module, "CONTACT", named)
    if contact not in (named, "volumetric") and not (isinstance(contact, dict) and contact.keys() <= TOLD):
        told = f"{named!r}, 'volumetric' or a dictionary of {', '.join(sorted(TOLD))}"
        raise SceneError(f"{path} has CONTACT = {contact!r}, which must be {told}")
    volumetric: dict[str, Any] = contact if isinstance(contact, dict) else {}
    model: ContactModel = "volumetric" if isinstance(contact, dict) else contact
    names = getattr(module, "NAMES", {})
    if not isinstance(names, dict):
        raise SceneError(f"{path} has NAMES = {names!r}, which must be a dictionary of names by the numbers of bodies")
    difficulty = (module.__doc__ or "").strip()
    parameters = parameters_of(build, named not in RETURNED)
    return Scene(path.stem, path, difficulty, steps, build, pairs, names, parameters, model, volumetric, named)


def _scene_of_model(path: Path) -> Scene:
    """The scene of a model file: one second of it. SceneError if the file does not compile or its engine is missing."""
    named: Any = FILES[path.suffix]
    try:
        reader: Any = import_module(ENGINES[named])
        build, time_step = reader.build_of(path)
    except (ImportError, ValueError) as error:
        raise SceneError(f"{path} cannot be loaded: {first_line(error)}") from error
    steps = max(1, round(1 / time_step))
    return Scene(path.stem, path, f"{path.name} as it is", steps, build, contact=named, engine=named)


def engine_in(path: Path, source: bytes) -> str:
    """The engine of a scene file, by its ending or by ENGINE in its text. The text is not run."""
    if path.suffix in FILES:
        return FILES[path.suffix]
    found = re.search(rb"^ENGINE\s*=\s*[\"'](\w+)[\"']", source, re.MULTILINE)
    return found[1].decode() if found else "bullet"


def find_scene(name_or_path: str | Path) -> Path:
    """The file of the scene with this name, or the file with this path. SceneError if there is none."""
    path = Path(name_or_path)
    if path.suffix in (".py", *FILES):
        if not path.is_file():
            raise SceneError(f"there is no scene file {path}")
        return path
    name, known = str(name_or_path), scene_paths()
    if name not in known:
        nearest = difflib.get_close_matches(name, known, n=1, cutoff=0.3)
        hint = f"; the nearest is {nearest[0]!r}" if nearest else ""
        names = ", ".join(sorted(known)) or "none here: give the path of a scene file"
        raise SceneError(f"there is no scene {name!r}{hint} (known scenes: {names})")
    return known[name]


def _imported(path: Path, source: bytes) -> ModuleType:
    module = ModuleType(path.stem)
    module.__file__ = str(path)
    try:
        # No cached bytecode: Python would reuse it for another source of the same size written in the same second.
        exec(_compiled(path, source), module.__dict__)
    except Exception as error:
        raise broken(path, "cannot be loaded", error) from error
    return module


@lru_cache(maxsize=1)
def _compiled(path: Path, source: bytes) -> CodeType:
    """The code of a scene, cached for its next run: a sweep has thousands of runs."""
    return compile(source, path, "exec")


def broken(path: Path, what: str, error: Exception) -> SceneError:
    """The SceneError for an `error` that the scene file raised, with the line of the file that raised it."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if Path(frame.filename).resolve() == path.resolve()]
    reason: object = error
    if isinstance(error, SyntaxError):
        lines, reason = [error.lineno], error.msg
    where = f" at line {lines[-1]}" if lines else ""
    kind = type(error).__name__
    said = first_line(reason, LONGEST // 2)
    return SceneError(f"the scene {path} {what}{where}: {kind}" + (f": {said}" if said != kind else ""))
