"""The faults that an audit finds in a robot, in sentences. CI fails if there are any."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from overlapper.audit.allowed import Patterns, is_allowed
from overlapper.audit.audit import Audit, PairAudit
from overlapper.audit.robot import Robot
from overlapper.audit.srdf import Names


def findings(audit: Audit, expected: Sequence[Patterns], disabled: Mapping[Names, str]) -> list[str]:
    """A sentence for each pair that is not adjacent, nor `expected`, and overlaps always, or though it is said not to.

    `disabled` are the pairs that an SRDF file disables, with its reasons: "Never" is a pair that does not overlap. Also
    a sentence for each link that the file names and the robot does not have.
    """
    unknown = {name for names in disabled for name in names} - set(audit.robot.link_names)
    sentences = [f"The SRDF file names the link {name!r}, which the robot does not have." for name in sorted(unknown)]
    for each in audit.pairs:
        if not each.met or is_allowed(each.names, expected):
            continue
        names = " and ".join(each.names)
        if each.status == "always" and not each.pair.adjacent and disabled.get(frozenset(each.names)) != "Always":
            sentences.append(f"{names} always overlap, and no joint ties them.")
        elif disabled.get(frozenset(each.names)) == "Never":
            sentences.append(f"{names} never overlap by the SRDF file, and do {_how_often(each)}.")
    return sentences


def remarks(robot: Robot) -> list[str]:
    """Sentences about how the robot was read."""
    links = [(name, link) for name, link in zip(robot.link_names, robot.tree.links)]
    lines = [f"Concave: {name} is {link.concave} convex parts." for name, link in links if link.concave]
    lines += [f"Not modelled: {name}, {link.skipped}." for name, link in links if link.skipped]
    for kind, name in robot.unmoved:
        why = "pybullet does not move it" if kind == "planar" else "it has no limits"
        lines.append(f"The {kind} joint {name} stays where it is, as {why}.")
    return lines


def _how_often(audited: PairAudit) -> str:
    assert audited.largest
    return f"in {audited.met:,} of {audited.asked:,} configurations, at first in number {audited.largest.number:,}"
