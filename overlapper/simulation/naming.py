"""Readable names of bodies: by file, by the name of a robot, or by mesh or kind of shape."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import PurePath

import numpy as np

from overlapper.printable import printable
from overlapper.simulation.model import LinkKey, ModelledBody

ENDINGS = (".urdf", ".sdf", ".xml", ".obj", ".stl", ".dae")

# Words in names of many robots, files and meshes, written by exporters and templates. They do not identify a body.
EMPTY = {"base", "body", "collision", "cube", "description", "dump", "dumpurdf", "link", "main", "mesh", "model", "obj"}
EMPTY |= {"object", "part", "physics", "robot", "scene", "sdf", "untitled", "urdf", "visual", "world", "xml"}
IN_FILE_NAMES = EMPTY - {"cube"}  # many copied robots are called "cube"; a file is called so only if it has a cube
# Words that are left out at the end of a name: duck_vhacd becomes duck.
OF_TOOLS = {"coacd", "description", "textured", "urdf", "vhacd"}


def body_name(own: str, file: str | None, alone: bool, meshes: Sequence[str], kind: str | None) -> str:
    """The most informative name of a body, or an empty one.

    `own` is the simulator's name of the body. `file` is the file that it was loaded from, `alone` or with others.
    `meshes` are the mesh files of a body of one link. `kind` is the kind of its only shape.
    """
    stem, folder = (PurePath(file).stem, PurePath(file).parent.name) if file else ("", "")
    named_after_a_file = own.lower().endswith(ENDINGS)
    plain = PurePath(own.replace("\\", "/")).stem if named_after_a_file else own
    of_file = [name for name in (stem, folder) if _says_something(name, IN_FILE_NAMES)]
    # Bodies of the same file differ only in their own names.
    own_says = _says_something(plain, EMPTY) and not (named_after_a_file and alone)
    candidates = [plain] if own_says else []
    if alone and of_file[:1] == [stem]:
        candidates = of_file[:1] + candidates
    candidates += of_file
    candidates += [name for name in (PurePath(mesh).stem for mesh in meshes) if _says_something(name, IN_FILE_NAMES)]
    candidates += [name for name in (plain, kind, stem) if name]
    return printable(_without_words_of_tools(candidates[0])) if candidates else ""


def _says_something(name: str, empty: set[str]) -> bool:
    """Whether the name has a word that is not in `empty`, and does not begin with "model"."""
    words = [word.strip("0123456789") or word for word in re.findall(r"[^\W_]+", name.lower())]
    said = [word for word in words if word not in empty and len(word) > 1 and not word.isdigit()]
    return bool(said) and words[0] != "model"


def _without_words_of_tools(name: str) -> str:
    first, *rest = name.split("_")
    while rest and rest[-1].lower() in OF_TOOLS:
        rest.pop()
    return "_".join([first, *rest])


def named(names: Mapping[int, str] | None) -> dict[int, str]:
    """The names given to bodies by their numbers, made printable. ValueError for an invalid name."""
    wanted = "names must be a dictionary of names by the numbers of bodies, such as {3: 'duck'}, not "
    if not isinstance(names or {}, Mapping):
        raise ValueError(f"{wanted}{names!r}")
    for body, name in (names or {}).items():
        if not (isinstance(body, int | np.integer) and isinstance(name, str) and name.strip()):
            raise ValueError(f"{wanted}{body!r}: {name!r}")
    return {int(body): printable(name) for body, name in (names or {}).items()}


def labels(bodies: Mapping[int, ModelledBody]) -> dict[int, str]:
    """The names of bodies. Names that are not unique end in "#" and the number of the body."""
    return _distinct({id: body.name for id, body in bodies.items()})


def link_names(bodies: Mapping[int, ModelledBody]) -> dict[LinkKey, str]:
    """Label and name of each link. Names that are not unique in a body end in "#" and the number of the link."""
    return {
        (id, link): f"{label}/{name}" if name else label
        for id, label in labels(bodies).items()
        for link, name in _distinct(bodies[id].link_names).items()
    }


def _distinct(names: Mapping[int, str]) -> dict[int, str]:
    number = Counter(names.values())
    return {id: name if number[name] == 1 else f"{name}#{id}" for id, name in names.items()}
