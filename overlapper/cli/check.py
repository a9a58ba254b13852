"""`overlapper check` and `overlapper diff`: what moved since a scene was recorded, or between two tables."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from overlapper.cli.refusals import Refused, input_refusals, quiet, say, scene_refusals, without_banner
from overlapper.scenes.scene import SceneError, scenes_in


def check(
    paths: Annotated[
        list[Path] | None, typer.Argument(help="Folders of scenes, or scene files; by default `scenes`.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the pages of scenes that have moved.")] = Path("out"),
    record: Annotated[bool, typer.Option("--record", help="Write what is expected anew instead.")] = False,
) -> None:
    """Run scenes and compare them with what was recorded of them in the folder `expected` beside each.

    What moved is told by cause: the geometry is this package's, the shapes are the models', the dynamics the
    simulator's. A new scene is recorded, and has moved this once. The exit code is 0 if all is as recorded, 1 if
    something moved, and 2 if a scene could not be run.

    Examples:

    [bold]overlapper check scenes[/bold]  says what moved, and writes out/<scene>.html with before and after

    [bold]overlapper check scenes/grasp.py --record[/bold]  takes what happens today as what is expected
    """
    codes = [_checked(scene, out, record) for folder in paths or [Path("scenes")] for scene in _scenes_in(folder)]
    raise typer.Exit(max(codes))


def _scenes_in(folder: Path) -> list[Path]:
    try:
        return scenes_in(folder)
    except SceneError as error:
        raise Refused(str(error)) from error


def _checked(scene: Path, out: Path, record: bool) -> int:
    """Says what became of a scene, on stderr if it could not be run; returns the exit code that it deserves."""
    try:
        with quiet() as noise, scene_refusals(noise):
            with without_banner():
                from overlapper.scenes.check import hold
            outcome = hold(scene, out, record)
    except Refused as error:
        say(f"overlapper: {error}", sys.stderr)
        return 2
    shown = outcome.lines if outcome.word != "as recorded" else [f"note: {note}" for note in outcome.notes]
    for line in [f"{scene}: {outcome.word}", *(f"    {line}" for line in shown)]:
        say(line)
    return 0 if outcome.passed else 1


def diff(
    before: Annotated[Path, typer.Argument(help="A table, .csv, .parquet or .sqlite.", show_default=False)],
    after: Annotated[Path, typer.Argument(help="Another table of the same scene.", show_default=False)],
) -> None:
    """Say what moved from one table of overlaps to another: poses of shapes, and overlaps of pairs.

    The budgets are those that the first table has in its heading, as expected files do; without any, overlaps may
    differ by rounding, and shapes by a tenth of a millimetre and a milliradian. The exit code is 0 if nothing moved, 1
    if something did, and 2 if a table cannot be read.

    [bold]overlapper diff monday.csv tuesday.csv[/bold]
    """
    from overlapper.scenes.comparison import compare_measures, compare_poses
    from overlapper.scenes.expected import DRIFT, ROUNDING, read_budgets
    from overlapper.scenes.table_file import read_table

    with input_refusals():
        recorded, found = read_table(before), read_table(after)
        budgets = ROUNDING | DRIFT | read_budgets(before)
    moved = False
    for cause, differences in (
        ("poses", compare_poses(recorded, found, budgets)),
        ("overlaps", compare_measures(recorded, found, budgets)),
    ):
        moves = sorted(differences.moves, key=lambda move: -move.part)
        print(f"{cause:9} {f'{len(moves):,} moved' if moves else 'the same'}")
        for move in moves[:20]:
            say(f"    {move}")
        if len(moves) > 20:
            print(f"    and {len(moves) - 20:,} more")
        moved = moved or bool(moves)
    raise typer.Exit(1 if moved else 0)
