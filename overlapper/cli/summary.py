"""The result of a run in words: a line per pair of links, and remarks below."""

from __future__ import annotations

from collections.abc import Mapping

from rich.markup import escape
from rich.table import Table
from rich.text import Text

from overlapper.cli.figures import ROUNDED_UP, VOLUME_UNITS, plain_table, volume_unit
from overlapper.printable import printable
from overlapper.reference import NAMES
from overlapper.simulation import Decomposed, Skipped
from overlapper.tables.summary import Summary


def overlaps_table(summary: Summary, limit: int = 20, title: str = "") -> Table:
    """The `limit` largest pairs, explained for a reader who does not know this program. There must be at least one.

    `title` is by default the name of the scene.
    """
    pairs = summary.largest()
    unit = volume_unit(pairs[0].volume)
    left_out = f"\nThe {limit} largest of {len(pairs)} pairs." if len(pairs) > limit else ""
    name = escape(printable(title or summary.scene))
    table = plain_table(
        title=f"Overlaps of {name} in {summary.steps} steps, {summary.seconds:.3g} s",
        caption="Volume: the largest in any step, with error bound ±. Depth: the shortest translation that separates "
        "the two links, or their two deepest shapes, in the step with the largest depth. Normal: the direction of this "
        "translation, for the first link." + " Force: the largest between the two links." * summary.forces + left_out,
    )
    # Two lines a pair and narrow numbers, so that a terminal of 80 columns holds the table.
    table.add_column("pair of links", overflow="fold")
    headers = ["steps", f"volume\n{unit}", f"±\n{unit}", "depth\nmm", "normal\nx, y, z", "at\nstep"]
    for header in headers + ["force\nN"] * summary.forces:
        table.add_column(header, justify="right", no_wrap=True)
    for pair in pairs[:limit]:
        table.add_row(
            Text("\n ".join(map(printable, pair.names))),
            str(pair.steps),
            f"{pair.volume / VOLUME_UNITS[unit]:.4g}",
            f"{ROUNDED_UP.create_decimal(pair.volume_error / VOLUME_UNITS[unit]):e}",
            f"{1e3 * pair.depth:.3g}",
            " ".join(f"{round(component, 2) + 0.0:+.2f}" for component in pair.normal),
            str(pair.depth_step),
            *[f"{pair.force:.3g}"] * summary.forces,
        )
    return table


def remarks(summary: Summary, limit: int = 10) -> list[str]:
    """The lines below the table: what was modelled, what was not, and the first `limit` disagreements."""
    lines = str(summary.report).splitlines() if summary.report else []
    lines += _between_lines(summary, limit)
    lines += skipped_lines(summary.skipped)
    lines += [_decomposed(each) for each in summary.decomposed]
    if summary.verdicts:
        counts = ", ".join(f"{count:,} {verdict}" for verdict, count in summary.verdicts.most_common())
        lines.append(
            f"{NAMES[summary.check]} on {sum(summary.verdicts.values()):,} pairs that overlap or touch: {counts}."
        )
    for each in summary.disagreements[:limit]:
        lines.append(f"  step {each.step}, {' – '.join(each.names)}, {each.verdict}: {each.explanation}")
    if len(summary.disagreements) > limit:
        rest = len(summary.disagreements) - limit
        lines.append(f"  and {rest:,} more, each explained in the table of --out and in the output of --json.")
    return lines


def _between_lines(summary: Summary, limit: int) -> list[str]:
    """The lines on pairs that met between two steps."""
    if not summary.between:
        return []
    found, rest = summary.tunnelled, len(summary.tunnelled) - limit
    pairs = "one pair" if len(found) == 1 else f"{len(found):,} pairs"
    lines = [f"Tunnelled: {pairs} of links passed through each other within a step."]
    for each in found[:limit]:
        at = ", ".join(f"{part:.4g}" for part in each.point)
        names = " – ".join(map(printable, each.names))
        lines.append(f"  step {each.step}, {names}: they met after {each.fraction:.4g} of the step, at {at} m")
    if rest > 0:
        lines.append(f"  and {rest:,} more, each in the table of --out and in the output of --json.")
    if summary.undecided:
        lines.append(f"Undecided: for {summary.undecided:,} pairs of shapes it is not known when they met in a step.")
    return lines


def skipped_lines(skipped: Mapping[Skipped, int]) -> list[str]:
    """A line for each shape or body that is left out; `skipped` has the first step without it."""
    return [
        f"Not modelled{f' from step {step} on' if each.diverged else ''}: {each.name}, {each.reason}."
        for each, step in skipped.items()
    ]


def _decomposed(mesh: Decomposed) -> str:
    parts = f"{len(mesh.shapes)} convex parts" if len(mesh.shapes) > 1 else "one convex part"
    bounds = "surface is open" if mesh.mesh_volume is None else f"mesh bounds {mesh.mesh_volume:.4g} m³"
    kept = f"; kept in {mesh.path}" if mesh.path else ""
    return f"Concave: {mesh.name} is {parts} of {mesh.volume:.4g} m³ together, the {bounds}{kept}."
