"""`overlapper watch`: runs an unchanged script and measures the overlaps of its simulations."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from overlapper.cli.figures import show
from overlapper.cli.options import (
    BetweenOption,
    Written,
    asking,
    files,
    modelling,
    with_options,
)
from overlapper.cli.refusals import Refused, say
from overlapper.printable import first_line
from overlapper.simulation.settings import Asking, Modelling, settings_of

if TYPE_CHECKING:
    from overlapper.scenes.watching import Watches


@with_options(files=files, asked=asking, modelled=modelling)
def watch(
    script: Annotated[
        Path,
        typer.Argument(help="Python script that steps pybullet or MuJoCo.", show_default=False, metavar="SCRIPT.py"),
    ],
    context: typer.Context,
    arguments: Annotated[
        list[str] | None, typer.Argument(help="Arguments of the script.", show_default=False, metavar="[ARGS]...")
    ] = None,
    *,
    every: Annotated[int, typer.Option(min=1, help="Measure one step in this many.")] = 1,
    rate: Annotated[
        float,
        typer.Option(
            min=0.001, help="Most measurements a second of a simulation in real time, which is held meanwhile."
        ),
    ] = 60,
    names: Annotated[
        list[str] | None,
        typer.Option("--name", metavar="BODY=NAME", help="Name of a body, by its number. May be repeated."),
    ] = None,
    files: Written,
    asked: Asking,
    modelled: Modelling,
    between: BetweenOption = False,
    direct: Annotated[
        bool,
        typer.Option("--direct", help="Replace pybullet.GUI by pybullet.DIRECT, so that the script opens no window."),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
) -> Callable[[], int]:
    """Run an unchanged script of pybullet or MuJoCo, and measure the overlaps of its bodies in every step.

    Options of this command stand before the script, options of the script after it. The output, the arguments and the
    exit code of the script are as without this command, and Ctrl-C works. The tables are printed on stderr when the
    script has ended. Each pybullet client and each MjData that the script steps has a table of its own: the second is
    written to FILE-2. The exit code is 2 instead of 0 if something was not measured or written: no step at all, shapes
    that are not modelled, bodies that have diverged, or steps in other processes.

    Examples:

    [bold]overlapper watch my_script.py --seed 3[/bold]  a table of the overlaps, on stderr

    [bold]overlapper watch --out run.parquet --html run.html --every 10 my_script.py[/bold]  every tenth step, in files

    [bold]overlapper watch --name 1=gripper --name 2=cup my_script.py[/bold]  with names of your own

    [bold]overlapper watch --between my_script.py[/bold]  with pairs that passed through each other between two steps

    [bold]overlapper watch --direct my_script.py[/bold]  a script that opens a window, on a machine without a screen
    """
    if not script.is_file():
        raise Refused(f"there is no script {script}")
    asked = replace(asked, pairs=asked.pairs or "simulated")
    how = {"every": every, "rate": rate, **settings_of(asked, modelled), "per": files.per, "check": files.check}
    how["between"] = between
    if between and every > 1:
        raise Refused("--between needs every step, so it does not go with --every")
    how["names"] = _named(names or ())
    try:
        from overlapper.reference import reference
        from overlapper.scenes.watching import Watches
        from overlapper.simulation.engine import LIBRARIES, engine
        from overlapper.simulation.imports import when_imported

        if not any(map(find_spec, LIBRARIES.values())):
            engine("bullet")  # says what to install
        from overlapper.tables.outputs import can_be_written

        if check := reference(files.check):
            check.close()
        can_be_written(files.out, files.html)
    except ImportError as error:
        raise Refused(str(error)) from error
    except OSError as error:
        raise Refused(f"cannot write {error.filename}: {error.strerror}") from error
    when_imported("pybullet", partial(_look_for_windows, script, direct))
    # An exception that ends the script must not be mistaken for one of ours.
    astray = _astray(context, arguments or [])
    watches = Watches(script.name, files.out, files.html, how)
    return lambda: _run(script, arguments or [], astray, watches, how, as_json)


def _look_for_windows(script: Path, direct: bool) -> None:
    """Give the script no window if `direct`, else say why it ends if there is no screen for one."""
    from overlapper.simulation.bullet.windows import open_no_window, tell_of_windows

    if direct:
        open_no_window()
        return
    sentence = f"{script} opens a window of pybullet, but there is no screen, so pybullet ends the script"
    tell_of_windows(lambda: say(f"overlapper: {sentence}: --direct runs it without a window", sys.stderr))


def _named(given: Sequence[str]) -> dict[int, str]:
    """The names of --name by the numbers of bodies."""
    names: dict[int, str] = {}
    for each in given:
        number, _, name = each.partition("=")
        if not (number.isascii() and number.isdigit() and name.strip()):
            raise Refused(f"--name must be BODY=NAME, such as 3=duck, not {each!r}")
        if int(number) in names:
            raise Refused(f"--name gives {number} twice")
        names[int(number)] = name
    return names


def _astray(context: typer.Context, arguments: Sequence[str]) -> list[str]:
    """The options of the watch among the arguments of the script, unless they also stand before the script."""
    ours = {option for each in context.command.params for option in each.opts if option.startswith("--")}
    before = {each.partition("=")[0] for each in sys.argv[: len(sys.argv) - len(arguments)]}
    return [name for each in arguments if (name := each.partition("=")[0]) in ours - before]


def _run(
    script: Path,
    arguments: list[str],
    astray: Sequence[str],
    watches: Watches,
    how: Mapping[str, Any],
    as_json: bool,
) -> int:
    from overlapper.scenes.script import end_as, run_script
    from overlapper.scenes.watching import interrupted_later

    process = os.getpid()
    try:
        ended = run_script(script, arguments)
    except OSError as error:
        watches.end(failed=True)
        say(f"overlapper: {script}: {error.strerror}", sys.stderr)
        return 2
    if os.getpid() == process:
        interrupted = isinstance(ended, KeyboardInterrupt)
        try:
            with interrupted_later():
                watches.end(failed=isinstance(ended, Exception))
            with suppress(BrokenPipeError):
                _tell(watches, _not_watched(script, watches, how, astray), how, not interrupted, as_json)
        except KeyboardInterrupt:
            say("overlapper: interrupted; the files are written", sys.stderr)
            ended = ended or SystemExit(130)
    well = ended is None or (isinstance(ended, SystemExit) and not ended.code)
    if well and os.getpid() == process and not watches.complete:
        return 2
    end_as(ended)
    return 0


def _tell(watches: Watches, not_watched: Sequence[str], how: Mapping[str, Any], finished: bool, as_json: bool) -> None:
    if not as_json:
        _show(watches, not finished)
    for sentence in not_watched:
        say(f"overlapper: {sentence}", sys.stderr)
    if as_json:
        simulations = [
            watch.summary.as_dict()
            | {"measured": watch.measured, "sampled": watch.sampled, "written": [str(path) for path in watch.written]}
            for watch in watches.all
        ]
        told = {"settings": how, "simulations": simulations, "not_watched": not_watched, "finished": finished}
        say(json.dumps(told), sys.stderr)


def _show(watches: Watches, interrupted: bool) -> None:
    from overlapper.cli.summary import overlaps_table, remarks

    for watch in watches.all:
        summary = watch.summary
        show(
            overlaps_table(summary)
            if summary.pairs
            else f"Nothing overlaps in {summary.steps} steps of {summary.scene}.",
            stderr=True,
            markup=False,
        )
        for line in remarks(summary):
            say(line, sys.stderr)
        if watch.sampled:
            sampled = f"{watch.sampled} samples of a simulation in real time, which was held meanwhile"
            say(f"{sampled}: at most {watch.rate:g} a second.", sys.stderr)
        if watch.every > 1:
            say(f"One step in {watch.every} was measured, {watch.measured} of {watch.steps}.", sys.stderr)
        for path in watch.written:
            say(f"Written: {path}", sys.stderr)
    if interrupted and watches.all:
        say(f"Interrupted after step {watches.all[-1].steps}; the steps before are kept.", sys.stderr)


def _not_watched(script: Path, watches: Watches, how: Mapping[str, Any], astray: Sequence[str]) -> list[str]:
    """A sentence for everything that was not measured or written, except shapes, which the summaries name."""
    told = []
    for watch, error in watches.failed:
        kept = f"; the steps before are in {' and '.join(map(str, watch.written))}" if watch.written else ""
        reason = first_line(error)
        if isinstance(error, OSError):
            reason = f"cannot write {error.filename or 'the results'}: {error.strerror or error}"
        told.append(f"{watch.summary.scene} was watched up to step {watch.steps}: {reason}{kept}")
    if not (watches.all or watches.failed):
        told.append(f"nothing was measured: {script} {_steps(watches)}")
    if watches.stepped_elsewhere:
        told.append(f"{script} stepped simulations in other processes, which are not watched")
    if number := watches.loaded_elsewhere:
        processes = "another process that loads" if number == 1 else f"{number:,} other processes that load"
        told.append(f"{script} started {processes} pybullet: steps in other processes are not watched")
    for body, name in how["names"].items() if watches.all else ():
        if all(body in watch.unnamed for watch in watches.all):
            told.append(f"--name {body}={name}: no measured step had a body {body}")
    for name in dict.fromkeys(astray):
        told.append(
            f"{name} stands after {script} and was an argument of the script: "
            "options of overlapper watch stand before the script"
        )
    return told


def _steps(watches: Watches) -> str:
    if watches.steps:
        return f"made {watches.steps} steps, fewer than --every"
    if watches.stepped_elsewhere or watches.loaded_elsewhere:
        return "made no step in its own process"
    clock = ", and pybullet.DIRECT has no simulation in real time" if watches.without_real_time else ""
    return f"never called pybullet.stepSimulation or mujoco.mj_step in its own process{clock}"
