"""The command line: scenes run, seen, listed, checked, compared; shapes listed; polytopes intersected; hard cases."""

from __future__ import annotations

import ctypes
import io
import json
import math
import os
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager, redirect_stdout, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, BinaryIO, Literal, NoReturn, TypeVar

try:
    import typer
    from rich.console import Console
    from rich.progress import Progress
except ImportError:
    # The entry point imports this module before it can call anything in it.
    print("overlapper: the command line needs typer and rich: pip install 'overlapper[cli]'", file=sys.stderr)
    sys.exit(2)

from overlapper import __version__
from overlapper.scenes.scene import SceneError, headline, load_scene, scene_paths, scenes_in
from overlapper.scenes.table import link_rows, rows
from overlapper.scenes.table_file import TABLES, origin

if TYPE_CHECKING:
    from overlapper import Hull, Overlap
    from overlapper.cli.summary import Summary
    from overlapper.scenes.playback import Playback, View
    from overlapper.scenes.verdict import Frame
    from overlapper.viewer.look import Look

LIBC = ctypes.CDLL(None)

Step = TypeVar("Step")

# What several commands ask for.
MethodOption = Annotated[
    Literal["auto", "paper"], typer.Option(help="How overlaps are computed; `paper` is the article, step for step.")
]
SurfaceOption = Annotated[
    Literal["nominal", "margin"],
    typer.Option(help="Convex meshes as they are, or with the margin that Bullet lays around them."),
]
ConcaveOption = Annotated[
    Literal["decompose", "enclose", "skip"],
    typer.Option(help="Concave meshes: as convex parts, open ones too with walls around them, or not at all."),
]
ThresholdOption = Annotated[
    float, typer.Option(help="Concavity that may be left, from 0.01 (many parts) to 1 (the hull).")
]

PICTURES_PER_SECOND = 30  # of simulated time: as smooth as a film, and a tenth of the size that every step would take

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


class Refused(Exception):
    """What was asked for cannot be done; the message is one sentence for the person who asked."""


def main() -> NoReturn:
    """The entry point: what the user can mend ends as one sentence on stderr, with exit code 2."""
    # UsageError, which is click's or typer's own, as the version of typer has it.
    usage_error: Any = typer.BadParameter.__bases__[0]
    try:
        sys.exit(app(sys.argv[1:] or ["--help"], prog_name="overlapper", standalone_mode=False))
    except Refused as error:
        _give_up(str(error))
    except usage_error as error:
        _give_up(error.format_message())


def _give_up(sentence: str) -> NoReturn:
    print(f"overlapper: {sentence}", file=sys.stderr)
    sys.exit(2)


def _show_version(wanted: bool) -> None:
    if wanted:
        print(f"overlapper {__version__}")
        raise typer.Exit


@app.callback()
def overlapper(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and leave.")
    ] = False,
) -> None:
    """The volume that the bodies of a pybullet simulation have in common, pair by pair.

    Start with [bold]overlapper scenes[/bold], then run one of them:

    [bold]overlapper run franka_grasp --html grasp.html[/bold]
    """


@app.command()
def scenes() -> None:
    """List the scenes that can be run by name: those of the checkout, and of the folder `scenes` here."""
    for name, path in scene_paths().items():
        print(f"{name:22}{headline(path)}")


@app.command()
def run(
    scene: Annotated[str, typer.Argument(help="Name of a scene, or path of a scene file (.py).", show_default=False)],
    steps: Annotated[
        int | None, typer.Option(min=1, help="Steps to simulate; by default as many as the scene says.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Table of all pairs in all steps: .csv, .parquet, .sqlite.")] = None,
    html: Annotated[Path | None, typer.Option(help="Recording to look at in a browser, one file.")] = None,
    check: Annotated[
        Literal["fcl"] | None, typer.Option(help="Ask FCL about every pair, too, and explain what differs.")
    ] = None,
    method: MethodOption = "auto",
    tolerance: Annotated[float, typer.Option(help="Relative accuracy of smooth shapes; polyhedra are exact.")] = 1e-3,
    per: Annotated[
        Literal["shape", "link"],
        typer.Option(help="What the rows of --out are of: two shapes, or two links as a whole."),
    ] = "shape",
    concave: ConcaveOption = "decompose",
    concave_threshold: ThresholdOption = 0.05,
    surface: SurfaceOption = "nominal",
    pairs: Annotated[
        Literal["simulated", "all"] | None,
        typer.Option(help="Pairs that the simulator lets collide, or all of different bodies; by default PAIRS."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
) -> None:
    """Simulate a scene and measure what its bodies have in common in every step.

    A scene is a Python file with STEPS, the number of steps, and build(client), which fills a pybullet client and may
    return a function step(i) that is called before each step. PAIRS in it may be "all", or a list of pairs of bodies.

    Examples:

    [bold]overlapper run franka_grasp[/bold]  a table of the overlaps

    [bold]overlapper run box_pile --steps 120 --out pile.csv[/bold]  and every pair of every step

    [bold]overlapper run my_scene.py --html my_scene.html[/bold]  and a recording with a time slider

    [bold]overlapper run kuka_jenga --check fcl --json[/bold]  compared with FCL, for a program to read
    """
    if not 0 < tolerance < 1:
        raise Refused(f"--tolerance must lie between 0 and 1, not {tolerance}")
    if out and out.suffix not in TABLES:
        raise Refused(f"--out must end in {', '.join(TABLES)}, not {out.name!r}")
    if not 0.01 <= concave_threshold <= 1:
        raise Refused(f"--concave-threshold must lie between 0.01 and 1, not {concave_threshold}")
    geometry = {
        "tolerance": tolerance,
        "method": method,
        "concave": concave,
        "concave_threshold": concave_threshold,
        "surface": surface,
        "pairs": pairs,
    }
    summary, finished = _measure(scene, steps, out, html, check is not None, per, geometry)
    files = {name: str(path) for name, path in (("out", out), ("html", html)) if path}
    if as_json:
        print(json.dumps(geometry | summary.as_dict() | {"finished": finished} | files))
    else:
        _show(summary, finished, files)
    if not finished:
        raise typer.Exit(130)


@app.command()
def view(
    source: Annotated[
        str, typer.Argument(help="A scene, by name or path, or a table of one that was written.", show_default=False)
    ],
    html: Annotated[Path | None, typer.Option(help="Write a page for any browser; out/<name>.html by default.")] = None,
    png: Annotated[Path | None, typer.Option(help="Draw a picture instead, without a browser.")] = None,
    live: Annotated[bool, typer.Option("--live", help="Watch it in meshcat while it is simulated instead.")] = False,
    steps: Annotated[int | None, typer.Option(min=1, help="Steps of a scene; by default as many as it says.")] = None,
    step: Annotated[
        int | None, typer.Option(min=1, help="Of the picture; by default the one in which most is shared.")
    ] = None,
    close: Annotated[bool, typer.Option("--close", help="The picture is of the largest overlap.")] = False,
    overlaps: Annotated[
        str, typer.Option(help="What is drawn of overlaps: faces, edges, vertices, marks.")
    ] = "faces,marks",
    overlaps_opacity: Annotated[float, typer.Option(help="From 0 to 1.")] = 1.0,
    overlaps_front: Annotated[str | None, typer.Option(help="Colour from outside; the owners' if not given.")] = None,
    overlaps_back: Annotated[str | None, typer.Option(help="Colour from inside, seen if opacity is below 1.")] = None,
    bodies: Annotated[str, typer.Option(help="What is drawn of bodies: faces, edges, vertices.")] = "faces,edges",
    bodies_opacity: Annotated[float, typer.Option(help="From 0 to 1.")] = 0.35,
    bodies_front: Annotated[str | None, typer.Option(help="Colour from outside; their own if not given.")] = None,
    bodies_back: Annotated[str | None, typer.Option(help="Colour from inside; not drawn if not given.")] = None,
) -> None:
    """See a scene, or a table of one: as a page with a time slider, as a picture, or live.

    An expected file has all that is needed. Of any other table the scene is run again, as the table says it was, and
    what is not as in the table is told.

    Examples:

    [bold]overlapper view franka_grasp[/bold]  a page to play, click and measure in: out/franka_grasp.html

    [bold]overlapper view scenes/expected/box_pile.csv --png pile.png --close[/bold]  a picture for a report

    [bold]overlapper view my_scene.py --live --bodies edges --overlaps-opacity 0.6[/bold]
    """
    if sum(map(bool, (html, png, live))) > 1:
        raise Refused("--html, --png and --live do not go together: one at a time")
    looks = (
        _look("bodies", bodies, bodies_opacity, bodies_front, bodies_back),
        _look("overlaps", overlaps, overlaps_opacity, overlaps_front, overlaps_back),
    )
    page = html or Path("out") / f"{Path(source).stem}.html"
    with _quiet() as noise, _refusals(noise), _input_refusals():
        with open(os.devnull, "wb") as nowhere, _diverted(2, nowhere):  # pybullet says on import when it was built
            from overlapper.scenes.playback import play
        playback = play(source, steps)
        with closing(playback.views):
            if live:
                _live(playback, looks)
            elif png:
                _picture(playback, png, step, close, looks)
            else:
                _film(playback, page, looks)
    for remark in playback.remarks:
        print(f"overlapper: {remark}", file=sys.stderr)
    if not live:
        print(f"Written: {png or page}")
    if not live and not png:
        _open(page.resolve().as_uri())


@app.command()
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
        with _quiet() as noise, _refusals(noise):
            with open(os.devnull, "wb") as nowhere, _diverted(2, nowhere):  # pybullet says on import when it was built
                from overlapper.scenes.check import hold
            outcome = hold(scene, out, record)
    except Refused as error:
        print(f"overlapper: {error}", file=sys.stderr)
        return 2
    shown = outcome.lines if outcome.word != "as recorded" else [f"note: {note}" for note in outcome.notes]
    print("\n".join([f"{scene}: {outcome.word}", *(f"    {line}" for line in shown)]), flush=True)
    return 0 if outcome.passed else 1


@app.command()
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

    try:
        recorded, found = read_table(before), read_table(after)
        budgets = ROUNDING | DRIFT | read_budgets(before)
    except (OSError, ValueError, ImportError) as error:
        raise Refused(str(error)) from error
    moved = False
    for cause, differences in (
        ("poses", compare_poses(recorded, found, budgets)),
        ("overlaps", compare_measures(recorded, found, budgets)),
    ):
        moves = sorted(differences.moves, key=lambda move: -move.part)
        print(f"{cause:9} {f'{len(moves):,} moved' if moves else 'the same'}")
        for move in moves[:20]:
            print(f"    {move}")
        if len(moves) > 20:
            print(f"    and {len(moves) - 20:,} more")
        moved = moved or bool(moves)
    raise typer.Exit(1 if moved else 0)


@app.command()
def intersect(
    sources: Annotated[
        list[str],
        typer.Argument(metavar="FILE_OR_URL...", help="Mesh files, and databases of polytopes.", show_default=False),
    ],
    query: Annotated[
        str | None, typer.Option(help="SQL that returns id, x, y, z, one row per point, ordered by id.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Mesh of what is common: .obj, .stl, .ply.")] = None,
    method: MethodOption = "auto",
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the lines.")] = False,
) -> None:
    """Measure what convex polytopes have in common, all of them together, without a simulator.

    A mesh file gives the convex hull of its points; a database, named by its SQLAlchemy URL, every polytope that
    --query returns, or that overlapper.write_polytopes has put there. Lengths are taken for m.

    Examples:

    [bold]overlapper intersect bolt.stl plate.stl --out clash.stl[/bold]

    [bold]overlapper intersect sqlite:///parts.db[/bold]

    [bold]overlapper intersect postgresql+psycopg://me@host/db --query "SELECT part, x, y, z FROM p ORDER BY 1"[/bold]
    """
    from overlapper import overlap

    with _input_refusals():
        if out:
            from overlapper.polytopes.mesh_file import check_ending, write_mesh

            check_ending(out)
        hulls = [hull for source in sources for hull in _hulls(source, query)]
    if len(hulls) < 2:
        raise Refused(f"at least two polytopes are needed, not {len(hulls)}")
    common = overlap(*hulls, method=method)
    written = out if common else None
    if written:
        with _input_refusals():
            write_mesh(written, common)
    facts = _facts(common) | {"method": method, "out": str(written) if written else None}
    if as_json:
        print(json.dumps(facts))
        return
    for name, fact in facts.items():
        if name == "volume" or (fact and name not in ("volume_error", "method", "out")):
            error = f" ± {common.volume_error:.1g}" if name == "volume" else ""
            print(f"{name:10}{_digits(fact)}{error}{UNITS.get(name, '')}")
    if out:
        print(f"Written: {out}" if written else f"Not written, as nothing is in common: {out}")


@app.command()
def shapes(
    file: Annotated[
        Path, typer.Argument(help="A model or a scene: .urdf, .sdf, .xml (MJCF), .bullet.", show_default=False)
    ],
    surface: SurfaceOption = "nominal",
    concave: ConcaveOption = "decompose",
    concave_threshold: ThresholdOption = 0.05,
    self_collision: Annotated[
        bool, typer.Option("--self-collision", help="Load it with pybullet's URDF_USE_SELF_COLLISION.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object, of every shape, instead.")] = False,
) -> None:
    """List what is modelled of a file that pybullet loads: shapes by link, sizes, who may collide, what is skipped.

    The exit code is 0 if all of it is modelled, 1 if something is skipped, and 2 if pybullet cannot load it.

    Examples:

    [bold]overlapper shapes robot.urdf[/bold]

    [bold]overlapper shapes humanoid.xml --self-collision --json[/bold]
    """
    from overlapper.simulation.inventory import NotRead, inventory

    try:
        found = inventory(file, self_collision, surface=surface, concave=concave, concave_threshold=concave_threshold)
    except (NotRead, ImportError) as error:
        raise Refused(str(error)) from error
    if as_json:
        print(json.dumps(found.as_dict()))
    else:
        from overlapper.cli.listing import remarks, shapes_table

        console = Console(width=None if sys.stdout.isatty() else 140, highlight=False)
        if found.links:
            console.print(shapes_table(found))
        for line in remarks(found):
            console.print(line, markup=False, soft_wrap=True)
    raise typer.Exit(1 if found.skipped else 0)


@app.command()
def stability(
    seed: Annotated[int, typer.Option(min=0, help="Of the first case of each family.")] = 0,
    count: Annotated[int, typer.Option(min=1, help="About so many cases.")] = 2000,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for results, page and pictures; by default where the checkout has its own."),
    ] = None,
) -> None:
    """Put hard cases to this package and to others, and chart who fails where: for a checkout, some minutes."""
    folder = [f"--out={out}"] if out else []
    raise typer.Exit(_run_benchmark("stability", f"--seed={seed}", f"--count={count}", *folder))


@app.command()
def chart(
    family: Annotated[
        list[str] | None,
        typer.Option(help="Measure these pairs only, such as 'box deep'; may be repeated.", show_default=False),
    ] = None,
    method: Annotated[
        list[str] | None,
        typer.Option(help="Ask these only, such as 'manifold3d'; may be repeated.", show_default=False),
    ] = None,
    seconds: Annotated[float, typer.Option(min=0.0, help="About so long the methods take turns on a family.")] = 4.0,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for results, page and pictures; by default where the checkout has its own."),
    ] = None,
    page: Annotated[bool, typer.Option("--page", help="Only draw, from the results there are.")] = False,
) -> None:
    """Time this package and others on the same pairs and chart error over time: for a checkout, twenty minutes.

    Then, unless pairs or methods are chosen, chart where the time of a step goes. Volumes are compared with the exact
    truth, or with single calls; the exit code is 1 if one of this package is wrong.
    """
    chosen = [f"--family={name}" for name in family or ()] + [f"--method={name}" for name in method or ()]
    common = [*([f"--out={out}"] if out else []), *["--page"] * page]
    code = _run_benchmark("chart", f"--seconds={seconds}", *chosen, *common)
    if not code and not chosen:
        code = _run_benchmark("scene_steps", *common)
    raise typer.Exit(code)


def _run_benchmark(name: str, *options: str) -> int:
    """Returns its exit code."""
    script = Path(__file__).parents[2] / "benchmarks" / f"{name}.py"
    if not script.is_file():
        raise Refused(f"{name} needs a checkout of overlapper, as its cases and peers are not installed")
    return subprocess.run([sys.executable, str(script), *options]).returncode


def _hulls(source: str, query: str | None) -> Iterator[Hull]:
    """The polytopes of one argument; what has been taken for them that is more than they are is named on stderr."""
    if "://" in source:
        from overlapper.polytopes.database import read_polytopes

        yield from (hull for _, hull in read_polytopes(source, query))
        return
    from overlapper.polytopes.mesh_file import NotConvexWarning, read_hull

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", NotConvexWarning)
        hull = read_hull(source)
    for warning in caught:
        if issubclass(warning.category, NotConvexWarning):
            print(f"overlapper: {warning.message}", file=sys.stderr)
    yield hull


@contextmanager
def _input_refusals() -> Iterator[None]:
    """Turns what is wrong with files and databases into one sentence."""
    try:
        yield
    except OSError as error:
        raise Refused(f"{error.filename}: {error.strerror}" if error.filename else str(error)) from error
    except (ImportError, ValueError) as error:
        raise Refused(str(error)) from error
    except Exception as error:
        # SQLAlchemy may not be there to name the class; its message goes on for lines about itself.
        if not type(error).__module__.startswith("sqlalchemy."):
            raise
        raise Refused(f"the database says: {str(getattr(error, 'orig', None) or error).splitlines()[0]}") from error


def _facts(common: Overlap) -> dict[str, Any]:
    centroid, normal = common.centroid, common.normal
    return {
        "polytopes": len(common.shapes),
        "status": common.status,
        "volume": common.volume,
        "volume_error": common.volume_error,
        "area": common.area,
        "centroid": None if centroid is None else centroid.tolist(),
        "depth": common.depth,
        "distance": common.distance,
        "normal": None if normal is None else normal.tolist(),
        "corners": len(common.vertices),
        "facets": len(common.facets),
    }


UNITS = {"volume": " m³", "area": " m²", "centroid": " m", "depth": " m", "distance": " m"}


def _digits(fact: Any) -> str:
    if isinstance(fact, list):
        return ", ".join(map(_digits, fact))
    return f"{fact:.9g}" if isinstance(fact, float) else str(fact)


def _measure(
    name: str,
    steps: int | None,
    out: Path | None,
    html: Path | None,
    check: bool,
    per: Literal["shape", "link"],
    geometry: Mapping[str, Any],
) -> tuple[Summary, bool]:
    """The run, with its files; False if it was interrupted, and then both have what was done until then."""
    with _quiet() as noise, _refusals(noise), ExitStack() as stack:
        with open(os.devnull, "wb") as nowhere, _diverted(2, nowhere):  # pybullet says on import when it was built
            from overlapper.scenes.verdict import run as frames_of
            from overlapper.simulation import link_contacts
        from overlapper.cli.summary import Summary
        from overlapper.reference import Fcl

        scene = load_scene(name)
        fcl = stack.enter_context(Fcl()) if check else None
        for path in filter(None, (out, html)):
            path.parent.mkdir(parents=True, exist_ok=True)
        settings = {
            "scene": scene.name,
            "steps": str(steps or scene.steps),
            "per": per,
            **{setting: str(value) for setting, value in geometry.items()},
        }
        table = stack.enter_context(closing(TABLES[out.suffix](out, origin() | settings))) if out else None
        record = stack.enter_context(_recorder(html)) if html else None
        frames = stack.enter_context(closing(frames_of(scene, steps, **geometry)))
        summary = Summary(scene.name)
        try:
            for frame in _with_progress(frames, scene.name, steps or scene.steps):
                opinions = fcl.compare_many(contact.overlap for contact in frame.contacts) if fcl else []
                if table:
                    where = frame.step, frame.time, frame.bodies
                    if per == "link":
                        table.write(link_rows(*where, link_contacts(frame.contacts)))
                    else:
                        table.write(rows(*where, frame.contacts, opinions))
                summary.add(frame, opinions)
                if record:
                    record(frame)
        except KeyboardInterrupt:
            return summary, False
    return summary, True


def _with_progress(frames: Iterable[Step], name: str, steps: int) -> Iterator[Step]:
    """The frames, counted by a bar on stderr if that is a terminal."""
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        yield from progress.track(frames, total=steps, description=name)


@contextmanager
def _recorder(
    path: Path, looks: Sequence[Look] = (), rate: float = PICTURES_PER_SECOND
) -> Iterator[Callable[[Frame | View], None]]:
    """Records some of the frames it is called with, and writes the page in the end, however that comes."""
    from overlapper.viewer import Recording

    path.touch()  # better refused now than after the run
    recording = Recording(*looks)
    shown = 0

    def record(frame: Frame | View) -> None:
        nonlocal shown
        if frame.time * rate >= shown:
            recording.add(frame.bodies, frame.contacts, frame.time)
            shown += 1

    try:
        yield record
    finally:
        if shown:
            recording.save(path)


def _film(playback: Playback, html: Path, looks: Sequence[Look]) -> None:
    html.parent.mkdir(parents=True, exist_ok=True)
    rate = math.inf if playback.sparse else PICTURES_PER_SECOND
    with _recorder(html, looks, rate) as record, suppress(KeyboardInterrupt):
        for view in _with_progress(playback.views, playback.name, playback.total):
            record(view)


def _picture(playback: Playback, png: Path, step: int | None, close: bool, looks: tuple[Look, Look]) -> None:
    from overlapper.scenes.playback import at_step, largest
    from overlapper.viewer import picture

    views = _with_progress(playback.views, playback.name, playback.total)
    view = at_step(views, step) if step else largest(views)
    png.parent.mkdir(parents=True, exist_ok=True)
    title = f"{playback.name}, step {view.step}, {view.time:.3f} s"
    picture.save(png, view.bodies, view.contacts, title, close, looks)


def _live(playback: Playback, looks: Sequence[Look]) -> None:
    """As fast as the simulation is in the world, or as it can be; stays until it is interrupted, on a terminal."""
    from overlapper.viewer import Viewer

    with redirect_stdout(io.StringIO()):  # meshcat says where it is, too
        viewer = Viewer(None, *looks)
    with viewer, suppress(KeyboardInterrupt):
        print(f"overlapper: {viewer.url} (Ctrl-C ends it)", file=sys.stderr, flush=True)
        _open(viewer.url)
        start, shown = time.monotonic(), 0
        for view in playback.views:
            if view.time * PICTURES_PER_SECOND >= shown or playback.sparse:
                time.sleep(max(0.0, start + view.time - time.monotonic()))
                viewer.show(view.bodies, view.contacts)
                shown += 1
        while sys.stderr.isatty():
            time.sleep(3600)


def _open(address: str) -> None:
    """In a browser, for somebody who sits at a screen."""
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


@contextmanager
def _refusals(noise: BinaryIO) -> Iterator[None]:
    """Turns what the user can mend into one sentence, to which the last line that C has printed may add the cause."""
    try:
        yield
    except ImportError as error:
        raise Refused(str(error)) from error
    except OSError as error:
        raise Refused(f"cannot write {error.filename or 'the results'}: {error.strerror}") from error
    except SceneError as error:
        LIBC.fflush(None)
        noise.seek(0)
        last_words = noise.read().decode(errors="replace").strip().rpartition("\n")[2]
        raise Refused(f"{error} ({last_words})" if last_words else str(error)) from error


@contextmanager
def _quiet() -> Iterator[BinaryIO]:
    """Keeps stdout for the answer: what Python prints goes to stderr, what C prints (as pybullet) to the file given."""
    with tempfile.TemporaryFile() as noise, redirect_stdout(sys.stderr), warnings.catch_warnings(), _diverted(1, noise):
        warnings.simplefilter("ignore", UserWarning)  # of shapes left out: the summary names them
        yield noise


@contextmanager
def _diverted(descriptor: int, file: BinaryIO) -> Iterator[None]:
    """Whatever goes to a file descriptor goes to `file` meanwhile, whoever writes it."""
    kept = os.dup(descriptor)
    os.dup2(file.fileno(), descriptor)
    try:
        yield
    finally:
        LIBC.fflush(None)  # or what C still holds would follow later
        os.dup2(kept, descriptor)
        os.close(kept)


def _show(summary: Summary, finished: bool, files: dict[str, str]) -> None:
    from overlapper.cli.summary import overlaps_table, remarks

    console = Console(width=None if sys.stdout.isatty() else 140, highlight=False)
    console.print(overlaps_table(summary) if summary.pairs else f"Nothing overlaps in {summary.steps} steps.")
    for line in remarks(summary):
        console.print(line, markup=False, soft_wrap=True)
    if not finished:
        console.print(f"Interrupted after step {summary.steps}; what came before is kept.")
    for path in files.values():
        console.print(f"Written: {path}", markup=False, soft_wrap=True)
