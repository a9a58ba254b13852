"""`overlapper run`: a scene simulated and measured, as a table, a recording and a summary."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from overlapper.cli.figures import show
from overlapper.cli.options import (
    CheckOption,
    ConcaveOption,
    ContactOption,
    HtmlOption,
    MethodOption,
    OutOption,
    PairsOption,
    PerOption,
    SceneArgument,
    SetOption,
    SurfaceOption,
    ThresholdOption,
    ToleranceOption,
    given_parameters,
    refuse_out_of_range,
)
from overlapper.cli.recorded import with_progress
from overlapper.cli.refusals import Refused, import_engine, quiet, say, scene_refusals
from overlapper.scenes.parameters import heading_of
from overlapper.scenes.scene import Scene, load_scene

if TYPE_CHECKING:
    from overlapper.tables.summary import Summary


def run(
    scene: SceneArgument,
    given: SetOption = None,
    steps: Annotated[
        int | None, typer.Option(min=1, help="Steps to simulate; by default as many as the scene says.")
    ] = None,
    out: OutOption = None,
    html: HtmlOption = None,
    check: CheckOption = None,
    method: MethodOption = "auto",
    tolerance: ToleranceOption = 1e-3,
    per: PerOption = "shape",
    concave: ConcaveOption = "decompose",
    concave_threshold: ThresholdOption = 0.05,
    surface: SurfaceOption = "nominal",
    pairs: PairsOption = None,
    contact: ContactOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
) -> None:
    """Simulate a scene and measure what its bodies have in common in every step.

    A scene is a Python file with STEPS, the number of steps, and build(client), which fills a pybullet client and may
    return a function step(i) that is called before each step. PAIRS in it may be "all", or a list of pairs of bodies,
    and CONTACT "volumetric": then bodies are pushed apart by the volumes that they share, and tables have the forces.
    What build takes beside the client, as build(client, *, mass=1.0, seed=0), are parameters that --set sets.

    Examples:

    [bold]overlapper run franka_grasp[/bold]  a table of the overlaps

    [bold]overlapper run box_pile --steps 120 --out pile.csv[/bold]  and every pair of every step

    [bold]overlapper run my_scene.py --html my_scene.html[/bold]  and a recording with a time slider

    [bold]overlapper run franka_grasp --set mass=0.3 --set friction=0.4[/bold]  with other parameters

    [bold]overlapper run peg_in_hole --contact volumetric --out peg.csv[/bold]  with forces, in the table, too

    [bold]overlapper run kuka_jenga --check fcl --json[/bold]  compared with FCL, for a program to read
    """
    refuse_out_of_range(tolerance, concave_threshold, out)
    parameters = given_parameters(given)
    geometry = {
        "tolerance": tolerance,
        "method": method,
        "concave": concave,
        "concave_threshold": concave_threshold,
        "surface": surface,
        "pairs": pairs,
        "contact": contact,
    }
    written: list[Path] = []
    try:
        chosen, summary, finished = _measure(
            scene, parameters, steps, out, html, check is not None, per, geometry, written
        )
    except Refused as refused:
        kept = f"; what came before is in {' and '.join(map(str, written))}" if written else ""
        raise Refused(f"{refused}{kept}") from refused
    if as_json:
        files = {name: str(path) for name, path in (("out", out), ("html", html)) if path in written}
        asked = {**geometry, "contact": contact or chosen.contact, "per": per, "check": check}
        settings = {"settings": asked, "parameters": chosen.parameters}
        print(json.dumps(settings | summary.as_dict() | {"finished": finished} | files))
    else:
        _show(chosen.title, summary, finished, written)
    if not finished:
        raise typer.Exit(130)


def _measure(
    name: str,
    parameters: Mapping[str, str],
    steps: int | None,
    out: Path | None,
    html: Path | None,
    check: bool,
    per: Literal["shape", "link"],
    geometry: Mapping[str, Any],
    written: list[Path],
) -> tuple[Scene, Summary, bool]:
    """The scene, and the run, with its files; False if it was interrupted, and then both have what was done until then.

    `written` gets the files that there are in the end: in their place, or, if the run fails, beside it.
    """
    with quiet() as noise, scene_refusals(noise), ExitStack() as stack:
        import_engine(name)
        from overlapper.reference import Fcl
        from overlapper.scenes.run import run as frames_of
        from overlapper.tables.outputs import outputs
        from overlapper.tables.summary import Summary

        scene = load_scene(name, parameters)
        fcl = stack.enter_context(Fcl()) if check else None
        geometry = {**geometry, "contact": geometry["contact"] or scene.contact}
        settings = {"scene": scene.name, "steps": steps or scene.steps, **geometry, **heading_of(scene.parameters)}
        summary = Summary(scene.name)
        forces = geometry["contact"] == "volumetric"
        take = stack.enter_context(outputs(summary, settings, written, out, html, per, fcl, forces))
        frames = stack.enter_context(closing(frames_of(scene, steps, **geometry)))
        try:
            for frame in with_progress(frames, scene.name, steps or scene.steps):
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
        say(f"Interrupted after step {summary.steps}; what came before is kept.")
    for path in written:
        say(f"Written: {path}")
