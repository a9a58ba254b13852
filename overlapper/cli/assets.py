"""`overlapper audit FOLDER`: what is wrong with the models and meshes of a folder."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import typer
from rich.text import Text

from overlapper.cli.figures import plain_table, show
from overlapper.cli.recorded import with_progress
from overlapper.cli.refusals import input_refusals, quiet, say
from overlapper.printable import printable
from overlapper.simulation.settings import Modelling, settings_of

if TYPE_CHECKING:
    from overlapper.audit.assets import Asset


def audit_folder(
    folder: Path, units: str, least_depth: float, modelling: Modelling, out: Path | None, as_json: bool
) -> NoReturn:
    """Report every asset, also in a table `out`. The exit code is 1 if anything is wrong with an asset."""
    told = {"units": units, "least_depth": least_depth, **settings_of(modelling)}
    with input_refusals(), quiet():
        from overlapper.audit.assets import asset_files, read_asset, write_table
        from overlapper.tables.outputs import can_be_written

        can_be_written(out, None)
        files = asset_files(folder)
        read = (read_asset(folder, file, units, least_depth, modelling) for file in files)
        assets = list(with_progress(read, folder.name, len(files)))
        if out:
            write_table(assets, out, told | {"folder": str(folder)})
    if as_json:
        rows = [asdict(asset) | {"sound": asset.sound} for asset in assets]
        print(json.dumps({"settings": told, "assets": rows} | ({"out": str(out)} if out else {})))
    else:
        _show(assets)
        if out:
            say(f"Written: {out}")
    raise typer.Exit(0 if all(asset.sound for asset in assets) else 1)


def _show(assets: Sequence[Asset]) -> None:
    table = plain_table()
    table.add_column("asset", overflow="fold")
    for header in ("", "bodies", "convex\nshapes", "closed", "their\nvolume", "overlap\nat rest"):
        table.add_column(header, justify="right" if header else "left", no_wrap=True)
    for asset in assets:
        row = [str(asset.bodies), str(asset.shapes), {True: "yes", False: "no", None: ""}[asset.closed]]
        row += ["" if asset.excess is None else f"{asset.excess:+.1%}", str(len(asset.overlaps))]
        table.add_row(Text(printable(asset.name)), asset.status, *(row if not asset.failure else [""] * 5))
    show(table)
    for asset in assets:
        if asset.failure:
            say(f"{asset.name} is not read: {asset.failure}.")
        for sentence in asset.skipped:
            say(f"{asset.name}, left out: {sentence}.")
        for each in asset.overlaps:
            names = " and ".join(each.names)
            say(f"{asset.name}, {names} share {each.volume:.3g} m³ at rest, {1e3 * each.depth:.3g} mm deep.")
    sound = sum(asset.sound for asset in assets)
    say(f"Of {len(assets):,} assets, {sound:,} {'is' if sound == 1 else 'are'} sound.")
