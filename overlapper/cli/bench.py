"""`overlapper stability` and `overlapper chart`: the benchmarks of a checkout."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Annotated

import typer

from overlapper.cli.refusals import Refused


def stability(
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first case of each family.")] = 0,
    count: Annotated[int, typer.Option(min=1, help="Approximate number of cases.")] = 2000,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for results, page and pictures. Default: that of the checkout."),
    ] = None,
) -> None:
    """Run hard cases with this package and others, and chart failures. Needs a checkout, takes some minutes."""
    folder = [f"--out={out}"] if out else []
    raise typer.Exit(_run_benchmark("stability", f"--seed={seed}", f"--count={count}", *folder))


def chart(
    family: Annotated[
        list[str] | None,
        typer.Option(
            help="Measure only this family of pairs, such as 'box deep'. May be repeated.", show_default=False
        ),
    ] = None,
    method: Annotated[
        list[str] | None,
        typer.Option(help="Measure only this method, such as 'manifold3d'. May be repeated.", show_default=False),
    ] = None,
    seconds: Annotated[
        float, typer.Option(min=0.0, help="Approximate time for all methods on one family, in s.")
    ] = 4.0,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for results, page and pictures. Default: that of the checkout."),
    ] = None,
    page: Annotated[bool, typer.Option("--page", help="Draw from existing results, without new measurements.")] = False,
) -> None:
    """Time this package and others on the same pairs, and chart error over time. Needs a checkout, takes half an hour.

    Without --family and --method, the command then charts the time of round bodies and the parts of a step's time.
    Volumes are compared with exact values, or with single calls. The exit code is 1 if a volume of this package is
    wrong.
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
        raise Refused(f"{name} needs a checkout of overlapper, because its cases and peers are not installed")
    try:
        return subprocess.run([sys.executable, str(benchmarks), name, *options]).returncode
    except OSError as error:
        raise Refused(f"{name} could not be started ({error.strerror})") from error
