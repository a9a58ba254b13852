"""Where the time of a step goes: piles of 50 to 5,000 boxes, beside pybullet's own step and its contact points.

    python benchmarks/scene_steps.py                 all piles, some minutes, then the page and its picture
    python benchmarks/scene_steps.py --boxes 200     this pile alone
    python benchmarks/scene_steps.py --page          only the page, from the results there are

In every step pybullet and this package are asked in turn, on one processor, and the time is that of the processor, so
that what else the machine does counts for nobody. Every volume is compared with that of a call for its pair alone: if
one bit differs, nothing is written. Writes steps.csv, a line per pile and part, to benchmarks/results/MACHINE, and the
page steps.md with steps.png and steps.svg to docs.
"""

from __future__ import annotations

import argparse
import csv
import math
import os
import platform
import random
import re
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from statistics import median, quantiles
from string import Template
from typing import Any

import numpy as np
import pybullet as p
import pybullet_data

from overlapper import Batch, overlap
from overlapper.simulation import Bodies

ROOT = Path(__file__).resolve().parents[1]

PILES = (50, 100, 200, 500, 1000, 2000, 5000)
KINDS = ("jenga/jenga.urdf", "block.urdf", "domino/domino.urdf", "cube_small.urdf", "lego/lego.urdf")
LAYERS = 8  # so that piles of any size are as deep, and a box has as many neighbours
SETTLING = 120  # steps until the boxes lie on each other
SAMPLES = (8, 60)  # the fewest and the most of a pile
COLUMNS = ("boxes", "part", "us", "us_low", "us_high", "samples")

# The parts of a step in the order in which they come, and what they are called in the picture.
PARTS = {
    "reading": "poses asked of pybullet",
    "placing": "bodies noticed, shapes placed",
    "culling": "pairs whose boxes meet, and may collide",
    "geometry": "volume, centroid, normal, depth, gradient",
    "hand-over": "arrays handed over",
}
COLOURS = dict(zip(PARTS, ("#9ecae1", "#4292c6", "#fdae6b", "#d1001f", "#8c6bb1")))
MEASURES = ("volume", "volume_error", "centroid", "normal", "depth", "gradient")


def fill(client: int, boxes: int) -> None:
    """The pile of the scene box_pile, as wide as it takes, between walls."""
    chance = random.Random(boxes)
    p.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=client)
    p.setGravity(0, 0, -9.81, physicsClientId=client)
    p.loadURDF("plane.urdf", physicsClientId=client)
    side = math.ceil(math.sqrt(boxes / LAYERS))
    half = 0.085 * side / 2 + 0.05
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        extents = [0.05 if x else half + 0.1, 0.05 if y else half + 0.1, 0.3]
        wall = p.createCollisionShape(p.GEOM_BOX, halfExtents=extents, physicsClientId=client)
        p.createMultiBody(0, wall, basePosition=[x * (half + 0.05), y * (half + 0.05), 0.3], physicsClientId=client)
    for k in range(boxes):
        layer, row, column = k // side**2, k // side % side - (side - 1) / 2, k % side - (side - 1) / 2
        p.loadURDF(
            chance.choice(KINDS),
            [0.085 * row, 0.085 * column, 0.1 + 0.07 * layer],
            p.getQuaternionFromEuler([chance.uniform(-3, 3) for _ in range(3)]),
            physicsClientId=client,
        )


class Steps:
    """The steps of one pile, and how long each part of them took."""

    def __init__(self, boxes: int) -> None:
        self.boxes = boxes
        self.client = p.connect(p.DIRECT)
        fill(self.client, boxes)
        for _ in range(SETTLING):
            p.stepSimulation(self.client)
        self.bodies = Bodies(self.client)
        self.batches = {kind: Batch(self.bodies.shapes) for kind in ("overlaps", "does not")}
        self.us: dict[str, list[float]] = {}
        self.counts: dict[str, int] = {}

    def timed(self, part: str, call: Callable[[], Any]) -> Any:
        begin = time.process_time()
        answer = call()
        self.us.setdefault(part, []).append(1e6 * (time.process_time() - begin))
        return answer

    def take(self) -> None:
        """One step."""
        client, bodies = self.client, self.bodies
        self.timed("stepSimulation", lambda: p.stepSimulation(client))
        points = self.timed("getContactPoints", lambda: p.getContactPoints(physicsClientId=client))
        self.timed("update", bodies.update)
        pairs = self.timed("culling", lambda: bodies.pairs())
        contacts = self.timed("overlaps", lambda: bodies.overlaps())
        found = contacts.overlaps
        self.timed("hand-over", lambda: [getattr(found, name) for name in MEASURES])
        # What overlaps() has done again, now that the boxes are laid around the shapes.
        self.timed("culling again", lambda: bodies.pairs())
        ids = list(range(self.boxes + 5))
        self.timed("reading", lambda: [p.getBasePositionAndOrientation(id, client) for id in ids])
        last = {part: values[-1] for part, values in self.us.items()}
        geometry = last["overlaps"] - last["culling again"]
        derived = {
            "placing": last["update"] - last["reading"],
            "geometry": geometry,
            "ours": last["update"] + last["culling"] + geometry + last["hand-over"],
        }
        for part, value in derived.items():
            self.us.setdefault(part, []).append(value)
        self.take_kinds(pairs, found.pairs)
        self.counts = {
            "pairs examined": len(pairs),
            "pairs overlapping": int((found.volume > 0).sum()),
            "pairs widened": int(found.widened.sum()),
            "contact points": len(points),
        }

    def take_kinds(self, pairs: np.ndarray, overlapping: np.ndarray) -> None:
        """The geometry of a pair that overlaps, and of one that does not, the shapes being placed before."""
        placed, number = self.bodies.placed, np.array([len(self.bodies.placed), 1])
        poses = np.array([body.position for body in placed]), np.array([body.orientation for body in placed])
        apart = pairs[~np.isin(pairs @ number, overlapping @ number)]
        for kind, those in (("overlaps", overlapping), ("does not", apart)):
            batch = self.batches[kind]
            batch.candidate_pairs(*poses)
            begin = time.process_time()
            batch.overlaps(*poses, those)
            if len(those):
                self.us.setdefault(f"a pair that {kind}", []).append(1e6 * (time.process_time() - begin) / len(those))

    def check(self) -> None:
        """Raises ArithmeticError if a volume is not that of a call for its pair alone."""
        contacts, placed = self.bodies.overlaps(), self.bodies.placed
        for (i, j), volume in zip(contacts.overlaps.pairs.tolist(), contacts.overlaps.volume.tolist()):
            alone = overlap(placed[i], placed[j]).volume
            if alone != volume:
                raise ArithmeticError(f"pile of {self.boxes}: {volume!r} in a step, {alone!r} alone")

    def rows(self) -> Iterator[dict[str, object]]:
        for part, values in self.us.items():
            low, _, high = quantiles(values, n=4, method="inclusive")
            figures = (median(values), low, high)
            yield dict(zip(COLUMNS, (self.boxes, part, *(f"{each:.4g}" for each in figures), len(values))))
        for name, count in self.counts.items():
            yield dict(zip(COLUMNS, (self.boxes, name, count, "", "", 1)))


def measure(piles: Sequence[int], path: Path) -> None:
    """Writes each pile as soon as it is measured."""
    on_one_processor()
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        file.write(f"# {machine()}; {time.strftime('%Y-%m-%d')}; Python {platform.python_version()}\n")
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        for boxes in piles:
            steps = Steps(boxes)
            try:
                # The caches of processor and pairs are warm after the first.
                steps.take()
                steps.us.clear()
                for _ in range(max(SAMPLES[0], min(SAMPLES[1], 20000 // boxes))):
                    steps.take()
                steps.check()
                writer.writerows(steps.rows())
                file.flush()
            finally:
                p.disconnect(steps.client)
            print(summary(steps), flush=True)


def on_one_processor() -> None:
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def summary(steps: Steps) -> str:
    us = {part: median(values) for part, values in steps.us.items()}
    parts = ", ".join(f"{part} {us[part]:,.0f}" for part in PARTS)
    whole = ", ".join(f"{part} {us[part]:,.0f} µs" for part in ("getContactPoints", "stepSimulation"))
    pairs = f"{steps.counts['pairs overlapping']:,} of {steps.counts['pairs examined']:,} pairs overlap"
    return f"{steps.boxes:,} boxes: ours {us['ours']:,.0f} µs ({parts}), {whole}; {pairs}"


def machine() -> str:
    """The processor by its name, and how many there are."""
    listed = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text(encoding="utf-8"))
    return f"{listed[1].strip() if listed else platform.machine()}, {os.cpu_count()} cores"


def results_path() -> Path:
    folder = re.sub(r"[^a-z0-9]+", "-", machine().lower()).strip("-")
    return ROOT / "benchmarks" / "results" / folder / "steps.csv"


def read(path: Path) -> dict[str, dict[int, float]]:
    """Median µs, or counts, by part and number of boxes."""
    with path.open(newline="", encoding="utf-8") as file:
        table = csv.DictReader(line for line in file if not line.startswith("#"))
        found: dict[str, dict[int, float]] = {}
        for row in table:
            found.setdefault(row["part"], {})[int(row["boxes"])] = float(row["us"])
    return found


def draw(path: Path, folder: Path) -> Path:
    """The chart of a results file, as steps.png and steps.svg in the folder."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    plt.rcParams.update({"font.size": 9, "svg.fonttype": "none", "svg.hashsalt": "overlapper"})
    us = read(path)
    piles = sorted(us["ours"])
    figure, (each, whole) = plt.subplots(1, 2, figsize=(10.8, 4.4), gridspec_kw={"width_ratios": [1.35, 1]})

    bottom = np.zeros(len(piles))
    places = np.arange(len(piles))
    for part, words in PARTS.items():
        heights = np.array([max(0.0, us[part][boxes]) / boxes for boxes in piles])
        each.bar(places, heights, 0.62, bottom=bottom, color=COLOURS[part], label=words, zorder=2)
        bottom += heights
    lines = {"getContactPoints": ("#222222", "-", 1), "stepSimulation": ("#222222", ":", 10)}
    for part, (colour, dashes, divisor) in lines.items():
        words = f"pybullet's {part}()" + (", a tenth" if divisor > 1 else "")
        heights = [us[part][boxes] / boxes / divisor for boxes in piles]
        each.plot(places, heights, dashes, color=colour, marker=".", label=words, zorder=3)
    each.set_xticks(places, [f"{boxes:,}" for boxes in piles])
    each.set(xlabel="boxes in the pile", ylabel="µs of a step, per box", title="Where the time of a step goes")
    each.set_ylim(0, 1.45 * max(bottom.max(), *(us["getContactPoints"][boxes] / boxes for boxes in piles)))
    each.legend(frameon=False, fontsize=7.2, ncols=2, columnspacing=1, loc="upper left")

    for part, words, colour, dashes in (
        ("stepSimulation", "stepSimulation()", "#222222", ":"),
        ("getContactPoints", "getContactPoints()", "#222222", "-"),
        ("ours", "update() and overlaps()", "#d1001f", "-"),
    ):
        whole.plot(piles, [us[part][boxes] / 1e3 for boxes in piles], dashes, color=colour, marker=".", label=words)
    whole.set(xscale="log", yscale="log", xlabel="boxes in the pile", ylabel="ms of a step", title="The whole")
    whole.set_xticks(piles, [f"{boxes:,}" for boxes in piles])
    whole.minorticks_off()
    whole.legend(frameon=False, fontsize=8)
    for ax in (each, whole):
        ax.grid(color="#e3e3e3", lw=0.5)
        ax.set_axisbelow(True)
        ax.spines[["top", "right"]].set_visible(False)
        ax.title.set(fontsize=10, fontweight="bold", ha="left", x=0)
    figure.tight_layout()
    picture = folder / "steps.png"
    figure.savefig(picture, dpi=130)
    figure.savefig(picture.with_suffix(".svg"), metadata={"Date": None})
    plt.close(figure)
    return picture


def write_page(path: Path, folder: Path) -> Path:
    """The page about a results file, steps.md, with its chart."""
    us = read(path)
    piles = sorted(us["ours"])
    rows = []
    for boxes in piles:
        whole = [us[part][boxes] for part in ("ours", "getContactPoints", "stepSimulation")]
        parts = [f"{us[part][boxes] / boxes:.2f}" for part in PARTS]
        rows.append([f"{boxes:,}", f"{us['pairs overlapping'][boxes]:,.0f}", *parts, *map(duration, whole)])
    heading = ["boxes", "pairs", "poses asked, µs per box", "placing", "culling", "geometry", "hand-over"]
    heading += ["all of ours", "`getContactPoints`", "`stepSimulation`"]
    lines = [f"| {' | '.join(row)} |" for row in [heading, ["--:"] * len(heading), *rows]]
    at = 200 if 200 in piles else piles[0]
    words = Template((Path(__file__).parent / "steps_page.md").read_text(encoding="utf-8")).substitute(
        results=path.relative_to(ROOT) if path.is_relative_to(ROOT) else path,
        piles=f"{piles[0]:,} to {piles[-1]:,}",
        table="\n".join(lines),
        widened=f"{100 * us['pairs widened'][at] / us['pairs overlapping'][at]:.0f}",
        overlapping=f"{us['pairs overlapping'][at]:,.0f}",
        apart=f"{us['pairs examined'][at] - us['pairs overlapping'][at]:,.0f}",
        a_pair=f"{us['a pair that overlaps'][at]:.2g} µs",
        a_pair_apart=f"{us['a pair that does not'][at]:.2g} µs",
        poses=f"{us['reading'][at] / us['getContactPoints'][at]:.2g}",
        against_contacts=f"{us['ours'][at] / us['getContactPoints'][at]:.2g}",
        against_step=f"{us['ours'][at] / us['stepSimulation'][at]:.2g}",
    )
    draw(path, folder)
    page = folder / "steps.md"
    page.write_text(words, encoding="utf-8")
    return page


def duration(us: float) -> str:
    for unit, size in (("s", 1e6), ("ms", 1e3)):
        if us >= size:
            return f"{us / size:.3g} {unit}"
    return f"{us:.3g} µs"


def main() -> None:
    parser = argparse.ArgumentParser(description="Where the time of a step goes, beside pybullet's own step.")
    parser.add_argument("--boxes", type=int, action="append", help="a pile of so many; may be repeated")
    parser.add_argument("--out", type=Path, help="folder for results and page, by default those of the checkout")
    parser.add_argument("--page", action="store_true", help="only write the page, from the results there are")
    chosen = parser.parse_args()
    path = chosen.out / "steps.csv" if chosen.out else results_path()
    if not chosen.page:
        try:
            measure(chosen.boxes or PILES, path)
        except ArithmeticError as wrong:
            sys.exit(f"overlapper: wrong: {wrong}")
    print(f"Written: {path}, {write_page(path, chosen.out or ROOT / 'docs')}")


if __name__ == "__main__":
    main()
