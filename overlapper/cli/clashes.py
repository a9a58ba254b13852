"""`overlapper clashes`: which bodies of mesh files overlap that should not."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

import typer
from rich.table import Table
from rich.text import Text

from overlapper.cli.figures import ROUNDED_UP, VOLUME_UNITS, plain_table, show, volume_unit
from overlapper.cli.options import (
    ExpectOption,
    HtmlOption,
    LeastDepthOption,
    ThresholdOption,
    expected_pairs,
    refuse_table,
    refuse_threshold,
)
from overlapper.cli.refusals import Refused, input_refusals, quiet, say
from overlapper.printable import printable

if TYPE_CHECKING:
    from overlapper.audit.clashes import Clash, Clashes, MeshBody

IN_MATRIX = 12  # bodies at most, so that a terminal holds it
LISTED = 20  # pairs at most
CAPTION = (
    "Volume: that of the meshes, with error bound ±; marked with *: that of their convex parts. Depth: the shortest "
    "translation that separates the deepest two convex parts. Convex parts: their number, and their excess volume."
)


def clashes(
    sources: Annotated[
        list[Path],
        typer.Argument(
            metavar="FOLDER|FILE...", help="Mesh files, a folder of them, or one assembly file.", show_default=False
        ),
    ],
    units: Annotated[
        Literal["mm", "cm", "m", "in"],
        typer.Option(help="Unit of length of files that state none, such as STL, OBJ and PLY."),
    ] = "m",
    least_depth: LeastDepthOption = 0.0,
    expect: ExpectOption = None,
    concave: Annotated[
        Literal["decompose", "enclose"],
        typer.Option(help="Make convex parts of concave meshes. `enclose` also closes open meshes first."),
    ] = "decompose",
    concave_threshold: ThresholdOption = 0.05,
    out: Annotated[
        Path | None, typer.Option(help="Write a table of all pairs of convex parts: .csv, .parquet, .sqlite.")
    ] = None,
    html: HtmlOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
) -> None:
    """Report which bodies of mesh files overlap, by how much, and how deep.

    Each mesh file is one body. An assembly (glTF, 3MF, STEP) has one body for each part that it shows. Volumes are
    those of the meshes, concave or not, if the meshes are closed. Depths are those of convex parts, which CoACD makes
    of concave meshes. The excess volume of the parts stands beside every result. The exit code is 0 without a clash,
    1 with a clash, and 2 if a mesh could not be read or measured.

    Examples:

    [bold]overlapper clashes parts --units mm --html clashes.html[/bold]  all pairs of a folder, and a page

    [bold]overlapper clashes gearbox.step --expect "bolt*,plate" --least-depth 1e-5[/bold]  a test of an assembly
    """
    refuse_threshold(concave_threshold)
    refuse_table(out)
    pairs = expected_pairs(expect)
    settings: dict[str, Any] = {
        "units": units,
        "least_depth": least_depth,
        "expect": expect or [],
        "concave": concave,
        "concave_threshold": concave_threshold,
    }
    written: list[Path] = []
    with input_refusals(), quiet():
        from overlapper.audit import clashes as scene
        from overlapper.tables.outputs import can_be_written

        can_be_written(out, html)
        parts, failures = scene.read(sources, units)
        if len(parts) < 2:
            for failure in failures[:-1]:
                say(f"overlapper: {failure}", sys.stderr)
            if failures:
                raise Refused(failures[-1])
            raise Refused(f"at least two bodies are needed, not {len(parts)}")
        found = scene.clashes(parts, concave == "enclose", concave_threshold, least_depth, pairs)
        found.failures[:0] = failures
        if out:
            scene.write_table(found, out, settings)
            written.append(out)
        if html:
            scene.write_page(found, html)
            written.append(html)
    code = 2 if found.failures else 1 if found.of_status("clash") else 0
    if as_json:
        files = {name: str(path) for name, path in (("out", out), ("html", html)) if path in written}
        print(json.dumps({"settings": settings} | _facts(found) | files))
    else:
        _show(found, written)
        for failure in found.failures:
            say(f"overlapper: {failure}", sys.stderr)
    raise typer.Exit(code)


def body_facts(body: MeshBody) -> dict[str, Any]:
    """The facts of a body, for JSON."""
    return {
        "name": body.name,
        "way": body.way,
        "parts": len(body.parts),
        "parts_volume_m3": body.parts_volume,
        "mesh_volume_m3": body.mesh_volume,
        "excess": body.excess,
    }


def _facts(found: Clashes) -> dict[str, Any]:
    return {
        "bodies": [body_facts(body) for body in found.bodies],
        "pairs": [
            {
                "names": pair.names,
                "status": pair.status,
                "volume_m3": pair.volume,
                "volume_error_m3": pair.volume_error,
                "volume_of": "meshes" if pair.of_meshes else "parts",
                "parts_volume_m3": pair.parts.volume if pair.parts is not None else None,
                "depth_m": pair.depth,
                "normal": pair.parts.normal.tolist() if pair.parts is not None else None,
            }
            for pair in found.pairs
        ],
        "failures": found.failures,
        "remarks": found.remarks,
    }


def _show(found: Clashes, written: list[Path]) -> None:
    from overlapper.audit.clashes import Status

    count = len(found.bodies)
    if found.pairs:
        if count <= IN_MATRIX:
            say(f"Volumes in {volume_unit(found.pairs[0].volume)} above the diagonal, depths in mm below it:")
            show(_matrix(found))
            say("")
        show(_list(found))
        say(CAPTION + (f" The {LISTED} largest of {len(found.pairs):,} pairs." if len(found.pairs) > LISTED else ""))
    clashing, expected, shallow, touching = (len(found.of_status(status)) for status in get_args(Status))
    words = [f"{clashing or 'none'} {'clash' if clashing > 1 else 'clashes'}"]
    words += [f"{expected:,} {'overlap' if expected > 1 else 'overlaps'} as expected"] if expected else []
    words += [f"{shallow:,} {'are' if shallow > 1 else 'is'} shallow"] if shallow else []
    words += [f"{touching:,} {'touch' if touching > 1 else 'touches'}"] if touching else []
    pairs = count * (count - 1) // 2
    say(f"Of {pairs:,} pair{'s' * (pairs > 1)} of {count:,} bodies, {', '.join(words)}.")
    for line in (*found.remarks, *(f"Written: {path}" for path in written)):
        say(line)


def _matrix(found: Clashes) -> Table:
    """Volumes above the diagonal, depths below it."""
    unit = volume_unit(found.pairs[0].volume)
    table = plain_table()
    table.add_column("body", overflow="fold")
    for k in range(len(found.bodies)):
        table.add_column(str(k + 1), justify="right", no_wrap=True)
    cells = [["·" if i == k else "" for k in range(len(found.bodies))] for i in range(len(found.bodies))]
    for pair in found.pairs:
        i, k = pair.pair
        cells[i][k] = _volume(pair, unit)
        cells[k][i] = _depth(pair)
    for k, (body, row) in enumerate(zip(found.bodies, cells)):
        table.add_row(Text(f"{k + 1} {printable(body.name)}"), *row)
    return table


def _list(found: Clashes) -> Table:
    """The largest pairs, two lines each."""
    unit = volume_unit(found.pairs[0].volume)
    table = plain_table("Pairs that overlap or touch")
    table.add_column("pair", overflow="fold")
    for header in ("", f"volume\n{unit}", f"±\n{unit}", "depth\nmm", "convex\nparts"):
        table.add_column(header, justify="right" if header else "left", no_wrap=True)
    for pair in found.pairs[:LISTED]:
        first, second = (found.bodies[i] for i in pair.pair)
        table.add_row(
            Text(f"{printable(first.name)}\n {printable(second.name)}"),
            pair.status,
            _volume(pair, unit) + "*" * (not pair.of_meshes),
            f"{ROUNDED_UP.create_decimal(pair.volume_error / VOLUME_UNITS[unit]):e}",
            _depth(pair),
            f"{parts_text(first)}\n{parts_text(second)}" if pair.parts is not None else "",
        )
    return table


def _volume(pair: Clash, unit: str) -> str:
    return f"{pair.volume / VOLUME_UNITS[unit]:.4g}"


def _depth(pair: Clash) -> str:
    return "" if pair.depth is None else f"{1e3 * pair.depth:.3g}"


def parts_text(body: MeshBody) -> str:
    """How many convex parts stand for a body, and how much more volume they have than its mesh."""
    if body.way == "convex":
        return "itself"
    count = "hull" if body.way == "hull" else str(len(body.parts))
    return f"{count}, open" if body.excess is None else f"{count}, {body.excess:+.1%}"
