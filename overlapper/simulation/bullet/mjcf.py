"""Reasons why pybullet's importer of MJCF makes another model of a file than MuJoCo does.

The importer knows few defaults, takes degrees for radians in files without <compiler>, and drops unknown elements. A
file is read correctly if all of its joints, shapes and bodies are as the format defines them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

from overlapper.simulation.bullet.attributes import numbers

Attributes = Mapping[str, str]

# Attributes other than `quat` that rotate a body or a geom in MuJoCo. The importer ignores them.
TURNS = ("euler", "axisangle", "xyaxes", "zaxis")
SHAPES = ("plane", "sphere", "capsule", "cylinder", "box", "mesh")
PLACED = ("size", "pos", "quat", "fromto", "mesh")  # attributes that are read from the geom alone
DROPPED = ("frame", "include", "replicate", "composite", "flexcomp", "attach")  # elements with bodies or geoms in them

TOLD = 3  # reasons in a sentence


def misread(root: Element) -> str:
    """The changes that the importer would make, as the end of a sentence; "" if there are none."""
    reasons = list(dict.fromkeys(_Reader(root).reasons()))
    more = f"; and {len(reasons) - TOLD:,} more" if len(reasons) > TOLD else ""
    return "; ".join(reasons[:TOLD]) + more


@dataclass(frozen=True, slots=True)
class _Units:
    """Whether angles are in degrees, and when a joint is limited: in MuJoCo and in the importer."""

    degrees: bool
    degrees_here: bool
    auto_limits: bool
    limited_here: str


class _Reader:
    def __init__(self, root: Element) -> None:
        self._root = root
        self._defaults: dict[str, dict[str, Attributes]] = {"main": {}}
        for each in root.findall("default"):
            self._take_defaults(each, each.get("class", "main"), {})
        compilers = root.findall("compiler")
        merged = {name: value for each in compilers for name, value in each.attrib.items()}
        limited = [each.get("limited", "") for top in root.findall("default") for each in top.findall("joint")]
        self._compiler: Attributes = merged
        self._units = _Units(
            merged.get("angle", "degree") == "degree",
            bool(compilers) and compilers[-1].get("angle", "degree") == "degree",
            merged.get("autolimits", "true") == "true",
            next(filter(None, reversed(limited)), ""),
        )

    def _take_defaults(self, element: Element, name: str, inherited: Mapping[str, Attributes]) -> None:
        own: dict[str, Attributes] = dict(inherited)
        for each in element:
            if each.tag != "default":
                own[each.tag] = {**own.get(each.tag, {}), **each.attrib}
        self._defaults[name] = own
        if "main" not in self._defaults or not self._defaults["main"]:
            self._defaults["main"] = own
        for each in element.findall("default"):
            self._take_defaults(each, each.get("class", ""), own)

    def _effective(self, element: Element, of_body: str) -> Attributes:
        """The attributes of a joint or geom in MuJoCo, defaults included."""
        name = element.get("class", of_body)
        return {**self._defaults.get(name, {}).get(element.tag, {}), **element.attrib}

    def reasons(self) -> Iterator[str]:
        if self._compiler.get("coordinate") == "global":
            yield "its coordinates are global"
        for tag in DROPPED:
            if self._root.find(f".//{tag}") is not None:
                yield f"it has <{tag}>, which is dropped"
        for world in self._root.findall("worldbody"):
            yield from self._of_body(world, world.get("childclass", "main"), "the world")

    def _of_body(self, body: Element, of_body: str, name: str) -> Iterator[str]:
        if turn := _turn(body.attrib):
            yield f"the body {name} is turned by {turn}"
        joints = [each for each in body.findall("joint") if each.get("type") != "free"]
        places = [numbers(self._effective(each, of_body).get("pos", "0 0 0")) for each in joints]
        if any(place != places[0] for place in places):
            yield f"the joints of the body {name} are in different places"
        for joint in joints:
            called = f"the joint {joint.get('name') or f'of the body {name}'}"
            yield from (f"{called} {reason}" for reason in self._of_joint(joint, self._effective(joint, of_body)))
        for geom in body.findall("geom"):
            called = f"the geom {geom.get('name')} of the body {name}" if geom.get("name") else f"a geom of {name}"
            yield from (f"{called} {reason}" for reason in self._of_geom(geom, self._effective(geom, of_body)))
        for each in body.findall("body"):
            yield from self._of_body(each, each.get("childclass", of_body), each.get("name", "without a name"))

    def _of_joint(self, joint: Element, meant: Attributes) -> Iterator[str]:
        kind = meant.get("type", "hinge")
        if joint.get("type") is None:
            yield f"has no type, and is a {kind}, which is dropped"
        elif kind not in ("hinge", "slide"):
            yield f"is a {kind}, which is dropped"
        if numbers(meant.get("axis", "0 0 1")) != numbers(joint.get("axis", "1 0 0")):
            yield "has its axis by default, which is another here"
        if numbers(meant.get("pos", "0 0 0")) != numbers(joint.get("pos", "0 0 0")):
            yield "has its place by default"
        if any(numbers(meant.get("ref", "0"))):
            yield "has a ref, which is dropped"
        yield from self._of_limits(joint, meant, kind)

    def _of_limits(self, joint: Element, meant: Attributes, kind: str) -> Iterator[str]:
        units, limited = self._units, meant.get("limited", "auto")
        is_limited = limited == "true" or (limited == "auto" and units.auto_limits and "range" in meant)
        is_here = joint.get("limited", units.limited_here) == "true"
        if is_limited != is_here:
            yield f"is limited to range {meant.get('range')!r}, which is dropped" if is_limited else "has no limits"
        elif is_limited and meant.get("range") != joint.get("range"):
            yield "has its range by default"
        elif is_limited and kind == "hinge" and units.degrees != units.degrees_here:
            yield f"has the range {meant.get('range')!r} in degrees, which are taken for radians"

    def _of_geom(self, geom: Element, meant: Attributes) -> Iterator[str]:
        kind = meant.get("type", "sphere")
        if geom.get("type") is None:
            yield f"has no type, and is a {kind}, which is dropped"
        elif kind not in SHAPES:
            yield f"is a {kind}, which is dropped"
        changed = [name for name in PLACED if meant.get(name) != geom.get(name)]
        if changed:
            yield f"has its {changed[0]} by default"
        if turn := _turn(meant):
            yield f"is turned by {turn}"
        if kind == "box" and "fromto" in meant:
            yield "is a box from one point to another"
        if kind != "mesh" and "mesh" in meant:
            yield f"is a {kind} about a mesh"
        if kind == "mesh":
            yield from self._of_mesh(meant.get("mesh", ""))

    def _of_mesh(self, name: str) -> Iterator[str]:
        named = [each for asset in self._root.findall("asset") for each in asset.findall("mesh")]
        mesh = next((each for each in named if each.get("name", Path(each.get("file", "")).stem) == name), None)
        if mesh is None:
            yield f"is of the mesh {name!r}, which is not there"
            return
        meant = self._effective(mesh, "main")
        if mesh.get("name") is None or mesh.get("file") is None:
            yield f"is of the mesh {name!r}, which has no name or no file"
        if any(value != 1.0 for value in numbers(meant.get("scale", "1 1 1"))):
            yield f"is of the mesh {name!r}, which is scaled"
        if "refpos" in meant or "refquat" in meant:
            yield f"is of the mesh {name!r}, which has a frame of its own"
        folder = self._compiler.get("meshdir", self._compiler.get("assetdir", ""))
        if folder != self._compiler.get("meshdir", "") or (folder and not folder.endswith("/")):
            yield f"is of the mesh {name!r}, which is in the folder {folder!r}"


def _turn(attributes: Attributes) -> str:
    """The attribute that rotates a body or geom and that the importer ignores; "" if there is none."""
    return next((name for name in TURNS if name in attributes and any(numbers(attributes[name])[:3])), "")
