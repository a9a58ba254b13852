"""`overlapper stability` and `overlapper chart`: the benchmarks of a checkout."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Annotated

import typer

from overlapper.cli.refusals import Refused


def stability(
    seed: Annotated[int, typer.Option(min=0, help="Of the first case of each family.")] = 0,
    count: Annotated[int, typer.Option(min=1, help="About so many cases.")] = 2000,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for results, page and pictures; by default where the checkout has its own."),
    ] = None,
) -> None:
    """Put hard cases to this package and to others, and chart who fails where: for a checkout, some minutes."""
    folder = [f"--out={out}"] if out else []
    raise typer.Exit(_run_benchmark("stability", f"--seed={seed}", f"--count={count}", *folder))


def chart(
    family: Annotated[
        list[str] | None,
        typer.Option(help="Measure these pairs only, such as 'box deep'; may be repeated.", show_default=False),
    ] = None,
    method: Annotated[
        list[str] | None,
        typer.Option(help="Ask these only, such as 'manifold3d'; may be repeated.", show_default=False),
    ] = None,
    seconds: Annotated[float, typer.Option(min=0.0, help="About so long the methods take turns on a family.")] = 4.0,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for results, page and pictures; by default where the checkout has its own."),
    ] = None,
    page: Annotated[bool, typer.Option("--page", help="Only draw, from the results there are.")] = False,
) -> None:
    """Time this package and others on the same pairs and chart error over time: for a checkout, half an hour.

    Then, unless pairs or methods are chosen, chart what round bodies cost and where the time of a step goes. Volumes
    are compared with the exact truth, or with single calls; the exit code is 1 if one of this package is wrong.
    """
    chosen = [f"--family={name}" for name in family or ()] + [f"--method={name}" for name in method or ()]
    common = [*([f"--out={out}"] if out else []), *["--page"] * page]
    code = _run_benchmark("chart", f"--seconds={seconds}", *chosen, *common)
    if not chosen:
        code = code or _run_benchmark("round", *common) or _run_benchmark("steps", *common)
    raise typer.Exit(code)


def _run_benchmark(name: str, *options: str) -> int:
    """Returns its exit code."""
    benchmarks = Path(__file__).parents[2] / "benchmarks"
    if not (benchmarks / "__main__.py").is_file():
        raise Refused(f"{name} needs a checkout of overlapper, as its cases and peers are not installed")
    try:
        return subprocess.run([sys.executable, str(benchmarks), name, *options]).returncode
    except OSError as error:
        raise Refused(f"{name} could not be started ({error.strerror})") from error
