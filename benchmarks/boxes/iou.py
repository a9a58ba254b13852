"""IoU of oriented boxes: errors and times of this package beside pytorch3d, scipy, shapely and Monte Carlo.

    python benchmarks boxes
    python benchmarks boxes --all      all figures of the page: a million pairs and AVX2, too

pytorch3d needs torch. `make test-torch` makes an environment with torch, in build/torch. Use its Python in the place of
`python`, after the following. easypytorch3d 0.7.9.post1 is compiled for torch 2.11 and does not load with 2.15.

    build/torch/bin/python -m pip install torch==2.11.0
    build/torch/bin/python -m pip install --no-deps easypytorch3d iopath portalocker fvcore yacs termcolor tabulate tqdm
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Iterable
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from statistics import median

import numpy as np
import shapely
from scipy.spatial import ConvexHull, HalfspaceIntersection

from harness.command import COMMANDS, Wrong, parser_of
from harness.results import of_machine, today, writing
from harness.timing import in_turn, on_one_processor
from overlapper import arrays, overlap

RESULTS = of_machine("boxes.csv")
PAGE = "boxes.page"

OFFSETS = (1.0, 0.3, 0.1, 0.03, 0.01, 1e-3, 1e-5, 0.0)
PAIRS = 300
PROVED = 30  # pairs of each offset whose volume is proved in rational arithmetic
POINTS = 100_000  # of Monte Carlo
SIDE = 100  # boxes of each array in the tables of times

# Corners from issues of pytorch3d, with the true IoU.
FAR = [(-24931.9805, 40325.3438), (-24931.1562, 40325.4336), (-24931.3105, 40326.8789), (-24932.1348, 40326.7891)]
UNIT = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
PUBLISHED = {
    "#1054": (UNIT, [[x + 0.5, y + 0.5, z] for x, y, z in UNIT]),
    "#1082": (
        [
            [x, y, z]
            for z in (-1.2441, 0.8192)
            for x, y in [(19.7804, -4.8337), (24.3597, -4.8431), (24.3648, -2.3689), (19.7855, -2.3595)]
        ],
        [
            [x, y, z]
            for z in (-1.25, 0.85)
            for x, y in [(19.8159, -4.8659), (24.4267, -4.8794), (24.4341, -2.3641), (19.8233, -2.3506)]
        ],
    ),
    "#1429": (
        [
            [x, y, z]
            for z in (1, -1)
            for x, y in [(844.4573, 545.2485), (876.2981, 549.768), (865.3027, 627.2315), (833.4619, 622.712)]
        ],
        [
            [x, y, z]
            for z in (1, -1)
            for x, y in [(847.1049, 545.0182), (878.9629, 550.236), (866.222, 628.0273), (834.364, 622.8095)]
        ],
    ),
    "#1551": ([[x, y, z] for z in (-254.5391, -253.7584) for x, y in FAR],) * 2,
}


def random_boxes(rng: np.random.Generator, n: int) -> list[np.ndarray]:
    """Sizes, positions and unit quaternions."""
    turns = rng.normal(size=(n, 4))
    return [
        rng.uniform(0.5, 2, (n, 3)),
        rng.uniform(-1, 1, (n, 3)),
        turns / np.linalg.norm(turns, axis=1, keepdims=True),
    ]


def street(rng: np.random.Generator, n: int) -> list[np.ndarray]:
    """Cars on 80 m of a street."""
    sizes, _, turns = random_boxes(rng, n)
    turns[:, :2] = 0
    sizes[:] = rng.uniform((1.5, 3.5, 1.4), (2, 5, 2), (n, 3))
    return [sizes, np.c_[rng.uniform(-40, 40, (n, 2)), 0.3 * rng.normal(size=n)], turns]


def beside(rng: np.random.Generator, boxes: list[np.ndarray], offset: float) -> list[np.ndarray]:
    """The boxes, moved, turned and stretched by about so much."""
    sizes, positions, turns = boxes
    n = len(sizes)
    return [
        sizes * (1 + 0.3 * offset * rng.normal(size=(n, 3))).clip(0.1),
        positions + offset * rng.normal(size=(n, 3)),
        turns + 0.3 * offset * rng.normal(size=(n, 4)),
    ]


def of_pytorch3d(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """IoUs of single pairs of corners; NaN for pairs that it refuses."""
    import torch  # the module is read without these two
    from pytorch3d.ops.iou_box3d import box3d_overlap

    found = np.full(len(a), np.nan)
    one, other = (torch.tensor(each, dtype=torch.float32) for each in (a, b))
    for k in range(len(a)):
        try:
            found[k] = box3d_overlap(one[k : k + 1], other[k : k + 1])[1].item()
        except ValueError:
            continue
    return found


def by_points(rng: np.random.Generator, a: arrays.ShapeArray, b: arrays.ShapeArray, k: int) -> float:
    """The IoU of row k by random points in the box of `a`."""
    sizes = [(each[k].shape.half_extents) for each in (a, b)]
    points = rng.uniform(-1, 1, (POINTS, 3)) * sizes[0] @ a.rotations[k].T + a.positions[k]
    inside = (np.abs((points - b.positions[k]) @ b.rotations[k]) <= sizes[1]).all(1).mean()
    shared = inside * a.volume[k]
    return float(shared / (a.volume[k] + b.volume[k] - shared))


def by_scipy(a: arrays.ShapeArray, b: arrays.ShapeArray, k: int) -> float:
    """The common volume of row k by half-spaces about a point that is inside both."""
    planes = []
    for each in (a, b):
        axes = each.rotations[k].T
        for normals in (axes, -axes):
            planes.append(np.c_[normals, -(each[k].shape.half_extents + normals @ each.positions[k])])
    inside = overlap(a[k], b[k]).centroid
    return float(ConvexHull(HalfspaceIntersection(np.vstack(planes), inside).intersections).volume)


def proved_error(a: arrays.ShapeArray, b: arrays.ShapeArray, volumes: np.ndarray, rows: Iterable[int]) -> float:
    """The largest relative error of volumes that certificates in rational arithmetic leave possible."""
    worst = 0.0
    for k in rows:
        if volumes[k] > 0:
            lower, upper = overlap(a[k], b[k]).certificate().verify()
            worst = max(worst, float(max(upper - volumes[k], volumes[k] - lower)) / float(lower))
    return worst


def errors(rng: np.random.Generator) -> list[tuple[str, str, str, float]]:
    rows = []
    for offset in OFFSETS:
        numbers = random_boxes(rng, PAIRS)
        moved = beside(rng, numbers, offset)
        a, b = arrays.boxes(*numbers), arrays.boxes(*moved)
        volumes, true = arrays.volume(a, b, aligned=True), arrays.iou(a, b, aligned=True)
        if (true > 1).any():
            raise Wrong(f"an IoU above 1 at the offset {offset}")
        found = of_pytorch3d(arrays.corners(*numbers), arrays.corners(*moved))
        off = np.abs(found - true)
        sampled = max(abs(by_points(rng, a, b, k) - true[k]) for k in range(PROVED))
        figures = {
            "median IoU": float(np.median(true)),
            "ours": proved_error(a, b, volumes, range(PROVED)),
            "points": sampled,
            "over 1e-3": int((off > 1e-3).sum()),
            "over 0.05": int((off > 0.05).sum()),
            "largest": float(np.nanmax(off)),
            "above 1": int((found > 1.001).sum()),
            "refused": int(np.isnan(found).sum()),
        }
        rows += [("errors", f"{offset:g}", name, value) for name, value in figures.items()]
    return rows


def published() -> list[tuple[str, str, str, float]]:
    rows = []
    for issue, (a, b) in PUBLISHED.items():
        one, other = np.array([a], float), np.array([b], float)
        rows.append(("published", issue, "pytorch3d", float(of_pytorch3d(one, other)[0])))
        rows.append(("published", issue, "ours", float(arrays.iou(one, other)[0, 0])))
    return rows


def rectangle(row: np.ndarray) -> shapely.Polygon:
    cos, sin = np.cos(row[4]), np.sin(row[4])
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * row[2:4] / 2
    return shapely.Polygon(corners @ [[cos, sin], [-sin, cos]] + row[:2])


def times(rng: np.random.Generator) -> list[tuple[str, str, str, float]]:
    """µs for each of the pairs, on one thread."""
    import torch
    from pytorch3d.ops.iou_box3d import box3d_overlap

    rows = []
    torch.set_num_threads(1)
    for name, make in (("any rotation", random_boxes), ("street of 80 m", street)):
        numbers = make(rng, SIDE), make(rng, SIDE)
        corners = [arrays.corners(*each) for each in numbers]
        tensors = [torch.tensor(each, dtype=torch.float32) for each in corners]
        calls = {
            "ours": lambda n=numbers: arrays.iou(arrays.boxes(*n[0]), arrays.boxes(*n[1])),
            "ours, corners": lambda c=corners: arrays.iou(*c),
            "pytorch3d": lambda t=tensors: box3d_overlap(*t),
        }
        for who, samples in zip(calls, in_turn([*calls.values()], rounds=5)):
            rows.append(("times", name, who, 1e6 * median(samples) / SIDE**2))
    a, b = (arrays.boxes(*each) for each in (random_boxes(rng, SIDE), random_boxes(rng, SIDE)))
    overlapping = np.flatnonzero(arrays.volume(a, b, aligned=True) > 1e-6)
    calls = {
        "scipy": lambda: [by_scipy(a, b, k) for k in overlapping],
        "points": lambda: [by_points(rng, a, b, k) for k in overlapping],
    }
    for who, samples in zip(calls, in_turn([*calls.values()], rounds=3)):
        rows.append(("times", "any rotation", who, 1e6 * median(samples) / len(overlapping)))
    flat = np.c_[rng.uniform(-1, 1, (2, SIDE, 2)), rng.uniform(0.5, 2, (2, SIDE, 2)), rng.uniform(-3, 3, (2, SIDE, 1))]
    polygons = [np.array([rectangle(row) for row in each]) for each in flat]
    areas = shapely.area(shapely.intersection(polygons[0][:, None], polygons[1][None]))
    rows.append(("flat", "rectangles", "difference", float(np.abs(areas - arrays.volume(*flat)).max())))
    calls = {
        "ours": lambda: arrays.volume(*flat),
        "shapely": lambda: shapely.area(shapely.intersection(polygons[0][:, None], polygons[1][None])),
    }
    for who, samples in zip(calls, in_turn([*calls.values()], rounds=5)):
        rows.append(("flat", "rectangles", who, 1e6 * median(samples) / SIDE**2))
    return rows


def options(parser: ArgumentParser) -> None:
    parser.add_argument("--all", action="store_true", help="measure a million pairs and AVX2, too")


def measure(chosen: Namespace, path: Path) -> None:
    on_one_processor()
    rng = np.random.default_rng(0)
    peers = ", ".join(
        f"{name} {version(name)}" for name in ("overlapper", "easypytorch3d", "torch", "scipy", "shapely")
    )
    note = f"{today()}; {peers}"
    with writing(path, ("part", "name", "figure", "value"), note) as write:
        for part in (errors(rng), published(), times(rng)):
            write(part)
    for name in ("million", "vectors") if chosen.all else ():
        module = import_module(COMMANDS[name])
        module.measure(parser_of(name, module).parse_args([]), path.with_name(module.RESULTS.name))
