"""The text of a URDF, SDF or MJCF file: the files and shapes that it names, and what pybullet would misread.

The text is read in a separate process, as pybullet reads the file there (`overlapper.simulation.bullet.model_file`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from overlapper.printable import first_line, printable
from overlapper.simulation.bullet.attributes import numbers
from overlapper.simulation.bullet.mjcf import misread
from overlapper.simulation.bullet.model_file import NotRead

# Attributes of URDF joints and collision shapes that are numbers, by element.
NUMBERS = {
    "origin": ("xyz", "rpy"),
    "axis": ("xyz",),
    "limit": ("lower", "upper"),
    "mimic": ("multiplier", "offset"),
    "box": ("size",),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "mesh": ("scale",),
}
BOUNDED = ("revolute", "prismatic")

LINE = 8191  # bytes: pybullet breaks longer lines here, even within a number

NO_NUMBER = re.compile(rb"^v[ \t][^\n]*\b(?:nan|inf)", re.IGNORECASE | re.MULTILINE)
LIBRARY = re.compile(rb"^mtllib[ \t]+([^\r\n]+)", re.MULTILINE)


def root_of(path: Path) -> Element:
    """The root of a model. NotRead if it has none.

    Text after the end of a URDF is ignored, as pybullet ignores it.
    """
    text, end = path.read_bytes(), b"</robot>"
    urdf = path.suffix.lower() == ".urdf" and end in text
    try:
        return ElementTree.fromstring(text[: text.index(end) + len(end)] if urdf else text)
    except (ElementTree.ParseError, ValueError, LookupError) as error:  # pybullet may accept it
        raise NotRead(f"it is not XML: {first_line(error)}") from error


def _must_not_be_broken(text: bytes) -> None:
    """NotRead if pybullet breaks a line within a word or a number."""
    for line in text.split(b"\n"):
        for place in range(LINE, len(line), LINE):
            around = line[place - 1 : place + 1]
            if not (around[:1] == b">" or around[1:] == b"<" or any(byte in b" \t\r" for byte in around)):
                raise NotRead(f"pybullet breaks lines after {LINE:,} bytes, which would break a word or a number")


def must_be_sound(path: Path, root: Element) -> None:
    """NotRead if pybullet would make another model of the file, or if the model names a pipe as a mesh.

    Lines of any file may be broken. A URDF may have joints or shapes with numbers that are not finite. An SDF may
    include other files. An MJCF file may have elements that the importer changes.
    """
    _must_not_be_broken(path.read_bytes())
    must_name_files(path, root)
    ending = path.suffix.lower()
    if ending == ".xml" and (changed := misread(root)):
        raise NotRead(f"pybullet would read the MJCF file wrongly: {changed}")
    if ending == ".sdf" and (included := root.find(".//include")) is not None:
        what = (included.findtext("uri") or "another file").strip()
        raise NotRead(f"it has <include> of {printable(what)}, which pybullet drops")
    if ending == ".urdf":
        must_have_finite_numbers(root)


def must_name_files(path: Path, root: Element) -> None:
    """NotRead if the model names a pipe, a device or a folder as a mesh or a picture."""
    for name in named_files(root):
        _must_be_a_file(path, name)


def must_have_finite_numbers(root: Element) -> None:
    """NotRead if a joint or a collision shape of a URDF has a number that is not finite, or an axis of length 0."""
    for joint in root.findall("joint"):
        _must_have_numbers(f"the joint {joint.get('name')!r}", joint, _checked(joint))
    for link in root.findall("link"):
        for collision in link.findall("collision"):
            parts = {part.tag for part in collision.iter()} & NUMBERS.keys()
            _must_have_numbers(f"a collision shape of the link {link.get('name')!r}", collision, parts)


def named_files(root: Element) -> Iterator[str]:
    """The meshes and pictures that a model names."""
    folders = [folder for each in root.iter("compiler") if (folder := each.get("meshdir"))]
    for each in root.iter():
        named = [each.get("filename"), each.get("file")] if each.tag in ("mesh", "texture") else []
        named += [each.text.strip()] if each.tag == "uri" and each.text else []
        for name in filter(None, named):
            yield from (name, *(f"{folder}/{name}" for folder in folders))


def _must_be_a_file(model: Path, name: str) -> None:
    """NotRead if pybullet would open something other than a file: a pipe may never end, and a folder crashes it."""
    file = found(model, name)
    if file is None:
        return
    if not file.is_file():
        raise NotRead(f"it names {name!r}, which is a pipe, a device or a folder, not a file")
    if file.suffix.lower() == ".obj":
        text = file.read_bytes()
        if NO_NUMBER.search(text):
            raise NotRead(f"it names {name!r}, which has vertices that are not numbers")
        for each in LIBRARY.findall(text):
            library = file.parent / each.decode(errors="replace").strip()
            if library.exists() and not library.is_file():
                raise NotRead(f"it names {name!r}, and that file names {library.name!r}, which is not a file")


def found(model: Path, name: str) -> Path | None:
    """The first existing path among the places where pybullet looks for a name in a model."""
    name = re.sub("^((package|model):/*|file://)", "", name)
    try:
        return next(
            (folder / name for folder in (*model.parents, Path(".."), Path("../..")) if (folder / name).exists()), None
        )
    except (OSError, ValueError):  # a name that is too long, or has a zero
        return None


def _checked(joint: Element) -> set[str]:
    """The elements of a joint whose numbers are used."""
    tags = {"origin", "mimic"}
    if joint.get("type") != "fixed":
        tags.add("axis")
    if joint.get("type") in BOUNDED:
        tags.add("limit")
    return tags


def _must_have_numbers(owner: str, element: Element, tags: set[str]) -> None:
    for part in (part for part in element.iter() if part.tag in tags):
        for name in NUMBERS[part.tag]:
            text = part.get(name)
            if text is None:
                continue
            values = numbers(text)
            if not all(isinstance(value, float) and math.isfinite(value) for value in values):
                raise NotRead(f"{owner} has <{part.tag} {name}={text!r}>, which is not a number")
            if part.tag == "axis" and not any(values):
                raise NotRead(f"{owner} has the axis {text!r}, which has no direction")


def named_shapes(path: Path, root: Element) -> dict[str, list[list[str]]]:
    """The collision shapes that a model names, by name of the link. A shape is given by its mesh, or else by its kind.

    Links with equal names are in the order of the file. MJCF bodies without a name are called "".
    """
    mjcf = path.suffix.lower() == ".xml"
    found: dict[str, list[list[str]]] = {}
    if mjcf:
        files = {str(each.get("name")): str(each.get("file")) for each in root.iter("mesh") if each.get("file")}
        for world in root.findall("worldbody"):
            for geom in world.findall("geom"):
                found.setdefault(geom.get("name", "anonymous"), []).append([_geom(geom, files)])
            for body in world.iter("body"):
                found.setdefault(body.get("name", ""), []).append([_geom(geom, files) for geom in body.findall("geom")])
        return found
    for link in root.iter("link"):
        shapes = [_geometry(collision) for collision in link.findall("collision")]
        found.setdefault(link.get("name", ""), []).append(shapes)
    return found


def _geom(geom: Element, files: dict[str, str]) -> str:
    return files.get(geom.get("mesh", ""), geom.get("type", "geom without a type"))


def _geometry(collision: Element) -> str:
    geometry = collision.find("geometry")
    shape = next(iter(geometry), None) if geometry is not None else None
    if shape is None:
        return "nothing"
    return shape.get("filename") or shape.findtext("uri") or shape.tag
