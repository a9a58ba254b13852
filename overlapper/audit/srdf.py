"""The pairs of links that a planner need not test: as SRDF, for MoveIt, or as MJCF, for MuJoCo."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from overlapper.audit.audit import Audit, PairAudit
from overlapper.audit.robot import not_modelled
from overlapper.printable import first_line
from overlapper.whole_file import beside

Names = frozenset[str]

PROVED = "Never, proved"
"""The reason of a pair that is proved never to overlap. "Never" is the reason of a pair that was only sampled."""

REASONS = frozenset({"Adjacent", "Never", PROVED, "Always", "Default"})
"""The reasons that MoveIt's assistant and `write_srdf` find out. People give others, such as "User"."""


def reason(audited: PairAudit, whole: bool, verdict: str | None = None) -> str | None:
    """Why a pair need not be tested; None if it must be. "Never" requires that both links are modelled `whole`.

    `verdict` is that of the pair's proof. A pair that overlaps by its proof alone must be tested.
    """
    if audited.pair.adjacent:
        return "Adjacent"
    if verdict == "never":
        return PROVED
    if verdict == "overlaps" and audited.status == "never":
        return None
    if audited.status == "never" and not whole:
        return None
    sometimes = "Default" if audited.at_rest else None
    return {"never": "Never", "always": "Always"}.get(audited.status, sometimes)


def write_srdf(audit: Audit, path: Path) -> None:
    """Write <disable_collisions> for each pair that is adjacent, never overlaps, or always or at rest does.

    The reason of pairs that overlap in the rest pose, but not always, is "Default", as in MoveIt. A pair with a link
    that is not modelled completely is not written as never overlapping. An existing SRDF file keeps everything else:
    groups, end effectors, comments, and pairs that it disables for a reason such as "User".

    Raises
    ------
    ValueError
        If the file exists and is not an SRDF file, or is that of another robot. It is then unchanged.
    """
    root = extended(path, audit.robot.name)
    kept = {frozenset((each.get("link1"), each.get("link2"))) for each in root.findall("disable_collisions")}
    for (first, second), why in _disabled(audit):
        if frozenset((first, second)) not in kept:
            ElementTree.SubElement(root, "disable_collisions", link1=first, link2=second, reason=why)
    _write(root, path)


def extended(path: Path, name: str) -> ElementTree.Element:
    """What `write_srdf` keeps of a file: a new <robot> if there is no file. Errors as for `write_srdf`."""
    if not path.is_file():
        return ElementTree.Element("robot", name=name)
    root = _root(path, comments=True)
    if (other := root.get("name", name)) != name:
        raise ValueError(f"{path} is the SRDF file of robot {other!r}, not of {name!r}")
    for each in root.findall("disable_collisions"):
        if each.get("reason") in REASONS:
            root.remove(each)
    return root


def write_excludes(audit: Audit, path: Path) -> None:
    """Write the same pairs as an MJCF file with an <exclude> for each, which a model may <include>."""
    root = ElementTree.Element("mujoco")
    contact = ElementTree.SubElement(root, "contact")
    for (first, second), _ in _disabled(audit):
        ElementTree.SubElement(contact, "exclude", body1=first, body2=second)
    _write(root, path)


def _disabled(audit: Audit) -> Iterator[tuple[tuple[str, str], str]]:
    """The pairs that need not be tested, by name, and why."""
    partial = not_modelled(audit.robot).keys()
    for audited in audit.pairs:
        proof = audit.proofs.get(audited.pair.links)
        if why := reason(audited, partial.isdisjoint(audited.names), proof.verdict if proof else None):
            yield audited.names, why


def _write(root: ElementTree.Element, path: Path) -> None:
    ElementTree.indent(root)
    with beside(path) as file:
        ElementTree.ElementTree(root).write(file, encoding="utf-8", xml_declaration=True)
        with file.open("a", encoding="utf-8") as end:
            end.write("\n")


def read_srdf(path: Path) -> dict[Names, str]:
    """The pairs that an SRDF file disables, with its reasons. OSError if the file is missing, ValueError if invalid."""
    root = _root(path)
    pairs = [each.attrib for each in root.findall("disable_collisions")]
    if missing := [each for each in pairs if not each.get("link1") or not each.get("link2")]:
        raise ValueError(
            f"{path} is not an SRDF file: a <disable_collisions> must name link1 and link2, not {dict(missing[0])}"
        )
    return {frozenset((each["link1"], each["link2"])): each.get("reason", "") for each in pairs}


def _root(path: Path, comments: bool = False) -> ElementTree.Element:
    """The root of an SRDF file. OSError if the file is missing, ValueError if invalid."""
    if path.exists() and not path.is_file():
        raise ValueError(f"there is no SRDF file {path}")
    try:
        parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=comments))
        root = ElementTree.parse(path, parser).getroot()
    except (ElementTree.ParseError, ValueError) as error:
        raise ValueError(f"{path} is not an SRDF file: {first_line(error)}") from error
    if root.tag != "robot":
        raise ValueError(f"{path} is not an SRDF file: its root is <{root.tag}>, not <robot>")
    return root
