"""The recording of a scene: its expected file, and the allowed difference of each quantity.

An expected file is a CSV table. It has the shapes, the poses and the measures of some steps of a scene, so that each of
the three can be compared separately.
"""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path

from overlapper import Shape
from overlapper.polytopes.shape_text import shape_of, text_of
from overlapper.printable import printable
from overlapper.tables.still import Still
from overlapper.tables.table import COLUMNS, Key, Row
from overlapper.tables.table import FORCES as FORCE_COLUMNS
from overlapper.tables.table_file import Content, CsvTable, read_content

# The beginning of a comment with shapes: each shape as text, and the (body, link, shape) that have it.
SHAPES = "shapes "

# A shape that meets no other has a row with the status "alone". Its columns of B and its measures are empty. So the
# poses of all shapes of a step are in the file, and a new pair is noticed.
EXPECTED_COLUMNS = [name for name in COLUMNS if name not in ("time_s", "nameA", "nameB", "fcl", "fcl_explanation")]


@dataclass(frozen=True, slots=True)
class Budget:
    """The allowed difference from a recorded value: `absolute` (SI units) + `relative` times the recorded value."""

    relative: float
    absolute: float

    def allowed(self, recorded: float) -> float:
        """The largest difference that is within the budget."""
        return self.absolute + self.relative * abs(recorded)

    def spent(self, difference: float, recorded: float) -> float:
        """The part of the budget that a difference uses; above 1, the difference is too large."""
        if difference == 0:
            return 0.0
        allowed = self.allowed(recorded)
        if math.isinf(allowed):
            return 0.0 if math.isfinite(difference) else math.inf
        return difference / allowed if allowed else math.inf


# The default budgets of a scene of polyhedra: five times the effect of rounding when all poses of the scenes were moved
# by less than a metre. Volumes changed by a relative 2e-10 at most, and centroids by 3e-12 m at most. A new file gets
# budgets fitted to its own scene instead.
ROUNDING = {
    "volume": Budget(1e-9, 0.0),
    "centroid": Budget(0.0, 1.5e-11),
    "area": Budget(1e-9, 0.0),
    "depth": Budget(1e-9, 1e-15),
    "normal": Budget(0.0, 1e-12),
}

# The allowed change of poses, in m and rad. It is larger than the effect of another machine's sine on motions that are
# not chaotic, and small enough that a grasp is still the same.
DRIFT = {"position": Budget(0.0, 1e-4), "orientation": Budget(0.0, 1e-3)}

# The allowed change of forces, torques and energies of volumetric contact: a hundredth of the recorded value, plus the
# weight of a gram, its torque on an arm of a centimetre, and its work over a tenth of a millimetre.
FORCES = {"force": Budget(0.01, 0.01), "torque": Budget(0.01, 1e-4), "energy": Budget(0.01, 1e-6)}

# If bodies have moved or have other shapes, changes of the overlaps above a hundredth are reported.
HUNDREDTHS = {"volume": Budget(0.01, 0.0), "depth": Budget(0.01, 0.0)}


@dataclass(frozen=True, slots=True)
class Expected:
    """The recording of a scene in some of its `steps`, at `tolerance`, and the budget of each quantity.

    `rows` are the overlaps of those steps. `stills` are the shapes and poses, by step.
    """

    steps: list[int]
    tolerance: float
    budgets: dict[str, Budget]
    rows: list[Row] = field(default_factory=list)
    stills: dict[int, Still] = field(default_factory=dict)

    def write(self, path: Path, origin: dict[str, str]) -> None:
        """Write the file. Users may edit the budgets in its first lines if these do not fit."""
        heading = {"steps": " ".join(map(str, self.steps)), "tolerance": repr(self.tolerance)}
        heading |= {
            f"budget {name}": f"relative {each.relative!r} absolute {each.absolute!r}"
            for name, each in self.budgets.items()
        }
        path.parent.mkdir(parents=True, exist_ok=True)
        forces = [*FORCE_COLUMNS] if any("energy_j" in row for row in self.rows) else []
        table = CsvTable(path, heading | origin, EXPECTED_COLUMNS + forces)
        try:
            self._write_steps(table)
            table.close()
        except BaseException:
            # An incomplete expected file is of no use.
            if left := table.leave():
                left.unlink()
            raise

    def _write_steps(self, table: CsvTable) -> None:
        known: dict[Key, str] = {}
        for step, rows in _by_step(self.rows):
            still = self.stills[step]
            texts = {shape_key: text_of(shape) for shape_key, shape in zip(still.keys, still.shapes)}
            new = {shape_key: text for shape_key, text in texts.items() if known.get(shape_key) != text}
            for text in dict.fromkeys(new.values()):
                users = " ".join("/".join(map(str, each)) for each, its in new.items() if its == text)
                table.comment(f"{SHAPES}{users}: {text}")
            known |= new
            table.write(rows)


def read_expected(path: Path) -> Expected:
    """Read an expected file. FileNotFoundError if it is missing, ValueError if it is invalid or incomplete."""
    return expected_in(read_content(path), path)


def expected_in(content: Content, path: Path) -> Expected:
    """The expected values in the content of the file at `path`. ValueError if it is not an expected file."""
    steps, tolerance = (content.metadata.get(name, "") for name in ("steps", "tolerance"))
    if not (re.fullmatch(r"[\d ]*\d", steps, re.ASCII) and re.fullmatch(r"[-+.e\d]+", tolerance, re.ASCII)):
        raise ValueError(f"{path} must say `# steps: <numbers>` and `# tolerance: <number>` in its first lines")
    budgets = budgets_in(content.metadata, path)
    try:
        expected = Expected([*map(int, steps.split())], float(tolerance), budgets, content.rows, _stills(content))
        if not 0 < expected.tolerance < 1:
            raise ValueError(f"its tolerance must lie between 0 and 1, not {expected.tolerance}")
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    return expected


def has_shapes(content: Content) -> bool:
    """Whether a table has the shapes of its steps, as an expected file has."""
    return any(comment.startswith(SHAPES) for _, comment in content.comments)


def budgets_in(metadata: Mapping[str, str], path: Path) -> dict[str, Budget]:
    """The budgets in the metadata of the table at `path`. ValueError if a budget names no known quantity."""
    budgets: dict[str, Budget] = {}
    for heading, text in metadata.items():
        parts = re.fullmatch(r"relative (\S+) absolute (\S+)", text)
        if not heading.startswith("budget ") or parts is None:
            continue
        name = heading.removeprefix("budget ")
        if name not in (known := ROUNDING | DRIFT | FORCES):
            raise ValueError(f"{path} has a budget for {name[:60]!r}, which must be one of {', '.join(known)}")
        try:
            relative, absolute = map(float, parts.groups())
        except ValueError:
            relative = math.nan
        if not (relative >= 0 and absolute >= 0):
            told = printable(" and ".join(parts.groups())[:60])
            raise ValueError(f"{path} must have two numbers from 0 as budget of {name}, not {told}")
        budgets[name] = Budget(relative, absolute)
    return budgets


def _by_step(rows: Iterable[Row]) -> Iterator[tuple[int, list[Row]]]:
    for step, group in groupby(rows, lambda row: int(row["step"] or 0)):
        yield step, list(group)


def _stills(content: Content) -> dict[int, Still]:
    """The shapes and poses of every step. A comment `shapes` is valid for the rows below it, up to the next one."""
    said = deque((above, text) for above, text in content.comments if text.startswith(SHAPES))
    known: dict[Key, Shape] = {}
    stills: dict[int, Still] = {}
    above = 0
    for step, rows in _by_step(content.rows):
        while said and said[0][0] <= above:
            users, _, words = said.popleft()[1].removeprefix(SHAPES).partition(": ")
            shape = shape_of(words)
            known |= {_key(user): shape for user in users.split()}
        if step in stills:
            raise ValueError(f"the rows of step {step} are not all together")
        try:
            stills[step] = Still.recorded(rows, known)
        except KeyError as error:
            lacking = "/".join(map(str, error.args[0]))
            raise ValueError(f"no line `# shapes` has the shape {lacking} of step {step}") from None
        above += len(rows)
    return stills


def _key(text: str) -> Key:
    try:
        body, link, shape = map(int, text.split("/"))
    except ValueError:
        raise ValueError(f"{text[:60]!r} must be body/link/shape, such as 0/-1/0") from None
    return body, link, shape
