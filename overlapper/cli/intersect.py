"""`overlapper intersect`: what polytopes of files and databases have in common."""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from overlapper.cli.clashes import body_facts, parts_text
from overlapper.cli.options import MethodOption
from overlapper.cli.refusals import Refused, input_refusals, quiet, say

if TYPE_CHECKING:
    from overlapper import Hull, Overlap

UNITS = {"volume": " m³", "area": " m²", "centroid": " m", "depth": " m", "distance": " m"}


def intersect(
    sources: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE_OR_URL...", help="Mesh files, and URLs of databases of polytopes.", show_default=False
        ),
    ],
    query: Annotated[
        str | None, typer.Option(help="SQL query that returns id, x, y, z: one row per point, ordered by id.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Write a mesh of the common part: .obj, .stl, .ply.")] = None,
    method: MethodOption = "auto",
    concave: Annotated[
        bool,
        typer.Option("--concave", help="Take two meshes as they are, concave or not. Default: their convex hulls."),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the lines.")] = False,
) -> None:
    """Measure the common part of two or more convex polytopes, without a simulator.

    A mesh file gives the convex hull of its points. A database, named by its SQLAlchemy URL, gives the polytopes that
    --query returns, or those that overlapper.write_polytopes stored. Lengths are read as metres. With --concave,
    volumes are those of the closed meshes. Depth, centroid and the mesh of --out are then those of the convex parts
    that CoACD makes of a concave mesh. The excess volume of the parts is printed, too.

    Examples:

    [bold]overlapper intersect bolt.stl plate.stl --out clash.stl[/bold]

    [bold]overlapper intersect sqlite:///parts.db[/bold]

    [bold]overlapper intersect postgresql+psycopg://me@host/db --query "SELECT part, x, y, z FROM p ORDER BY 1"[/bold]
    """
    from overlapper import overlap

    with input_refusals():
        if out:
            from overlapper.polytopes.mesh_file import check_ending, write_mesh

            check_ending(out)
        if concave:
            facts, pieces = _of_meshes(sources, method)
        else:
            hulls = [hull for source in sources for hull in _hulls(source, query)]
            if len(hulls) < 2:
                raise Refused(f"at least two polytopes are needed, not {len(hulls)}")
            common = overlap(*hulls, method=method)
            facts, pieces = _facts(common), [common] if common else []
        written = out if pieces else None
        if written:
            write_mesh(written, pieces)
    facts |= {"method": method, "out": str(written) if written else None}
    if as_json:
        print(json.dumps(facts))
        return
    for name, fact in facts.items():
        if name == "volume" or (fact and name not in ("volume_error", "method", "out", "bodies")):
            error = f" ± {facts['volume_error']:.1g}" if name == "volume" else ""
            print(f"{name:10}{_digits(fact)}{error}{UNITS.get(name, '')}")
    if out:
        say(f"Written: {out}" if written else f"Not written, as nothing is in common: {out}")


def _hulls(source: str, query: str | None) -> Iterator[Hull]:
    """The polytopes of one argument. Meshes that are not convex become their hulls, with a warning on stderr."""
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
            say(f"overlapper: {warning.message}", sys.stderr)
    yield hull


def _of_meshes(sources: Sequence[str], method: str) -> tuple[dict[str, Any], list[Overlap]]:
    """The overlap of two mesh files, concave or not, and the overlaps of the pairs of their convex parts."""
    if method != "auto":
        raise Refused("--concave and --method paper exclude each other: the method `paper` is for polytopes")
    if len(sources) != 2 or any("://" in source for source in sources):
        raise Refused("--concave takes two mesh files; overlapper clashes takes more, and measures all pairs")
    import numpy as np

    from overlapper.audit.clashes import clashes
    from overlapper.polytopes.mesh_file import MeshPart, read_triangles

    with quiet():
        found = clashes([(source, MeshPart(source, read_triangles(source), np.eye(4))) for source in sources])
    if found.failures:
        raise Refused(found.failures[0])
    for remark in found.remarks:
        say(f"overlapper: {remark}", sys.stderr)
    pair = found.pairs[0] if found.pairs else None
    parts = pair.parts if pair else None
    overlapping = pair is not None and pair.volume > pair.volume_error
    facts = {
        "polytopes": sum(len(body.parts) for body in found.bodies),
        "status": "overlapping" if overlapping else "touching" if pair else "separated",
        "volume": pair.volume if pair else 0.0,
        "volume_error": pair.volume_error if pair else 0.0,
        "centroid": parts.centroid.tolist() if parts is not None and parts.centroid is not None else None,
        "depth": pair.depth if pair else None,
        "normal": parts.normal.tolist() if parts is not None else None,
        "bodies": [body_facts(body) for body in found.bodies],
    }
    for body in found.bodies if parts is not None else ():
        if body.way != "convex":
            say(f"overlapper: convex parts of {body.name}: {parts_text(body)} of its volume", sys.stderr)
    return facts, [contact.overlap for contact in parts.contacts if contact.overlap] if parts is not None else []


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


def _digits(fact: Any) -> str:
    if isinstance(fact, list):
        return ", ".join(map(_digits, fact))
    return f"{fact:.9g}" if isinstance(fact, float) else str(fact)
