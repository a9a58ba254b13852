"""`overlapper run`: a scene simulated and measured, as a table, a recording and a summary."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from overlapper.cli.figures import show
from overlapper.cli.options import (
    BetweenOption,
    SceneArgument,
    Simulated,
    Written,
    asking,
    files,
    modelling,
    simulated,
    with_options,
)
from overlapper.cli.recorded import with_progress
from overlapper.cli.refusals import Refused, import_engine, quiet, say, scene_refusals
from overlapper.scenes.parameters import heading_of
from overlapper.scenes.scene import Scene, load_scene
from overlapper.simulation.settings import Asking, Modelling, settings_of

if TYPE_CHECKING:
    from overlapper.tables.summary import Summary


@with_options(simulated=simulated, files=files, asked=asking, modelled=modelling)
def run(
    scene: SceneArgument,
    *,
    simulated: Simulated,
    files: Written,
    asked: Asking,
    modelled: Modelling,
    between: BetweenOption = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
) -> None:
    """Simulate a scene and measure the overlaps of its bodies in every step.

    A scene is a Python file with STEPS, the number of steps, and build(client), which fills a pybullet client.
    build(client) may return a function step(i), which is called before each step. PAIRS in the file may be "all", or a
    list of pairs of bodies. With CONTACT = "volumetric", contact forces are computed from overlap volumes, and tables
    have the forces. Further arguments of build, as in build(client, *, mass=1.0, seed=0), are parameters, which --set
    sets.

    The exit code is 1 if shapes were not modelled or a body has diverged, 2 if the scene cannot be run, else 0.

    Examples:

    [bold]overlapper run franka_grasp[/bold]  a table of the overlaps

    [bold]overlapper run box_pile --steps 120 --out pile.csv[/bold]  with a table of every pair in every step

    [bold]overlapper run my_scene.py --html my_scene.html[/bold]  with a recording to play in a browser

    [bold]overlapper run franka_grasp --set mass=0.3 --set friction=0.4[/bold]  with other parameters

    [bold]overlapper run peg_in_hole --contact volumetric --out peg.csv[/bold]  with contact forces in the table

    [bold]overlapper run kuka_jenga --check fcl --json[/bold]  compared with FCL, as JSON

    [bold]overlapper run my_scene.py --between[/bold]  with pairs that passed through each other between two steps
    """
    written: list[Path] = []
    try:
        chosen, summary, finished = _measure(scene, simulated, files, asked, modelled, between, written)
    except Refused as refused:
        kept = f"; the steps before are in {' and '.join(map(str, written))}" if written else ""
        raise Refused(f"{refused}{kept}") from refused
    if as_json:
        places = {name: str(path) for name, path in (("out", files.out), ("html", files.html)) if path in written}
        settings = settings_of(asked, modelled) | {
            "contact": simulated.contact or chosen.contact,
            "per": files.per,
            "check": files.check,
            "between": between,
        }
        told = {"settings": settings, "parameters": chosen.parameters}
        print(json.dumps(told | summary.as_dict() | {"finished": finished} | places))
    else:
        _show(chosen.title, summary, finished, written)
    if not finished or summary.skipped:
        raise typer.Exit(1 if finished else 130)


def _measure(
    name: str,
    simulated: Simulated,
    files: Written,
    asked: Asking,
    modelled: Modelling,
    between: bool,
    written: list[Path],
) -> tuple[Scene, Summary, bool]:
    """The scene, its summary, and False if the run was interrupted: then the summary ends with the last step.

    `written` gets the files that there are in the end: in their place, or, if the run fails, beside it.
    """
    with quiet() as noise, scene_refusals(noise), ExitStack() as stack:
        import_engine(name)
        from overlapper.reference import reference
        from overlapper.scenes.run import run as frames_of
        from overlapper.tables.outputs import outputs
        from overlapper.tables.summary import Summary
        from overlapper.tables.table_file import origin

        scene = load_scene(name, simulated.parameters)
        if files.check == "mujoco" and scene.engine != "mujoco":
            raise Refused(f"--check mujoco needs a simulation of MuJoCo, but {scene.engine} runs {scene.path}")
        if check := reference(files.check):
            stack.callback(check.close)
        steps, contact = simulated.steps or scene.steps, simulated.contact or scene.contact
        settings = {"scene": scene.name, "steps": steps, **settings_of(asked, modelled), "contact": contact}
        summary = Summary(scene.name)
        take = stack.enter_context(
            outputs(
                summary,
                origin(scene.engine) | settings | heading_of(scene.parameters),
                written,
                files.out,
                files.html,
                files.per,
                check,
                contact == "volumetric",
                between=between,
            )
        )
        frames = stack.enter_context(closing(frames_of(scene, steps, asked, modelled, contact, between=between)))
        try:
            for frame in with_progress(frames, scene.name, steps):
                take(frame)
        except KeyboardInterrupt:
            if not summary.steps:
                raise
            return scene, summary, False
    return scene, summary, True


def _show(title: str, summary: Summary, finished: bool, written: Sequence[Path]) -> None:
    from overlapper.cli.summary import overlaps_table, remarks

    show(overlaps_table(summary, title=title) if summary.pairs else f"Nothing overlaps in {summary.steps} steps.")
    for line in remarks(summary):
        say(line)
    if not finished:
        say(f"Interrupted after step {summary.steps}; the steps before are kept.")
    for path in written:
        say(f"Written: {path}")
