"""One command line for all benchmarks.

A benchmark is a module with a docstring and `main(chosen)`, and with `options(parser)` if it has options. If it
measures what a page shows, it has in place of `main`: `RESULTS`, the results file, `measure(chosen, path)`, which
writes it, and `PAGE`, if the benchmark has a page: the module whose `write_page(path, folder)` writes it.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from importlib import import_module
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).resolve().parents[2]

COMMANDS = {
    "chart": "speed.chart",
    "round": "speed.round",
    "steps": "speed.steps",
    "ways": "speed.ways",
    "mujoco": "speed.engine",
    "stability": "stability.hard_cases",
    "stress": "stability.stress",
    "graded": "stability.graded",
    "physics": "forces.physics",
    "engines": "forces.engines",
    "forces": "forces.cost",
    "firsttry": "forces.firsttry",
    "boxes": "boxes.iou",
    "million": "boxes.million",
    "vectors": "boxes.vectors",
    "motion": "motion.impacts",
    "motions": "motion.many",
    "audit": "costs.audit",
    "concave": "costs.concave",
    "recording": "costs.recording",
    "sweep": "costs.sweep",
    "watch": "costs.watch",
}


class Wrong(Exception):
    """An answer of this package is not what it claims. The run ends, and its results are not kept."""


def main(arguments: list[str]) -> int:
    """Runs a benchmark. Returns 1 if an answer of this package is wrong, 2 if a package is missing, 0 otherwise."""
    outer = ArgumentParser("python benchmarks", description="Measures what the pages of docs show.")
    outer.add_argument("name", choices=COMMANDS, metavar="NAME", help=", ".join(COMMANDS))
    name = outer.parse_args(arguments[:1]).name
    try:
        module = import_module(COMMANDS[name])
        return run(module, parser_of(name, module).parse_args(arguments[1:]))
    except ModuleNotFoundError as error:
        print(f"overlapper: {name} needs {error.name}: pip install '.[bench]'", file=sys.stderr)
        return 2
    except Wrong as wrong:
        print(f"overlapper: wrong: {wrong}", file=sys.stderr)
        return 1


def parser_of(name: str, module: ModuleType) -> ArgumentParser:
    parser = ArgumentParser(
        f"python benchmarks {name}", description=module.__doc__, formatter_class=RawDescriptionHelpFormatter
    )
    if hasattr(module, "options"):
        module.options(parser)
    if hasattr(module, "measure"):
        parser.add_argument("--out", type=Path, help="folder for results and page, by default those of the checkout")
    if hasattr(module, "PAGE"):
        parser.add_argument("--page", action="store_true", help="only write the page, from the results there are")
    return parser


def run(module: ModuleType, chosen: Namespace) -> int:
    if hasattr(module, "main"):
        return int(module.main(chosen) or 0)
    path = chosen.out / module.RESULTS.name if chosen.out else module.RESULTS
    if not getattr(chosen, "page", False):
        path.parent.mkdir(parents=True, exist_ok=True)
        module.measure(chosen, path)
        print(f"Written: {path}")
    if hasattr(module, "PAGE"):
        folder = chosen.out or ROOT / "docs"
        folder.mkdir(parents=True, exist_ok=True)
        print(f"Written: {import_module(module.PAGE).write_page(path, folder)}")
    return 0
