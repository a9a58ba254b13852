"""The options that several commands have."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from overlapper.cli.refusals import Refused
from overlapper.scenes.scene import ContactModel, scene_paths
from overlapper.simulation.settings import Asking, Modelling


def _scene_names(begun: str) -> list[str]:
    return [name for name in scene_paths() if name.startswith(begun)]


SceneArgument = Annotated[
    str,
    typer.Argument(
        help="Name of a scene, or path of a scene file (.py).", show_default=False, autocompletion=_scene_names
    ),
]

OutOption = Annotated[
    Path | None, typer.Option(help="Write a table of all pairs in all steps: .csv, .parquet, .sqlite.")
]

HtmlOption = Annotated[Path | None, typer.Option(help="Write a recording as one HTML file, to open in a browser.")]

CheckOption = Annotated[
    Literal["fcl", "mujoco"] | None,
    typer.Option(help="Compare every pair with FCL or, in MuJoCo, with MuJoCo's own answer, and explain differences."),
]

ToleranceOption = Annotated[
    float, typer.Option(help="Allowed relative error of the volume of curved shapes. Polyhedra are exact.")
]

PerOption = Annotated[
    Literal["shape", "link"], typer.Option(help="A row of --out is a pair of shapes, or a pair of whole links.")
]

MethodOption = Annotated[
    Literal["auto", "paper"],
    typer.Option(help="Method of computation. `paper` follows the published article step by step."),
]

SurfaceOption = Annotated[
    Literal["nominal", "margin"],
    typer.Option(help="Convex meshes as they are, or with the collision margin of Bullet."),
]

ConcaveOption = Annotated[
    Literal["decompose", "enclose", "skip"],
    typer.Option(help="Concave meshes: make convex parts, close open meshes first (`enclose`), or skip them."),
]

ThresholdOption = Annotated[
    float, typer.Option(help="Allowed concavity of convex parts, from 0.01 (many parts) to 1 (the convex hull).")
]

PairsOption = Annotated[
    Literal["simulated", "all"] | None,
    typer.Option(
        help="Pairs that the simulator lets collide, or all pairs of different bodies. Default: PAIRS of the scene."
    ),
]

ContactOption = Annotated[
    ContactModel | None,
    typer.Option(
        help="Contact model: contact points of the engine, or volumetric contact. Default: CONTACT of the scene."
    ),
]

SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="NAME=VALUE", help="Set a parameter of the scene. May be repeated.", show_default=False
    ),
]


def given_parameters(settings: Sequence[str] | None) -> dict[str, str]:
    """The values of --set by name. Refused if a value is missing or a name is given twice."""
    given: dict[str, str] = {}
    for each in settings or ():
        name, sign, text = each.partition("=")
        if not (name and sign):
            raise Refused(f"--set must be NAME=VALUE, not {each!r}")
        if name in given:
            raise Refused(f"--set gives {name} twice")
        given[name] = text
    return given


@dataclass(frozen=True, slots=True)
class Simulated:
    """How a scene is simulated: its parameters as text, the number of its steps, and what pushes bodies apart.

    None stands for what the scene says.
    """

    parameters: dict[str, str]
    steps: int | None
    contact: ContactModel | None


def simulated(
    given: SetOption = None,
    steps: Annotated[
        int | None, typer.Option(min=1, help="Number of steps to simulate. Default: STEPS of the scene.")
    ] = None,
    contact: ContactOption = None,
) -> Simulated:
    """How a scene is simulated."""
    return Simulated(given_parameters(given), steps, contact)


BetweenOption = Annotated[
    bool,
    typer.Option("--between", help="Find pairs that passed through each other between two steps, and when they met."),
]

LeastDepthOption = Annotated[
    float, typer.Option(min=0.0, help="Ignore overlaps with a depth below this, in m.", show_default=False)
]

ExpectOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="A,B", help="Names of two that may overlap. * matches any text. May be repeated.", show_default=False
    ),
]


def expected_pairs(given: list[str] | None) -> list[tuple[str, str]]:
    """The pairs given to --expect."""
    from overlapper.audit.allowed import allowed_pair

    try:
        return [allowed_pair(each) for each in given or ()]
    except ValueError as error:
        raise Refused(str(error)) from error


def refuse_tolerance(tolerance: float) -> None:
    """Refuse a tolerance that is out of range."""
    if not 0 < tolerance < 1:
        raise Refused(f"--tolerance must lie between 0 and 1, not {tolerance}")


def refuse_threshold(concave_threshold: float) -> None:
    """Refuse a threshold that CoACD does not take."""
    if not 0.01 <= concave_threshold <= 1:
        raise Refused(f"--concave-threshold must lie between 0.01 and 1, not {concave_threshold}")


def refuse_table(out: Path | None) -> None:
    """Refuse a table of an unknown kind."""
    from overlapper.tables.table_file import TABLES

    if out and out.suffix not in TABLES:
        raise Refused(f"--out must end in {', '.join(TABLES)}, not {out.name!r}")


def modelling(
    concave: ConcaveOption = "decompose", concave_threshold: ThresholdOption = 0.05, surface: SurfaceOption = "nominal"
) -> Modelling:
    """How shapes are modelled."""
    refuse_threshold(concave_threshold)
    return Modelling(concave, concave_threshold, surface)


def asking(method: MethodOption = "auto", tolerance: ToleranceOption = 1e-3, pairs: PairsOption = None) -> Asking:
    """Which pairs are measured, and how."""
    refuse_tolerance(tolerance)
    return Asking(pairs, tolerance, method)


@dataclass(frozen=True, slots=True)
class Written:
    """The files that a run writes, whether rows are of shapes or of links, and which program is asked, too."""

    out: Path | None
    html: Path | None
    per: Literal["shape", "link"]
    check: Literal["fcl", "mujoco"] | None


def files(
    out: OutOption = None, html: HtmlOption = None, check: CheckOption = None, per: PerOption = "shape"
) -> Written:
    """The files that a run writes."""
    refuse_table(out)
    return Written(out, html, per, check)


def options_given(context: typer.Context | None) -> list[str]:
    """The options on the command line. None of them if the command is called as a function."""
    if context is None:
        return []
    options = {each.name: each.opts[0] for each in context.command.params if each.param_type_name == "option"}
    sources = {option: context.get_parameter_source(name) for name, option in options.items() if name}
    return [option for option, source in sources.items() if source and source.name == "COMMANDLINE"]


def with_options(**groups: Callable[..., Any]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """For commands: a parameter of each of these names has the options that the function takes, and is its answer."""

    def decorated(command: Callable[..., Any]) -> Callable[..., Any]:
        taken = {name: _parameters(make) for name, make in groups.items()}
        own = _parameters(command, leave=groups.keys())
        told = {each: value for name, one in own.items() for each, value in taken.get(name, {name: one}).items()}

        defaults = {name: each.default for name, each in told.items() if each.default is not each.empty}

        @wraps(command)
        def called(*arguments: Any, **given: Any) -> Any:
            given = defaults | dict(zip(told, arguments)) | given
            made = {name: make(**{each: given.pop(each) for each in taken[name]}) for name, make in groups.items()}
            return command(**given, **made)

        called.__signature__ = inspect.Signature([*told.values()])  # type: ignore[attr-defined]
        called.__annotations__ = {name: each.annotation for name, each in told.items()}
        return called

    return decorated


def _parameters(function: Callable[..., Any], leave: Collection[str] = ()) -> dict[str, inspect.Parameter]:
    """The parameters by name, with their annotations evaluated but for those to `leave`."""
    where = function.__globals__
    return {
        name: each.replace(
            kind=each.KEYWORD_ONLY, annotation=each.annotation if name in leave else eval(each.annotation, where)
        )
        for name, each in inspect.signature(function).parameters.items()
    }
