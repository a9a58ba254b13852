"""Makes expected files from today's simulation, and measures recorded shapes and poses without a simulator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from overlapper.columns import MEASURES
from overlapper.tables.still import Still
from overlapper.tables.table import Row
from overlapper.verdicts.comparison import compare_measures
from overlapper.verdicts.expected import DRIFT, FORCES, ROUNDING, Budget, Expected

# The displacements, in m, of a scene that show how much rounding alone changes its measures.
ASIDES = ((0.3, 0.7, 0.1), (-0.2, 0.4, 0.9), (0.6, -0.5, -0.3))


def wanted(last_step: int, forces: bool) -> Expected:
    """The steps and budgets to record for a scene without an expected file: four steps, and the default budgets."""
    steps = sorted({max(last_step * quarter // 4, 1) for quarter in (1, 2, 3, 4)})
    return Expected(steps, 1e-3, ROUNDING | DRIFT | (FORCES if forces else {}))


def observed(wanted: Expected, today: dict[int, Still]) -> Expected:
    """The recording of the scene as it is `today`, with the steps, the tolerance and the budgets of `wanted`."""
    return replace(wanted, rows=measured(today, wanted.tolerance), stills=today)


def fitted(made: Expected) -> Expected:
    """The recording with budgets of five times what rounding needs, to one digit. The other budgets stay."""
    needed = {
        name: Budget(*(float(f"{5 * part * each:.0e}") for each in (budget.relative, budget.absolute)))
        for name, part in rounding(made).items()
        for budget in [made.budgets[name]]
        if part
    }
    return replace(made, budgets=made.budgets | needed)


def measured(stills: Mapping[int, Still], tolerance: float) -> list[Row]:
    """The rows of all steps, measured by today's geometry."""
    return [row for step, still in stills.items() for row in still.rows(step, tolerance)]


def rounding(expected: Expected) -> dict[str, float]:
    """The largest part of each budget that rounding uses when all bodies are moved by less than a metre."""
    spent = [compare_measures(expected.rows, replay(expected, aside), expected.budgets).spent for aside in ASIDES]
    return {name: max(each[name] for each in spent) for name in spent[0]}


def replay(expected: Expected, moved_by: Sequence[float] = (0.0, 0.0, 0.0)) -> list[Row]:
    """Measure the shapes and poses of an expected file with today's geometry, without a simulator. Returns the rows.

    With `moved_by`, in m, the bodies are moved before they are measured, and the rows are moved back. Differences are
    then due to rounding.
    """
    moved = {step: still.moved(moved_by) for step, still in expected.stills.items()}
    table = measured(moved, expected.tolerance)
    for row in table:
        for column, distance in zip(MEASURES["centroid"], moved_by):
            if row.get(column) is not None:
                row[column] = float(row[column] or 0.0) - distance
    return table
