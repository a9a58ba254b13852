"""`overlapper check` and `overlapper diff`: what moved since a scene was recorded, or between two tables."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Callable, Generator, Mapping
from contextlib import closing, redirect_stderr
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import typer

from overlapper.cli.refusals import Interrupted, Refused, import_engine, input_refusals, quiet, say, scene_refusals
from overlapper.jobs.worker import NotStarted
from overlapper.scenes.scene import SceneError, scenes_in


def check(
    paths: Annotated[
        list[Path] | None, typer.Argument(help="Folders of scenes, or scene files. Default: the folder `scenes`.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the pages of scenes that have changed.")] = Path("out"),
    record: Annotated[bool, typer.Option("--record", help="Write new expected files instead of comparing.")] = False,
    workers: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Number of scenes at a time. Default: one on each core. 1: in this process.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Run scenes and compare them with their expected files, in the folder `expected` beside each scene.

    Changes are reported by cause: geometry (this package), shapes (the models), or dynamics (the simulator). A scene
    without an expected file is recorded, and counts as changed once. A scene that diverges is not recorded. Shapes that
    are not modelled are named. The exit code is 0 if nothing changed, 1 if something changed, and 2 if a scene could
    not be run.

    Examples:

    [bold]overlapper check scenes[/bold]  reports changes, and writes out/<scene>.moved.html with before and after

    [bold]overlapper check scenes/grasp.py --record[/bold]  makes the results of today the expected ones
    """
    named: dict[str, Path] = {}
    for scene in (scene for folder in paths or [Path("scenes")] for scene in _scenes_in(folder)):
        named.setdefault(os.path.abspath(scene), scene)  # once, or two at once would write its expected file
    from overlapper.scenes.check import pages_of

    pages = pages_of([*named.values()], out)
    held = _in_turn(pages, record) if workers == 1 else _at_once(pages, record, workers)
    code = 0
    try:
        with closing(held):
            for each in held:
                code = max(code, each.code)
                sys.stderr.write(each.talk)
                for line in each.lines:
                    say(line, sys.stderr if each.code == 2 else sys.stdout)
    except KeyboardInterrupt as error:
        raise Interrupted from error
    except NotStarted as error:
        raise Refused(str(error)) from error
    raise typer.Exit(code)


def _scenes_in(folder: Path) -> list[Path]:
    try:
        return scenes_in(folder)
    except SceneError as error:
        raise Refused(str(error)) from error


@dataclass(frozen=True, slots=True)
class _Held:
    """The report on a scene, its exit code, and the output of the scene itself."""

    code: int
    lines: list[str]
    talk: str = ""


def _in_turn(pages: Mapping[Path, Path], record: bool) -> Generator[_Held, None, None]:
    for scene, page in pages.items():
        yield _held(scene, page, record)


def _at_once(pages: Mapping[Path, Path], record: bool, workers: int | None) -> Generator[_Held, None, None]:
    """As _in_turn, in the same order, by several processes."""
    from overlapper.jobs.executor import outcomes
    from overlapper.jobs.hand import Done, Job, Outcome
    from overlapper.jobs.processes import Processes

    job = Job(__name__, prepared.__name__, record)
    found: dict[int, Outcome] = {}
    told = 0
    with closing(outcomes(Processes(workers), job, [*pages.items()])) as done:
        for number, outcome in done:
            found[number] = outcome
            while told in found:
                ready = found.pop(told)
                if isinstance(ready, Done):
                    yield ready.value
                else:
                    yield _refused(f"{[*pages][told]}: {ready.sentence}")
                told += 1


def prepared(record: bool) -> Callable[[tuple[Path, Path]], _Held]:
    """The function that compares a scene with its expected file in another process."""

    def held(item: tuple[Path, Path]) -> _Held:
        with redirect_stderr(io.StringIO()) as talk:
            found = _held(*item, record)
        return replace(found, talk=talk.getvalue())

    return held


def _held(scene: Path, page: Path, record: bool) -> _Held:
    try:
        with quiet() as noise, scene_refusals(noise):
            import_engine(scene)
            from overlapper.scenes.check import hold

            outcome = hold(scene, page, record)
    except Refused as error:
        return _refused(str(error))
    shown = outcome.lines if outcome.word != "as recorded" else [f"note: {note}" for note in outcome.notes]
    return _Held(0 if outcome.passed else 1, [f"{scene}: {outcome.word}", *(f"    {line}" for line in shown)])


def _refused(sentence: str) -> _Held:
    return _Held(2, [f"overlapper: {sentence}"])


def diff(
    before: Annotated[Path, typer.Argument(help="Table: .csv, .parquet or .sqlite.", show_default=False)],
    after: Annotated[Path, typer.Argument(help="Another table of the same scene.", show_default=False)],
) -> None:
    """Report changes from one table of overlaps to another: poses of shapes, and overlaps of pairs.

    The budgets, which are the allowed changes, come from the heading of the first table, as in expected files. Without
    budgets, overlaps may differ by rounding, and poses by 0.1 mm and 1 mrad. Shapes that are not modelled must be the
    same. The exit code is 0 if nothing changed, 1 if something changed, and 2 if a table cannot be read.

    [bold]overlapper diff monday.csv tuesday.csv[/bold]
    """
    from overlapper.tables.table_file import LEFT_OUT, read_content
    from overlapper.verdicts.comparison import compare_forces, compare_measures, compare_poses
    from overlapper.verdicts.expected import DRIFT, FORCES, ROUNDING, budgets_in

    with input_refusals():
        first, second = read_content(before), read_content(after)
        found = second.rows
        recorded, budgets = first.rows, ROUNDING | DRIFT | FORCES | budgets_in(first.metadata, before)
    compared = {
        "poses": compare_poses(recorded, found, budgets),
        "overlaps": compare_measures(recorded, found, budgets),
    }
    if all(rows and "energy_j" in rows[0] for rows in (recorded, found)):
        compared["forces"] = compare_forces(recorded, found, budgets)
    left_out = [
        {said for name, said in content.metadata.items() if name.startswith(LEFT_OUT)} for content in (first, second)
    ]
    moved = left_out[0] != left_out[1]
    if any(left_out):
        print(f"left out  {'moved' if moved else 'the same'}")
        for path, said in zip((before, after), left_out):
            for each in sorted(said - (left_out[0] & left_out[1])):
                say(f"    by {path} alone: {each}")
    for cause, differences in compared.items():
        moves = sorted(differences.moves, key=lambda move: -move.part)
        print(f"{cause:9} {f'{len(moves):,} moved' if moves else 'the same'}")
        for move in moves[:20]:
            say(f"    {move}")
        if len(moves) > 20:
            print(f"    and {len(moves) - 20:,} more")
        moved = moved or bool(moves)
    raise typer.Exit(1 if moved else 0)
