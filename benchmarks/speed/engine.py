"""MuJoCo: the time of overlaps beside mj_step, the pairs that overlap in packages' models, and depths beside ours.

    python benchmarks mujoco                 all, some minutes, then the page
    python benchmarks mujoco --cases 20      fewer poses of each pair of types
    python benchmarks mujoco --page          only the page, from the results there are

In every step mj_step and this package are called in turn, on one processor, and the time is that of the processor, so
that other processes do not count. Every volume is compared with that of a call for its pair alone: if one differs by
more than rounding, the run ends. Models of dm_control and of other packages are measured if the packages are installed.
Writes mujoco.csv to benchmarks/results/MACHINE, and the page docs/mujoco_benchmarks.md.
"""

from __future__ import annotations

import math
import os
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from importlib.util import find_spec
from itertools import combinations_with_replacement
from pathlib import Path

import mujoco
import numpy as np

from harness import results
from harness.command import Wrong
from harness.timing import Stopwatch, on_one_processor, quartiles
from overlapper import Overlaps, overlap
from overlapper.mujoco import Bodies
from overlapper.reference import Mujoco
from speed.engine_models import PACKAGES, model_figures

RESULTS = results.of_machine("mujoco.csv")
PAGE = "speed.engine_page"

COLUMNS = ("table", "row", "column", "value")
SETTLING, SAMPLES = 400, 200  # steps before and while times are taken
DIFFERENCE = 1e-9  # allowed relative difference of a volume from that of a single call; tolerance of curved shapes
SUITE = ("humanoid", "quadruped", "dog")
GRIDS = {"100 boxes": ("box",), "100 capsules": ("capsule",), "50 boxes, 50 capsules": ("box", "capsule")}
SIZES = {"box": ".08 .07 .06", "capsule": ".05 .08"}
TYPES = ("plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")


def grid(kinds: tuple[str, ...], count: int = 100) -> str:
    """Bodies that fall on a plane from a grid, each turned at random."""
    chance, side = np.random.default_rng(0), math.ceil(count ** (1 / 3))
    bodies = ""
    for k in range(count):
        at = [0.22 * (k % side), 0.22 * (k // side % side), 0.2 + 0.22 * (k // side**2)]
        kind = kinds[k % len(kinds)]
        pose = f'pos="{words(at)}" quat="{words(chance.normal(size=4))}"'
        bodies += f'<body {pose}><freejoint/><geom type="{kind}" size="{SIZES[kind]}"/></body>'
    return f'<mujoco><worldbody><geom type="plane" size="0 0 1"/>{bodies}</worldbody></mujoco>'


def words(numbers: list[float] | np.ndarray) -> str:
    return " ".join(f"{each:.6f}" for each in numbers)


def models() -> Iterator[tuple[str, mujoco.MjModel]]:
    found = find_spec("dm_control")
    if found is None or not found.submodule_search_locations:
        print("dm_control is not installed: its models are left out")
    else:
        suite = Path(found.submodule_search_locations[0], "suite")
        for name in SUITE:
            yield f"dm_control's {name}", mujoco.MjModel.from_xml_path(str(suite / f"{name}.xml"))
    for name, kinds in GRIDS.items():
        yield name, mujoco.MjModel.from_xml_string(grid(kinds))


def step_figures(name: str, model: mujoco.MjModel) -> dict[str, float]:
    """Median times, µs, and counts of a model."""
    data = mujoco.MjData(model)
    for _ in range(SETTLING):
        mujoco.mj_step(model, data)
    bodies, us = Bodies(model, data), []
    for _ in range(SAMPLES):
        watch = Stopwatch()
        watch("mj_step", mujoco.mj_step, model, data)
        watch("update", bodies.update)
        contacts = watch("overlaps", bodies.overlaps)
        bodies.update()
        watch("again", bodies.update)
        us.append(watch.take())
    check(name, contacts.overlaps, bodies)
    parts = ("mj_step", "update", "overlaps", "again")
    mj_step, update, overlaps, again = (np.array([each[part] for each in us]) for part in parts)
    ratios = (update + overlaps) / mj_step
    return {
        "geoms": len(bodies.shapes),
        "overlapping": int((contacts.overlaps.status == Overlaps.OVERLAPPING).sum()),
        "mj_step": float(np.median(mj_step)),
        "update": float(np.median(update)),
        "overlaps": float(np.median(overlaps)),
        "again": float(np.median(again)),
        **dict(zip(("ratio", "ratio_low", "ratio_high"), quartiles(ratios.tolist()))),
    }


def check(name: str, found: Overlaps, bodies: Bodies) -> None:
    """Raises Wrong if a volume is not that of a call for its pair alone."""
    placed = bodies.placed
    for (i, j), volume in zip(found.pairs.tolist(), found.volume.tolist()):
        alone = overlap(placed[i], placed[j])
        if abs(alone.volume - volume) > alone.volume_error + DIFFERENCE * alone.volume:
            raise Wrong(f"{name}: {volume!r} m³ in a step, {alone.volume!r} m³ alone")


def random_pair(kinds: tuple[str, str], seed: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Two geoms of 0.2 m to 0.8 m, at random poses that often overlap."""
    chance = np.random.default_rng(seed)
    cloud = chance.normal(size=(20, 3))
    cloud *= chance.uniform(0.1, 0.4, 3) / np.linalg.norm(cloud, axis=1)[:, None]
    made = ""
    for kind in kinds:
        form = 'mesh="cloud"' if kind == "mesh" else f'size="{words(chance.uniform(0.1, 0.4, 3))}"'
        pose = f'pos="{words(chance.uniform(-0.3, 0.3, 3))}" quat="{words(chance.normal(size=4))}"'
        geom = f'<geom type="{kind}" {form} {{}}/>'
        made += geom.format(pose) if kind == "plane" else f"<body {pose}><freejoint/>{geom.format('')}</body>"
    mesh = f'<asset><mesh name="cloud" vertex="{words(cloud.ravel())}"/></asset>' * ("mesh" in kinds)
    model = mujoco.MjModel.from_xml_string(f"<mujoco>{mesh}<worldbody>{made}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def distance_figures(kinds: tuple[str, str], cases: int) -> dict[str, float]:
    """How the depths of a pair of types differ from ours, over random poses."""
    counts = dict.fromkeys(("overlapping", "sides", "agree", "ours", "mujoco", "undecided", "shallow"), 0)
    largest = {"difference": 0.0, "relative": 0.0, "contact": 0.0}
    for seed in range(cases):
        model, data = random_pair(kinds, seed)
        bodies = Bodies(model, data)
        contacts = bodies.overlaps()
        negative = bool((data.contact.dist < 0).any())
        counts["sides"] += negative != any(contact.overlap for contact in contacts)
        for told in Mujoco().compare_contacts(bodies, contacts):
            assert told.theirs and told.theirs.signed_distance is not None and told.ours.signed_distance is not None
            difference = told.theirs.signed_distance - told.ours.signed_distance
            counts["overlapping"] += 1
            counts["agree" if told.verdict == "agree" else told.nearer or "undecided"] += 1
            counts["shallow"] += told.verdict != "agree" and difference > 0
            largest["difference"] = max(largest["difference"], abs(difference))
            largest["relative"] = max(largest["relative"], abs(difference / told.ours.signed_distance))
            if negative:
                contact = abs(float(data.contact.dist.min()) - told.ours.signed_distance)
                largest["contact"] = max(largest["contact"], contact)
    return {"cases": cases} | counts | largest


def options(parser: ArgumentParser) -> None:
    parser.add_argument("--cases", type=int, default=150, help="poses of each pair of types")


def measure(chosen: Namespace, path: Path) -> None:
    on_one_processor()
    load = f"load {os.getloadavg()[0]:.1f} at the start"
    with results.writing(path, COLUMNS, f"{results.today()}; {results.packages('mujoco', *PACKAGES)}; {load}") as write:
        for name, model in models():
            write(("steps", name, column, f"{value:.4g}") for column, value in step_figures(name, model).items())
            print(f"{name}: measured", flush=True)
        for package in PACKAGES:
            counts = model_figures(package)
            write(("models", package, column, value) for column, value in (counts or {}).items())
            print(f"{package}: {'compared' if counts else 'not installed, its models are left out'}", flush=True)
        for kinds in combinations_with_replacement(TYPES, 2):
            if kinds == ("plane", "plane"):
                continue
            figures = distance_figures(kinds, chosen.cases)
            write(("distances", "–".join(kinds), column, f"{value:.3g}") for column, value in figures.items())
            print(f"{'–'.join(kinds)}: compared", flush=True)
