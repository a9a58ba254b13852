"""`overlapper view`: a scene, or the table of one, as a page, as a picture, or live."""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from overlapper.cli.options import Simulated, simulated, with_options
from overlapper.cli.recorded import with_progress
from overlapper.cli.refusals import Refused, import_engine, input_refusals, quiet, say, scene_refusals

if TYPE_CHECKING:
    from overlapper.scenes.playback import Playback, View
    from overlapper.viewer.look import Look


@dataclass(frozen=True, slots=True)
class Shown:
    """The page, the picture of a step, or the live view at `host` that is asked for."""

    html: Path | None
    png: Path | None
    live: bool
    host: str
    step: int | None
    close: bool


def shown(
    html: Annotated[Path | None, typer.Option(help="Write a page for a browser. Default: out/<name>.html.")] = None,
    png: Annotated[Path | None, typer.Option(help="Write a picture instead of a page.")] = None,
    live: Annotated[
        bool, typer.Option("--live", help="Show the scene in meshcat during the simulation, instead of a page.")
    ] = False,
    host: Annotated[
        str, typer.Option(help="Address of this machine for --live. 0.0.0.0 shows it to the network.")
    ] = "127.0.0.1",
    step: Annotated[
        int | None, typer.Option(min=1, help="Step of the picture. Default: the step with the largest overlap.")
    ] = None,
    close: Annotated[bool, typer.Option("--close", help="Zoom the picture to the largest overlap.")] = False,
) -> Shown:
    """The page, picture or live view that is asked for."""
    if sum(map(bool, (html, png, live))) > 1:
        raise Refused("--html, --png and --live exclude each other")
    return Shown(html, png, live, host, step, close)


def looks(
    overlaps: Annotated[
        str, typer.Option(help="Parts of overlaps to draw: faces, edges, vertices, marks, forces.")
    ] = "faces,marks,forces",
    overlaps_opacity: Annotated[float, typer.Option(help="Opacity of overlaps, from 0 to 1.")] = 1.0,
    overlaps_front: Annotated[
        str | None, typer.Option(help="Colour of the outside. Default: the colours of the two bodies.")
    ] = None,
    overlaps_back: Annotated[
        str | None, typer.Option(help="Colour of the inside. It is visible if the opacity is below 1.")
    ] = None,
    bodies: Annotated[str, typer.Option(help="Parts of bodies to draw: faces, edges, vertices.")] = "faces,edges",
    bodies_opacity: Annotated[float, typer.Option(help="Opacity of bodies, from 0 to 1.")] = 0.35,
    bodies_front: Annotated[
        str | None, typer.Option(help="Colour of the outside. Default: the body's own colour.")
    ] = None,
    bodies_back: Annotated[
        str | None, typer.Option(help="Colour of the inside. Default: the inside is not drawn.")
    ] = None,
) -> tuple[Look, Look]:
    """The looks of bodies and of overlaps."""
    return (
        _look("bodies", bodies, bodies_opacity, bodies_front, bodies_back),
        _look("overlaps", overlaps, overlaps_opacity, overlaps_front, overlaps_back),
    )


@with_options(shown=shown, simulated=simulated, looks=looks)
def view(
    source: Annotated[str, typer.Argument(help="Scene, by name or path, or table of a scene.", show_default=False)],
    *,
    shown: Shown,
    scene: Annotated[
        str | None, typer.Option(help="Scene of a table without shapes, by name or path. It is run again.")
    ] = None,
    simulated: Simulated,
    looks: tuple[Look, Look],
) -> None:
    """Show a scene, or a table of a scene: as a page with a time slider, as a picture, or live.

    An expected file contains the shapes and poses. Any other table needs --scene: the scene is run again with the
    settings of the table, and differences are reported. A file that only the table names is never run. The exit code is
    1 if shapes were not modelled or a body has diverged.

    Examples:

    [bold]overlapper view franka_grasp[/bold]  a page to play, click and measure in: out/franka_grasp.html

    [bold]overlapper view franka_grasp --set mass=0.3[/bold]  with another value of a parameter

    [bold]overlapper view scenes/expected/box_pile.csv --png pile.png --close[/bold]  a picture for a report

    [bold]overlapper view run.csv --scene my_scene.py[/bold]

    [bold]overlapper view my_scene.py --live --bodies edges --overlaps-opacity 0.6[/bold]
    """
    written: list[Path] = []
    finished = True
    page = shown.html or Path("out") / f"{Path(source).stem}.html"
    with quiet() as noise, scene_refusals(noise), input_refusals():
        import_engine(scene or source)
        from overlapper.scenes.playback import play

        playback = play(source, simulated.steps, scene, simulated.parameters, simulated.contact)
        with closing(playback.views):
            if shown.live:
                _live(playback, looks, shown.host)
            elif shown.png:
                _picture(playback, shown.png, shown.step, shown.close, looks)
                written.append(shown.png)
            else:
                finished = _film(playback, page, looks, written)
    for remark in playback.remarks:
        say(f"overlapper: {remark}", sys.stderr)
    from overlapper.cli.summary import skipped_lines

    for line in skipped_lines(playback.skipped):
        say(line, sys.stderr)
    for path in written:
        say(f"Written: {path}")
    if not finished:
        raise typer.Exit(130)
    if page in written:
        _open(page.resolve().as_uri())
    if playback.skipped:
        raise typer.Exit(1)


def _film(playback: Playback, html: Path, looks: Sequence[Look], written: list[Path]) -> bool:
    """False if it was interrupted. The page has the frames before. Without any, KeyboardInterrupt is raised."""
    from overlapper.tables.outputs import PICTURES_PER_SECOND, recorder

    html.parent.mkdir(parents=True, exist_ok=True)
    rate = math.inf if playback.sparse else PICTURES_PER_SECOND
    seen = 0
    with recorder(html, written, looks, rate) as record:
        try:
            for view in with_progress(playback.views, playback.name, playback.total):
                record(view)
                seen += 1
        except KeyboardInterrupt:
            if not seen:
                raise
            return False
    if not seen:
        raise ValueError("there is nothing to show: no step was simulated or recorded")
    return True


def _picture(playback: Playback, png: Path, step: int | None, close: bool, looks: tuple[Look, Look]) -> None:
    from overlapper.scenes.playback import at_step, largest
    from overlapper.viewer import picture
    from overlapper.viewer.framing import Framing

    framing = None

    def watched() -> Iterator[View]:
        nonlocal framing
        for each in with_progress(playback.views, playback.name, playback.total):
            framing = framing or Framing(each.bodies)
            framing.see(each.bodies, each.contacts)
            yield each

    view = at_step(watched(), step) if step else largest(watched())
    png.parent.mkdir(parents=True, exist_ok=True)
    title = f"{playback.name}, step {view.step}, {view.time:.3f} s"
    picture.save(png, view.bodies, view.contacts, title, close, looks, framing, view.forces)


def _live(playback: Playback, looks: Sequence[Look], host: str) -> None:
    """Show the simulation in real time, or slower if it takes longer. On a terminal, stay until Ctrl-C."""
    from overlapper.tables.outputs import PICTURES_PER_SECOND
    from overlapper.viewer import Viewer

    with Viewer(None, *looks, host=host) as viewer, suppress(KeyboardInterrupt):
        print(f"overlapper: {viewer.url} (Ctrl-C ends it)", file=sys.stderr, flush=True)
        _open(viewer.url)
        start, shown = time.monotonic(), 0
        for view in playback.views:
            if view.time * PICTURES_PER_SECOND >= shown or playback.sparse:
                time.sleep(max(0.0, start + view.time - time.monotonic()))
                viewer.show(view.bodies, view.contacts, view.forces)
                shown += 1
        while sys.stderr.isatty():
            time.sleep(3600)


def _open(address: str) -> None:
    """Open a browser, if there is a terminal and a screen."""
    if sys.stderr.isatty() and (sys.platform != "linux" or "DISPLAY" in os.environ or "WAYLAND_DISPLAY" in os.environ):
        typer.launch(address)


def _look(kind: str, parts: str, opacity: float, front: str | None, back: str | None) -> Look:
    from overlapper.viewer.look import PARTS, Look

    wanted = [part.strip() for part in parts.split(",") if part.strip()]
    for part in wanted:
        if part not in PARTS:
            raise Refused(f"--{kind} must name some of {','.join(PARTS)}, not {part!r}")
    try:
        return Look(opacity=opacity, front=front, back=back, **{part: part in wanted for part in PARTS})
    except ValueError as error:
        raise Refused(f"--{kind}-{error}") from error
