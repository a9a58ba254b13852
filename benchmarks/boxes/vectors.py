"""What AVX2 brings to volumes of arrays of boxes: the same core with it and without it, in turn.

    python benchmarks vectors

Two processes measure the same pairs on one processor. In one of them, the variable OVERLAPPER_NARROW keeps the core
from AVX2. Writes vectors.csv to benchmarks/results/MACHINE, and the page boxes.md to docs.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from argparse import ArgumentParser, Namespace
from contextlib import ExitStack
from pathlib import Path
from statistics import median

import numpy as np

from boxes.iou import random_boxes, street
from harness.command import Wrong
from harness.results import of_machine, today, writing
from harness.timing import on_one_processor
from overlapper import arrays

RESULTS = of_machine("vectors.csv")
PAGE = "boxes.page"

SIDE = 300  # boxes of each array; each is paired with each
BOXES = {"any rotation": random_boxes, "street of 80 m": street}
WIDTHS = {"AVX2": {}, "without AVX2": {"OVERLAPPER_NARROW": "1"}}


def options(parser: ArgumentParser) -> None:
    parser.add_argument("--rounds", type=int, default=15, help="how often each process measures")


def asked() -> None:
    """The process: for each line of its input, the time of a pair in ns and the sum of the volumes as bits."""
    rng = np.random.default_rng(0)
    both = [[arrays.boxes(*make(rng, SIDE)) for _ in range(2)] for make in BOXES.values()]
    for _ in sys.stdin:
        found = []
        for a, b in both:
            begin = time.process_time()
            volumes = arrays.volume(a, b, threads=1)
            found += [f"{1e9 * (time.process_time() - begin) / volumes.size}", float(volumes.sum()).hex()]
        print(*found, flush=True)


def measure(chosen: Namespace, path: Path) -> None:
    on_one_processor()
    samples: dict[tuple[str, str], list[float]] = {}
    sums: dict[str, set[str]] = {name: set() for name in BOXES}
    with ExitStack() as ended:
        programs = {}
        for width, words in WIDTHS.items():
            command = [sys.executable, "-c", "from boxes.vectors import asked; asked()"]
            places = os.pathsep.join(sys.path)
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
            program = subprocess.Popen(command, env={**os.environ, **words, "PYTHONPATH": places}, **pipes)
            programs[width] = ended.enter_context(program)
        for turn in range(chosen.rounds + 1):
            for width, program in programs.items():
                program.stdin.write("\n")
                program.stdin.flush()
                words = program.stdout.readline().split()
                for name, ns, total in zip(BOXES, words[::2], words[1::2]):
                    sums[name].add(total)
                    if turn:  # the first asks for memory
                        samples.setdefault((name, width), []).append(float(ns))
        for program in programs.values():
            program.stdin.close()
    if any(len(totals) > 1 for totals in sums.values()):
        raise Wrong("the bits of volumes differ without AVX2")
    with writing(path, ("part", "name", "figure", "value"), today()) as write:
        write(("vectors", name, width, f"{median(ns):.4g}") for (name, width), ns in samples.items())
