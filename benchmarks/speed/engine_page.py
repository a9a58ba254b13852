"""The page about MuJoCo's times, pairs and depths, docs/mujoco_benchmarks.md, from the results file."""

from __future__ import annotations

from pathlib import Path

from harness import results
from harness.page import duration, indented, named, table, write
from speed.engine import SAMPLES, SETTLING
from speed.engine_models import POSES, TOUCHING

COUNTS = ("overlapping", "agree", "ours", "mujoco", "undecided", "shallow")
MODEL_COUNTS = ("models", "poses", "pairs", "ours", "theirs", "touching")

Figures = dict[str, dict[str, float]]  # by row and column


def read(path: Path) -> tuple[list[str], dict[str, Figures]]:
    """The notes of a results file, and its tables by name."""
    notes, rows = results.read(path)
    found: dict[str, Figures] = {"steps": {}, "models": {}, "distances": {}}
    for row in rows:
        found[row["table"]].setdefault(row["row"], {})[row["column"]] = float(row["value"])
    return notes, found


def write_page(path: Path, folder: Path) -> Path:
    notes, found = read(path)
    steps, models, distances = found["steps"], found["models"], found["distances"]

    def a_pair(name: str) -> str:
        return duration(steps[name]["overlaps"] / steps[name]["overlapping"])

    def total(column: str, of: Figures = distances) -> int:
        return round(sum(figures[column] for figures in of.values()))

    times = [
        [
            name,
            *(f"{figures[column]:.0f}" for column in ("geoms", "overlapping")),
            *(duration(figures[column]) for column in ("mj_step", "update", "again", "overlaps")),
            f"{figures['ratio']:.2f} ({figures['ratio_low']:.2f} to {figures['ratio_high']:.2f})",
        ]
        for name, figures in steps.items()
    ]
    depths = [
        [
            kinds.replace("–", ", "),
            *(
                f"{figures[column]:.0f}"
                for column in ("overlapping", "agree", "ours", "mujoco", "undecided", "shallow")
            ),
            *(f"{figures[column]:.1e}" for column in ("difference", "contact")),
        ]
        for kinds, figures in distances.items()
    ]
    packages = [[name, *(f"{figures[column]:,.0f}" for column in MODEL_COUNTS)] for name, figures in models.items()]
    packages.append(["**all**", *(f"**{total(column, models):,}**" for column in MODEL_COUNTS)])
    heading = ["pair", "overlap", "agree", "ours nearer", "MuJoCo nearer", "undecided", "too shallow"]
    return write(
        Path(__file__).with_suffix(".md"),
        folder / "mujoco_benchmarks.md",
        results=named(path),
        notes=indented(notes),
        times=table(["model", "geoms", "overlaps", "`mj_step`", "`update()`", "again", "`overlaps()`", "ratio"], times),
        models=table(["package", "models", "poses", "both", "only ours", "only MuJoCo's", "touching"], packages),
        depths=table([*heading, "depth differs by, m", "`contact.dist` differs by, m"], depths),
        capsules=a_pair("100 capsules"),
        boxes=a_pair("100 boxes"),
        settling=SETTLING,
        samples=SAMPLES,
        poses=POSES,
        touching=f"{TOUCHING:g}",
        left_out=total("skipped", models),
        cases=f"{max(figures['cases'] for figures in distances.values()):.0f}",
        overlapping=f"{total('overlapping'):,}",
        sides=total("sides"),
        ours=total("ours"),
        theirs=total("mujoco"),
        undecided=total("undecided"),
    )
