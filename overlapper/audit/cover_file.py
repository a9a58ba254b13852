"""The file of the covers that prove which links never overlap. It is checked against the robot as it is read anew."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from overlapper.audit.pairs import link_pairs
from overlapper.audit.proofs import Proof
from overlapper.audit.prove import chain_between, ranges
from overlapper.audit.robot import Robot, not_modelled
from overlapper.proof.cover import check
from overlapper.proof.refusal import CertificateError
from overlapper.whole_file import beside


@dataclass(frozen=True, slots=True)
class Checked:
    """Whether the file proves that a pair of links, by its names, never overlaps.

    `open_share` is the share of the joint positions that its covers leave open, 0 if the proof holds. `wrong` says why
    a cover is refused, "" if all are right.
    """

    names: tuple[str, str]
    open_share: float
    wrong: str


def write_covers(robot: Robot, proofs: Iterable[Proof], path: Path) -> None:
    """Write the covers of all pairs that have covers as .npz. OSError if the file cannot be written."""
    arrays: dict[str, Any] = {}
    pairs = []
    for proof in proofs:
        if proof.covers:
            shapes = []
            for cover in proof.covers:
                arrays |= {f"splits{len(arrays) // 2}": cover.splits, f"axes{len(arrays) // 2}": cover.axes}
                shapes.append(list(cover.shapes))
            pairs.append({"names": list(proof.names), "shapes": shapes})
    about = np.frombuffer(json.dumps({"robot": robot.name, "pairs": pairs}).encode(), dtype=np.uint8)
    with beside(path) as made, made.open("wb") as file:
        np.savez_compressed(file, about=about, **arrays)


def verify(robot: Robot, path: Path) -> list[Checked]:
    """Check the covers of a file, for each pair of links in it. The core takes no part.

    Shapes, joints and their limits are those of `robot`. What the file says of them is not used.

    Raises
    ------
    ValueError
        If the file has no covers, or those of another robot.
    OSError
        If the file cannot be read.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = dict(file)
        about = json.loads(arrays["about"].tobytes())
        claims = [_claim(each) for each in about["pairs"]]
        name = about["robot"]
    except (ValueError, KeyError, TypeError, AttributeError, EOFError, zipfile.BadZipFile) as error:
        raise ValueError(f"{path} is not a file of covers") from error
    if name != robot.name:
        raise ValueError(f"{path} has the covers of robot {name!r}, not of {robot.name!r}")
    found, number = [], 0
    for names, shapes in claims:
        covers = {}
        for pair in shapes:
            covers[pair] = arrays.get(f"splits{number}"), arrays.get(f"axes{number}")
            number += 1
        try:
            found.append(Checked(names, _open(robot, names, covers), ""))
        except CertificateError as error:
            found.append(Checked(names, 1.0, str(error)))
    return found


def _claim(pair: Mapping[str, Any]) -> tuple[tuple[str, str], list[tuple[int, int]]]:
    """The names of two links, and the numbers of their shapes in the order of their covers."""
    first, second = map(str, pair["names"])
    return (first, second), [(int(a), int(b)) for a, b in pair["shapes"]]


def _open(robot: Robot, names: tuple[str, str], covers: Mapping[tuple[int, int], tuple[Any, Any]]) -> float:
    """The share that is open of the pair of shapes with the largest share. CertificateError if a cover is wrong."""
    pairs = {tuple(robot.link_names[link] for link in each.links): each.links for each in link_pairs(robot)}
    if names not in pairs:
        raise CertificateError("the robot has no such pair of links with shapes")
    if partial := [name for name in names if name in not_modelled(robot)]:
        raise CertificateError(f"{partial[0]} is not modelled whole")
    numbers = [[k for k, shape in enumerate(robot.tree.shapes) if shape.link == link] for link in pairs[names]]
    span, share = ranges(robot), 0.0
    for pair in product(numbers[0], numbers[1]):
        chain = chain_between(robot, *pair)
        if isinstance(chain, str):
            raise CertificateError(chain)
        splits, axes = covers.get(pair, (None, None))
        if splits is None or axes is None or splits.dtype != np.int8 or axes.dtype != np.float32:
            raise CertificateError("a pair of shapes has no cover")
        lower, upper = np.array([span[column] for column in chain.columns]).reshape(-1, 2).T
        share = max(share, check(chain, lower, upper, splits, axes))
    return share
