"""The command line `overlapper` with all of its commands."""

from __future__ import annotations

import inspect
import sys
from typing import Annotated, Any, NoReturn

import typer

from overlapper import __version__
from overlapper.cli.audit import audit
from overlapper.cli.bench import chart, stability
from overlapper.cli.check import check, diff
from overlapper.cli.clashes import clashes
from overlapper.cli.intersect import intersect
from overlapper.cli.refusals import Interrupted, Refused, give_up, say
from overlapper.cli.run import run
from overlapper.cli.shapes import shapes
from overlapper.cli.sweep import sweep
from overlapper.cli.view import view
from overlapper.cli.watch import watch
from overlapper.scenes.scene import headline, scene_paths

app = typer.Typer(pretty_exceptions_enable=False, context_settings={"help_option_names": ["-h", "--help"]})


def main() -> NoReturn:
    """The entry point. An error that the user can correct is one sentence on stderr, with exit code 2."""
    # UsageError, which is click's or typer's own, as the version of typer has it.
    usage_error: Any = typer.BadParameter.__bases__[0]
    try:
        answer = app(sys.argv[1:] or ["--help"], prog_name="overlapper", standalone_mode=False)
    except Interrupted:
        say("overlapper: interrupted; nothing was written", sys.stderr)
        sys.exit(130)
    except (KeyboardInterrupt, typer.Abort):
        say("overlapper: interrupted", sys.stderr)
        sys.exit(130)
    except Refused as error:
        give_up(str(error))
    except MemoryError:
        give_up("there is not enough memory for this")
    except usage_error as error:
        # Some versions of typer let a library check choices, and hand on how that begins.
        give_up(error.format_message().replace(": Value error, ", ": "))
    # Whatever a script raises is its own, and Python's to tell.
    sys.exit(answer() if callable(answer) else answer)


def _show_version(wanted: bool) -> None:
    if wanted:
        print(f"overlapper {__version__}")
        raise typer.Exit


@app.callback()
def overlapper(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Measure the overlaps of bodies in simulations, meshes and robots: volume, depth, centroid and error bounds.

    List the sample scenes with [bold]overlapper scenes[/bold], and run one of them:

    [bold]overlapper run franka_grasp --html grasp.html[/bold]

    Watch a script of your own, without changes to it:

    [bold]overlapper watch --html mine.html my_script.py[/bold]
    """


def scenes() -> None:
    """List the scenes that can be run by name: the sample scenes, and those of the folder `scenes` here."""
    for name, path in scene_paths().items():
        say(f"{name:22}{headline(path)}")


def reflowed(text: str) -> str:
    """The text with each paragraph on one line. The help is then broken at the margin only."""
    return "\n\n".join(" ".join(paragraph.split("\n")) for paragraph in inspect.cleandoc(text).split("\n\n"))


# Options behind the path of the script belong to the script.
app.command(context_settings={"allow_interspersed_args": False}, help=reflowed(watch.__doc__ or ""))(watch)
for command in (scenes, run, sweep, view, check, diff, intersect, clashes, shapes, audit, stability, chart):
    app.command(help=reflowed(command.__doc__ or ""))(command)
