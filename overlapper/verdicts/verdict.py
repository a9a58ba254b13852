"""The changes in a scene since it was recorded.

Three causes are distinguished. Geometry is this package: it measures the recorded shapes and poses again. Shapes come
from the models, as they are read today. Dynamics come from the simulator: its poses of the shapes today.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from overlapper import Shape
from overlapper.polytopes.shape_text import alike
from overlapper.shapes.table import facts
from overlapper.simulation.model import Skipped
from overlapper.tables.still import Still
from overlapper.verdicts.comparison import (
    Differences,
    Move,
    compare_forces,
    compare_measures,
    compare_poses,
    loose_budgets,
    shape_label,
)
from overlapper.verdicts.expected import HUNDREDTHS, Expected
from overlapper.verdicts.replay import measured, replay, rounding


@dataclass(frozen=True, slots=True)
class Verdict:
    """The changes in a scene since it was recorded, by cause.

    `geometry`: overlaps of the recorded shapes and poses, measured by today's package. `shapes`: shapes of today's
    simulation. `dynamics`: poses of today's simulation, and forces of volumetric contact. `overlaps`: changes of the
    overlaps because of shapes and dynamics; empty if both are as recorded. `notes`: sentences about budgets that do not
    fit, and about what is not modelled. `today` has the steps as they are today, `expected.stills` the recorded steps.
    """

    expected: Expected
    geometry: list[Move]
    shapes: list[Move]
    dynamics: list[Move]
    overlaps: list[Move]
    notes: list[str]
    today: dict[int, Still] = field(repr=False)

    @property
    def causes(self) -> dict[str, list[Move]]:
        """The moves of each of the three causes."""
        return {"geometry": self.geometry, "shapes": self.shapes, "dynamics": self.dynamics}

    @property
    def moves(self) -> list[Move]:
        """All moves, the worst first; empty if everything is as recorded."""
        return sorted((move for moves in self.causes.values() for move in moves), key=lambda move: -move.part)

    @property
    def worst_step(self) -> int:
        """The step of the worst move: the largest move with a finite size, or else the first move."""
        measured = [move for move in self.moves if math.isfinite(move.part)]
        return (measured or self.moves)[0].step

    def lines(self, limit: int = 5) -> list[str]:
        """The verdict on each cause, with its `limit` worst moves."""
        sections = {
            "geometry": (self.geometry, "overlaps of the recorded shapes and poses, measured today"),
            "shapes": (self.shapes, "shapes of the models, read today"),
            "dynamics": (self.dynamics, "poses and forces of the simulation of today"),
        }
        if self.overlaps:
            sections["overlaps"] = (self.overlaps, "overlaps of the simulation of today that changed by more than 1 %")
        lines = []
        for cause, (moves, meaning) in sections.items():
            lines.append(f"{cause:9} {f'{len(moves):,} moved' if moves else 'as recorded'} ({meaning})")
            lines += [f"    {move}" for move in sorted(moves, key=lambda move: -move.part)[:limit]]
            if len(moves) > limit:
                lines.append(f"    and {len(moves) - limit:,} more")
        return lines + [f"note      {note}" for note in self.notes]


def examine(expected: Expected, today: dict[int, Still], last_step: int) -> Verdict:
    """Compare a scene as it is `today`, by step, with its recording. Its last step is `last_step`."""
    names = {link: name for still in today.values() for link, name in still.names.items()}
    geometry = compare_measures(expected.rows, replay(expected), expected.budgets, names)
    placed = [row for step, still in today.items() for row in still.placements(step)]
    dynamics = compare_poses(expected.rows, placed, expected.budgets, names)
    if any(still.forces is not None for still in today.values()):
        forces = compare_forces(expected.rows, measured(today, expected.tolerance), expected.budgets, names)
        dynamics = Differences(dynamics.moves + forces.moves, dynamics.spent | forces.spent)
    shapes = _shape_moves(expected.stills, today, last_step, names)
    overlaps: list[Move] = []
    if shapes or dynamics.moves:
        changes = compare_measures(expected.rows, measured(today, expected.tolerance), HUNDREDTHS, names).moves
        overlaps = [replace(move, allowed=math.nan) for move in changes if move.quantity != "volume_error_m3"]
    notes = _notes(geometry, rounding(expected), dynamics) + left_out(today)
    return Verdict(expected, geometry.moves, shapes, dynamics.moves, overlaps, notes, today)


def left_out(stills: Mapping[int, Still]) -> list[str]:
    """A sentence for each shape or body that is not modelled in some of the steps."""
    steps: dict[Skipped, list[int]] = {}
    for step, still in stills.items():
        for each in still.skipped:
            steps.setdefault(each, []).append(step)
    return [
        f"not modelled: {each.name}, {each.reason}"
        + (f" (in step {', '.join(map(str, some))})" if len(some) < len(stills) else "")
        for each, some in steps.items()
    ]


def _shape_moves(
    before: dict[int, Still], today: dict[int, Still], last_step: int, names: dict[tuple[int, int], str]
) -> list[Move]:
    """The shapes that differ from the recorded shapes, each in the first step where it differs."""
    moves: dict[str, Move] = {}
    for step, recorded in before.items():
        if step not in today:
            moves.setdefault("", Move(step, "the scene", "last step", str(step), str(last_step)))
            continue
        was, now = (dict(zip(still.keys, still.shapes)) for still in (recorded, today[step]))
        for k in sorted(was.keys() | now.keys()):
            if k not in was or k not in now or not alike(was[k], now[k]):
                who = shape_label(k, names)
                moves.setdefault(who, Move(step, who, "shape", _described(was.get(k)), _described(now.get(k))))
    return list(moves.values())


def _described(shape: Shape | None) -> str:
    if shape is None:
        return "not there"
    _, _, corners = facts(shape).words()
    return f"{shape} of {shape.volume:.9g} m³" if corners else str(shape)


def _notes(geometry: Differences, shaken: dict[str, float], dynamics: Differences) -> list[str]:
    """Sentences on budgets that do not fit: ten times wider than moves and rounding need, or narrower than rounding."""
    needed = {name: max(part, shaken[name]) for name, part in geometry.spent.items()}
    if not dynamics.moves:
        needed |= dynamics.spent
    notes = [
        f"the budget of {name} is too narrow: rounding errors are {part:.3g} times as large "
        "when everything is moved by a metre"
        for name, part in shaken.items()
        if part > 1
    ]
    return notes + loose_budgets(Differences([], needed, geometry.error_gain))
