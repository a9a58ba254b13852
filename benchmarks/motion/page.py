"""The page about times of impact, docs/motion.md, from the results file."""

from __future__ import annotations

from pathlib import Path

from harness import results
from harness.page import duration, named, table, write

ADVANCEMENT = ("advancement, libccd", "advancement, indep")
FIGURES = ("missed", "late", "latest", "earliest")
STATUSES = ("impact", "separated", "touching", "overlapping", "open")
PEERS = (*ADVANCEMENT, "1,000 poses")


def write_page(path: Path, folder: Path) -> Path:
    (note,), rows = results.read(path)
    beside = path.with_name("motions.csv")
    _, graded = results.read(beside if beside.exists() else next(results.FOLDER.glob("*/motions.csv")))
    found: dict[str, dict[str, dict[str, float]]] = {}
    for row in rows:
        found.setdefault(row["kind"], {}).setdefault(row["library"], {})[row["figure"]] = float(row["value"])

    def small(value: float) -> str:
        return f"{value:.0e}" if value else "0"

    answers = [
        [
            kind,
            f"{of['truth']['hits']:.0f}",
            *(f"{of[peer][figure]:.0f}" for figure in ("missed", "late") for peer in ADVANCEMENT),
            *(small(of[peer][figure]) for figure in ("latest", "early") for peer in ADVANCEMENT),
            small(of["1,000 poses"]["latest"]),
        ]
        for kind, of in found.items()
    ]
    names = ("ours", "ours, one call", *PEERS)
    speed = [
        [kind, *(duration(of[name]["us"]) for name in names), duration(of["ours"]["us slowest"])]
        for kind, of in found.items()
    ]
    return write(
        Path(__file__).with_suffix(".md"),
        folder / "motion.md",
        results=named(path),
        note=note,
        answers=table(
            ["motion", "hits", *(f"{figure}, {who}" for figure in FIGURES for who in ("libccd", "indep")), "poses"],
            answers,
        ),
        speed=table(["motion", "ours", "ours, one call", "libccd", "indep", "1,000 poses", "ours, slowest"], speed),
        graded=table(
            ["motions", *STATUSES, "wider", "late", "wrong"],
            [
                [row["kind"], *(f"{int(row[name]):,}" for name in (*STATUSES, "wide", "late", "false"))]
                for row in graded
            ],
        ),
        graded_count=f"{sum(int(row['motions']) for row in graded):,}",
        graded_late=f"{sum(int(row['late']) for row in graded):,}",
        graded_false=f"{sum(int(row['false']) for row in graded):,}",
        graded_open=f"{sum(int(row['open']) for row in graded):,}",
        poses_missed=f"{sum(of['1,000 poses']['missed'] for of in found.values()):.0f}",
        early=small(max(of[peer]["early"] for of in found.values() for peer in ADVANCEMENT)),
        false=f"{sum(of[peer]['false'] for of in found.values() for peer in PEERS):.0f}",
        width=f"{max(of['ours']['widest'] for of in found.values()):.1e}",
    )
