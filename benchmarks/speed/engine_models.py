"""Models of packages of robots and tasks: the pairs that overlap here and in MuJoCo's contacts, at random poses."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np

from overlapper.mujoco import Bodies
from overlapper.simulation.cautions import SkippedShapeWarning

PACKAGES = ("dm_control", "gymnasium", "gymnasium_robotics", "robosuite", "metaworld", "mani_skill")
POSES = 4  # the initial pose, and random ones
TURN = 0.6  # standard deviation of each joint's motion, rad or m
TOUCHING = 1e-9  # m; pairs with smaller depths are counted apart


def model_figures(package: str) -> dict[str, int] | None:
    """Counts of files, poses and pairs of one package, or None if it is not installed."""
    found = find_spec(package)
    if found is None or not found.submodule_search_locations:
        return None
    counts = dict.fromkeys(("models", "poses", "pairs", "ours", "theirs", "touching", "skipped"), 0)
    for model in models_of(Path(found.submodule_search_locations[0])):
        counts["models"] += 1
        data, chance = mujoco.MjData(model), np.random.default_rng(0)
        mujoco.mj_forward(model, data)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SkippedShapeWarning)  # `skipped` counts them
            bodies = Bodies(model, data)
        counts["skipped"] += len(bodies.skipped)
        for pose in range(POSES):
            if pose:
                mujoco.mj_resetData(model, data)
                mujoco.mj_integratePos(model, data.qpos, chance.normal(size=model.nv) * TURN, 1.0)
                mujoco.mj_forward(model, data)
            ours, theirs = depths(bodies), contact_depths(data)
            deep = {pair for pair, depth in (theirs | ours).items() if depth > TOUCHING}
            counts["poses"] += 1
            counts["pairs"] += len(ours.keys() & theirs.keys() & deep)
            counts["ours"] += len((ours.keys() - theirs.keys()) & deep)
            counts["theirs"] += len((theirs.keys() - ours.keys()) & deep)
            counts["touching"] += len((ours.keys() | theirs.keys()) - deep)
    return counts


def models_of(folder: Path) -> Iterator[mujoco.MjModel]:
    """The files that are models by themselves. Others are parts of models, or refer to files that are not there."""
    for path in sorted(folder.rglob("*.xml")):
        if "<mujoco" in path.read_text(encoding="utf-8", errors="ignore"):
            try:
                yield mujoco.MjModel.from_xml_path(str(path))
            except ValueError:
                continue


def depths(bodies: Bodies) -> dict[tuple[int, int], float]:
    """The depth of each pair of geoms that overlap, m. A height field has the largest depth of its prisms."""
    bodies.update()
    return deepest((each.geomA, each.geomB, each.overlap.depth) for each in bodies.overlaps() if each.overlap)


def contact_depths(data: mujoco.MjData) -> dict[tuple[int, int], float]:
    """The depth of the deepest contact of each pair of geoms, m, where MuJoCo's distance is negative."""
    contacts = zip(data.contact.geom.tolist(), data.contact.dist.tolist())
    return deepest((a, b, -distance) for (a, b), distance in contacts if distance < 0)


def deepest(found: Iterable[tuple[int, int, float]]) -> dict[tuple[int, int], float]:
    """The largest depth of each pair."""
    depth: dict[tuple[int, int], float] = {}
    for a, b, each in found:
        pair = min(a, b), max(a, b)
        depth[pair] = max(depth.get(pair, 0.0), each)
    return depth
