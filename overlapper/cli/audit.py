"""`overlapper audit`: which pairs of links of a robot can overlap at all."""

from __future__ import annotations

import json
from collections import Counter
from contextlib import AbstractContextManager
from dataclasses import asdict, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NoReturn

import typer
from rich.table import Table
from rich.text import Text

from overlapper.cli.assets import audit_folder
from overlapper.cli.engine import working
from overlapper.cli.figures import VOLUME_UNITS, plain_table, show, volume_unit
from overlapper.cli.options import (
    ExpectOption,
    HtmlOption,
    LeastDepthOption,
    ToleranceOption,
    expected_pairs,
    modelling,
    options_given,
    refuse_table,
    refuse_tolerance,
    with_options,
)
from overlapper.cli.recorded import with_progress
from overlapper.cli.refusals import Refused, input_refusals, quiet, say
from overlapper.printable import printable
from overlapper.simulation.settings import Modelling, settings_of

if TYPE_CHECKING:
    from overlapper.audit.audit import Audit, PairAudit
    from overlapper.jobs.executor import Executor

LISTED = 20  # pairs at most
LIMIT = 20_000  # boxes for each pair of links
HOW_SHAPES_ARE_READ = {"--concave", "--concave-threshold", "--surface"}
OF_FOLDERS = {"--least-depth", "--out", "--units", "--json", *HOW_SHAPES_ARE_READ}
OF_VERIFY = {"--verify", "--json", *HOW_SHAPES_ARE_READ}
CAPTION = (
    "Fraction: share of the random configurations, with its 95 % confidence bounds. Volume: the largest. Depth: the "
    "largest, of the deepest pair of shapes."
)


@with_options(engine=working, modelled=modelling)
def audit(
    robot: Annotated[
        Path,
        typer.Argument(
            metavar="ROBOT|FOLDER",
            help="Robot model (.urdf, .sdf, .xml of MJCF), or folder of assets.",
            show_default=False,
        ),
    ],
    *,
    configurations: Annotated[int, typer.Option(min=1, help="Number of configurations to sample.")] = 100_000,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the random configurations.")] = 0,
    expect: ExpectOption = None,
    least_depth: LeastDepthOption = 0.0,
    against: Annotated[Path | None, typer.Option(help="SRDF file whose disabled pairs are checked.")] = None,
    srdf: Annotated[Path | None, typer.Option(help="Write an SRDF file for a motion planner, or extend one.")] = None,
    exclude: Annotated[
        Path | None, typer.Option(help="Write the same pairs as <exclude> to an MJCF file (.xml) for MuJoCo.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Write a table of all pairs of links, or of all assets: .csv, .parquet, .sqlite."),
    ] = None,
    html: HtmlOption = None,
    prove: Annotated[
        bool, typer.Option("--prove", help="Prove which pairs never overlap, for all joint positions.")
    ] = False,
    limit: Annotated[
        int | None,
        typer.Option(min=1, help=f"Boxes of joint positions that --prove takes for a pair: {LIMIT:,} if not given."),
    ] = None,
    cover: Annotated[
        Path | None, typer.Option(help="Write the proofs of --prove to a file that --verify checks: .npz.")
    ] = None,
    verify: Annotated[
        Path | None, typer.Option(help="Check the proofs of a file without the core, and nothing else.")
    ] = None,
    engine: AbstractContextManager[Executor],
    tolerance: ToleranceOption = 1e-3,
    modelled: Modelling,
    units: Annotated[
        Literal["mm", "cm", "m", "in"], typer.Option(help="Unit of length of meshes whose files state none.")
    ] = "m",
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
    context: typer.Context = None,  # type: ignore[assignment]  # typer gives it
) -> None:
    """Report which pairs of links of a robot overlap never, sometimes or always: how often, how much and how deep.

    The command samples configurations of the joints: the rest pose, corners of the joint limits, and random ones. Two
    links are adjacent if a joint connects them, or joints and links without shapes. Adjacent links overlap by design,
    and are not reported. The exit code is 1 if a pair that is not adjacent always overlaps, if a pair that --against
    disables overlaps, or if a shape is not modelled. It is 2 if the robot cannot be read, else 0.

    --prove adds an answer for all joint positions, for each pair that is not adjacent: never (proved), overlaps (with a
    configuration), or open. The exit code is then also 1 if a pair is open. With --verify, it is 1 if a proof of the
    file does not hold.

    For a folder of models and meshes, the command reports which files load, which meshes are closed, and what is left
    out and why. It also reports how much volume convex parts add, and which models overlap with themselves at rest.
    The exit code is 1 if anything is reported.

    Examples:

    [bold]overlapper audit robot.urdf[/bold]

    [bold]overlapper audit robot.urdf --srdf robot.srdf --out pairs.csv --html worst.html[/bold]  with three files

    [bold]overlapper audit robot.urdf --against robot.srdf --expect "*finger,*finger"[/bold]  a test for CI

    [bold]overlapper audit robot.urdf --prove --cover proofs.npz[/bold]  for all joint positions

    [bold]overlapper audit robot.urdf --verify proofs.npz[/bold]  checks the proofs again

    [bold]overlapper audit assets --units mm[/bold]  a folder of models and meshes
    """
    refuse_tolerance(tolerance)
    refuse_table(out)
    _refuse_without_proofs(prove, limit, cover)
    boxes = limit or LIMIT
    pairs = expected_pairs(expect)
    settings: dict[str, Any] = {
        "configurations": configurations,
        "seed": seed,
        "expect": expect or [],
        "least_depth": least_depth,
        "against": str(against) if against else None,
        "tolerance": tolerance,
        **settings_of(modelled),
    }
    settings |= {"limit": boxes} if prove else {}
    given = options_given(context)
    if robot.is_dir():
        if of_robots := [each for each in given if each not in OF_FOLDERS]:
            raise Refused(f"{of_robots[0]} needs a robot, but {robot} is a folder")
        audit_folder(robot, units, least_depth, modelled, out, as_json)
    if "--units" in given:
        raise Refused(f"--units needs a folder, but {robot} is a robot")
    if verify:
        if ignored := [each for each in given if each not in OF_VERIFY]:
            raise Refused(f"{ignored[0]} has no effect with --verify, which only checks proofs")
        _verify(robot, verify, modelled, as_json)
    written: list[Path] = []
    with input_refusals(), quiet():
        from overlapper.audit.allowed import must_name_some
        from overlapper.audit.audit import audit as look
        from overlapper.audit.findings import findings, remarks
        from overlapper.audit.page import addresses, write_page
        from overlapper.audit.robot import not_modelled, read_robot
        from overlapper.audit.srdf import extended, read_srdf, write_excludes, write_srdf
        from overlapper.audit.table import facts, write_table
        from overlapper.simulation.bullet.model_file import NotRead
        from overlapper.tables.outputs import can_be_written

        can_be_written(out, html, srdf, exclude, cover)
        import_module("overlapper.audit.prove" if prove else "overlapper.audit.audit")  # python-flint may be missing
        disabled = read_srdf(against) if against else {}
        try:
            read = read_robot(robot, modelled)
        except NotRead as error:
            raise Refused(str(error)) from error
        must_name_some(pairs, read.link_names, "link")
        if srdf:
            extended(srdf, read.name)  # a file that it cannot extend is refused before the audit
        with engine as working:
            found = look(
                read,
                configurations,
                seed,
                tolerance,
                least_depth,
                working,
                lambda blocks, count: with_progress(blocks, robot.name, count),
            )
            if prove:
                found = _proved(found, boxes, least_depth, working)
        if not found.pairs:
            left_out = "".join(f"; {name} is not modelled, because {why}" for name, why in not_modelled(read).items())
            raise Refused(f"{robot} has no two links with shapes that could overlap{left_out}")
        page = addresses(found, html) if html else {}
        if out:
            write_table(found, out, settings, page)
            written.append(out)
        if srdf:
            write_srdf(found, srdf)
            written.append(srdf)
        if exclude:
            write_excludes(found, exclude)
            written.append(exclude)
        written += _write_covers(found, cover)
        if html:
            write_page(found, html)
            written.append(html)
        wrong = findings(found, pairs, disabled)
    if as_json:
        places = {"out": out, "srdf": srdf, "exclude": exclude, "html": html, "cover": cover}
        files = {name: str(path) for name, path in places.items() if path}
        about: dict[str, Any] = {"robot": read.name, "joints": list(read.columns), "remarks": remarks(read)}
        about["not_modelled"] = not_modelled(read)
        told = {"pairs": facts(found, page), "findings": wrong}
        print(json.dumps({"settings": settings} | about | told | files))
    else:
        _show(found, wrong, written)
    raise typer.Exit(1 if wrong else 0)


def _refuse_without_proofs(prove: bool, limit: int | None, cover: Path | None) -> None:
    """Refuse options of proofs that would have no effect, and a file of proofs with another ending."""
    for name, given in {"--limit": limit, "--cover": cover}.items():
        if given and not prove:
            raise Refused(f"{name} needs --prove")
    if cover and cover.suffix != ".npz":
        raise Refused(f"--cover must end in .npz, not {cover.name!r}")


def _proved(found: Audit, limit: int, least_depth: float, engine: Executor) -> Audit:
    """The audit with the answers for all joint positions."""
    from overlapper.audit.prove import prove

    name = f"proofs of {found.robot.name}"
    proofs = prove(found, limit, least_depth, engine, lambda proofs, count: with_progress(proofs, name, count))
    return replace(found, proofs={each.pair.links: each for each in proofs})


def _write_covers(found: Audit, cover: Path | None) -> list[Path]:
    if cover is None:
        return []
    from overlapper.audit.cover_file import write_covers

    write_covers(found.robot, found.proofs.values(), cover)
    return [cover]


def _verify(path: Path, cover: Path, modelled: Modelling, as_json: bool) -> NoReturn:
    """Check the proofs of a file, show what holds, and leave: 1 if a proof does not hold, else 0."""
    with input_refusals(), quiet():
        from overlapper.audit.cover_file import verify
        from overlapper.audit.robot import read_robot
        from overlapper.simulation.bullet.model_file import NotRead

        try:
            checked = verify(read_robot(path, modelled), cover)
        except NotRead as error:
            raise Refused(str(error)) from error
    proved = [each for each in checked if not each.wrong and not each.open_share]
    if as_json:
        print(json.dumps({"robot": str(path), "cover": str(cover), "pairs": [asdict(each) for each in checked]}))
    else:
        for each in checked:
            names = " and ".join(each.names)
            if each.wrong:
                say(f"Refused: {names}, {each.wrong}.")
            elif each.open_share:
                say(f"Open: {names}, {100 * each.open_share:.3g} % of the joint positions.")
        say(f"{len(proved):,} of {len(checked):,} pairs of links in {cover} are proved never to overlap.")
    raise typer.Exit(0 if len(proved) == len(checked) else 1)


def _show(found: Audit, wrong: list[str], written: list[Path]) -> None:
    from overlapper.audit.findings import remarks
    from overlapper.audit.robot import not_modelled

    met = [each for each in found.pairs if each.met and not each.pair.adjacent]
    if met:
        show(_list(found, sorted(met, key=lambda each: (-_often(each), each.names))))
    counts = {status: len(found.of_status(status)) for status in ("never", "sometimes", "always")}
    adjacent = len(found.pairs) - sum(counts.values())
    words = [f"{adjacent:,} {'are' if adjacent != 1 else 'is'} adjacent"]
    left_out = len(not_modelled(found.robot))
    words += [
        f"{count:,} {status} {'overlaps' if count == 1 else 'overlap'}" for status, count in counts.items() if count
    ]
    links = len({link for each in found.pairs for link in each.pair.links})
    say(
        f"Of {len(found.pairs):,} pairs of {links:,} links, {', '.join(words)} in {found.sampling.count:,} "
        "configurations."
    )
    if found.proofs:
        _say_proofs(found)
    if left_out:
        say(f"{left_out:,} {'links are' if left_out > 1 else 'link is'} not modelled whole.")
    for line in (*remarks(found.robot), *wrong, *(f"Written: {path}" for path in written)):
        say(line)


def _say_proofs(found: Audit) -> None:
    """How many pairs are proved, overlap or are open, and the configurations of overlaps that no sample had."""
    verdicts = Counter(proof.verdict for proof in found.proofs.values())
    say(
        f"For all joint positions: {verdicts['never']:,} of {len(found.proofs):,} pairs that are not adjacent never "
        f"overlap (proved), {verdicts['overlaps']:,} overlap, {verdicts['open']:,} are open."
    )
    for each in found.pairs:
        proof = found.proofs.get(each.pair.links)
        if proof and proof.verdict == "overlaps" and not each.met and proof.values is not None:
            where = ", ".join(f"{name} {value:.6g}" for name, value in zip(found.robot.columns, proof.values.tolist()))
            say(f"Overlap that no sample had: {' and '.join(each.names)} at {where}.")


def _often(audited: PairAudit) -> float:
    return audited.fraction[0] if audited.fraction else audited.met / audited.asked


def _list(found: Audit, met: list[PairAudit]) -> Table:
    """The pairs that overlap most often, two lines each."""
    unit = volume_unit(max(each.largest.contact.volume for each in met if each.largest))
    left_out = f" The {LISTED} of {len(met):,} pairs that overlap most often." if len(met) > LISTED else ""
    table = plain_table(
        title="Links that overlap and are not adjacent",
        caption=CAPTION + left_out,
    )
    table.add_column("pair of links", overflow="fold")
    for header in ("", "fraction\n%", "95 %\n%", f"volume\n{unit}", "depth\nmm"):
        table.add_column(header, justify="right" if header else "left", no_wrap=True)
    for each in met[:LISTED]:
        assert each.largest and each.deepest
        fraction, low, high = (f"{100 * value:.3g}" for value in each.fraction) if each.fraction else ("", "", "")
        table.add_row(
            Text("\n ".join(map(printable, each.names))),
            each.status,
            fraction,
            f"{low} to {high}" if each.fraction else "",
            f"{each.largest.contact.volume / VOLUME_UNITS[unit]:.4g}",
            f"{1e3 * each.deepest.contact.depth:.3g}",
        )
    return table
