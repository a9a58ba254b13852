"""`overlapper sweep`: a scene run with many parameters, on all cores or on a cluster."""

from __future__ import annotations

import json
import re
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from overlapper.cli.engine import working
from overlapper.cli.options import SceneArgument, Simulated, asking, modelling, simulated, with_options
from overlapper.cli.refusals import Refused, import_engine, input_refusals, quiet, say, scene_refusals
from overlapper.simulation.settings import Asking, Modelling

if TYPE_CHECKING:
    from overlapper.jobs.executor import Executor
    from overlapper.sweep.comparison import Comparison
    from overlapper.sweep.left_out import LeftOut
    from overlapper.sweep.points import Axis, Space
    from overlapper.sweep.store import Store
    from overlapper.sweep.study import Task
    from overlapper.sweep.sweep import Progress as Reached
    from overlapper.sweep.sweep import Sweep

FAILURES_SHOWN = 5
MOVED_SHOWN = 10


@dataclass(frozen=True, slots=True)
class Axes:
    """The axes whose product is the points of a sweep."""

    grid: list[str] | None
    seeds: int | None
    points: Path | None
    sample: int | None
    ranges: list[str] | None
    sample_seed: int

    def of(self, space: Space) -> list[Axis]:
        """The points of each axis, seeds last."""
        axes = [space.read(self.points)] if self.points else []
        axes += [space.samples(self.sample, self.ranges or [], self.sample_seed)] if self.sample else []
        axes += [space.grid(each) for each in self.grid or ()]
        return axes + ([space.seeds(self.seeds)] if self.seeds else [])


def axes(
    grid: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=FROM:TO:COUNT[:log]|NAME=A,B,...",
            help="Values of a parameter. May be repeated.",
            show_default=False,
        ),
    ] = None,
    seeds: Annotated[
        int | None,
        typer.Option(min=1, help="Number of seeds. The parameter `seed` gets 0, 1, 2, ...", show_default=False),
    ] = None,
    points: Annotated[
        Path | None, typer.Option(help="CSV table of points, with a column for each parameter.", show_default=False)
    ] = None,
    sample: Annotated[
        int | None,
        typer.Option(min=1, help="Number of points of a Latin hypercube sample of the ranges.", show_default=False),
    ] = None,
    ranges: Annotated[
        list[str] | None,
        typer.Option(
            "--range",
            metavar="NAME=FROM:TO[:log]",
            help="Range of a parameter for --sample. May be repeated.",
            show_default=False,
        ),
    ] = None,
    sample_seed: Annotated[int, typer.Option(min=0, help="Seed of --sample.")] = 0,
) -> Axes:
    """The axes whose product is the points of a sweep."""
    if ranges and not sample:
        raise Refused("--range needs --sample")
    return Axes(grid, seeds, points, sample, ranges, sample_seed)


@with_options(axes=axes, simulated=simulated, engine=working, asked=asking, modelled=modelling)
def sweep(
    scene: SceneArgument,
    out: Annotated[
        Path, typer.Option(help="Folder of the sweep. Tasks that it has are not run again.", show_default=False)
    ],
    *,
    axes: Axes,
    simulated: Simulated,
    steps_kept: Annotated[
        str,
        typer.Option(
            metavar='summary|"every N"|all', help="Steps whose pairs are kept in tables, besides the summary."
        ),
    ] = "summary",
    limit: Annotated[
        float | None, typer.Option(min=0.001, help="Time limit of a task, in s. A task that exceeds it fails.")
    ] = None,
    memory: Annotated[
        int | None,
        typer.Option(min=1, help="Memory limit of a task, in MB, on Linux. A task that exceeds it fails."),
    ] = None,
    retry: Annotated[bool, typer.Option("--retry", help="Run failed tasks again.")] = False,
    engine: AbstractContextManager[Executor],
    check: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder of a recorded sweep to compare with.", show_default=False),
    ] = None,
    pages: Annotated[
        int, typer.Option(min=0, help="Number of tasks, the worst first, that get a page of their own.")
    ] = 0,
    asked: Asking,
    modelled: Modelling,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the text.")] = False,
) -> None:
    """Run a scene with many values of its parameters, and keep a summary of each run.

    The parameters of a scene are the further arguments of its build, as in build(client, *, mass=1.0, seed=0). A task
    is a run with one value of each parameter. The tasks are all combinations of --grid, --seeds, --points and --sample.
    --set holds for all tasks. Each task is a row of OUT/tasks.parquet, or of OUT/failures.parquet if it failed. A sweep
    that is started again runs only the missing tasks. The exit code is 0 if all tasks are done, 1 if any task failed,
    diverged or left shapes out, and 2 if no task could be run.

    With --check, the tasks are compared with those of the same parameters in another folder. The allowed changes are
    the budgets of the scene's expected file, or rounding errors. The exit code is 0 if nothing changed, and 1 if a task
    changed or newly failed. It is 2 if there is nothing to compare.

    Examples:

    [bold]overlapper sweep franka_grasp --grid mass=0.1:10:20:log --grid friction=0.3,0.5 --out runs[/bold]

    [bold]overlapper sweep box_pile --seeds 50 --steps-kept "every 10" --limit 60 --out piles[/bold]

    [bold]overlapper sweep franka_grasp --sample 1000 --range mass=0.1:10:log --range friction=0.1:1 --out runs[/bold]

    [bold]overlapper sweep box_pile --seeds 50 --out today --check piles[/bold]
    """
    kept = _kept(steps_kept)
    if check and check.resolve() == out.resolve():
        raise Refused("--check and --out are the same folder")
    with ExitStack() as stack:
        noise = stack.enter_context(quiet())
        stack.enter_context(scene_refusals(noise))
        stack.enter_context(input_refusals())
        import_engine(scene)
        from overlapper.scenes.scene import find_scene, load_scene
        from overlapper.sweep import charts, page
        from overlapper.sweep.comparison import Recorded
        from overlapper.sweep.left_out import LeftOut
        from overlapper.sweep.part import must_be_no_columns
        from overlapper.sweep.points import Space
        from overlapper.sweep.study import Study
        from overlapper.sweep.sweep import Sweep

        charts.must_be_there()
        chosen = load_scene(scene, simulated.parameters)
        must_be_no_columns(chosen.parameters)
        space = Space(chosen.name, chosen.parameters, simulated.parameters.keys())
        contact = simulated.contact or chosen.contact
        study = Study.of(find_scene(scene), simulated.steps or chosen.steps, contact, asked, modelled, kept)
        todo = Sweep(study, space.crossed(axes.of(space)))
        recorded = Recorded(check, chosen.expected, todo) if check else None
        store = stack.enter_context(todo.opened(out))
        working = stack.enter_context(engine)
        reached, finished = _run(todo, store, working, limit, memory, retry)
        compared = recorded.compare(store) if recorded and finished else None
        left_out = LeftOut.of(todo, store)
        shown = page.write(todo, store, scene, pages, comparison=compared)
        failed = store.columns("failures", todo, [])[0].tolist()
        failures = store.rows_of("failures", todo, failed if as_json else failed[:FAILURES_SHOWN], but="traceback")
    _tell(todo, store, reached, finished, len(failed), failures, left_out, compared, shown, as_json)


def _kept(text: str) -> int:
    """The pairs of every n-th step are kept: n, or 0 if no pairs are kept."""
    every = re.fullmatch(r"every (\d+)", text.strip())
    if text in ("summary", "all"):
        return int(text == "all")
    if every and int(every[1]):
        return int(every[1])
    raise Refused(f"--steps-kept must be summary, 'every N' or all, not {text!r}")


def _run(
    todo: Sweep, store: Store, engine: Executor, limit: float | None, memory: int | None, retry: bool
) -> tuple[Reached, bool]:
    """The progress, and False if the sweep was interrupted."""
    from overlapper.scenes.parameters import described
    from overlapper.sweep.sweep import Progress as Reached

    console = Console(stderr=True)
    reached = Reached(len(todo))
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        bar = progress.add_task(todo.study.scene, total=len(todo), rate="")

        def heard(now: Reached) -> None:
            nonlocal reached
            reached = now
            if not now.done + now.failed:  # what was there before says nothing of how fast it goes
                progress.reset(bar, completed=now.total - now.missing)
            speed = progress.tasks[0].speed
            failed = f", {now.failed:,} failed" if now.failed else ""
            rate = f"{speed:,.3g}/s{failed}" if speed else ""
            progress.update(bar, completed=now.total - now.missing, rate=rate)

        def late(task: Task, among: int, seconds: float) -> None:
            which = described(task.parameters) or "the task"
            which = f"one of {among:,} tasks from {which} on" if among > 1 else which
            console.print(
                f"{which} has run for {seconds / 60:.0f} min; --limit ends such tasks", markup=False, highlight=False
            )

        try:
            todo.run(store, engine, limit, retry, heard, memory, None if limit else late)
        except KeyboardInterrupt:
            return reached, False
    return reached, True


def _tell(
    todo: Sweep,
    store: Store,
    reached: Reached,
    finished: bool,
    failed: int,
    failures: list[dict[str, Any]],
    left_out: LeftOut,
    compared: Comparison | None,
    page: Path | None,
    as_json: bool,
) -> None:
    """Report the result of the sweep, and exit with its code."""
    from overlapper.sweep.store import text_of

    if as_json:
        told = {
            "scene": todo.study.scene,
            "settings": todo.study.settings,
            "versions": todo.study.versions,
            "out": str(store.folder),
            "page": str(page) if page else None,
            "tasks": reached.total,
            "there_before": reached.before,
            "done": reached.done,
            "missing": reached.missing,
            "failed": failures,
            "broken": [str(path) for path in store.broken],
            "skipped": left_out.skipped,
            "diverged": left_out.diverged,
            "finished": finished,
        }
        if compared:
            told["check"] = {
                "recorded": str(compared.folder),
                "compared": len(compared.numbers),
                "not_recorded": compared.added,
                "gone": compared.gone,
                "measures": compared.counts,
                "moved": [text_of(name) for name in todo.names[compared.moved]],
            }
        print(json.dumps(told))
    else:
        before = f", {reached.before:,} of them before" if reached.before else ""
        say(f"{todo.study.scene}: {reached.before + reached.done:,} of {reached.total:,} tasks are done{before}.")
        for path in store.broken:
            say(f"A file has changed since it was written, so its tasks run again: {path}")
        for line in left_out.lines():
            say(line)
        for row in failures:
            say(f"Failed: {_point(todo, row)}: {row['sentence']}")
        if failed > FAILURES_SHOWN:
            say(f"and {failed - FAILURES_SHOWN:,} more")
        if failed:
            say(f"Tracebacks: {store.path('failures')}; --retry runs these tasks again")
        if not finished:
            say("Interrupted; the same command continues with the missing tasks.")
        for line in compared.lines(MOVED_SHOWN) if compared else ():
            say(line)
        for path in filter(None, (store.path("tasks") if page else None, page)):
            say(f"Written: {path}")
    wrong = bool(failed or left_out)
    if compared:
        wrong = bool(compared.worst or failed > compared.same_failures)
    raise typer.Exit(130 if not finished else int(wrong))


def _point(todo: Sweep, row: dict[str, Any]) -> str:
    from overlapper.scenes.parameters import described

    return described({name: row[name] for name in todo.points[0]}) or todo.study.scene
