"""`overlapper watch`: a script of one's own run as it is, and what its simulations share."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from overlapper.cli.figures import show
from overlapper.cli.options import (
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
        Path, typer.Argument(help="A Python script that steps pybullet.", show_default=False, metavar="SCRIPT.py")
    ],
    arguments: Annotated[
        list[str] | None, typer.Argument(help="Arguments of the script.", show_default=False, metavar="[ARGS]...")
    ] = None,
    *,
    every: Annotated[int, typer.Option(min=1, help="Steps from one that is measured to the next.")] = 1,
    files: Written,
    asked: Asking,
    modelled: Modelling,
    direct: Annotated[
        bool, typer.Option("--direct", help="Give the script no window if it asks for one: pybullet.DIRECT for GUI.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Say one JSON object instead of the table.")] = False,
) -> Callable[[], int]:
    """Run a pybullet script as it is, and measure what its bodies have in common whenever it steps a simulation.

    Options of the watch stand before the script, those of the script behind it. Its output, its arguments, its exit
    code and Ctrl-C are as without the watch, whose own words go to stderr when the script has ended. Each client that
    the script steps is a simulation with a table of its own: the second is in FILE-2. The exit code is 2 where the
    script's would be 0 and something could not be measured or written.

    Examples:

    [bold]overlapper watch my_script.py --seed 3[/bold]  a table of the overlaps, on stderr

    [bold]overlapper watch --out run.parquet --html run.html --every 10 my_script.py[/bold]  and files, every tenth step

    [bold]overlapper watch --direct my_script.py[/bold]  a script that opens a window, on a machine without a screen
    """
    if not script.is_file():
        raise Refused(f"there is no script {script}")
    asked = replace(asked, pairs=asked.pairs or "simulated")
    how = {"every": every, **settings_of(asked, modelled), "per": files.per, "check": files.check}
    try:
        from overlapper.reference import Fcl
        from overlapper.scenes.watching import Watches
        from overlapper.simulation.engine import engine

        engine("bullet")  # says what to install
        from overlapper.simulation.bullet.windows import open_no_window, tell_of_windows
        from overlapper.tables.outputs import can_be_written

        if files.check:
            Fcl().close()
        can_be_written(files.out, files.html)
    except ImportError as error:
        raise Refused(str(error)) from error
    except OSError as error:
        raise Refused(f"cannot write {error.filename}: {error.strerror}") from error
    if direct:
        open_no_window()
    else:
        sentence = f"{script} asks pybullet for a window, and there is no screen to show it on, so pybullet ends it"
        tell_of_windows(lambda: say(f"overlapper: {sentence}: --direct runs it without one", sys.stderr))
    # An exception that ends the script must not be mistaken for one of ours.
    return lambda: _run(script, arguments or [], Watches(script.name, files.out, files.html, how), how, as_json)


def _run(script: Path, arguments: list[str], watches: Watches, how: Mapping[str, Any], as_json: bool) -> int:
    from overlapper.scenes.script import end_as, run_script

    process = os.getpid()
    try:
        ended = run_script(script, arguments)
    except OSError as error:
        watches.end(failed=True)
        say(f"overlapper: {script}: {error.strerror}", sys.stderr)
        return 2
    if os.getpid() == process:
        watches.end(failed=isinstance(ended, Exception))
        interrupted = isinstance(ended, KeyboardInterrupt)
        with suppress(BrokenPipeError):
            if not as_json:
                _show(watches, interrupted)
            _say_what_failed(script, watches)
            if as_json:
                _say_json(watches, how, not interrupted)
    if watches.failed and (ended is None or (isinstance(ended, SystemExit) and not ended.code)):
        return 2
    end_as(ended)
    return 0


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
        if watch.every > 1:
            say(f"One step in {watch.every} was measured, {watch.measured} of {watch.steps}.", sys.stderr)
        for path in watch.written:
            say(f"Written: {path}", sys.stderr)
    if interrupted and watches.all:
        say(f"Interrupted after step {watches.all[-1].steps}; what came before is kept.", sys.stderr)


def _say_json(watches: Watches, how: Mapping[str, Any], finished: bool) -> None:
    simulations = [
        watch.summary.as_dict() | {"measured": watch.measured, "written": [str(path) for path in watch.written]}
        for watch in watches.all
    ]
    say(json.dumps({"settings": how, "simulations": simulations, "finished": finished}), sys.stderr)


def _say_what_failed(script: Path, watches: Watches) -> None:
    for watch, error in watches.failed:
        kept = f"; what came before is in {' and '.join(map(str, watch.written))}" if watch.written else ""
        reason = first_line(error)
        if isinstance(error, OSError):
            reason = f"cannot write {error.filename or 'the results'}: {error.strerror or error}"
        say(f"overlapper: {watch.summary.scene} was watched up to step {watch.steps}: {reason}{kept}", sys.stderr)
    if watches.all or watches.failed:
        return
    if watches.steps:
        say(f"overlapper: nothing was measured: {script} made {watches.steps} steps, fewer than --every", sys.stderr)
    else:
        clock = ", and simulations in real time are not stepped by calls" if watches.in_real_time else ""
        say(f"overlapper: nothing was measured: {script} never called pybullet.stepSimulation{clock}", sys.stderr)
