"""Readable names of bodies: by file, by the name of a robot, by mesh, or by kind, colour and size of a shape."""

from __future__ import annotations

import colorsys
import re
from collections import Counter
from collections.abc import Callable, Container, Mapping, Sequence
from itertools import chain, count
from pathlib import PurePath

import numpy as np

from overlapper import Placed
from overlapper.printable import printable
from overlapper.simulation.model import Color, LinkKey, ModelledBody, ModelledShape

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


Look = tuple[str, str]
"""Colour and size in words."""

DESCRIPTIONS: tuple[Callable[[str, str, str], str], ...] = (
    lambda name, color, size: name,
    lambda name, color, size: f"{color} {name}".strip(),
    lambda name, color, size: f"{name} {size}".strip(),
    lambda name, color, size: f"{color} {name} {size}".strip(),
)


class Labels:
    """The distinct names of bodies in tables and views. A body keeps its label when other bodies come or go."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, str, Look], str] = {}
        self._looks: dict[str, set[Look]] = {}  # by name

    def of(self, bodies: Mapping[int, ModelledBody]) -> dict[int, str]:
        """The labels of bodies by number.

        If new bodies have the same name, it is preceded by their colours or followed by their sizes, if these differ.
        Names that are still not unique end in "#" and the number of the body.
        """
        keys = {id: (id, body.name, body.look) for id, body in bodies.items()}
        fresh = {id: bodies[id] for id, key in keys.items() if key not in self._known}
        taken = set(self._known.values())
        for name in dict.fromkeys(body.name for body in fresh.values()):
            looks = {id: body.look for id, body in fresh.items() if body.name == name}
            before = self._looks.setdefault(name, set())
            # The shortest of the descriptions that tell most bodies apart.
            describe = max(
                DESCRIPTIONS,
                key=lambda way: len(
                    {way(name, *each) for each in looks.values()} - {way(name, *each) for each in before}
                ),
            )
            for id, label in _distinct({id: describe(name, *each) for id, each in looks.items()}, taken).items():
                self._known[keys[id]] = label
                taken.add(label)
            before.update(looks.values())
        return {id: self._known[key] for id, key in keys.items()}


def labels(bodies: Mapping[int, ModelledBody]) -> dict[int, str]:
    """The labels of bodies that are read once."""
    return Labels().of(bodies)


def _distinct(names: Mapping[int, str], taken: Container[str] = ()) -> dict[int, str]:
    number = Counter(names.values())
    return {
        id: name if number[name] == 1 and name not in taken else _numbered(name, id, taken)
        for id, name in names.items()
    }


def _numbered(name: str, id: int, taken: Container[str]) -> str:
    numbers = chain([f"{id}"], (f"{id}.{time}" for time in count(2)))
    return next(label for each in numbers if (label := f"{name}#{each}") not in taken)


def link_names(bodies: Mapping[int, ModelledBody], labels: Mapping[int, str]) -> dict[LinkKey, str]:
    """The label of each body of one link; label and name of each other link.

    Names that are not unique in a body end in "#" and the number of the link.
    """
    return {
        (id, link): link_name(label, bodies[id].link_names, name)
        for id, label in labels.items()
        for link, name in _distinct(bodies[id].link_names).items()
    }


def link_name(body: str, links: Mapping[int, str], name: str) -> str:
    """The name of a link of a body with these links: the name of the body if it has no other link."""
    return f"{body}/{name}" if name and len(links) > 1 else body


HUES = {15: "red", 45: "orange", 70: "yellow", 165: "green", 195: "cyan", 255: "blue", 290: "purple", 345: "pink"}
"""The words for hues, by the degree at which they end."""


def look(color: Color | None, shapes: Sequence[ModelledShape]) -> Look:
    """Colour and size in words, as a reader sees them; empty words for what is not seen.

    The size is the longest side of a box around the shapes, along the axes of their link.
    """
    boxes = [np.asarray(Placed(each.shape, each.position, each.orientation).bounds) for each in shapes]
    size = float(np.ptp(np.concatenate(boxes), axis=0).max()) if boxes else np.inf
    said = "" if not np.isfinite(size) else f"{size:.3g} m" if size >= 0.01 else f"{1e3 * size:.3g} mm"
    return _color_word(color) if color else "", said


def _color_word(color: Color) -> str:
    hue, saturation, value = colorsys.rgb_to_hsv(*np.clip(color[:3], 0, 1).tolist())
    if not color[3]:
        return ""
    if value < 0.2:
        return "black"
    if saturation < 0.15:
        return "white" if value > 0.9 else "grey"
    word = next((word for end, word in HUES.items() if 360 * hue < end), "red")
    return "brown" if word == "orange" and value < 0.7 else word
