"""Scenes run, written down, and compared with what was written down before.

The expected file of a scene has the poses and the measures of some of its steps, so that geometry is compared on equal
input, whatever the simulator of the day makes of the scene.
"""

from __future__ import annotations

import math
import re
from collections.abc import Container, Generator, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from overlapper import Shape, _core
from overlapper.scene import Scene, SceneError, Step, broken, load_scene
from overlapper.simulation import Bodies, Contact
from overlapper.table import COLUMNS, POSE, Row, Value, key, placements, rows
from overlapper.table_file import CsvTable, read_csv

try:
    import pybullet
except ImportError as error:
    raise ImportError("overlapper.regression needs pybullet: pip install 'overlapper[sim]'") from error

__all__ = [
    "Budget",
    "Differences",
    "Expected",
    "Frame",
    "Scene",
    "SceneError",
    "compare",
    "load_scene",
    "loose_budgets",
    "read_expected",
    "record",
    "replay",
    "run",
]


@dataclass(frozen=True, slots=True)
class Frame:
    """The state after `step` steps, `time` seconds into the simulation; `bodies` is the same object in every frame."""

    step: int
    time: float
    bodies: Bodies
    contacts: list[Contact]


def run(
    scene: Scene,
    steps: int | None = None,
    tolerance: float = 1e-3,
    method: Literal["auto", "paper"] = "auto",
    only: Container[int] | None = None,
) -> Generator[Frame, None, None]:
    """Build the scene in a client of its own and step it, `scene.steps` times by default.

    Every step is a frame, the first has number 1; or only those in `only`, if given. `tolerance` and `method` are those
    of `overlapper.overlap`. SceneError if the scene itself fails.
    """
    client = pybullet.connect(pybullet.DIRECT)
    try:
        step = _built(scene, client)
        bodies = Bodies(client)
        seconds = pybullet.getPhysicsEngineParameters(client)["fixedTimeStep"]
        for i in range(steps or scene.steps):
            _controlled(scene, step, i)
            pybullet.stepSimulation(client)
            if only is None or i + 1 in only:
                bodies.update()
                yield Frame(i + 1, (i + 1) * seconds, bodies, bodies.overlaps(tolerance, method))
    finally:
        pybullet.disconnect(client)


def _built(scene: Scene, client: int) -> Step | None:
    try:
        step = scene.build(client)
    except Exception as error:
        raise broken(scene.path, "cannot be built", error) from error
    if step is not None and not callable(step):
        raise SceneError(f"build(client) of {scene.path} must return None or a function step(i), not {step!r}")
    return step


def _controlled(scene: Scene, step: Step | None, i: int) -> None:
    if step is None:
        return
    try:
        step(i)
    except Exception as error:
        raise broken(scene.path, f"fails before step {i + 1}", error) from error


# The columns of an expected file. A shape that meets no other has a row with the status "alone", of which the columns
# of B and the measures are empty, so that every shape of a step is placed, and a pair out of nothing is noticed.
EXPECTED_COLUMNS = [name for name in COLUMNS if name not in ("time_s", "nameA", "nameB", "fcl", "fcl_explanation")]

# The measures that are compared, each with its columns.
QUANTITIES = {
    "volume": ["volume_m3"],
    "centroid": ["centroid_x_m", "centroid_y_m", "centroid_z_m"],
    "area": ["area_m2"],
    "depth": ["depth_m"],
    "normal": ["normal_x", "normal_y", "normal_z"],
}


@dataclass(frozen=True, slots=True)
class Budget:
    """How far a quantity may be from what was recorded: `absolute` (SI units) + `relative` times the recorded one."""

    relative: float
    absolute: float

    def spent(self, value: float, recorded: float) -> float:
        """The part of the budget that a difference uses up; above 1 is too far."""
        difference = abs(value - recorded)
        allowed = self.absolute + self.relative * abs(recorded)
        return difference / allowed if allowed else 0.0 if difference == 0 else math.inf


# The budgets of a scene of polyhedra: five times what rounding did to the scenes when all their poses were moved by
# less than a metre, which changed volumes by up to 2e-10 of themselves and centroids by up to 3e-12 m.
ROUNDING = {
    "volume": Budget(1e-9, 0.0),
    "centroid": Budget(0.0, 1.5e-11),
    "area": Budget(1e-9, 0.0),
    "depth": Budget(1e-9, 1e-15),
    "normal": Budget(0.0, 1e-12),
}


@dataclass(frozen=True, slots=True)
class Expected:
    """What was recorded of a scene: some of its `steps`, at `tolerance`, and the budget of each quantity."""

    steps: list[int]
    tolerance: float
    budgets: dict[str, Budget]
    rows: list[Row] = field(default_factory=list)

    def heading(self) -> dict[str, str]:
        """The first lines of the file, which are written by hand where the defaults do not do."""
        return {
            "steps": " ".join(map(str, self.steps)),
            "tolerance": repr(self.tolerance),
            **{
                f"budget {name}": f"relative {each.relative!r} absolute {each.absolute!r}"
                for name, each in self.budgets.items()
            },
        }


def read_expected(path: Path) -> Expected:
    """An expected file. FileNotFoundError if there is none."""
    heading = "".join(line for line in path.read_text(encoding="utf-8").splitlines(True) if line.startswith("#"))
    number = r"([-+.e\d]+)"
    steps = re.search(r"steps:? ([\d ]+)", heading)
    tolerance = re.search(rf"tolerance:? {number}", heading)
    if steps is None or tolerance is None:
        raise ValueError(f"{path} must say `# steps <numbers>` and `# tolerance <number>` in its first lines")
    budgets = re.findall(rf"budget (\w+): relative {number} absolute {number}", heading)
    return Expected(
        [int(step) for step in steps[1].split()],
        float(tolerance[1]),
        {name: Budget(float(relative), float(absolute)) for name, relative, absolute in budgets},
        read_csv(path),
    )


def record(scene: Scene) -> None:
    """Run the scene and write its expected file anew; the first lines of an old one stay in force."""
    try:
        old = read_expected(scene.expected)
    except FileNotFoundError:
        old = Expected([scene.steps * quarter // 4 for quarter in (1, 2, 3, 4)], 1e-3, ROUNDING)
    scene.expected.parent.mkdir(exist_ok=True)
    table = CsvTable(scene.expected, old.heading(), EXPECTED_COLUMNS)
    try:
        for frame in run(scene, only=old.steps):
            bodies = frame.bodies
            still = Still(bodies.keys, bodies.shapes, bodies.positions, bodies.orientations, bodies.names)
            table.write(still.rows(frame.step, old.tolerance))
    finally:
        table.close()


def replay(scene: Scene, expected: Expected, moved_by: Sequence[float] = (0.0, 0.0, 0.0)) -> list[Row]:
    """The rows that today's geometry makes of the poses of an expected file; the simulator only builds the scene.

    With `moved_by`, in m, all is moved before it is measured, and the rows are moved back: what differs is rounding.
    """
    client = pybullet.connect(pybullet.DIRECT)
    try:
        _built(scene, client)
        bodies = Bodies(client)
    finally:
        pybullet.disconnect(client)
    table: list[Row] = []
    for step, recorded in groupby(expected.rows, lambda row: int(row["step"] or 0)):
        poses = _poses(recorded)
        if poses.keys() != set(bodies.keys):
            raise ValueError(f"{scene.expected} does not have the shapes of the scene in step {step}: record it again")
        ordered = np.array([poses[shape] for shape in bodies.keys])
        still = Still(bodies.keys, bodies.shapes, ordered[:, :3] + moved_by, ordered[:, 3:], bodies.names)
        table += still.rows(step, expected.tolerance)
    for row in table:
        for column, distance in zip(QUANTITIES["centroid"], moved_by):
            if row.get(column) is not None:
                row[column] = _number(row, column) - distance
    return table


def _poses(recorded: Iterable[Row]) -> dict[tuple[Value, ...], list[Value]]:
    """Position and orientation of every shape in the rows of one step, by (body, link, shape)."""
    return {
        tuple(row[f"{word}{side}"] for word in ("body", "link", "shape")): [row[part.format(side)] for part in POSE]
        for row in recorded
        for side in ("A" if row["status"] == "alone" else "AB")
    }


@dataclass(frozen=True, slots=True)
class Still:
    """The shapes of a scene in one step, apart from the simulator; the fields are those of `simulation.Bodies`."""

    keys: list[tuple[int, int, int]]
    shapes: list[Shape]
    positions: NDArray[np.float64]
    orientations: NDArray[np.float64]
    names: dict[tuple[int, int], str]

    def rows(self, step: int, tolerance: float) -> list[Row]:
        """A row for each pair of shapes of different bodies that overlap or touch, and one for each shape alone."""
        contacts = self._contacts(tolerance)
        pairs = rows(step, 0.0, self, contacts)
        met = {shape for row in pairs for shape in (key(row)[:3], key(row)[3:])}
        alone = [row for shape, row in placements(self, "A").items() if shape not in met]
        return pairs + [{"step": step, **row, "status": "alone"} for row in alone]

    def _contacts(self, tolerance: float) -> list[Contact]:
        # Pairs of static bodies are in it, too: whether they may be left out is the simulator's business.
        pairs = _core.candidate_pairs(self.shapes, self.positions, self.orientations)
        bodies = np.array(self.keys)[:, 0]
        pairs = pairs[bodies[pairs[:, 0]] != bodies[pairs[:, 1]]]
        overlaps = _core.overlap_pairs(self.shapes, self.positions, self.orientations, pairs, tolerance)
        return [
            Contact(*self.keys[int(i)], *self.keys[int(j)], overlap)
            for (i, j), overlap in zip(pairs, overlaps)
            if overlap.status != "separated"
        ]


@dataclass(frozen=True, slots=True)
class Differences:
    """`failures`: a sentence for each row that is not as recorded.

    `spent`: the largest part of its budget that each quantity used up, 1 being all of it. `error_gain`: the sum of the
    certified errors of the volumes over what it was when recorded, below 1 if they have become better.
    """

    failures: list[str]
    spent: dict[str, float]
    error_gain: float


def compare(expected: Expected, found: list[Row]) -> Differences:
    """Pairs and statuses must be those recorded, measures within their budgets, certified errors much the same."""
    recorded = {(row["step"], *key(row)): row for row in expected.rows}
    now = {(row["step"], *key(row)): row for row in found}
    failures = [
        f"{_label(recorded[k])} is recorded as {recorded[k]['status']}, not found" for k in recorded.keys() - now
    ]
    failures += [f"{_label(now[k])} is {now[k]['status']}, not recorded" for k in now.keys() - recorded]
    spent = dict.fromkeys(expected.budgets, 0.0)
    for k in recorded.keys() & now.keys():
        failures += _row_failures(recorded[k], now[k], expected.budgets, spent)
    before, after = (sum(_number(row, "volume_error_m3") for row in rows) for rows in (expected.rows, found))
    return Differences(sorted(failures), spent, after / before if before else 1.0)


def _row_failures(old: Row, new: Row, budgets: dict[str, Budget], spent: dict[str, float]) -> list[str]:
    if old["status"] != new["status"]:
        return [f"{_label(old)} is {new['status']}, recorded as {old['status']}"]
    if old["status"] == "alone":
        return []
    failures = []
    for name, budget in budgets.items():
        parts = {column: budget.spent(_number(new, column), _number(old, column)) for column in QUANTITIES[name]}
        spent[name] = max(spent[name], *parts.values())
        failures += [
            f"{_label(old)}: {column} is {new[column]}, recorded as {old[column]}, {part:.3g} times its budget"
            for column, part in parts.items()
            if not part <= 1  # as it is for a value that is not a number
        ]
    # Ten times, for the bound of one pair depends on the order of operations: moving a scene multiplied one by 4.7.
    if _number(new, "volume_error_m3") > 10 * _number(old, "volume_error_m3"):
        failures.append(f"{_label(old)}: volume_error_m3 is {new['volume_error_m3']}, was {old['volume_error_m3']}")
    return failures


def loose_budgets(differences: Differences) -> list[str]:
    """A sentence for each budget that is ten times what these differences need, if there are any at all."""
    loose = [
        f"the budget of {name} is {1 / most:.3g} times what is needed"
        for name, most in differences.spent.items()
        if 0 < most < 0.1
    ]
    if differences.error_gain < 0.1:
        loose.append(f"the certified errors of the volumes are {differences.error_gain:.3g} of those recorded")
    return loose


def _number(row: Row, column: str) -> float:
    """A measure as a number; 0.0 where it has none, which is the same on both sides if the status is."""
    value = row.get(column)
    return float(value) if value is not None else 0.0


def _label(row: Row) -> str:
    a, b = ("/".join(str(part) for part in half) for half in (key(row)[:3], key(row)[3:]))
    return f"step {row['step']}, body/link/shape {a}" + ("" if row["status"] == "alone" else f" and {b}")
