"""An audit as a table with a row for each pair of links, and as values for JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from overlapper.audit.audit import Audit, PairAudit
from overlapper.audit.robot import not_modelled
from overlapper.audit.tally import Array
from overlapper.tables.table import Row, Value
from overlapper.tables.table_file import TABLES, origin

# Every column, in order, with its type; the unit is in the name. `adjacent` is 1 or 0, and so is `at_rest`:
# whether the pair overlaps in configuration 0. Joints are JSON, by name, in rad and m. `page` links to the pose of the
# largest volume. `not_modelled` says which shapes of the links are left out. `proof` is the verdict of --prove. The
# next columns are the share of the joint positions that is open, the least distance seen, and its joints. Then follow
# the number of boxes, and why a pair was not searched.
COLUMNS: dict[str, type] = {
    "nameA": str,
    "nameB": str,
    "adjacent": int,
    "status": str,
    "asked": int,
    "overlapping": int,
    "at_rest": int,
    "fraction": float,
    "fraction_low": float,
    "fraction_high": float,
    "volume_m3": float,
    "volume_error_m3": float,
    "volume_configuration": int,
    "volume_joints": str,
    "depth_m": float,
    "depth_configuration": int,
    "depth_joints": str,
    "page": str,
    "not_modelled": str,
    "proof": str,
    "proof_open": float,
    "proof_distance_m": float,
    "proof_joints": str,
    "proof_boxes": int,
    "proof_why": str,
}


def write_table(audit: Audit, path: Path, settings: Mapping[str, Any], page: Mapping[tuple[int, int], str]) -> None:
    """Write a row for each pair of links. `page` has the link to the page's frame for each pair.

    OSError if the file cannot be written.
    """
    texts = {name: str(value) for name, value in settings.items()}
    table = TABLES[path.suffix](path, origin("bullet") | {"robot": audit.robot.name} | texts, COLUMNS)
    try:
        table.write(_row(audit, audited, page) for audited in audit.pairs)
    except BaseException:
        table.leave()
        raise
    table.close()


def facts(audit: Audit, page: Mapping[tuple[int, int], str]) -> list[dict[str, Any]]:
    """The rows as values for JSON; joints are objects."""
    made = []
    for audited in audit.pairs:
        row: dict[str, Any] = dict(_row(audit, audited, page))
        for name, pose in (("volume_joints", audited.largest), ("depth_joints", audited.deepest)):
            row[name] = _joints(audit, pose.values) if pose else None
        if row["proof_joints"]:
            row["proof_joints"] = json.loads(row["proof_joints"])
        made.append(row)
    return made


def _row(audit: Audit, audited: PairAudit, page: Mapping[tuple[int, int], str]) -> Row:
    fraction: tuple[Value, ...] = audited.fraction or (None,) * 3
    row: Row = {"nameA": audited.names[0], "nameB": audited.names[1], "adjacent": int(audited.pair.adjacent)}
    row |= {"status": audited.status, "asked": audited.asked, "overlapping": audited.met}
    row["at_rest"] = int(audited.at_rest)
    row |= dict(zip(("fraction", "fraction_low", "fraction_high"), fraction))
    for name, pose in (("volume", audited.largest), ("depth", audited.deepest)):
        row[f"{name}_configuration"] = pose.number if pose else None
        row[f"{name}_joints"] = json.dumps(_joints(audit, pose.values)) if pose else None
    if audited.largest and audited.deepest:
        shared = audited.largest.contact
        row |= {"volume_m3": shared.volume, "volume_error_m3": shared.volume_error}
        row["depth_m"] = audited.deepest.contact.depth
    row["page"] = page.get(audited.pair.links)
    left_out = not_modelled(audit.robot)
    row["not_modelled"] = "; ".join(f"{name}: {left_out[name]}" for name in audited.names if name in left_out) or None
    if proof := audit.proofs.get(audited.pair.links):
        row |= {"proof": proof.verdict, "proof_open": proof.open_share, "proof_boxes": proof.boxes}
        row |= {"proof_distance_m": proof.least, "proof_why": proof.why or None}
        row["proof_joints"] = json.dumps(_joints(audit, proof.values)) if proof.values is not None else None
    return {name: row.get(name) for name in COLUMNS}


def _joints(audit: Audit, values: Array) -> dict[str, float]:
    return dict(zip(audit.robot.columns, values.tolist()))
