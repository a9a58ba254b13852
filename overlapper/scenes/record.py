"""What is recorded of a scene, and what today's geometry makes of it, without a simulator."""

from __future__ import annotations

from collections.abc import Sequence

from overlapper.scenes.parameters import heading_of
from overlapper.scenes.run import stills
from overlapper.scenes.scene import Scene
from overlapper.tables.still import Still
from overlapper.tables.table import Row
from overlapper.tables.table_file import origin
from overlapper.verdicts.comparison import compare_measures
from overlapper.verdicts.expected import DRIFT, FORCES, MEASURES, ROUNDING, Budget, Expected, read_expected

# Where a scene is put to see what rounding alone does to its measures, in m.
ASIDES = ((0.3, 0.7, 0.1), (-0.2, 0.4, 0.9), (0.6, -0.5, -0.3))


def record(scene: Scene) -> None:
    """Run the scene and write its expected file anew.

    The steps, the tolerance and the budgets of an old file stay in force. A new file has four steps and budgets of five
    times what rounding does to its measures when all is moved by less than a metre.
    """
    try:
        old = read_expected(scene.expected)
        made = _observed(scene, old)
    except FileNotFoundError:
        steps = sorted({max(scene.steps * quarter // 4, 1) for quarter in (1, 2, 3, 4)})
        forces = FORCES if scene.contact == "volumetric" else {}
        made = _observed(scene, Expected(steps, 1e-3, ROUNDING | DRIFT | forces))
        made.budgets.update(_needed(made))
    made.write(scene.expected, origin() | heading_of(scene.parameters))


def _observed(scene: Scene, wanted: Expected) -> Expected:
    """What the scene is today, in the steps wanted."""
    seen = stills(scene, wanted.steps)
    table = [row for step, still in seen.items() for row in still.rows(step, wanted.tolerance)]
    shapes = {step: dict(zip(still.keys, still.shapes)) for step, still in seen.items()}
    return Expected(wanted.steps, wanted.tolerance, dict(wanted.budgets), table, shapes)


def _needed(made: Expected) -> dict[str, Budget]:
    """Budgets of five times what rounding needs, to one digit; where it needs nothing, those made."""
    return {
        name: Budget(*(float(f"{5 * part * each:.0e}") for each in (budget.relative, budget.absolute)))
        for name, part in rounding(made).items()
        for budget in [made.budgets[name]]
        if part
    }


def rounding(expected: Expected) -> dict[str, float]:
    """The largest part of each budget of a measure that rounding takes when all is moved by less than a metre."""
    spent = [compare_measures(expected.rows, replay(expected, aside), expected.budgets).spent for aside in ASIDES]
    return {name: max(each[name] for each in spent) for name in spent[0]}


def replay(expected: Expected, moved_by: Sequence[float] = (0.0, 0.0, 0.0)) -> list[Row]:
    """The rows that today's geometry makes of the shapes and poses of an expected file, without a simulator.

    With `moved_by`, in m, all is moved before it is measured, and the rows are moved back: what differs is rounding.
    """
    table: list[Row] = []
    for step, recorded in expected.rows_by_step():
        table += Still.recorded(recorded, expected.shapes[step]).moved(moved_by).rows(step, expected.tolerance)
    for row in table:
        for column, distance in zip(MEASURES["centroid"], moved_by):
            if row.get(column) is not None:
                row[column] = float(row[column] or 0.0) - distance
    return table
