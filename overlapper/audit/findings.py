"""The faults that an audit finds in a robot, as sentences. CI fails if there are any."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from overlapper.audit.allowed import Patterns, is_allowed
from overlapper.audit.audit import Audit, PairAudit
from overlapper.audit.robot import Robot, not_modelled
from overlapper.audit.srdf import PROVED, Names

NEVER = ("Never", PROVED)


def findings(audit: Audit, expected: Sequence[Patterns], disabled: Mapping[Names, str]) -> list[str]:
    """A sentence for each link that is not modelled completely, and each faulty pair that is not `expected`.

    A pair is also faulty if a proof was asked for and leaves the pair open.

    A pair is faulty if it is not adjacent and always overlaps, or if it overlaps although an SRDF file disables it.
    `disabled` are the pairs that the file disables, with its reasons. The reason "Never" says that the pair does not
    overlap. There is also a sentence for each link that the file names and the robot does not have.
    """
    sentences = [f"Not modelled: {name}, {reason}." for name, reason in not_modelled(audit.robot).items()]
    unknown = {name for names in disabled for name in names} - set(audit.robot.link_names)
    sentences += [f"The SRDF file names the link {name!r}, which the robot does not have." for name in sorted(unknown)]
    for each in audit.pairs:
        if each.met and not is_allowed(each.names, expected):
            sentences += _wrong(each, disabled.get(frozenset(each.names)))
    return sentences + _of_proofs(audit, expected, disabled)


def _of_proofs(audit: Audit, expected: Sequence[Patterns], disabled: Mapping[Names, str]) -> list[str]:
    """A sentence for each pair that a proof leaves open, and each disabled pair that only the proof saw overlapping."""
    sentences = []
    for each in audit.pairs:
        proof = audit.proofs.get(each.pair.links)
        if proof is None or is_allowed(each.names, expected):
            continue
        names, file = " and ".join(each.names), disabled.get(frozenset(each.names))
        if proof.verdict == "open":
            seen = f"; the least distance seen is {1e3 * proof.least:.3g} mm" if proof.least is not None else ""
            why = f", because {proof.why}" if proof.why else ""
            sentences.append(f"Open: {names}, {100 * proof.open_share:.3g} % of the joint positions{why}{seen}.")
        elif proof.verdict == "overlaps" and not each.met and file is not None:
            sentences.append(
                f"{names} are disabled by the SRDF file as {file!r}, and overlap where only the proof looked."
            )
    return sentences


def _wrong(audited: PairAudit, reason: str | None) -> list[str]:
    """The sentence on a faulty pair that overlaps, or no sentence; `reason` is why a file disables the pair."""
    names, adjacent = " and ".join(audited.names), audited.pair.adjacent
    if audited.status == "always" and not adjacent and reason != "Always":
        return [f"{names} always overlap, and no joint connects them."]
    if reason in NEVER:
        return [f"{names} never overlap by the SRDF file, but overlap {_how_often(audited)}."]
    if reason is None or adjacent or audited.status == "always":
        return []
    why = f"as {reason!r}" if reason else "without a reason"
    return [f"{names} are disabled by the SRDF file {why}, and overlap {_how_often(audited)}."]


def remarks(robot: Robot) -> list[str]:
    """Sentences about how the robot was read."""
    links = [(name, link) for name, link in zip(robot.link_names, robot.tree.links)]
    lines = [f"Concave: {name} is {link.concave} convex parts." for name, link in links if link.concave]
    for kind, name in robot.unmoved:
        why = "planar joints are not moved" if kind == "planar" else "it has no limits"
        lines.append(f"The {kind} joint {name} stays at rest, because {why}.")
    return [*lines, *robot.notes]


def _how_often(audited: PairAudit) -> str:
    assert audited.deepest
    depth = 1e3 * audited.deepest.contact.depth
    return f"in {audited.met:,} of {audited.asked:,} configurations, by up to {depth:.3g} mm"
