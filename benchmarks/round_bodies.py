"""What round bodies cost beside two boxes: every class of pairs, cold single calls and batches, margins, and scenes.

    python benchmarks/round_bodies.py              all again, two or three minutes, then the page and its picture
    python benchmarks/round_bodies.py --pairs 50   fewer pairs of a class, sooner and less surely
    python benchmarks/round_bodies.py --page       only the page, from the results there are

Classes take turns, in several rounds of one run on one processor, and in a round each pair of a class is asked once, so
that nothing is known of it; its time is the median of the rounds. Volumes of batches are compared with those of single
calls: if one bit differs, nothing is written. Writes round.csv, a line per figure, to benchmarks/results/MACHINE, and
the page round.md with round.png and round.svg to docs.
"""

from __future__ import annotations

import argparse
import csv
import platform
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import combinations_with_replacement, cycle
from pathlib import Path
from statistics import mean, median
from string import Template
from textwrap import fill
from typing import Any

import numpy as np
import pybullet as p
import pybullet_data
from scene_steps import duration, machine, on_one_processor, results_path

from overlapper import (
    Batch,
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Overlaps,
    Placed,
    RoundedHull,
    Shape,
    Sphere,
    overlap,
)
from overlapper.scenes.scene import load_scene
from overlapper.simulation import Bodies, SkippedShapeWarning

ROOT = Path(__file__).resolve().parents[1]

PAIRS, ROUNDS = 200, 5  # of each class, and how often each pair is asked
ENCLOSED = 4  # a pair that is enclosed by planes takes milliseconds: of such classes, so many times fewer
MARGIN = 1e-3  # m, what Bullet adds around convex meshes

# Of what is measured, the most that was aimed at: times two boxes, times a single call, times the nominal self, ms.
MEDIAN, TAIL, BATCH, WITH_MARGIN = 10, 40, 1.5, 3

MEASURES = (
    "volume", "volume_error", "centroid", "area", "normal", "depth", "gradient", "patch_area", "patch_centre",
    "patch_moments", "patch_distance",
)  # fmt: skip
COLUMNS = ("part", "name", "figure", "value")


def points(rng: np.random.Generator, count: int) -> np.ndarray:
    """On an ellipsoid, so that all are corners."""
    rows = rng.normal(size=(count, 3))
    return rows / np.linalg.norm(rows, axis=1)[:, None] * rng.uniform(0.3, 0.6, 3)


SHAPES: dict[str, Callable[[np.random.Generator], Shape]] = {
    "box": lambda rng: Box(rng.uniform(0.25, 0.5, 3)),
    "hull": lambda rng: Hull(points(rng, 20)),
    "half-space": lambda rng: HalfSpace([0, 0, 1], 0),
    "ball": lambda rng: Sphere(rng.uniform(0.3, 0.6)),
    "capsule": lambda rng: Capsule(rng.uniform(0.2, 0.4), rng.uniform(0.4, 1.0)),
    "cylinder": lambda rng: Cylinder(rng.uniform(0.2, 0.5), rng.uniform(0.4, 1.0)),
    "ellipsoid": lambda rng: Ellipsoid(rng.uniform(0.2, 0.6, 3)),
    "rounded hull": lambda rng: RoundedHull(points(rng, 20), rng.uniform(0.02, 0.1)),
    "mesh with margin": lambda rng: RoundedHull(points(rng, 60), MARGIN),
}
POLYHEDRA = ("box", "hull", "half-space")
BOXES = "box, box"
CLASSES = [
    pair for pair in combinations_with_replacement(SHAPES, 2) if pair != ("half-space", "half-space")
]  # what is common to two half-spaces is unbounded


@dataclass
class Class:
    """Pairs of two kinds of shapes that overlap, and how long each of them took."""

    name: str
    pairs: list[tuple[Placed, Placed]]
    ways: Counter[str]
    us: list[float]

    def figures(self) -> Iterator[tuple[str, float]]:
        yield "median", median(self.us)
        yield "mean", mean(self.us)
        yield "99 %", float(np.quantile(self.us, 0.99))
        for way, count in self.ways.most_common():
            yield way, 100 * count / len(self.pairs)


def made(rng: np.random.Generator, kinds: tuple[str, str], count: int) -> Class:
    """At random poses; half of the pairs as they come, half pulled apart until they share 10 to the -1 ... -6 m."""
    pairs: list[tuple[Placed, Placed]] = []
    while len(pairs) < count:
        shapes = [SHAPES[kind](rng) for kind in kinds]
        at = rng.normal(size=3) * 0.4
        a, b = Placed(shapes[0], at, rng.normal(size=4)), Placed(shapes[1], (0, 0, 0), rng.normal(size=4))
        found = overlap(a, b)
        if found and len(pairs) % 2:
            shallow = 10.0 ** -rng.uniform(1, 6)
            a = Placed(a.shape, at + max(0.0, found.depth - shallow) * found.normal, a.orientation)
            found = overlap(a, b)
        if found:
            pairs.append((a, b))
        if len(pairs) == count // ENCLOSED and all(overlap(*pair).way == "dual hull" for pair in pairs):
            break
    return Class(", ".join(kinds), pairs, Counter(overlap(*pair).way for pair in pairs), [])


def in_turn(asked: list[Callable[[], Any]], rounds: int) -> list[float]:
    """µs of each, the median of so many rounds in which all take turns."""
    clock, taken = time.perf_counter_ns, np.empty((rounds, len(asked)))
    for row in taken:
        for k, ask in enumerate(asked):
            begin = clock()
            ask()
            row[k] = clock() - begin
    return (np.median(taken, axis=0) / 1e3).tolist()


def volume_of(a: Placed, b: Placed) -> Callable[[], float]:
    return lambda: overlap(a, b).volume


def measured_classes(classes: list[Class], rounds: int) -> Iterator[tuple[str, str, str, float]]:
    us = iter(in_turn([volume_of(*pair) for each in classes for pair in each.pairs], rounds))
    for each in classes:
        each.us += [next(us) for _ in each.pairs]
        for figure, value in each.figures():
            yield "class", each.name, figure, value


class Many:
    """All pairs of a class in one call, all measures, nothing known of them."""

    def __init__(self, pairs: list[tuple[Placed, Placed]]) -> None:
        bodies = [body for pair in pairs for body in pair]
        self.batch = Batch([body.shape for body in bodies])
        self.positions = np.array([body.position for body in bodies])
        orientations = np.array([body.given_orientation for body in bodies])
        rows = np.arange(len(bodies), dtype=np.int32).reshape(-1, 2)
        # Other pairs and poses to the batch, with the same answers, so that nothing is kept from call to call.
        self.turns = cycle([(orientations, rows), (2 * orientations, rows[:, ::-1].copy())])

    def __call__(self, measures: tuple[str, ...] = ()) -> Overlaps:
        found = self.batch.overlaps(self.positions, *next(self.turns))
        for name in measures:
            getattr(found, name)
        return found


def all_of(a: Placed, b: Placed) -> None:
    found = overlap(a, b)
    for name in MEASURES:
        getattr(found, name)


BATCHES = ("a call, volume", "a call, all", "a batch", "a batch, all")


def measured_batches(classes: list[Class], rounds: int) -> Iterator[tuple[str, str, str, float]]:
    """Raises ArithmeticError if a volume is not that of a call for its pair alone."""
    batches = [Many(each.pairs) for each in classes]
    asked: list[Callable[[], Any]] = []
    for each, batch in zip(classes, batches):
        if batch().volume.tolist() != [overlap(*pair).volume for pair in each.pairs]:
            raise ArithmeticError(f"{each.name}: volumes of a batch are not those of single calls")
        asked += [
            lambda pairs=each.pairs: [overlap(a, b).volume for a, b in pairs],
            lambda pairs=each.pairs: [all_of(a, b) for a, b in pairs],
            batch,
            lambda batch=batch: batch(MEASURES),
        ]
    us = iter(in_turn(asked, rounds))
    for each in classes:
        for figure in BATCHES:
            yield "batch", each.name, figure, next(us) / len(each.pairs)


def measured_margins(rng: np.random.Generator, count: int, rounds: int) -> Iterator[tuple[str, str, str, float]]:
    """Pairs of meshes as they are, and with margins."""
    for corners in (8, 20, 60, 200):
        bare, grown = [], []
        while len(bare) < count:
            clouds, turns, at = [points(rng, corners) for _ in range(2)], rng.normal(size=(2, 4)), rng.normal(size=3)
            a, b = (Placed(Hull(cloud), 0.3 * k * at, turns[k]) for k, cloud in enumerate(clouds))
            if overlap(a, b):
                bare.append((a, b))
                grown.append(
                    tuple(Placed(RoundedHull(x.shape.vertices, MARGIN), x.position, x.orientation) for x in (a, b))
                )
        us = in_turn([volume_of(*pair) for both in zip(bare, grown) for pair in both], rounds)
        for figure, values in (("nominal", us[::2]), ("with margins", us[1::2])):
            yield "margin", f"meshes of {corners} corners", figure, median(values)


HEXAHEDRON = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
CORNERS = np.array([[*xy, z] for z in (-1, 1) for xy in HEXAHEDRON], float)  # in the order that `overlap` wants


def by_overlap(ball: Placed, box: Placed) -> Callable[[], float] | None:
    """The package `overlap`, its element and sphere made before; None if it is not installed."""
    try:
        import overlap as peer
    except ImportError:
        return None
    x, y, z, w = box.orientation / np.linalg.norm(box.orientation)
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    element = peer.Hexahedron((CORNERS * box.shape.half_extents) @ turn.T + box.position)
    sphere = peer.Sphere(ball.position, ball.shape.radius)
    return lambda: peer.overlap_volume(sphere, element)


def measured_peer(balls: list[tuple[Placed, Placed]], rounds: int) -> Iterator[tuple[str, str, str, float]]:
    """Of balls and boxes, and of a ball of 0.5 m over a right edge, shallower and shallower."""
    pairs = {"at random": [(a, b) if isinstance(a.shape, Sphere) else (b, a) for a, b in balls]}
    cube = Placed(Box([1, 1, 1]))
    for k in range(1, 11):
        place = 1 + (0.5 - 10.0**-k) / 2**0.5
        pairs[f"1e-{k}"] = [(Placed(Sphere(0.5), (place, place, 0.0625)), cube)]
    for name, some in pairs.items():
        peers = [by_overlap(*pair) for pair in some]
        if None in peers:
            return
        us = in_turn([ask for pair, peer in zip(some, peers) for ask in (volume_of(*pair), peer)], 20 * rounds)
        yield "overlap", name, "ours", median(us[::2])
        yield "overlap", name, "overlap", median(us[1::2])
        if name != "at random":
            (pair,), (peer,) = some, peers
            truth = over_an_edge(pair[0])
            yield "overlap", name, "error, ours", abs(overlap(*pair).volume - truth) / truth
            yield "overlap", name, "error, overlap", abs(peer() - truth) / truth


def over_an_edge(ball: Placed) -> float:
    """What a ball over the edge x = y = 1 of a cube shares with it, of discs cut by two lines, in 50 digits."""
    import mpmath

    with mpmath.workdps(50):
        r, out = mpmath.mpf(ball.shape.radius), mpmath.mpf(float(ball.position[0])) - 1

        def area(u: Any) -> Any:
            """Of the disc whose radius is r cos u: within both lines, each as far from the centre."""
            rho = r * mpmath.cos(u)
            if rho**2 <= 2 * out**2:
                return mpmath.mpf(0)
            end = mpmath.sqrt(rho**2 - out**2)
            angle = mpmath.pi / 2 - 2 * mpmath.asin(out / rho)
            return rho**2 * angle / 2 - out * (end - out)

        last = mpmath.acos(out * mpmath.sqrt(2) / r)
        return float(2 * mpmath.quad(lambda u: area(u) * r * mpmath.cos(u), [0, last / 2, last]))


# Scenes


def humanoids(client: int) -> None:
    """Fifty of pybullet's humanoids of eight capsules, five balls and two boxes, limp, fallen on a heap."""
    for k in range(50):
        place = [0.7 * (k % 5 - 2), 0.7 * (k // 5 % 5 - 2), 1.0 + 1.5 * (k // 25)]
        turn = p.getQuaternionFromEuler([0.3 * k, 0.7 * k, 0.2 * k])
        p.loadURDF("humanoid/humanoid.urdf", place, turn, globalScaling=0.25, physicsClientId=client)


ROBOTS = (
    "r2d2.urdf", "humanoid/humanoid.urdf", "laikago/laikago_toes_zup.urdf", "a1/a1.urdf",
    "mini_cheetah/mini_cheetah.urdf", "husky/husky.urdf",
)  # fmt: skip


def robots(client: int) -> None:
    """Six of each of six kinds, fallen on a heap."""
    for k in range(36):
        name, place = ROBOTS[k % 6], [0.6 * (k // 6 % 3 - 1), 0.6 * (k // 18 - 0.5), 0.6 + 0.5 * (k % 6)]
        scaling = 0.25 if "humanoid" in name else 1.0
        p.loadURDF(name, place, globalScaling=scaling, physicsClientId=client)


def on_a_plane(build: Callable[[int], None]) -> Callable[[int], None]:
    def filled(client: int) -> None:
        p.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=client)
        p.setGravity(0, 0, -9.81, physicsClientId=client)
        p.loadURDF("plane.urdf", physicsClientId=client)
        build(client)

    return filled


@dataclass(frozen=True)
class Heap:
    """A scene; the first steps are not timed if bodies have to fall first."""

    build: Callable[[int], Any]
    aim: str
    falling: int
    steps: int
    surface: str = "nominal"
    measures: tuple[str, ...] = ("volume",)
    step: Callable[[int], None] | None = None


def heaps() -> dict[str, Heap]:
    balls, objects = (load_scene(ROOT / "scenes" / f"{name}.py") for name in ("bin_of_balls", "random_objects_pile"))
    return {
        "bin_of_balls": Heap(balls.build, "0.4 ms", 0, balls.steps),
        "fifty capsule humanoids": Heap(on_a_plane(humanoids), "half of stepSimulation", 200, 60),
        "random_objects_pile, with margins": Heap(objects.build, "6 ms", 0, objects.steps, "margin"),
        "36 mixed robots, all measures": Heap(on_a_plane(robots), "20 ms", 200, 60, measures=MEASURES),
    }


AIMS_OF_SCENES = {
    "bin_of_balls": 400.0,
    "random_objects_pile, with margins": 6000.0,
    "36 mixed robots, all measures": 2e4,
}


def measured_scene(name: str, heap: Heap) -> Iterator[tuple[str, str, str, float]]:
    client = p.connect(p.DIRECT)
    ours, theirs, overlapping, round_ones = [], [], [], []
    try:
        heap.build(client)
        bodies = Bodies(client, surface=heap.surface)
        round_shapes = np.array([not isinstance(shape, (Box, Hull, HalfSpace)) for shape in bodies.shapes])
        for step in range(heap.falling + heap.steps):
            begin = time.process_time()
            p.stepSimulation(client)
            between = time.process_time()
            if step < heap.falling:
                continue
            bodies.update()
            found = bodies.overlaps().overlaps
            for measure in heap.measures:
                getattr(found, measure)
            ours.append(1e6 * (time.process_time() - between))
            theirs.append(1e6 * (between - begin))
            overlapping.append(int((found.volume > 0).sum()))
            round_ones.append(int((round_shapes[found.pairs].any(axis=1) & (found.volume > 0)).sum()))
    finally:
        p.disconnect(client)
    figures = {
        "ours": median(ours), "stepSimulation": median(theirs), "pairs": mean(overlapping), "round": mean(round_ones),
    }  # fmt: skip
    for figure, value in figures.items():
        yield "scene", name, figure, value


def measured(pairs: int, rounds: int, scenes: Iterable[str]) -> Iterator[tuple[str, str, str, float]]:
    on_one_processor()
    warnings.simplefilter("ignore", SkippedShapeWarning)
    rng = np.random.default_rng(0)
    classes = [made(rng, kinds, pairs) for kinds in CLASSES]
    yield from measured_classes(classes, rounds)
    yield from measured_batches(classes, rounds)
    yield from measured_margins(rng, pairs, rounds)
    yield from measured_peer(next(each.pairs for each in classes if each.name == "box, ball"), rounds)
    for name, heap in heaps().items():
        if name in scenes:
            yield from measured_scene(name, heap)


# The page

Figures = dict[str, dict[str, dict[str, float]]]  # by part, name and figure


def write_results(rows: Iterable[tuple[str, str, str, float]], path: Path) -> None:
    found = list(rows)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        file.write(f"# {machine()}; {time.strftime('%Y-%m-%d')}; Python {platform.python_version()}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows((part, name, figure, f"{value:.4g}") for part, name, figure, value in found)


def read(path: Path) -> tuple[str, Figures]:
    """The comment, and the figures."""
    with path.open(newline="", encoding="utf-8") as file:
        note = file.readline()[2:].strip()
        figures: Figures = {}
        for row in csv.DictReader(file):
            figures.setdefault(row["part"], {}).setdefault(row["name"], {})[row["figure"]] = float(row["value"])
    return note, figures


def table(heading: list[str], rows: Iterable[list[str]]) -> str:
    rule = "|---|" + "--:|" * (len(heading) - 1)
    return "\n".join([f"| {' | '.join(heading)} |", rule, *(f"| {' | '.join(row)} |" for row in rows)])


def times(ratio: float, aim: float) -> str:
    """In bold what keeps the aim."""
    said = f"{ratio:,.0f}" if ratio >= 10 else f"{ratio:.1f}"
    return f"**{said}**" if ratio <= aim else said


def ways_of(figures: dict[str, float]) -> str:
    found = {way: share for way, share in figures.items() if way in Overlaps.WAYS}
    return ", ".join(f"{way} {share:.0f} %" for way, share in sorted(found.items(), key=lambda item: -item[1]))


def class_table(figures: Figures) -> str:
    boxes = figures["class"][BOXES]["median"]
    rows = [
        [
            name, duration(each["median"]), times(each["median"] / boxes, MEDIAN),
            duration(each["99 %"]), times(each["99 %"] / boxes, TAIL), ways_of(each),
        ]
        for name, each in figures["class"].items()
    ]  # fmt: skip
    return table(["pairs", "median", "times two boxes", "99 % take at most", "times two boxes", "ways"], rows)


def batch_table(figures: Figures) -> str:
    rows = [
        [name, *(duration(each[figure]) for figure in BATCHES), *(times(ratio, BATCH) for ratio in ratios(each))]
        for name, each in figures["batch"].items()
    ]
    heading = ["pairs", *BATCHES, "all over volume", "all over all"]
    return table(heading, rows)


def ratios(of_class: dict[str, float]) -> tuple[float, float]:
    """How much longer a pair of a batch takes with all measures than a call for the volume, and for all."""
    return tuple(of_class["a batch, all"] / of_class[figure] for figure in BATCHES[:2])


def held(figures: Figures) -> dict[str, str]:
    """How many classes keep the aims, of how many."""
    boxes, classes = figures["class"][BOXES]["median"], figures["class"]
    of_volume, of_all = zip(*map(ratios, figures["batch"].values()))
    return {
        "classes": str(len(classes)),
        "median_held": str(sum(each["median"] <= MEDIAN * boxes for each in classes.values())),
        "tail_held": str(sum(each["99 %"] <= TAIL * boxes for each in classes.values())),
        "volume_held": str(sum(ratio <= BATCH for ratio in of_volume)),
        "all_held": str(sum(ratio <= BATCH for ratio in of_all)),
        "boxes": duration(boxes),
    }


# Why a class misses an aim, by what is done for most of its pairs.
BOUNDS = {
    "planes": "**Planes around ellipsoids.** An ellipsoid and another round body are no ball and no cylinder in any "
    "common frame. They are enclosed by tangent planes, some thousand for a tolerance of 1e-3.",
    "pieces": "**Pieces of rounded hulls.** Which facets, edges and corners are met is found by cutting a polytope "
    "around what is common, and each piece that is met is measured on its own: the time goes with their number.",
    "slices": "**Slices.** There is no formula for two round bodies whose surfaces cross, and for a side of a capsule "
    "or a cylinder over an edge or a corner it cancels where the contact is shallow. What is left are slices, dozens "
    "to hundreds, each an outline.",
}


def bound_by(name: str, figures: dict[str, float]) -> str:
    if figures.get("dual hull", 0.0) > figures.get("slicing", 0.0):
        return "planes"
    return "pieces" if {"rounded hull", "mesh with margin"} & set(name.split(", ")) else "slices"


def bounds_text(figures: Figures) -> str:
    boxes = figures["class"][BOXES]["median"]
    lines = []
    for bound, words in BOUNDS.items():
        of_bound = {name: each for name, each in figures["class"].items() if bound_by(name, each) == bound}
        both = [name for name, each in of_bound.items() if each["median"] > MEDIAN * boxes]
        tail = [name for name, each in of_bound.items() if name not in both and each["99 %"] > TAIL * boxes]
        if both or tail:
            said = [words]
            said += [f"Beyond {MEDIAN} times in the median: {listed(both)}."] * bool(both)
            said += [f"Beyond {TAIL} times in the slowest hundredth only: {listed(tail)}."] * bool(tail)
            lines.append(fill(" ".join(said), 120, initial_indent="- ", subsequent_indent="  ", break_on_hyphens=False))
    return "\n".join(lines) or "None does."


def listed(names: list[str]) -> str:
    return "; ".join(name.replace(", ", " and ") for name in names)


# What the time of a scene goes to, said where it misses its aim.
BOUNDS_OF_SCENES = {
    "bin_of_balls": "capsules on edges of walls, and others near where their ends begin, which are sliced",
    "fifty capsule humanoids": "capsules of neighbours that cross or touch, which are sliced",
    "random_objects_pile, with margins": "small hulls of up to a hundred facets, every one of which has pieces",
    "36 mixed robots, all measures": "poses and shapes of so many links",
}


def aim_of(name: str, figures: dict[str, float]) -> float:
    """In µs."""
    return AIMS_OF_SCENES.get(name, figures["stepSimulation"] / 2)


def scene_bounds(figures: Figures) -> str:
    missed = [name for name, each in figures["scene"].items() if each["ours"] > aim_of(name, each)]
    said = "; ".join(f"*{name}*: {BOUNDS_OF_SCENES[name]}" for name in missed)
    return fill(f"What bounds those that miss their aim: {said}.", 120) if missed else "All keep their aim."


def margin_table(figures: Figures) -> str:
    rows = []
    for name, each in figures["margin"].items():
        ratio = each["with margins"] / each["nominal"]
        rows.append([name, duration(each["nominal"]), duration(each["with margins"]), times(ratio, WITH_MARGIN)])
    return table(["", "as they are", "with margins of 1 mm", "times"], rows)


def overlap_text(figures: Figures) -> str:
    if "overlap" not in figures:
        return "It was not installed."
    rows = [
        [
            f"{float(name):.0e} m", duration(each["ours"]), duration(each["overlap"]),
            f"{each['error, ours']:.0e}",
            "answers 0" if each["error, overlap"] == 1 else f"{each['error, overlap']:.0e}",
        ]
        for name, each in figures["overlap"].items()
        if name != "at random"
    ]  # fmt: skip
    both = figures["overlap"]["at random"]
    said = f"In the median of the balls and boxes above, this package takes {duration(both['ours'])}"
    said += f" and `overlap` {duration(both['overlap'])}. Over an edge:\n\n"
    return said + table(["depth", "ours", "`overlap`", "error, ours", "error, `overlap`"], rows)


def scene_table(figures: Figures) -> str:
    rows = []
    for name, each in figures["scene"].items():
        took = duration(each["ours"])
        said = heaps()[name].aim
        rows.append(
            [
                name, f"{each['pairs']:,.0f}", f"{each['round']:,.0f}", duration(each["stepSimulation"]),
                f"**{took}**" if each["ours"] <= aim_of(name, each) else took, said,
            ]
        )  # fmt: skip
    return table(["scene", "pairs that overlap", "a round one in", "`stepSimulation`", "ours", "aim"], rows)


def draw(figures: Figures, folder: Path) -> None:
    """A line for each class from its median to what 99 % of its pairs take, as round.png and round.svg."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    plt.rcParams.update({"font.size": 8, "svg.fonttype": "none", "svg.hashsalt": "overlapper"})
    boxes = figures["class"][BOXES]["median"]
    classes = sorted(figures["class"].items(), key=lambda item: item[1]["median"])
    figure, ax = plt.subplots(figsize=(8.6, 0.165 * len(classes) + 1.2))
    for k, (name, each) in enumerate(classes):
        flat = all(kind in POLYHEDRA for kind in name.split(", "))
        colour = "#666666" if flat else "#d1001f"
        ax.plot([each["median"], each["99 %"]], [k, k], color=colour, lw=1.4, alpha=0.55, zorder=2)
        ax.plot(each["median"], k, "o", color=colour, ms=5, zorder=3)
        ax.plot(each["99 %"], k, "|", color=colour, ms=7, zorder=3)
    for factor, words in ((1, "two boxes"), (MEDIAN, "10 times"), (TAIL, "40 times")):
        ax.axvline(factor * boxes, color="#1f5fbf", lw=0.8, ls=":" if factor > 1 else "-", zorder=1)
        ax.annotate(words, (factor * boxes, len(classes) - 0.3), color="#1f5fbf", fontsize=7, ha="center")
    ax.set(xscale="log", ylim=(-0.8, len(classes) + 0.6))
    ax.set_xlabel("time of a call: the median of a class (dot), and what 99 of 100 of its pairs take at most (bar)")
    ax.set_yticks(range(len(classes)), [name for name, _ in classes])
    ticks = [tick for tick in 10.0 ** np.arange(-1, 7) if ax.get_xlim()[0] < tick < ax.get_xlim()[1]]
    ax.set_xticks(ticks, [duration(tick) for tick in ticks])
    ax.minorticks_off()
    ax.grid(axis="x", color="#e3e3e3", lw=0.5)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(folder / "round.png", dpi=130)
    figure.savefig(folder / "round.svg", metadata={"Date": None})
    plt.close(figure)


def write_page(path: Path, folder: Path) -> Path:
    """The page about a results file, round.md, with its chart."""
    note, figures = read(path)
    folder.mkdir(parents=True, exist_ok=True)
    words = Template((Path(__file__).parent / "round_page.md").read_text(encoding="utf-8")).substitute(
        results=path.relative_to(ROOT) if path.is_relative_to(ROOT) else path,
        note=note,
        table=class_table(figures),
        batches=batch_table(figures),
        margins=margin_table(figures),
        overlap=overlap_text(figures),
        scenes=scene_table(figures),
        bounds=bounds_text(figures),
        scene_bounds=scene_bounds(figures),
        **held(figures),
    )
    draw(figures, folder)
    page = folder / "round.md"
    page.write_text(words, encoding="utf-8")
    return page


def main() -> None:
    parser = argparse.ArgumentParser(description="What round bodies cost beside two boxes.")
    parser.add_argument("--pairs", type=int, default=PAIRS, help="of each class")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="how often each pair is asked")
    parser.add_argument("--out", type=Path, help="folder for results and page, by default those of the checkout")
    parser.add_argument("--page", action="store_true", help="only write the page, from the results there are")
    chosen = parser.parse_args()
    path = chosen.out / "round.csv" if chosen.out else results_path().with_name("round.csv")
    if not chosen.page:
        try:
            write_results(measured(chosen.pairs, chosen.rounds, heaps()), path)
        except ArithmeticError as wrong:
            sys.exit(f"overlapper: wrong: {wrong}")
    print(f"Written: {path}, {write_page(path, chosen.out or ROOT / 'docs')}")


if __name__ == "__main__":
    main()
