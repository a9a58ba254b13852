"""The changes between two tables of a scene, each with its step, its pair, its quantity and its size."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from overlapper.columns import FORCE_MEASURES, MEASURES
from overlapper.tables.table import TUNNELLED, Row, Value, key, poses
from overlapper.verdicts.expected import Budget

Names = Mapping[tuple[int, int], str]


@dataclass(frozen=True, slots=True)
class Move:
    """A quantity of a pair of shapes, or of one shape, that is further from its recorded value than its budget allows.

    `part` is the difference divided by `allowed`. If nothing can be subtracted, as between two statuses, the difference
    and `part` are infinite. If the quantity has no budget, `allowed` is NaN, and `part` is in hundredths of the
    recorded value.
    """

    step: int
    who: str
    quantity: str
    recorded: str
    found: str
    difference: float = math.inf
    allowed: float = 0.0
    part: float = math.inf

    HEADS: ClassVar = ("step", "of", "quantity", "recorded", "today", "off by", "allowed", "times its budget")

    def cells(self) -> tuple[str, ...]:
        """The cells of a row of the table with the heads HEADS."""
        figures = ("", "", "")
        if math.isfinite(self.difference):
            allowed = "" if math.isnan(self.allowed) else f"{self.allowed:.3g}"
            figures = (f"{self.difference:.3g}", allowed, f"{self.part:.3g}" + " %" * math.isnan(self.allowed))
        return (str(self.step), self.who, self.quantity, self.recorded, self.found, *figures)

    def __str__(self) -> str:
        moved = f"step {self.step}, {self.who}: {self.quantity} is {self.found}, recorded as {self.recorded}"
        if not math.isfinite(self.difference):
            return moved
        if math.isnan(self.allowed):
            return f"{moved}: off by {self.difference:.3g}, {self.part:.3g} %"
        times = f", {self.part:.3g} times its budget" if math.isfinite(self.part) else ""
        return f"{moved}: off by {self.difference:.3g} where {self.allowed:.3g} is allowed{times}"


@dataclass(frozen=True, slots=True)
class Differences:
    """`moves`: the quantities that are too far from their recorded values, by step and pair.

    `spent`: for each quantity, the largest part of its budget that was used; 1 is the whole budget. `error_gain`: the
    sum of the certified errors of the volumes divided by the recorded sum; below 1 if the errors have become smaller.
    """

    moves: list[Move]
    spent: dict[str, float]
    error_gain: float = 1.0


def compare_measures(
    recorded: Sequence[Row], found: Sequence[Row], budgets: Mapping[str, Budget], names: Names | None = None
) -> Differences:
    """Pairs and statuses must be as recorded, measures within their budgets, and certified errors similar.

    Pairs that have tunnelled between two steps are not compared.
    """
    names = names or {}
    old, new = (
        {(_step(row), *key(row)): row for row in rows if row["status"] not in ("alone", TUNNELLED)}
        for rows in (recorded, found)
    )
    moves: list[Move] = []
    spent = {name: 0.0 for name in MEASURES if name in budgets}
    for k in sorted(old.keys() | new.keys(), key=lambda k: [-math.inf if part is None else part for part in k]):
        who = label(old.get(k) or new[k], names)
        was, now = (str(rows[k]["status"]) if k in rows else "not there" for rows in (old, new))
        if was != now:
            moves.append(Move(_step(old.get(k) or new[k]), who, "status", was, now))
        else:
            moves += _measure_moves(old[k], new[k], who, budgets, spent)
    before, after = (sum(_number(row, "volume_error_m3") for row in rows) for rows in (recorded, found))
    return Differences(moves, spent, after / before if before else 1.0)


def _measure_moves(
    old: Row, new: Row, who: str, budgets: Mapping[str, Budget], spent: dict[str, float]
) -> Iterator[Move]:
    for name in spent:
        for column in MEASURES[name]:
            was, now = _number(old, column), _number(new, column)
            part = budgets[name].spent(off_by(was, now), was)
            spent[name] = max(spent[name], part)
            if not part <= 1:  # also true for NaN
                allowed = budgets[name].allowed(was)
                yield Move(_step(old), who, column, _text(was), _text(now), off_by(was, now), allowed, part)
    # An error bound may have any value within the budget of the volume. A larger bound may grow tenfold, because the
    # bound of a pair depends on the order of operations. Moving a scene multiplied one bound by 4.7, and another way of
    # cutting multiplied one by 14.
    was, now = (_number(row, "volume_error_m3") for row in (old, new))
    allowed = max(10 * was, budgets["volume"].allowed(_number(old, "volume_m3")) if "volume" in budgets else 0.0)
    if now > allowed:
        part = now / allowed if allowed else math.inf
        yield Move(_step(old), who, "volume_error_m3", _text(was), _text(now), now - was, allowed - was, part)


def compare_forces(
    recorded: Sequence[Row], found: Sequence[Row], budgets: Mapping[str, Budget], names: Names | None = None
) -> Differences:
    """Compare forces, torques and energies, for pairs that are in both tables and have forces in at least one.

    Quantities without a budget are not compared.
    """
    names = names or {}
    old, new = ({(_step(row), *key(row)): row for row in rows} for rows in (recorded, found))
    moves: list[Move] = []
    spent = {name: 0.0 for name in FORCE_MEASURES if name in budgets}
    for k in sorted(old.keys() & new.keys(), key=lambda k: [-math.inf if part is None else part for part in k]):
        for name in spent:
            columns = FORCE_MEASURES[name]
            was, now = (np.array([_number(rows[k], column) for column in columns]) for rows in (old, new))
            size, difference = (float(np.linalg.norm(each)) for each in (was, now - was))
            part = 0.0 if np.array_equal(was, now, equal_nan=True) else budgets[name].spent(difference, size)
            spent[name] = max(spent[name], part)
            if not part <= 1:
                unit = columns[0].rpartition("_")[2]
                before, after = (_numbers(each) if len(each) > 1 else _text(float(each[0])) for each in (was, now))
                allowed = budgets[name].allowed(size)
                who = label(old[k], names)
                moves.append(Move(_step(old[k]), who, f"{name}_{unit}", before, after, difference, allowed, part))
    return Differences(moves, spent)


def compare_poses(
    recorded: Sequence[Row], found: Sequence[Row], budgets: Mapping[str, Budget], names: Names | None = None
) -> Differences:
    """Compare the poses of shapes that are in both tables: the distance from the recorded one in m, the angle in rad.

    Quantities without a budget are not compared.
    """
    names = names or {}
    old, new = poses(recorded), poses(found)
    moves = []
    spent = {"position": 0.0, "orientation": 0.0}
    for k in sorted(old.keys() & new.keys()):
        step, shape = k
        who = shape_label(shape, names)
        differences = {"position": 0.0, "orientation": 0.0}
        # A link of many shapes has no pose. Poses that are missing or NaN on both sides are equal.
        if not np.array_equal(old[k], new[k], equal_nan=True):
            differences["position"] = float(np.linalg.norm(new[k][:3] - old[k][:3]))
            differences["orientation"] = _angle(old[k][3:], new[k][3:])
        for (name, difference), unit, part_of in zip(differences.items(), ("m", "rad"), (slice(3), slice(3, 7))):
            budget = budgets.get(name, Budget(0.0, math.inf))
            part = budget.spent(difference, 0.0)
            spent[name] = max(spent[name], part)
            if not part <= 1:
                was, now = (_numbers(each[k][part_of]) for each in (old, new))
                moves.append(Move(step, who, f"{name}_{unit}", was, now, difference, budget.allowed(0.0), part))
    return Differences(moves, spent)


def _angle(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """The angle of the rotation from one unit quaternion to the other. Small angles keep their relative accuracy."""
    less, more = sorted((float(np.linalg.norm(a - b)), float(np.linalg.norm(a + b))))
    return 4 * math.atan2(less, more)


def loose_budgets(differences: Differences) -> list[str]:
    """A sentence for each budget that is ten times what these differences need. No sentence without differences."""
    loose = [
        f"the budget of {name} is {1 / most:.3g} times as large as needed"
        for name, most in differences.spent.items()
        if 0 < most < 0.1
    ]
    if differences.error_gain < 0.1:
        loose.append(f"the certified errors of the volumes are {differences.error_gain:.3g} of those recorded")
    return loose


def label(row: Row, names: Names) -> str:
    """The pair of a row as text: names, where there are any, and body/link/shape."""
    return " and ".join(shape_label(shape, names) for shape in (key(row)[:3], key(row)[3:]))


def shape_label(shape: tuple[Value, ...], names: Names) -> str:
    numbers = "/".join(map(str, shape))
    body, link, _ = shape
    name = names.get((int(body or 0), int(link or 0)))
    return f"{name} ({numbers})" if name else numbers


def _step(row: Row) -> int:
    return int(row["step"] or 0)


def _number(row: Row, column: str) -> float:
    """A measure as a number, 0.0 if it is missing. If the statuses are equal, it is missing on both sides."""
    value = row.get(column)
    return float(value) if value is not None else 0.0


def off_by(was: float, now: float) -> float:
    """The change of a measure. NaN differs from every number, but not from NaN."""
    return 0.0 if was == now or (math.isnan(was) and math.isnan(now)) else abs(now - was)


def _text(value: float) -> str:
    return f"{value:.12g}"


def _numbers(values: NDArray[np.float64]) -> str:
    return "(" + ", ".join(f"{value:.5g}" for value in values) + ")"
